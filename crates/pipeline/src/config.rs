//! Building a pipeline from TOML. The text is parsed once into values that keep their spans, and
//! each plugin receives its own values, so that every error is shown with its line.

use std::ops::Range;
use std::path::Path;

use tagalong_config::{
    ConfigError, Context, Kind, Registry, Settings, Value, nearest, parse_settings,
};
use tagalong_core::{Associator, Filter, TrackManager, Verifier};
use tagalong_stereo::StereoDepth;
use tagalong_tracking::Guarded;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use tagalong_tracking::{DetectorSettings, DetectorSlot, Parts, Role, Tracker};

use crate::pipeline::Pipeline;
use crate::preprocessors::preprocessors;
use crate::settings::{PipelineSettings, PluginSettings};
use tagalong_following::{CommandLimiterSettings, RobotSettings, Steering};
use tagalong_math::mix;
use tagalong_vision::Describer;

mod builtin;
mod checks;
mod document;
mod inputs;
mod resolve;
mod resolved;
mod source;
mod suits;
#[cfg(test)]
mod tests;
mod tune;

use checks::check;
pub use document::{Document, flattened};
use inputs::{APPEARANCE, Declared, declared_inputs, describes};
use resolve::{default_plugin, resolve};
pub use resolved::ResolvedConfig;
pub use source::{BuildError, ConfigSource};
pub use suits::Suits;
pub use tune::{Tunable, with_values};

const OWN: [&str; 15] = [
    "seed",
    "without",
    "robot",
    "stereo",
    "odometry",
    "clock",
    "merge",
    "occlusion",
    "births",
    "appearance",
    "reidentification",
    "silhouette",
    "target",
    "command_limiter",
    "collision_monitor",
];
const PLUGINS: [&str; 6] =
    ["detectors", "verifiers", "associator", "filter", "manager", "controller"];

/// Tables of a config that belong to the reader of logs and the writer of runs.
const FOREIGN: [&str; 3] = ["input", "limits", "output"];

/// Keys of older configs, with their replacement.
const RENAMED: [(&str, &str); 3] = [
    (
        "association",
        "`[associator.config]`; `same_person_m`, `same_person_iou` and `max_detections` stand in \
         `[merge]`",
    ),
    ("lifecycle", "`[manager.config]`"),
    ("governor", "`[command_limiter]`; `[governor.corridor]` is `[collision_monitor]`"),
];

/// Options for reading a config.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Options {
    /// Top-level tables that belong to other programs. They are ignored; see
    /// [`ResolvedConfig::table`].
    pub foreign: Vec<String>,
    /// Seed that replaces the config's.
    pub seed: Option<u64>,
    /// Most threads of stereo matching; the results do not depend on it.
    pub threads: Option<usize>,
}

impl Default for Options {
    fn default() -> Self {
        Self { foreign: FOREIGN.map(str::to_owned).to_vec(), seed: None, threads: None }
    }
}

impl Pipeline {
    /// Builds the pipeline that a config describes.
    ///
    /// # Errors
    /// Any mistake in the config, with its place in the text; see [`ConfigError::render`].
    pub(crate) fn from_source(
        source: &ConfigSource,
        registry: &Registry,
        options: &Options,
    ) -> Result<Self, ConfigError> {
        let document = source.document()?;
        Self::from_document(&document, source, registry, options)
            .map_err(|error| document.locate(error))
    }

