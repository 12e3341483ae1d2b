//! Registry of plugins by kind and name, and their construction from a config.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::io::ErrorKind;
use std::path::PathBuf;

use crate::bounded::{FileLimit, read_text};
use crate::{
    ConfigError, ExportedNetwork, RecordedOffer, Remedy, Settings, Trainer, TrainingData,
    TrainingOffer, TrialValues, Value, commented_defaults, model_hint, nearest, parse_settings,
};
use tagalong_core::{
    Associator, Controller, Detector, DiffDrive, Error, Filter, Result, TrackManager, Verifier,
};

/// The six kinds of plugin.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// Finds people in images.
    Detector,
    /// Verifies detections.
    Verifier,
    /// Decides which detection belongs to which track.
    Associator,
    /// Estimates the states of people over time.
    Filter,
    /// Decides when tracks start, are confirmed, and end.
    Manager,
    /// Steers after the target.
    Controller,
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Detector => "detector",
            Self::Verifier => "verifier",
            Self::Associator => "associator",
            Self::Filter => "filter",
            Self::Manager => "track manager",
            Self::Controller => "controller",
        })
    }
}

impl Kind {
    /// Returns the kind with its article, for sentences.
    fn with_article(self) -> String {
        let article = if self == Self::Associator { "an" } else { "a" };
        format!("{article} {self}")
    }
}

/// Information available to a plugin when it is built.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Context {
    /// The seed of the run, already mixed with the plugin's place in the config.
    pub seed: u64,
    /// The directory against which paths in the config are resolved.
    pub base_dir: PathBuf,
    /// The drive of the robot.
    pub wheels: DiffDrive,
}

impl Context {
    /// Creates the information for a plugin: the seed of the run, the directory of the config, and the
    /// drive of the robot.
    pub fn new(seed: u64, base_dir: impl Into<PathBuf>, wheels: DiffDrive) -> Self {
        Self { seed, base_dir: base_dir.into(), wheels }
    }

    /// Returns a learned model: that of `file`, a path relative to the config, or the plugin's
    /// built-in one if the config names no file.
    ///
    /// # Errors
    /// [`Error::Model`] for a file that cannot be read or that `parse` refuses.
    pub fn model<M>(
        &self,
        file: &str,
        built_in: &str,
        parse: impl FnOnce(&str) -> std::result::Result<M, String>,
    ) -> Result<M> {
        if file.is_empty() {
            return parse(built_in).map_err(|why| Error::Model { path: String::new(), why });
        }
        let path = self.base_dir.join(file);
        let text = read_text(&path, FileLimit::Model).map_err(|error| {
            let is_missing = error.kind() == ErrorKind::NotFound;
            let hint = if is_missing { model_hint(&path, &[]) } else { String::new() };
            format!("{error}{hint}")
        });
        text.and_then(|text| parse(&text))
            .map_err(|why| Error::Model { path: path.display().to_string(), why })
    }
}

