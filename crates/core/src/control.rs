use std::fmt;

use crate::{Frame, Inputs, Stamp, Track, Wheels};

/// Speeds over ground of the two driven wheels, m/s.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct WheelSpeeds {
    /// Left wheel.
    pub left: f64,
    /// Right wheel.
    pub right: f64,
}

impl WheelSpeeds {
    /// Standing still.
    pub const STOP: Self = Self { left: 0.0, right: 0.0 };
}

/// What the wheels may do, for how long, and why.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command {
    /// The speeds: finite and within the robot's limits.
    pub wheels: WheelSpeeds,
    /// When the image was taken that the command answers to.
    pub stamp: Stamp,
    /// Whoever drives the wheels stops them after this, unless there is a newer
    /// command.
    pub valid_until: Stamp,
    /// Why it is what it is.
    pub reason: Reason,
}

/// Why a command is what it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Reason {
    /// As the controller wishes.
    Follow,
    /// As the controller wishes, but slower: a limit of speed, acceleration or
    /// turn rate.
    Limited,
    /// At most half as fast: it may be somebody else who is followed.
    Unsure,
    /// At most half as fast, to find a person again who is lost.
    Search,
    /// Slower, for something is ahead.
    Obstacle,
    /// Slower, for frames come late.
    Slow,
    /// Stop: something is too near ahead.
    Blocked,
    /// Stop: the depth image shows nothing at all.
    Blind,
    /// Stop: nobody is followed.
    NoTarget,
    /// Stop: too few frames since the start or a jump of the clock.
    Settling,
    /// Stop: no frame for too long.
    Stalled,
    /// Stop: the controller's wish is not finite.
    NotFinite,
    /// Stop: the command before has expired and there is no newer one.
    Expired,
    /// Stop: a fault that lasts until the pipeline is armed again.
    Fault,
}

impl Reason {
    /// The word for it in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Follow => "follow",
            Self::Limited => "limited",
            Self::Unsure => "unsure",
            Self::Search => "search",
            Self::Obstacle => "obstacle",
            Self::Slow => "slow",
            Self::Blocked => "blocked",
            Self::Blind => "blind",
            Self::NoTarget => "no-target",
            Self::Settling => "settling",
            Self::Stalled => "stalled",
            Self::NotFinite => "not-finite",
            Self::Expired => "expired",
            Self::Fault => "fault",
        }
    }

    /// True if the robot may move for this reason.
    pub fn moves(self) -> bool {
        matches!(
            self,
            Self::Follow
                | Self::Limited
                | Self::Unsure
                | Self::Search
                | Self::Obstacle
                | Self::Slow
        )
    }
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// What a controller sees of one frame.
pub struct Scene<'a> {
    /// The frame; its depth image shows the obstacles.
    pub frame: &'a Frame,
    /// The person to follow, if the pipeline is sure of one.
    pub target: Option<&'a Track>,
    /// Everybody confirmed, the target included.
    pub tracks: &'a [Track],
    /// The drive.
    pub wheels: Wheels,
    /// The speed limit of a wheel, m/s.
    pub max_speed_mps: f64,
}

/// Steers after the target. It cannot fail: when unsure, it stops.
pub trait Controller: Send {
    /// Returns the inputs that the controller itself uses. The governor, which looks at
    /// obstacles for all of them, declares its own.
    fn inputs(&self) -> Inputs {
        Inputs::NONE
    }

    /// The wheel speeds to command now.
    fn command(&mut self, scene: &Scene<'_>) -> WheelSpeeds;

    /// The distance at which it stops before the person, m, if it keeps one. A
    /// config whose robot cannot stop within it is refused.
    fn stand_off_m(&self) -> Option<f64> {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Reason; 14] = [
        Reason::Follow,
        Reason::Limited,
        Reason::Unsure,
        Reason::Search,
        Reason::Obstacle,
        Reason::Slow,
        Reason::Blocked,
        Reason::Blind,
        Reason::NoTarget,
        Reason::Settling,
        Reason::Stalled,
        Reason::NotFinite,
        Reason::Expired,
        Reason::Fault,
    ];

    #[test]
    fn the_robot_moves_for_six_reasons_and_stands_for_the_others() {
        let (moves, stands) = ALL.split_at(6);
        assert!(moves.iter().all(|reason| reason.moves()));
        assert!(stands.iter().all(|reason| !reason.moves()));
    }

    #[test]
    fn each_reason_has_a_word_of_its_own() {
        let words: std::collections::BTreeSet<String> =
            ALL.iter().map(ToString::to_string).collect();
        assert_eq!(words.len(), ALL.len());
        assert!(words.iter().all(|word| !word.is_empty() && !word.contains([' ', ','])));
        assert_eq!(Reason::NotFinite.name(), "not-finite");
    }

    #[test]
    fn a_controller_keeps_no_distance_unless_it_says_so() {
        struct Still;
        impl Controller for Still {
            fn command(&mut self, _: &Scene<'_>) -> WheelSpeeds {
                WheelSpeeds::STOP
            }
        }
        assert_eq!(Still.stand_off_m(), None);
    }
}
