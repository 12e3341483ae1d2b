use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::origin::Origin;
use crate::outcome::Failure;
use crate::suggest::{is_run, runs_in};
use serde::Deserialize;
use tagalong_eval::Report;
use tagalong_eval::formats::{Timeline, kitti, metres, mot};

use super::{Reports, odd_labels, read_text, without_area};

/// Tracks as written by a tracker.
#[derive(Clone, Debug, Default)]
pub struct Tracks {
    /// Reports by the number of the frame.
    pub reports: Reports,
    /// Name of the log, if the tracks are those of a run.
    pub log_name: Option<String>,
    /// Path of that log according to the run, if it still exists.
    pub log_path: Option<PathBuf>,
    /// True if positions are in the robot frame.
    pub in_robot_frame: bool,
    /// Notes on lines that may have another meaning than intended.
    pub notes: Vec<String>,
}

/// The used part of a run's `report.json`.
#[derive(Deserialize)]
struct RunFacts {
    log: LogName,
    #[serde(default = "complete")]
    ended: String,
}

/// Returns the end of a run that was not stopped, as in its report.
fn complete() -> String {
    "complete".into()
}

#[derive(Deserialize)]
struct LogName {
    name: String,
}

impl Tracks {
    /// Reads tracks: MOTChallenge or KITTI text, `tracks-metres.csv`, or the folder of a run;
    /// `length` is the number of frames in the sequence, if that is known.
    ///
    /// # Errors
    /// A file that cannot be read, or that TrackEval would reject; with the name of the file and
    /// the line.
    pub fn read(path: &Path, length: Option<u32>) -> Result<Self, Failure> {
        if path.is_dir() {
            return Self::of_run(path, length);
        }
        // A file in the folder of a run belongs to the log of that run.
        if let Some(run) = path.parent().filter(|folder| is_run(folder)) {
            return Self::of_file(path, length)?.with_facts(run);
        }
        Self::of_file(path, length)
    }

    fn of_file(path: &Path, length: Option<u32>) -> Result<Self, Failure> {
        let text = read_text(path)?;
        let name = path.display().to_string();
        let first = text.lines().next().unwrap_or_default();
        if ["ub_x", "head_x"].iter().any(|column| first.contains(column)) {
            return Err(Failure::usage(format!(
                "{name} is a truth, not tracks: name it as --truth"
            )));
        }
        // Of all formats, only `tracks-metres.csv` begins with this column.
        if first.starts_with("stamp_ns") {
            let reports = places(&text, &name, length)?;
            return Ok(Self { reports, in_robot_frame: true, ..Self::default() });
        }
        if is_kitti(first) {
            Self::of_kitti(&text, &name)
        } else {
            Self::of_boxes(&text, &name, length)
        }
    }

    fn of_boxes(text: &str, name: &str, length: Option<u32>) -> Result<Self, Failure> {
        let rows = mot::parse_tracks(text, name).map_err(Failure::failed)?;
        if let Some(length) = length {
            mot::check_length(&rows, name, length).map_err(Failure::failed)?;
        }
        let notes = without_area(name, rows.iter().map(|row| (row.line, &row.region)));
        let reports = gather(rows.iter().map(mot::Row::report));
        Ok(Self { reports, notes: notes.into_iter().collect(), ..Self::default() })
    }

    /// Reads KITTI labels. Their frames start at 0, those of all other formats at 1.
    fn of_kitti(text: &str, name: &str) -> Result<Self, Failure> {
        let labels = kitti::parse(text, name).map_err(Failure::failed)?;
        let mut timeline = Timeline::new();
        kitti::add_reports(&mut timeline, &labels);
        let frames = timeline.into_frames().into_iter();
        let reports = frames.map(|(number, frame)| (number + 1, frame.reports)).collect();
        let notes = odd_labels(name, &labels);
        Ok(Self { reports, notes, ..Self::default() })
    }

    fn of_run(folder: &Path, length: Option<u32>) -> Result<Self, Failure> {
        if let Some(first) = runs_in(folder).first() {
            let first = first.display();
            let shown = folder.display();
            return Err(Failure::usage(format!(
                "{shown} is a folder of runs: name one of them, as `--tracks {first}`"
            )));
        }
        let (text, name) = text_and_name(folder.join("tracks.csv"))?;
        let mut tracks = Self::of_boxes(&text, &name, length)?;
        let (text, name) = text_and_name(folder.join("tracks-metres.csv"))?;
        merge(&mut tracks.reports, places(&text, &name, length)?);
        Self { in_robot_frame: true, ..tracks }.with_facts(folder)
    }

    /// Adds the information from the folder of a run: its log, and a note if it is incomplete.
    fn with_facts(mut self, folder: &Path) -> Result<Self, Failure> {
        let path = folder.join("report.json");
        let text = read_text(&path)?;
        let facts: RunFacts = serde_json::from_str(&text)
            .map_err(|error| Failure::failed(format!("{}: {error}", path.display())))?;
        if facts.ended != complete() {
            self.notes.push(format!(
                "{}: the run is incomplete ({}); the frames after its end count as frames without \
                 tracks",
                folder.display(),
                facts.ended
            ));
        }
        Ok(Self { log_name: Some(facts.log.name), log_path: log_of(folder), ..self })
    }
}

/// Returns the path of the log of a run, a file or the folder of a recording, if it exists.
fn log_of(run: &Path) -> Option<PathBuf> {
    let text = read_text(&run.join("origin.json")).ok()?;
    let origin: Origin = serde_json::from_str(&text).ok()?;
    (!origin.log.as_os_str().is_empty() && origin.log.exists()).then_some(origin.log)
}

/// Returns the text of a file, and its name for messages.
fn text_and_name(path: PathBuf) -> Result<(String, String), Failure> {
    Ok((read_text(&path)?, path.display().to_string()))
}

fn is_kitti(first: &str) -> bool {
    // The third field of KITTI is a class name, where MOTChallenge has a number.
    let class = first.split_whitespace().nth(2);
    !first.contains(',') && class.is_some_and(|field| field.parse::<f64>().is_err())
}

fn gather(rows: impl IntoIterator<Item = (u32, Report)>) -> Reports {
    let mut reports = Reports::new();
    for (number, report) in rows {
        reports.entry(number).or_default().push(report);
    }
    reports
}

/// Returns the positions of the seen tracks, because `tracks.csv` only has boxes of these.
fn places(text: &str, name: &str, length: Option<u32>) -> Result<Reports, Failure> {
    let rows = metres::parse(text, name).map_err(Failure::failed)?;
    if let Some(length) = length {
        metres::check_length(&rows, name, length).map_err(Failure::failed)?;
    }
    let seen = rows.iter().filter(|row| row.seen);
    Ok(gather(seen.map(|row| row.report(metres::Floor::Robot))))
}

/// Adds the positions to the boxes, and tracks that have a position but no box.
fn merge(reports: &mut Reports, places: Reports) {
    for (number, places) in places {
        let frame = reports.entry(number).or_default();
        let mut by_id: BTreeMap<i64, usize> =
            frame.iter().enumerate().map(|(index, report)| (report.id, index)).collect();
        for place in places {
            match by_id.remove(&place.id) {
                Some(index) => frame[index].floor_m = place.floor_m,
                None => frame.push(place),
            }
        }
    }
}
