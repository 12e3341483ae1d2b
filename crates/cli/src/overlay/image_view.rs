use nalgebra::Point2;
use tagalong_core::{DepthImage, Images, Rect, RgbImage, Track};
use tagalong_pipeline::Fate;

use super::canvas::{Canvas, Ink, LINE_PX};
use super::trails::Trails;
use super::{Scene, colour_of};

/// Depth at which the shading of depth images is darkest, m.
const FAR_M: f32 = 8.0;

const REJECTED: Ink = Ink::solid([200, 200, 200]).faint(0.55);
const TITLE: Ink = Ink::solid([255, 255, 255]);

/// The camera's image with everything drawn on it.
pub fn draw(scene: &Scene, trails: &Trails) -> Canvas {
    let (width, height) = (scene.camera.width, scene.camera.height);
    let mut canvas = Canvas::new(width, height, [0; 3]);
    if let Some(picture) = background(&scene.images) {
        canvas.paste(&picture, 0);
    }
    draw_rejected(&mut canvas, scene);
    draw_trails(&mut canvas, scene, trails);
    // Far to near, so that near people cover far ones.
    for track in scene.report.tracks.iter().rev() {
        draw_track(&mut canvas, track);
    }
    canvas.text(Point2::new(2.0, 2.0), &title(scene), TITLE);
    canvas
}

/// The best picture of the scene that the log carries.
fn background(images: &Images) -> Option<RgbImage> {
    if let Some(colour) = &images.colour {
        return Some(RgbImage::clone(colour));
    }
    if let Some(grey) = &images.grey {
        return Some(grey.map(|v| [v; 3]));
    }
    images.depth.as_deref().map(shaded)
}

/// Near is bright, far is dark, no reading is a dark red.
fn shaded(depth: &DepthImage) -> RgbImage {
    depth.map(|metres| {
        if metres.is_finite() {
            [(235.0 * (1.0 - (metres / FAR_M).clamp(0.0, 1.0)) + 20.0) as u8; 3]
        } else {
            [40, 0, 0]
        }
    })
}

fn title(scene: &Scene) -> String {
    let people = scene.report.tracks.iter().filter(|t| t.confirmed && t.seen).count();
    format!("frame {}  {} s  {people} seen", scene.report.index, scene.report.stamp)
}

/// What was dropped, with the test that dropped it.
fn draw_rejected(canvas: &mut Canvas, scene: &Scene) {
    for candidate in &scene.report.candidates {
        if let Fate::Dropped(test) = candidate.fate {
            label(canvas, &candidate.detection.region, test);
        }
    }
    for entry in scene.report.funnel.entries() {
        let shown = scene.report.candidates.iter().any(|c| c.fate == Fate::Dropped(entry.test));
        if let Some(region) = entry.example.filter(|_| !shown) {
            label(canvas, &region, &format!("{} x{}", entry.test, entry.count));
        }
    }
}

fn label(canvas: &mut Canvas, region: &Rect, test: &str) {
    canvas.outline(region, 1, REJECTED);
    canvas.text(Point2::new(region.x, region.bottom() - LINE_PX), test, REJECTED);
}

fn draw_trails(canvas: &mut Canvas, scene: &Scene, trails: &Trails) {
    for (id, trail) in trails.in_robot(scene) {
        let points: Vec<_> = trail.iter().filter_map(|p| scene.camera.project(p)).collect();
        canvas.path(&points, colour_of(id.0).faint(0.8));
    }
}

/// Seen: a thick box; predicted only: a thin one; tentative: grey.
fn draw_track(canvas: &mut Canvas, track: &Track) {
    let ink = if track.confirmed { colour_of(track.id.0) } else { REJECTED };
    let region = &track.estimate.region;
    canvas.outline(region, if track.seen { 2 } else { 1 }, ink);
    let state = match (track.confirmed, track.seen, track.occluded) {
        (false, _, _) => " ?",
        (true, true, _) => "",
        (true, false, true) => " hidden",
        (true, false, false) => " unseen",
    };
    let distance = track.estimate.person.position.xy().coords.norm();
    let text = format!("{}{state} {distance:.1}m", track.id);
    canvas.text(Point2::new(region.x, region.y - LINE_PX), &text, ink);
}
