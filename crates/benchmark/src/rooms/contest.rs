use std::collections::BTreeMap;
use std::path::PathBuf;

use crate::tuning::{Search, candidates, shipped, shown_value};
use tagalong_app::config_file::ConfigFile;
use tagalong_app::outcome::Failure;
use tagalong_config::Registry;
use tagalong_pipeline::ResolvedConfig;

use super::RoomsArgs;
use crate::plan::{self, Annotated, PlannedConfig, sha256};

/// Room with its logs.
pub struct Location {
    pub name: String,
    pub about: String,
    pub logs: Vec<Annotated>,
    /// Models that were trained without this room, by the plugin that reads them.
    pub models: BTreeMap<String, PathBuf>,
    /// True if its frames are not tracked over time; then it does not affect a choice.
    pub single_frames: bool,
}

/// Pipeline with all settings that are tried.
pub struct Contestant {
    /// Config as shipped.
    pub config: PlannedConfig,
    /// Settings to run: first those among which the rooms choose.
    pub settings: Vec<Setting>,
    /// Number of settings among which the rooms choose, over all samples.
    pub candidates: usize,
    /// For each seed its sample, as indices into `settings`; a single sample if it does not depend
    /// on a seed.
    pub samples: Vec<Vec<usize>>,
    /// Method of the search.
    pub search: Search,
    /// Index of the settings of the config, which are a candidate only by chance.
    pub shipped: usize,
    /// Number of combinations of the first sample that contradict themselves.
    pub refused: usize,
}

/// Values of the tunable settings, and the config that has them.
pub struct Setting {
    /// Values in the order of the tunables.
    pub values: Vec<toml::Value>,
    /// Config with these values.
    as_is: Variant,
    /// The same configs with models that were trained without a room, by its name.
    unseen: BTreeMap<String, Variant>,
}

/// Config to run.
pub struct Variant {
    pub file: ConfigFile,
    /// Hash of the config with all defaults, and of the files that it names.
    hash: String,
}

impl Contestant {
    /// Creates the contestant, and builds the pipeline once with each combination.
    ///
    /// # Errors
    /// Values that a setting does not allow, with their line.
    pub fn new(
        config: PlannedConfig,
        args: &RoomsArgs,
        locations: &[Location],
        registry: &Registry,
    ) -> Result<Self, Failure> {
        config.file.check_tuning(registry)?;
        let (pipeline, _) = config.file.pipeline(registry, None)?;
        let budget = usize::from(args.budget);
        let search = Search::of(&config.tune, budget);
        let now = shipped(&config.tune);
        let mut settings: Vec<Setting> = Vec::new();
        let mut samples: Vec<Vec<usize>> = Vec::new();
        let mut refused = 0;
        for number in 0..search.samples(args.samples) {
            let seed = args.seed.wrapping_add(number.into());
            let mut sample = Vec::new();
            let mut contradicting = 0;
            for values in candidates(&config.tune, budget, seed) {
                let known = settings.iter().position(|setting| setting.values == values);
                if let Some(known) = known {
                    sample.push(known);
                    continue;
                }
                match Setting::new(&config, pipeline.config(), values, locations, registry)? {
                    Some(setting) => {
                        sample.push(settings.len());
                        settings.push(setting);
                    }
                    None => contradicting += 1,
                }
            }
            if number == 0 {
                refused = contradicting;
            }
            samples.push(sample);
        }
        if samples[0].is_empty() {
            let name = config.file.stem();
            let why = format!(
                "{name}: no setting of [tune] is left, all {refused} contradict themselves"
            );
            return Err(Failure::usage(why));
        }
        // A later sample that consists only of contradictions gives no information about the
        // spread.
        samples.retain(|sample| !sample.is_empty());
        let candidates = settings.len();
        let shipped = settings.iter().position(|setting| setting.values == now);
        if shipped.is_none() {
            let as_is = Setting::new(&config, pipeline.config(), now, locations, registry)?;
            settings.extend(as_is);
        }
        let shipped = shipped.unwrap_or(settings.len() - 1);
        Ok(Self { config, settings, candidates, samples, search, shipped, refused })
    }

    /// Returns the name in tables.
    pub fn name(&self) -> String {
        self.config.file.stem()
    }

    /// Returns the settings as text: `manager.config.confirm_hits = 2, ...`.
    pub fn words(&self, setting: usize) -> String {
        let values = self.config.tune.iter().zip(&self.settings[setting].values);
        let words: Vec<String> = values
            .map(|(tunable, value)| format!("{} = {}", tunable.key, shown_value(value)))
            .collect();
        if words.is_empty() { "nothing to tune".to_owned() } else { words.join(", ") }
    }
}

