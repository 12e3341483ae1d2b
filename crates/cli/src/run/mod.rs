//! `tagalong run`: reads a log and a config, writes a directory of results.

mod args;
mod choice;
mod each_camera;
mod frames;
mod images;
mod pace;
mod pictures;
mod report;
mod summary;

use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::time::Instant;

pub use args::{Overlaid, RunArgs};
use frames::{Frames, Item};
use pace::Pace;
use pictures::Pictures;
use report::{FileFacts, RunReport, Tally};
use summary::{doctor, quoted};
use tagalong::logs::sources_of;
use tagalong_app::choice::uses_camera;
use tagalong_app::config_file::{ConfigFile, OuterSettings, refused_log};
use tagalong_app::format::Format;
use tagalong_app::frame_notes::{FRAME_NOTES_TOPIC, FrameNotes};
use tagalong_app::lacking::Lacking;
use tagalong_app::misfit::{COMPARE, Traits, misfit_note};
use tagalong_app::origin::Origin;
use tagalong_app::outcome::{Ended, Failure, Outcome, print, refused, say};
use tagalong_app::progress::Progress;
use tagalong_app::remedies::{Remedies, reach_m};
use tagalong_app::serialize::to_json;
use tagalong_app::signals::Signals;
use tagalong_app::suggest::check_log_path;
use tagalong_app::threads::threads;
use tagalong_app::timings::Timings;
use tagalong_app::unable::unable;
use tagalong_config::Registry;
use tagalong_core::Stamp;
use tagalong_log::write::{FrameNames, FrameRecord, RunDir, RunTexts, TrackLog};
use tagalong_log::{FrameSource, Input, Inputs, Usage, is_loss};
use tagalong_pipeline::{FrameReport, MissingSource, Pipeline, ResolvedConfig, StepError};
use tagalong_render::{Overlay, OverlayData, background};
use tagalong_simulate::sample;
use tagalong_view::Live;

/// Runs a pipeline over a log, until a signal comes.
///
/// # Errors
/// A config, log or output directory that cannot be used; a plugin that fails on a frame; frames that
/// all lack an input; a disk that fails.
pub fn run(args: &RunArgs, registry: &Registry) -> Outcome {
    if args.each_camera {
        return each_camera::run(args, registry);
    }
    run_until(args, registry, Signals::listen)
}

/// Runs a pipeline over a log, for a program with signals of its own: `listen` is called once the
/// log has been looked through, before anything is written.
pub fn run_until(
    args: &RunArgs,
    registry: &Registry,
    listen: impl FnOnce() -> Result<Signals, Failure>,
) -> Outcome {
    // A name that is no config must not cost a simulation.
    if let Some(path) = args.config().filter(|_| !args.has_log()) {
        ConfigFile::read(path)?.pipeline(registry, args.seed)?;
    }
    if !args.has_log() {
        sample::write(args.log()).map_err(refused)?;
        say(&format!("no log given: two simulated people walk through {}", args.log().display()));
    }
    let job = Progress::waiting(&format!("looking through {}", args.log().display()), || {
        Job::prepare(args, registry)
    })?;
    // Until here nothing is written: a signal ends the program at once, however long the log is.
    let signals = listen()?;
    if let Some(signal) = signals.received() {
        return Ok(Ended::BySignal(signal));
    }
    let mut desk = Desk::open(args, &job)?;
    // Reading ahead pays from the second core on, rendering in parallel from the third.
    let threads = threads(args.threads);
    let mut pictures = Pictures::new(desk.overlay.take(), threads);
    let mut frames = Frames::new(job.source, threads);
    let mut pipeline = job.pipeline;
    pipeline.visualise(args.overlay.is_some());
    let live =
        args.serve.map(|at| serve(at, args, registry, &job.resolved, &job.report)).transpose()?;
    let mut pace = Pace::new(args.realtime);
    let stopped = {
        let stage = Stage { desk: &mut desk, pictures: &mut pictures, live: live.as_ref() };
        work(&mut pipeline, &mut frames, &mut pace, stage, &signals)
    };
    if let Some(live) = live {
        live.finish("The run has ended.");
    }
    // An error of the run is returned only after the threads have finished.
    pictures.finish()?;
    let source = frames.finish()?;
    desk.close(args, job.report, source, stopped?, &signals)
}

