//! Tasks of a benchmark: pipelines on logs, each with an identifying hash.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use tagalong_app::config_file::{ConfigFile, OuterSettings};
use tagalong_app::misfit::{COMPARE, Traits, misfits_note};
use tagalong_app::outcome::{Failure, say};
use tagalong_app::recorded_boxes::RecordedBoxes;
use tagalong_app::scoring::{TruthFile, files_of};
use tagalong_app::suggest::{self, check_log_path, toml_files};
use tagalong_config::{Registry, path_text};
use tagalong_log::{
    COPY_OF, FrameSource, InputSettings, Inputs, Limits, LogError, read_attachment,
};
use tagalong_math::counted;
use tagalong_pipeline::{Suits, Tunable};

use super::args::PlanArgs;
use super::made_with;

pub mod facts;

/// Prefix of the inputs that are files named by a config.
const FILE: &str = "file ";

/// One pipeline on one log with one seed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Task {
    /// Number in the plan, from 1.
    pub k: usize,
    /// Hash of everything on which its result depends.
    pub hash: String,
    /// Name of the pipeline.
    pub pipeline: String,
    /// Path of its config, or of the tracks of another program.
    #[serde(with = "path_text")]
    pub config: PathBuf,
    /// Name of the log.
    pub log_name: String,
    /// Name of the room of the log, if rooms were given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub room: Option<String>,
    /// True if the frames of the log are not tracked over time.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub single_frames: bool,
    /// Frames of the log in which people are neither missed nor found.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub unjudged: Vec<u32>,
    /// Path of the log.
    #[serde(with = "path_text")]
    pub log: PathBuf,
    /// Path of its truth.
    #[serde(with = "path_text")]
    pub truth: PathBuf,
    /// True if the boxes of the truth are whole bodies.
    pub whole_bodies: bool,
    /// True if only the first of several people with the same ID in a frame of the truth is kept.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub drops_doubled_ids: bool,
    /// Seed of the run.
    pub seed: u64,
    /// Hashed inputs, by name.
    pub inputs: BTreeMap<String, String>,
    /// SHA-256 of the recording from which `tagalong alter` made the log, if the log is such a
    /// copy.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub copy_of: Option<String>,
    /// True if shipped models or settings of the pipeline were made with this recording.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub made_with_log: bool,
    /// Version of the program that planned it.
    pub version: String,
    /// Reason why it cannot run, if there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub skip: Option<String>,
}

/// Config that was read, with its inputs.
pub struct PlannedConfig {
    /// The config.
    pub file: ConfigFile,
    /// Path of the config.
    pub path: PathBuf,
    first_seed: u64,
    /// Its settings outside of the pipeline.
    pub outer: OuterSettings,
    /// Inputs of its pipeline.
    pub inputs: Inputs,
    /// Its settings that may be tuned.
    pub tune: Vec<Tunable>,
    /// Robots and cameras for which it is suitable.
    suits: Suits,
    /// Hashes of the recordings with which its shipped models and settings were made.
    made_with: BTreeSet<String>,
    /// True if it contains the name of the log.
    differs_by_log: bool,
}

impl PlannedConfig {
    /// Opens a log with this pipeline's settings.
    ///
    /// # Errors
    /// A log that lacks an input that the pipeline needs, or that cannot be read.
    pub fn open(&self, log: &Path) -> Result<FrameSource, LogError> {
        FrameSource::open(log, &self.outer.input, &self.outer.limits, self.inputs)
    }

    /// Returns a key of its input settings: pipelines with the same key see the same frames.
    pub fn reading(&self) -> String {
        format!("{:?}", (&self.outer.input, &self.outer.limits, self.inputs))
    }
}

/// Log with its truth.
pub struct Annotated {
    /// Path of the log.
    pub log: PathBuf,
    /// Name in tables.
    pub name: String,
    /// Hash of the log.
    pub sha256: String,
    /// Hash of the recording from which `tagalong alter` made the log, if the log is such a copy.
    pub copy_of: Option<String>,
    /// Path of its truth.
    pub truth: PathBuf,
    /// Hash of the truth.
    pub truth_sha256: String,
    /// True if the boxes of the truth are whole bodies.
    pub whole_bodies: bool,
    /// True if only the first of several people with the same ID in a frame of the truth is kept.
    pub drops_doubled_ids: bool,
    /// Frames in which people are neither missed nor found.
    pub unjudged: Vec<u32>,
    /// Name of its room, if rooms were given.
    pub room: Option<String>,
    /// True if its frames are not tracked over time.
    pub single_frames: bool,
}

