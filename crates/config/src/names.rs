//! Suggestions in errors for names that do not exist: keys of a config, files, networks.

use std::fs;
use std::path::{Path, PathBuf};

/// Returns the name among `available` that is nearest to the mistyped `wanted`, if fewer than half
/// of its letters differ.
///
/// ```
/// use tagalong_config::nearest;
/// assert_eq!(nearest("kalmann", ["ekf", "kalman"]), Some("kalman"));
/// assert_eq!(nearest("zebra", ["ekf", "kalman"]), None);
/// ```
pub fn nearest<'a>(wanted: &str, available: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let wanted = wanted.to_lowercase();
    available
        .into_iter()
        .map(|name| (edit_distance(&wanted, &name.to_lowercase()), name))
        .filter(|(distance, name)| 2 * distance < name.chars().count().max(wanted.chars().count()))
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, name)| name)
}

/// Returns "; did you mean `NAME`?" for a file that is missing, with the nearest name among the files of
/// its folder that have its extension and among `others` that are not written as it is; nothing if none
/// is near.
///
/// ```
/// use tagalong_config::model_hint;
/// let hint = model_hint("models/yolox-nan".as_ref(), &["yolox-nano".to_owned()]);
/// assert_eq!(hint, "; did you mean `yolox-nano`?");
/// ```
pub fn model_hint(missing: &Path, others: &[String]) -> String {
    let Some(wanted) = missing.file_stem().and_then(|stem| stem.to_str()) else {
        return String::new();
    };
    let folder = missing.parent().filter(|folder| !folder.as_os_str().is_empty());
    let mut files: Vec<PathBuf> = Vec::new();
    for entry in fs::read_dir(folder.unwrap_or(Path::new("."))).into_iter().flatten().flatten() {
        if entry.path().extension() == missing.extension() {
            files.push(entry.path());
        }
    }
    // The order of a directory depends on the file system.
    files.sort();
    // Without the extension, which is common to all of them and would make any two alike.
    let stems = files.iter().filter_map(|file| file.file_stem()?.to_str());
    let others = others.iter().map(String::as_str).filter(|name| missing.to_str() != Some(*name));
    let Some(best) = nearest(wanted, others.chain(stems)) else {
        return String::new();
    };
    let file = files.iter().find(|file| file.file_stem().is_some_and(|stem| stem == best));
    let name = file.and_then(|file| file.file_name()?.to_str()).unwrap_or(best);
    format!("; did you mean `{name}`?")
}

/// Most names that are listed behind a suggestion.
const MOST_NAMES: usize = 8;

/// Puts "did you mean" into serde's "unknown field `a`, expected one of `b`, `c`", before the names,
/// or in the place of many names.
pub(crate) fn with_suggestion(message: &str) -> String {
    let mut quoted = message.split('`').skip(1).step_by(2);
    // The unknown name is quoted first, then the valid ones.
    let unknown = if message.starts_with("unknown ") { quoted.next() } else { None };
    let names: Vec<&str> = quoted.collect();
    let better = unknown.and_then(|name| nearest_key(name, &names));
    match (better, message.split_once("`, expected ")) {
        (Some(better), Some((wrong, expected))) => {
            let list = if names.len() > MOST_NAMES {
                String::new()
            } else {
                format!(" expected {expected}")
            };
            format!("{wrong}`; did you mean `{better}`?{list}")
        }
        (Some(better), None) => format!("{message}; did you mean `{better}`?"),
        (None, _) => message.to_owned(),
    }
}

/// Returns the nearest key, or the first with a near first word: `color_topic` for `colour`.
fn nearest_key<'a>(wanted: &str, keys: &[&'a str]) -> Option<&'a str> {
    if let Some(key) = nearest(wanted, keys.iter().copied()) {
        return Some(key);
    }
    let words = keys.iter().filter_map(|key| Some(key.split_once('_')?.0));
    let word = nearest(wanted, words)?;
    keys.iter().copied().find(|key| key.split_once('_').is_some_and(|(first, _)| first == word))
}

/// Computes the Levenshtein distance, one row at a time.
fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, ca) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, cb) in b.iter().enumerate() {
            let substituted = diagonal + usize::from(ca != *cb);
            diagonal = row[j + 1];
            row[j + 1] = substituted.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_first_word_suggests_its_key_and_many_names_are_not_listed() {
        let few = with_suggestion("unknown field `colour`, expected one of `color_topic`, `size`");
        let expected = "unknown field `colour`; did you mean `color_topic`? expected one of";
        assert!(few.starts_with(expected), "{few}");
        let names: Vec<String> = (0..9).map(|at| format!("`other{at}`")).collect();
        let many =
            format!("unknown field `dept`, expected one of `depth_topic`, {}", names.join(", "));
        assert_eq!(with_suggestion(&many), "unknown field `dept`; did you mean `depth_topic`?");
        let none = "unknown field `zebra`, expected one of `color_topic`, `size`";
        assert_eq!(with_suggestion(none), none);
    }

    #[test]
    fn names_are_as_far_apart_as_letters_have_to_be_changed() {
        let apart = [("", "abc"), ("abc", "abc"), ("abc", ""), ("kitten", "sitting"), ("ab", "ba")];
        assert_eq!(apart.map(|(a, b)| edit_distance(a, b)), [3, 0, 3, 3, 2]);
    }

    #[test]
    fn a_name_of_which_half_is_wrong_was_not_meant() {
        assert_eq!(nearest("abxx", ["abcd"]), None);
        assert_eq!(nearest("abxxe", ["abcde"]), Some("abcde"));
        assert_eq!(nearest("EKF", ["ekf"]), Some("ekf"), "however it is written");
    }
    #[test]
    fn a_missing_model_leads_to_the_nearest_file_of_its_kind() {
        let home = tempfile::tempdir().unwrap();
        for name in ["people.toml", "people-two.toml", "peopel.onnx"] {
            fs::write(home.path().join(name), "").unwrap();
        }
        let installed = ["yolox-nano".to_owned()];
        for (name, hint) in [
            ("peple.toml", "; did you mean `people.toml`?"),
            ("people.onnx", "; did you mean `peopel.onnx`?"),
            // The name of no file.
            ("yolox-nan", "; did you mean `yolox-nano`?"),
            ("zebra.toml", ""),
        ] {
            assert_eq!(model_hint(&home.path().join(name), &installed), hint, "{name}");
        }
        let itself = model_hint("yolox-nano".as_ref(), &installed);
        assert_eq!(itself, "", "the name was not mistyped");
    }
}
