use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::LazyLock;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::body::{Relief, render};

/// The body directions that have a template (P4: three). A frontal silhouette
/// equals one from behind.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum Direction {
    /// Facing the camera or turning the back to it.
    Along,
    /// Facing left as seen from the camera.
    Left,
    /// Facing right as seen from the camera.
    Right,
}

impl Direction {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Along, Self::Left, Self::Right];

    fn yaw_rad(self) -> f64 {
        match self {
            Self::Along => PI,
            Self::Left => FRAC_PI_2,
            Self::Right => -FRAC_PI_2,
        }
    }
}

/// The person in one row of a template: a single run of pixels. The rest of the window is
/// background, except a narrow guard along the silhouette, where sensors mix foreground and
/// background.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TemplateRow {
    /// Row relative to the head centre, pixels.
    pub dy: i64,
    /// First pixel of the person, relative to the head centre.
    pub from: i64,
    /// One past the last pixel; equal to `from` in a row without a person.
    pub to: i64,
    /// Background ends before this pixel ...
    pub guard_from: i64,
    /// ... and goes on with this one.
    pub guard_to: i64,
    /// Depth of the person behind the face in this row, m.
    pub relief_m: f64,
}

/// A silhouette at one scale, as runs.
#[derive(Clone, Debug, PartialEq)]
pub struct Template {
    /// Some or all rows, top to bottom.
    pub rows: Vec<TemplateRow>,
    /// The window reaches this many pixels left and right of the head centre.
    pub half_width: i64,
    /// Pixels of the person in all rows.
    pub person: f64,
    /// Pixels of the background in all rows.
    pub background: f64,
}

impl Template {
    fn new(rows: Vec<TemplateRow>, half_width: i64) -> Self {
        let person = rows.iter().map(|row| (row.to - row.from) as f64).sum();
        let background = rows
            .iter()
            .map(|row| {
                let sides = [row.guard_from + half_width, half_width + 1 - row.guard_to];
                sides.map(|pixels| pixels.max(0) as f64).iter().sum::<f64>()
            })
            .sum();
        Self { rows, half_width, person, background }
    }
}

/// Which silhouette: how the person is seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Pose {
    direction: Direction,
    pitch: i8,
    roll: i8,
    scale_step: u16,
}

impl Pose {
    /// The nearest pose in the bank: a viewing ray that points `pitch_rad`
    /// downwards, a person whose upward direction leans `roll_rad` to the right
    /// in the image, and a scale in pixels per metre.
    pub fn nearest(direction: Direction, pitch_rad: f64, roll_rad: f64, px_per_m: f64) -> Self {
        let pitch = (pitch_rad.to_degrees() / PITCH_STEP_DEG).round();
        let pitch = pitch.clamp(f64::from(FIRST_PITCH), f64::from(FIRST_PITCH + PITCHES - 1));
        let roll = (roll_rad.to_degrees() / ROLL_STEP_DEG).round().clamp(-15.0, 15.0);
        let step = (px_per_m.clamp(1.0, 4000.0).ln() / SCALE_STEP).round();
        Self { direction, pitch: pitch as i8, roll: roll as i8, scale_step: step as u16 }
    }

    fn px_per_m(self) -> f64 {
        (f64::from(self.scale_step) * SCALE_STEP).exp()
    }

    /// Returns how far the window reaches left and right of the head centre, pixels.
    pub(crate) fn half_width(self) -> i64 {
        (HALF_WIDTH_M * self.px_per_m()).round() as i64
    }

    /// Returns how far left and right of the head centre the person can show or hide anything,
    /// pixels.
    pub(crate) fn reach(self) -> i64 {
        ((HALF_WIDTH_M + GUARD_M) * self.px_per_m()).ceil() as i64 + 1
    }
}

/// Silhouettes in all body directions, viewing angles and scales. They are
/// rendered from the body model, not typed in. Its reliefs are rendered when the first bank is
/// made, and shared by all; each silhouette is cut when first asked for and kept.
pub struct Bank {
    reliefs: &'static Reliefs,
    templates: BTreeMap<Pose, Template>,
    max_rows: usize,
}

