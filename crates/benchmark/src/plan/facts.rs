//! Properties of logs from a file of rooms, for a benchmark in which no room is left out.

use std::path::Path;

use tagalong_app::outcome::{Failure, say};
use tagalong_app::scoring::read_text;
use tagalong_app::suggest::check_log_path;
use tagalong_config::ConfigError;

use super::{Annotated, with_truth};
use crate::tuning::{Room, RoomFile, Rooms};

/// Returns all logs of the rooms, with their truth and the properties that the file states.
///
/// # Errors
/// A file that cannot be read, or a log without truth; with the position in the file.
pub fn of_rooms(path: &Path) -> Result<Vec<Annotated>, Failure> {
    let (rooms, text) = read(path)?;
    let shown = path.display().to_string();
    let mut logs = Vec::new();
    for room in &rooms.rooms {
        let annotated = of_room(room);
        logs.extend(annotated.map_err(|error| Failure::usage(error.render(&shown, &text)))?);
    }
    Ok(logs)
}

/// Returns the logs of a room, with their truth and the properties that the file states.
///
/// # Errors
/// A log that cannot be read or has no truth, with its position in the file.
pub fn of_room(room: &Room) -> Result<Vec<Annotated>, ConfigError> {
    room.logs.iter().map(|log| Ok(with_facts(of_file(log)?, room))).collect()
}

/// Adds the properties that the file of rooms states to logs, by name; reports the logs that are in
/// no room.
///
/// # Errors
/// A file that cannot be read.
pub fn in_rooms(path: &Path, logs: Vec<Annotated>) -> Result<Vec<Annotated>, Failure> {
    let (rooms, _) = read(path)?;
    let mut known = Vec::new();
    for log in logs {
        let room = rooms.rooms.iter().find(|room| room.logs.iter().any(|l| l.name() == log.name));
        match room {
            Some(room) => known.push(with_facts(log, room)),
            None => {
                say(&format!("note: {} is in no room of {}", log.name, path.display()));
                known.push(log);
            }
        }
    }
    Ok(known)
}

/// Returns a log with the properties of its room.
fn with_facts(log: Annotated, room: &Room) -> Annotated {
    let file = room.logs.iter().find(|file| file.name() == log.name);
    let unjudged = file.map_or_else(Vec::new, |file| room.unjudged(file).to_vec());
    let single_frames = room.single_frames;
    Annotated { unjudged, room: Some(room.name.clone()), single_frames, ..log }
}

/// Returns a log that a file of rooms names, with its truth.
fn of_file(log: &RoomFile) -> Result<Annotated, ConfigError> {
    let annotated = check_log_path(&log.path).and_then(|()| with_truth(&log.path));
    annotated.map_err(|failure| ConfigError::new(failure.message).or_at(Some(log.place.clone())))
}

/// Reads the rooms, and returns them with their text.
fn read(path: &Path) -> Result<(Rooms, String), Failure> {
    let text = read_text(path).map_err(|failure| Failure::usage(failure.message))?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let rooms = Rooms::read(&text, folder, None)
        .map_err(|error| Failure::usage(error.render(&path.display().to_string(), &text)))?;
    Ok((rooms, text))
}
