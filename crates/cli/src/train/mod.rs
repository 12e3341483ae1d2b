//! `tagalong train`: trains the model file of a plugin on simulated rooms, annotated logs and
//! photographs, and writes a card with its origin and its scores.
//!
//! A verifier is trained on the proposals of the detector, since these are its later inputs. The
//! first model is then applied to new rooms, and candidates that it judges wrongly or with a small
//! margin are added before the next fit.

mod card;
mod faces;
mod frames;
mod held_out;
mod in_use;
#[cfg(test)]
mod overlap;
mod panorama;
mod photos;
mod rooms;
mod seen;
mod wide_rooms;
mod windows;

use std::fs;
use std::path::{Path, PathBuf};

use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use tagalong_config::{ConfigError, Context, Example, Kind, Registry, Trainer};
use tagalong_core::{Detection, DiffDrive, Frame, Verifier};
use tagalong_pipeline::Pipeline;
use tagalong_sim::{CameraKind, Split};
use toml::Spanned;
use toml::de::DeTable;

use self::card::{Card, Harvest};
use self::held_out::{Comparison, Effect, Tally};
use self::in_use::InUse;
use self::photos::{fingerprint, photos};
use self::rooms::ImageTiming;
use self::seen::{AnnotatedFrame, Label, in_log, in_scene, label};
use crate::outcome::{Ended, Failure, Outcome, print, say};
use crate::simulate::threads;

/// Margin below which a judgement is unsure: log-odds.
const UNSURE: f64 = 1.0;

/// Annotated logs for training ...
const TRAIN_LOGS: [&str; 2] = ["filinha", "um"];
/// ... and one of another room, which is held out.
const TEST_LOGS: [&str; 1] = ["lab2-camera2"];

/// Arguments of `tagalong train`.
#[derive(Args, Debug)]
pub struct TrainArgs {
    /// The plugin to train, for example `svm-patch`; `omni-distance` is the model
    /// of the detector `omni-appearance`, `cascade` that of `face-rgbd`.
    pub plugin: String,
    /// Output file of the model; its card is written beside it [default:
    /// configs/models/<plugin>.toml].
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// A folder of real data (logs, people, negatives); without it, only simulated rooms are used.
    #[arg(long, value_name = "DIR")]
    pub data: Option<PathBuf>,
    /// Settings of the plugin, a TOML file.
    #[arg(long, value_name = "FILE")]
    pub settings: Option<PathBuf>,
    /// A quick training, to see that it works; the model is poor.
    #[arg(long)]
    pub quick: bool,
    /// Scenes that are simulated for the first round of a verifier [default: 256]; more of them
    /// take longer, and help a large model.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(4..=900))]
    pub scenes: Option<u64>,
    /// Further rounds of a verifier, each of which adds the model's mistakes to the training data
    /// [default: 2].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(0..=8))]
    pub rounds: Option<u64>,
    /// A config with the detector that proposes the candidates of a verifier, as it is, instead of
    /// those of `depth-ekf` and `stereo-best` with low thresholds.
    #[arg(long, value_name = "CONFIG")]
    pub proposes: Option<PathBuf>,
    /// Seed of everything random.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
}

/// Amount of simulated data.
struct Plan {
    /// Scenes of the first round and of each further one.
    scenes: [u64; 2],
    rounds: usize,
    test_scenes: u64,
    /// Few images per second: distant moments are more informative than neighbouring ones.
    look: ImageTiming,
    /// Rate and duration for tests; tracks need more images.
    test_look: ImageTiming,
}

impl Plan {
    fn new(args: &TrainArgs) -> Self {
        let (scenes, rounds) = (args.scenes, args.rounds.map(|rounds| rounds as usize));
        let look = ImageTiming { rate_hz: 1.0, duration_s: 7.0 };
        if args.quick {
            let test_look = ImageTiming { rate_hz: 4.0, duration_s: 2.0 };
            let rounds = rounds.unwrap_or(1);
            Self { scenes: [scenes.unwrap_or(6), 4], rounds, test_scenes: 4, look, test_look }
        } else {
            let test_look = ImageTiming { rate_hz: 5.0, duration_s: 4.0 };
            Self {
                scenes: [scenes.unwrap_or(256), 64],
                rounds: rounds.unwrap_or(2),
                test_scenes: 36,
                look,
                test_look,
            }
        }
    }

    /// Returns the numbers of the scenes of a round; no number is repeated.
    fn numbers(&self, round: usize, seed: u64) -> std::ops::Range<u64> {
        let [first, further] = self.scenes;
        let before = if round == 0 { 0 } else { first + (round as u64 - 1) * further };
        let count = if round == 0 { first } else { further };
        let start = seed.wrapping_mul(1000) % 1_000_000 + before;
        start..start + count
    }
}

