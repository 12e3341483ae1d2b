//! Commands for the wheels, with the reason of each and its text, and the trait of controllers.

use std::fmt;

use crate::{DiffDrive, Frame, Inputs, Stamp, Track, Twist, WheelSpeeds};

/// Speed, m/s or rad/s, that two digits show as zero.
const STILL: f64 = 0.005;

/// Velocity to drive, with a period of validity and a reason.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Command {
    /// The velocity: finite and within the robot's limits.
    pub twist: Twist,
    /// The wheel speeds of a differential drive with this velocity.
    pub wheels: WheelSpeeds,
    /// Capture time of the frame to which the command responds.
    pub stamp: Stamp,
    /// Time at which the motor driver stops the wheels unless a newer command has arrived.
    pub valid_until: Stamp,
    /// Reason for the speeds.
    pub reason: Reason,
}

impl Command {
    /// Creates the command that responds to the frame of `stamp`: the velocity, which is finite and
    /// within the robot's limits, the wheel speeds of it, its end, and the reason.
    pub fn new(
        twist: Twist,
        wheels: WheelSpeeds,
        stamp: Stamp,
        valid_until: Stamp,
        reason: Reason,
    ) -> Self {
        Self { twist, wheels, stamp, valid_until, reason }
    }

    /// Returns the velocity as pages tell it: without what two digits round away.
    pub fn told_twist(&self) -> Twist {
        let Twist { linear_mps, lateral_mps, angular_rps } = self.twist;
        let linear_mps = if linear_mps.abs() < STILL { 0.0 } else { linear_mps };
        let lateral_mps = if lateral_mps.abs() < STILL { 0.0 } else { lateral_mps };
        let angular_rps = if angular_rps.abs() < STILL { 0.0 } else { angular_rps };
        Twist { linear_mps, lateral_mps, angular_rps }
    }

    /// Returns the effect in one word, as [`Reason::effect`]; a robot that neither drives nor turns
    /// stands, whatever the reason.
    pub fn effect(&self) -> &'static str {
        if self.told_twist() == Twist::STOP { "stands" } else { self.reason.effect() }
    }

    /// Returns one sentence for an operator of the robot: [`Reason::about`], with what the robot
    /// does by this command.
    pub fn about(&self) -> String {
        let about = self.reason.about();
        let is_still = self.told_twist() == Twist::STOP;
        if is_still && self.reason == Reason::Follow {
            return "stands, as the controller asks".to_owned();
        }
        if is_still && self.reason.moves() {
            let cause = about.split_once(": ").map_or(about, |(_, cause)| cause);
            return format!("stands: {cause}");
        }
        match about.strip_prefix("stands: ") {
            Some(cause) if !is_still => format!("does not drive, may turn: {cause}"),
            _ => about.to_owned(),
        }
    }
}

/// Reason for the speeds of a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Reason {
    /// As requested by the controller.
    Follow,
    /// As requested by the controller, but slower: a limit of speed, acceleration or turn rate
    /// applies.
    Limited,
    /// At most half as fast: the followed track may be another person.
    Unsure,
    /// At most half as fast, to find a lost target again.
    Search,
    /// Slower because an obstacle is ahead.
    Obstacle,
    /// Slower because frames arrive late.
    Slow,
    /// Slower because a person, or something that moves, is near.
    Near,
    /// Slower because a sensor sees too little of the region that the robot would sweep.
    Unclear,
    /// Slower and slower until the robot stands, because there is no target.
    Stopping,
    /// Stop: an obstacle ahead is too near.
    Blocked,
    /// Stop: a person, or something that moves, is nearer than the protective distance.
    TooClose,
    /// Stop: the sensors see too little of the region that the robot would sweep.
    Unknown,
    /// Stop: the depth image has no readings at all, or there is no sensor of obstacles.
    Blind,
    /// Stop: a sensor of obstacles has delivered no new reading for too long.
    Silent,
    /// Stop: a sensor repeats itself, or does not change as the odometry says.
    Frozen,
    /// Stop: the odometry is missing, too old, or no number.
    Odometry,
    /// Stop: the pose of the camera on the robot is too old, because tf does not come.
    CameraPose,
    /// Stop: images or wheels respond later than the reaction time allows.
    Late,
    /// Stop: a bumper is pressed.
    Contact,
    /// Stop: there is no target.
    NoTarget,
    /// Stop: too few frames since the start or a jump of the clock.
    Settling,
    /// Stop: no frame for too long.
    Stalled,
    /// Stop: the speeds requested by the controller are not finite.
    NotFinite,
    /// Stop: the previous command has expired and there is no newer one.
    Expired,
    /// Stop: a fault that persists until the pipeline is armed again.
    Fault,
}

