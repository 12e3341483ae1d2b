use serde::{Deserialize, Serialize};

use crate::features::{COUNT, FEATURES, Features};

/// Node of a tree: feature, threshold, and what follows below the threshold and from it on. A
/// number above zero is the index of another node, and `leaves` hold the value otherwise.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "RawNode", into = "RawNode")]
pub struct Node {
    /// Index of the feature.
    pub feature: usize,
    /// Values below this take the first way.
    pub below: f32,
    /// Index of the next node of both ways; 0 for a leaf, because no way leads to the root.
    pub next: [usize; 2],
    /// Values of both ways that are leaves.
    pub leaves: [f32; 2],
}

type RawNode = (usize, f32, usize, usize, f32, f32);

impl From<RawNode> for Node {
    fn from((feature, below, first, second, low, high): RawNode) -> Self {
        Self { feature, below, next: [first, second], leaves: [low, high] }
    }
}

impl From<Node> for RawNode {
    fn from(Node { feature, below, next, leaves }: Node) -> Self {
        (feature, below, next[0], next[1], leaves[0], leaves[1])
    }
}

/// Nodes of a tree, the root first.
pub type Tree = Vec<Node>;

/// Sum of trees, and the line that turns it into log-odds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Model {
    /// The trees in the order in which they were grown.
    pub trees: Vec<Tree>,
    /// Log-odds per unit of the sum.
    pub slope: f64,
    /// Log-odds of the sum 0.
    pub offset: f64,
}

/// A model as TOML.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    format: String,
    features: Vec<String>,
    slope: f64,
    offset: f64,
    trees: Vec<Tree>,
}

const FORMAT: &str = "laser-legs 1";

impl Model {
    /// Returns the log-odds that a segment is a leg, with even priors.
    pub fn log_odds(&self, features: &Features) -> f64 {
        self.slope * self.sum(features) + self.offset
    }

    /// Returns the sum of the trees.
    pub fn sum(&self, features: &Features) -> f64 {
        self.trees.iter().map(|tree| f64::from(value(tree, features))).sum()
    }

    /// Formats the model file.
    ///
    /// # Errors
    /// Numbers that TOML cannot express.
    pub fn to_text(&self) -> Result<String, String> {
        let file = File {
            format: FORMAT.into(),
            features: FEATURES.map(String::from).to_vec(),
            slope: self.slope,
            offset: self.offset,
            trees: self.trees.clone(),
        };
        let text = toml::to_string(&file).map_err(|why| format!("the model is no TOML: {why}"))?;
        Ok(text.replace("]], [", "]],\n  ["))
    }

    /// Parses a model file.
    ///
    /// # Errors
    /// Text that is not a model; the message is one sentence.
    pub fn from_text(text: &str) -> Result<Self, String> {
        let file: File = toml::from_str(text).map_err(|e| e.message().trim_end().to_owned())?;
        if file.format != FORMAT {
            return Err(format!("the format is `{}`, not `{FORMAT}`", file.format));
        }
        if file.features != FEATURES {
            return Err(format!("it is not made of the features {FEATURES:?}"));
        }
        if !file.trees.iter().all(is_sound) {
            return Err("its trees do not hang together or are not finite".into());
        }
        if ![file.slope, file.offset].into_iter().all(f64::is_finite) {
            return Err("its calibration is not finite".into());
        }
        Ok(Self { trees: file.trees, slope: file.slope, offset: file.offset })
    }
}

/// Returns true if every way through a tree leads forward, to nodes and features that exist.
fn is_sound(tree: &Tree) -> bool {
    !tree.is_empty()
        && tree.iter().enumerate().all(|(index, node)| {
            let numbers = [node.below, node.leaves[0], node.leaves[1]];
            node.feature < COUNT
                && node.next.iter().all(|next| *next == 0 || (index < *next && *next < tree.len()))
                && numbers.iter().all(|n| n.is_finite())
        })
}

/// Returns the value of the leaf that some features lead to.
fn value(tree: &Tree, features: &Features) -> f32 {
    let mut node = &tree[0];
    loop {
        // A value that is not a number takes the second way.
        let is_below = features[node.feature] < node.below;
        let way = usize::from(!is_below);
        match node.next[way] {
            0 => return node.leaves[way],
            next => node = &tree[next],
        }
    }
}
