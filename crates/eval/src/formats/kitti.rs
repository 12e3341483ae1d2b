//! KITTI tracking labels: one object per line, fields separated by blanks, frames from 0, `frame id
//! type truncated occluded alpha left top right bottom height width length x y z rotation_y
//! [score]`.

use std::io::{self, Write};

use super::{FormatError, Line, Timeline, lines};
use crate::prepare::Comparison;
use crate::types::{Region, Report, Role, Similarity, Truth};

/// Unmatched reports of at most this height are left out, in pixels.
pub const LEAST_HEIGHT_PX: f64 = 25.0;

/// Returns the comparison under KITTI's rules.
pub fn comparison(similarity: Similarity) -> Comparison {
    Comparison { ignore_unmatched_below_px: Some(LEAST_HEIGHT_PX), ..similarity.into() }
}

/// One line of a label file.
#[derive(Clone, PartialEq, Debug)]
pub struct Label {
    /// Line of the file, from 1.
    pub line: usize,
    /// Number of the frame, from 0.
    pub frame: u32,
    /// ID of the object; -1 for `DontCare`.
    pub id: i64,
    /// The class, for example `Pedestrian`.
    pub class: String,
    /// 0 for a whole object, above 0 for one that leaves the image; -1 if it is not annotated.
    pub truncated: f64,
    /// 0 visible, 1 partly hidden, 2 largely hidden, 3 unknown; -1 not annotated.
    pub occluded: f64,
    /// Observation angle in radians.
    pub alpha: f64,
    /// The box in pixels.
    pub region: Region,
    /// Height, width and length in metres.
    pub size_m: [f64; 3],
    /// Middle of the lower side, in metres, in camera 0: right, down, forward.
    pub position_in_camera_m: [f64; 3],
    /// Rotation about the vertical axis in radians.
    pub rotation_y: f64,
    /// Score of a report.
    pub score: Option<f64>,
}

impl Label {
    /// Returns the position on the floor, (right, forward) of the camera in metres; `None` for the
    /// marker -1000, "not annotated".
    pub fn floor_m(&self) -> Option<[f64; 2]> {
        let [x, _, z] = self.position_in_camera_m;
        (x > -999.0 && z > -999.0).then_some([x, z])
    }

    /// Returns the role of the label when pedestrians are scored: other classes have none; seated
    /// people and those that are cut off or of unknown occlusion are ignored (the rules of
    /// TrackEval).
    pub fn pedestrian_role(&self) -> Option<Role> {
        let hard = self.occluded > 2.0 || self.truncated > 0.0;
        match self.class.to_ascii_lowercase().as_str() {
            "pedestrian" if hard => Some(Role::Ignored),
            "pedestrian" => Some(Role::Counts),
            "person" | "person_sitting" => Some(Role::Ignored),
            _ => None,
        }
    }

    fn is_dont_care(&self) -> bool {
        self.class.eq_ignore_ascii_case("dontcare")
    }

    /// Returns true for an object without an ID of its own, which TrackEval leaves out.
    pub fn is_anonymous(&self) -> bool {
        self.id < 0 && !self.is_dont_care()
    }
}

/// Reads label lines; `file` names the text in errors. Boxes without an area are kept, as in
/// TrackEval; they match no other box.
///
/// # Errors
///
/// When a line has fewer than 17 fields, or a field is not a number.
pub fn parse(text: &str, file: &str) -> Result<Vec<Label>, FormatError> {
    lines(text, file).map(|line| label(&line)).collect()
}

fn label(line: &Line<'_>) -> Result<Label, FormatError> {
    let left = line.number(6, "left")?;
    let top = line.number(7, "top")?;
    let right = line.number(8, "right")?;
    let bottom = line.number(9, "bottom")?;
    let region = Region::new(left, top, right - left, bottom - top);
    Ok(Label {
        line: line.number,
        frame: line.frame(0, 0)?,
        id: line.whole(1, "id")?,
        class: line.text(2, "type")?.to_owned(),
        truncated: line.number(3, "truncated")?,
        occluded: line.number(4, "occluded")?,
        alpha: line.number(5, "alpha")?,
        region,
        size_m: [line.number(10, "height")?, line.number(11, "width")?, line.number(12, "length")?],
        position_in_camera_m: [line.number(13, "x")?, line.number(14, "y")?, line.number(15, "z")?],
        rotation_y: line.number(16, "rotation_y")?,
        score: if line.fields.len() > 17 { Some(line.number(17, "score")?) } else { None },
    })
}

/// Adds labels to a timeline as truth for pedestrians. `DontCare` becomes an ignore region, and
/// people without an ID are left out. Frames keep KITTI's numbers, from 0.
pub fn add_truths(timeline: &mut Timeline, labels: &[Label]) {
    for label in labels.iter().filter(|label| !label.is_anonymous()) {
        let frame = timeline.frame(label.frame);
        if label.is_dont_care() {
            frame.ignore_regions.push(label.region);
        } else if let Some(role) = label.pedestrian_role() {
            let region = Some(label.region);
            let floor_m = label.floor_m();
            frame.truths.push(Truth { id: label.id, region, floor_m, role, view: None });
        }
    }
}

/// Adds the pedestrians among labels to a timeline as reports, except for those without an ID.
pub fn add_reports(timeline: &mut Timeline, labels: &[Label]) {
    for label in labels {
        if !label.class.eq_ignore_ascii_case("pedestrian") || label.is_anonymous() {
            continue;
        }
        timeline.frame(label.frame).reports.push(Report {
            id: label.id,
            region: Some(label.region),
            floor_m: label.floor_m(),
            score: label.score.unwrap_or(1.0),
        });
    }
}

/// Writes a label line.
///
/// # Errors
///
/// Those of the writer.
pub fn write(out: &mut impl Write, label: &Label) -> io::Result<()> {
    let Region { x, y, width, height } = label.region;
    let Label { frame, id, class, truncated, occluded, alpha, .. } = label;
    write!(out, "{frame} {id} {class} {truncated} {occluded} {alpha}")?;
    write!(out, " {x} {y} {} {}", x + width, y + height)?;
    let numbers = label.size_m.iter().chain(&label.position_in_camera_m);
    for value in numbers.chain([&label.rotation_y]).chain(&label.score) {
        write!(out, " {value}")?;
    }
    writeln!(out)
}