impl Reason {
    /// Returns the name of the reason in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Follow => "follow",
            Self::Limited => "limited",
            Self::Unsure => "unsure",
            Self::Search => "search",
            Self::Obstacle => "obstacle",
            Self::Slow => "slow",
            Self::Near => "near",
            Self::Unclear => "unclear",
            Self::Stopping => "stopping",
            Self::Blocked => "blocked",
            Self::TooClose => "too-close",
            Self::Unknown => "unknown",
            Self::Blind => "blind",
            Self::Silent => "silent",
            Self::Frozen => "frozen",
            Self::Odometry => "odometry",
            Self::CameraPose => "camera-pose",
            Self::Late => "late",
            Self::Contact => "contact",
            Self::NoTarget => "no-target",
            Self::Settling => "settling",
            Self::Stalled => "stalled",
            Self::NotFinite => "not-finite",
            Self::Expired => "expired",
            Self::Fault => "fault",
        }
    }

    /// Returns one sentence for an operator of the robot.
    pub fn about(self) -> &'static str {
        match self {
            Self::Follow => "drives as the controller asks",
            Self::Limited => {
                "drives slower than the controller asks: a limit of speed, acceleration or turn rate applies"
            }
            Self::Unsure => "at most half as fast: the followed track may be another person",
            Self::Search => "searches for the lost person, at most half as fast",
            Self::Obstacle => "slower: an obstacle is ahead",
            Self::Slow => "slower: frames arrive late",
            Self::Near => "slower: a person, or something that moves, is near",
            Self::Unclear => "slower: the sensors see little of the way ahead",
            Self::Stopping => "brakes: there is no target",
            Self::Blocked => "stands: an obstacle ahead is too near",
            Self::TooClose => "stands: a person, or something that moves, is too close",
            Self::Unknown => "stands: the sensors see too little of the way ahead",
            Self::Frozen => {
                "stands: a sensor repeats itself, or does not change as the odometry says"
            }
            Self::Odometry => "stands: the odometry is missing, too old, or no number",
            Self::CameraPose => "stands: tf does not say any more where the camera is on the robot",
            Self::Late => "stands: images or wheels respond too late",
            Self::Contact => "stands: a bumper is pressed",
            Self::Blind => "stands: depth has no readings, or there is no sensor of obstacles",
            Self::Silent => "stands: a sensor of obstacles delivers no new readings",
            Self::NoTarget => "stands: there is no target",
            Self::Settling => "stands: too few frames since the start or a jump of the clock",
            Self::Stalled => "stands: no frame came for too long",
            Self::NotFinite => "stands: the controller asked for speeds that are no numbers",
            Self::Expired => "stands: the last command has expired",
            Self::Fault => "stands: a fault persists until the pipeline is armed again",
        }
    }

    /// Returns the effect in one word: `drives` as the controller asks, `slower`, or `stands`.
    pub fn effect(self) -> &'static str {
        if !self.moves() {
            return "stands";
        }
        // Limits of speed and acceleration apply in every ride; they say nothing about its surroundings.
        if matches!(self, Self::Follow | Self::Limited) { "drives" } else { "slower" }
    }

    /// Returns true if the robot may move for this reason.
    pub fn moves(self) -> bool {
        matches!(
            self,
            Self::Follow
                | Self::Limited
                | Self::Unsure
                | Self::Search
                | Self::Obstacle
                | Self::Slow
                | Self::Near
                | Self::Unclear
                | Self::Stopping
        )
    }
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Input of a controller for one frame.
#[non_exhaustive]
pub struct Scene<'a> {
    /// The frame; its depth image shows the obstacles.
    pub frame: &'a Frame,
    /// The track to follow, if the pipeline is sure of one.
    pub target: Option<&'a Track>,
    /// All confirmed tracks, the target included.
    pub tracks: &'a [Track],
    /// The differential drive.
    pub wheels: DiffDrive,
    /// Speed limit of a wheel, m/s.
    pub max_speed_mps: f64,
}

impl<'a> Scene<'a> {
    /// Creates the input of a controller without a target: the frame, all confirmed tracks, the drive,
    /// and the speed limit of a wheel, m/s.
    pub fn new(
        frame: &'a Frame,
        tracks: &'a [Track],
        wheels: DiffDrive,
        max_speed_mps: f64,
    ) -> Self {
        Self { frame, target: None, tracks, wheels, max_speed_mps }
    }

    /// Returns the input with the track to follow, if there is one.
    pub fn with_target(self, target: Option<&'a Track>) -> Self {
        Self { target, ..self }
    }
}

