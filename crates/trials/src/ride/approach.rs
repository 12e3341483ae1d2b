//! Approaches: whether the robot was moving when the approacher, or anything else, touched it.

use std::fmt;

use serde::Serialize;
use tagalong_core::Reason;
use tagalong_pipeline::FrameReport;
use tagalong_sim::{ApproachBy, Event, Scene, ScheduledFault};

use super::{Ride, Tick, Witness};
use crate::SimulatedFrame;

/// Time for which a ride continues after a contact, s, so that a robot that starts to move while it
/// is touched is noticed as well.
const AFTER_CONTACT_S: f64 = 1.0;
/// Time for which a ride continues after the approacher has stopped, s.
const AFTER_STAND_S: f64 = 1.0;
/// A ride ends after this multiple of the time in which the approacher reaches a robot at rest, ...
const LEAD_TIMES: f64 = 1.5;
/// ... plus this time, s.
const AFTER_LEAD_S: f64 = 1.0;
/// Time before a contact within which the approacher must have been in view to count as seen, s.
const SEEN_WITHIN_S: f64 = 1.0;

/// Rules by which an approach is scored.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ApproachJudge {
    /// Speed over ground of any point of the robot's body above which the robot counts as moving,
    /// m/s.
    pub moves_mps: f64,
    /// Speed of people in the separation distance, m/s (ISO 13855).
    pub human_mps: f64,
    /// Reaction time in the separation distance, s.
    pub reaction_s: f64,
    /// Deceleration of the robot in the separation distance, m/s².
    pub decel_mps2: f64,
    /// Remaining distance at the stop, as part of the separation distance, m.
    pub margin_m: f64,
}

impl Default for ApproachJudge {
    fn default() -> Self {
        Self { moves_mps: 0.02, human_mps: 1.6, reaction_s: 0.5, decel_mps2: 1.0, margin_m: 0.1 }
    }
}

/// Side of the robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Side {
    /// Within 45 degrees of the forward direction.
    Front,
    /// To the left.
    Left,
    /// To the right.
    Right,
    /// Within 45 degrees of the backward direction.
    Rear,
}

impl Side {
    /// All sides.
    pub const ALL: [Self; 4] = [Self::Front, Self::Left, Self::Right, Self::Rear];

    /// Returns the side for a direction in the robot frame, degrees, positive to the left.
    pub fn of_bearing(bearing_deg: f64) -> Self {
        let from_right = (bearing_deg + 135.0).rem_euclid(360.0);
        [Self::Right, Self::Front, Self::Left, Self::Rear][((from_right / 90.0) as usize).min(3)]
    }

    /// Returns the name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Front => "front",
            Self::Left => "left",
            Self::Right => "right",
            Self::Rear => "rear",
        }
    }
}

impl fmt::Display for Side {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Body that the robot touched.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Touched {
    /// The approacher.
    Approacher,
    /// Another person, for example the followed one.
    Person,
    /// Furniture or a wall.
    Thing,
}

impl Touched {
    /// Returns the name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Approacher => "approacher",
            Self::Person => "person",
            Self::Thing => "thing",
        }
    }
}

/// Contact of the robot.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Contact {
    /// Time since the start, s.
    pub at_s: f64,
    /// The body that was touched.
    pub with: Touched,
    /// True forward speed of the robot, m/s.
    pub speed_mps: f64,
    /// True turn rate of the robot, rad/s.
    pub turn_rate: f64,
    /// Direction of the approacher in the robot frame, degrees, positive to the left.
    pub bearing_deg: Option<f64>,
    /// True if the approacher was in the camera's view in the last second.
    pub camera_saw: bool,
    /// True if the approacher was in the laser scanner's view in the last second.
    pub laser_saw: bool,
    /// Reason of the command in force.
    pub reason: Option<&'static str>,
}