impl Setting {
    /// Returns `None` if each value is allowed, but not this combination.
    fn new(
        config: &PlannedConfig,
        resolved: &ResolvedConfig,
        values: Vec<toml::Value>,
        locations: &[Location],
        registry: &Registry,
    ) -> Result<Option<Self>, Failure> {
        let keys = config.tune.iter().map(|tunable| tunable.key.as_str());
        let named: Vec<(&str, &toml::Value)> = keys.zip(&values).collect();
        let text = resolved.with_values(&named).map_err(|error| Failure::usage(error.message))?;
        let file = config.file.with_text(text);
        // `check_tuning` has accepted each value alone, so the combination is at fault.
        let Ok((_, chosen)) = file.pipeline(registry, None) else { return Ok(None) };
        let as_is = Variant::new(config, file, &chosen)?;
        let mut unseen = BTreeMap::new();
        for Location { name, models, .. } in locations {
            if let Some(text) = with_models(chosen.values(), models)? {
                let file = config.file.with_text(text);
                let (_, resolved) = file.pipeline(registry, None)?;
                unseen.insert(name.clone(), Variant::new(config, file, &resolved)?);
            }
        }
        Ok(Some(Self { values, as_is, unseen }))
    }

    /// Returns true if some model of the config was trained with a room.
    pub fn has_seen(&self, room: &str) -> bool {
        self.unseen.contains_key(room)
    }

    /// Returns the config to run in a room, with models that were trained without it, or as
    /// shipped.
    pub fn variant(&self, room: &str, unseen: bool) -> &Variant {
        let variant = self.unseen.get(room).filter(|_| unseen);
        variant.unwrap_or(&self.as_is)
    }
}

impl Variant {
    /// Creates the variant; `resolved` is the config with every default.
    fn new(
        config: &PlannedConfig,
        file: ConfigFile,
        resolved: &ResolvedConfig,
    ) -> Result<Self, Failure> {
        let whole = config.outer.resolved_with(resolved)?;
        let files = plan::file_hashes(&file)?;
        let everything = format!("{}\n{files:?}", whole.to_toml());
        Ok(Self { file, hash: sha256(everything.as_bytes()) })
    }

    /// Returns the name of its result on a log: a hash of everything on which it depends.
    pub fn run_hash(&self, log: &Annotated, version: &str) -> String {
        let Annotated { sha256: log, truth_sha256, whole_bodies, unjudged, .. } = log;
        let truth = format!("{truth_sha256}\n{whole_bodies}\n{unjudged:?}");
        let everything = format!("{version}\n{}\n{log}\n{truth}", self.hash);
        sha256(everything.as_bytes())[..32].to_owned()
    }
}

/// Returns the config with the models of a room in place of built-in ones; `None` if it uses no
/// built-in model that the room replaces. `resolved` has every setting.
fn with_models(
    resolved: &toml::Table,
    models: &BTreeMap<String, PathBuf>,
) -> Result<Option<String>, Failure> {
    let mut root = resolved.clone();
    let mut changed = false;
    for (_, section) in &mut root {
        let slots = match section {
            toml::Value::Array(slots) => slots.as_mut_slice(),
            one => std::slice::from_mut(one),
        };
        for slot in slots {
            let plugin = slot.get("plugin").and_then(toml::Value::as_str);
            let Some(path) = plugin.and_then(|plugin| models.get(plugin)) else { continue };
            let model = slot.get_mut("config").and_then(|config| config.get_mut("model"));
            if let Some(model) = model.filter(|model| model.as_str() == Some("")) {
                *model = path.display().to_string().into();
                changed = true;
            }
        }
    }
    if !changed {
        return Ok(None);
    }
    toml::to_string(&root).map(Some).map_err(Failure::failed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_room_replaces_built_in_models_of_its_plugins_alone() {
        fn model(slot: &toml::Value) -> String {
            slot["config"]["model"].as_str().unwrap().to_owned()
        }

        let models = BTreeMap::from([("net".to_owned(), PathBuf::from("/without.toml"))]);
        let text = "seed = 1\n[[detectors]]\nplugin = 'net'\nconfig = { model = '' }\n\
                    [[detectors]]\nplugin = 'net'\nconfig = { model = 'mine.toml' }\n\
                    [[verifiers]]\nplugin = 'other'\nconfig = { model = '' }\n\
                    [filter]\nplugin = 'net'\nconfig = { model = '' }\n";
        let text = with_models(&text.parse().unwrap(), &models).unwrap().unwrap();
        let root: toml::Table = text.parse().unwrap();
        assert_eq!(model(&root["detectors"][0]), "/without.toml");
        assert_eq!(model(&root["detectors"][1]), "mine.toml");
        assert_eq!(model(&root["verifiers"][0]), "");
        assert_eq!(model(&root["filter"]), "/without.toml");
        let none = "[[verifiers]]\nplugin = 'other'\nconfig = { model = '' }\n";
        assert!(with_models(&none.parse().unwrap(), &models).unwrap().is_none());
    }
}