/// Everything that is read and checked before anything is written.
struct Job {
    pipeline: Pipeline,
    outer: OuterSettings,
    source: FrameSource,
    resolved: ResolvedConfig,
    folder: PathBuf,
    report: RunReport,
    remedies: Remedies,
}

impl Job {
    fn prepare(args: &RunArgs, registry: &Registry) -> Result<Self, Failure> {
        let named = args.config().map(ConfigFile::read).transpose()?;
        let is_named = named.is_some();
        check_log_path(args.log())?;
        let config = match named {
            Some(config) => config,
            None if !args.has_log() => ConfigFile::built_in()?,
            None => choice::choose(args.log(), registry, &args.input)?,
        };
        let config = config.on_log(args.log());
        let threads = args.threads.map(usize::from);
        let (mut pipeline, settings) = config.pipeline_on(registry, args.seed, threads)?;
        let outer = args.input.applied(config.outer_for(&pipeline)?);
        let folder = args.output.clone().unwrap_or_else(|| default_folder(args, &config));
        RunDir::check(&folder, args.overwrite, args.log()).map_err(refused)?;
        let inputs = pipeline.inputs();
        // A picture shows colour, whether or not the pipeline uses it.
        let wants_pictures = args.overlay.is_some() || args.with_images || args.serve.is_some();
        let inputs = if wants_pictures { inputs.accept(Input::Colour) } else { inputs };
        if args.input.camera.is_some() && !uses_camera(inputs) {
            return Err(camera_for_nothing(&config, inputs));
        }
        let source = FrameSource::open(args.log(), &outer.input, &outer.limits, inputs)
            .map_err(|error| refused_log(error, pipeline.config()))?;
        let unsteered = pipeline.check_sources(sources_of(&source)).err();
        if let Some(why) = &unsteered {
            if is_named {
                return Err(cannot_steer(&config, args.log(), why));
            }
            // A config that the program chose is for the tracks alone.
            pipeline = pipeline.without_controller().map_err(Failure::failed)?;
        }
        let resolved = outer.resolved_with(pipeline.config())?;
        let log = FileFacts { name: log_name(args), sha256: source.facts().sha256.clone() };
        let mut report = blank_report(&config, settings.seed, log);
        report.inputs = source.account().clone();
        if !args.quiet {
            report.inputs.lines().iter().for_each(|line| say(line));
        }
        let misfits = Traits::of(&source).misfits(&settings.suits);
        let misfit = misfit_note(&config.name(), &[(log_name(args), misfits)]);
        report.notes.extend(misfit.map(|note| format!("{note}; {COMPARE}")));
        report.notes.extend(config.notes()?);
        if unsteered.is_some() {
            report.notes.push(WITHOUT_COMMANDS.into());
        }
        let remedies = Remedies::new(registry);
        Ok(Self { pipeline, outer, source, resolved, folder, report, remedies })
    }
}

/// Note on a log that lacks a source of the controller of the config that was chosen for it.
const WITHOUT_COMMANDS: &str = "the log lacks an input of the controller (odometry, or an obstacle \
                                sensor): its people are tracked, but none is followed";

/// Returns the failure of a log that lacks a source of the controller, with the command and the config that
/// track the log all the same.
pub(crate) fn cannot_steer(config: &ConfigFile, log: &Path, why: &MissingSource) -> Failure {
    let shown = log.display();
    let command = quoted(&shown.to_string());
    Failure::failed(format!(
        "`{shown}`: {why}\n`tagalong run {command}` tracks its people without commands to a robot; so does a \
         config of these two lines:\n  extends = \"{}\"\n  controller.plugin = \"none\"",
        config.name()
    ))
}

