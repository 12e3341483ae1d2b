use nalgebra::Point2;
use tagalong_core::{DepthImage, Images, RgbImage, Track, TrackId};
use tagalong_geometry::Rect;
use tagalong_pipeline::Fate;
use tagalong_vision::{Sketch, SketchMap, SketchPoint};

use super::canvas::{Canvas, Ink, LINE_PX, Lettering};
use super::data::OverlayData;
use super::enlarge::{enlarge, factor};
use super::labels::Labels;
use super::style::{OverlayStyle, colour, colour_of};
use super::trails::Trails;

/// Depth at which the shading of depth images is darkest, m.
const FAR_M: f32 = 8.0;

/// Colour of dropped candidates.
pub const DROPPED: Ink = Ink::solid([215, 215, 215]).faint(0.7);

/// Fraction of the box of a predicted person that has to be inside the image for a label.
const LABELLED: f64 = 0.25;

const TITLE: Ink = Ink::solid([255, 255, 255]);

/// Camera's image with all overlays, enlarged.
struct ImageView {
    canvas: Canvas,
    scale: f64,
}

/// Renders the camera's image with all overlays.
pub fn draw(scene: &OverlayData, trails: &Trails, style: OverlayStyle) -> Canvas {
    let by = factor(scene.camera.width);
    let width = by * scene.camera.width;
    let height = by * scene.camera.height;
    let mut view = ImageView { canvas: Canvas::new(width, height, [0; 3]), scale: by as f64 };
    if let Some(picture) = background(&scene.images) {
        view.canvas.paste(&enlarge(&picture, by), 0, 0);
    }
    let mut labels = labels(scene, by, style);
    // Tracks come last, so that nothing hides them.
    let shown = scene.report.visualisation.as_ref().filter(|_| !scene.shows_past());
    if let Some(sketch) = shown.and_then(|shown| shown.downcast_ref::<Sketch>()) {
        view.draw_silhouettes(sketch);
        if style.is_debug() {
            view.draw_filter(sketch, &mut labels);
        }
    }
    if style.is_debug() {
        view.draw_dropped(scene);
    }
    view.draw_trails(scene, trails);
    // Far to near, so that near people cover far ones.
    for track in style.tracks(scene).rev() {
        let region = view.scaled(&style.region(scene, track));
        draw_box(
            &mut view.canvas,
            &region,
            track.seen && !scene.shows_past(),
            colour(scene, track),
        );
    }
    view.draw_joints(scene, style);
    add_labels(&mut labels, scene, by, style);
    labels.paint(&mut view.canvas);
    view.canvas
}

fn scaled(rect: &Rect, by: f64) -> Rect {
    Rect::new(by * rect.x, by * rect.y, by * rect.width, by * rect.height)
}

/// Returns the area of the labels, which avoid the boxes of tracks.
fn labels(scene: &OverlayData, by: usize, style: OverlayStyle) -> Labels {
    let width = by * scene.camera.width;
    let height = by * scene.camera.height;
    let tracks = scene.report.tracks.iter().filter(|track| track.confirmed);
    let spared = tracks.map(|track| scaled(&style.region(scene, track), by as f64)).collect();
    Labels::within(Rect::new(0.0, 0.0, width as f64, height as f64), spared)
}

/// Adds the labels of tracks, nearest first, and, for debugging, those of dropped candidates where
/// there is room.
pub fn add_labels(labels: &mut Labels, scene: &OverlayData, by: usize, style: OverlayStyle) {
    let lettering = Lettering::of_width(by * scene.camera.width);
    let area = Rect::new(0.0, 0.0, scene.camera.width as f64, scene.camera.height as f64);
    for track in style.tracks(scene) {
        let region = style.region(scene, track);
        // A person that another sensor sees has no box. A label at the border for a predicted person
        // outside of the image explains nothing there.
        let inside = region.intersection(&area).area();
        if region.width <= 0.0 || !track.seen && inside < LABELLED * region.area() {
            continue;
        }
        let region = scaled(&region, by as f64);
        let name = name_of(scene, track);
        labels.add(&region, name, lettering, colour(scene, track));
    }
    for (region, test) in dropped(scene).into_iter().filter(|_| style.is_debug()) {
        labels.add_if_room(&scaled(&region, by as f64), test, Lettering::Small, DROPPED.faint(1.0));
    }
}

/// Returns the labels of a scene as they are placed.
#[cfg(test)]
pub fn placed_labels(scene: &OverlayData, style: OverlayStyle) -> Labels {
    let by = factor(scene.camera.width);
    let mut labels = labels(scene, by, style);
    add_labels(&mut labels, scene, by, style);
    labels
}

