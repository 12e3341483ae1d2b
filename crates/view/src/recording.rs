//! Recorded run: frames with tracks, candidates and funnel, and its config.

use std::path::{Path, PathBuf};

use crate::page::moment::{Moment, TrackState};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use tagalong_app::frame_notes::{FRAME_NOTES_TOPIC, FrameNotes};
use tagalong_app::origin::Origin;
use tagalong_app::outcome::Failure;
use tagalong_app::suggest::{is_run, runs_in};
use tagalong_config::{FileLimit, read_text};
use tagalong_log::msgs::{StringMsg, decode};
use tagalong_log::{Limits, LogFile, LogWalker, read_attachment};
use toml::Table;

/// Topic of the tracks as JSON in `tracks.mcap`.
const TRACKS_TOPIC: &str = "/people/tracks_json";
/// Least time that is shown in a result, s.
const SHOWN_S: f64 = 0.05;

/// Run of a pipeline over a log.
#[derive(Clone, Debug, Default)]
pub struct Recording {
    /// Folder of the run.
    pub folder: PathBuf,
    /// Name of the log, its hash, and the config.
    pub report: ReportFacts,
    /// Paths of the log and the config, as far as they are recorded.
    pub origin: Origin,
    /// Resolved config; empty if it cannot be read.
    pub config: Table,
    /// Frames inside of the window, in the order of their stamps.
    pub moments: Vec<Moment>,
    /// Interval of the frames: 1 if all are there, 2 for every second one.
    pub every: u64,
    /// Time of the last frame of the run, inside of the window or not, s since the first.
    pub length_s: f64,
}

/// Part of a log, s since its first frame.
#[derive(Clone, Copy, Debug, Default)]
pub struct Span {
    /// First time; `None` for the beginning.
    pub from_s: Option<f64>,
    /// Last time; `None` for the end.
    pub to_s: Option<f64>,
}

/// Limits on the frames that are read, because a run of a day must not fill the memory.
#[derive(Clone, Copy, Debug)]
pub struct Window {
    /// Part of the log.
    span: Span,
    /// First frame of all runs, ns.
    first_ns: u64,
    /// Largest number of frames; if there are more, every second, fourth or eighth is kept.
    most: usize,
}

impl Window {
    /// Creates a window on the runs of some folders.
    ///
    /// # Errors
    /// A folder that is not a run, or a run without data on its frames.
    pub fn of<'a>(
        folders: impl IntoIterator<Item = &'a PathBuf>,
        span: Span,
        most: usize,
    ) -> Result<Self, Failure> {
        let mut first_ns = u64::MAX;
        for folder in folders {
            let mut frames = Frames::open(&tracks_of(folder)?)?;
            let first = frames.next_moment()?.ok_or_else(|| frames.without_notes())?;
            first_ns = first_ns.min(first.notes.stamp_ns);
        }
        Ok(Self { span, first_ns, most })
    }

    fn contains(&self, stamp_ns: u64) -> bool {
        let t_s = stamp_ns.saturating_sub(self.first_ns) as f64 * 1e-9;
        self.span.from_s.is_none_or(|from| t_s >= from) && self.span.to_s.is_none_or(|to| t_s <= to)
    }
}

/// Part of a run's `report.json` that is used.
#[derive(Clone, Debug, Default, Deserialize)]
pub struct ReportFacts {
    /// End of the run.
    pub ended: String,
    /// The log.
    pub log: FileFacts,
    /// The config.
    pub config: FileFacts,
    /// Result of a ride; `None` for a run over a log.
    pub ride: Option<RideFacts>,
    /// Faults that were injected into a ride.
    #[serde(default)]
    pub faults: Vec<FaultFacts>,
}

/// Fault that was injected into a ride.
#[derive(Clone, Debug, Default, Deserialize)]
pub struct FaultFacts {
    /// Its kind.
    pub kind: String,
    /// Its begin, s since the first frame.
    pub from_s: f64,
    /// Its end, s; `None` if it lasts to the end of the ride.
    pub to_s: Option<f64>,
}

impl FaultFacts {
    /// Returns its times in words: "freeze-depth from 5.0 s to the end".
    pub fn in_words(&self) -> String {
        let end = self.to_s.map_or("the end".to_owned(), |to_s| format!("{to_s:.1} s"));
        format!("{} from {:.1} s to {end}", self.kind, self.from_s)
    }
}