    fn from_document(
        document: &Document,
        source: &ConfigSource,
        registry: &Registry,
        options: &Options,
    ) -> Result<Self, ConfigError> {
        let mut root = document.root()?;
        refuse_unknown(&root, options)?;
        let settings = own_settings(&root, options)?;
        let builder = Builder { registry, base_dir: source.folder(), settings: &settings };
        let (detectors, places) = builder.detectors(root.remove("detectors"))?;
        let verifiers = builder.verifiers(root.remove("verifiers"))?;
        let associator = builder.associator(root.remove("associator"))?;
        let (filter, filter_span) = builder.filter(root.remove("filter"))?;
        let manager = builder.manager(root.remove("manager"))?;
        // These checks span several sections, so they follow the construction of all of them.
        check_detectors(&detectors, &places)?;
        check_weighing(&filter, &detectors, filter_span)?;
        let describer = builder.describer(&root)?;
        let controller = root.remove("controller").filter(|section| !leaves_out(section));
        let steering = builder.steering(controller, &describer)?;
        let plugins: Vec<Declared<'_>> = detectors
            .iter()
            .map(|slot| (&*slot.settings.plugin, slot.plugin.plugin().capabilities().inputs))
            .chain(verifiers.iter().map(|verifier| (verifier.name(), verifier.plugin().inputs())))
            .chain([(filter.name(), filter.plugin().requirements().inputs)])
            .chain(steering.as_ref().map(Steering::inputs))
            .collect();
        let without_span = root.get("without").map(Spanned::span);
        let inputs = declared_inputs(&settings, &plugins, steering.is_some(), without_span)?;
        let values = resolve(document.table()?, &settings, registry)?;
        let config = ResolvedConfig {
            seed: settings.seed,
            robot: settings.robot.clone(),
            tune: tune::read(root.remove(tune::TABLE), &values)?,
            suits: suits::read(root.remove(suits::TABLE))?,
            source: source.clone(),
            document: document.clone(),
            text: resolved::to_text(&values)?,
            values,
            foreign: options.foreign.clone(),
        };
        let stereo = settings
            .stereo
            .as_ref()
            .map(|stereo| match options.threads {
                Some(most) => StereoDepth::new(stereo.on_threads(most)),
                None => StereoDepth::new(stereo.clone()),
            })
            .transpose();
        let stereo = stereo.map_err(|error| ConfigError::new(error.to_string()))?;
        let preprocessors = preprocessors(stereo, settings.odometry.clone());
        let parts = Parts {
            preprocessors,
            detectors,
            verifiers,
            associator,
            filter,
            manager,
            describer: describer.clone(),
        };
        let mut tracker = Tracker::new(parts, settings.tracker());
        if let Some((name, inputs)) = steering.as_ref().map(Steering::inputs) {
            tracker.require(name, inputs);
        }
        if describes(&settings, steering.is_some()) {
            tracker.require("[appearance]", APPEARANCE);
        }
        Ok(Self { inputs, tracker, settings, steering, describer, config, failed: None })
    }
}

/// Name in place of a controller's that leaves an inherited one out.
const NO_CONTROLLER: &str = "none";

/// Returns true for a section that names no plugin, so that a config without a controller can extend one
/// that has it.
fn leaves_out(section: &Value<'_>) -> bool {
    let table = section.get_ref().as_table();
    let plugin = table.and_then(|table| table.get("plugin")?.get_ref().as_str());
    plugin == Some(NO_CONTROLLER)
}

fn refuse_unknown(root: &DeTable<'_>, options: &Options) -> Result<(), ConfigError> {
    let foreign = options.foreign.iter().map(String::as_str);
    let known: Vec<&str> = PLUGINS
        .into_iter()
        .chain(OWN)
        .chain([tune::TABLE, suits::TABLE, document::EXTENDS])
        .chain(foreign)
        .collect();
    for key in root.keys() {
        let name: &str = key.get_ref();
        // A key of an older version gets its replacement instead of a guess by spelling.
        if let Some((_, now)) = RENAMED.iter().find(|(old, _)| *old == name) {
            let message = format!("`{name}` is now {now}");
            return Err(ConfigError::new(message).or_at(Some(key.span())));
        }
        if !known.contains(&name) {
            let hint = nearest(name, known.iter().copied())
                .map_or(String::new(), |better| format!(" did you mean `{better}`?"));
            let message = format!("unknown key `{name}`;{hint} available: {}", known.join(", "));
            return Err(ConfigError::new(message).or_at(Some(key.span())));
        }
    }
    Ok(())
}

fn own_settings(root: &DeTable<'_>, options: &Options) -> Result<PipelineSettings, ConfigError> {
    // Only the pipeline's own keys are deserialised here: the type refuses unknown ones.
    let own: DeTable<'_> = root
        .iter()
        .filter(|(key, _)| OWN.contains(&key.get_ref().as_ref()))
        .map(|(key, value)| (key.clone(), value.clone()))
        .collect();
    let mut settings: PipelineSettings =
        parse_settings(Some(Spanned::new(0..0, DeValue::Table(own))))?;
    settings.seed = options.seed.unwrap_or(settings.seed);
    check(&settings, root)?;
    Ok(settings)
}