impl Annotated {
    /// Returns the options with which its truth is read, as text for a hash.
    pub fn reading(&self) -> String {
        let doubled = if self.drops_doubled_ids { "\nfirst of doubled ids" } else { "" };
        let unjudged = if self.unjudged.is_empty() {
            String::new()
        } else {
            format!("\nwithout {:?}", self.unjudged)
        };
        format!("\n{}{doubled}{unjudged}", self.whole_bodies)
    }

    /// Returns a task on this log, without the values that depend on the pipeline.
    pub fn task(&self) -> Task {
        Task {
            k: 0,
            hash: String::new(),
            pipeline: String::new(),
            config: PathBuf::new(),
            log_name: self.name.clone(),
            room: self.room.clone(),
            single_frames: self.single_frames,
            unjudged: self.unjudged.clone(),
            log: self.log.clone(),
            truth: self.truth.clone(),
            whole_bodies: self.whole_bodies,
            drops_doubled_ids: self.drops_doubled_ids,
            seed: 0,
            inputs: BTreeMap::new(),
            copy_of: self.copy_of.clone(),
            made_with_log: false,
            version: String::new(),
            skip: None,
        }
    }
}

/// Plans a benchmark.
///
/// # Errors
/// Configs or logs that cannot be read, or two of the same name.
pub fn plan(args: &PlanArgs, registry: &Registry) -> Result<Vec<Task>, Failure> {
    // An error in a config should be reported before long logs are read.
    for path in &args.configs {
        ConfigFile::read(path)?;
    }
    let logs = logs(args)?;
    let configs = configs(args, &logs[0].log, registry)?;
    let foreign = args.tracks.iter().map(|tracks| tracks.name.clone());
    let stems = configs.iter().map(|config| config.file.stem());
    unique("configs or tracks", stems.chain(foreign))?;
    unique("logs", logs.iter().map(|log| log.name.clone()))?;
    let version = version()?;
    let mut tasks = Vec::new();
    let mut unsuited = vec![Vec::new(); configs.len()];
    for log in &logs {
        let mut tried: BTreeMap<String, Opened> = BTreeMap::new();
        for (config, unsuited) in configs.iter().zip(&mut unsuited) {
            let own;
            let config = if config.differs_by_log {
                own = candidate_on(&config.path, Some(&log.log), registry)?;
                &own
            } else {
                config
            };
            let key = config.reading();
            // Opening a log is slow, so the result is shared by configs that read it the same way.
            let opened = match tried.get(&key) {
                Some(known) => known.clone(),
                None => tried.entry(key).or_insert(opened(config, log)?).clone(),
            };
            let skip = match opened {
                Ok(traits) => {
                    unsuited.push((log.name.clone(), traits.misfits(&config.suits)));
                    None
                }
                Err(why) => Some(why),
            };
            for offset in 0..args.seeds {
                let seed = config.first_seed.wrapping_add(offset);
                let mut task = task(config, log, seed, &version, registry)?;
                (task.k, task.skip) = (tasks.len() + 1, skip.clone());
                tasks.push(task);
            }
        }
        for tracks in &args.tracks {
            tasks.push(Task { k: tasks.len() + 1, ..tracks.task(log, &version)? });
        }
    }
    for config in &configs {
        for boxes in RecordedBoxes::of(&config.file) {
            let name = config.file.stem();
            let logs = if config.differs_by_log { 1 } else { logs.len() };
            let notes = [boxes.note(), boxes.note_on_logs(&name, logs)];
            notes.iter().flatten().for_each(|note| say(&format!("note: {note}")));
        }
    }
    let names = configs.iter().map(|config| config.file.stem());
    let unsuited: Vec<_> = names.zip(unsuited).collect();
    if let Some(note) = misfits_note(&unsuited) {
        say(&format!("note: {note}; {COMPARE}"));
    }
    say(&size(args, configs.len(), logs.len(), tasks.len()));
    Ok(tasks)
}

