use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use tagalong_config::ConfigError;
use toml::Spanned;

/// Minimum number of rooms: one is left out, and one has to remain.
const FEWEST: usize = 2;

/// Logs by the room in which they were taken.
#[derive(Clone, Debug, PartialEq)]
pub struct Rooms {
    /// The rooms by name.
    pub rooms: Vec<Room>,
}

/// A room.
#[derive(Clone, Debug, PartialEq)]
pub struct Room {
    /// Name in tables.
    pub name: String,
    /// Description.
    pub about: String,
    /// Its logs.
    pub logs: Vec<RoomFile>,
    /// Models that were trained without this room, by the plugin that reads them.
    pub models: BTreeMap<String, RoomFile>,
    /// True if its logs are single frames, which are not tracked over time.
    pub single_frames: bool,
    /// Frames of its logs in which the positions of upper bodies are not annotated.
    unjudged: BTreeMap<String, Vec<u32>>,
}

impl Room {
    /// Returns the frames of a log in which people are not scored.
    pub fn unjudged(&self, log: &RoomFile) -> &[u32] {
        self.unjudged.get(&log.name()).map_or(&[], Vec::as_slice)
    }
}

/// A file, and the position where the text names it.
#[derive(Clone, Debug, PartialEq)]
pub struct RoomFile {
    /// The file.
    pub path: PathBuf,
    /// Position in the text.
    pub place: Range<usize>,
}

/// The file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default)]
    folder: PathBuf,
    rooms: Spanned<BTreeMap<String, Entry>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    #[serde(default)]
    about: String,
    logs: Spanned<Vec<Spanned<PathBuf>>>,
    #[serde(default)]
    models: BTreeMap<String, Spanned<PathBuf>>,
    #[serde(default)]
    single_frames: bool,
    #[serde(default)]
    unjudged: BTreeMap<Spanned<String>, Vec<u32>>,
}

impl Rooms {
    /// Reads rooms of which one is to be left out, so that at least two are needed; otherwise as
    /// [`Self::read`].
    ///
    /// # Errors
    /// The error in the text, with its position.
    pub fn parse(
        text: &str,
        base_dir: &Path,
        logs_dir: Option<&Path>,
    ) -> Result<Self, ConfigError> {
        let (read, whole) = Self::placed(text, base_dir, logs_dir)?;
        if read.rooms.len() < FEWEST {
            let message = format!("{} room: one is left out, so two are needed", read.rooms.len());
            return Err(ConfigError::new(message).or_at(Some(whole)));
        }
        refuse_twins(&read.rooms)?;
        Ok(read)
    }

    /// Reads rooms. Paths of logs are relative to `folder` in the text, which is relative to
    /// `base_dir`; or to `logs_dir`, if that is given. Paths of models are relative to `base_dir`.
    ///
    /// # Errors
    /// The error in the text, with its position.
    pub fn read(text: &str, base_dir: &Path, logs_dir: Option<&Path>) -> Result<Self, ConfigError> {
        let (read, _) = Self::placed(text, base_dir, logs_dir)?;
        refuse_twins(&read.rooms)?;
        Ok(read)
    }

    /// Reads rooms, and returns them with their positions in the text.
    fn placed(
        text: &str,
        base_dir: &Path,
        logs_dir: Option<&Path>,
    ) -> Result<(Self, Range<usize>), ConfigError> {
        let File { folder, rooms } = toml::from_str(text)?;
        let folder = logs_dir.map_or_else(|| base_dir.join(folder), Path::to_owned);
        let whole = rooms.span();
        let rooms: Vec<Room> = rooms
            .into_inner()
            .into_iter()
            .map(|(name, entry)| Room::read(name, entry, &folder, base_dir))
            .collect::<Result<_, _>>()?;
        Ok((Self { rooms }, whole))
    }
}

impl Room {
    fn read(
        name: String,
        entry: Entry,
        folder: &Path,
        base_dir: &Path,
    ) -> Result<Self, ConfigError> {
        let place = entry.logs.span();
        let logs = entry.logs.into_inner().into_iter();
        let logs: Vec<RoomFile> = logs.map(|log| RoomFile::new(log, folder)).collect();
        let models = entry.models.into_iter();
        let models = models.map(|(plugin, path)| (plugin, RoomFile::new(path, base_dir))).collect();
        if logs.is_empty() {
            let message = format!("room `{name}` has no log");
            return Err(ConfigError::new(message).or_at(Some(place)));
        }
        for file in entry.unjudged.keys() {
            if !logs.iter().any(|log| log.name() == *file.get_ref()) {
                let message = format!("room `{name}` has no log called `{}`", file.get_ref());
                return Err(ConfigError::new(message).or_at(Some(file.span())));
            }
        }
        let unjudged = entry.unjudged.into_iter().map(|(log, all)| (log.into_inner(), all));
        Ok(Self {
            name,
            about: entry.about,
            logs,
            models,
            single_frames: entry.single_frames,
            unjudged: unjudged.collect(),
        })
    }
}

impl RoomFile {
    fn new(path: Spanned<PathBuf>, folder: &Path) -> Self {
        Self { place: path.span(), path: folder.join(path.into_inner()) }
    }

