//! Signs that a truth belongs to another log than the frames.

use std::path::Path;

use super::beside::log_of;
use super::{Shots, TruthFile};

/// Suffixes of other truth files that are named after their log.
const OTHER_ENDINGS: [&str; 3] = [".jsonl", ".mcap", ".bag"];
/// Number of frames by which a truth may extend beyond the last frame of the log, because images at
/// the end may have lost their depth.
const BEYOND: u32 = 5;
/// Fraction of the boxes with centres outside of the image from which on they belong to another
/// image.
const OUTSIDE: f64 = 0.2;
/// Fraction of the annotated people below which the truth may belong to another log: by chance a
/// few of its boxes match tracks.
const BY_CHANCE: f64 = 0.1;

/// Returns notes on a truth and the frames of a log: the signs that the truth belongs to another
/// log, and people that end long before the log does.
pub fn truth_notes(
    path: &Path,
    truth: &TruthFile,
    log_name: Option<&str>,
    shots: &Shots,
) -> Vec<String> {
    let mut notes = other_log_notes(path, truth, log_name, shots);
    notes.extend(truth.early_end(&file_name(path), shots));
    notes
}

/// Returns the question whether the truth is the right one, if tracks match only `matched` of its
/// `people`, over all frames, or none.
pub fn match_note(path: &Path, people: u64, matched: u64, reports: u64) -> Option<String> {
    if reports == 0 || matched as f64 >= BY_CHANCE * people as f64 {
        return None;
    }
    let told = if matched == 0 {
        "nothing matches".to_owned()
    } else {
        format!("only {matched} of {people} annotated people match")
    };
    Some(format!("{}: {told}: is it the truth of another log?", file_name(path)))
}

fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Returns notes with the signs that a truth belongs to another log: its name, its number of
/// frames, its stamps, and the size of the image that contains its boxes. `log_name` is the file
/// name of the log, if it is known; `shots` is empty if no log was read.
pub fn other_log_notes(
    path: &Path,
    truth: &TruthFile,
    log_name: Option<&str>,
    shots: &Shots,
) -> Vec<String> {
    let name = file_name(path);
    let mut signs: Vec<String> =
        log_name.and_then(|log| by_name(&name, truth, log)).into_iter().collect();
    signs.extend(by_frames(&name, truth, shots));
    signs.extend(by_image(&name, truth, shots));
    if let Some(last) = signs.last_mut() {
        last.push_str(": if the truth is that of another log, the comparison means nothing");
    }
    // A few of them are images that were lost.
    let lost = truth.without_image(shots);
    if shots.first().is_some() && lost > 0 && !is_of_other_times(truth, lost) {
        signs.push(format!("{name}: {lost} moments have no image and are left out"));
    }
    signs
}

/// Returns true if most moments of a truth have no image.
fn is_of_other_times(truth: &TruthFile, without: usize) -> bool {
    truth.needs_stamps() && 2 * without > truth.annotated()
}

/// Returns the sign that a truth is named after another log.
fn by_name(name: &str, truth: &TruthFile, log: &str) -> Option<String> {
    let of_truth = log_of(name)
        .or_else(|| OTHER_ENDINGS.iter().find_map(|ending| name.strip_suffix(ending)))?;
    let stem = Path::new(log).file_stem()?.to_string_lossy().into_owned();
    let is_other = of_truth != stem && !(truth.is_in_log() && name == log);
    is_other.then(|| format!("{name} is named after {of_truth}, and the run is of {log}"))
}

/// Returns the sign that people are in frames, or at stamps, that the log does not have.
fn by_frames(name: &str, truth: &TruthFile, shots: &Shots) -> Option<String> {
    shots.first()?;
    if truth.needs_stamps() {
        let without = truth.without_image(shots);
        let all = truth.annotated();
        return is_of_other_times(truth, without)
            .then(|| format!("{name}: {without} of {all} moments have no image and are left out"));
    }
    let last = truth.last_annotated(shots)?;
    let known = shots.last();
    (last > known.saturating_add(BEYOND)).then(|| {
        format!("{name} has people up to frame {last}, and the last of the log is {known}")
    })
}

