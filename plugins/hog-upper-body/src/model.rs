use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Spans;
use crate::channels::Channels;
use crate::coverage::{Coverage, SIDE};
use crate::depth_channel::DepthTrees;
use crate::hog::{BLOCK, Blocks};
use crate::trees::{self, Trees};

/// Number of values of a window for a linear machine.
pub const NUMBERS: usize = SIDE * SIDE * BLOCK;

const FORMAT: &str = "hog-upper-body 3";

/// Kind of classifier of windows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// Normalised blocks of cells and a linear classifier.
    Linear,
    /// Finer cells and boosted trees: fewer errors.
    #[default]
    Trees,
}

/// Layout of the values of a window.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Layout {
    /// Kind of the machine that they are for.
    pub kind: Kind,
    /// Part of a person that the window shows.
    pub coverage: Coverage,
}

impl From<Kind> for Layout {
    /// Returns the layout of an upper body.
    fn from(kind: Kind) -> Self {
        Self { kind, coverage: Coverage::UpperBody }
    }
}

/// Machine that classifies windows.
#[derive(Clone, Debug, PartialEq)]
pub enum Machine {
    /// Weighted sum of the values of all blocks.
    Linear {
        /// Weights of the values of a window, block row by block row.
        weights: Vec<f32>,
        /// Constant that is added to the weighted sum.
        bias: f32,
    },
    /// Sum of the values of trees over cells.
    Trees(Trees),
}

/// Features of all windows of an image in one size.
#[derive(Clone, Debug)]
pub enum Field {
    /// For linear machines.
    Blocks(Blocks),
    /// For trees.
    Channels(Channels),
}

impl Field {
    /// Creates an empty field for one kind of machine.
    pub fn new(kind: Kind) -> Self {
        match kind {
            Kind::Linear => Self::Blocks(Blocks::default()),
            Kind::Trees => Self::Channels(Channels::default()),
        }
    }

    /// Computes the features of another image (see [`Blocks::fill`]).
    pub fn fill(&mut self, pixels: &[f32], width: usize, spans: &Spans) {
        match self {
            Self::Blocks(blocks) => blocks.fill(pixels, width, spans),
            Self::Channels(channels) => channels.fill(pixels, width, spans),
        }
    }

    /// Returns the values of the window that begins at cell (x, y), of 8 pixels; that of blocks
    /// shows an upper body.
    pub fn numbers(&self, (x, y): (usize, usize), coverage: Coverage) -> Vec<f32> {
        match self {
            Self::Blocks(blocks) => {
                let rows = (y..y + SIDE).map(|y| &blocks.from(x, y)[..SIDE * BLOCK]);
                rows.flatten().copied().collect()
            }
            Self::Channels(channels) => (2 * y..2 * (y + coverage.rows()))
                .flat_map(|y| &channels.from(2 * x, y)[..trees::CELLS * crate::channels::DEPTH])
                .copied()
                .collect(),
        }
    }
}

/// Machine with its calibration.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// The machine.
    pub machine: Machine,
    /// Part of a person that its windows show.
    pub coverage: Coverage,
    /// Log-odds per unit of the sum.
    pub slope: f64,
    /// Log-odds at the sum 0.
    pub offset: f64,
    /// Trees over depth, if the model has them.
    pub depth: Option<DepthTrees>,
}

/// Content of the depth channel in a model file.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct DepthFile {
    slope: f64,
    offset: f64,
    /// Trees, little-endian numbers in base64.
    numbers: String,
}

impl From<&DepthTrees> for DepthFile {
    fn from(depth: &DepthTrees) -> Self {
        let numbers = BASE64_STANDARD.encode(trees::to_bytes(&depth.trees.trees));
        Self { slope: depth.slope, offset: depth.offset, numbers }
    }
}

impl DepthFile {
    fn trees(&self) -> Result<DepthTrees, String> {
        let bytes = BASE64_STANDARD.decode(&self.numbers).map_err(|error| error.to_string())?;
        DepthTrees::from_bytes(&bytes, self.slope, self.offset)
    }
}

/// Content of a model file.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ModelFile {
    format: String,
    machine: Kind,
    #[serde(default, skip_serializing_if = "is_upper_body")]
    coverage: Coverage,
    /// Bias of a linear machine; for trees, the sum below which a window is rejected, for each
    /// round.
    levels: Vec<f32>,
    slope: f64,
    offset: f64,
    /// Little-endian numbers in base64: weights, or trees.
    numbers: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    depth: Option<DepthFile>,
}

// Files from before there were whole bodies do not state the part.
fn is_upper_body(coverage: &Coverage) -> bool {
    *coverage == Coverage::UpperBody
}

impl Model {
    /// Returns the layout of its windows.
    pub fn layout(&self) -> Layout {
        Layout { kind: self.kind(), coverage: self.coverage }
    }