    /// Returns the name of the file, as in tables.
    pub fn name(&self) -> String {
        self.path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
    }
}

/// Rejects a log in two rooms, which would be left out and left in at the same time.
fn refuse_twins(rooms: &[Room]) -> Result<(), ConfigError> {
    let mut seen: BTreeMap<String, &str> = BTreeMap::new();
    for room in rooms {
        for log in &room.logs {
            if let Some(other) = seen.insert(log.name(), &room.name) {
                let message = format!(
                    "a log called `{}` is in room `{other}` already; each has one room",
                    log.name()
                );
                return Err(ConfigError::new(message).or_at(Some(log.place.clone())));
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const TWO: &str = "folder = \"logs\"\n[rooms.B]\nlogs = [\"b.mcap\"]\n\
        [rooms.A]\nabout = \"a hall\"\nlogs = [\"a1.mcap\", \"a2.mcap\"]\n";

    fn parse(text: &str) -> Result<Rooms, String> {
        Rooms::parse(text, Path::new("home"), None).map_err(|e| e.render("rooms.toml", text))
    }

    #[test]
    fn rooms_are_in_the_order_of_their_names() {
        let rooms = parse(TWO).unwrap().rooms;
        let names: Vec<&str> = rooms.iter().map(|room| room.name.as_str()).collect();
        assert_eq!((names, rooms[0].about.as_str()), (vec!["A", "B"], "a hall"));
        let paths: Vec<&Path> = rooms[0].logs.iter().map(|log| log.path.as_path()).collect();
        assert_eq!(paths, [Path::new("home/logs/a1.mcap"), Path::new("home/logs/a2.mcap")]);
        assert_eq!(&TWO[rooms[1].logs[0].place.clone()], "\"b.mcap\"");
    }

    #[test]
    fn one_room_is_enough_where_none_is_left_out() {
        let one = "[rooms.A]\nlogs = ['a.mcap']";
        let read = Rooms::read(one, Path::new("home"), None).expect("a room");
        assert_eq!(read.rooms[0].logs[0].path, Path::new("home/a.mcap"));
        let twins = "[rooms.A]\nlogs = ['a.mcap']\n[rooms.B]\nlogs = ['a.mcap']";
        assert!(Rooms::read(twins, Path::new("home"), None).is_err());
    }

    #[test]
    fn logs_may_lie_elsewhere() {
        let rooms = Rooms::parse(TWO, Path::new("home"), Some(Path::new("there"))).unwrap();
        assert_eq!(rooms.rooms[1].logs[0].path, Path::new("there/b.mcap"));
    }

    #[test]
    fn models_lie_beside_the_file_of_the_rooms() {
        let text = TWO.replace("[\"b.mcap\"]\n", "[\"b.mcap\"]\nmodels = { net = 'b.toml' }\n");
        let rooms = Rooms::parse(&text, Path::new("home"), Some(Path::new("there"))).unwrap();
        assert_eq!(rooms.rooms[1].models["net"].path, Path::new("home/b.toml"));
        assert!(rooms.rooms[0].models.is_empty());
    }

    #[test]
    fn frames_that_are_not_judged_are_those_of_a_log() {
        let text = TWO.replace("[\"b.mcap\"]\n", "[\"b.mcap\"]\nunjudged = { b = [8, 9] }\n");
        let rooms = parse(&text).unwrap().rooms;
        assert_eq!(rooms[1].unjudged(&rooms[1].logs[0]), [8, 9]);
        assert!(rooms[0].unjudged(&rooms[0].logs[0]).is_empty());
    }

    #[test]
    fn a_room_of_single_frames_says_so() {
        let text = TWO.replace("[\"b.mcap\"]\n", "[\"b.mcap\"]\nsingle_frames = true\n");
        let rooms = parse(&text).unwrap().rooms;
        assert_eq!([rooms[0].single_frames, rooms[1].single_frames], [false, true]);
    }

    #[test]
    fn mistakes_are_shown_with_their_line() {
        let cases: &[(&str, &[&str])] = &[
            (
                "[rooms.A]\nlogs = ['a.mcap']\nunjudged = { b = [1] }",
                &["rooms.toml:3:14", "has no log called `b`"],
            ),
            ("[rooms.A]\nlogs = [\"a.mcap\"]", &["1 room", "two are needed"]),
            ("[rooms.A]\nlogs = []\n[rooms.B]\nlogs = ['b']", &["rooms.toml:2:8", "`A` has no"]),
            (
                "[rooms.A]\nlogs = ['x/a.mcap']\n[rooms.B]\nlogs = ['a.mcap']",
                &["rooms.toml:4:9", "in room `A` already"],
            ),
            ("[rooms.A]\nlog = ['a']", &["rooms.toml:2:1", "did you mean `logs`?"]),
            ("[room.A]\nlogs = ['a']", &["rooms.toml:1:2", "did you mean `rooms`?"]),
            ("folder = 'x'", &["missing field `rooms`"]),
        ];
        for (text, expected) in cases {
            let shown = parse(text).unwrap_err();
            for words in *expected {
                assert!(shown.contains(words), "{text}\n{shown}\nlacks {words}");
            }
        }
    }
}