/// State of one training.
struct Session<'a> {
    args: &'a TrainArgs,
    registry: &'a Registry,
    plan: Plan,
    settings: toml::Table,
    model: PathBuf,
    bar: ProgressBar,
}

/// Runs `tagalong train`.
///
/// # Errors
/// A plugin that cannot be trained and wrong settings are exit code 2; files that cannot be read or
/// written are 1.
pub fn train(args: &TrainArgs, registry: &Registry) -> Outcome {
    let session = Session::new(args, registry)?;
    // Its samples come from the truth and not from proposals, so it skips the rounds below.
    if args.plugin == panorama::NAME {
        return panorama::train(&session, args);
    }
    let mut trainer = session.trainer()?;
    if args.plugin == frames::NAME {
        return frames::train(&session, trainer.as_mut());
    }
    let is_detector = registry.find(&args.plugin).is_ok_and(|info| info.kind == Kind::Detector);
    if is_detector || args.plugin == faces::NAME {
        return windows::train(&session, trainer.as_mut());
    }
    let mut card = Card::new(args, session.plan.scenes[0], session.sources());
    let mut doubter: Option<Box<dyn Verifier>> = None;
    for round in 0..=session.plan.rounds {
        let harvest = session.harvest(round, trainer.as_mut(), doubter)?;
        session.tell(round, "fitting");
        session.bar.set_length(1000);
        let fitted = trainer
            .fit(&mut |part| session.bar.set_position((1000.0 * part) as u64))
            .map_err(Failure::failed)?;
        // Written first: the verifier loads the model from its file.
        write(&session.model, &fitted.model)?;
        doubter = Some(session.verifier()?);
        card.rounds.push(harvest);
        card.fit = fitted.figures;
    }
    card.held_out_rooms = session.try_rooms()?;
    card.held_out_logs = session.try_logs()?;
    session.bar.finish_and_clear();
    let path = session.model.with_extension("card.toml");
    write(&path, &card.to_text())?;
    print(&card.summary())?;
    say(&format!("{} and {}", session.model.display(), path.display()));
    Ok(Ended::Well)
}

impl<'a> Session<'a> {
    fn new(args: &'a TrainArgs, registry: &'a Registry) -> Result<Self, Failure> {
        let model = args.output.clone().unwrap_or_else(|| {
            // A cascade is a file of OpenCV's kind.
            let kind = if args.plugin == faces::NAME { "xml" } else { "toml" };
            Path::new("configs/models").join(&args.plugin).with_extension(kind)
        });
        let bar = ProgressBar::new(1);
        if let Ok(style) = ProgressStyle::with_template("{wide_bar} {percent:>3}% {msg} {eta}") {
            bar.set_style(style);
        }
        let settings = settings(args.settings.as_deref())?;
        Ok(Self { args, registry, plan: Plan::new(args), settings, model, bar })
    }

    fn tell(&self, round: usize, what: &str) {
        self.bar.set_position(0);
        self.bar.set_message(format!("round {} of {}: {what}", round + 1, self.plan.rounds + 1));
    }

    fn sources(&self) -> Vec<String> {
        let mut names = vec!["drawn rooms".to_owned()];
        if self.args.data.is_some() {
            names.extend(TRAIN_LOGS.map(|log| format!("logs/{log}.mcap")));
            names.extend(
                ["people/inria-64x128", "people/head-shoulder-50", "negatives"].map(String::from),
            );
        }
        names
    }

    fn context(&self) -> Context {
        let wheels = DiffDrive { half_separation_m: 0.167, slip: 0.02 };
        Context { seed: self.args.seed, base_dir: PathBuf::from("."), wheels }
    }

    fn trainer(&self) -> Result<Box<dyn Trainer>, Failure> {
        let mut settings = self.settings.clone();
        if self.args.quick {
            settings.extend(quick_settings(&self.args.plugin));
        }
        with_value(&settings, |value| {
            self.registry.build_trainer(&self.args.plugin, value, &self.context())
        })
    }

