//! Kinect Tracking Precision dataset (M. Munaro, E. Menegatti, *Fast RGB-D people tracking for service
//! robots*, Autonomous Robots 37, 2014), the folders of images: `images/NAME/rgb/STAMP.jpg`,
//! `images/NAME/depth/STAMP.pgm` in millimetres, and `ground_truth/NAME_gt2D.txt` with lines
//! `STAMP: ID X Y WIDTH HEIGHT, ID X Y ...` in pixels.
//!
//! The layout is that which the reader of A. Ramey (`KTP2PPL.cpp`, 2014) takes. The places of
//! `NAME_gt3D.txt` are left out: they are in the frame of the motion capture, and no description of
//! the poses of the robot in it was found.

use std::path::{Path, PathBuf};

use tagalong_app::outcome::Failure;
use tagalong_eval::Region;

use super::ImportArgs;
use super::folders::level;
use super::sequence::{
    Calibration, Eye, Moment, PICTURES, Sequence, files, lines, numbers, stamp, text,
};
use super::truth::{Frames, WholeBody, absent, boxes_csv, stem};

const LAYOUT: &str = "images/NAME of the KTP dataset, with rgb and depth";
const DEPTH_UNIT_M: f64 = 0.001;
/// Focal length and centre that the driver of a Kinect gives without a calibration, pixels.
const KINECT: Calibration =
    Calibration { focal: [525.0; 2], centre: Some([319.5, 239.5]), distortion: [0.0; 5] };
/// Number of words of a box: id, left, top, width, height.
const WORDS: usize = 5;

/// Reads a folder `images/NAME`.
///
/// # Errors
/// Files that are missing or wrong.
pub fn read(args: &ImportArgs) -> Result<Sequence, Failure> {
    let folder = &args.path;
    let mut moments = stamped(&folder.join("rgb"), Eye::Left, &PICTURES)?;
    let mut notes = Vec::new();
    match folder.join("depth") {
        depth if depth.is_dir() => moments.extend(stamped(&depth, Eye::Depth, &["pgm", "png"])?),
        _ => notes.push("there is no folder depth: the log has colour alone".into()),
    }
    moments.sort_by_key(|moment| (moment.stamp, moment.eye));
    let calibration = args.calibration(640).unwrap_or_else(|| {
        notes.push("525 pixels of focal length are taken; --focal tells another".into());
        KINECT
    });
    let mut beside = Vec::new();
    match truth(folder) {
        Some(file) => beside.push(("boxes.csv", boxes(&file, &moments, &mut notes)?)),
        None => notes.push("there is no ground_truth/NAME_gt2D.txt: no truth".into()),
    }
    Ok(Sequence {
        moments,
        calibration: Some(calibration),
        depth_unit_m: DEPTH_UNIT_M,
        mount: args.height.map(|height| level(height, args.tilt)),
        beside,
        notes,
        ..Sequence::default()
    })
}

/// Returns the images of a folder whose names are their times.
fn stamped(folder: &Path, eye: Eye, endings: &[&str]) -> Result<Vec<Moment>, Failure> {
    let moment = |file: PathBuf| {
        let stamp = stamp(&stem(&file)).ok_or_else(|| {
            let shown = file.display();
            Failure::failed(format!("{shown}: the name is no time in seconds; is this {LAYOUT}?"))
        })?;
        Ok(Moment { stamp, eye, file })
    };
    files(folder, endings)?.into_iter().map(moment).collect()
}

/// Finds the boxes of the folder `images/NAME`, in `ground_truth` beside `images` or beside NAME.
fn truth(folder: &Path) -> Option<PathBuf> {
    let whole = folder.canonicalize().ok()?;
    let name = format!("{}_gt2D.txt", whole.file_name()?.to_string_lossy());
    let above = whole.ancestors().skip(1).take(2);
    above.map(|above| above.join("ground_truth").join(&name)).find(|file| file.is_file())
}

fn boxes(path: &Path, moments: &[Moment], notes: &mut Vec<String>) -> Result<String, Failure> {
    let text = text(path, "ground truth of the KTP dataset")?;
    let (frames, mut bodies, mut without) = (Frames::of(moments), Vec::new(), 0);
    for (number, line) in lines(&text) {
        let wrong = |why: String| Failure::failed(format!("{}:{number}: {why}", path.display()));
        let mut words = line.split([':', ',', ' ', '\t']).filter(|word| !word.is_empty());
        let word = words.next().unwrap_or_default();
        let time = stamp(word).ok_or_else(|| wrong(format!("`{word}` is no time")))?;
        let values = numbers(words, path, number)?;
        if !values.len().is_multiple_of(WORDS) {
            return Err(wrong("not `TIME: ID X Y WIDTH HEIGHT, ID ...`".into()));
        }
        let Some(frame) = frames.at(time) else {
            without += 1;
            continue;
        };
        let people = values.chunks_exact(WORDS).filter(|of| of[3] > 0.0 && of[4] > 0.0);
        bodies.extend(people.map(|of| body(frame, of)));
    }
    notes.extend(absent(without, path));
    Ok(boxes_csv(&bodies))
}

fn body(frame: u32, of: &[f64]) -> WholeBody {
    let region = Region { x: of[1], y: of[2], width: of[3], height: of[4] };
    WholeBody { frame, id: of[0] as i64, region, visible: 1.0, counts: true }
}
