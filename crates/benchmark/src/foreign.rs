//! Tracks of other programs, scored together with the pipelines: `--tracks NAME=DIR`.

use std::collections::BTreeMap;
use std::path::Path;

use tagalong_app::outcome::Failure;
use tagalong_app::scoring::{
    Rate, Shots, Tracks, TruthFile, as_upper_bodies, assemble, comparable, comparison,
    misread_notes, with_remedy,
};
use tagalong_app::signals::Signals;
use tagalong_eval::{Clear, Prepared, Role, Sequence, Similarity};
use tagalong_log::{InputSettings, Limits};
use tagalong_report::{MissedPerson, TaskResult};

use super::args::ForeignTracks;
use super::plan::{Annotated, Task, sha256, sha256_of_file};
use super::store::{Store, Stored};
use super::watch::{repaired, score_tracks};
use super::work::{blank, failed, notes_on, truth_of};

/// Extensions of a file of tracks.
const ENDINGS: [&str; 2] = ["txt", "csv"];
/// Name of the input that is the file of tracks.
pub const TRACKS: &str = "tracks";
/// Cause of all misses of another program, and the sentence for it.
const CAUSE: &str = "tracks of another program";
const WHY: &str = "the dropped candidates of another program are not known";

impl ForeignTracks {
    /// Returns the task of scoring the tracks on a log.
    ///
    /// # Errors
    /// A folder that does not exist, or a file that cannot be read.
    pub fn task(&self, log: &Annotated, version: &str) -> Result<Task, Failure> {
        if !self.folder.is_dir() {
            let folder = self.folder.display();
            return Err(Failure::usage(format!("--tracks {}: {folder} is no folder", self.name)));
        }
        let candidates = ENDINGS.map(|ending| self.folder.join(format!("{}.{ending}", log.name)));
        let found = candidates.iter().find(|path| path.is_file());
        let mut inputs = BTreeMap::from([
            ("log".to_owned(), log.sha256.clone()),
            ("truth".to_owned(), log.truth_sha256.clone()),
        ]);
        if let Some(path) = found {
            inputs.insert(TRACKS.to_owned(), sha256_of_file(path)?);
        }
        let [text, table] = ENDINGS.map(|ending| format!("{}.{ending}", log.name));
        let skip = found
            .is_none()
            .then(|| format!("there is no {text} and no {table} with tracks of {}", self.name));
        let everything = format!("{version}\n{}\n{inputs:?}{}", self.name, log.reading());
        Ok(Task {
            hash: sha256(everything.as_bytes())[..32].to_owned(),
            pipeline: self.name.clone(),
            config: found.unwrap_or(&candidates[0]).clone(),
            inputs,
            version: version.to_owned(),
            skip,
            ..log.task()
        })
    }
}

/// Returns true for a task that scores the tracks of another program.
pub fn is_foreign(task: &Task) -> bool {
    task.inputs.contains_key(TRACKS)
}

/// Scores tracks of other programs, log by log; `done` is called for each log with the number of
/// finished tasks. Ends early after a stop signal.
///
/// # Errors
/// A failure of the disk. Tracks that cannot be read are not an error: their result states it.
pub fn score_all(
    tasks: &[Task],
    store: &Store,
    signals: &Signals,
    done: impl Fn(usize),
) -> Result<(), Failure> {
    let mut by_log: BTreeMap<&Path, Vec<&Task>> = BTreeMap::new();
    for task in tasks {
        by_log.entry(&task.log).or_default().push(task);
    }
    for (log, tasks) in by_log {
        if signals.received().is_some() {
            return Ok(());
        }
        // All trackers share the log and its truth, so these are hashed only once.
        let read = check_inputs(tasks[0], &[("log", log), ("truth", &tasks[0].truth)])
            .and_then(|()| Shots::read(log, &InputSettings::default(), &Limits::default()));
        for task in &tasks {
            let scored = match &read {
                Ok(shots) => scored(task, shots),
                Err(failure) => Err(failure.message.clone()),
            };
            let stored = scored.unwrap_or_else(|why| failed(task, &why).0);
            store.put_result(&task.hash, &stored)?;
        }
        done(tasks.len());
    }
    Ok(())
}

