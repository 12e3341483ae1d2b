use std::path::{Path, PathBuf};

use indicatif::{ProgressBar, ProgressStyle};
use tagalong_app::outcome::Failure;
use tagalong_app::threads::threads;
use tagalong_config::{
    ConfigError, Context, Example, FileLimit, Registry, Trainer, TrainingData, read_text,
};
use tagalong_core::{Detection, DiffDrive, Frame, Verifier};
use tagalong_pipeline::Pipeline;
use tagalong_sim::{CameraKind, Scene, Split, Variant};
use toml::Spanned;
use toml::de::DeTable;

use super::args::{TEST_LOGS, TRAIN_LOGS, TrainArgs};
use super::card::CandidateCounts;
use super::held_out::{Comparison, Effect, Tally};
use super::in_use::{InUse, pipeline, read_table};
use super::photos::{self, fingerprint, photos};
use super::plan::Plan;
use super::rooms::ImageTiming;
use super::seen::{AnnotatedFrame, Label, in_log, in_scene, label};
use super::{rooms, seen};

/// Absolute log-odds below which a judgement is uncertain.
const UNSURE: f64 = 1.0;

/// State of one training.
pub struct Session<'a> {
    /// Arguments of the command.
    pub args: &'a TrainArgs,
    /// Known plugins.
    pub registry: &'a Registry,
    /// Amount of simulated data.
    pub plan: Plan,
    /// Texts of the scenes that are simulated instead of random rooms.
    worlds: Vec<String>,
    /// Settings of the plugin.
    pub settings: toml::Table,
    /// Path of the model.
    pub model: PathBuf,
    /// Progress.
    pub bar: ProgressBar,
}

impl<'a> Session<'a> {
    /// Reads the settings.
    ///
    /// # Errors
    /// Settings that cannot be read: exit code 2.
    pub fn new(args: &'a TrainArgs, registry: &'a Registry) -> Result<Self, Failure> {
        let model = args.output.clone().unwrap_or_else(|| {
            // A cascade is a file in OpenCV's format.
            let is_cascade = registry.training_offer(&args.plugin).data == TrainingData::Faces;
            let kind = if is_cascade { "xml" } else { "toml" };
            Path::new("configs/models").join(&args.plugin).with_extension(kind)
        });
        let bar = ProgressBar::new(1);
        if let Ok(style) = ProgressStyle::with_template("{wide_bar} {percent:>3}% {msg} {eta}") {
            bar.set_style(style);
        }
        let settings = settings(args.settings.as_deref())?;
        let worlds = args.world.iter().map(|path| scene_text(path)).collect::<Result<_, _>>()?;
        Ok(Self { args, registry, plan: Plan::new(args), worlds, settings, model, bar })
    }

    /// Shows the start of a step of a round.
    pub fn tell(&self, round: usize, what: &str) {
        self.bar.set_position(0);
        self.bar.set_message(format!("round {} of {}: {what}", round + 1, self.plan.rounds + 1));
    }

    /// Returns the names of the training data.
    pub fn sources(&self) -> Vec<String> {
        let worlds = self.args.world.iter().filter_map(|path| path.file_stem());
        let mut names: Vec<String> =
            worlds.map(|name| format!("simulated {}", name.to_string_lossy())).collect();
        if names.is_empty() {
            names.push("simulated rooms".to_owned());
        }
        if self.args.data.is_some() {
            names.extend(self.train_logs().map(|log| format!("logs/{log}.mcap")));
            names.extend(
                ["people/inria-64x128", "people/head-shoulder-50", "negatives"].map(String::from),
            );
        }
        names
    }

