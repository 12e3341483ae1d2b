use nalgebra::{Matrix2, Point2, Point3, SymmetricEigen, Vector2};
use tagalong_core::Track;
use tagalong_geometry::Rect;

use super::canvas::{Canvas, Ink, LINE_PX, Lettering};
use super::data::OverlayData;
use super::labels::Labels;
use super::style::{LEAST_REACH_M, OverlayStyle, colour, colour_of};
use super::trails::Trails;

/// Reach of the view behind the robot, as a fraction of that ahead.
const BEHIND: f64 = 0.125;

/// Reach of the view ahead of the robot and behind it if people are detected on all sides, m.
const REACH_AROUND_M: [f64; 2] = [5.0, 4.0];

/// Half the side of the square around a person that labels avoid, pixels.
const MARK_PX: f64 = 8.0;

/// Colour of the plan behind all marks.
const GROUND: Ink = Ink::solid(GROUND_RGB);
const GROUND_RGB: [u8; 3] = [24, 24, 28];
const GRID: Ink = Ink::solid([60, 60, 68]);
const AXIS: Ink = Ink::solid([150, 150, 160]);
const SCAN: Ink = Ink::solid([200, 160, 90]);
const VIEW: Ink = Ink::solid([110, 130, 170]);

/// Returns the columns of the view beside an image with `height` rows.
pub fn width_px(height: usize) -> usize {
    (height * 4 / 5).next_multiple_of(2)
}

/// Map from metres on the floor to pixels: ahead is up, left is left.
struct Plan {
    robot: Point2<f64>,
    px_per_m: f64,
    width: f64,
    /// Reach ahead and behind, m.
    reach_m: [f64; 2],
}

impl Plan {
    fn new(height: usize, is_around: bool, style: OverlayStyle) -> Self {
        let ahead_m = f64::from(style.reach_m.max(LEAST_REACH_M));
        let reach_m = if is_around { REACH_AROUND_M } else { [ahead_m, BEHIND * ahead_m] };
        let [ahead_m, behind_m] = reach_m;
        let px_per_m = height as f64 / (ahead_m + behind_m);
        let width = width_px(height) as f64;
        let robot = Point2::new(0.5 * width, ahead_m * px_per_m);
        Self { robot, px_per_m, width, reach_m }
    }

    fn pixel(&self, forward_m: f64, left_m: f64) -> Point2<f64> {
        self.robot - Vector2::new(left_m, forward_m) * self.px_per_m
    }

    /// Returns the square around a person.
    fn mark(&self, track: &Track) -> Rect {
        let at = self.of(&track.estimate.person.position);
        Rect::new(at.x - MARK_PX, at.y - MARK_PX, 2.0 * MARK_PX, 2.0 * MARK_PX)
    }

    /// Returns true if a person is within the view.
    fn shows(&self, track: &Track, height: usize) -> bool {
        let whole = Rect::new(0.0, 0.0, self.width, height as f64);
        whole.contains(self.of(&track.estimate.person.position))
    }

    fn of(&self, point_in_robot: &Point3<f64>) -> Point2<f64> {
        self.pixel(point_in_robot.x, point_in_robot.y)
    }
}

/// Renders the people from above, `height` pixels high.
pub fn draw(scene: &OverlayData, trails: &Trails, style: OverlayStyle, height: usize) -> Canvas {
    let plan = Plan::new(height, scene.is_around, style);
    let mut canvas = Canvas::new(width_px(height), height, GROUND_RGB);
    draw_grid(&mut canvas, &plan);
    // A frame without an image has a camera that sees nothing.
    if !scene.camera.is_blind() && !scene.is_around {
        draw_field_of_view(&mut canvas, &plan, scene);
    }
    for point in &scene.scan {
        canvas.disc(plan.pixel(point.x, point.y), 1.0, SCAN);
    }
    canvas.disc(plan.robot, 5.0, AXIS);
    for (place, text) in notes(&plan) {
        canvas.text(Point2::new(place.x, place.y), text, AXIS);
    }
    for (id, trail) in trails.in_robot(scene) {
        let points: Vec<_> = trail.iter().map(|p| plan.of(p)).collect();
        canvas.thick_path(&points, colour_of(id).faint(0.7));
    }
    for track in style.tracks(scene).rev() {
        draw_track(&mut canvas, &plan, scene, track);
        if style.is_debug() {
            draw_uncertainty(&mut canvas, &plan, track, colour(scene, track));
        }
    }
    labels(scene, &plan, style, height).paint(&mut canvas);
    canvas
}

/// Returns the IDs of all tracks at positions that avoid all marks.
fn labels(scene: &OverlayData, plan: &Plan, style: OverlayStyle, height: usize) -> Labels {
    let marks = style.tracks(scene).map(|track| plan.mark(track)).collect();
    let mut labels = Labels::within(Rect::new(0.0, 0.0, plan.width, height as f64), marks);
    for (place, _) in notes(plan) {
        labels.reserve(place);
    }
    for track in style.tracks(scene).filter(|track| plan.shows(track, height)) {
        let is_target = scene.report.target == Some(track.id);
        let text = if is_target { format!("{} target", track.id) } else { track.id.to_string() };
        labels.add(&plan.mark(track), text, Lettering::Bold, colour(scene, track));
    }
    labels
}

