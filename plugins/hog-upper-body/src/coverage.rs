use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_geometry::{Rect, UPPER_BODY_SIDE_M};

use crate::hog::CELL;

/// Number of blocks along a side of a window, of 64 pixels.
pub const SIDE: usize = 7;

/// Part of a person that a window shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Coverage {
    /// Head, trunk and hips: finds people whose legs are hidden or outside of the image.
    #[default]
    UpperBody,
    /// Head to feet: fewer false alarms for people in the open. For trees only.
    WholeBody,
}

impl Coverage {
    /// Returns the number of rows of cells, of 8 pixels, in a window.
    pub const fn rows(self) -> usize {
        match self {
            Self::UpperBody => SIDE + 1,
            // The person is 12 cells tall, with a cell above and one below.
            Self::WholeBody => 14,
        }
    }
}

/// Height of a standing person in sides of the upper-body square, and width by height.
const STANDING_SIDES: f64 = 1.7 / UPPER_BODY_SIDE_M;

const STANDING_WIDTH: f64 = 0.41;

impl Coverage {
    /// Returns the box of the part of a person by the upper-body square: for whole bodies, a
    /// standing person of 1.7 m.
    pub fn person(self, square: &Rect) -> Rect {
        if self == Self::UpperBody {
            return *square;
        }
        let height = STANDING_SIDES * square.height;
        let width = STANDING_WIDTH * height;
        Rect::new(square.centre().x - 0.5 * width, square.y, width, height)
    }
}

/// Side of a window, pixels of the resampled image.
pub const WINDOW_PX: usize = (SIDE + 1) * CELL;

/// Part of a window's width that the upper-body square fills: arms, hips and the surroundings of a
/// person carry more information than the outline of head and shoulders alone.
pub const FILLED: f64 = 0.5;

/// Part of a window that is above the square; the square is in the middle of its columns.
const ABOVE: f64 = 0.1;

/// Returns the margins of a window left of and above the upper-body square, pixels of the resampled
/// image.
pub fn margins() -> (f64, f64) {
    (0.5 * (1.0 - FILLED) * WINDOW_PX as f64, ABOVE * WINDOW_PX as f64)
}

/// Returns the window of an upper-body square, pixels of the image.
pub fn window_of(square: &Rect, coverage: Coverage) -> Rect {
    let step = square.width / (FILLED * WINDOW_PX as f64);
    let (left, above) = margins();
    let width = WINDOW_PX as f64 * step;
    let height = (coverage.rows() * CELL) as f64 * step;
    Rect::new(square.x - left * step, square.y - above * step, width, height)
}