    /// Returns the annotated logs for training.
    fn train_logs(&self) -> impl Iterator<Item = &'static str> {
        TRAIN_LOGS.into_iter().filter(|log| !self.args.without.iter().any(|name| name == log))
    }

    fn context(&self) -> Context {
        let wheels = DiffDrive { half_separation_m: 0.167, slip: 0.02 };
        Context::new(self.args.seed, ".", wheels)
    }

    /// Builds the trainer of the plugin.
    ///
    /// # Errors
    /// A plugin that cannot be trained, or wrong settings: exit code 2.
    pub fn trainer(&self) -> Result<Box<dyn Trainer>, Failure> {
        let mut settings = self.settings.clone();
        if self.args.quick {
            fill_in(&mut settings, quick_settings(self.registry, &self.args.plugin)?);
        }
        with_value(&settings, |value| {
            self.registry.build_trainer(&self.args.plugin, value, &self.context())
        })
    }

    /// Returns the verifier with the model of the last round.
    ///
    /// # Errors
    /// A model that the plugin refuses: exit code 2.
    pub fn verifier(&self) -> Result<Box<dyn Verifier>, Failure> {
        with_value(&self.with_model()?, |value| {
            self.registry.build_verifier(&self.args.plugin, value, &self.context())
        })
    }

    // An absolute path, because relative ones start at the config's folder.
    fn with_model(&self) -> Result<toml::Table, Failure> {
        let absolute = std::path::absolute(&self.model).map_err(Failure::failed)?;
        let mut settings = self.settings.clone();
        settings.insert("model".into(), absolute.display().to_string().into());
        Ok(settings)
    }

    /// Passes candidates to the trainer: all of them in the first round, after that those that the
    /// verifier judges wrongly or with a small margin.
    ///
    /// # Errors
    /// A plugin that fails, or data that cannot be read: exit code 1.
    pub fn collect_hard_negatives(
        &self,
        round: usize,
        trainer: &mut dyn Trainer,
        mut doubter: Option<Box<dyn Verifier>>,
    ) -> Result<CandidateCounts, Failure> {
        let mut counts = CandidateCounts::default();
        let mut show = |frame: &Frame, candidate: &Detection, example: Example| {
            counts.seen += 1;
            if let Some(verifier) = &mut doubter {
                let log_odds = verifier.log_odds(frame, candidate).map_err(Failure::failed)?;
                let right = if example.is_person { log_odds } else { -log_odds };
                counts.mistakes += u64::from(right < 0.0);
                // Only mistakes and uncertain cases are added, because the model is right about the
                // rest.
                if right >= UNSURE {
                    return Ok(());
                }
            }
            let count = if example.is_person { &mut counts.people } else { &mut counts.others };
            *count += 1;
            trainer.add(frame, candidate, example).map_err(Failure::failed)
        };
        let numbers = self.plan.numbers(round, self.args.seed);
        self.tell(round, "drawing scenes");
        self.bar.set_length(numbers.end - numbers.start);
        for number in numbers {
            let scene = self.scene(Split::Train, number, self.plan.look)?;
            let in_use = self.in_use(scene.camera.kind)?;
            let mut pipeline = pipeline(&in_use.proposing()?, self.registry)?;
            in_scene(&scene, threads(None), in_use.stereo()?, &mut |seen| {
                propose(&mut pipeline, seen, |_| number, &mut show)
            })?;
            self.bar.inc(1);
        }
        let Some(data) = &self.args.data else { return Ok(counts) };
        self.tell(round, "reading logs and photographs");
        // The logs do not change, so later rounds would repeat their candidates.
        if round == 0 {
            let proposing = self.in_use(CameraKind::Rgbd)?.proposing()?;
            for log in self.train_logs() {
                let mut pipeline = pipeline(&proposing, self.registry)?;
                self.in_log(data, log, &mut |seen| {
                    propose(
                        &mut pipeline,
                        seen,
                        |who| fingerprint(&format!("{log} {who:?}")),
                        &mut show,
                    )
                })?;
            }
        }
        // The remainder by 5 marks the held-out groups, so the share is taken from the quotient.
        let share = if self.args.quick { 8 } else { 1 };
        let photos = photos(data, false);
        self.bar.set_length(photos.len() as u64);
        for photo in photos.iter().filter(|p| p.group / 5 % share == 0) {
            photo.visit(round as u64, &mut show)?;
            self.bar.inc(1);
        }
        Ok(counts)
    }

    /// Returns a scene of a split: the next of the given ones in turn, or a random room.
    fn scene(&self, split: Split, number: u64, look: ImageTiming) -> Result<Scene, Failure> {
        if self.worlds.is_empty() {
            return rooms::scene(split, number, look).map_err(Failure::failed);
        }
        let text = &self.worlds[(number % self.worlds.len() as u64) as usize];
        let scene = Scene::parse_with(text, &Variant::of_split(split, number));
        // Webcams would cost time, and no pipeline looks at them.
        Ok(Scene { webcams: Vec::new(), ..scene.map_err(Failure::usage)? })
    }

    /// Returns the pipeline for which a verifier is trained.
    fn in_use(&self, kind: CameraKind) -> Result<InUse, Failure> {
        match &self.args.proposes {
            Some(path) => InUse::as_it_is(path),
            None => InUse::of(kind),
        }
    }

    fn in_log(&self, data: &Path, log: &str, see: seen::See<'_>) -> Result<(), Failure> {
        let path = data.join("logs").join(log);
        in_log(&path.with_extension("mcap"), &path.with_extension("people.csv"), see)
    }

    /// Returns the final pipeline, without and with the verifier.
    fn comparison(&self, in_use: &InUse) -> Result<Comparison, Failure> {
        let verified = in_use.verified(&self.args.plugin, self.with_model()?);
        let configs = [in_use.proposing()?, in_use.plain(), verified];
        Comparison::new(configs.each_ref().map(String::as_str), self.verifier()?, self.registry)
    }

    /// Scores the verifier in held-out rooms.
    ///
    /// # Errors
    /// A plugin that fails: exit code 1.
    pub fn try_rooms(&self) -> Result<Effect, Failure> {
        self.bar.set_message("trying held-out rooms");
        self.bar.set_position(0);
        self.bar.set_length(self.plan.test_scenes);
        let mut tally = Tally::default();
        for number in 0..self.plan.test_scenes {
            let scene = self.scene(Split::Test, number, self.plan.test_look)?;
            let in_use = self.in_use(scene.camera.kind)?;
            let mut comparison = self.comparison(&in_use)?;
            tally.next_scene();
            in_scene(&scene, threads(None), in_use.stereo()?, &mut |seen| {
                comparison.step(seen, &mut tally)
            })?;
            self.bar.inc(1);
        }
        Ok(tally.effect())
    }

    /// Scores the verifier on held-out logs, if there are data.
    ///
    /// # Errors
    /// As for [`Session::try_rooms`], and a log that cannot be read.
    pub fn try_logs(&self) -> Result<Option<Effect>, Failure> {
        let Some(data) = &self.args.data else { return Ok(None) };
        let mut tally = Tally::default();
        for log in TEST_LOGS {
            let mut comparison = self.comparison(&self.in_use(CameraKind::Rgbd)?)?;
            tally.next_scene();
            self.in_log(data, log, &mut |seen| comparison.step(seen, &mut tally))?;
        }
        Ok(Some(tally.effect()))
    }
}