/// Returns the number of tasks in words, with the option that limits it if it was not given.
fn size(args: &PlanArgs, configs: usize, logs: usize, tasks: usize) -> String {
    let [configs, logs] = [counted(configs, "config"), counted(logs, "log")];
    let seeds = if args.seeds > 1 { format!(", {} seeds", args.seeds) } else { String::new() };
    let limit = if args.configs.is_empty() { "; --configs limits them" } else { "" };
    format!("{} planned: {configs} on {logs}{seeds}{limit}", counted(tasks, "task"))
}

/// Reads the config of a task again.
///
/// # Errors
/// If it, or its truth, changed since the task was planned.
pub fn reread(task: &Task, registry: &Registry) -> Result<PlannedConfig, Failure> {
    let candidate = candidate_on(&task.config, Some(&task.log), registry)?;
    let mut now = task.inputs.clone();
    // The list of files is built again, because the config may now name other files.
    now.retain(|name, _| !name.starts_with(FILE));
    now.insert("config".into(), config_hash(&candidate, task.seed, registry)?);
    now.insert("truth".into(), sha256_of_file(&task.truth)?);
    now.extend(files(&candidate)?);
    if now == task.inputs {
        return Ok(candidate);
    }
    let config = task.config.display();
    let truth = task.truth.display();
    Err(Failure::usage(format!("{config} or {truth} changed since it was planned; plan again")))
}

fn files(candidate: &PlannedConfig) -> Result<BTreeMap<String, String>, Failure> {
    file_hashes(&candidate.file)
}

/// Returns the hashes of the files that a config names, such as models.
///
/// # Errors
/// A file that cannot be read.
pub fn file_hashes(config: &ConfigFile) -> Result<BTreeMap<String, String>, Failure> {
    let named = config.files().into_iter();
    named.map(|(name, path)| Ok((format!("{FILE}{name}"), sha256_of_file(&path)?))).collect()
}

/// Returns the version of this program, including a hash of its bytes, because plugins may differ
/// while the version number does not.
///
/// # Errors
/// If the program cannot read itself.
pub fn version() -> Result<String, Failure> {
    let program = std::env::current_exe().map_err(Failure::failed)?;
    let hash = sha256_of_file(&program)?;
    Ok(format!("{}+{}", env!("CARGO_PKG_VERSION"), &hash[..12]))
}

fn task(
    config: &PlannedConfig,
    log: &Annotated,
    seed: u64,
    version: &str,
    registry: &Registry,
) -> Result<Task, Failure> {
    let mut inputs = BTreeMap::from([
        ("config".to_owned(), config_hash(config, seed, registry)?),
        ("log".to_owned(), log.sha256.clone()),
        ("truth".to_owned(), log.truth_sha256.clone()),
    ]);
    inputs.extend(files(config)?);
    // The hash identifies the result, so it covers the program and the seed as well.
    let everything = format!("{version}\n{seed}{}\n{inputs:?}", log.reading());
    Ok(Task {
        hash: sha256(everything.as_bytes())[..32].to_owned(),
        pipeline: config.file.stem(),
        config: config.path.clone(),
        seed,
        inputs,
        made_with_log: config.made_with.contains(log.copy_of.as_ref().unwrap_or(&log.sha256)),
        version: version.to_owned(),
        ..log.task()
    })
}

/// Returns the hash of the resolved config: comments and order do not affect it, changed defaults
/// do.
fn config_hash(config: &PlannedConfig, seed: u64, registry: &Registry) -> Result<String, Failure> {
    let (pipeline, _) = config.file.pipeline(registry, Some(seed))?;
    let resolved = config.outer.resolved_with(pipeline.config())?;
    Ok(sha256(resolved.to_toml().as_bytes()))
}

/// Properties of a log that a config can read, or the reason why it cannot.
type Opened = Result<Traits, String>;

/// Returns the reason why the config cannot run on the log, if there is one.
///
/// # Errors
/// A log that cannot be read at all.
pub fn why_not(config: &PlannedConfig, log: &Annotated) -> Result<Option<String>, Failure> {
    Ok(opened(config, log)?.err())
}

/// Opens a log as a config reads it.
fn opened(config: &PlannedConfig, log: &Annotated) -> Result<Opened, Failure> {
    match config.open(&log.log) {
        Ok(source) => Ok(Ok(Traits::of(&source))),
        Err(
            error @ (LogError::Missing { .. }
            | LogError::UnknownTopic { .. }
            | LogError::Calibration { .. }),
        ) => {
            let text = error.to_string();
            // The first line names the problem, the others give advice; the folder must not appear
            // in the report.
            let first = text.lines().next().unwrap_or_default();
            Ok(Err(first.replace(&log.log.display().to_string(), &log.name)))
        }
        Err(error) => Err(error.into()),
    }
}