/// The body in each direction, at each pitch from the first one on.
type Reliefs = [[Relief; PITCHES as usize]; Direction::ALL.len()];

// Nothing but constants is in them. A pipeline that rendered them within a frame was late with it.
static RELIEFS: LazyLock<Reliefs> = LazyLock::new(|| {
    Direction::ALL.map(|direction| {
        std::array::from_fn(|step| {
            let pitch = f64::from(FIRST_PITCH + step as i8) * PITCH_STEP_DEG;
            render(direction.yaw_rad(), pitch.to_radians())
        })
    })
});

const FIRST_PITCH: i8 = -1;
const PITCHES: i8 = 6;
const PITCH_STEP_DEG: f64 = 15.0;
const ROLL_STEP_DEG: f64 = 6.0;
/// Scales of the bank are 2 % apart.
const SCALE_STEP: f64 = 0.02;
/// The window around the head centre, m: to each side, above, below.
const HALF_WIDTH_M: f64 = 0.33;
const ABOVE_M: f64 = 0.20;
const BELOW_M: f64 = 0.43;
/// Half the width of the guard along the silhouette, m; at least a pixel.
const GUARD_M: f64 = 0.012;

impl Bank {
    /// A bank whose templates have at most `max_rows` rows each: of a larger
    /// silhouette every second, third, ... row is used.
    pub fn new(max_rows: usize) -> Self {
        Self { reliefs: &RELIEFS, templates: BTreeMap::new(), max_rows: max_rows.max(1) }
    }

    /// The template of a pose.
    pub fn template(&mut self, pose: Pose) -> &Template {
        let Self { reliefs, templates, max_rows } = self;
        templates.entry(pose).or_insert_with(|| {
            let cutter = Cutter::new(reliefs, pose);
            Template::new(cutter.with_reliefs(cutter.outline(*max_rows).iter()), pose.half_width())
        })
    }

    /// Cuts the rows of a pose without their reliefs, which take most of the time, and keeps none.
    pub(crate) fn outline(&self, pose: Pose) -> Vec<TemplateRow> {
        Cutter::new(self.reliefs, pose).outline(self.max_rows)
    }
}

/// Returns rows of an outline with their reliefs.
pub(crate) fn with_reliefs<'a>(
    pose: Pose,
    rows: impl Iterator<Item = &'a TemplateRow>,
) -> Vec<TemplateRow> {
    Cutter::new(&RELIEFS, pose).with_reliefs(rows)
}

/// A relief under the pixels of a template. A turned person shifts along a row by the same steps
/// in all rows, so that those are computed once.
struct Cutter<'a> {
    relief: &'a Relief,
    scale: f64,
    /// Sine and cosine of the roll.
    turn: (f64, f64),
    columns: Vec<Column>,
    /// Depth of the face, m.
    face: f64,
}

/// A column of the window, and its steps right and up on the relief, m.
struct Column {
    dx: i64,
    right_m: f64,
    up_m: f64,
}

impl<'a> Cutter<'a> {
    /// A cutter at the scale and roll of a pose.
    fn new(reliefs: &'a Reliefs, pose: Pose) -> Self {
        let relief = &reliefs[pose.direction as usize][(pose.pitch - FIRST_PITCH) as usize];
        let scale = pose.px_per_m();
        let half_width = pose.half_width();
        let (sin, cos) = (f64::from(pose.roll) * ROLL_STEP_DEG).to_radians().sin_cos();
        let columns = (-half_width..=half_width)
            .map(|dx| {
                let x = dx as f64 / scale;
                Column { dx, right_m: x * cos, up_m: x * sin }
            })
            .collect();
        Self { relief, scale, turn: (sin, cos), columns, face: relief.at(0.0, 0.0) }
    }

    /// Returns at most `max_rows` rows, without their reliefs.
    fn outline(&self, max_rows: usize) -> Vec<TemplateRow> {
        let [first, last] = [-ABOVE_M, BELOW_M].map(|m| (m * self.scale).round() as i64);
        let step = ((last - first + 1) as usize).div_ceil(max_rows).max(1);
        (first..=last).step_by(step).map(|dy| self.row(dy)).collect()
    }

