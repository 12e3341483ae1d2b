use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use serde::Serialize;
use tagalong_config::{FileLimit, Registry, read_text};
use tagalong_pipeline::{StereoSettings, flattened};
use tagalong_sim::{Scene, Seeds, Split, Variant};
use tagalong_trials::{Contender, Trial, TrialError, each, in_order};

/// Fewest seeds of a quick experiment.
const FEWEST: u64 = 1;
/// Divisor of the number of seeds for a quick experiment.
const QUICK: u64 = 50;

/// Failure of an experiment.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ReproduceError {
    /// A config, scene or log cannot be read.
    #[error("cannot read {path}: {why}")]
    Unreadable {
        /// The file.
        path: String,
        /// Error of the operating system.
        why: String,
    },
    /// A scene has an error, shown with its place.
    #[error("{0}")]
    Scene(String),
    /// A pipeline failed.
    #[error(transparent)]
    Trial(#[from] TrialError),
    /// Any other failure.
    #[error("{0}")]
    Other(String),
}

impl ReproduceError {
    /// Returns another error as one of an experiment.
    pub(crate) fn other(error: impl ToString) -> Self {
        Self::Other(error.to_string())
    }

    /// Returns another error, with the name of the log or config that has it.
    pub(crate) fn of(name: &str, error: impl Display) -> Self {
        Self::Other(format!("{name}: {error}"))
    }
}

/// Receives the progress of an experiment.
pub trait Progress: Sync {
    /// Begins a phase of `steps` steps.
    fn begin(&self, steps: usize, what: &str);
    /// Completes one step.
    fn step(&self);
}

/// A simulated scene with its seeds.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct SimulatedScene {
    /// Name of the scene.
    pub scene: String,
    /// Seeds of the scene.
    pub seeds: Seeds,
}

/// Scenes that a lab has simulated.
#[derive(Debug, Default)]
pub struct SimulatedScenes(Mutex<Vec<SimulatedScene>>);

impl SimulatedScenes {
    fn add(&self, simulated: SimulatedScene) {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        // Several tables of one experiment may use the same scenes.
        if !all.contains(&simulated) {
            all.push(simulated);
        }
    }

