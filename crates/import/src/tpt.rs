//! TPT-Bench (H. Ye and others, *TPT-Bench: A Large-Scale, Long-Term and Robot-Egocentric Dataset for
//! Benchmarking Target Person Tracking*, arXiv 2505.07446): panoramic images
//! `panoramic_images/NAME/NANOSECONDS.jpg` and the target in `GTs/NAME.json`, an object with one
//! member an image: `"NANOSECONDS": {"is_exist": true, "bbox": [left, top, width, height]}`.
//!
//! The layout is that of the README and of `evaluate_baselines.py` in the tools of its authors
//! (MedlarTea/TPT-BENCH-TOOLS). Only the target is annotated, so that tracks of other people are no
//! false alarms, though `eval` counts them as such.

use std::path::{Path, PathBuf};

use serde_json::Value;
use tagalong_app::outcome::Failure;
use tagalong_core::Stamp;

use super::ImportArgs;
use super::folders::level;
use super::json::{document, members, rectangle};
use super::sequence::{Eye, Moment, Sequence, pictures, size};
use super::truth::{Frames, WholeBody, absent, boxes_csv, stem};

const LAYOUT: &str = "panoramic_images/NAME of TPT-Bench";
/// Number of the only annotated person.
const TARGET: i64 = 1;

/// Reads a folder `panoramic_images/NAME`.
///
/// # Errors
/// Files that are missing or wrong.
pub fn read(args: &ImportArgs) -> Result<Sequence, Failure> {
    let folder = &args.path;
    let mut moments: Vec<Moment> =
        pictures(folder)?.into_iter().map(moment).collect::<Result<_, _>>()?;
    moments.sort_by_key(|moment| moment.stamp);
    let mut notes = Vec::new();
    let calibration = match moments.first() {
        Some(first) => args.calibration(size(&first.file)?.0),
        None => None,
    };
    if calibration.is_none() {
        notes
            .push("panoramic images have no focal length: places in metres will be guesses".into());
    }
    let mut beside = Vec::new();
    match truth(folder) {
        Some(file) => {
            beside.push(("boxes.csv", boxes(&file, &moments, &mut notes)?));
            notes.push("only the target is annotated: `eval` counts others as false".into());
        }
        None => notes.push("there is no GTs/NAME.json: no truth".into()),
    }
    let mount = args.height.map(|height| level(height, args.tilt));
    Ok(Sequence { moments, calibration, mount, beside, notes, ..Sequence::default() })
}

fn moment(file: PathBuf) -> Result<Moment, Failure> {
    let nanos = stem(&file).parse().map_err(|_| {
        let shown = file.display();
        Failure::failed(format!("{shown}: the name is no time in nanoseconds; is this {LAYOUT}?"))
    })?;
    Ok(Moment { stamp: Stamp::from_nanos(nanos), eye: Eye::Left, file })
}

/// Finds the annotations of the folder `panoramic_images/NAME`.
fn truth(folder: &Path) -> Option<PathBuf> {
    let whole = folder.canonicalize().ok()?;
    let name = format!("{}.json", whole.file_name()?.to_string_lossy());
    let above = whole.ancestors().nth(2)?;
    Some(above.join("GTs").join(name)).filter(|file| file.is_file())
}

fn boxes(path: &Path, moments: &[Moment], notes: &mut Vec<String>) -> Result<String, Failure> {
    let document = document(path)?;
    let (frames, mut bodies, mut without) = (Frames::of(moments), Vec::new(), 0);
    for (name, image) in members(&document, path)? {
        let at = format!("{}: image `{name}`", path.display());
        let wrong = |why: &str| Failure::failed(format!("{at}: {why}"));
        let exists = image.get("is_exist").and_then(Value::as_bool);
        let exists = exists.ok_or_else(|| wrong("`is_exist` is neither true nor false"))?;
        let Some(frame) = frames.named(name) else {
            without += 1;
            continue;
        };
        if !exists {
            continue;
        }
        let region = rectangle(image.get("bbox")).map_err(|why| wrong(&format!("`bbox` {why}")))?;
        bodies.push(WholeBody { frame, id: TARGET, region, visible: 1.0, counts: true });
    }
    notes.extend(absent(without, path));
    bodies.sort_by_key(|body| body.frame);
    Ok(boxes_csv(&bodies))
}