    fn with_reliefs<'r>(&self, rows: impl Iterator<Item = &'r TemplateRow>) -> Vec<TemplateRow> {
        rows.map(|row| TemplateRow { relief_m: self.mean_relief(row), ..*row }).collect()
    }

    /// Returns the row of the template `dy` pixels below the head centre, without its relief.
    fn row(&self, dy: i64) -> TemplateRow {
        let start = self.start_of(dy);
        let columns = self.columns_of_body(start);
        let mut body = columns.iter().filter(|column| !self.behind(start, column).is_nan());
        let Some(first) = body.next() else {
            return TemplateRow { dy, from: 0, to: 0, guard_from: 0, guard_to: 0, relief_m: 0.0 };
        };
        let from = first.dx;
        let to = body.next_back().unwrap_or(first).dx + 1;
        let guard = ((GUARD_M * self.scale).round() as i64).max(1).min((to - from) / 4);
        TemplateRow {
            dy,
            from: from + guard,
            to: to - guard,
            guard_from: from - guard,
            guard_to: to + guard,
            relief_m: 0.0,
        }
    }

    /// Returns the mean depth of the person behind the face in a row, edges included, m.
    fn mean_relief(&self, row: &TemplateRow) -> f64 {
        let mut sum = 0.0;
        let mut count = 0.0;
        let start = self.start_of(row.dy);
        for column in self.columns_of_body(start) {
            let behind = self.behind(start, column);
            if !behind.is_nan() {
                sum += behind - self.face;
                count += 1.0;
            }
        }
        if count > 0.0 { sum / count } else { 0.0 }
    }

    /// Returns the place on the relief of a row's middle, m right and down.
    fn start_of(&self, dy: i64) -> (f64, f64) {
        let y = dy as f64 / self.scale;
        (y * self.turn.0, y * self.turn.1)
    }

    /// Returns the depth behind the head in a column of the row that starts there, m.
    fn behind(&self, (right_m, down_m): (f64, f64), column: &Column) -> f64 {
        self.relief.at(column.right_m + right_m, down_m - column.up_m)
    }

    /// Returns the columns of a row between which the body lies: most of a window is beside it.
    fn columns_of_body(&self, (right_m, down_m): (f64, f64)) -> &[Column] {
        let [Some(left), Some(right)] = [self.columns.first(), self.columns.last()] else {
            return &[];
        };
        let up_m = left.up_m.max(right.up_m);
        let least_up_m = left.up_m.min(right.up_m);
        let (from_m, to_m) = self.relief.extent(down_m - up_m, down_m - least_up_m);
        let from = self.columns.partition_point(|column| column.right_m + right_m < from_m);
        let to = self.columns.partition_point(|column| column.right_m + right_m <= to_m);
        &self.columns[from..to.max(from)]
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Returns a row pixel by pixel, straight from the definition.
    fn slow_row(relief: &Relief, pose: Pose, dy: i64, half_width: i64) -> TemplateRow {
        let scale = pose.px_per_m();
        let (sin, cos) = (f64::from(pose.roll) * ROLL_STEP_DEG).to_radians().sin_cos();
        let y = dy as f64 / scale;
        let person: Vec<(i64, f64)> = (-half_width..=half_width)
            .map(|dx| {
                let x = dx as f64 / scale;
                (dx, relief.at(x * cos + y * sin, y * cos - x * sin))
            })
            .filter(|(_, behind)| !behind.is_nan())
            .collect();
        let [Some((first, _)), Some((last, _))] = [person.first(), person.last()] else {
            return TemplateRow { dy, from: 0, to: 0, guard_from: 0, guard_to: 0, relief_m: 0.0 };
        };
        let from = *first;
        let to = last + 1;
        let guard = ((GUARD_M * scale).round() as i64).max(1).min((to - from) / 4);
        let sum: f64 = person.iter().map(|(_, behind)| behind - relief.at(0.0, 0.0)).sum();
        TemplateRow {
            dy,
            from: from + guard,
            to: to - guard,
            guard_from: from - guard,
            guard_to: to + guard,
            relief_m: sum / person.len() as f64,
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]

        #[test]
        fn a_template_is_cut_as_its_definition_says(
            which in 0usize..3, pitch in -1.0..1.5f64, roll in -2.0..2.0f64, scale in 5.0..300.0f64,
        ) {
            let pose = Pose::nearest(Direction::ALL[which], pitch, roll, scale);
            let mut bank = Bank::new(usize::MAX);
            let outline = bank.outline(pose);
            let template = bank.template(pose);
            prop_assert_eq!(&with_reliefs(pose, outline.iter()), &template.rows);
            let relief = render(pose.direction.yaw_rad(), (f64::from(pose.pitch) * PITCH_STEP_DEG).to_radians());
            for row in &template.rows {
                let slow = slow_row(&relief, pose, row.dy, template.half_width);
                prop_assert!((row.relief_m - slow.relief_m).abs() < 1e-12);
                prop_assert_eq!(*row, TemplateRow { relief_m: row.relief_m, ..slow });
            }
        }
    }

    fn widths(direction: Direction, roll_deg: f64) -> Template {
        let pose = Pose::nearest(direction, 0.0, f64::to_radians(roll_deg), 100.0);
        Bank::new(1000).template(pose).clone()
    }

    #[test]
    fn a_pose_is_the_nearest_of_the_bank() {
        fn steps(pitch: f64, roll: f64) -> (i8, i8) {
            let pitch = pitch * PITCH_STEP_DEG;
            let roll = roll * ROLL_STEP_DEG;
            let pose =
                Pose::nearest(Direction::Along, pitch.to_radians(), roll.to_radians(), 100.0);
            (pose.pitch, pose.roll)
        }

        assert_eq!(steps(0.4, -0.4), (0, 0));
        assert_eq!(steps(0.6, -0.6), (1, -1));
        assert_eq!([steps(-3.0, -20.0), steps(9.0, 20.0)], [(-1, -15), (4, 15)]);
    }

    #[test]
    fn the_head_is_narrower_than_the_shoulders() {
        let template = widths(Direction::Along, 0.0);
        // Air above the head, the head, and the shoulders.
        for (dy, range) in [(-18, 0..=0), (0, 15..=20), (38, 40..=52)] {
            let row = template.rows.iter().find(|row| row.dy == dy).unwrap();
            let width = (row.to - row.from + row.guard_to - row.guard_from) / 2;
            assert!(range.contains(&width), "{dy}: {width}");
        }
    }

    #[test]
    fn left_and_right_are_mirror_images() {
        let left = widths(Direction::Left, 0.0);
        let right = widths(Direction::Right, 0.0);
        for (a, b) in left.rows.iter().zip(&right.rows).filter(|(a, _)| a.to > a.from) {
            assert!(
                (a.from + b.to - 1).abs() <= 1 && (a.to + b.from - 1).abs() <= 1,
                "{a:?} {b:?}"
            );
        }
    }

    #[test]
    fn a_person_leaning_right_has_the_shoulders_on_the_left() {
        fn middle(t: &Template) -> i64 {
            let row = t.rows.iter().find(|r| r.dy == 35).unwrap();
            row.from + row.to
        }

        assert!(
            middle(&widths(Direction::Along, 12.0)) < middle(&widths(Direction::Along, 0.0)) - 8
        );
    }

    #[test]
    fn from_above_the_shoulders_are_behind_the_head() {
        let pose = Pose::nearest(Direction::Along, f64::to_radians(30.0), 0.0, 100.0);
        let mut bank = Bank::new(1000);
        let row = bank.template(pose).rows.iter().find(|r| r.dy == 30).copied().unwrap();
        assert!((0.08..0.35).contains(&row.relief_m), "{row:?}");
    }

    #[test]
    fn rows_are_thinned_out() {
        let pose = Pose::nearest(Direction::Along, 0.0, 0.0, 300.0);
        assert!(Bank::new(24).template(pose).rows.len() <= 24);
    }
}
