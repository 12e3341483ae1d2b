use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Name of an input. Behind its own name, because a reference in the enum itself would make serde
/// borrow from the text of a config.
type Name = &'static str;

/// A kind of data that a log may carry beside the camera and the odometry.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
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
    /// Data of a sensor that another crate defines, by the name that its [`crate::Sensor`] gives.
    #[serde(skip)]
    Named(Name),
}

impl Input {
    /// The kinds that every build knows.
    pub const ALL: [Self; 5] =
        [Self::Colour, Self::Depth, Self::Right, Self::Laser, Self::Detections];
    /// Readings of the further sources of the collision monitor, [`crate::ObstacleReadings`].
    pub const OBSTACLES: Self = Self::Named("obstacle-sources");
    /// The points of a 3-D lidar, [`crate::PointCloud`].
    pub const POINTS: Self = Self::Named("points");

    /// Returns the name in configs and in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Colour => "colour",
            Self::Depth => "depth",
            Self::Right => "right",
            Self::Laser => "laser",
            Self::Detections => "detections",
            Self::Named(name) => name,
        }
    }

    /// Returns the place of a kind in [`Input::ALL`]; `Err` with the name of any other.
    const fn place(self) -> Result<usize, &'static str> {
        match self {
            Self::Colour => Ok(0),
            Self::Depth => Ok(1),
            Self::Right => Ok(2),
            Self::Laser => Ok(3),
            Self::Detections => Ok(4),
            Self::Named(name) => Err(name),
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
            Self::Named(name) => name,
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
pub struct Inputs {
    known: [Usage; Input::ALL.len()],
    named: [Option<(&'static str, Usage)>; MOST_NAMED],
    /// Usage of named inputs that are not in `named`.
    others: Usage,
}

/// Largest number of named inputs of a pipeline.
const MOST_NAMED: usize = 8;

impl Inputs {
    /// No input is used.
    pub const NONE: Self = Self::all(Usage::Unused);
    /// Every input is used if the log has it.
    pub const ANY: Self = Self::all(Usage::Optional);

    const fn all(usage: Usage) -> Self {
        Self { known: [usage; Input::ALL.len()], named: [None; MOST_NAMED], others: usage }
    }

    /// Returns these inputs with `input` required.
    ///
    /// # Panics
    /// With more than eight inputs that are [`Input::Named`].
    pub const fn require(self, input: Input) -> Self {
        self.with(input, Usage::Required)
    }

    /// Returns these inputs with `input` used if the log has it; a required one stays required.
    ///
    /// # Panics
    /// As [`Inputs::require`].
    pub const fn accept(self, input: Input) -> Self {
        match self.usage(input) {
            Usage::Unused => self.with(input, Usage::Optional),
            Usage::Optional | Usage::Required => self,
        }
    }

    /// Returns true for a pipeline that sees by the points of a 3-D lidar alone.
    pub fn are_of_points(&self) -> bool {
        let images = [Input::Colour, Input::Depth, Input::Right];
        self.requires(Input::POINTS) && !images.into_iter().any(|image| self.uses(image))
    }

    /// Returns these inputs with `input` optional, if it is used at all.
    pub fn relax(self, input: Input) -> Self {
        self.with(input, self.usage(input).min(Usage::Optional))
    }

    /// Returns these inputs without `input`.
    pub fn without(self, input: Input) -> Self {
        self.with(input, Usage::Unused)
    }

    const fn with(mut self, input: Input, usage: Usage) -> Self {
        match input.place() {
            Ok(place) => self.known[place] = usage,
            Err(name) => {
                let slot = self.slot(name);
                assert!(slot < MOST_NAMED, "a pipeline has at most eight named inputs");
                self.named[slot] = Some((name, usage));
            }
        }
        self
    }

    /// Returns the slot of a named input: its own, or else the first free one.
    const fn slot(&self, name: &str) -> usize {
        let mut slot = 0;
        while slot < MOST_NAMED {
            match self.named[slot] {
                Some((other, _)) if !is_same(name, other) => slot += 1,
                _ => break,
            }
        }
        slot
    }

    /// Returns the inputs of two plugins that work on the same frames.
    pub fn union(self, other: Self) -> Self {
        let known = std::array::from_fn(|i| self.known[i].max(other.known[i]));
        let named = self.named.iter().chain(&other.named).flatten();
        let union =
            Self { known, named: [None; MOST_NAMED], others: self.others.max(other.others) };
        named.fold(union, |union, (name, _)| {
            let input = Input::Named(name);
            union.with(input, self.usage(input).max(other.usage(input)))
        })
    }

    /// Returns the usage of `input`.
    pub const fn usage(&self, input: Input) -> Usage {
        match input.place() {
            Ok(place) => self.known[place],
            Err(name) => match self.slot(name) {
                slot if slot < MOST_NAMED => match self.named[slot] {
                    Some((_, usage)) => usage,
                    None => self.others,
                },
                _ => self.others,
            },
        }
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
        let named = self.named.iter().flatten().map(|(name, _)| Input::Named(name));
        Input::ALL.into_iter().chain(named).filter(move |input| self.usage(*input) == usage)
    }
}

/// Compares two names, in constants too.
const fn is_same(a: &str, b: &str) -> bool {
    let a = a.as_bytes();
    let b = b.as_bytes();
    let mut at = 0;
    while at < a.len() && at < b.len() && a[at] == b[at] {
        at += 1;
    }
    at == a.len() && at == b.len()
}

/// The declaration of a detector: its inputs, and the roles that a config may give it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
#[non_exhaustive]
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

impl Capabilities {
    /// Declares the inputs of a detector, without a role yet.
    ///
    /// ```
    /// # use tagalong_core::{Capabilities, Input, Inputs};
    /// let detector = Capabilities::new(Inputs::NONE.require(Input::Depth)).discovering();
    /// assert!(detector.discovers && !detector.tracks && !detector.weighs);
    /// ```
    pub fn new(inputs: Inputs) -> Self {
        Self { inputs, ..Self::default() }
    }

    /// Returns the declaration of a detector that finds people without a track.
    pub fn discovering(self) -> Self {
        Self { discovers: true, ..self }
    }

    /// Returns the declaration of a detector that finds a tracked person again.
    pub fn tracking(self) -> Self {
        Self { tracks: true, ..self }
    }

    /// Returns the declaration of a detector with a [`crate::Likelihood`].
    pub fn weighing(self) -> Self {
        Self { weighs: true, ..self }
    }
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

    /// The names of inputs that other crates define.
    const RADAR: Input = Input::Named("radar");
    const RADIO: Input = Input::Named("radio");
    const BOTH: Inputs = Inputs::NONE.require(RADAR).accept(RADIO);

    #[test]
    fn inputs_that_other_crates_define_are_declared_by_name() {
        assert_eq!((BOTH.usage(RADAR), BOTH.usage(RADIO)), (Usage::Required, Usage::Optional));
        assert!(!BOTH.uses(Input::Named("rad")) && !Inputs::NONE.uses(RADAR));
        assert!(Inputs::ANY.uses(RADAR) && !Inputs::ANY.without(RADAR).uses(RADAR));
        assert_eq!(BOTH.of(Usage::Required).collect::<Vec<_>>(), [RADAR]);
        assert_eq!(BOTH.relax(RADAR).usage(RADAR), Usage::Optional);
        let union = Inputs::NONE.require(RADIO).require(Input::Depth).union(BOTH);
        assert_eq!(union.of(Usage::Required).collect::<Vec<_>>(), [Input::Depth, RADIO, RADAR]);
        assert_eq!(Inputs::ANY.union(BOTH).usage(Input::Named("other")), Usage::Optional);
        assert_eq!((RADAR.name(), RADAR.to_string()), ("radar", "radar".to_owned()));
    }

    #[test]
    fn inputs_stand_at_their_own_place() {
        for (place, input) in Input::ALL.into_iter().enumerate() {
            assert_eq!(input.place(), Ok(place), "{input}");
            let text = serde_json::to_string(&input).unwrap();
            assert_eq!(text, format!("{:?}", input.name()));
        }
    }
}