/// Returns the failure of `--camera` with a pipeline that uses none.
fn camera_for_nothing(config: &ConfigFile, inputs: Inputs) -> Failure {
    let used: Vec<&str> = inputs.of(Usage::Required).map(|input| input.name()).collect();
    Failure::usage(format!(
        "--camera names a camera, and {} uses none, but {}: leave out --camera, or take another config",
        config.stem(),
        used.join(" and ")
    ))
}

/// Returns `runs/LOG-CONFIG`, or `runs/LOG-CONFIG-CAMERA` for a camera that is asked for.
fn default_folder(args: &RunArgs, config: &ConfigFile) -> PathBuf {
    let log = args.log().file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let mut name = format!("{log}-{}", config.stem());
    if let Some(camera) = &args.input.camera {
        name = format!("{name}-{}", each_camera::folder_name(camera));
    }
    Path::new("runs").join(name)
}

fn log_name(args: &RunArgs) -> String {
    args.log().file_name().unwrap_or_default().to_string_lossy().into_owned()
}

fn blank_report(config: &ConfigFile, seed: u64, log: FileFacts) -> RunReport {
    RunReport {
        tagalong: env!("CARGO_PKG_VERSION"),
        ended: "complete".into(),
        config: FileFacts { name: config.name(), sha256: config.sha256() },
        seed,
        log,
        ..RunReport::default()
    }
}

/// Begins to serve the page of what happens now, and prints its address.
fn serve(
    at: SocketAddr,
    args: &RunArgs,
    registry: &Registry,
    resolved: &ResolvedConfig,
    report: &RunReport,
) -> Result<Live, Failure> {
    let name = report.config.name.trim_end_matches(".toml");
    let live = Live::start(at, name, &log_name(args), resolved.values(), registry);
    let live = live.map_err(|error| {
        Failure::usage(format!(
            "cannot serve on {at}: {error}; name another port with --serve=PORT"
        ))
    })?;
    say(&format!(
        "live: open {} in a browser; anyone with this address sees the page",
        live.address()
    ));
    if !at.ip().is_loopback() {
        say("live: anyone in this network with the address sees the images; on another computer, \
             replace 0.0.0.0 by the IP address of this one");
    }
    Ok(live)
}

/// Everything that takes the report of a frame.
struct Stage<'a> {
    desk: &'a mut Desk,
    pictures: &'a mut Pictures,
    live: Option<&'a Live>,
}

/// Processes one frame after the other until the log ends, the pipeline fails or a signal comes; a
/// frame that lacks an input is left out. `Some` is the error of the plugin that ended it.
fn work(
    pipeline: &mut Pipeline,
    frames: &mut Frames,
    pace: &mut Pace,
    stage: Stage<'_>,
    signals: &Signals,
) -> Result<Option<StepError>, Failure> {
    let Stage { desk, pictures, live } = stage;
    let progress = Progress::new();
    loop {
        let waiting = Instant::now();
        let Some(item) = frames.next(signals) else { return Ok(None) };
        pace.wait_for(item.frame.frame.stamp, signals);
        desk.timings.add("read", ms_since(waiting));
        desk.tally.read(item.frame.odom_stale);
        let report = match desk.lacking.step(pipeline, &item.frame.frame) {
            Ok(Some(report)) => report,
            Ok(None) => continue,
            Err(error) => return Ok(Some(error)),
        };
        let people = report.tracks.iter().filter(|track| track.confirmed && track.seen).count();
        progress.show(item.progress, report.index, people);
        desk.take(&item, &report)?;
        if let Some(live) = live {
            live.offer(&item.frame.frame, &item.frame.odom_from_robot, &report);
        }
        desk.pass_image(&item, &report)?;
        pictures.draw(|| scene(&item, report))?;
    }
}

fn scene(item: &Item, report: FrameReport) -> OverlayData {
    OverlayData::of(&item.frame.frame, item.frame.odom_from_robot, report)
}

fn ms_since(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}

/// Name of the time from one frame of the log to the next.
const PERIOD: &str = "period";

