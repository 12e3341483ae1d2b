//! Files of boxes that a config replays, as the config `recorded` does.

use std::collections::BTreeSet;

use tagalong_config::{FileLimit, read_text};
use tagalong_eval::formats::mot;

use crate::config_file::ConfigFile;

/// File of boxes that a config names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordedBoxes {
    /// The file, as the config names it.
    pub name: String,
    /// True if its boxes have IDs, like those of tracks.
    pub has_ids: bool,
}

impl RecordedBoxes {
    /// Returns the files of a config that are MOTChallenge text.
    pub fn of(config: &ConfigFile) -> Vec<Self> {
        let mut found = Vec::new();
        for (name, path) in config.files() {
            let Ok(text) = read_text(&path, FileLimit::Table) else { continue };
            let Ok(rows) = mot::parse(&text, &name) else { continue };
            if !rows.is_empty() {
                let ids: BTreeSet<i64> = rows.iter().map(|row| row.id).collect();
                found.push(Self { name, has_ids: ids.len() > 1 });
            }
        }
        found
    }

    /// Returns a note on IDs that are ignored.
    pub fn note(&self) -> Option<String> {
        let name = &self.name;
        self.has_ids.then(|| {
            format!(
                "the IDs in {name} are not used: its boxes are tracked anew; `tagalong eval --tracks {name}` \
                 or `tagalong bench --tracks NAME=DIR` scores those tracks"
            )
        })
    }

    /// Returns a note on one file for several logs.
    pub fn note_on_logs(&self, config: &str, logs: usize) -> Option<String> {
        (logs > 1).then(|| {
            format!(
                "{config} takes the boxes of {} for all {logs} logs, but they belong to one: give \
                 each log a config of its own, or score tracks with --tracks NAME=DIR",
                self.name
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_of_recorded_boxes_and_a_file_for_several_logs_are_noted() {
        let home = tempfile::tempdir().expect("a folder");
        let config =
            "[[detectors]]\nplugin = 'recorded-detections'\nconfig = { path = 'det.txt' }\n";
        for (text, has_ids) in
            [("1,-1,5,5,9,9,1\n2,-1,5,5,9,9,1\n", false), ("1,3,5,5,9,9\n1,4,9,5,9,9\n", true)]
        {
            std::fs::write(home.path().join("det.txt"), text).expect("a file");
            let config = ConfigFile::of_text(config.into(), home.path());
            let found = RecordedBoxes::of(&config);
            assert_eq!(found, [RecordedBoxes { name: "det.txt".into(), has_ids }]);
            assert_eq!(
                found[0].note().is_some_and(|note| note.contains("--tracks det.txt")),
                has_ids
            );
            assert!(
                found[0]
                    .note_on_logs("recorded", 2)
                    .is_some_and(|note| note.contains("all 2 logs"))
            );
            assert_eq!(found[0].note_on_logs("recorded", 1), None);
        }
    }
}
