use std::fs;
use std::path::Path;

use nalgebra::Point2;
use tagalong_core::{DepthImage, Images, RgbImage};
use tagalong_sim::{Event, Scene, Shot, Simulation};

use crate::outcome::{Failure, say};
use crate::overlay::canvas::{Canvas, Ink};
use crate::overlay::write_png;

/// Pictures of one scene.
const PICTURES: u64 = 6;
/// Depth that is drawn black, m.
const FAR_M: f32 = 8.0;

/// Draws some moments of a scene, evenly spread, with the truth on them: the
/// image on the left, depth or the right image beside it.
pub fn paint(mut simulation: Simulation, scene: &Scene, folder: &Path) -> Result<(), Failure> {
    fs::create_dir_all(folder)
        .map_err(|error| Failure::failed(format!("cannot make {}: {error}", folder.display())))?;
    let every_ns = (scene.duration_s * 1e9) as u64 / PICTURES;
    let mut drawn = 0;
    while let Some(event) = simulation.next_event() {
        let Event::Shot(shot) = event else { continue };
        if shot.captured_ns < drawn * every_ns + every_ns / 2 {
            continue;
        }
        drawn += 1;
        let path = folder.join(format!("{:06}ms.png", shot.captured_ns / 1_000_000));
        write_png(&path, &picture(&shot))
            .map_err(|why| Failure::failed(format!("cannot write {}: {why}", path.display())))?;
    }
    say(&format!("{drawn} pictures are in {}", folder.display()));
    Ok(())
}

fn picture(shot: &Shot) -> RgbImage {
    let (first, second) = side_by_side(&shot.images);
    let mut canvas = Canvas::new(first.width() + second.width(), first.height(), [0; 3]);
    canvas.paste(&first, 0);
    canvas.paste(&second, first.width());
    for person in &shot.truth {
        let ink = Ink::solid(if person.ignore { [150; 3] } else { [255, 220, 0] });
        if let Some(whole) = &person.upper_body {
            canvas.outline(whole, 1, ink);
            let hidden = person.occluder.map_or(String::new(), |id| format!("<{id}"));
            let text = format!("{} {:.0}%{hidden}", person.id, 100.0 * person.visible_fraction);
            canvas.text(Point2::new(whole.x, whole.y - 10.0), &text, ink);
        }
        if let Some(visible) = &person.visible {
            canvas.outline(visible, 1, Ink::solid([0, 200, 255]).faint(0.7));
        }
    }
    canvas.into_image()
}

fn side_by_side(images: &Images) -> (RgbImage, RgbImage) {
    let grey = |image: &tagalong_core::GreyImage| image.map(|v| [v; 3]);
    let first = images.colour.as_deref().cloned().or(images.grey.as_deref().map(grey));
    let second = images
        .depth
        .as_deref()
        .map(shades)
        .or(images.right.as_deref().map(|right| grey(&right.image)));
    (first.unwrap_or_default(), second.unwrap_or_default())
}

/// Near is bright, no reading is red.
fn shades(depth: &DepthImage) -> RgbImage {
    depth.map(|z| {
        let shade = (255.0 * (1.0 - z / FAR_M)).clamp(0.0, 255.0) as u8;
        if z.is_nan() { [90, 0, 0] } else { [shade; 3] }
    })
}