/// Result of a ride, as determined by `tagalong follow`.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub struct RideFacts {
    /// Seed of the scene.
    pub seed: u64,
    /// True if the person was followed, or correctly given up, and no other person was followed for
    /// long.
    pub kept: bool,
    /// Most frequent reason of the commands of a robot that never moved.
    pub never_moved: Option<String>,
    /// Length of the ride, s.
    pub time_s: f64,
    /// Time in which the person was in view, s.
    pub in_view_s: f64,
    /// Time in which the lock was on another person or an object, s, including times at rest.
    pub wrong_s: f64,
    /// Time in which the person was followed and walked slowly, s.
    pub slow_s: f64,
    /// Part of that time in which the distance was kept, s.
    pub distance_kept_s: f64,
    /// Least clearance from people while the robot moved, m.
    pub clearance_people_m: Option<f64>,
    /// Least clearance from objects while the robot moved, m.
    pub clearance_things_m: Option<f64>,
    /// Time of the least clearance, s.
    pub nearest_s: Option<f64>,
    /// Periods without the person after the first period with the person.
    pub episodes: Vec<EpisodeFacts>,
}

/// Period of a ride without the person.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default)]
pub struct EpisodeFacts {
    /// Start, s.
    pub lost_s: f64,
    /// Time at which the person was followed again, s.
    pub found_s: Option<f64>,
}

impl RideFacts {
    /// Returns the least clearance from people and objects while the robot moved, m.
    pub fn room_m(&self) -> Option<f64> {
        [self.clearance_people_m, self.clearance_things_m].into_iter().flatten().reduce(f64::min)
    }

    /// Returns true if the robot touched a person or an object while it moved.
    pub fn touches(&self) -> bool {
        self.room_m().is_some_and(|room| room < 0.0)
    }

    /// Returns the share of the time in which the distance was kept.
    pub fn distance_share(&self) -> Option<f64> {
        (self.slow_s > 0.0).then(|| self.distance_kept_s / self.slow_s)
    }

    /// Returns the time from which no person was followed until the end, s.
    pub fn lost_to_the_end_s(&self) -> Option<f64> {
        self.episodes.last().filter(|it| it.found_s.is_none()).map(|it| it.lost_s)
    }

    /// Returns whether the person was kept, in words. A ride that ends without the person says so,
    /// even if no better result was possible.
    pub fn kept_in_words(&self) -> String {
        match (self.kept, self.lost_to_the_end_s()) {
            (true, None) => "the person was kept".to_owned(),
            (true, Some(lost_s)) => format!(
                "the person was lost at {lost_s:.1} s and not seen for long enough to be found again"
            ),
            (false, None) => "the person was not kept".to_owned(),
            (false, Some(lost_s)) => format!("the person was not kept: lost from {lost_s:.1} s on"),
        }
    }

    /// Returns the result in one line.
    pub fn summary(&self) -> String {
        fn metres(room: Option<f64>) -> String {
            room.map_or("-".into(), |room| format!("{room:.2} m"))
        }

        let share = self.distance_share().map_or("-".into(), |s| format!("{:.0} %", 100.0 * s));
        let wrong = if self.wrong_s < SHOWN_S {
            "the lock was never on another person or a thing".to_owned()
        } else {
            format!("the lock was on another person or a thing for {:.1} s", self.wrong_s)
        };
        let stands = self.never_moved.as_ref();
        let stands = stands.map_or(String::new(), |why| format!("; the robot never moved ({why})"));
        format!(
            "{}{stands}{}; least room from the edge of the robot to people {}, to things {}; distance kept for {share} of the time in \
             which the person was followed and walked slowly; {wrong}",
            self.kept_in_words(),
            if self.touches() { "; the robot touched something" } else { "" },
            metres(self.clearance_people_m),
            metres(self.clearance_things_m),
        )
    }
}

/// File of a run.
#[derive(Clone, Debug, Default, Deserialize)]
pub struct FileFacts {
    /// Name without the folder.
    pub name: String,
    /// SHA-256 of its bytes.
    pub sha256: String,
}

/// Message on [`TRACKS_TOPIC`].
#[derive(Deserialize)]
struct TracksMessage {
    stamp_ns: u64,
    target: Option<u32>,
    tracks: Vec<TrackState>,
}