/// Spans of a detector section, as a whole and by key.
struct SectionSpans {
    section: Range<usize>,
    every: Option<Range<usize>>,
    offset: Option<Range<usize>>,
    roles: Option<Range<usize>>,
}

/// Parts of a plugin section.
struct Section<'a, T> {
    settings: T,
    config: Option<Value<'a>>,
    table: DeTable<'a>,
    span: Range<usize>,
}

impl<'a, T: Settings> Section<'a, T> {
    fn new(name: &str, value: Value<'a>) -> Result<Self, ConfigError> {
        let span = value.span();
        let DeValue::Table(mut table) = value.into_inner() else {
            let message = format!("`{name}` must be a table with the key `plugin`");
            return Err(ConfigError::new(message).or_at(Some(span)));
        };
        let config = table.remove("config");
        let settings =
            parse_settings(Some(Spanned::new(span.clone(), DeValue::Table(table.clone()))))?;
        Ok(Self { settings, config, table, span })
    }

    fn span_of(&self, key: &str) -> Option<Range<usize>> {
        self.table.get(key).map(Spanned::span)
    }

    /// Adds the span of the plugin's name to an error that has none.
    fn at_plugin<P>(&self, built: Result<P, ConfigError>) -> Result<P, ConfigError> {
        let place = self.span_of("plugin").unwrap_or_else(|| self.span.clone());
        built.map_err(|error| error.or_at(Some(place)))
    }
}

impl<'a> Section<'a, PluginSettings> {
    /// Splits a section that may be left out, or name no plugin.
    fn or_default(
        kind: Kind,
        name: &str,
        value: Option<Value<'a>>,
        registry: &Registry,
    ) -> Result<Self, ConfigError> {
        let mut section = Self::new(
            name,
            value.unwrap_or_else(|| Spanned::new(0..0, DeValue::Table(DeTable::new()))),
        )?;
        if section.settings.plugin.is_empty() {
            section.settings.plugin = default_plugin(registry, kind, name)?.to_owned();
        }
        Ok(section)
    }
}

struct Builder<'a> {
    registry: &'a Registry,
    base_dir: &'a Path,
    settings: &'a PipelineSettings,
}