type Build<P> =
    Box<dyn Fn(Option<Value<'_>>, &Context) -> std::result::Result<P, ConfigError> + Send + Sync>;

enum Maker {
    Detector(Build<Box<dyn Detector>>),
    Verifier(Build<Box<dyn Verifier>>),
    Associator(Build<Box<dyn Associator>>),
    Filter(Build<Box<dyn Filter>>),
    Manager(Build<Box<dyn TrackManager>>),
    Controller(Build<Box<dyn Controller>>),
}

/// Entry of `tagalong list`, and output of `tagalong config`.
pub struct PluginInfo {
    /// The name used in configs.
    pub name: &'static str,
    /// Kind of plugin.
    pub kind: Kind,
    /// Description in one line.
    pub summary: &'static str,
    defaults: fn() -> String,
    schema: fn() -> serde_json::Value,
    maker: Maker,
}

impl PluginInfo {
    /// Returns the default settings as commented TOML.
    pub fn defaults(&self) -> String {
        (self.defaults)()
    }

    /// Returns the JSON schema of the settings.
    pub fn schema(&self) -> serde_json::Value {
        (self.schema)()
    }
}

/// Registry of all plugins of a program. No code runs before `main`: each plugin crate has a
/// `register` function, and the program calls it.
///
/// ```
/// # use tagalong_core::*;
/// # use tagalong_config::Registry;
/// #[derive(Default, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
/// #[serde(default, deny_unknown_fields)]
/// struct Config {}
/// struct Trusting;
/// impl Verifier for Trusting {
///     fn inputs(&self) -> Inputs { Inputs::NONE }
///     fn log_odds(&mut self, _: &Frame, _: &Detection) -> Result<f64> { Ok(1.0) }
/// }
/// let mut registry = Registry::default();
/// registry.verifier("trusting", "believes everything", |_: Config, _| Ok(Trusting));
/// assert_eq!(registry.plugins().count(), 1);
/// ```
#[derive(Default)]
pub struct Registry {
    plugins: BTreeMap<&'static str, PluginInfo>,
    trainers: BTreeMap<&'static str, Build<Box<dyn Trainer>>>,
    exporters: BTreeMap<&'static str, Build<ExportedNetwork>>,
    training: BTreeMap<&'static str, TrainingOffer>,
    remedies: BTreeMap<&'static str, &'static [Remedy]>,
    trial_values: BTreeMap<&'static str, &'static [TrialValues]>,
    alternatives: BTreeSet<&'static str>,
    defaults: BTreeMap<Kind, &'static str>,
    recorded: BTreeMap<&'static str, RecordedOffer>,
    networks: BTreeSet<&'static str>,
}

impl Registry {
    /// Registers a detector.
    ///
    /// # Panics
    /// If the name is taken: that is a mistake in the program, not in its input.
    pub fn detector<C: Settings, P: Detector + 'static>(
        &mut self,
        name: &'static str,
        summary: &'static str,
        build: impl Fn(C, &Context) -> Result<P> + Send + Sync + 'static,
    ) {
        let maker = Maker::Detector(boxed(build, |plugin| Box::new(plugin)));
        self.add::<C>(name, Kind::Detector, summary, maker);
    }

    /// Registers a verifier.
    ///
    /// # Panics
    /// As [`Registry::detector`].
    pub fn verifier<C: Settings, P: Verifier + 'static>(
        &mut self,
        name: &'static str,
        summary: &'static str,
        build: impl Fn(C, &Context) -> Result<P> + Send + Sync + 'static,
    ) {
        let maker = Maker::Verifier(boxed(build, |plugin| Box::new(plugin)));
        self.add::<C>(name, Kind::Verifier, summary, maker);
    }

    /// Registers an associator.
    ///
    /// # Panics
    /// As [`Registry::detector`].
    pub fn associator<C: Settings, P: Associator + 'static>(
        &mut self,
        name: &'static str,
        summary: &'static str,
        build: impl Fn(C, &Context) -> Result<P> + Send + Sync + 'static,
    ) {
        let maker = Maker::Associator(boxed(build, |plugin| Box::new(plugin)));
        self.add::<C>(name, Kind::Associator, summary, maker);
    }

    /// Registers a filter.
    ///
    /// # Panics
    /// As [`Registry::detector`].
    pub fn filter<C: Settings, P: Filter + 'static>(
        &mut self,
        name: &'static str,
        summary: &'static str,
        build: impl Fn(C, &Context) -> Result<P> + Send + Sync + 'static,
    ) {
        let maker = Maker::Filter(boxed(build, |plugin| Box::new(plugin)));
        self.add::<C>(name, Kind::Filter, summary, maker);
    }

    /// Registers a track manager.
    ///
    /// # Panics
    /// As [`Registry::detector`].
    pub fn manager<C: Settings, P: TrackManager + 'static>(
        &mut self,
        name: &'static str,
        summary: &'static str,
        build: impl Fn(C, &Context) -> Result<P> + Send + Sync + 'static,
    ) {
        let maker = Maker::Manager(boxed(build, |plugin| Box::new(plugin)));
        self.add::<C>(name, Kind::Manager, summary, maker);
    }

    /// Registers a controller.
    ///
    /// # Panics
    /// As [`Registry::detector`].
    pub fn controller<C: Settings, P: Controller + 'static>(
        &mut self,
        name: &'static str,
        summary: &'static str,
        build: impl Fn(C, &Context) -> Result<P> + Send + Sync + 'static,
    ) {
        let maker = Maker::Controller(boxed(build, |plugin| Box::new(plugin)));
        self.add::<C>(name, Kind::Controller, summary, maker);
    }

    /// Registers a trainer of a model file, under the name of the plugin that reads it, or of the
    /// model if that is only a part of the plugin; `C` are the settings of the plugin.
    ///
    /// # Panics
    /// If there is a trainer of this name already.
    pub fn trainer<C: Settings, P: Trainer + 'static>(
        &mut self,
        name: &'static str,
        build: impl Fn(C, &Context) -> Result<P> + Send + Sync + 'static,
    ) {
        let previous = self.trainers.insert(name, boxed(build, |trainer| Box::new(trainer)));
        assert!(previous.is_none(), "two trainers for `{name}`");
    }

    /// Registers how the model of a trainer is trained. By default that of a detector learns from
    /// windows and others from candidates, and a quick trial has the same settings.
    pub fn training(&mut self, name: &'static str, offer: TrainingOffer) {
        self.training.insert(name, offer);
    }

    /// Returns whether any plugin can be trained.
    pub fn has_trainers(&self) -> bool {
        !self.trainers.is_empty()
    }

    /// Returns how the model of a trainer is trained.
    pub fn training_offer(&self, name: &str) -> TrainingOffer {
        let is_detector = self.plugins.get(name).is_some_and(|info| info.kind == Kind::Detector);
        let data = if is_detector { TrainingData::Windows } else { TrainingData::Candidates };
        let usual = TrainingOffer { data, ..TrainingOffer::default() };
        self.training.get(name).copied().unwrap_or(usual)
    }

    /// Registers advice on the tests of a plugin.
    pub fn remedies(&mut self, name: &'static str, remedies: &'static [Remedy]) {
        self.remedies.insert(name, remedies);
    }

    /// Returns the advice on the tests of all plugins, by the names of the plugins.
    pub fn all_remedies(&self) -> impl Iterator<Item = (&'static str, &'static Remedy)> {
        self.remedies.iter().flat_map(|(name, remedies)| {
            let name = *name;
            remedies.iter().map(move |remedy| (name, remedy))
        })
    }

    /// Registers values of settings of a plugin that are worth a trial on any log.
    pub fn trial_values(&mut self, name: &'static str, values: &'static [TrialValues]) {
        self.trial_values.insert(name, values);
    }

    /// Returns the values of settings that are worth a trial, by the names of the plugins.
    pub fn all_trial_values(&self) -> impl Iterator<Item = (&'static str, &'static TrialValues)> {
        self.trial_values.iter().flat_map(|(name, values)| {
            let name = *name;
            values.iter().map(move |values| (name, values))
        })
    }

    /// Registers a plugin as worth a trial in place of another one of its kind.
    pub fn alternative(&mut self, name: &'static str) {
        self.alternatives.insert(name);
    }

    /// Returns the plugins that are worth a trial in place of others of their kinds.
    pub fn alternatives(&self) -> impl Iterator<Item = &PluginInfo> {
        self.alternatives.iter().filter_map(|name| self.plugins.get(name))
    }

    /// Registers the plugin of a kind that a config has without naming it, in place of an earlier one.
    pub fn default_plugin(&mut self, kind: Kind, name: &'static str) {
        self.defaults.insert(kind, name);
    }

    /// Returns the plugin of a kind that a config has without naming it, if there is one.
    pub fn default_of(&self, kind: Kind) -> Option<&PluginInfo> {
        let plugin = self.plugins.get(self.defaults.get(&kind)?)?;
        (plugin.kind == kind).then_some(plugin)
    }

    /// Registers a detector as one that takes the detections that come with the frames.
    pub fn recorded(&mut self, name: &'static str, offer: RecordedOffer) {
        self.recorded.insert(name, offer);
    }

    /// Returns the detectors that take the detections that come with the frames, by name.
    pub fn all_recorded(&self) -> impl Iterator<Item = (&'static str, RecordedOffer)> {
        self.recorded.iter().map(|(name, offer)| (*name, *offer))
    }

    /// Registers a detector as one that runs the network of the file `model`, with the settings `fit`,
    /// `colours`, `mean` and `deviation` for the preparation of its images.
    pub fn network_of_a_file(&mut self, name: &'static str) {
        self.networks.insert(name);
    }

    /// Returns true for a detector that runs the network of a file.
    pub fn runs_network_of_a_file(&self, name: &str) -> bool {
        self.networks.contains(name)
    }

    /// Registers the export of a plugin's network as an ONNX file, under the name of the plugin; `C`
    /// are the settings of the plugin.
    ///
    /// # Panics
    /// If there is an exporter of this name already.
    pub fn exporter<C: Settings>(
        &mut self,
        name: &'static str,
        export: impl Fn(C, &Context) -> Result<ExportedNetwork> + Send + Sync + 'static,
    ) {
        let previous = self.exporters.insert(name, boxed(export, |network| network));
        assert!(previous.is_none(), "two exporters for `{name}`");
    }

    fn add<C: Settings>(
        &mut self,
        name: &'static str,
        kind: Kind,
        summary: &'static str,
        maker: Maker,
    ) {
        let info = PluginInfo {
            name,
            kind,
            summary,
            // Functions rather than values: most runs need neither defaults nor schema.
            defaults: commented_defaults::<C>,
            schema: || schemars::schema_for!(C).to_value(),
            maker,
        };
        let previous = self.plugins.insert(name, info);
        assert!(previous.is_none(), "two plugins are called `{name}`");
    }

    /// Returns all plugins, by name.
    pub fn plugins(&self) -> impl Iterator<Item = &PluginInfo> {
        self.plugins.values()
    }

    /// Returns the plugin called `name`.
    ///
    /// # Errors
    /// If there is none: names the nearest one and all available ones.
    pub fn find(&self, name: &str) -> std::result::Result<&PluginInfo, ConfigError> {
        self.plugins.get(name).ok_or_else(|| {
            ConfigError::new(unknown("plugin", name, self.plugins.keys().copied().collect()))
        })
    }

    /// Builds a detector from its settings.
    ///
    /// # Errors
    /// An unknown name, a plugin of another kind, or bad settings.
    pub fn build_detector(
        &self,
        name: &str,
        config: Option<Value<'_>>,
        context: &Context,
    ) -> std::result::Result<Box<dyn Detector>, ConfigError> {
        match &self.of_kind(name, Kind::Detector)?.maker {
            Maker::Detector(build) => build(config, context),
            _ => Err(self.wrong_kind(name, Kind::Detector)),
        }
    }

    /// Builds a verifier from its settings.
    ///
    /// # Errors
    /// As [`Registry::build_detector`].
    pub fn build_verifier(
        &self,
        name: &str,
        config: Option<Value<'_>>,
        context: &Context,
    ) -> std::result::Result<Box<dyn Verifier>, ConfigError> {
        match &self.of_kind(name, Kind::Verifier)?.maker {
            Maker::Verifier(build) => build(config, context),
            _ => Err(self.wrong_kind(name, Kind::Verifier)),
        }
    }

    /// Builds an associator from its settings.
    ///
    /// # Errors
    /// As [`Registry::build_detector`].
    pub fn build_associator(
        &self,
        name: &str,
        config: Option<Value<'_>>,
        context: &Context,
    ) -> std::result::Result<Box<dyn Associator>, ConfigError> {
        match &self.of_kind(name, Kind::Associator)?.maker {
            Maker::Associator(build) => build(config, context),
            _ => Err(self.wrong_kind(name, Kind::Associator)),
        }
    }

    /// Builds a filter from its settings.
    ///
    /// # Errors
    /// As [`Registry::build_detector`].
    pub fn build_filter(
        &self,
        name: &str,
        config: Option<Value<'_>>,
        context: &Context,
    ) -> std::result::Result<Box<dyn Filter>, ConfigError> {
        match &self.of_kind(name, Kind::Filter)?.maker {
            Maker::Filter(build) => build(config, context),
            _ => Err(self.wrong_kind(name, Kind::Filter)),
        }
    }

    /// Builds a track manager from its settings.
    ///
    /// # Errors
    /// As [`Registry::build_detector`].
    pub fn build_manager(
        &self,
        name: &str,
        config: Option<Value<'_>>,
        context: &Context,
    ) -> std::result::Result<Box<dyn TrackManager>, ConfigError> {
        match &self.of_kind(name, Kind::Manager)?.maker {
            Maker::Manager(build) => build(config, context),
            _ => Err(self.wrong_kind(name, Kind::Manager)),
        }
    }

    /// Builds a controller from its settings.
    ///
    /// # Errors
    /// As [`Registry::build_detector`].
    pub fn build_controller(
        &self,
        name: &str,
        config: Option<Value<'_>>,
        context: &Context,
    ) -> std::result::Result<Box<dyn Controller>, ConfigError> {
        match &self.of_kind(name, Kind::Controller)?.maker {
            Maker::Controller(build) => build(config, context),
            _ => Err(self.wrong_kind(name, Kind::Controller)),
        }
    }

    /// Builds the trainer of a plugin from the plugin's settings.
    ///
    /// # Errors
    /// A plugin that cannot be trained (lists those that can), or bad settings.
    pub fn build_trainer(
        &self,
        name: &str,
        config: Option<Value<'_>>,
        context: &Context,
    ) -> std::result::Result<Box<dyn Trainer>, ConfigError> {
        match self.trainers.get(name) {
            Some(build) => build(config, context),
            None => Err(self.untrainable(name)),
        }
    }

    /// Exports the network of a plugin with these settings.
    ///
    /// # Errors
    /// A plugin without a network (lists those that have one), or bad settings.
    pub fn export(
        &self,
        name: &str,
        config: Option<Value<'_>>,
        context: &Context,
    ) -> std::result::Result<ExportedNetwork, ConfigError> {
        match self.exporters.get(name) {
            Some(export) => export(config, context),
            None => {
                let list = self.exporters.keys().copied().collect::<Vec<_>>().join(", ");
                let message = format!("`{name}` has no network to export; available: {list}");
                Err(ConfigError::new(message))
            }
        }
    }

    fn untrainable(&self, name: &str) -> ConfigError {
        let names: Vec<_> = self.trainers.keys().copied().collect();
        ConfigError::new(match self.plugins.get(name) {
            Some(info) => {
                let list = names.join(", ");
                format!("the {} `{name}` cannot be trained; available: {list}", info.kind)
            }
            None => unknown("plugin", name, names),
        })
    }

    fn of_kind(&self, name: &str, kind: Kind) -> std::result::Result<&PluginInfo, ConfigError> {
        match self.plugins.get(name) {
            Some(info) if info.kind == kind => Ok(info),
            _ => Err(self.wrong_kind(name, kind)),
        }
    }

    fn wrong_kind(&self, name: &str, kind: Kind) -> ConfigError {
        let of_kind: Vec<_> =
            self.plugins.values().filter(|p| p.kind == kind).map(|p| p.name).collect();
        let message = match self.plugins.get(name) {
            Some(info) => {
                let list = of_kind.join(", ");
                format!(
                    "`{name}` is {}, not {}; available {kind}s: {list}",
                    info.kind.with_article(),
                    kind.with_article()
                )
            }
            None => unknown(&format!("{kind} plugin"), name, of_kind),
        };
        ConfigError::new(message)
    }
}

fn boxed<C: Settings, P, B>(
    build: impl Fn(C, &Context) -> Result<P> + Send + Sync + 'static,
    boxed: fn(P) -> B,
) -> Build<B>
where
    P: 'static,
    B: 'static,
{
    Box::new(move |value, context| {
        let config = parse_settings::<C>(value.clone())?;
        build(config, context).map(boxed).map_err(|error| match &value {
            Some(value) => ConfigError::at_key(&error, value),
            None => ConfigError::new(error.to_string()),
        })
    })
}

/// Formats "unknown thing `x`; did you mean `y`? available: a, b".
fn unknown(thing: &str, name: &str, available: Vec<&str>) -> String {
    let hint = nearest(name, available.iter().copied())
        .map_or(String::new(), |better| format!(" did you mean `{better}`?"));
    format!("unknown {thing} `{name}`;{hint} available: {}", available.join(", "))
}

#[cfg(test)]
mod tests;