    /// Returns the verifier with the model of the last round.
    fn verifier(&self) -> Result<Box<dyn Verifier>, Failure> {
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
    /// verifier judges wrongly or is unsure of.
    fn harvest(
        &self,
        round: usize,
        trainer: &mut dyn Trainer,
        mut doubter: Option<Box<dyn Verifier>>,
    ) -> Result<Harvest, Failure> {
        let mut harvest = Harvest::default();
        let mut show = |frame: &Frame, candidate: &Detection, example: Example| {
            harvest.seen += 1;
            if let Some(verifier) = &mut doubter {
                let margin = verifier.log_odds(frame, candidate).map_err(Failure::failed)?;
                let right = if example.is_person { margin } else { -margin };
                harvest.mistakes += u64::from(right < 0.0);
                // Only mistakes and unsure cases are added: the model is right about the rest.
                if right >= UNSURE {
                    return Ok(());
                }
            }
            let count = if example.is_person { &mut harvest.people } else { &mut harvest.others };
            *count += 1;
            trainer.add(frame, candidate, example).map_err(Failure::failed)
        };
        let numbers = self.plan.numbers(round, self.args.seed);
        self.tell(round, "drawing scenes");
        self.bar.set_length(numbers.end - numbers.start);
        for number in numbers {
            let scene =
                rooms::scene(Split::Train, number, self.plan.look).map_err(Failure::failed)?;
            let in_use = self.in_use(scene.camera.kind)?;
            let mut pipeline = pipeline(&in_use.proposing()?, self.registry)?;
            in_scene(&scene, threads(None), in_use.stereo()?, &mut |seen| {
                propose(&mut pipeline, seen, |_| number, &mut show)
            })?;
            self.bar.inc(1);
        }
        let Some(data) = &self.args.data else { return Ok(harvest) };
        self.tell(round, "reading logs and photographs");
        // The logs do not change, so later rounds would repeat their candidates.
        if round == 0 {
            let proposing = self.in_use(CameraKind::Rgbd)?.proposing()?;
            for log in TRAIN_LOGS {
                let mut pipeline = pipeline(&proposing, self.registry)?;
                let group = |who: Option<i64>| fingerprint(&format!("{log} {who:?}"));
                self.in_log(data, log, &mut |seen| propose(&mut pipeline, seen, group, &mut show))?;
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
        Ok(harvest)
    }

    /// Returns the pipeline that a verifier is trained for.
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

    /// Returns the pipeline in use, without and with the verifier.
    fn comparison(&self, in_use: &InUse) -> Result<Comparison, Failure> {
        let verified = in_use.verified(&self.args.plugin, self.with_model()?);
        let configs = [in_use.proposing()?, in_use.plain(), verified];
        Comparison::new(configs.each_ref().map(String::as_str), self.verifier()?, self.registry)
    }

    fn try_rooms(&self) -> Result<Effect, Failure> {
        self.bar.set_message("trying held-out rooms");
        self.bar.set_position(0);
        self.bar.set_length(self.plan.test_scenes);
        let mut tally = Tally::default();
        for number in 0..self.plan.test_scenes {
            let scene =
                rooms::scene(Split::Test, number, self.plan.test_look).map_err(Failure::failed)?;
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

    fn try_logs(&self) -> Result<Option<Effect>, Failure> {
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

/// Passes on the detector's proposals that the truth can label.
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

fn pipeline(text: &str, registry: &Registry) -> Result<Pipeline, Failure> {
    let built = Pipeline::from_toml(text, Path::new("."), registry);
    built.map(|(pipeline, _)| pipeline).map_err(Failure::usage)
}

/// Returns settings with fewer combinations, for a quick trial.
fn quick_settings(plugin: &str) -> toml::Table {
    let text = match plugin {
        "svm-patch" => "[training]\ngammas = [2.0, 8.0]\npenalties = [1.0, 10.0]\nmax_tried = 300",
        "body-net" => "[training]\nepochs = 2",
        "depth-net" => "[training]\nsteps = 40\nreal_steps = 10",
        "color-texture" => "[training]\ntrees = [25, 50]",
        "hog-upper-body" => "[training]\nmining_rounds = 1\nepochs = 10",
        "cascade" => "[training]\nstages = 4\nfeatures = 200",
        _ => "",
    };
    text.parse().unwrap_or_default()
}

fn settings(path: Option<&Path>) -> Result<toml::Table, Failure> {
    let Some(path) = path else { return Ok(toml::Table::new()) };
    let wrong = |why: String| Failure::usage(format!("{}: {why}", path.display()));
    let text = fs::read_to_string(path).map_err(|error| wrong(error.to_string()))?;
    text.parse().map_err(|error: toml::de::Error| wrong(error.to_string()))
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

fn write(path: &Path, text: &str) -> Result<(), Failure> {
    let failed = |error| Failure::failed(format!("cannot write {}: {error}", path.display()));
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder).map_err(failed)?;
    }
    fs::write(path, text).map_err(failed)
}