impl Builder<'_> {
    /// Returns the context of a plugin. Its seed depends on the run's and on the plugin's place in
    /// the config.
    fn context(&self, section: usize, index: usize) -> Context {
        // The section is in the upper half, so that no index within a section can collide with it.
        let place = ((section as u64) << 32) + index as u64;
        Context::new(
            mix(mix(self.settings.seed) ^ place),
            self.base_dir.to_owned(),
            self.settings.robot.wheels(),
        )
    }

    fn detectors(
        &self,
        value: Option<Value<'_>>,
    ) -> Result<(Vec<DetectorSlot>, Vec<SectionSpans>), ConfigError> {
        let mut built = (Vec::new(), Vec::new());
        for (index, value) in list("detectors", value)?.into_iter().enumerate() {
            refuse_old_role(&value)?;
            let mut section = Section::<DetectorSettings>::new("detectors", value)?;
            let config = section.config.take();
            let context = self.context(0, index);
            let name = &section.settings.plugin;
            let plugin = section.at_plugin(self.registry.build_detector(name, config, &context))?;
            built.1.push(SectionSpans {
                section: section.span.clone(),
                every: section.span_of("every"),
                offset: section.span_of("offset"),
                roles: section.span_of("roles"),
            });
            let plugin = Guarded::new(section.settings.plugin.clone(), plugin);
            built.0.push(DetectorSlot { settings: section.settings, plugin });
        }
        Ok(built)
    }

    fn verifiers(
        &self,
        value: Option<Value<'_>>,
    ) -> Result<Vec<Guarded<dyn Verifier>>, ConfigError> {
        let mut built = Vec::new();
        for (index, value) in list("verifiers", value)?.into_iter().enumerate() {
            let mut section = Section::<PluginSettings>::new("verifiers", value)?;
            let config = section.config.take();
            let context = self.context(1, index);
            let name = &section.settings.plugin;
            let plugin = section.at_plugin(self.registry.build_verifier(name, config, &context))?;
            built.push(Guarded::new(section.settings.plugin, plugin));
        }
        Ok(built)
    }

    fn filter(
        &self,
        value: Option<Value<'_>>,
    ) -> Result<(Guarded<dyn Filter>, Range<usize>), ConfigError> {
        let Some(value) = value else {
            let message = "no filter: add a section [filter] with `plugin = \"...\"`";
            return Err(ConfigError::new(message));
        };
        let mut section = Section::<PluginSettings>::new("filter", value)?;
        let config = section.config.take();
        let context = self.context(2, 0);
        let name = &section.settings.plugin;
        let plugin = section.at_plugin(self.registry.build_filter(name, config, &context))?;
        let span = section.span_of("plugin").unwrap_or(section.span);
        Ok((Guarded::new(section.settings.plugin, plugin), span))
    }

    fn associator(&self, value: Option<Value<'_>>) -> Result<Guarded<dyn Associator>, ConfigError> {
        let mut section =
            Section::or_default(Kind::Associator, "associator", value, self.registry)?;
        let config = section.config.take();
        let context = self.context(4, 0);
        let name = &section.settings.plugin;
        let plugin = section.at_plugin(self.registry.build_associator(name, config, &context))?;
        Ok(Guarded::new(section.settings.plugin, plugin))
    }

    fn manager(&self, value: Option<Value<'_>>) -> Result<Guarded<dyn TrackManager>, ConfigError> {
        let mut section = Section::or_default(Kind::Manager, "manager", value, self.registry)?;
        let config = section.config.take();
        let context = self.context(5, 0);
        let name = &section.settings.plugin;
        let plugin = section.at_plugin(self.registry.build_manager(name, config, &context))?;
        Ok(Guarded::new(section.settings.plugin, plugin))
    }

    /// Builds the description of people; `root` has the place of its section.
    fn describer(&self, root: &DeTable<'_>) -> Result<Describer, ConfigError> {
        let settings = &self.settings.appearance;
        settings.describer(self.base_dir).map_err(|error| {
            let section = root.get("appearance").and_then(|value| value.get_ref().as_table());
            let span = section.and_then(|table| table.get("model")).map(Spanned::span);
            ConfigError::new(format!("[appearance] {error}")).or_at(span)
        })
    }

    fn steering(
        &self,
        value: Option<Value<'_>>,
        describer: &Describer,
    ) -> Result<Option<Steering>, ConfigError> {
        let Some(value) = value else { return Ok(None) };
        let mut section = Section::<PluginSettings>::new("controller", value)?;
        let config = section.config.take();
        let distance = config.as_ref().and_then(|config| span_in(config, "stand_off_m"));
        let context = self.context(3, 0);
        let name = &section.settings.plugin;
        let plugin = section.at_plugin(self.registry.build_controller(name, config, &context))?;
        let PipelineSettings { robot, command_limiter, .. } = self.settings;
        // The stopping distance is known before the first frame, so an unsafe config is refused
        // here.
        if let Some(message) = too_near(plugin.stand_off_m(), robot, command_limiter) {
            let place = distance.or_else(|| section.span_of("plugin"));
            return Err(ConfigError::new(message).or_at(place));
        }
        let name = section.settings.plugin;
        let settings = self.settings.following();
        Ok(Some(Steering::new(name, plugin, settings, describer.clone())))
    }
}

/// Returns the message for a robot that cannot stop before it reaches the person, if so.
fn too_near(
    stand_off_m: Option<f64>,
    robot: &RobotSettings,
    limiter: &CommandLimiterSettings,
) -> Option<String> {
    let stopping_m = limiter.stopping_m(robot.max_speed_mps);
    let distance_m = stand_off_m?;
    // Written as `>=` so that a distance that is not a number counts as too near.
    let stops = distance_m >= stopping_m;
    if stops {
        return None;
    }
    let margin_m = limiter.margin_m;
    let way_m = stopping_m - margin_m;
    Some(format!(
        "a robot at {} m/s needs {stopping_m:.2} m to stop ({way_m:.2} m, and `margin_m` of {margin_m:.2} m), \
         and follows at {distance_m} m: raise `stand_off_m` or lower `max_speed_mps` in [robot]",
        robot.max_speed_mps
    ))
}