/// Returns the compared configs; those that contain the name of the log are as they are for the
/// first log.
fn configs(
    args: &PlanArgs,
    first: &Path,
    registry: &Registry,
) -> Result<Vec<PlannedConfig>, Failure> {
    if !args.configs.is_empty() {
        let named = args.configs.iter();
        return named.map(|path| candidate_on(path, Some(first), registry)).collect();
    }
    // Outside of a clone, the built-in configs that need no file are compared.
    if toml_files(Path::new("configs")).is_empty() {
        return ConfigFile::built_in_names()
            .map(|name| candidate(Path::new(name), registry))
            .collect();
    }
    shipped(registry)
}

/// Reads every config in configs.
///
/// # Errors
/// If there is none.
pub fn shipped(registry: &Registry) -> Result<Vec<PlannedConfig>, Failure> {
    let mut found = Vec::new();
    for path in toml_files(Path::new("configs")) {
        match candidate(&path, registry) {
            Ok(candidate) => found.push(candidate),
            // An invalid config in the folder must not prevent the others from running.
            Err(why) => say(&format!("note: left out: {}", why.message)),
        }
    }
    if found.is_empty() {
        return Err(Failure::usage("no config in the folder configs; name some with --configs"));
    }
    Ok(found)
}

/// Reads a config.
///
/// # Errors
/// Any mistake in it.
pub fn candidate(path: &Path, registry: &Registry) -> Result<PlannedConfig, Failure> {
    candidate_on(path, None, registry)
}

/// Reads a config as it applies to a log.
fn candidate_on(
    path: &Path,
    log: Option<&Path>,
    registry: &Registry,
) -> Result<PlannedConfig, Failure> {
    let file = ConfigFile::read(path)?;
    let differs_by_log = file.differs_by_log();
    let file = match log {
        Some(log) => file.on_log(log),
        None => file,
    };
    let (pipeline, settings) = file.pipeline(registry, None)?;
    let outer = file.outer()?;
    let first_seed = settings.seed;
    let tune = settings.tune;
    let suits = settings.suits;
    let inputs = pipeline.inputs();
    let made_with = made_with::recordings_of(&file, pipeline.config().values())?;
    let path = path.to_owned();
    Ok(PlannedConfig {
        file,
        path,
        first_seed,
        outer,
        inputs,
        tune,
        suits,
        made_with,
        differs_by_log,
    })
}

fn logs(args: &PlanArgs) -> Result<Vec<Annotated>, Failure> {
    let mut found = Vec::new();
    for log in &args.logs {
        check_log_path(log)?;
        found.push(with_truth(log)?);
    }
    for log in args.logs_dir.as_deref().map_or(Ok(Vec::new()), mcap_files)? {
        match annotated(&log)? {
            Some(annotated) => found.push(annotated),
            None => {
                say(&format!(
                    "note: left out: {} has no truth; {}",
                    log.display(),
                    makes_truth(&log)
                ));
            }
        }
    }
    if let Some(path) = &args.rooms {
        let names_logs = !args.logs.is_empty() || args.logs_dir.is_some();
        found = if names_logs { facts::in_rooms(path, found) } else { facts::of_rooms(path) }?;
    }
    found.iter_mut().for_each(|log| log.drops_doubled_ids = args.drop_doubled_ids);
    if found.is_empty() {
        return Err(Failure::usage("no log with truth; name some with --logs or --logs-dir"));
    }
    Ok(found)
}

fn mcap_files(folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    if folder.is_file() {
        let file = folder.display();
        return Err(Failure::usage(format!(
            "--logs-dir takes a folder of logs, but {file} is a file: `--logs {file}`"
        )));
    }
    suggest::mcap_files(folder)
        .map_err(|error| Failure::failed(format!("cannot read {}: {error}", folder.display())))
}

/// Returns the log with its truth.
///
/// # Errors
/// A log without truth, or one that cannot be read.
pub fn with_truth(log: &Path) -> Result<Annotated, Failure> {
    annotated(log)?.ok_or_else(|| {
        Failure::usage(format!(
            "{} has no truth: none of {} beside it, and no channel {} in it; {}",
            log.display(),
            files_of(log),
            tagalong_log::TRUTH_TOPIC,
            makes_truth(log)
        ))
    })
}