/// Returns the sign that boxes belong to an image of another size.
fn by_image(name: &str, truth: &TruthFile, shots: &Shots) -> Option<String> {
    let camera = &shots.first()?.camera;
    let size = [camera.width as f64, camera.height as f64];
    // The boxes may be those of the raw image of a mirror, while the camera is that of the
    // unwrapped one.
    if camera.is_blind() || camera.panorama().is_some() {
        return None;
    }
    if let Some(info) = &truth.info
        && info.width > 0
        && [f64::from(info.width), f64::from(info.height)] != size
    {
        return Some(format!(
            "seqinfo.ini beside {name} is of {}x{} images, and those of the log are {}x{}",
            info.width, info.height, camera.width, camera.height
        ));
    }
    let mut count = 0;
    let mut outside = 0;
    let mut reach = [0.0_f64; 2];
    for region in truth.regions() {
        let middle = [region.x + 0.5 * region.width, region.y + 0.5 * region.height];
        let is_inside = (0..2).all(|axis| (0.0..size[axis]).contains(&middle[axis]));
        count += 1;
        outside += u32::from(!is_inside);
        reach = [reach[0].max(region.x + region.width), reach[1].max(region.y + region.height)];
    }
    let are_many = f64::from(outside) > OUTSIDE * f64::from(count);
    are_many.then(|| {
        format!(
            "{name}: {outside} of {count} boxes lie outside of the {}x{} images of the log, as far as to x = \
             {:.0} and y = {:.0}",
            camera.width, camera.height, reach[0], reach[1]
        )
    })
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::Isometry2;
    use tagalong_geometry::{Camera, Distortion, Pinhole};

    use super::super::{Shot, TruthOptions};
    use super::*;

    /// Returns twenty frames of images of 640x480 pixels, ten a second.
    fn shots() -> Shots {
        let lens =
            Pinhole { fx: 500.0, fy: 500.0, cx: 320.0, cy: 240.0, distortion: Distortion::None };
        let camera = Arc::new(Camera::mounted(lens, 640, 480, 1.0, 0.0, 0.0));
        let mut shots = Shots::default();
        for number in 1..=20 {
            shots.push(Shot {
                number,
                stamp_ns: u64::from(number) * 100_000_000,
                camera: Arc::clone(&camera),
                odom_from_robot: Isometry2::identity(),
            });
        }
        shots
    }

    /// Returns the notes on a truth of one person, whose box is that of frame 1 and of `last`.
    fn notes(file: &str, last: u32, x: f64, log: Option<&str>, info: &str) -> Vec<String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(file);
        if !info.is_empty() {
            std::fs::write(folder.path().join("seqinfo.ini"), info).unwrap();
        }
        let rows = [1, last].map(|frame| format!("{frame},1,{x},10,40,90,1,-1,-1,-1\n"));
        std::fs::write(&path, rows.concat()).unwrap();
        let truth = TruthFile::read(&path, TruthOptions::default()).unwrap();
        other_log_notes(&path, &truth, log, &shots())
    }

    #[test]
    fn a_truth_of_the_log_gives_no_sign() {
        for log in [None, Some("walk.mcap"), Some("walk.bag")] {
            assert!(notes("walk.boxes.csv", 20, 600.0, log, "").is_empty(), "{log:?}");
        }
        // Images at the end may have lost their depth.
        assert!(notes("gt.txt", 24, 10.0, Some("walk.mcap"), "").is_empty());
        let info = "name=a\nframeRate=10\nseqLength=20\nimWidth=640\nimHeight=480\n";
        assert!(notes("gt.txt", 20, 10.0, Some("walk.mcap"), info).is_empty());
    }

    #[test]
    fn people_whom_nothing_matches_raise_a_question() {
        let path = Path::new("logs/walk.people.csv");
        for (people, matched, reports, told) in [
            (32, 0, 181, Some("nothing matches")),
            (32, 3, 181, Some("only 3 of 32 annotated people match")),
            (32, 4, 181, None),
            // Without tracks, and without people, nothing can match.
            (32, 0, 0, None),
            (0, 0, 181, None),
        ] {
            let told = told
                .map(|told| format!("walk.people.csv: {told}: is it the truth of another log?"));
            assert_eq!(match_note(path, people, matched, reports), told, "{matched} of {people}");
        }
    }

    #[test]
    fn a_truth_that_ends_early_is_told_with_the_signs() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("other.boxes.csv");
        std::fs::write(&path, "1,1,10,10,40,90,1,-1,-1,-1\n").expect("a file");
        let truth = TruthFile::read(&path, TruthOptions::default()).expect("a truth");
        let notes = truth_notes(&path, &truth, Some("walk.mcap"), &shots());
        let [name, end] = &notes[..] else { panic!("{notes:?}") };
        assert!(name.contains("is named after other"), "{name}");
        assert!(end.starts_with("other.boxes.csv: its last frame with people is 1,"), "{end}");
    }

    #[test]
    fn each_sign_of_another_log_is_told() {
        let other = "name=a\nframeRate=10\nseqLength=20\nimWidth=1280\nimHeight=720\n";
        for (file, last, x, info, sign) in [
            ("other.boxes.csv", 20, 10.0, "", "named after other, and the run is of walk.mcap"),
            ("gt.txt", 40, 10.0, "", "up to frame 40, and the last of the log is 20"),
            ("gt.txt", 20, 900.0, "", "2 of 2 boxes lie outside of the 640x480 images"),
            ("gt.txt", 20, 10.0, other, "is of 1280x720 images, and those of the log are 640x480"),
        ] {
            let notes = notes(file, last, x, Some("walk.mcap"), info);
            let [note] = &notes[..] else { panic!("{sign}: {notes:?}") };
            assert!(
                note.contains(sign) && note.ends_with("the comparison means nothing"),
                "{note}"
            );
        }
    }

    #[test]
    fn stamps_that_no_image_has_are_told() {
        let other = note_of_stamps(&[100_000_000, 900_000_000_000, 901_000_000_000]);
        assert!(other.contains("2 of 3 moments have no image"), "{other}");
        assert!(other.ends_with("the comparison means nothing"), "{other}");
        let lost = note_of_stamps(&[100_000_000, 200_000_000, 901_000_000_000]);
        assert!(lost.ends_with("1 moments have no image and are left out"), "{lost}");
    }

    /// The one note on a truth with moments of these stamps.
    fn note_of_stamps(stamps: &[u64]) -> String {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("walk.truth.jsonl");
        let mut text = String::new();
        for &stamp_ns in stamps {
            let frame = tagalong_log::TruthFrame { stamp_ns, ..Default::default() };
            text += &serde_json::to_string(&frame).expect("a frame is JSON");
            text.push('\n');
        }
        std::fs::write(&path, text).expect("the folder takes files");
        let truth = TruthFile::read(&path, TruthOptions::default()).expect("a valid truth");
        let notes = other_log_notes(&path, &truth, Some("walk.mcap"), &shots());
        assert_eq!(notes.len(), 1, "{notes:?}");
        notes[0].clone()
    }
}