impl Recording {
    /// Reads the folder of a run.
    ///
    /// # Errors
    /// A folder that is not a run, or a run without data on its frames; the message names the
    /// remedy.
    pub fn read(folder: &Path, window: &Window) -> Result<Self, Failure> {
        let tracks = tracks_of(folder)?;
        let report = read_json(&folder.join("report.json"))?;
        // Only the images need it, and they may be found without it.
        let origin = read_json(&folder.join("origin.json")).unwrap_or_default();
        let mut frames = Frames::open(&tracks)?;
        let (moments, every, length_s) = gather(|| frames.next_moment(), window)?;
        let config = read_attachment(&tracks, "config.toml", &Limits::default())?;
        let text = config.and_then(|bytes| String::from_utf8(bytes).ok()).unwrap_or_default();
        let config = toml::from_str(&text).unwrap_or_default();
        Ok(Self { folder: folder.to_owned(), report, origin, config, moments, every, length_s })
    }

    /// Returns the name of its config without the ending.
    pub fn config_name(&self) -> String {
        self.report.config.name.trim_end_matches(".toml").to_owned()
    }
}

fn tracks_of(folder: &Path) -> Result<PathBuf, Failure> {
    let tracks = folder.join("tracks.mcap");
    if tracks.is_file() { Ok(tracks) } else { Err(no_run(folder)) }
}

/// Returns the failure of a path that is not the folder of a run.
fn no_run(folder: &Path) -> Failure {
    let shown = folder.display();
    let parent = folder.parent().filter(|parent| !parent.as_os_str().is_empty());
    let parent = parent.unwrap_or(Path::new("."));
    if folder.is_file() && is_run(parent) {
        let run = parent.display();
        return Failure::usage(format!(
            "{shown} is a file of a run: `tagalong view {run}` shows it"
        ));
    }
    let runs = runs_in(folder);
    if let Some(first) = runs.first() {
        let names: Vec<String> = runs.iter().map(|run| run.display().to_string()).collect();
        let first = first.display();
        return Failure::usage(format!(
            "{shown} is a folder of runs: name one of them, as `tagalong view {first}`; there are: {}",
            names.join(", ")
        ));
    }
    Failure::usage(if folder.is_file() {
        format!(
            "{shown} is a file, not the folder of a run; `tagalong run {shown}` makes one, \
             and prints its name"
        )
    } else if folder.exists() {
        format!("{shown} is no run: it has no tracks.mcap; `tagalong run LOG` makes one")
    } else {
        format!("{shown}: no such folder; `tagalong run LOG` makes one, and prints its name")
    })
}

/// Reads a JSON file.
///
/// # Errors
/// A file that cannot be read, or has another format.
pub fn read_json<T: for<'de> Deserialize<'de>>(path: &Path) -> Result<T, Failure> {
    let shown = path.display();
    let text = read_text(path, FileLimit::Table)
        .map_err(|error| Failure::failed(format!("cannot read {shown}: {error}")))?;
    serde_json::from_str(&text).map_err(|error| Failure::failed(format!("{shown}: {error}")))
}

/// Iterator over the frames of a file of tracks.
struct Frames {
    shown: String,
    walker: LogWalker<LogFile>,
    /// Tracks of the frame whose data come next.
    tracks: Option<TracksMessage>,
}

impl Frames {
    fn open(path: &Path) -> Result<Self, Failure> {
        // Its message names the file.
        let walker = LogWalker::open(path, &Limits::default()).map_err(Failure::failed)?;
        Ok(Self { shown: path.display().to_string(), walker, tracks: None })
    }

    /// Returns the next frame; `None` at the end. An incomplete frame is left out.
    fn next_moment(&mut self) -> Result<Option<Moment>, Failure> {
        let shown = &self.shown;
        while let Some(message) = self.walker.next() {
            let topic = message.channel.topic.as_str();
            if !matches!(topic, TRACKS_TOPIC | FRAME_NOTES_TOPIC) {
                continue;
            }
            let text: StringMsg = decode(message.data)
                .map_err(|error| Failure::failed(format!("{shown}: {error}")))?;
            if topic == TRACKS_TOPIC {
                self.tracks = Some(json_of_topic(&text.data, shown, topic)?);
                continue;
            }
            let notes: FrameNotes = json_of_topic(&text.data, shown, topic)?;
            let found = self.tracks.take().filter(|found| found.stamp_ns == notes.stamp_ns);
            let (tracks, target) =
                found.map(|found| (found.tracks, found.target)).unwrap_or_default();
            return Ok(Some(Moment { notes, tracks, target }));
        }
        Ok(None)
    }