    /// Returns the scenes simulated since the last call.
    pub(crate) fn take(&self) -> Vec<SimulatedScene> {
        std::mem::take(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// Environment of the experiments.
pub struct Lab<'a> {
    /// Registry of all plugins.
    pub registry: &'a Registry,
    /// Folder of the configs, which holds the folder `scenes`.
    pub configs: PathBuf,
    /// Folder of the configs of the laboratory, with their models: printed forms, and single steps of a
    /// paper.
    pub printed_configs: PathBuf,
    /// Folder of real logs and labelled images, if there is one.
    pub data: Option<PathBuf>,
    /// True for a quick version of about a minute.
    pub quick: bool,
    /// Number of seeds per scene, if the user sets it.
    pub seeds: Option<u64>,
    /// First seed within the split: others give other draws.
    pub first_seed: u64,
    /// Scenes simulated so far.
    pub simulated: SimulatedScenes,
    /// Number of trials that run at once.
    pub jobs: usize,
    /// Receiver of the progress.
    pub progress: &'a dyn Progress,
}

impl Lab<'_> {
    /// Returns the number of seeds for an experiment that takes `whole` by default.
    pub fn seeds(&self, whole: u64) -> u64 {
        match self.seeds {
            Some(asked) => asked,
            // `min`, because a quick run never has more seeds than the whole experiment.
            None if self.quick => (whole / QUICK).max(FEWEST).min(whole),
            None => whole,
        }
    }

    /// Returns the draws of a scene of the split `test` with `seeds` seeds from the first one on;
    /// `set` replaces values by dotted keys, like `camera.kind=stereo`.
    ///
    /// # Errors
    /// A scene that cannot be read, an error in it or in `set`, and seeds that the split does not
    /// have.
    pub fn scenes(
        &self,
        name: &str,
        set: &[(&str, &str)],
        seeds: u64,
    ) -> Result<Vec<Scene>, ReproduceError> {
        self.scenes_of(Split::Test, name, set, seeds)
    }

    /// Returns the draws of a scene as [`Lab::scenes`], of another split: settings are chosen on
    /// `validation`.
    pub fn scenes_of(
        &self,
        split: Split,
        name: &str,
        set: &[(&str, &str)],
        seeds: u64,
    ) -> Result<Vec<Scene>, ReproduceError> {
        let path = self.configs.join("scenes").join(format!("{name}.toml"));
        let text = read(&path)?;
        let set: Vec<(String, String)> =
            set.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect();
        let seeds = split.seeds(self.first_seed, seeds).map_err(ReproduceError::other)?;
        self.simulated.add(SimulatedScene { scene: name.to_owned(), seeds });
        seeds
            .numbers()
            .map(|seed| {
                let variant = Variant { seed: Some(seed), split: Some(split), set: set.clone() };
                Scene::parse_with(&text, &variant).map_err(|error| {
                    ReproduceError::Scene(error.render(&path.display().to_string(), &text))
                })
            })
            .collect()
    }

    /// Returns the shipped configs of these names.
    ///
    /// # Errors
    /// A config that cannot be read.
    pub fn contenders(&self, names: &[&str]) -> Result<Vec<Contender>, ReproduceError> {
        names.iter().map(|name| self.contender(name)).collect()
    }

    /// Returns the config of this name, one of the laboratory or a shipped one.
    ///
    /// # Errors
    /// A config that cannot be read.
    pub fn contender(&self, name: &str) -> Result<Contender, ReproduceError> {
        let folder = self.folder_of(name);
        let path = folder.join(format!("{name}.toml"));
        let text = read(&path)?;
        let text = flattened(&text, folder).map_err(|error| {
            ReproduceError::Other(error.render(&path.display().to_string(), &text))
        })?;
        // Paths in a config are relative to its folder.
        Ok(Contender { folder: folder.to_owned(), ..Contender::new(name, text) })
    }

    /// Returns the folder of the config of this name.
    pub fn folder_of(&self, name: &str) -> &Path {
        let is_own = self.printed_configs.join(format!("{name}.toml")).is_file();
        if is_own { &self.printed_configs } else { &self.configs }
    }

    /// Runs all contenders on all scenes and keeps the results of `keep` for each trial, in the
    /// order of the scenes.
    pub fn trials<T: Send>(
        &self,
        what: &str,
        scenes: &[Scene],
        contenders: &[Contender],
        keep: impl Fn(Trial) -> Result<T, TrialError> + Sync,
    ) -> Result<Vec<T>, ReproduceError> {
        self.progress.begin(scenes.len(), what);
        Ok(each(scenes, contenders, self.registry, self.jobs, keep, |_| self.progress.step())?)
    }
}

impl Lab<'_> {
    /// Runs all contenders as [`Lab::trials`], with depth from the scenes' stereo pairs by these
    /// settings, computed once for all contenders.
    pub fn pair_trials<T: Send>(
        &self,
        what: &str,
        scenes: &[Scene],
        contenders: &[Contender],
        stereo: &StereoSettings,
        keep: impl Fn(Trial) -> Result<T, TrialError> + Sync,
    ) -> Result<Vec<T>, ReproduceError> {
        self.progress.begin(scenes.len(), what);
        let trials = in_order(
            scenes,
            self.jobs,
            |scene| Trial::of_pairs(scene, contenders, self.registry, stereo).and_then(&keep),
            |_| self.progress.step(),
        );
        Ok(trials?)
    }
}

pub(crate) fn read(path: &Path) -> Result<String, ReproduceError> {
    read_text(path, FileLimit::Table).map_err(|error| ReproduceError::Unreadable {
        path: path.display().to_string(),
        why: error.to_string(),
    })
}

#[cfg(test)]
pub(crate) mod testing {
    use super::*;

    struct Silent;

    impl Progress for Silent {
        fn begin(&self, _: usize, _: &str) {}
        fn step(&self) {}
    }

