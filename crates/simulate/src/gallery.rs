use std::path::Path;
use std::sync::Arc;

use nalgebra::Point2;
use tagalong_app::outcome::{Failure, make_folder, say};
use tagalong_core::{DepthImage, Images, RgbImage};
use tagalong_geometry::Rect;
use tagalong_math::counted;
use tagalong_render::canvas::{Canvas, Ink, LINE_PX};
use tagalong_render::write_png;
use tagalong_sim::{Event, Joint, Scene, Shot, Simulation, Truth};
use tagalong_vision::Unwrapper;

/// Pictures of one scene.
const PICTURES: u64 = 6;
/// Depth from which pixels are black, m.
const FAR_M: f32 = 8.0;
/// Joints that a bone connects.
const BONES: [[&str; 2]; 12] = [
    ["left_shoulder", "right_shoulder"],
    ["left_shoulder", "left_elbow"],
    ["left_elbow", "left_wrist"],
    ["right_shoulder", "right_elbow"],
    ["right_elbow", "right_wrist"],
    ["left_shoulder", "left_hip"],
    ["right_shoulder", "right_hip"],
    ["left_hip", "right_hip"],
    ["left_hip", "left_knee"],
    ["left_knee", "left_ankle"],
    ["right_hip", "right_knee"],
    ["right_knee", "right_ankle"],
];

/// Renders pictures of a scene at evenly spaced times, with the truth: the image on the left, and
/// beside it depth or the right image, or for a mirror the unwrapped image and the raw one. Images
/// of cameras in the room are in a separate picture.
pub fn paint(mut simulation: Simulation, scene: &Scene, folder: &Path) -> Result<(), Failure> {
    make_folder(folder)?;
    let mut unwrapping = Unwrapping::of(&simulation)?;
    let mut webcams: Vec<Arc<RgbImage>> = simulation.webcams().map(|_| Arc::default()).collect();
    let every_ns = (scene.duration_s * 1e9) as u64 / PICTURES;
    let mut drawn = 0;
    while let Some(event) = simulation.next_event() {
        let shot = match event {
            Event::Shot(shot) => shot,
            Event::Webcam(shot) => {
                webcams[shot.webcam] = shot.image;
                continue;
            }
            Event::Odometry(_) | Event::NoOdometry { .. } | Event::Sensor(_) => continue,
        };
        // Offset by half an interval, so that the pictures are in the middle of equal parts of the
        // scene.
        if shot.captured_ns < drawn * every_ns + every_ns / 2 {
            continue;
        }
        drawn += 1;
        let name = format!("{:06}ms", shot.captured_ns / 1_000_000);
        save(&folder.join(format!("{name}.png")), &picture(&shot, unwrapping.as_mut())?)?;
        if !webcams.is_empty() {
            save(&folder.join(format!("{name}-webcams.png")), &beside(&webcams))?;
        }
    }
    say(&format!("{}: {}", folder.display(), counted(drawn, "picture")));
    Ok(())
}

fn save(path: &Path, image: &RgbImage) -> Result<(), Failure> {
    write_png(path, image)
        .map_err(|why| Failure::failed(format!("cannot write {}: {why}", path.display())))
}

/// Converter from the circular image of a mirror to the panorama that the truth refers to.
struct Unwrapping {
    unwrapper: Unwrapper<[u8; 3]>,
    unwrapped: RgbImage,
}

impl Unwrapping {
    /// Creates the converter; `None` for a camera without a mirror.
    fn of(simulation: &Simulation) -> Result<Option<Self>, Failure> {
        let Some(panorama) = simulation.panorama() else { return Ok(None) };
        let camera = simulation.camera();
        let unwrapper =
            Unwrapper::new(panorama, camera.width, camera.height).map_err(Failure::failed)?;
        Ok(Some(Self { unwrapper, unwrapped: RgbImage::default() }))
    }
}

