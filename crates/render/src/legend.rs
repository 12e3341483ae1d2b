//! Strip below a picture: time, number of people and state of the robot, legend, dropped candidates.

use nalgebra::Point2;
use tagalong_geometry::Rect;
use tagalong_pipeline::{FrameReport, Outcome};
use tagalong_vision::Sketch;

use super::canvas::{Canvas, Ink, LINE_PX, Lettering};
use super::data::OverlayData;
use super::image_view::{DROPPED, draw_box};
use super::style::{OverlayStyle, TENTATIVE};
use super::trails::Trails;

/// Returns the height of the strip under image and plan, pixels. It is the same for all frames, so
/// that the pictures can be made into a video.
pub fn height_px(style: OverlayStyle) -> usize {
    if style.is_debug() { 64 } else { 46 }
}

const MARGIN_PX: f64 = 6.0;
const MARK_PX: f64 = 14.0;
const WHITE: Ink = Ink::solid([235, 235, 235]);
const QUIET: Ink = Ink::solid([190, 190, 190]);
/// Colour of the examples, which no track has.
const EXAMPLE: Ink = Ink::solid([120, 190, 255]);

/// Renders the frame number, the legend and, for debugging, counts of dropped candidates in the
/// strip below `top`.
pub fn draw(
    canvas: &mut Canvas,
    top: usize,
    scene: &OverlayData,
    trails: &Trails,
    style: OverlayStyle,
) {
    let rows = [0.0, 1.0, 2.0].map(|row| top as f64 + 4.0 + row * (LINE_PX + 1.0));
    canvas.write(
        Point2::new(MARGIN_PX, rows[0]),
        &title(scene, trails, style),
        Lettering::Bold,
        WHITE,
    );
    let mut at = Point2::new(MARGIN_PX, rows[1]);
    for (sample, meaning) in entries(scene, style) {
        at.x += draw_entry(canvas, at, sample, meaning);
    }
    if !style.is_debug() {
        return;
    }
    let columns =
        (canvas.width() as f64 - 2.0 * MARGIN_PX) / Lettering::Small.size_px("m")[0].max(1.0);
    let dropped = counts(scene, columns as usize);
    canvas.text(Point2::new(MARGIN_PX, rows[2]), &dropped, QUIET);
}

fn title(scene: &OverlayData, trails: &Trails, style: OverlayStyle) -> String {
    let people = seen(scene);
    let drive = drive(&scene.report);
    if !style.is_debug() {
        let elapsed_s = trails.elapsed_s(scene.report.stamp);
        return format!("{elapsed_s:.1} s   {people}   frame {}{drive}", scene.report.index);
    }
    let ms = scene.report.stamp.nanos() / 1_000_000;
    let s = ms / 1000;
    let ms = ms % 1000;
    format!("frame {}   {s}.{ms:03} s   {people}{drive}", scene.report.index)
}

/// Returns the number of visible people in words, or that the frame was not used or is that of a
/// frozen camera.
fn seen(scene: &OverlayData) -> String {
    match scene.report.outcome {
        Outcome::OutOfOrder => return "late, not used".to_owned(),
        Outcome::Duplicate => return "repeated, not used".to_owned(),
        _ if scene.shows_past() => return "frozen image, places are old".to_owned(),
        _ => {}
    }
    match scene.report.tracks.iter().filter(|t| t.confirmed && t.seen).count() {
        1 => "1 person seen".to_owned(),
        people => format!("{people} people seen"),
    }
}

/// Returns the target, the command and its reason, if the pipeline has a controller.
fn drive(report: &FrameReport) -> String {
    let Some(command) = report.command else { return String::new() };
    let target = report.target.map_or("no target".to_owned(), |id| format!("target {id}"));
    let twist = command.told_twist();
    let speed = twist.linear_mps;
    let turn = twist.angular_rps;
    format!("   {target}   {speed:.2} m/s {turn:+.2} rad/s: {}", command.reason)
}

/// Line or mark in the picture.
#[derive(Clone, Copy)]
enum Sample {
    Seen,
    Predicted,
    Tentative,
    Dropped,
    Trail,
    Particles,
    Ellipse,
    Velocity,
}

/// Returns the marks with their meanings, most important first.
fn entries(scene: &OverlayData, style: OverlayStyle) -> Vec<(Sample, &'static str)> {
    if !style.is_debug() {
        return vec![
            (Sample::Seen, "seen: ID, distance (~ guess)"),
            (Sample::Predicted, "predicted"),
            (Sample::Trail, "last 2 s"),
            (Sample::Velocity, "position in 1 s"),
        ];
    }
    let sketch = scene.report.visualisation.as_ref().and_then(|shown| shown.downcast_ref());
    let has_particles = sketch.is_some_and(|sketch: &Sketch| !sketch.points.is_empty());
    let image = [
        (Sample::Seen, "seen (~ guess)"),
        (Sample::Predicted, "predicted"),
        (Sample::Tentative, "tentative"),
        (Sample::Dropped, "dropped, by test"),
        (Sample::Trail, "trail"),
    ];
    let plan = [(Sample::Velocity, "position in 1 s"), (Sample::Ellipse, "2 sigma")];
    let particles = has_particles.then_some((Sample::Particles, "particles"));
    image.into_iter().chain(particles).chain(plan).collect()
}

