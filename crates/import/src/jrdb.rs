//! JRDB (R. Martin-Martin and others, *JRDB: A Dataset and Benchmark of Egocentric Robot Visual
//! Perception of Humans in Built Environments*, TPAMI 2021), one camera of one sequence:
//! `images/image_N/NAME/000000.jpg` or `images/image_stitched/NAME`, with `labels`, `calibration` and
//! `timestamps` beside `images`.
//!
//! The layout is that of the scripts in the toolkit of its authors (JRDB-dataset/jrdb_toolkit):
//! boxes in images are left, top, width and height; boxes in space have their *middle* at `cx`, `cy`,
//! `cz` in the frame of the ring of cameras (forward, left, up), and `l`, `w`, `h` of which `h` alone
//! is used here. A person with both is a box and a head: the middle of the box, 12 cm below its top.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion};
use serde_json::Value;
use tagalong_app::outcome::Failure;
use tagalong_core::Stamp;
use tagalong_eval::Region;
use tagalong_eval::formats::people::Row;
use tagalong_geometry::{HEAD_RADIUS_M, Rect};

use super::ImportArgs;
use super::json::{document, members, number, rectangle};
use super::sequence::{Calibration, Eye, Moment, Sequence, pictures, steady, text};
use super::truth::{Frames, WholeBody, absent, boxes_csv, people_csv, stem};

const LAYOUT: &str = "images/image_N/NAME of JRDB";
/// Images per second, where `timestamps` does not tell them.
const HZ: f64 = 15.0;
/// Middle of the head below the top of a box, m.
const HEAD_BELOW_TOP_M: f64 = 0.12;
/// Height of a standing person, by which `eval` cuts boxes of whole bodies, m.
const STANDING_HEIGHT_M: f64 = 1.7;
/// Visible part of the body by the word of the annotators, and whether a miss of it counts.
const OCCLUSION: [(&str, f64, bool); 4] = [
    ("Fully_visible", 1.0, true),
    ("Mostly_visible", 0.75, true),
    ("Severely_occluded", 0.25, false),
    ("Fully_occluded", 0.0, false),
];

/// Files of a sequence as one camera sees it.
struct Files {
    root: PathBuf,
    name: String,
    /// Number of the camera; `None` for the stitched images.
    camera: Option<String>,
}

/// Box in space by image and person: middle and height, m.
type Places = BTreeMap<(u32, i64), (Point3<f64>, f64)>;

/// Reads a folder `images/image_N/NAME`.
///
/// # Errors
/// Files that are missing or wrong.
pub fn read(args: &ImportArgs) -> Result<Sequence, Failure> {
    let files = Files::of(&args.path)?;
    let mut notes = Vec::new();
    let moments = files.moments(&args.path, &mut notes)?;
    let frames = Frames::of(&moments);
    let calibration = match args.calibration(752) {
        Some(told) => Some(told),
        None => files.calibration()?,
    };
    if calibration.is_none() {
        notes.push("no lens (calibration/cameras.yaml): places in metres will be guesses".into());
    }
    let bodies = files.bodies(&frames, &mut notes)?;
    let places = files.places(&frames)?;
    let rig = files.rig_from_camera()?;
    let mount = rig.and_then(|rig| mounted(rig, &places, args.height));
    if mount.is_none() {
        notes.push(
            "the height of the camera is not known (calibration/lidars.yaml with labels_3d, or \
             --height with the former)"
                .into(),
        );
    }
    let mut beside = Vec::new();
    if let Some(bodies) = &bodies {
        beside.push(("boxes.csv", boxes_csv(bodies)));
        if let Some(rig) = rig.filter(|_| !places.is_empty()) {
            beside.push(("people.csv", people_csv(&rows(bodies, &places, &rig))?));
        }
    }
    Ok(Sequence { moments, calibration, mount, beside, notes, ..Sequence::default() })
}

impl Files {
    fn of(folder: &Path) -> Result<Self, Failure> {
        let wrong = || {
            let shown = folder.display();
            Failure::failed(format!(
                "{shown} is not {LAYOUT}: give images/image_0/NAME, or images/image_stitched/NAME"
            ))
        };
        let whole = folder.canonicalize().map_err(|_| wrong())?;
        let mut above = whole.ancestors().map(|above| {
            above.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
        });
        let (name, camera) = (above.next().unwrap_or_default(), above.next().unwrap_or_default());
        let camera = match camera.strip_prefix("image_").ok_or_else(wrong)? {
            "stitched" => None,
            number => Some(number.to_owned()),
        };
        let root = whole.ancestors().nth(3).ok_or_else(wrong)?.to_owned();
        Ok(Self { root, name, camera })
    }

