use tagalong_app::config_file::ConfigFile;
use tagalong_app::outcome::Failure;
use tagalong_config::Registry;
use tagalong_pipeline::{Tunable, with_values};
use tagalong_tuning::candidates;

use super::RoomsArgs;
use crate::plan::{self, Annotated, PlannedConfig, sha256};

/// Room with its logs.
pub struct Location {
    pub name: String,
    pub about: String,
    pub logs: Vec<Annotated>,
}

/// Pipeline with all settings that are tried.
pub struct Contestant {
    /// Config as it is shipped.
    pub config: PlannedConfig,
    /// Tried settings, the shipped ones first.
    pub settings: Vec<Setting>,
    /// Number of combinations that contradict themselves.
    pub refused: usize,
}

/// Values of the tunable settings, and the config that has them.
pub struct Setting {
    /// Values in the order of the tunables.
    pub values: Vec<toml::Value>,
    /// Config with these values.
    pub file: ConfigFile,
    /// Hash of the config with all defaults, and of the files that it names.
    hash: String,
}

impl Contestant {
    /// Builds the pipeline once with each combination.
    ///
    /// # Errors
    /// Values that a setting does not allow, with their line.
    pub fn new(
        config: PlannedConfig,
        args: &RoomsArgs,
        registry: &Registry,
    ) -> Result<Self, Failure> {
        config.file.check_tuning(registry)?;
        let (pipeline, _) = config.file.pipeline(registry, None)?;
        let (resolved, budget) = (pipeline.resolved(), usize::from(args.budget));
        let (mut settings, mut refused) = (Vec::new(), 0);
        for values in candidates(&config.tune, budget, args.seed) {
            match Setting::new(&config, &resolved, values, registry)? {
                Some(setting) => settings.push(setting),
                None => refused += 1,
            }
        }
        Ok(Self { config, settings, refused })
    }

    /// Returns its name in tables.
    pub fn name(&self) -> String {
        self.config.file.stem()
    }

    /// Returns the settings as text: `manager.config.confirm_hits = 2, ...`.
    pub fn words(&self, setting: usize) -> String {
        let word = |(tunable, value): (&Tunable, &toml::Value)| {
            format!("{} = {}", tunable.key, shown(value))
        };
        let words: Vec<String> =
            self.config.tune.iter().zip(&self.settings[setting].values).map(word).collect();
        if words.is_empty() { "nothing to tune".to_owned() } else { words.join(", ") }
    }
}

/// Formats a value without the digits that come from dividing a range.
pub fn shown(value: &toml::Value) -> String {
    match value {
        toml::Value::Float(number) => format!("{:?}", (number * 1e9).round() / 1e9),
        other => other.to_string(),
    }
}

impl Setting {
    /// Returns `None` if each value is allowed, but not all of them together.
    fn new(
        config: &PlannedConfig,
        resolved: &str,
        values: Vec<toml::Value>,
        registry: &Registry,
    ) -> Result<Option<Self>, Failure> {
        let keys = config.tune.iter().map(|tunable| tunable.key.as_str());
        let named: Vec<(&str, &toml::Value)> = keys.zip(&values).collect();
        let text = with_values(resolved, &named).map_err(|error| Failure::usage(error.message))?;
        let file = config.file.with_text(text);
        // `check_tuning` has accepted each value alone, so the combination is at fault.
        let Ok((pipeline, _)) = file.pipeline(registry, None) else { return Ok(None) };
        let outer = config.outer.resolved()?;
        let files = plan::file_hashes(&file)?;
        let everything = format!("{}\n{outer}\n{files:?}", pipeline.resolved());
        let hash = sha256(everything.as_bytes());
        Ok(Some(Self { values, file, hash }))
    }

    /// Returns the name of its result on a log: a hash of everything that it depends on.
    pub fn run_hash(&self, log: &Annotated, version: &str) -> String {
        let Annotated { sha256: log, truth_sha256, whole_bodies, .. } = log;
        let everything = format!("{version}\n{}\n{log}\n{truth_sha256}\n{whole_bodies}", self.hash);
        sha256(everything.as_bytes())[..32].to_owned()
    }
}
