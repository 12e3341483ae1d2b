use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A kind of data that a log may carry beside the camera and the odometry.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum Input {
    /// Colour or grey images.
    Colour,
    /// Depth images.
    Depth,
    /// The right images of a stereo pair.
    Right,
    /// The points of a laser scanner.
    Laser,
    /// Detections that the log carries.
    Detections,
}

impl Input {
    /// All kinds.
    pub const ALL: [Self; 5] =
        [Self::Colour, Self::Depth, Self::Right, Self::Laser, Self::Detections];

    /// Returns the name in configs and in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Colour => "colour",
            Self::Depth => "depth",
            Self::Right => "right",
            Self::Laser => "laser",
            Self::Detections => "detections",
        }
    }
}

impl fmt::Display for Input {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Colour => "colour or grey images",
            Self::Depth => "depth images",
            Self::Right => "right images of a stereo pair",
            Self::Laser => "laser scans",
            Self::Detections => "recorded detections",
        })
    }
}

/// Use of an input by a plugin.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Default)]
pub enum Usage {
    /// Never used.
    #[default]
    Unused,
    /// Used if the log has it.
    Optional,
    /// Required.
    Required,
}

/// Declared inputs of a plugin or of a pipeline, used or required. A pipeline receives the inputs
/// that it declares and no others.
///
/// ```
/// # use tagalong_core::{Input, Inputs, Usage};
/// let detector = Inputs::NONE.require(Input::Colour).accept(Input::Depth);
/// let verifier = Inputs::NONE.require(Input::Depth);
/// let both = detector.union(verifier);
/// assert_eq!(both.usage(Input::Depth), Usage::Required);
/// assert!(!both.uses(Input::Laser));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Inputs([Usage; Input::ALL.len()]);

impl Inputs {
    /// No input is used.
    pub const NONE: Self = Self([Usage::Unused; Input::ALL.len()]);
    /// Every input is used if the log has it.
    pub const ANY: Self = Self([Usage::Optional; Input::ALL.len()]);

    /// Returns these inputs with `input` required.
    pub const fn require(mut self, input: Input) -> Self {
        self.0[input as usize] = Usage::Required;
        self
    }

    /// Returns these inputs with `input` used if the log has it; a required one stays required.
    pub const fn accept(mut self, input: Input) -> Self {
        if let Usage::Unused = self.0[input as usize] {
            self.0[input as usize] = Usage::Optional;
        }
        self
    }

    /// Returns these inputs with `input` optional, if it is used at all.
    pub fn relax(mut self, input: Input) -> Self {
        let usage = &mut self.0[input as usize];
        *usage = (*usage).min(Usage::Optional);
        self
    }

    /// Returns these inputs without `input`.
    pub fn without(mut self, input: Input) -> Self {
        self.0[input as usize] = Usage::Unused;
        self
    }

    /// Returns the inputs of two plugins that work on the same frames.
    pub fn union(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i].max(other.0[i])))
    }

    /// Returns the usage of `input`.
    pub fn usage(&self, input: Input) -> Usage {
        self.0[input as usize]
    }

    /// Returns true if `input` is used at all.
    pub fn uses(&self, input: Input) -> bool {
        self.usage(input) > Usage::Unused
    }

    /// Returns true if `input` is required.
    pub fn requires(&self, input: Input) -> bool {
        self.usage(input) == Usage::Required
    }

    /// Returns the inputs with the given usage.
    pub fn of(&self, usage: Usage) -> impl Iterator<Item = Input> {
        Input::ALL.into_iter().filter(move |input| self.usage(*input) == usage)
    }
}

/// The declaration of a detector: its inputs, and the roles that a config may give it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Capabilities {
    /// The inputs that the detector uses.
    pub inputs: Inputs,
    /// True if it finds people that are not tracked yet ([`crate::Query::Discover`]).
    pub discovers: bool,
    /// True if it finds a tracked person again ([`crate::Query::Track`]).
    pub tracks: bool,
    /// True if it has a [`crate::Likelihood`].
    pub weighs: bool,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stronger_use_wins_and_what_is_left_out_is_gone() {
        let a = Inputs::NONE.require(Input::Depth).accept(Input::Depth).accept(Input::Laser);
        assert_eq!(a.usage(Input::Depth), Usage::Required);
        let both = Inputs::ANY.union(a);
        assert_eq!(both.of(Usage::Required).collect::<Vec<_>>(), [Input::Depth]);
        assert_eq!(both.of(Usage::Optional).count(), 4);
        assert_eq!(both.relax(Input::Depth), Inputs::ANY);
        assert_eq!(a.relax(Input::Right).usage(Input::Right), Usage::Unused);
        assert!(!both.without(Input::Depth).uses(Input::Depth));
    }

    #[test]
    fn inputs_stand_at_their_own_place() {
        for (place, input) in Input::ALL.into_iter().enumerate() {
            assert_eq!(input as usize, place, "{input}");
            let text = serde_json::to_string(&input).unwrap();
            assert_eq!(text, format!("{:?}", input.name()));
        }
    }
}