    /// Returns a file of the data set where it is there.
    fn find(&self, folder: &str, name: &str) -> Option<PathBuf> {
        Some(self.root.join(folder).join(name)).filter(|file| file.is_file())
    }

    fn moments(&self, folder: &Path, notes: &mut Vec<String>) -> Result<Vec<Moment>, Failure> {
        let images = pictures(folder)?;
        let Some(file) = self.find("timestamps", &format!("{}/frames_img.json", self.name)) else {
            notes.push(format!("no timestamps/{}/frames_img.json: {HZ} Hz", self.name));
            return Ok(steady(images, Eye::Left, HZ).collect());
        };
        let stamps = self.stamps(&file)?;
        let count = images.len();
        let mut moments: Vec<Moment> = images
            .into_iter()
            .filter_map(|file| {
                let stamp = *stamps.get(&stem(&file))?;
                Some(Moment { stamp, eye: Eye::Left, file })
            })
            .collect();
        if moments.len() < count {
            let without = count - moments.len();
            notes.push(format!("{without} of {count} images have no time and are left out"));
        }
        moments.sort_by_key(|moment| moment.stamp);
        Ok(moments)
    }

    /// Returns the times of the images of this camera by their names without ending.
    fn stamps(&self, path: &Path) -> Result<BTreeMap<String, Stamp>, Failure> {
        let document = document(path)?;
        let frames = document.get("data").and_then(Value::as_array).ok_or_else(|| {
            Failure::failed(format!("{}: there is no list `data` of frames", path.display()))
        })?;
        let cameras = frames.iter().filter_map(|frame| frame.get("cameras")?.as_array()).flatten();
        let own = cameras.filter(|camera| {
            let name = camera.get("name").and_then(Value::as_str).unwrap_or_default();
            self.is_named(name)
        });
        own.map(|camera| {
            let url = camera.get("url").and_then(Value::as_str).unwrap_or_default();
            let seconds = seconds(camera.get("timestamp")).ok_or_else(|| {
                let shown = path.display();
                Failure::failed(format!("{shown}: `timestamp` of {url} is no time in seconds"))
            })?;
            Ok((stem(Path::new(url)), Stamp::from_nanos((seconds * 1e9).round() as u64)))
        })
        .collect()
    }

    /// Returns true for the name of this camera: `image_0`, `image0` or `stitched_image0`.
    fn is_named(&self, name: &str) -> bool {
        match &self.camera {
            None => name.contains("stitched"),
            Some(number) => {
                let rest = name.strip_prefix("image").unwrap_or_default();
                rest.strip_prefix('_').unwrap_or(rest) == number
            }
        }
    }

    /// Returns the lens of the camera.
    fn calibration(&self) -> Result<Option<Calibration>, Failure> {
        let (Some(number), Some(path)) = (&self.camera, self.find("calibration", "cameras.yaml"))
        else {
            return Ok(None);
        };
        let text = text(&path, LAYOUT)?;
        let sensor = format!("sensor_{number}");
        let matrix = listed(&text, &sensor, "K");
        let Some(&[fx, _, cx, _, fy, cy, _, _, _]) = matrix.as_deref() else {
            let shown = path.display();
            return Err(Failure::failed(format!("{shown}: no `K` of nine numbers in {sensor}")));
        };
        let distortion = listed(&text, &sensor, "D").and_then(|of| of.try_into().ok());
        Ok(Some(Calibration {
            focal: [fx, fy],
            centre: Some([cx, cy]),
            distortion: distortion.unwrap_or_default(),
        }))
    }

    /// Returns the pose of the camera in the frame of the boxes in space.
    fn rig_from_camera(&self) -> Result<Option<Isometry3<f64>>, Failure> {
        let (Some(number), Some(path)) = (&self.camera, self.find("calibration", "lidars.yaml"))
        else {
            return Ok(None);
        };
        let text = text(&path, LAYOUT)?;
        let sensor = format!("sensor_{number}");
        let rows = listed(&text, &sensor, "cam2ego").unwrap_or_default();
        let Ok(rows) = <[f64; 16]>::try_from(rows) else {
            let shown = path.display();
            return Err(Failure::failed(format!("{shown}: no `cam2ego` of 4 x 4 in {sensor}")));
        };
        let at = |row: usize, column: usize| rows[4 * row + column];
        // The published figures are rounded, and a pose needs a rotation.
        let turn = Rotation3::from_matrix(&Matrix3::from_fn(at));
        let place = Translation3::new(at(0, 3), at(1, 3), at(2, 3));
        Ok(Some(Isometry3::from_parts(place, UnitQuaternion::from_rotation_matrix(&turn))))
    }

