use serde::{Deserialize, Serialize};

use crate::features::{COUNT, Features};

/// A decision by one feature: its votes where the feature is below a threshold and where it is not.
/// An unknown feature has no vote.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "(usize, f32, f32, f32)", into = "(usize, f32, f32, f32)")]
pub struct Stump {
    /// Index of the number.
    pub feature: usize,
    /// Where it is divided.
    pub threshold: f32,
    /// Added below the threshold ...
    pub below: f32,
    /// ... and from it on.
    pub above: f32,
}

impl From<(usize, f32, f32, f32)> for Stump {
    fn from((feature, threshold, below, above): (usize, f32, f32, f32)) -> Self {
        Self { feature, threshold, below, above }
    }
}

impl From<Stump> for (usize, f32, f32, f32) {
    fn from(stump: Stump) -> Self {
        (stump.feature, stump.threshold, stump.below, stump.above)
    }
}

impl Stump {
    /// Returns the vote for a value of its feature.
    pub fn vote(&self, value: f32) -> f32 {
        if value.is_nan() {
            0.0
        } else if value < self.threshold {
            self.below
        } else {
            self.above
        }
    }
}

/// Two decisions one after the other: which stump votes depends on one number,
/// so that a tree can say "flat, and textured like a face". A number that is
/// not known adds nothing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "(usize, f32, Stump, Stump)", into = "(usize, f32, Stump, Stump)")]
pub struct Tree {
    /// Index of the first number.
    pub feature: usize,
    /// Where it is divided.
    pub threshold: f32,
    /// Votes below the threshold ...
    pub below: Stump,
    /// ... and from it on.
    pub above: Stump,
}

impl From<(usize, f32, Stump, Stump)> for Tree {
    fn from((feature, threshold, below, above): (usize, f32, Stump, Stump)) -> Self {
        Self { feature, threshold, below, above }
    }
}

impl From<Tree> for (usize, f32, Stump, Stump) {
    fn from(tree: Tree) -> Self {
        (tree.feature, tree.threshold, tree.below, tree.above)
    }
}

/// Returns a number of a candidate, NaN where it has none.
fn number_of(values: &[f32], feature: usize) -> f32 {
    values.get(feature).copied().unwrap_or(f32::NAN)
}

impl Tree {
    /// Returns the vote for the features of a candidate.
    pub fn vote(&self, values: &[f32]) -> f32 {
        let first = number_of(values, self.feature);
        // A tree without its first feature has no vote.
        if first.is_nan() {
            return 0.0;
        }
        let stump = if first < self.threshold { &self.below } else { &self.above };
        stump.vote(number_of(values, stump.feature))
    }

    fn features(&self) -> [usize; 3] {
        [self.feature, self.below.feature, self.above.feature]
    }

    fn numbers(&self) -> [f32; 7] {
        let Self { threshold, below: b, above: a, .. } = self;
        [*threshold, b.threshold, b.below, b.above, a.threshold, a.below, a.above]
    }
}

/// A sum of trees, and the straight line that turns it into log-odds. Its
/// default is undecided about everything.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// The trees, as they were found.
    pub trees: Vec<Tree>,
    /// Log-odds per unit of the sum ...
    pub slope: f64,
    /// ... and those of the sum 0.
    pub offset: f64,
}

/// A model as TOML.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    format: String,
    /// Number of features that its trees choose from.
    features: usize,
    slope: f64,
    offset: f64,
    trees: Vec<Tree>,
}

const FORMAT: &str = "color-texture 2";

impl Model {
    /// Log-odds that the candidate is a person, with even priors.
    pub fn log_odds(&self, features: &Features) -> f64 {
        self.slope * self.sum(features.values()) + self.offset
    }

    /// The sum of the trees.
    pub fn sum(&self, values: &[f32]) -> f64 {
        self.trees.iter().map(|tree| f64::from(tree.vote(values))).sum()
    }

    /// Formats the model file.
    ///
    /// # Errors
    /// Numbers that TOML cannot express.
    pub fn to_text(&self) -> Result<String, String> {
        let file = File {
            format: FORMAT.into(),
            features: COUNT,
            slope: self.slope,
            offset: self.offset,
            trees: self.trees.clone(),
        };
        let text = toml::to_string(&file).map_err(|why| format!("the model is no TOML: {why}"))?;
        Ok(text.replace("]], [", "]],\n  ["))
    }

    /// Reads a model file.
    ///
    /// # Errors
    /// Text that is no model, in a sentence.
    pub fn from_text(text: &str) -> Result<Self, String> {
        let file: File = toml::from_str(text).map_err(|e| e.message().trim_end().to_owned())?;
        if file.format != FORMAT {
            return Err(format!("the format is `{}`, not `{FORMAT}`", file.format));
        }
        // A model of other features would vote on the wrong numbers.
        if file.features != COUNT || file.trees.iter().flat_map(Tree::features).any(|f| f >= COUNT)
        {
            return Err(format!("it is not made of the {COUNT} numbers of this program"));
        }
        let numbers = file.trees.iter().flat_map(Tree::numbers);
        let is_finite = numbers.map(f64::from).chain([file.slope, file.offset]).all(f64::is_finite);
        if !is_finite {
            return Err("it has numbers that are not finite".into());
        }
        Ok(Self { trees: file.trees, slope: file.slope, offset: file.offset })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn model() -> Model {
        fn stump(feature: usize, threshold: f32, below: f32, above: f32) -> Stump {
            Stump { feature, threshold, below, above }
        }

        let trees = vec![
            Tree {
                feature: 3,
                threshold: 0.5,
                below: stump(3, 0.25, -1.0, -0.75),
                above: stump(5, 0.0, 2.0, 1.0),
            },
            Tree {
                feature: 7,
                threshold: -0.25,
                below: stump(8, 0.0, 0.5, 0.25),
                above: stump(8, 0.0, 0.0, 0.0),
            },
        ];
        Model { trees, slope: 1.5, offset: -0.25 }
    }

    #[test]
    fn what_is_not_known_says_nothing() {
        let mut values = vec![0.0; COUNT];
        assert_eq!(model().sum(&values), -1.0);
        values[3] = f32::NAN;
        assert_eq!(model().sum(&values), 0.0);
        values[7] = -0.3;
        assert_eq!(model().sum(&values), 0.25);
        values[8] = f32::NAN;
        assert_eq!(model().sum(&values), 0.0);
    }

    #[test]
    fn the_second_question_depends_on_the_first() {
        let mut values = vec![0.0; COUNT];
        values[5] = 1.0;
        assert_eq!(model().sum(&values), -1.0);
        values[3] = 0.6;
        assert_eq!(model().sum(&values), 1.0);
        values[5] = -1.0;
        assert_eq!(model().sum(&values), 2.0);
    }

    #[test]
    fn a_model_survives_its_file() {
        assert_eq!(Model::from_text(&model().to_text().unwrap()).unwrap(), model());
    }

    #[test]
    fn broken_files_are_refused_in_a_sentence() {
        let good = model().to_text().unwrap();
        for (from, to, why) in [
            ("texture 2", "texture 9", "texture 9"),
            ("slope = 1.5", "slope = inf", "not finite"),
            ("[3,", "[99999,", "numbers of this program"),
        ] {
            assert!(good.contains(from), "{good}");
            let refusal = Model::from_text(&good.replace(from, to)).unwrap_err();
            assert!(refusal.contains(why), "{refusal}");
        }
        assert!(Model::from_text("nonsense").is_err());
    }
}
