//! Real rooms, each of which is left out once.

use std::path::{Path, PathBuf};

/// Rooms, and their logs.
pub const ROOMS: [(&str, &str); 6] = [
    ("um and filinha", "um"),
    ("um and filinha", "filinha"),
    ("lab2", "lab2-camera1"),
    ("lab2", "lab2-camera2"),
    ("corredor1", "corredor1-camera1"),
    ("uc3m", "uc3m-single-frames"),
];

/// Rooms and logs in which the places of people are annotated.
pub fn with_places() -> impl Iterator<Item = (&'static str, &'static str)> {
    // `uc3m` has boxes around whole people alone.
    ROOMS.into_iter().filter(|(room, _)| *room != "uc3m")
}

/// Returns the names of the rooms of [`with_places`], each once.
pub fn room_names() -> Vec<&'static str> {
    let mut names: Vec<_> = with_places().map(|(room, _)| room).collect();
    names.dedup();
    names
}

/// Returns true if a log was taken in this room.
pub fn is_of(log: &str, room: &str) -> bool {
    ROOMS.contains(&(room, log))
}

/// Returns the path of the model that has not seen a room.
pub fn without(model: &Path, room: &str) -> PathBuf {
    let stem = model.file_stem().unwrap_or_default().to_string_lossy();
    model.with_file_name(format!("{stem}.without-{}.toml", room.replace(' ', "-")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_model_is_named_after_the_room_that_it_has_not_seen() {
        assert_eq!(room_names(), ["um and filinha", "lab2", "corredor1"]);
        assert!(is_of("filinha", "um and filinha") && !is_of("filinha", "lab2"));
        let path = without(Path::new("m/svm.toml"), "um and filinha");
        assert_eq!(path, Path::new("m/svm.without-um-and-filinha.toml"));
    }
}