/// Writers and counters of the results.
struct Desk {
    log: TrackLog,
    overlay: Option<Overlay>,
    tally: Tally,
    lacking: Lacking,
    timings: Timings,
    /// Times from one frame of the log to the next.
    periods: Timings,
    last: Option<Stamp>,
    with_images: bool,
    is_odom_known: bool,
    remedies: Remedies,
}

impl Desk {
    fn open(args: &RunArgs, job: &Job) -> Result<Self, Failure> {
        let dir = RunDir::create(&job.folder, args.overwrite, args.log()).map_err(refused)?;
        let overlay = match args.overlay {
            None => None,
            Some(overlaid) => {
                let style = overlaid.style(job.outer.output.boxes);
                let style = style.reaching(reach_m(job.resolved.values()).unwrap_or_default());
                Some(Overlay::new(dir.overlay().map_err(refused)?, style))
            }
        };
        let input = &job.outer.input;
        let camera = job.source.facts().camera_frame.clone();
        let names = FrameNames {
            base: input.base_frame.clone(),
            odom: input.odom_frame.clone(),
            camera: camera.unwrap_or_else(|| "camera".into()),
        };
        let log = TrackLog::create(dir, names, job.outer.output.clone(), job.resolved.to_toml())
            .map_err(refused)?;
        let log = if args.smoothed { log.with_smoothed() } else { log };
        let tally = Tally::default();
        let timings = Timings::default();
        let remedies = job.remedies.clone();
        Ok(Self {
            log,
            overlay,
            tally,
            lacking: Lacking::default(),
            timings,
            periods: Timings::default(),
            last: None,
            with_images: args.with_images,
            is_odom_known: !job.source.lacks_usable_odometry(),
            remedies,
        })
    }

    /// Adds the report of a frame.
    fn take(&mut self, item: &Item, report: &FrameReport) -> Result<(), Failure> {
        self.tally.add(report);
        if !report.outcome.is_processed() {
            report.timings.iter().for_each(|(stage, ms)| self.timings.add(stage, *ms));
            return Ok(());
        }
        self.timings.add_frame(&report.timings);
        let last = self.last.replace(report.stamp);
        if let Some(last) = last {
            self.periods.add(PERIOD, 1e3 * report.stamp.seconds_since(last));
        }
        let writing = Instant::now();
        let record = FrameRecord {
            index: report.index,
            stamp: report.stamp,
            camera: &item.frame.frame.camera,
            odom_from_robot: &item.frame.odom_from_robot,
            is_odom_known: self.is_odom_known,
            tracks: &report.tracks,
            joints: &report.joints(),
            target: report.target,
            command: report.command.map(|command| command.wheels),
        };
        self.log.write(&record)?;
        for correction in &report.corrections {
            self.log.correct(correction.since, report.index, correction.ids);
        }
        let notes = FrameNotes::of(report, &item.frame.frame.camera, &item.frame.odom_from_robot);
        self.log.write_json(FRAME_NOTES_TOPIC, report.stamp, &notes)?;
        self.timings.add("write", ms_since(writing));
        Ok(())
    }

    /// Adds the image of a frame, where that is wanted.
    fn pass_image(&mut self, item: &Item, report: &FrameReport) -> Result<(), Failure> {
        if !self.with_images || !report.outcome.is_processed() {
            return Ok(());
        }
        let Some(image) = background(&item.frame.frame.images()) else { return Ok(()) };
        let jpeg = images::jpeg(&image)?;
        Ok(self.log.write_image(report.stamp, &jpeg)?)
    }