    /// Returns the kind of machine.
    pub fn kind(&self) -> Kind {
        match self.machine {
            Machine::Linear { .. } => Kind::Linear,
            Machine::Trees(_) => Kind::Trees,
        }
    }

    /// Returns the sum of a window's values.
    pub fn sum_of(&self, numbers: &[f32]) -> f32 {
        match &self.machine {
            Machine::Linear { weights, bias } => dot(weights, numbers) + bias,
            Machine::Trees(trees) => trees.sum_of(numbers),
        }
    }

    /// Returns the log-odds of a sum.
    pub fn log_odds(&self, sum: f32) -> f64 {
        self.slope * f64::from(sum) + self.offset
    }

    /// Returns the sum at which the log-odds are `score`.
    pub fn sum_at(&self, score: f64) -> f32 {
        // A tiny slope would send the sum to infinity.
        ((score - self.offset) / self.slope.max(1e-6)) as f32
    }

    /// Formats the model file.
    ///
    /// # Errors
    /// Numbers that TOML cannot express.
    pub fn to_text(&self) -> Result<String, String> {
        let (levels, bytes) = match &self.machine {
            Machine::Linear { weights, bias } => {
                (vec![*bias], weights.iter().flat_map(|w| w.to_le_bytes()).collect())
            }
            Machine::Trees(all) => (all.least.clone(), trees::to_bytes(&all.trees)),
        };
        let kept = ModelFile {
            format: FORMAT.into(),
            machine: self.kind(),
            coverage: self.coverage,
            levels,
            slope: self.slope,
            offset: self.offset,
            numbers: BASE64_STANDARD.encode(bytes),
            depth: self.depth.as_ref().map(DepthFile::from),
        };
        toml::to_string(&kept).map_err(|why| format!("the model is no TOML: {why}"))
    }

    /// Parses a model file.
    ///
    /// # Errors
    /// Text that is not a model; the message is one sentence.
    pub fn from_text(text: &str) -> Result<Self, String> {
        // Without the line itself, which may be of any file that a config names.
        let kept: ModelFile =
            toml::from_str(text).map_err(|e| e.message().trim_end().to_owned())?;
        if kept.format != FORMAT {
            return Err(format!("its format is `{}`, expected `{FORMAT}`", kept.format));
        }
        let bytes = BASE64_STANDARD.decode(&kept.numbers).map_err(|error| error.to_string())?;
        let depth = kept.depth.as_ref().map(DepthFile::trees).transpose()?;
        let ModelFile { machine, coverage, levels, slope, offset, .. } = kept;
        let finite =
            levels.iter().all(|level| level.is_finite()) && slope.is_finite() && offset.is_finite();
        if !finite || slope <= 0.0 {
            return Err(
                "it has numbers that are no numbers, or a slope that is not positive".into()
            );
        }
        let machine = match machine {
            Kind::Linear if coverage == Coverage::WholeBody => {
                return Err("a linear machine has no windows of whole bodies".into());
            }
            Kind::Linear => Machine::Linear { weights: weights(&bytes)?, bias: bias(&levels)? },
            Kind::Trees => Machine::Trees(trees::from_bytes(&bytes, levels, coverage)?),
        };
        Ok(Self { machine, coverage, slope, offset, depth })
    }
}

fn bias(levels: &[f32]) -> Result<f32, String> {
    match levels {
        [bias] => Ok(*bias),
        _ => Err(format!("it has {} levels, expected the bias", levels.len())),
    }
}

fn weights(bytes: &[u8]) -> Result<Vec<f32>, String> {
    fn number(b: &[u8]) -> f32 {
        f32::from_le_bytes([b[0], b[1], b[2], b[3]])
    }

    let weights: Vec<f32> = bytes.chunks_exact(4).map(number).collect();
    if weights.len() != NUMBERS {
        return Err(format!("it has {} weights, expected {NUMBERS}", weights.len()));
    }
    if weights.iter().any(|w| !w.is_finite()) {
        return Err("it has weights that are no numbers".into());
    }
    Ok(weights)
}

/// Computes the product in eight lanes of a fixed order: fast, and the same on every machine.
#[multiversion::multiversion(targets("x86_64+avx2"))]
pub(crate) fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut lanes = [0.0_f32; 8];
    let heads = a.chunks_exact(8);
    let tails = b.chunks_exact(8);
    let rest: f32 = heads.remainder().iter().zip(tails.remainder()).map(|(x, y)| x * y).sum();
    for (x, y) in heads.zip(tails) {
        lanes.iter_mut().zip(x.iter().zip(y)).for_each(|(lane, (x, y))| *lane += x * y);
    }
    lanes.iter().sum::<f32>() + rest
}