    /// Reads the boxes of people in the images of this camera; `None` without labels.
    fn bodies(
        &self,
        frames: &Frames,
        notes: &mut Vec<String>,
    ) -> Result<Option<Vec<WholeBody>>, Failure> {
        let name = &self.name;
        let path = match &self.camera {
            None => self.find("labels/labels_2d_stitched", &format!("{name}.json")),
            Some(number) => self.find("labels/labels_2d", &format!("{name}_image{number}.json")),
        };
        let Some(path) = path else {
            notes.push("there are no labels_2d of this camera: no truth".into());
            return Ok(None);
        };
        let document = document(&path)?;
        let (mut bodies, mut without) = (Vec::new(), 0);
        for (image, labels) in labels(&document, &path)? {
            let Some(frame) = frames.named(image) else {
                without += 1;
                continue;
            };
            for (at, id, label) in people(labels, image, &path)? {
                bodies.push(body(frame, id, label).map_err(|why| Failure::failed(at + &why))?);
            }
        }
        notes.extend(absent(without, &path));
        bodies.sort_by_key(|body| (body.frame, body.id));
        Ok(Some(bodies))
    }

    /// Reads the boxes of people in space; none without labels.
    fn places(&self, frames: &Frames) -> Result<Places, Failure> {
        let Some(path) = self.find("labels/labels_3d", &format!("{}.json", self.name)) else {
            return Ok(Places::new());
        };
        let document = document(&path)?;
        let mut places = Places::new();
        for (cloud, labels) in labels(&document, &path)? {
            let Some(frame) = frames.named(cloud) else { continue };
            for (at, id, label) in people(labels, cloud, &path)? {
                let place = place(label).map_err(|why| Failure::failed(at + &why))?;
                places.insert((frame, id), place);
            }
        }
        Ok(places)
    }
}

fn seconds(value: Option<&Value>) -> Option<f64> {
    let text = value?.as_str().and_then(|text| text.parse().ok());
    number(value).or(text).filter(|seconds| (0.0..1e10).contains(seconds))
}

/// Returns the labels of each image.
fn labels<'a>(
    document: &'a Value,
    path: &Path,
) -> Result<impl Iterator<Item = (&'a String, &'a Value)>, Failure> {
    let wrong = || Failure::failed(format!("{}: there is no `labels`", path.display()));
    Ok(members(document.get("labels").ok_or_else(wrong)?, path)?.iter())
}

/// Returns the labels of people in one image: place for messages, id, label.
fn people<'a>(
    labels: &'a Value,
    image: &str,
    path: &Path,
) -> Result<Vec<(String, i64, &'a Value)>, Failure> {
    let at = format!("{}: image `{image}`: ", path.display());
    let list =
        labels.as_array().ok_or_else(|| Failure::failed(at.clone() + "no list of labels"))?;
    let mut all = Vec::new();
    for label in list {
        let name = label.get("label_id").and_then(Value::as_str).unwrap_or_default();
        // Labels of things have other words in front of the colon.
        let Some(number) = name.strip_prefix("pedestrian:") else { continue };
        let id = number.parse().map_err(|_| {
            Failure::failed(format!("{at}`label_id` is `{name}`, expected pedestrian:NUMBER"))
        })?;
        all.push((format!("{at}{name}: "), id, label));
    }
    Ok(all)
}

fn body(frame: u32, id: i64, label: &Value) -> Result<WholeBody, String> {
    let region = rectangle(label.get("box")).map_err(|why| format!("`box` {why}"))?;
    let word = label.pointer("/attributes/occlusion").and_then(Value::as_str);
    let known = |word: &str| OCCLUSION.iter().find(|(name, ..)| *name == word);
    // The test set and early releases have no attributes.
    let (visible, counts) = match word.map(|word| known(word).ok_or(word)) {
        None => (1.0, true),
        Some(Ok(&(_, visible, counts))) => (visible, counts),
        Some(Err(word)) => return Err(format!("`occlusion` is `{word}`, not known")),
    };
    Ok(WholeBody { frame, id, region, visible, counts })
}

fn place(label: &Value) -> Result<(Point3<f64>, f64), String> {
    let side = |name: &str| {
        let value = label.pointer(&format!("/box/{name}"));
        number(value).ok_or_else(|| format!("`{name}` of `box` is no number"))
    };
    Ok((Point3::new(side("cx")?, side("cy")?, side("cz")?), side("h")?))
}

/// Returns the pose of the camera above the floor: that on which the boxes stand, or at a height.
fn mounted(
    rig_from_camera: Isometry3<f64>,
    places: &Places,
    height_m: Option<f64>,
) -> Option<Isometry3<f64>> {
    let mut feet: Vec<f64> =
        places.values().map(|(middle, height)| middle.z - 0.5 * height).collect();
    feet.sort_by(f64::total_cmp);
    let told = height_m.map(|height| rig_from_camera.translation.z - height);
    let floor = told.or_else(|| feet.get(feet.len() / 2).copied())?;
    Some(Translation3::new(0.0, 0.0, -floor) * rig_from_camera)
}