/// Returns the place of a key of a table.
fn span_in(table: &Value<'_>, key: &str) -> Option<Range<usize>> {
    table.get_ref().as_table()?.get(key).map(Spanned::span)
}

/// Refuses the former name of the role `track`.
fn refuse_old_role(section: &Value<'_>) -> Result<(), ConfigError> {
    let roles = section.get_ref().as_table().and_then(|table| table.get("roles"));
    let roles = roles.and_then(|roles| roles.get_ref().as_array());
    let old = roles.into_iter().flatten().find(|role| role.get_ref().as_str() == Some("follow"));
    match old {
        Some(role) => {
            let message = "the role `follow` is now `track`".to_owned();
            Err(ConfigError::new(message).or_at(Some(role.span())))
        }
        None => Ok(()),
    }
}

/// Returns the sections of an array of tables.
fn list<'a>(name: &str, value: Option<Value<'a>>) -> Result<Vec<Value<'a>>, ConfigError> {
    let Some(value) = value else { return Ok(Vec::new()) };
    let span = value.span();
    match value.into_inner() {
        DeValue::Array(items) => Ok(items.into_iter().collect()),
        _ => {
            let message = format!(
                "`{name}` is a list: write [[{name}]] with double brackets, or `extends` a config to \
                 change one entry of its list"
            );
            Err(ConfigError::new(message).or_at(Some(span)))
        }
    }
}

/// Refuses roles and schedules that parse but cannot work.
fn check_detectors(detectors: &[DetectorSlot], places: &[SectionSpans]) -> Result<(), ConfigError> {
    for (slot, place) in detectors.iter().zip(places) {
        let DetectorSettings { plugin, roles, every, offset, .. } = &slot.settings;
        let (message, span) = if *every == 0 {
            ("`every` must be at least 1".into(), &place.every)
        } else if offset >= every {
            let message = format!("`offset` must be below `every`: {offset} is not below {every}");
            (message, &place.offset)
        } else if roles.is_empty() {
            let message = format!("`{plugin}` has no role: name discover, follow or weigh");
            (message, &place.roles)
        } else if let Some((role, cannot)) = missing_role(slot) {
            let message = format!("`{plugin}` cannot {cannot}: remove the role {role}");
            (message, &place.roles)
        } else {
            continue;
        };
        let span = span.clone().or_else(|| Some(place.section.clone()));
        return Err(ConfigError::new(message).or_at(span));
    }
    if !detectors.iter().any(|slot| slot.settings.roles.contains(&Role::Discover)) {
        let message = "no detector discovers anybody: give one of [[detectors]] the role discover";
        return Err(ConfigError::new(message).or_at(places.first().map(|p| p.section.clone())));
    }
    Ok(())
}

/// Returns a role of the config that the detector does not offer, with its description.
fn missing_role(slot: &DetectorSlot) -> Option<(&'static str, &'static str)> {
    let offered = slot.plugin.plugin().capabilities();
    let roles = [
        (Role::Discover, offered.discovers, "discover", "discover people"),
        (Role::Track, offered.tracks, "track", "find a tracked person again"),
        (Role::Weigh, offered.weighs, "weigh", "weigh scenes"),
    ];
    let missing = roles
        .into_iter()
        .find(|(role, is_offered, ..)| slot.settings.roles.contains(role) && !is_offered);
    missing.map(|(_, _, name, words)| (name, words))
}

fn check_weighing(
    filter: &Guarded<dyn Filter>,
    detectors: &[DetectorSlot],
    span: Range<usize>,
) -> Result<(), ConfigError> {
    fn weighs(slot: &DetectorSlot) -> bool {
        slot.settings.roles.contains(&Role::Weigh)
    }

    // A filter that weighs scenes would have no measurement without such a detector.
    if !filter.plugin().requirements().likelihood || detectors.iter().any(weighs) {
        return Ok(());
    }
    let message = format!(
        "`{}` weighs scenes, and no detector does that for it: \
         add the role weigh to a detector that has a likelihood",
        filter.name()
    );
    Err(ConfigError::new(message).or_at(Some(span)))
}
