//! Depth image of a frame at low resolution, to explain why nothing was proposed at a position.

use std::sync::Arc;

use tagalong_core::{DepthImage, Frame};
use tagalong_geometry::{Camera, Rect};

use super::Rules;
use crate::remedies::{number, sections};

/// Number of columns and rows of cells.
const COLUMNS: usize = 32;
const ROWS: usize = 24;

/// Number of readings of a cell along each axis.
const TAPS: usize = 3;

/// Units of a reading per metre: a byte reaches 25 m.
const UNITS: f32 = 10.0;

/// Minimum fraction of the cells of a box that must have depth.
const LEAST_SHARE: f64 = 0.2;

/// Fraction of a box, about its centre, in which the person is in front.
const CORE: f64 = 0.5;

/// Depth image of a frame in coarse cells, with its camera. Copies share the cells.
#[derive(Clone, Debug)]
pub struct Depths {
    /// Row by row, in tenths of a metre; 0 without a reading.
    cells: Arc<[u8]>,
    camera: Arc<Camera>,
}

/// Limit of a detector, and its line in the config.
struct Limit {
    value: f64,
    line: String,
}

impl Depths {
    /// Reduces the depth image of a frame; `None` without a depth image.
    pub fn of_frame(frame: &Frame) -> Option<Self> {
        frame.depth().ok().map(|depth| Self::of(depth, &frame.camera))
    }

    pub(super) fn of(depth: &DepthImage, camera: &Arc<Camera>) -> Self {
        let mut cells = Vec::with_capacity(COLUMNS * ROWS);
        for row in 0..ROWS {
            for column in 0..COLUMNS {
                cells.push(cell(depth, column, row));
            }
        }
        Self { cells: cells.into(), camera: Arc::clone(camera) }
    }

    /// Returns the name and the sentence of a cause that can be measured at a person without any
    /// candidate. `None` if there is none, or if a detector needs no depth.
    pub(super) fn cause(&self, person: &Rect, rules: Rules<'_>) -> Option<(&'static str, String)> {
        // A detector without such a limit uses something other than depth.
        let least_m = limit(rules, "min_depth_m", f64::min)?;
        let most_m = limit(rules, "max_depth_m", f64::max)?;
        let Some(depth_m) = self.median_m(person) else {
            let why = "no detector proposed a candidate here: the depth image has no reading at the \
                       person";
            return Some(("no depth", why.to_owned()));
        };
        let words = format!("the surface there is {depth_m:.1} m away");
        if depth_m < least_m.value {
            return Some(("too near", outside(&words, "nearer", &least_m)));
        }
        if depth_m > most_m.value {
            return Some(("too far", outside(&words, "farther", &most_m)));
        }
        let head_m = self.camera.head_of(person, depth_m).z;
        let words = format!("the head is about {head_m:.1} m above the floor");
        let lowest = limit(rules, "min_head_height_m", f64::min)?;
        if head_m < lowest.value {
            return Some(("head too low", outside(&words, "lower", &lowest)));
        }
        let highest = limit(rules, "max_head_height_m", f64::max)?;
        (head_m > highest.value).then(|| ("head too high", outside(&words, "higher", &highest)))
    }

    /// Returns the median of the readings in the middle of a box, m; `None` if there are too few.
    fn median_m(&self, person: &Rect) -> Option<f64> {
        let image = self.camera.width as f64 / COLUMNS as f64;
        let tall = self.camera.height as f64 / ROWS as f64;
        let core = person.inflated(CORE - 1.0).clipped(self.camera.width, self.camera.height);
        if core.area() <= 0.0 {
            return None;
        }
        let columns =
            (core.x / image) as usize..=((core.right() / image) as usize).min(COLUMNS - 1);
        let rows = (core.y / tall) as usize..=((core.bottom() / tall) as usize).min(ROWS - 1);
        let mut readings = Vec::new();
        let mut all = 0;
        for row in rows {
            for column in columns.clone() {
                let reading = self.cells[row * COLUMNS + column];
                all += 1;
                readings.extend((reading > 0).then_some(reading));
            }
        }
        if (readings.len() as f64) < LEAST_SHARE * f64::from(all) || readings.is_empty() {
            return None;
        }
        readings.sort_unstable();
        Some(f64::from(readings[readings.len() / 2]) / f64::from(UNITS))
    }
}

/// Returns the median of a cell's readings, 0 if fewer than half of them exist.
fn cell(depth: &DepthImage, column: usize, row: usize) -> u8 {
    // An array instead of a vector saves an allocation per cell.
    let mut readings = [f32::INFINITY; TAPS * TAPS];
    let mut count = 0;
    for tap in 0..TAPS * TAPS {
        let x = (column * TAPS + tap % TAPS) * depth.width() / (COLUMNS * TAPS);
        let y = (row * TAPS + tap / TAPS) * depth.height() / (ROWS * TAPS);
        let metres = depth.get(x as i64, y as i64);
        if let Some(metres) = metres.filter(|metres| DepthImage::is_reading(*metres)) {
            readings[count] = metres;
            count += 1;
        }
    }
    if count * 2 < TAPS * TAPS {
        return 0;
    }
    readings[..count].sort_unstable_by(f32::total_cmp);
    (readings[count / 2] * UNITS).round().clamp(1.0, 255.0) as u8
}

/// Returns the common limit of the detectors, if all of them have it.
fn limit(rules: Rules<'_>, key: &str, wider: fn(f64, f64) -> f64) -> Option<Limit> {
    let mut widest: Option<Limit> = None;
    for detector in sections(rules.config).filter(|section| section.name == "detectors") {
        let value = detector.setting(key).and_then(number)?;
        let is_wider = widest.as_ref().is_none_or(|one| wider(one.value, value) != one.value);
        if is_wider {
            let path = detector.path();
            let plugin = detector.plugin().unwrap_or_default();
            let line = format!("{path}.config.{key} = {value:?} ({plugin})");
            widest = Some(Limit { value, line });
        }
    }
    widest
}

fn outside(words: &str, than: &str, limit: &Limit) -> String {
    format!(
        "no detector proposed a candidate here: {words}, {than} than the detectors search; \
         decided by {}",
        limit.line
    )
}
