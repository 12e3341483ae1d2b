//! Truth in a file beside its log: the formats that every command accepts.

use std::path::{Path, PathBuf};

use crate::suggest::LOG_ENDINGS;

/// Format of a file of truth that is named after its log.
struct Form {
    /// Suffix of the file, which replaces the extension of the log.
    ending: &'static str,
    /// True if its boxes are of whole people.
    whole_bodies: bool,
}

/// Formats in order of precedence: if a log has several, boxes and heads have priority over
/// positions on the floor.
const FORMS: [Form; 4] = [
    Form { ending: "people.csv", whole_bodies: false },
    Form { ending: "truth.jsonl", whole_bodies: false },
    Form { ending: "boxes.csv", whole_bodies: true },
    Form { ending: "people-floor.csv", whole_bodies: false },
];

/// Returns the file with the truth beside a log; the flag is true if its boxes are of whole people.
pub fn file_beside(log: &Path) -> Option<(PathBuf, bool)> {
    for form in &FORMS {
        let path = log.with_extension(form.ending);
        if path.is_file() {
            return Some((path, form.whole_bodies));
        }
    }
    None
}

/// Returns the file beside a log for people that are annotated by hand.
pub fn annotated_file(log: &Path) -> PathBuf {
    log.with_extension(FORMS[0].ending)
}

/// Returns true if the boxes of a file are of whole people, according to its suffix.
pub fn is_of_whole_bodies(truth: &Path) -> bool {
    let name = truth.to_string_lossy();
    FORMS.iter().any(|form| form.whole_bodies && name.ends_with(&format!(".{}", form.ending)))
}

/// Returns the name of the log after which a file of truth is named, without extension.
pub fn log_of(truth: &str) -> Option<&str> {
    for form in &FORMS {
        let stem = truth.strip_suffix(form.ending).and_then(|stem| stem.strip_suffix('.'));
        if stem.is_some() {
            return stem;
        }
    }
    None
}

/// Returns the log beside a file of truth that is named after it.
pub fn log_beside(truth: &Path) -> Option<PathBuf> {
    let name = truth.file_name()?.to_string_lossy().into_owned();
    let stem = log_of(&name)?;
    let mut logs =
        LOG_ENDINGS.iter().map(|ending| truth.with_file_name(format!("{stem}.{ending}")));
    logs.find(|log| log.is_file())
}

/// Returns the possible files for the truth of a log, as `a.people.csv, a.boxes.csv`.
pub fn files_of(log: &Path) -> String {
    let files = FORMS.iter().map(|form| log.with_extension(form.ending).display().to_string());
    files.collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_form_beside_a_log_is_found_and_boxes_come_before_places() {
        let home = tempfile::tempdir().expect("a folder");
        let log = home.path().join("walk.mcap");
        assert_eq!(file_beside(&log), None);
        // From the last to the first: each takes the place of those before.
        for (ending, whole_bodies) in [
            ("people-floor.csv", false),
            ("boxes.csv", true),
            ("truth.jsonl", false),
            ("people.csv", false),
        ] {
            let path = home.path().join(format!("walk.{ending}"));
            std::fs::write(&path, "").expect("a file");
            assert_eq!(file_beside(&log), Some((path.clone(), whole_bodies)));
            assert_eq!(is_of_whole_bodies(&path), whole_bodies, "{ending}");
            assert_eq!(log_of(&format!("walk.{ending}")), Some("walk"));
            assert!(files_of(&log).contains(&path.display().to_string()), "{ending}");
        }
        // The annotated file takes the place of all others.
        assert_eq!(file_beside(&log), Some((annotated_file(&log), false)));
        assert_eq!(log_beside(&annotated_file(&log)), None);
        std::fs::write(&log, "").expect("a file");
        assert_eq!(log_beside(&annotated_file(&log)), Some(log.clone()));
        assert_eq!(log_beside(&home.path().join("gt.txt")), None);
        assert_eq!([log_of("gt.txt"), log_of("people.csv")], [None; 2]);
    }
}