/// Returns the IDs of a scene as they are placed.
#[cfg(test)]
pub fn placed_ids(scene: &OverlayData, style: OverlayStyle, height: usize) -> Labels {
    labels(scene, &Plan::new(height, scene.is_around, style), style, height)
}

/// Returns the words that explain the view, with their positions.
fn notes(plan: &Plan) -> [(Rect, &'static str); 2] {
    let above = "from above";
    let robot = "robot";
    let [above_px, height] = Lettering::Small.size_px(above);
    let [robot_px, _] = Lettering::Small.size_px(robot);
    let left = (plan.robot.x - 0.5 * robot_px).floor();
    let below = (plan.robot.y + MARK_PX).floor();
    [
        (Rect::new(plan.width - above_px - 2.0, 2.0, above_px, height), above),
        (Rect::new(left, below, robot_px, height), robot),
    ]
}

/// Renders a line every metre, and a number at every second line.
fn draw_grid(canvas: &mut Canvas, plan: &Plan) {
    let [ahead_m, behind_m] = plan.reach_m;
    let sides = (0.5 * plan.width / plan.px_per_m).ceil();
    for metre in -(sides as i32)..=sides as i32 {
        let column = plan.pixel(0.0, f64::from(metre)).x;
        let ends = [plan.pixel(ahead_m, 0.0).y, plan.pixel(-behind_m, 0.0).y];
        canvas.line(Point2::new(column, ends[0]), Point2::new(column, ends[1]), GRID);
    }
    for metre in -(behind_m as i32)..=ahead_m as i32 {
        let row = plan.pixel(f64::from(metre), 0.0).y;
        canvas.line(Point2::new(0.0, row), Point2::new(plan.width, row), GRID);
        if metre > 0 && metre % 2 == 0 {
            let at = Point2::new(2.0, row - 0.5 * LINE_PX);
            canvas.text(at, &format!("{metre} m"), AXIS);
        }
    }
}

/// Renders the two edges of the field of view, on the floor plan.
fn draw_field_of_view(canvas: &mut Canvas, plan: &Plan, scene: &OverlayData) {
    let camera = &scene.camera;
    let eye = Point3::from(camera.robot_from_camera.translation.vector);
    for column in [0.0, camera.width as f64 - 1.0] {
        let ray = camera.ray(Point2::new(column, 0.5 * camera.height as f64));
        let ray_in_robot = camera.robot_from_camera.rotation * ray;
        // Beyond the corners of the view.
        let end = eye + ray_in_robot * (1.5 * plan.reach_m[0]);
        canvas.line(plan.of(&eye), plan.of(&end), VIEW);
    }
}

fn draw_track(canvas: &mut Canvas, plan: &Plan, scene: &OverlayData, track: &Track) {
    let ink = colour(scene, track);
    let person = &track.estimate.person;
    let at = plan.of(&person.position);
    let is_seen = track.seen && !scene.shows_past();
    let opacity = if is_seen { 1.0 } else { 0.5 };
    let radius = if scene.report.target == Some(track.id) { 7.0 } else { 5.0 };
    if is_seen {
        canvas.disc(at, radius, ink);
    } else {
        draw_ring(canvas, at, radius, ink);
    }
    // Of an earlier time nothing is known of the next second.
    if scene.shows_past() {
        return;
    }
    // The line ends where the person will be in one second.
    let soon = person.position.xy() + person.velocity;
    canvas.line(at, plan.pixel(soon.x, soon.y), ink.faint(opacity));
}

/// Renders the mark of a predicted person.
pub(super) fn draw_ring(canvas: &mut Canvas, at: Point2<f64>, radius: f64, ink: Ink) {
    canvas.disc(at, radius, ink);
    canvas.disc(at, radius - 2.0, GROUND);
}

/// Renders the ellipse of two standard deviations.
fn draw_uncertainty(canvas: &mut Canvas, plan: &Plan, track: &Track, ink: Ink) {
    let person = &track.estimate.person;
    let covariance = track.estimate.covariance.fixed_view::<2, 2>(0, 0).into_owned();
    canvas.path(&ellipse(plan, &person.position, covariance), ink.faint(0.6));
}

/// Returns the ellipse of two standard deviations around a position on the floor.
fn ellipse(plan: &Plan, centre: &Point3<f64>, covariance: Matrix2<f64>) -> Vec<Point2<f64>> {
    let eigen = SymmetricEigen::new(covariance);
    let axes = eigen.eigenvectors;
    // Rounding can make an eigenvalue of a narrow ellipse slightly negative.
    let sigma = eigen.eigenvalues.map(|v| 2.0 * v.max(0.0).sqrt());
    (0..=24)
        .map(|i| {
            let (sin, cos) = (f64::from(i) * std::f64::consts::TAU / 24.0).sin_cos();
            let offset = axes * Vector2::new(sigma.x * cos, sigma.y * sin);
            plan.pixel(centre.x + offset.x, centre.y + offset.y)
        })
        .collect()
}
