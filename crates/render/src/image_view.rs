use nalgebra::Point2;
use tagalong_core::{DepthImage, Images, RgbImage, Track};
use tagalong_geometry::Rect;
use tagalong_pipeline::Fate;
use tagalong_vision::{Sketch, SketchMap, SketchPoint};

use super::canvas::{Canvas, Ink, LINE_PX};
use super::trails::Trails;
use super::{OverlayData, colour_of};

/// Depth at which the shading of depth images is darkest, m.
const FAR_M: f32 = 8.0;

const REJECTED: Ink = Ink::solid([200, 200, 200]).faint(0.55);
const TITLE: Ink = Ink::solid([255, 255, 255]);

/// Renders the camera's image with all overlays.
pub fn draw(scene: &OverlayData, trails: &Trails) -> Canvas {
    let (width, height) = (scene.camera.width, scene.camera.height);
    let mut canvas = Canvas::new(width, height, [0; 3]);
    if let Some(picture) = background(&scene.images) {
        canvas.paste(&picture, 0, 0);
    }
    // Tracks come last, so that nothing hides them.
    let shown = scene.report.visualisation.as_ref();
    if let Some(sketch) = shown.and_then(|shown| shown.downcast_ref::<Sketch>()) {
        draw_sketch(&mut canvas, sketch);
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

/// Returns the best picture of the scene in the log: colour, grey, or shaded depth.
pub fn background(images: &Images) -> Option<RgbImage> {
    if let Some(colour) = &images.colour {
        return Some(RgbImage::clone(colour));
    }
    if let Some(grey) = &images.grey {
        return Some(grey.map(|v| [v; 3]));
    }
    images.depth.as_deref().map(shaded)
}

/// Shades depth: near is bright, far is dark, no reading is a dark red.
fn shaded(depth: &DepthImage) -> RgbImage {
    depth.map(|metres| {
        if metres.is_finite() {
            [(235.0 * (1.0 - (metres / FAR_M).clamp(0.0, 1.0)) + 20.0) as u8; 3]
        } else {
            [40, 0, 0]
        }
    })
}

fn title(scene: &OverlayData) -> String {
    let people = scene.report.tracks.iter().filter(|t| t.confirmed && t.seen).count();
    format!("frame {}  {} s  {people} seen", scene.report.index, scene.report.stamp)
}

/// Renders the state of the filter: bodies, particles, and maps in the lower
/// left corner.
fn draw_sketch(canvas: &mut Canvas, sketch: &Sketch) {
    for body in &sketch.silhouettes {
        let ink = colour_of(body.id.0).faint(0.4);
        body.runs.iter().for_each(|run| canvas.fill(run, ink));
    }
    for SketchPoint { id, pixel, weight } in &sketch.points {
        let opacity = 0.25 + 0.75 * weight.clamp(0.0, 1.0);
        canvas.disc(*pixel, 1.5, colour_of(id.0).faint(opacity as f32));
    }
    let mut bottom = canvas.height() as f64 - MAP_MARGIN_PX;
    for map in &sketch.maps {
        bottom -= draw_map(canvas, map, bottom) + MAP_MARGIN_PX;
    }
}

/// Side of a map's cell, and margin around a map, pixels.
const CELL_PX: f64 = 2.0;
const MAP_MARGIN_PX: f64 = 4.0;

/// Renders one map with its title, above `bottom`; returns its height, pixels.
fn draw_map(canvas: &mut Canvas, map: &SketchMap, bottom: f64) -> f64 {
    let rows = map.values.len().div_ceil(map.columns.max(1));
    let height = CELL_PX * rows as f64;
    for (i, value) in map.values.iter().enumerate() {
        let (x, y) = ((i % map.columns.max(1)) as f64, (i / map.columns.max(1)) as f64);
        let shade = (255.0 * value.clamp(0.0, 1.0)) as u8;
        let cell =
            Rect::new(MAP_MARGIN_PX + CELL_PX * x, bottom - height + CELL_PX * y, CELL_PX, CELL_PX);
        canvas.fill(&cell, Ink::solid([shade, shade / 2, 255 - shade]));
    }
    canvas.text(Point2::new(MAP_MARGIN_PX, bottom - height - LINE_PX), &map.title, TITLE);
    height + LINE_PX
}

/// Renders the dropped candidates, with the test that dropped them.
fn draw_rejected(canvas: &mut Canvas, scene: &OverlayData) {
    for candidate in &scene.report.candidates {
        if let Fate::Dropped(test) = candidate.fate {
            label(canvas, &candidate.detection.rect_in(&scene.camera), test);
        }
    }
    // A funnel entry without a visible candidate is shown once, with its count.
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

fn draw_trails(canvas: &mut Canvas, scene: &OverlayData, trails: &Trails) {
    for (id, trail) in trails.in_robot(scene) {
        let points: Vec<_> = trail.iter().filter_map(|p| scene.camera.project(p)).collect();
        canvas.path(&points, colour_of(id.0).faint(0.8));
    }
}

/// Renders a track. Seen: a thick box; predicted only: a thin one; tentative: grey.
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