/// Returns the way to obtain truth for a log that has none: people cannot be annotated in scans
/// alone.
fn makes_truth(log: &Path) -> String {
    let settings = InputSettings::default();
    let opened = FrameSource::open(log, &settings, &Limits::default(), Inputs::ANY);
    let is_blind = opened.is_ok_and(|source| source.facts().width == 0);
    if is_blind {
        return "without images people cannot be annotated: give their positions as \
                NAME.people-floor.csv beside it"
            .into();
    }
    format!("`tagalong annotate {}` makes one", log.display())
}

/// Returns the log with its truth, if it has any.
fn annotated(log: &Path) -> Result<Option<Annotated>, Failure> {
    let Some((truth, whole_bodies)) = TruthFile::beside(log)? else { return Ok(None) };
    Ok(Some(Annotated {
        log: log.to_owned(),
        name: log.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
        sha256: sha256_of_file(log)?,
        copy_of: copy_of(log),
        truth_sha256: sha256_of_file(&truth)?,
        truth,
        whole_bodies,
        drops_doubled_ids: false,
        unjudged: Vec::new(),
        room: None,
        single_frames: false,
    }))
}

/// Returns the hash of the recording of which a log is a copy.
fn copy_of(log: &Path) -> Option<String> {
    // Logs of other formats have no attachments, and read errors are found elsewhere.
    let bytes = read_attachment(log, COPY_OF, &Limits::default()).ok().flatten()?;
    String::from_utf8(bytes).ok()
}

/// Rejects a name that is used twice, because names identify rows of tables.
///
/// # Errors
/// The repeated name.
pub fn unique(what: &str, names: impl Iterator<Item = String>) -> Result<(), Failure> {
    let mut seen = BTreeSet::new();
    for name in names {
        if !seen.insert(name.clone()) {
            return Err(Failure::usage(format!("two {what} are called `{name}`; rename one")));
        }
    }
    Ok(())
}

/// Returns the SHA-256 in hexadecimal.
pub fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Returns the SHA-256 of a file's bytes.
///
/// # Errors
/// A file that cannot be read.
pub fn sha256_of_file(path: &Path) -> Result<String, Failure> {
    hash_of_file(path)
        .map_err(|error| Failure::failed(format!("cannot read {}: {error}", path.display())))
}

fn hash_of_file(path: &Path) -> io::Result<String> {
    let mut file = File::open(path)?;
    // Read in blocks, because a log may be larger than the memory.
    let mut hash = Sha256::new();
    let mut buffer = vec![0; 1 << 16];
    loop {
        match file.read(&mut buffer)? {
            0 => return Ok(hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()),
            count => hash.update(&buffer[..count]),
        }
    }
}

/// Returns a task of a pipeline on some log, for tests.
#[cfg(test)]
pub fn planned_for_tests(pipeline: &str) -> Task {
    let log = Annotated {
        log: "logs/hall.mcap".into(),
        name: "hall".into(),
        sha256: String::new(),
        copy_of: None,
        truth: "logs/hall.people.csv".into(),
        truth_sha256: String::new(),
        whole_bodies: false,
        drops_doubled_ids: false,
        unjudged: Vec::new(),
        room: None,
        single_frames: false,
    };
    Task {
        k: 1,
        hash: pipeline.into(),
        pipeline: pipeline.into(),
        config: "a.toml".into(),
        ..log.task()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_in_the_place_of_a_folder_of_logs_is_answered_with_the_option_for_it() {
        let home = tempfile::tempdir().unwrap();
        let log = home.path().join("walk.mcap");
        std::fs::write(&log, "").unwrap();
        let why = mcap_files(&log).unwrap_err().message;
        assert!(why.contains(&format!("`--logs {}`", log.display())), "{why}");
    }

    #[test]
    fn the_size_of_a_plan_names_the_option_that_limits_it() {
        let mut args = PlanArgs { seeds: 1, ..PlanArgs::default() };
        let all = size(&args, 38, 8, 304);
        assert_eq!(all, "304 tasks planned: 38 configs on 8 logs; --configs limits them");
        (args.configs, args.seeds) = (vec!["a.toml".into()], 3);
        assert_eq!(size(&args, 1, 2, 6), "6 tasks planned: 1 config on 2 logs, 3 seeds");
    }
}