/// Result of an approach.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Approached {
    /// Seed of the scene.
    pub seed: u64,
    /// Kind of the approacher.
    pub by: ApproachBy,
    /// True if the approacher always turned to the robot.
    pub aims: bool,
    /// Speed of the approacher, m/s.
    pub approach_mps: f64,
    /// Time at which the approacher appeared, s.
    pub start_s: f64,
    /// Direction in the robot frame where the approacher appeared, degrees, positive to the left;
    /// `None` if the ride ended before.
    pub bearing_deg: Option<f64>,
    /// Delay from a command to its effect on the wheels, s.
    pub latency_s: f64,
    /// Height of the camera, m.
    pub camera_height_m: f64,
    /// True if the robot has a laser scanner.
    pub laser: bool,
    /// Injected faults.
    pub faults: Vec<ScheduledFault>,
    /// Length of the ride, s.
    pub time_s: f64,
    /// True if the robot moved at any time between the appearance of the approacher and the end.
    pub moved: bool,
    /// Reason of the command in force when the approacher appeared.
    pub reason: Option<&'static str>,
    /// First contact while the robot moved.
    pub contact: Option<Contact>,
    /// First contact while the robot was at rest.
    pub touched: Option<Contact>,
    /// Minimum free distance to the approacher while the robot moved, m.
    pub room_m: Option<f64>,
    /// True if the approacher came within the separation distance of the moving robot.
    pub came_near: bool,
    /// Time from then until the robot had stopped, s; `None` if it did not stop.
    pub stopping_s: Option<f64>,
}

impl Approached {
    /// Returns the side from which the approacher came.
    pub fn side(&self) -> Option<Side> {
        self.bearing_deg.map(Side::of_bearing)
    }
}

impl ApproachJudge {
    /// Scores a ride in a scene with an approach; `None` for a scene without one.
    pub fn judge(&self, scene: &Scene, ride: &Ride) -> Option<Approached> {
        let settings = scene.approach.as_ref()?;
        let first = ride.ticks.iter().find_map(|tick| Some((tick, tick.approach?)));
        let coming = ride.ticks.iter().filter(|tick| tick.approach.is_some());
        let moving: Vec<&Tick> = coming.filter(|tick| self.moves(tick)).collect();
        let near = self.near(&ride.ticks);
        Some(Approached {
            seed: ride.seed,
            by: settings.by,
            aims: settings.aims,
            approach_mps: settings.speed_mps,
            start_s: settings.start_s,
            bearing_deg: first.map(|(_, state)| state.bearing_rad.to_degrees()),
            latency_s: scene.robot.latency_s,
            camera_height_m: scene.camera.height_m,
            laser: scene.laser.is_some(),
            faults: scene.scheduled_faults(),
            time_s: ride.ticks.last().map_or(0.0, |tick| tick.at_s),
            moved: !moving.is_empty(),
            reason: first.and_then(|(tick, _)| tick.reason.map(Reason::name)),
            contact: self.first_contact(ride, true),
            touched: self.first_contact(ride, false),
            room_m: least_room(moving.into_iter()),
            came_near: near.is_some(),
            stopping_s: near.and_then(|at| self.stopping_s(&ride.ticks[at..])),
        })
    }

    /// Returns the first contact while the robot moves, or while it is at rest.
    fn first_contact(&self, ride: &Ride, moves: bool) -> Option<Contact> {
        let mut ticks = ride.ticks.iter().filter(|tick| self.moves(tick) == moves);
        ticks.find_map(|tick| Some(contact_at(ride, tick, touched(tick)?)))
    }

    /// Returns true if the robot moves, forward, backward or by turning.
    pub fn moves(&self, tick: &Tick) -> bool {
        tick.body_mps() > self.moves_mps
    }

    /// Returns the distance within which a robot at this speed has to stop for a person, m: S =
    /// (v_h + v_r) (t_r + t_b) + C of ISO 13855, with the braking time t_b = v_r / a.
    pub fn separation_m(&self, robot_mps: f64) -> f64 {
        let stop_s = self.reaction_s + robot_mps.abs() / self.decel_mps2;
        (self.human_mps + robot_mps.abs()) * stop_s + self.margin_m
    }