    fn without_notes(&self) -> Failure {
        Failure::failed(format!(
            "{} has no {FRAME_NOTES_TOPIC}: no frame was processed, or an earlier version made the \
             run; repeat it with `tagalong run ... --overwrite`",
            self.shown
        ))
    }
}

/// Parses the JSON of a message; a failure names its file and topic.
fn json_of_topic<T: DeserializeOwned>(text: &str, file: &str, topic: &str) -> Result<T, Failure> {
    serde_json::from_str(text).map_err(|error| Failure::failed(format!("{file}: {topic}: {error}")))
}

/// Returns the failure of a window without a frame.
pub fn no_frames(runs: &[Recording]) -> Failure {
    let length_s = runs.iter().map(|run| run.length_s).fold(0.0, f64::max);
    Failure::usage(format!(
        "no frame lies between --from and --to: the last one of the run is at {length_s:.1} s"
    ))
}

/// Collects the frames of a window; returns them with their interval, and the time of the last
/// frame of the run, s since the first.
fn gather(
    mut next: impl FnMut() -> Result<Option<Moment>, Failure>,
    window: &Window,
) -> Result<(Vec<Moment>, u64, f64), Failure> {
    let mut kept = Vec::new();
    let mut every = 1;
    let mut last_ns = window.first_ns;
    while let Some(moment) = next()? {
        last_ns = last_ns.max(moment.notes.stamp_ns);
        if !window.contains(moment.notes.stamp_ns) || !is_kept(&moment, every) {
            continue;
        }
        kept.push(moment);
        if kept.len() > window.most {
            every *= 2;
            kept.retain(|moment| is_kept(moment, every));
        }
    }
    kept.sort_by_key(|moment| moment.notes.stamp_ns);
    Ok((kept, every, (last_ns - window.first_ns) as f64 * 1e-9))
}

/// Decides by the number of a frame, so that two runs of one log keep the same frames.
fn is_kept(moment: &Moment, every: u64) -> bool {
    moment.notes.frame.saturating_sub(1).is_multiple_of(every)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    /// Numbers of the frames that a window keeps of nine a second apart.
    fn kept(span: Span, most: usize) -> (Vec<u64>, u64) {
        let mut frames = (1..=9).map(|frame| Moment {
            notes: FrameNotes { frame, stamp_ns: frame * 1_000_000_000, ..FrameNotes::default() },
            ..Moment::default()
        });
        let window = Window { span, first_ns: 1_000_000_000, most };
        let (moments, every, length_s) = gather(|| Ok(frames.next()), &window).unwrap();
        assert_eq!(length_s, 8.0, "of the whole run, whatever the window");
        (moments.iter().map(|moment| moment.notes.frame).collect(), every)
    }

    #[test]
    fn a_file_of_a_run_and_a_folder_of_runs_lead_to_the_run() {
        let home = tempfile::tempdir().unwrap();
        let run = home.path().join("walk");
        fs::create_dir(&run).unwrap();
        assert!(no_run(home.path()).message.contains("no tracks.mcap"));
        for name in ["tracks.mcap", "report.json", "tracks.csv"] {
            fs::write(run.join(name), "").unwrap();
        }
        let command = format!("`tagalong view {}`", run.display());
        for path in [home.path().to_owned(), run.join("tracks.mcap"), run.join("tracks.csv")] {
            let why = no_run(&path).message;
            assert!(why.contains(&command), "{why}");
        }
    }

    #[test]
    fn a_window_without_a_frame_tells_the_length_of_the_run() {
        let run = Recording { length_s: 12.34, ..Recording::default() };
        let why = no_frames(&[Recording::default(), run]).message;
        assert!(why.contains("12.3 s"), "{why}");
    }

    #[test]
    fn a_window_keeps_its_span_and_of_too_many_frames_every_second() {
        assert_eq!(kept(Span::default(), 9), ((1..=9).collect(), 1));
        assert_eq!(kept(Span::default(), 8), (vec![1, 3, 5, 7, 9], 2));
        assert_eq!(kept(Span::default(), 3), (vec![1, 5, 9], 4));
        let span = Span { from_s: Some(2.0), to_s: Some(4.0) };
        assert_eq!(kept(span, 3), (vec![3, 4, 5], 1), "all of a part");
    }
}