/// Renders the box of a track, thick if it is seen and thin if it is only predicted, with a dark
/// rim that makes it visible on bright images.
pub fn draw_box(canvas: &mut Canvas, region: &Rect, seen: bool, ink: Ink) {
    // A person that another sensor sees has no box.
    if region.width <= 0.0 {
        return;
    }
    let thick = if seen { 3 } else { 1 };
    let rim = Rect::new(region.x - 1.0, region.y - 1.0, region.width + 2.0, region.height + 2.0);
    canvas.outline(&rim, thick + 2, Ink::solid([0; 3]).faint(0.5));
    canvas.outline(region, thick, ink);
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

/// Side of a map's cell in the image, and margin around a map, pixels.
const CELL_PX: f64 = 2.0;
const MAP_MARGIN_PX: f64 = 4.0;

impl ImageView {
    fn scaled(&self, rect: &Rect) -> Rect {
        scaled(rect, self.scale)
    }

    fn pixel(&self, point: &Point2<f64>) -> Point2<f64> {
        point * self.scale
    }

    fn draw_silhouettes(&mut self, sketch: &Sketch) {
        for body in &sketch.silhouettes {
            let ink = colour_of(body.id).faint(0.4);
            body.runs.iter().for_each(|run| self.canvas.fill(&scaled(run, self.scale), ink));
        }
    }

    /// Renders the state of the filter: particles, and maps in the lower left corner.
    fn draw_filter(&mut self, sketch: &Sketch, labels: &mut Labels) {
        for SketchPoint { id, pixel, weight } in &sketch.points {
            let opacity = 0.25 + 0.75 * weight.clamp(0.0, 1.0);
            let ink = colour_of(*id).faint(opacity as f32);
            self.canvas.disc(self.pixel(pixel), 1.0 + 0.5 * self.scale, ink);
        }
        let mut bottom = self.canvas.height() as f64 - MAP_MARGIN_PX;
        for map in &sketch.maps {
            let place = self.draw_map(map, bottom);
            bottom -= place.height + MAP_MARGIN_PX;
            labels.reserve(place);
        }
    }

    /// Renders one map with its title, above `bottom`; returns its area.
    fn draw_map(&mut self, map: &SketchMap, bottom: f64) -> Rect {
        let columns = map.columns.max(1);
        let cell = CELL_PX * self.scale;
        let left = MAP_MARGIN_PX;
        let height = cell * map.values.len().div_ceil(columns) as f64;
        for (i, value) in map.values.iter().enumerate() {
            let x = (i % columns) as f64;
            let y = (i / columns) as f64;
            let shade = (255.0 * value.clamp(0.0, 1.0)) as u8;
            let place = Rect::new(left + cell * x, bottom - height + cell * y, cell, cell);
            self.canvas.fill(&place, Ink::solid([shade, shade / 2, 255 - shade]));
        }
        let top = bottom - height - LINE_PX;
        self.canvas.text(Point2::new(left, top), &map.title, TITLE);
        let width = (cell * columns as f64).max(Lettering::Small.size_px(&map.title)[0]);
        Rect::new(left, top, width, height + LINE_PX)
    }

    /// Renders the lines between the joints of people whose joints a detector found.
    fn draw_joints(&mut self, scene: &OverlayData, style: OverlayStyle) {
        let joints = scene.report.joints();
        for track in style.tracks(scene) {
            let Some((_, joints)) = joints.iter().find(|(id, _)| *id == track.id) else { continue };
            for [from, to] in joints.bones() {
                let ends = [self.pixel(&from), self.pixel(&to)];
                self.canvas.thick_path(&ends, colour(scene, track));
            }
        }
    }

    fn draw_dropped(&mut self, scene: &OverlayData) {
        for (region, _) in dropped(scene) {
            let region = self.scaled(&region);
            self.canvas.dashed(&region, DROPPED);
        }
    }

    fn draw_trails(&mut self, scene: &OverlayData, trails: &Trails) {
        for (id, trail) in trails.in_robot(scene) {
            let mut piece = Vec::new();
            for head in &trail {
                match scene.camera.project(head) {
                    Some(pixel) => piece.push(self.pixel(&pixel)),
                    // A line across the part outside of the view would cross the picture.
                    None => self.draw_trail(&mut piece, id),
                }
            }
            self.draw_trail(&mut piece, id);
        }
    }

    /// Renders a piece of a trail and empties it.
    fn draw_trail(&mut self, piece: &mut Vec<Point2<f64>>, id: TrackId) {
        self.canvas.thick_path(piece, colour_of(id).faint(0.8));
        piece.clear();
    }
}

/// Returns the regions of dropped candidates, with the test that dropped them.
fn dropped(scene: &OverlayData) -> Vec<(Rect, String)> {
    let mut all = Vec::new();
    for candidate in &scene.report.candidates {
        if let Fate::Dropped(test) = candidate.fate {
            all.push((candidate.detection.rect_in(&scene.camera), test.to_owned()));
        }
    }
    // A funnel entry without a visible candidate is shown once; the legend has its count.
    for entry in scene.report.funnel.entries() {
        let shown = scene.report.candidates.iter().any(|c| c.fate == Fate::Dropped(entry.test));
        if let Some(region) = entry.example.filter(|_| !shown) {
            all.push((region, entry.test.to_owned()));
        }
    }
    all
}

/// Returns the ID of a track, whether it is the target, its state, and its distance from the robot.
fn name_of(scene: &OverlayData, track: &Track) -> String {
    let target = if scene.report.target == Some(track.id) { " target" } else { "" };
    let state = match (track.confirmed, track.seen) {
        (false, _) => "?",
        _ if scene.shows_past() => " stale",
        (true, true) => "",
        (true, false) => " predicted",
    };
    format!("{}{target}{state} {}", track.id, track.estimate.distance_text())
}