/// Returns the people of all images with the upper bodies of their boxes, and the places of their heads.
fn rows(bodies: &[WholeBody], places: &Places, rig_from_camera: &Isometry3<f64>) -> Vec<Row> {
    let row = |body: &WholeBody| {
        let Region { x, y, width, height } = body.region;
        let upper = Rect::new(x, y, width, height).upper_body_of_standing(STANDING_HEIGHT_M);
        let place = places.get(&(body.frame, body.id));
        Row {
            frame: body.frame,
            id: body.id,
            upper_body: Some(Region {
                x: upper.x,
                y: upper.y,
                width: upper.width,
                height: upper.height,
            }),
            visible_body: None,
            head_in_camera_m: place.map(|place| head(place, rig_from_camera)),
            visible: body.visible,
            occluder: "0".into(),
            ignore: !body.counts,
            interpolated: 1,
            key: true,
        }
    };
    bodies.iter().map(row).collect()
}

/// Returns the surface of the head that the camera sees, in its frame.
fn head((middle, height): &(Point3<f64>, f64), rig_from_camera: &Isometry3<f64>) -> [f64; 3] {
    let centre = middle + nalgebra::Vector3::z() * (0.5 * height - HEAD_BELOW_TOP_M);
    let seen = rig_from_camera.inverse() * centre;
    // `people.csv` has the surface, and `eval` goes back to the centre.
    let ray = seen.coords.try_normalize(1e-6).unwrap_or_default();
    (seen - ray * HEAD_RADIUS_M).into()
}

/// Returns the numbers under a key of a sensor in a YAML file, whether they stand in the line, in
/// brackets or in a list below.
fn listed(text: &str, sensor: &str, key: &str) -> Option<Vec<f64>> {
    let indent = |line: &str| line.len() - line.trim_start().len();
    let mut lines = text.lines().skip_while(|line| line.trim().trim_end_matches(':') != sensor);
    let outer = indent(lines.next()?);
    let mut block =
        lines.take_while(|line| line.trim().is_empty() || indent(line) > outer).map(str::trim);
    let first = block.find_map(|line| line.strip_prefix(key)?.strip_prefix(':'))?;
    let items = block.map_while(|line| line.strip_prefix("- "));
    let words = |part: &'_ str| {
        let cut = part.split([' ', ',', '[', ']', '"', '\'']);
        cut.filter(|word| !word.is_empty()).map(str::parse).collect::<Vec<_>>()
    };
    let all = std::iter::once(first).chain(items).flat_map(words);
    all.map(|value| value.ok().filter(|value: &f64| value.is_finite())).collect()
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    const YAML: &str = "lidar:\n  D: [9]\ncameras:\n  sensor_0:\n    K: 476.7 0 350.7 0 479.5 209.5 \
                        0 0 1\n    D: '-0.33 0.15 0.1 0.2 0.3'\n  sensor_2:\n    cam2ego:\n    - \
                        [1.0, 2]\n    - [3, 4.5]\n    K: x\n";

    #[test]
    fn numbers_of_a_sensor_stand_in_a_line_or_in_a_list() {
        assert_eq!(listed(YAML, "sensor_0", "K").unwrap()[..3], [476.7, 0.0, 350.7]);
        assert_eq!(listed(YAML, "sensor_0", "D"), Some(vec![-0.33, 0.15, 0.1, 0.2, 0.3]));
        assert_eq!(listed(YAML, "sensor_2", "cam2ego"), Some(vec![1.0, 2.0, 3.0, 4.5]));
        for (sensor, key) in [("sensor_0", "cam2ego"), ("sensor_2", "K"), ("sensor_4", "K")] {
            assert_eq!(listed(YAML, sensor, key), None, "{sensor} {key}");
        }
    }

    #[test]
    fn cameras_are_told_apart_by_name() {
        let of = |camera: Option<&str>| Files {
            root: PathBuf::new(),
            name: String::new(),
            camera: camera.map(str::to_owned),
        };
        for name in ["image0", "image_0"] {
            assert!(of(Some("0")).is_named(name) && !of(Some("8")).is_named(name), "{name}");
        }
        assert!(of(None).is_named("stitched_image0") && !of(Some("0")).is_named("stitched_image0"));
    }

    #[test]
    fn times_are_numbers_or_texts_and_never_before_zero() {
        assert_eq!(seconds(Some(&json!("1.5"))), Some(1.5));
        assert_eq!(seconds(Some(&json!(2))), Some(2.0));
        for wrong in [json!(-1), json!("x"), json!(null), json!(1e300)] {
            assert_eq!(seconds(Some(&wrong)), None, "{wrong}");
        }
    }
}