/// Passes on the proposals of the detector that can be labelled with the truth.
fn propose(
    pipeline: &mut Pipeline,
    seen: &AnnotatedFrame,
    group: impl Fn(Option<i64>) -> u64,
    show: photos::Take<'_>,
) -> Result<(), Failure> {
    let report = pipeline.step(&seen.frame).map_err(Failure::failed)?;
    for candidate in &report.candidates {
        let (is_person, who) = match label(&candidate.detection, &seen.people) {
            Label::Person(id) => (true, Some(id)),
            Label::Nobody => (false, None),
            Label::Part | Label::Unclear => continue,
        };
        show(&seen.frame, &candidate.detection, Example { is_person, group: group(who) })?;
    }
    Ok(())
}

/// Returns the settings of a plugin with fewer combinations, for a quick trial.
fn quick_settings(registry: &Registry, plugin: &str) -> Result<toml::Table, Failure> {
    let text = registry.training_offer(plugin).quick_settings;
    text.parse().map_err(|error: toml::de::Error| {
        Failure::failed(format!("the quick settings that `{plugin}` offers: {error}"))
    })
}

/// Adds the values that the settings of the user do not contain, also in nested tables.
fn fill_in(settings: &mut toml::Table, offered: toml::Table) {
    for (key, value) in offered {
        match (settings.get_mut(&key), value) {
            (None, value) => {
                settings.insert(key, value);
            }
            (Some(toml::Value::Table(inner)), toml::Value::Table(offered)) => {
                fill_in(inner, offered);
            }
            (Some(_), _) => {}
        }
    }
}

/// Reads a scene.
fn scene_text(path: &Path) -> Result<String, Failure> {
    read_text(path, FileLimit::Config)
        .map_err(|error| Failure::usage(format!("{}: {error}", path.display())))
}

/// Reads the settings of a plugin, if there are any.
fn settings(path: Option<&Path>) -> Result<toml::Table, Failure> {
    path.map_or_else(|| Ok(toml::Table::new()), read_table)
}

/// Builds something from a table of settings.
fn with_value<T>(
    settings: &toml::Table,
    build: impl FnOnce(Option<tagalong_config::Value<'_>>) -> Result<T, ConfigError>,
) -> Result<T, Failure> {
    let text = settings.to_string();
    let table = DeTable::parse(&text).map_err(Failure::usage)?;
    let span = table.span();
    let value = Spanned::new(span, toml::de::DeValue::Table(table.into_inner()));
    build(Some(value)).map_err(|error| Failure::usage(error.message))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offered_settings_fill_gaps_and_replace_nothing() {
        let mut settings: toml::Table = "[training]\nfolds = 3\n".parse().unwrap();
        let offered = "weight = 2.0\n[training]\nfolds = 2\ngammas = [2.0]\n".parse().unwrap();
        fill_in(&mut settings, offered);
        let expected = "weight = 2.0\n[training]\nfolds = 3\ngammas = [2.0]\n".parse().unwrap();
        assert_eq!(settings, expected);
    }
}