fn picture(shot: &Shot, unwrapping: Option<&mut Unwrapping>) -> Result<RgbImage, Failure> {
    let (first, second) = side_by_side(&shot.images);
    let Some(Unwrapping { unwrapper, unwrapped }) = unwrapping else {
        return Ok(beside(&[Arc::new(annotated(&first, &shot.truth)), Arc::new(second)]));
    };
    unwrapper.apply(&first, unwrapped).map_err(Failure::failed)?;
    Ok(beside(&[Arc::new(annotated(unwrapped, &shot.truth)), Arc::new(first)]))
}

/// Joins pictures in a row.
fn beside(pictures: &[Arc<RgbImage>]) -> RgbImage {
    let width = pictures.iter().map(|p| p.width()).sum();
    let height = pictures.iter().map(|p| p.height()).max().unwrap_or(0);
    let mut canvas = Canvas::new(width, height, [0; 3]);
    let mut left = 0;
    for picture in pictures {
        canvas.paste(picture, left, 0);
        left += picture.width();
    }
    canvas.into_image()
}

fn annotated(image: &RgbImage, truth: &[Truth]) -> RgbImage {
    let width = image.width() as f64;
    let mut canvas = Canvas::new(image.width(), image.height(), [0; 3]);
    canvas.paste(image, 0, 0);
    for person in truth {
        let ink = Ink::solid(if person.ignore { [150; 3] } else { [255, 220, 0] });
        if let Some(whole) = &person.upper_body {
            outline(&mut canvas, whole, width, ink);
            let hidden = person.occluder.map_or(String::new(), |id| format!("<{id}"));
            let text = format!("{} {:.0}%{hidden}", person.id, 100.0 * person.visible_fraction);
            canvas.text(Point2::new(whole.x, whole.y - LINE_PX), &text, ink);
        }
        if let Some(visible) = &person.visible {
            outline(&mut canvas, visible, width, Ink::solid([0, 200, 255]).faint(0.7));
        }
        skeleton(&mut canvas, &person.joints);
    }
    canvas.into_image()
}

/// Renders the bones between joints in the image: visible ones bright, the others faint.
fn skeleton(canvas: &mut Canvas, joints: &[Joint]) {
    for [from, to] in BONES {
        let from = joints.iter().find(|joint| joint.name == from);
        let to = joints.iter().find(|joint| joint.name == to);
        let Some((from, to)) = from.zip(to) else { continue };
        let Some((a, b)) = from.pixel.zip(to.pixel) else { continue };
        // Across the seam of a panorama a bone would cross the whole image.
        if (a.x - b.x).abs() > 0.5 * canvas.width() as f64 {
            continue;
        }
        let ink = Ink::solid([90, 255, 120]);
        canvas.line(a, b, if from.in_sight && to.in_sight { ink } else { ink.faint(0.3) });
    }
}

/// Renders the outline of a rectangle. Beyond the right edge of a panorama it continues at the
/// left.
fn outline(canvas: &mut Canvas, rect: &Rect, width: f64, ink: Ink) {
    canvas.outline(rect, 1, ink);
    if rect.right() > width {
        canvas.outline(&Rect { x: rect.x - width, ..*rect }, 1, ink);
    }
}

fn side_by_side(images: &Images) -> (RgbImage, RgbImage) {
    let grey = images.grey.as_deref().map(|image| image.map(|v| [v; 3]));
    let first = images.colour.as_deref().cloned().or(grey);
    let right = images.right.as_deref().map(|right| right.image.map(|v| [v; 3]));
    let second = images.depth.as_deref().map(shades).or(right);
    (first.unwrap_or_default(), second.unwrap_or_default())
}

/// Shades depth: near is bright, no reading is red.
fn shades(depth: &DepthImage) -> RgbImage {
    depth.map(|z| {
        let shade = (255.0 * (1.0 - z / FAR_M)).clamp(0.0, 255.0) as u8;
        if z.is_nan() { [90, 0, 0] } else { [shade; 3] }
    })
}
