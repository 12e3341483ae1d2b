use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;
use serde::{Deserialize, Serialize};

use crate::hog::{BLOCK, Blocks};

/// Blocks along a side of a window: 64 pixels.
pub(crate) const SIDE: usize = 7;
/// Numbers of a window.
pub const NUMBERS: usize = SIDE * SIDE * BLOCK;

const FORMAT: &str = "hog-upper-body 1";

/// A linear machine over the blocks of a window, with its calibration.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// A weight for each number of a window, block row by block row.
    pub weights: Vec<f32>,
    /// Added to the weighted sum.
    pub bias: f32,
    /// Log-odds per unit of the sum.
    pub slope: f64,
    /// Log-odds of the sum 0.
    pub offset: f64,
}

/// The model as it is kept.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Kept {
    format: String,
    bias: f32,
    slope: f64,
    offset: f64,
    /// Little-endian 32-bit numbers in base64.
    weights: String,
}

impl Model {
    /// The weighted sum of a window whose first block is at (x, y).
    pub fn sum(&self, blocks: &Blocks, x: usize, y: usize) -> f32 {
        let rows = self.weights.chunks_exact(SIDE * BLOCK).enumerate();
        rows.map(|(row, weights)| dot(weights, blocks.run(x, y + row, SIDE))).sum::<f32>()
            + self.bias
    }

    /// The weighted sum of a window's numbers.
    pub fn sum_of(&self, numbers: &[f32]) -> f32 {
        dot(&self.weights, numbers) + self.bias
    }

    /// Log-odds of a weighted sum.
    pub fn log_odds(&self, sum: f32) -> f64 {
        self.slope * f64::from(sum) + self.offset
    }

    /// The sum at which the log-odds are `score`.
    pub fn sum_at(&self, score: f64) -> f32 {
        ((score - self.offset) / self.slope.max(1e-6)) as f32
    }

    /// The content of a model file.
    pub fn to_text(&self) -> String {
        let bytes: Vec<u8> = self.weights.iter().flat_map(|w| w.to_le_bytes()).collect();
        let kept = Kept {
            format: FORMAT.into(),
            bias: self.bias,
            slope: self.slope,
            offset: self.offset,
            weights: BASE64_STANDARD.encode(bytes),
        };
        toml::to_string(&kept).unwrap_or_default()
    }

    /// Reads a model file.
    ///
    /// # Errors
    /// In a sentence, what is wrong with the text.
    pub fn from_text(text: &str) -> Result<Self, String> {
        let kept: Kept = toml::from_str(text).map_err(|error| error.to_string())?;
        if kept.format != FORMAT {
            return Err(format!("its format is `{}`, expected `{FORMAT}`", kept.format));
        }
        let bytes = BASE64_STANDARD.decode(&kept.weights).map_err(|error| error.to_string())?;
        let number = |b: &[u8]| f32::from_le_bytes([b[0], b[1], b[2], b[3]]);
        let weights: Vec<f32> = bytes.chunks_exact(4).map(number).collect();
        let Kept { bias, slope, offset, .. } = kept;
        if weights.len() != NUMBERS {
            return Err(format!("it has {} weights, expected {NUMBERS}", weights.len()));
        }
        let finite = bias.is_finite() && slope.is_finite() && offset.is_finite();
        if !finite || slope <= 0.0 || weights.iter().any(|w| !w.is_finite()) {
            return Err(
                "it has numbers that are no numbers, or a slope that is not positive".into()
            );
        }
        Ok(Self { weights, bias, slope, offset })
    }
}

/// Sums in eight lanes of a fixed order: fast, and the same on every machine.
pub(crate) fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut lanes = [0.0_f32; 8];
    let (heads, tails) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f32 = heads.remainder().iter().zip(tails.remainder()).map(|(x, y)| x * y).sum();
    for (x, y) in heads.zip(tails) {
        lanes.iter_mut().zip(x.iter().zip(y)).for_each(|(lane, (x, y))| *lane += x * y);
    }
    lanes.iter().sum::<f32>() + rest
}