    /// Finishes the files and prints a summary.
    fn close(
        self,
        args: &RunArgs,
        mut report: RunReport,
        source: Option<FrameSource>,
        mut stopped: Option<StepError>,
        signals: &Signals,
    ) -> Outcome {
        self.tally.fill(&mut report);
        if signals.received().is_none() {
            stopped = stopped.or_else(|| self.lacking.failure().cloned());
        }
        let warnings = self.lacking.warnings();
        report.lacking = self.lacking.into_groups();
        report.frames.lacking = report.lacking.iter().map(|group| group.frames).sum();
        describe_source(&mut report, source);
        describe_end(&mut report, stopped.as_ref(), signals);
        // Without a single processed frame the output would be an empty directory that looks like a
        // result.
        let is_empty = report.frames.read == 0 && signals.received().is_none();
        if report.frames.processed == 0 && (stopped.is_some() || is_empty) {
            self.log.discard()?;
            return verdict(args, &report, &warnings, stopped, signals, &self.remedies);
        }
        let times = to_json("timings.json", &self.timings.summary())?;
        let json = to_json("report.json", &report)?;
        let origin = to_json("origin.json", &Origin::of(args.log(), args.config()))?;
        let texts = RunTexts { report: &json, timings: &times, origin: &origin };
        let folder = self.log.finish(about(&report), &texts)?;
        match args.format {
            _ if args.quiet => {}
            Format::Json => print(&json)?,
            Format::Text => {
                let period_ms = self.periods.summary().get(PERIOD).map(|times| times.p50_ms);
                print(&summary::text(&report, &self.timings, period_ms, &folder, args))?;
            }
        }
        verdict(args, &report, &warnings, stopped, signals, &self.remedies)
    }
}

/// Adds the counters and notes of the reader.
fn describe_source(report: &mut RunReport, source: Option<FrameSource>) {
    let Some(source) = source else {
        report.notes.push("the reader was still waiting for its input".into());
        return;
    };
    report.counters =
        source.counters().iter().map(|(name, count)| ((*name).to_owned(), *count)).collect();
    report.notes.extend(source.notes().iter().cloned());
    report.data_lost = source.data_lost();
}

fn describe_end(report: &mut RunReport, stopped: Option<&StepError>, signals: &Signals) {
    if let Some(error) = stopped {
        report.ended = format!("failed: {error}");
    } else if let Some(signal) = signals.received() {
        report.ended = format!("stopped by signal {signal}");
    }
}

/// Returns the metadata record of `tracks.mcap`.
fn about(report: &RunReport) -> BTreeMap<String, String> {
    BTreeMap::from([
        ("version".into(), report.tagalong.into()),
        ("seed".into(), report.seed.to_string()),
        ("config_sha256".into(), report.config.sha256.clone()),
        ("log_sha256".into(), report.log.sha256.clone()),
    ])
}

/// Returns the message about a log of which no frame could be made.
fn no_frame(report: &RunReport, args: &RunArgs) -> String {
    let telling = report.counters.iter().filter(|(name, _)| is_loss(name));
    let reasons: Vec<String> =
        telling.map(|(name, count)| format!("{} {count}", name.replace('_', " "))).collect();
    let why =
        if reasons.is_empty() { "it has no image or scan".to_owned() } else { reasons.join(", ") };
    let name = &report.log.name;
    format!("no frame could be made from {name}: {why}; `{}` tells more", doctor(report, args))
}

/// Returns the exit code, and the reason for a failure.
fn verdict(
    args: &RunArgs,
    report: &RunReport,
    warnings: &[String],
    stopped: Option<StepError>,
    signals: &Signals,
    remedies: &Remedies,
) -> Outcome {
    for note in &report.notes {
        say(&format!("note: {note}"));
    }
    for warning in warnings {
        say(&format!("warning: {warning}"));
    }
    match stopped {
        // The error is the plugin's, and the results before it are written.
        Some(error @ StepError::Panic { .. }) => {
            return Err(Failure { code: 3, message: error.to_string() });
        }
        Some(error) => return Err(Failure::failed(error)),
        None => {}
    }
    if let Some(signal) = signals.received() {
        return Ok(Ended::BySignal(signal));
    }
    if report.frames.read == 0 {
        return Err(Failure::failed(no_frame(report, args)));
    }
    let tests = report.funnel.iter().map(|line| line.test);
    if let Some(why) = unable(&report.config.name, tests, !report.persons.is_empty(), remedies) {
        return Err(Failure::failed(why));
    }
    match (report.data_lost, args.strict) {
        (false, _) => Ok(Ended::Well),
        (true, false) => Ok(Ended::WithLoss),
        (true, true) => Err(Failure::failed("part of the log was lost, and --strict was given")),
    }
}