/// Scores the tracks of one task.
fn scored(task: &Task, shots: &Shots) -> Result<Stored, String> {
    check_inputs(task, &[(TRACKS, &task.config)]).map_err(|failure| failure.message)?;
    let truth = truth_of(task).map_err(|failure| failure.message)?;
    let tracks = Tracks::read(&task.config, None).map_err(|failure| failure.message)?;
    let mut notes = notes_on(task, &truth, shots);
    let file = task.config.display().to_string();
    let name = &task.pipeline;
    notes.extend(tracks.notes.iter().map(|note| note.replace(&file, &format!("tracks of {name}"))));
    let mut sequence = assemble(&task.log_name, &truth, shots, tracks.reports, Rate(1.0));
    if let Some((cut, note)) = as_upper_bodies(&sequence) {
        sequence = cut;
        notes.push(format!("{name} on {}: {note}", task.log_name));
    }
    if let Some(boxes) = comparable(&sequence, Similarity::Iou) {
        let misread = misread_notes(&boxes, &comparison(&truth, Similarity::Iou));
        notes.extend(misread.iter().map(|note| format!("{name} on {}: {note}", task.log_name)));
    }
    let frames = shots.iter().count() as u64;
    let mut result = TaskResult { frames, ..blank(task) };
    add_missed(&sequence, &truth, &mut result)?;
    let repairs = repaired(&sequence, &truth)?;
    let (result, recording) = score_tracks(sequence, &truth, shots, None, result)?;
    let result = TaskResult { repairs, ..result };
    Ok(Stored { result, recording: Some(recording), notes, ..Stored::default() })
}

/// Rejects files that have changed since they were planned, because the hash of the task covers
/// them.
fn check_inputs(task: &Task, files: &[(&str, &Path)]) -> Result<(), Failure> {
    for (name, path) in files {
        if task.inputs.get(*name) != Some(&sha256_of_file(path)?) {
            let shown = path.display();
            return Err(Failure::usage(format!(
                "{shown} changed since it was planned; plan again"
            )));
        }
    }
    Ok(())
}

/// Adds the people that match no track, frame by frame, without a cause.
fn add_missed(
    sequence: &Sequence,
    truth: &TruthFile,
    result: &mut TaskResult,
) -> Result<(), String> {
    let similarities = [Similarity::Iou, Similarity::Metres];
    let compared = similarities.iter().find_map(|s| Some((comparable(sequence, *s)?, *s)));
    let Some((sequence, similarity)) = compared else { return Ok(()) };
    let prepared = Prepared::new(&sequence, &comparison(truth, similarity))
        .map_err(|error| with_remedy(&error))?;
    let (_, matches) = Clear::measure(&prepared);
    let frames = sequence.frames.iter().zip(&prepared.frames).zip(&matches);
    for (at, ((frame, compared), matches)) in frames.enumerate() {
        for (row, truth) in compared.truths.iter().enumerate() {
            let person = prepared.truth_ids[*truth as usize];
            let is_matched = matches.iter().any(|pair| pair.row as usize == row);
            let counts = frame.truths.iter().any(|t| t.id == person && t.role == Role::Counts);
            if counts && !is_matched {
                result.missed.push(MissedPerson {
                    frame: at as u64 + 1,
                    person,
                    other_cause: Some(CAUSE.into()),
                    ..MissedPerson::default()
                });
            }
        }
    }
    if !result.missed.is_empty() {
        result.reasons.insert(CAUSE.into(), WHY.into());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tracks_have_a_name_and_a_folder() {
        let parsed: ForeignTracks = "byte=runs/a=b".parse().expect("a name and a folder");
        assert_eq!(
            (parsed.name.as_str(), parsed.folder.as_path()),
            ("byte", Path::new("runs/a=b"))
        );
        for wrong in ["byte", "=runs", "byte="] {
            assert!(wrong.parse::<ForeignTracks>().is_err(), "{wrong}");
        }
    }
}