    /// Returns the first step at which the robot moves with the approacher within the separation
    /// distance.
    fn near(&self, ticks: &[Tick]) -> Option<usize> {
        ticks.iter().position(|tick| {
            let gap_m = tick.approach.map_or(f64::INFINITY, |state| state.gap_m);
            self.moves(tick) && gap_m <= self.separation_m(tick.speed_mps)
        })
    }

    /// Returns the time from the first of some steps until the robot has stopped, s.
    fn stopping_s(&self, ticks: &[Tick]) -> Option<f64> {
        let stands = ticks.iter().find(|tick| !self.moves(tick))?;
        Some(stands.at_s - ticks.first()?.at_s)
    }
}

/// Returns the body that the robot touches at a step, if any.
fn touched(tick: &Tick) -> Option<Touched> {
    if tick.approach.is_some_and(|state| state.gap_m <= 0.0) {
        return Some(Touched::Approacher);
    }
    if tick.clearance.people_m <= 0.0 {
        return Some(Touched::Person);
    }
    (tick.clearance.things_m <= 0.0).then_some(Touched::Thing)
}

fn contact_at(ride: &Ride, tick: &Tick, with: Touched) -> Contact {
    let recent =
        ride.in_view.iter().filter(|(at_s, _)| (0.0..=SEEN_WITHIN_S).contains(&(tick.at_s - at_s)));
    Contact {
        at_s: tick.at_s,
        with,
        speed_mps: tick.speed_mps,
        turn_rate: tick.turn_rate,
        bearing_deg: tick.approach.map(|state| state.bearing_rad.to_degrees()),
        camera_saw: recent.clone().any(|(_, seen)| seen.camera),
        laser_saw: recent.clone().any(|(_, seen)| seen.laser),
        reason: tick.reason.map(Reason::name),
    }
}

fn least_room<'a>(ticks: impl Iterator<Item = &'a Tick>) -> Option<f64> {
    ticks.filter_map(|tick| Some(tick.approach?.gap_m)).min_by(f64::total_cmp)
}

/// Observer that ends a ride once its approach is over.
pub struct ApproachWatch<'a> {
    witness: &'a mut dyn Witness,
    ends_s: f64,
    over: bool,
}

impl<'a> ApproachWatch<'a> {
    /// Observes a ride in a scene, and passes everything on to another observer.
    pub fn new(scene: &Scene, witness: &'a mut dyn Witness) -> Self {
        let ends_s = scene.approach.as_ref().map_or(f64::INFINITY, |approach| {
            let lead_s = approach.arrives_s() - approach.start_s;
            approach.start_s + LEAD_TIMES * lead_s + AFTER_LEAD_S
        });
        Self { witness, ends_s, over: false }
    }
}

impl Witness for ApproachWatch<'_> {
    fn event(&mut self, event: &Event) {
        self.witness.event(event);
    }

    fn tick(&mut self, tick: &Tick) {
        self.witness.tick(tick);
        if touched(tick).is_some() {
            self.ends_s = self.ends_s.min(tick.at_s + AFTER_CONTACT_S);
        }
        if tick.approach.is_some_and(|state| state.speed_mps == 0.0) {
            self.ends_s = self.ends_s.min(tick.at_s + AFTER_STAND_S);
        }
        self.over |= tick.at_s >= self.ends_s;
    }

    fn frame(&mut self, simulated: &SimulatedFrame, report: &FrameReport) {
        self.witness.frame(simulated, report);
    }

    fn goes_on(&self) -> bool {
        !self.over && self.witness.goes_on()
    }

    fn uses_images(&self) -> bool {
        self.witness.uses_images()
    }
}