/// Renders a mark and its meaning; returns the columns of both.
fn draw_entry(canvas: &mut Canvas, at: Point2<f64>, sample: Sample, meaning: &str) -> f64 {
    let mark = Rect::new(at.x, at.y + 2.0, MARK_PX, MARK_PX);
    draw_sample(canvas, &mark, sample);
    let text_at = Point2::new(at.x + MARK_PX + 4.0, at.y);
    // An entry beyond the edge is left out instead of moved over the one before it.
    if at.x + entry_px(meaning) <= canvas.width() as f64 {
        canvas.text(text_at, meaning, QUIET);
    }
    entry_px(meaning) + 10.0
}

/// Width of a mark with its meaning, pixels.
fn entry_px(meaning: &str) -> f64 {
    MARK_PX + 4.0 + Lettering::Small.size_px(meaning)[0]
}

fn draw_sample(canvas: &mut Canvas, mark: &Rect, sample: Sample) {
    let centre = mark.centre();
    let middle = mark.y + 0.5 * mark.height;
    let ends = [Point2::new(mark.x, middle), Point2::new(mark.right(), middle)];
    match sample {
        Sample::Seen => draw_box(canvas, mark, true, EXAMPLE),
        Sample::Predicted => draw_box(canvas, mark, false, EXAMPLE),
        Sample::Tentative => draw_box(canvas, mark, true, TENTATIVE),
        Sample::Dropped => canvas.dashed(mark, DROPPED.faint(1.0)),
        Sample::Trail => canvas.line(ends[0], ends[1], EXAMPLE),
        Sample::Velocity => {
            canvas.disc(ends[0], 3.0, EXAMPLE);
            canvas.line(ends[0], ends[1], EXAMPLE);
        }
        Sample::Particles => {
            for (x, y) in [(-4.0, -3.0), (3.0, -4.0), (0.0, 1.0), (-3.0, 4.0), (4.0, 3.0)] {
                canvas.disc(Point2::new(centre.x + x, centre.y + y), 1.5, EXAMPLE);
            }
        }
        Sample::Ellipse => {
            let circle: Vec<_> = (0..=24)
                .map(|i| (f64::from(i) * std::f64::consts::TAU / 24.0).sin_cos())
                .map(|(sin, cos)| Point2::new(centre.x + 7.0 * cos, centre.y + 4.0 * sin))
                .collect();
            canvas.path(&circle, EXAMPLE);
        }
    }
}

/// Returns the counts of the tests that dropped candidates, latest test first, as many as fit into
/// `columns` letters.
fn counts(scene: &OverlayData, columns: usize) -> String {
    let entries = scene.report.funnel.entries();
    if entries.is_empty() {
        return "nothing dropped".into();
    }
    let mut text = "dropped:".to_owned();
    // The last tests saw the candidates that were nearest to people.
    for (index, entry) in entries.iter().rev().enumerate() {
        let part = format!("  {} {}", entry.test, entry.count);
        let more = format!("  and by {} more tests", entries.len() - index);
        let rest = if index + 1 < entries.len() { more.len() } else { 0 };
        if text.len() + part.len() + rest > columns {
            text += &more;
            break;
        }
        text += &part;
    }
    text
}

#[cfg(test)]
mod tests {
    use tagalong_core::{Command, Reason, Stamp, TrackId, Twist, WheelSpeeds};

    use super::*;

    #[test]
    fn the_title_has_target_command_and_reason_where_there_is_a_controller() {
        let mut report = FrameReport::new(3, Stamp::default());
        assert_eq!(drive(&report), "");
        let at = Stamp::default();
        let twist = Twist::new(0.42, -0.1);
        report.command = Some(Command::new(twist, WheelSpeeds::STOP, at, at, Reason::Near));
        assert_eq!(drive(&report), "   no target   0.42 m/s -0.10 rad/s: near");
        report.target = Some(TrackId(7));
        assert!(drive(&report).starts_with("   target 7   "));
    }

    #[test]
    fn the_meaning_of_all_marks_and_of_a_tilde_fits_under_the_narrowest_picture() {
        let scene = super::super::tests::scene(&[], Vec::new());
        let entries = entries(&scene, OverlayStyle::default());
        assert!(
            entries.iter().any(|(_, meaning)| meaning.contains('~')),
            "distances may be guesses"
        );
        let widths = entries.iter().map(|(_, meaning)| entry_px(meaning) + 10.0);
        let all_px = MARGIN_PX + widths.sum::<f64>() - 10.0;
        assert!(all_px <= 640.0, "{all_px}");
    }

    #[test]
    fn a_late_frame_is_said_to_be_not_used() {
        let mut scene = super::super::tests::scene(&[], Vec::new());
        assert_eq!(seen(&scene), "0 people seen");
        scene.report.outcome = Outcome::OutOfOrder;
        assert_eq!(seen(&scene), "late, not used");
    }
}