    pub(crate) fn lab(registry: &Registry, quick: bool, seeds: Option<u64>) -> Lab<'_> {
        let own = Path::new(env!("CARGO_MANIFEST_DIR"));
        Lab {
            registry,
            configs: own.join("../../configs"),
            printed_configs: own.join("configs"),
            data: None,
            quick,
            seeds,
            first_seed: 0,
            simulated: SimulatedScenes::default(),
            jobs: 1,
            progress: &Silent,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::testing::lab;
    use super::*;

    #[test]
    fn seeds_are_as_asked_or_few_when_quick() {
        let registry = Registry::default();
        assert_eq!(lab(&registry, false, None).seeds(100), 100);
        assert_eq!(lab(&registry, true, None).seeds(100), 2);
        assert_eq!(lab(&registry, true, None).seeds(20), FEWEST);
        assert_eq!(lab(&registry, true, None).seeds(1), 1);
        assert_eq!(lab(&registry, true, Some(7)).seeds(100), 7);
    }

    #[test]
    fn scenes_are_of_the_test_split_and_take_replacements() {
        let registry = Registry::default();
        let lab = lab(&registry, false, None);
        let scenes = lab.scenes("full-occlusion", &[("people.1.hide_s", "0.5")], 2).unwrap();
        assert!(scenes.iter().all(|scene| scene.split() == Split::Test));
        assert_ne!(scenes[0].seed, scenes[1].seed);
    }

    #[test]
    fn another_first_seed_draws_others_and_each_draw_is_noted_once() {
        fn seeds(lab: &Lab) -> Vec<u64> {
            lab.scenes("crowd", &[], 2).unwrap().iter().map(|scene| scene.seed).collect()
        }

        fn of(first: u64) -> SimulatedScene {
            SimulatedScene { scene: "crowd".into(), seeds: Split::Test.seeds(first, 2).unwrap() }
        }

        let registry = Registry::default();
        let mut lab = lab(&registry, false, None);
        assert_eq!(seeds(&lab), [2_000_000_000, 2_000_000_001]);
        assert_eq!(seeds(&lab), [2_000_000_000, 2_000_000_001]);
        lab.first_seed = 40;
        assert_eq!(seeds(&lab), [2_000_000_040, 2_000_000_041]);
        assert_eq!(lab.simulated.take(), [of(0), of(40)]);
        assert_eq!(lab.simulated.take(), []);
        lab.first_seed = 999_999_999;
        let error = lab.scenes("crowd", &[], 2).unwrap_err().to_string();
        assert!(error.contains("leave the split test"), "{error}");
    }

    #[test]
    fn printed_forms_are_read_from_their_own_folder_and_extend_shipped_configs() {
        let registry = Registry::default();
        let lab = lab(&registry, false, None);
        let printed = lab.contender("stereo-ekf-as-printed").unwrap();
        assert_eq!(printed.folder, lab.printed_configs);
        let table: toml::Table = printed.config.parse().unwrap();
        assert_eq!(table["filter"]["plugin"].as_str(), Some("ekf-as-printed"));
        assert!(table.contains_key("stereo"), "of the config that it extends");
        assert_eq!(lab.contender("stereo-ekf").unwrap().folder, lab.configs);
        let step = lab.contender("joint-particle-kde50").unwrap();
        assert_eq!(step.folder, lab.printed_configs);
        let table: toml::Table = step.config.parse().unwrap();
        assert_eq!(table["filter"]["config"]["hold_depth"].as_bool(), Some(true), "{table}");
    }

    #[test]
    fn what_is_missing_is_named() {
        let registry = Registry::default();
        let lab = lab(&registry, false, None);
        let error = lab.scenes("nowhere", &[], 1).unwrap_err().to_string();
        assert!(error.contains("nowhere.toml"), "{error}");
        let error = lab.contender("nothing").unwrap_err().to_string();
        assert!(error.contains("nothing.toml"), "{error}");
        let error = lab.scenes("crowd", &[("camera.colours", "1")], 1).unwrap_err().to_string();
        assert!(error.contains("colours"), "{error}");
    }
}