#[cfg(test)]
mod tests {
    use tagalong_sim::{ApproachInView, ApproachSettings, ApproachState, Clearance};

    use super::*;

    const GAPS_M: [f64; 6] = [3.0, 1.5, 0.8, 0.3, -0.01, -0.02];

    /// One step a second, with these speeds of the robot and these gaps.
    fn ride(speeds: [f64; 6], turn_rate: f64) -> Ride {
        let steps = (0..).zip(speeds).zip(GAPS_M);
        let ticks = steps.map(|((at, speed_mps), gap_m)| Tick {
            at_s: f64::from(at),
            speed_mps,
            turn_rate,
            clearance: Clearance { people_m: gap_m, things_m: 4.0 },
            crowd: None,
            approach: Some(ApproachState { gap_m, bearing_rad: -1.6, speed_mps: 1.0 }),
            reason: Some(Reason::Follow),
            effect: "drives",
        });
        Ride {
            seed: 1,
            ticks: ticks.collect(),
            in_view: vec![
                (2.9, ApproachInView { camera: true, laser: false }),
                (3.2, ApproachInView { camera: false, laser: true }),
            ],
            ..Ride::default()
        }
    }

    fn judged(speeds: [f64; 6], turn_rate: f64) -> Approached {
        let scene = Scene { approach: Some(ApproachSettings::default()), ..Scene::default() };
        ApproachJudge::default().judge(&scene, &ride(speeds, turn_rate)).unwrap()
    }

    #[test]
    fn a_robot_that_drives_on_has_a_contact_while_it_moves() {
        let driven = judged([0.5; 6], 0.0);
        let contact = driven.contact.unwrap();
        assert_eq!((contact.at_s, contact.with), (4.0, Touched::Approacher));
        assert!(contact.laser_saw && !contact.camera_saw, "the camera saw it too long ago");
        assert_eq!((driven.touched, driven.side()), (None, Some(Side::Right)));
        assert_eq!((driven.room_m, driven.stopping_s), (Some(-0.02), None));
        assert!(driven.moved && driven.came_near);
    }

    #[test]
    fn a_robot_that_stood_in_time_has_none() {
        let stood = judged([0.5, 0.5, 0.2, 0.0, 0.0, 0.0], 0.0);
        assert_eq!((stood.contact, stood.touched.map(|touch| touch.at_s)), (None, Some(4.0)));
        assert_eq!((stood.room_m, stood.stopping_s), (Some(0.8), Some(2.0)));
    }

    #[test]
    fn one_that_begins_to_move_while_it_is_touched_has_one() {
        let late = judged([0.0, 0.0, 0.0, 0.0, 0.0, 0.03], 0.0);
        assert_eq!((late.contact.unwrap().at_s, late.touched.unwrap().at_s), (5.0, 4.0));
    }

    #[test]
    fn a_turn_is_motion_from_two_centimetres_a_second_at_the_rim_on() {
        assert!(judged([0.0; 6], 0.07).contact.is_none());
        assert!(judged([0.0; 6], -0.09).contact.is_some());
    }

    #[test]
    fn a_scene_without_an_approach_is_not_judged() {
        assert_eq!(ApproachJudge::default().judge(&Scene::default(), &ride([0.0; 6], 0.0)), None);
    }

    #[test]
    fn sides_are_quarters_around_the_robot() {
        let sides = [-44.0, 46.0, 134.0, 136.0, -136.0, -134.0, -46.0, 359.0].map(Side::of_bearing);
        let names = sides.map(Side::name);
        assert_eq!(names, ["front", "left", "left", "rear", "rear", "right", "right", "front"]);
    }

    #[test]
    fn the_separation_is_that_of_the_standard() {
        let judge = ApproachJudge::default();
        assert!((judge.separation_m(0.0) - 0.9).abs() < 1e-9);
        assert!((judge.separation_m(-0.9) - (2.5 * 1.4 + 0.1)).abs() < 1e-9);
    }
}