/// Steers the robot after the target. It cannot fail: when unsure, it stops.
///
/// ```
/// # use nalgebra::{Isometry3, SMatrix, zero};
/// # use tagalong_core::*;
/// # use tagalong_geometry::{Camera, Rect};
/// /// Turns to face the target and never drives.
/// struct Facing;
///
/// impl Controller for Facing {
///     fn command(&mut self, scene: &Scene<'_>) -> Twist {
///         let Some(target) = scene.target else { return Twist::STOP };
///         let place = target.estimate.person.position;
///         Twist::new(0.0, 0.5 * place.y.atan2(place.x))
///     }
/// }
///
/// # let (blind, motion) = (Camera::blind(Isometry3::identity()).into(), EgoMotion::at_rest(0.1));
/// # let frame = Frame::of_sensors(1, Stamp::default(), blind, motion, Sensors::default());
/// # let person = Person { position: [0.0, 2.0, 1.6].into(), velocity: zero() };
/// # let estimate = Estimate::new(person, SMatrix::identity(), Rect::default());
/// // The person stands at the robot's left, 2 m away.
/// let track = Track::new(TrackId(1), estimate, 1.0);
/// let tracks = std::slice::from_ref(&track);
/// let wheels = DiffDrive { half_separation_m: 0.2, slip: 0.0 };
/// let scene = Scene::new(&frame, tracks, wheels, 1.0).with_target(Some(&track));
/// let twist = Facing.command(&scene);
/// assert!(twist.angular_rps > 0.7 && twist.linear_mps == 0.0);
/// assert_eq!(Facing.command(&scene.with_target(None)), Twist::STOP);
/// ```
pub trait Controller: Send {
    /// Returns the inputs that the controller itself uses. The command limiter, which checks obstacles for
    /// all controllers, declares its own.
    fn inputs(&self) -> Inputs {
        Inputs::NONE
    }

    /// Returns the velocity to command now: neither the speed nor the speed of the wheels by the
    /// turn alone is above the limit of the scene. What the wheels cannot drive of the two together
    /// is scaled down later, on the same arc.
    fn command(&mut self, scene: &Scene<'_>) -> Twist;

    /// Returns the distance at which the controller stops before the person, m, if it keeps one. A
    /// config is refused if the robot cannot stop within it.
    fn stand_off_m(&self) -> Option<f64> {
        None
    }

    /// Returns true if the controller keeps the person where a camera that looks ahead does not see them:
    /// beside the robot, or behind it.
    fn leaves_view(&self) -> bool {
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Reason; 25] = [
        Reason::Follow,
        Reason::Limited,
        Reason::Unsure,
        Reason::Search,
        Reason::Obstacle,
        Reason::Slow,
        Reason::Near,
        Reason::Unclear,
        Reason::Stopping,
        Reason::Blocked,
        Reason::TooClose,
        Reason::Unknown,
        Reason::Blind,
        Reason::Silent,
        Reason::Frozen,
        Reason::Odometry,
        Reason::CameraPose,
        Reason::Late,
        Reason::Contact,
        Reason::NoTarget,
        Reason::Settling,
        Reason::Stalled,
        Reason::NotFinite,
        Reason::Expired,
        Reason::Fault,
    ];

    #[test]
    fn a_command_drives_is_slower_or_stands() {
        let effects =
            [Reason::Limited, Reason::Near, Reason::Stopping, Reason::Blocked].map(Reason::effect);
        assert_eq!(effects, ["drives", "slower", "slower", "stands"]);
        for reason in ALL {
            assert_eq!(reason.effect() == "stands", !reason.moves(), "{reason}");
        }
    }

    fn command(linear_mps: f64, angular_rps: f64, reason: Reason) -> Command {
        let wheels = WheelSpeeds::STOP;
        let at = Stamp::default();
        Command::new(Twist::new(linear_mps, angular_rps), wheels, at, at, reason)
    }

    #[test]
    fn a_command_of_zero_stands_whatever_its_reason() {
        for reason in ALL {
            let still = command(0.004, -0.004, reason);
            assert_eq!(still.effect(), "stands", "{reason}");
            assert!(still.about().starts_with("stands"), "{}", still.about());
        }
        let near = command(0.0, 0.0, Reason::Near).about();
        assert_eq!(near, "stands: a person, or something that moves, is near");
        assert_eq!(command(0.1, 0.0, Reason::Near).effect(), "slower");
        assert_eq!(command(0.0, 0.1, Reason::Near).effect(), "slower");
        assert_eq!(command(0.1, 0.0, Reason::Near).about(), Reason::Near.about());
    }

    #[test]
    fn a_robot_that_turns_is_not_said_to_stand() {
        for reason in ALL {
            let turns = command(0.0, 0.46, reason).about();
            assert!(!turns.starts_with("stands"), "{turns}");
        }
        let close = command(0.0, -0.46, Reason::TooClose).about();
        assert!(close.starts_with("does not drive, may turn: a person"), "{close}");
    }

    #[test]
    fn a_speed_is_told_with_its_sign() {
        for told_mps in [-0.1, -0.015, 0.015] {
            assert_eq!(command(told_mps, 0.0, Reason::Near).told_twist().linear_mps, told_mps);
        }
        assert_eq!(command(-0.004, 0.0, Reason::Near).told_twist(), Twist::STOP);
    }

    #[test]
    fn the_robot_moves_for_nine_reasons_and_stands_for_the_others() {
        let (moves, stands) = ALL.split_at(9);
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
            fn command(&mut self, _: &Scene<'_>) -> Twist {
                Twist::STOP
            }
        }
        assert_eq!(Still.stand_off_m(), None);
    }
}
