//! Speed at which a path is free: the area that the robot sweeps until it is at rest, against
//! static obstacles and against people that may approach meanwhile.
//!
//! For a robot of speed v that reacts after t and brakes with a, the stopping distance is
//! `L = v t + v²/2a` and the stopping time `T = t + v/a`. A static obstacle is clear if the robot
//! stops before its footprint, swept along the path, comes nearer than the clearance. In the
//! stopping time, and until the wheels are at rest after it, a person may come nearer by
//! `reach(T)`; with full speed u from the start this is the distance of ISO 13855,
//! `S = (u + v) t + u v/a + v²/2a + C`, where C is `protective_m`. A turn in place brings the robot
//! no nearer to a person; the person is expected to keep their present speed.

use nalgebra::Point2;
use tagalong_core::Reason;

use super::CollisionMonitorSettings;
use super::footprint::{Footprint, Path};

/// Steps of the search for the largest speed: to a thousandth of the asked one.
const HALVINGS: u32 = 10;
/// An obstacle that is nearer than the clearance already may come nearer by this much, m: the robot
/// may drive along it, and turn away.
const SLACK_M: f64 = 0.02;
/// Distance, m, below which something may touch the robot: then nothing moves.
const TOUCH_M: f64 = 0.03;
/// Angle that is left before a thing when a turn in place stops, rad.
const TURN_STOP_RAD: f64 = 0.05;

/// Place that may not be driven over.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Hazard {
    /// Position in the robot frame, m.
    pub(crate) at: Point2<f64>,
    /// Weight, in points of the depth image.
    pub(crate) points: u32,
    /// Motion that is expected before the robot stands.
    pub(crate) kind: HazardKind,
}

/// Motion that is expected of a hazard.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum HazardKind {
    /// It stays where it is.
    Still,
    /// It comes nearer at this speed now, m/s, and may speed up to that of a person.
    Moves(f64),
    /// It is the followed person, approaching at this speed, m/s.
    Followed(f64),
}

/// Reaction and deceleration along a path: m and m/s, or rad and rad/s for a turn in place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Braking {
    /// Time from an image to wheels that move accordingly, s.
    pub(crate) reaction_s: f64,
    /// Delay of the stop by the rise of the deceleration, s.
    pub(crate) rise_s: f64,
    /// Deceleration.
    pub(crate) decel: f64,
    /// Time from one image to the next, s: what moves is that much nearer before it is seen again.
    pub(crate) between_s: f64,
    /// Time from the end of the braking until the wheels stand, s: people come nearer meanwhile.
    pub(crate) settle_s: f64,
}

impl Braking {
    /// Returns the way until the robot stands.
    fn way(&self, speed: f64, delay_s: f64) -> f64 {
        speed * delay_s + speed * speed / (2.0 * self.decel)
    }

    /// Returns the time until the robot stands, in which people come nearer, s: from before the next
    /// image, because a person is in this one or the next.
    fn time_s(&self, speed: f64, delay_s: f64) -> f64 {
        self.between_s + delay_s + speed / self.decel + self.settle_s
    }

    /// Returns the largest speed from which the robot stops within this way: the positive root of
    /// v t + v² / 2 a = s.
    pub(crate) fn speed_within(&self, way: f64, delay_s: f64) -> f64 {
        let root = (delay_s * delay_s + 2.0 * way.max(0.0) / self.decel).sqrt();
        self.decel * (root - delay_s)
    }

    /// Returns the farthest way that matters at a speed.
    pub(super) fn farthest(&self, speed: f64) -> f64 {
        self.way(speed, self.reaction_s + self.rise_s)
    }
}

/// Place that limits the speed, with its distance from the outline of the robot and those below which
/// the robot is slower, and does not move along its path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LimitingPlace {
    /// Place in the robot frame, m.
    pub(crate) at: Point2<f64>,
    /// Distance of it, m.
    pub(crate) distance_m: f64,
    /// Distance below which the robot is slower, m.
    pub(crate) slower_m: f64,
    /// Distance below which it does not move, m.
    pub(crate) stop_m: f64,
}

/// Largest speeds that hazards allow on a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Allowance {
    /// Place that limits the speed; `None` where no place does.
    pub(crate) by: Option<LimitingPlace>,
    /// Largest speed from which the robot stops within the limit of the jerk.
    pub(crate) gentle: f64,
    /// Largest speed from which it stops at all.
    pub(crate) most: f64,
    /// Reason for driving slower by it.
    pub(crate) slower: Reason,
    /// Reason for standing by it.
    pub(crate) stops: Reason,
}

impl Allowance {
    /// No limit.
    pub(crate) const FREE: Self = Self {
        by: None,
        gentle: f64::INFINITY,
        most: f64::INFINITY,
        slower: Reason::Obstacle,
        stops: Reason::Blocked,
    };

    /// Returns the tighter of two.
    pub(crate) fn and(self, other: Self) -> Self {
        let tighter = if other.most < self.most { other } else { self };
        Self { gentle: self.gentle.min(other.gentle), ..tighter }
    }
}

/// Returns the distance, m, by which a person approaching at `closing_mps` may be nearer after
/// `time_s`: they speed up to `people_mps` by `people_accel_mps2`.
pub(crate) fn reach_m(settings: &CollisionMonitorSettings, closing_mps: f64, time_s: f64) -> f64 {
    let fastest = settings.people_mps;
    let speed = closing_mps.clamp(-fastest, fastest);
    let speeds_up_s = (fastest - speed) / settings.people_accel_mps2;
    let until_s = time_s.min(speeds_up_s);
    let way = speed * until_s + 0.5 * settings.people_accel_mps2 * until_s * until_s;
    (way + fastest * (time_s - until_s)).max(0.0)
}

/// Returns the largest speeds along a path, up to `speed`, that the hazards allow.
pub(crate) fn allowance(
    settings: &CollisionMonitorSettings,
    footprint: &Footprint,
    hazards: &[Hazard],
    path: Path,
    speed: f64,
    braking: &Braking,
) -> Allowance {
    let mut sweep = Sweep::new(settings, footprint, path, speed, *braking);
    let mut limits = Vec::new();
    for hazard in hazards {
        if let Some(limit) = sweep.limit(hazard) {
            limits.push(limit);
        }
    }
    let most = tightest(settings, &mut limits, |limit| limit.most);
    let gentle = tightest(settings, &mut limits, |limit| limit.gentle);
    let Some(most) = most else { return Allowance::FREE };
    Allowance { gentle: gentle.map_or(f64::INFINITY, |limit| limit.gentle), ..most.allowance() }
}

/// Limit of one hazard.
#[derive(Clone, Copy, Debug)]
struct Limit {
    gentle: f64,
    most: f64,
    points: u32,
    is_person: bool,
    place: LimitingPlace,
}

impl Limit {
    fn allowance(self) -> Allowance {
        let by = Some(self.place);
        let mut allowance =
            Allowance { by, gentle: self.gentle, most: self.most, ..Allowance::FREE };
        if self.is_person {
            allowance.slower = Reason::Near;
            allowance.stops = Reason::TooClose;
        }
        allowance
    }
}

/// Returns the limit up to which enough points lie. Single points may be noise, and points accumulate
/// over the path: few of them at each place may still be one slanted obstacle.
fn tightest(
    settings: &CollisionMonitorSettings,
    limits: &mut [Limit],
    speed: impl Fn(&Limit) -> f64,
) -> Option<Limit> {
    limits.sort_by(|a, b| speed(a).total_cmp(&speed(b)));
    let mut points = 0_u32;
    for limit in limits {
        points = points.saturating_add(limit.points);
        if points >= settings.min_points.max(1) {
            return Some(*limit);
        }
    }
    None
}

/// Poses of the robot along a path until it stands.
struct Sweep<'a> {
    settings: &'a CollisionMonitorSettings,
    footprint: &'a Footprint,
    path: Path,
    speed: f64,
    braking: Braking,
    step: f64,
    poses: Vec<nalgebra::Isometry2<f64>>,
    /// Distance of the current hazard up to each pose: the least so far, m.
    nearest: Vec<f64>,
}

impl<'a> Sweep<'a> {
    fn new(
        settings: &'a CollisionMonitorSettings,
        footprint: &'a Footprint,
        path: Path,
        speed: f64,
        braking: Braking,
    ) -> Self {
        let step = path.step(footprint);
        let stop = match path {
            Path::Arc { .. } => settings.stop_m,
            Path::Turn { .. } => TURN_STOP_RAD,
        };
        let count = ((braking.farthest(speed) + stop) / step).ceil() as usize + 1;
        let poses = (0..=count).map(|at| path.pose(at as f64 * step)).collect();
        Self { settings, footprint, path, speed, braking, step, poses, nearest: Vec::new() }
    }

    /// Returns the limit of a hazard; `None` if it allows the speed of the sweep.
    fn limit(&mut self, hazard: &Hazard) -> Option<Limit> {
        let margin_m = self.margin_m(hazard);
        if self.is_far(hazard, margin_m) {
            return None;
        }
        self.measure(&hazard.at);
        let delays = [self.braking.reaction_s, self.braking.reaction_s + self.braking.rise_s];
        let [most, gentle] = delays.map(|delay_s| match hazard.kind {
            HazardKind::Still => self.speed_before(delay_s),
            HazardKind::Moves(_) | HazardKind::Followed(_) => {
                self.speed_beside(delay_s, |time_s| self.margin_within(hazard, time_s))
            }
        });
        (gentle < self.speed).then(|| Limit {
            gentle,
            most,
            points: hazard.points,
            is_person: hazard.kind != HazardKind::Still,
            place: self.limiting_place(hazard),
        })
    }

    /// Returns the place of the hazard, the last that was measured, for the words of the command.
    fn limiting_place(&self, hazard: &Hazard) -> LimitingPlace {
        let Braking { reaction_s, rise_s, .. } = self.braking;
        let delay_s = reaction_s + rise_s;
        let way_m = match self.path {
            Path::Arc { .. } => self.braking.way(self.speed, delay_s),
            Path::Turn { .. } => 0.0,
        };
        let stop_m = match (hazard.kind, self.path) {
            (HazardKind::Still, Path::Arc { .. }) => self.settings.stop_m,
            (HazardKind::Still, Path::Turn { .. }) => 0.5 * self.settings.side_m,
            _ => self.margin_within(hazard, self.braking.time_s(0.0, reaction_s)),
        };
        let slower_m = match hazard.kind {
            HazardKind::Still => way_m + stop_m,
            _ => way_m + self.margin_within(hazard, self.braking.time_s(self.speed, delay_s)),
        };
        let distance_m = self.nearest.first().copied().unwrap_or(f64::INFINITY);
        LimitingPlace { at: hazard.at, distance_m, slower_m, stop_m }
    }

    /// Returns the distance to keep from a hazard that may come nearer for a time, m.
    fn margin_within(&self, hazard: &Hazard, time_s: f64) -> f64 {
        match hazard.kind {
            HazardKind::Still => self.settings.stop_m.max(self.settings.side_m),
            HazardKind::Moves(closing) => {
                self.comes_m(closing, time_s) + self.settings.protective_m
            }
            HazardKind::Followed(closing) => {
                closing.max(0.0) * time_s + self.settings.followed_stop_m
            }
        }
    }

    /// Returns the distance, m, by which a person may be nearer after `time_s`.
    fn comes_m(&self, closing_mps: f64, time_s: f64) -> f64 {
        match self.path {
            Path::Arc { .. } => reach_m(self.settings, closing_mps, time_s),
            // The robot stays where it is: only a person on the way already meets it while it
            // turns. Otherwise nobody could stand beside a robot that looks for the person it lost.
            Path::Turn { .. } => closing_mps.clamp(0.0, self.settings.people_mps) * time_s,
        }
    }

    /// Returns the largest distance that may matter between the swept area and the hazard, m.
    fn margin_m(&self, hazard: &Hazard) -> f64 {
        let time_s = self.braking.time_s(self.speed, self.braking.reaction_s + self.braking.rise_s);
        self.margin_within(hazard, time_s)
    }

    /// Returns true if no pose comes near enough, without looking at each.
    fn is_far(&self, hazard: &Hazard, margin_m: f64) -> bool {
        let travel_m = match self.path {
            Path::Arc { .. } => self.braking.farthest(self.speed) + self.settings.stop_m,
            Path::Turn { .. } => 0.0,
        };
        hazard.at.coords.norm() > self.footprint.radius_m() + travel_m + margin_m
    }

    /// Fills in the distances of a place up to each pose.
    fn measure(&mut self, at: &Point2<f64>) {
        self.nearest.clear();
        let mut least = f64::INFINITY;
        for pose in &self.poses {
            if least > 0.0 {
                least = least.min(self.footprint.distance_m(&pose.inverse_transform_point(at)));
            }
            self.nearest.push(least);
        }
    }

    /// Returns the least distance up to a way along the path, m.
    fn nearest_within(&self, way: f64) -> f64 {
        let place = way / self.step;
        let before = (place as usize).min(self.nearest.len() - 1);
        let after = (before + 1).min(self.nearest.len() - 1);
        let part = (place - before as f64).clamp(0.0, 1.0);
        self.nearest[before] + part * (self.nearest[after] - self.nearest[before])
    }

    /// Returns the largest speed from which the robot stops before a thing that stands.
    fn speed_before(&self, delay_s: f64) -> f64 {
        let clearance_m = match self.path {
            Path::Arc { .. } => self.settings.side_m,
            // A turn in place moves the corners alone, and by what they leave out no robot is wider.
            Path::Turn { .. } => 0.5 * self.settings.side_m,
        };
        let first = self.nearest[0];
        if first < TOUCH_M {
            return 0.0;
        }
        // A thing that is nearer already may stay as near.
        let clearance_m = clearance_m.min((first - SLACK_M).max(0.0));
        let Some(hit) =
            self.nearest.iter().position(|nearest| *nearest < clearance_m || *nearest <= 0.0)
        else {
            return f64::INFINITY;
        };
        let way = match hit.checked_sub(1) {
            None => 0.0,
            Some(before) => {
                let fall = (self.nearest[before] - self.nearest[hit]).max(1e-9);
                let part = ((self.nearest[before] - clearance_m) / fall).clamp(0.0, 1.0);
                (before as f64 + part) * self.step
            }
        };
        let left = match self.path {
            Path::Arc { .. } => (self.settings.stop_m - self.settings.side_m).max(0.0),
            Path::Turn { .. } => TURN_STOP_RAD,
        };
        self.braking.speed_within(way - left, delay_s)
    }

    /// Returns the largest speed, up to that of the sweep, at which a hazard that may come nearer by
    /// `margin_m` in a time is not reached before the robot stands.
    fn speed_beside(&self, delay_s: f64, margin_m: impl Fn(f64) -> f64) -> f64 {
        if self.is_free_at(self.speed, delay_s, &margin_m) {
            return f64::INFINITY;
        }
        if !self.is_free_at(0.0, delay_s, &margin_m) {
            return 0.0;
        }
        let mut free = 0.0;
        let mut taken = self.speed;
        for _ in 0..HALVINGS {
            let middle = 0.5 * (free + taken);
            if self.is_free_at(middle, delay_s, &margin_m) {
                free = middle;
            } else {
                taken = middle;
            }
        }
        free
    }

    /// Returns true if a hazard that may come nearer by `margin_m` in a time is not reached from this
    /// speed.
    fn is_free_at(&self, speed: f64, delay_s: f64, margin_m: impl Fn(f64) -> f64) -> bool {
        let nearest_m = self.nearest_within(self.braking.way(speed, delay_s));
        let time_s = self.braking.time_s(speed, delay_s);
        nearest_m >= margin_m(time_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BRAKING: Braking =
        Braking { reaction_s: 0.5, rise_s: 0.1, decel: 1.0, between_s: 0.0, settle_s: 0.0 };
    const AHEAD: Path = Path::Arc { curvature: 0.0, backwards: false };

    fn octagon() -> Footprint {
        Footprint::new(&crate::RobotSettings::default().footprint)
    }

    fn allowed(hazard: Hazard, path: Path, speed: f64) -> Allowance {
        let settings = CollisionMonitorSettings::default();
        allowance(&settings, &octagon(), &[hazard], path, speed, &BRAKING)
    }

    fn still(x: f64, y: f64) -> Hazard {
        Hazard { at: Point2::new(x, y), points: 9, kind: HazardKind::Still }
    }

    fn moving(x: f64, y: f64, closing: f64) -> Hazard {
        Hazard { kind: HazardKind::Moves(closing), ..still(x, y) }
    }

    #[test]
    fn before_a_thing_the_robot_stops_at_the_distance_that_is_set() {
        let settings = CollisionMonitorSettings::default();
        for x in [0.8, 1.1, 1.4] {
            let Allowance { most, stops, .. } = allowed(still(x, 0.0), AHEAD, 0.9);
            let way = most * 0.5 + 0.5 * most * most;
            let gap_m = x - octagon().front_m() - way;
            assert!((gap_m - settings.stop_m).abs() < 0.01, "{x} {most} {gap_m}");
            assert_eq!(stops, Reason::Blocked);
        }
        assert_eq!(allowed(still(2.2, 0.0), AHEAD, 0.9), Allowance::FREE);
        assert_eq!(allowed(still(0.6, 0.0), AHEAD, 0.9).most, 0.0);
    }

    #[test]
    fn the_place_that_limits_the_speed_is_nearer_than_its_limit() {
        for hazard in
            [still(0.55, 0.0), still(1.1, 0.0), moving(1.1, 0.0, 1.6), moving(2.2, 0.0, 1.6)]
        {
            let Allowance { by, most, .. } = allowed(hazard, AHEAD, 0.9);
            let place = by.expect("a place limits the speed");
            let gap_m = hazard.at.x - octagon().front_m();
            assert_eq!(place.at, hazard.at);
            assert!((place.distance_m - gap_m).abs() < 1e-9, "{place:?} {gap_m}");
            assert_eq!(place.distance_m < place.stop_m, most == 0.0, "{place:?} {most}");
            assert!(place.distance_m < place.slower_m, "{place:?}");
        }
        assert_eq!(allowed(still(2.2, 0.0), AHEAD, 0.9).by, None);
    }

    #[test]
    fn what_is_beside_the_way_is_free_and_what_a_corner_sweeps_is_not() {
        assert_eq!(allowed(still(1.0, 0.36), AHEAD, 0.9), Allowance::FREE);
        assert!(allowed(still(1.0, 0.3), AHEAD, 0.9).most < 0.9);
        // A bar 0.6 m long, turned about its end: the tail sweeps the place beside it.
        let bar = Footprint::new(&[[0.1, 0.1], [0.1, -0.1], [-0.5, -0.1], [-0.5, 0.1]]);
        let settings = CollisionMonitorSettings::default();
        let beside = [still(-0.35, -0.35)];
        let [left, right] = [true, false].map(|left| {
            allowance(&settings, &bar, &beside, Path::Turn { left }, 1.5, &BRAKING).most
        });
        assert!(left < 1.0, "the tail turns to the right: {left}");
        assert_eq!(right, f64::INFINITY);
    }

    #[test]
    fn what_touches_the_robot_holds_it_still() {
        for path in
            [AHEAD, Path::Turn { left: true }, Path::Arc { curvature: 0.0, backwards: true }]
        {
            assert_eq!(allowed(still(-0.27, 0.0), path, 0.4).most, 0.0, "{path:?}");
        }
    }

    #[test]
    fn reverse_is_looked_along_backwards() {
        let back = Path::Arc { curvature: 0.0, backwards: true };
        assert_eq!(allowed(still(-0.6, 0.0), back, 0.4).most, 0.0);
        assert_eq!(allowed(still(0.6, 0.0), back, 0.4), Allowance::FREE);
    }

    #[test]
    fn along_a_thing_that_is_near_already_the_robot_may_drive_and_turn() {
        assert_eq!(allowed(still(0.0, 0.3), AHEAD, 0.5), Allowance::FREE);
        assert_eq!(allowed(still(0.0, 0.3), Path::Turn { left: true }, 1.0), Allowance::FREE);
        assert!(allowed(still(0.28, 0.0), AHEAD, 0.5).most < 0.01);
    }

    /// ISO 13855 with the robot's own way: S = u T + v t + v²/2a + C.
    #[test]
    fn before_a_person_who_comes_the_distance_is_that_of_the_standard() {
        let settings = CollisionMonitorSettings::default();
        for x in [1.6, 2.2, 3.0] {
            let Allowance { most, stops, .. } = allowed(moving(x, 0.0, 1.6), AHEAD, 0.9);
            let time_s = 0.5 + most;
            let separation_m =
                1.6 * time_s + 0.5 * most + 0.5 * most * most + settings.protective_m;
            let gap_m = x - octagon().front_m();
            assert!(most > 0.0 && (separation_m - gap_m).abs() < 0.02, "{x} {most} {separation_m}");
            assert_eq!(stops, Reason::TooClose);
        }
        assert_eq!(allowed(moving(1.1, 0.0, 1.6), AHEAD, 0.9).most, 0.0);
        assert_eq!(allowed(moving(1.1, 0.0, 1.6), Path::Turn { left: true }, 0.5).most, 0.0);
    }

    #[test]
    fn before_a_person_the_wheels_have_time_to_come_to_rest() {
        let settings = CollisionMonitorSettings::default();
        let [[slow, fast], [to_thing, to_thing_at_once]] = [moving(2.2, 0.0, 1.6), still(1.2, 0.0)]
            .map(|hazard| {
                [0.25, 0.0].map(|settle_s| {
                    let braking = Braking { settle_s, ..BRAKING };
                    allowance(&settings, &octagon(), &[hazard], AHEAD, 0.9, &braking).most
                })
            });
        let separation_m = 1.6 * (0.75 + slow) + 0.5 * slow + 0.5 * slow * slow;
        let gap_m = 2.2 - octagon().front_m() - settings.protective_m;
        assert!((separation_m - gap_m).abs() < 0.02, "{slow} {separation_m} {gap_m}");
        assert!(slow < fast - 0.1, "{slow} {fast}");
        // Things that stand come no nearer meanwhile.
        assert_eq!(to_thing, to_thing_at_once);
    }

    #[test]
    fn a_person_who_stands_or_leaves_needs_less_room_than_one_who_comes() {
        fn most(closing: f64) -> f64 {
            allowed(moving(1.5, 0.0, closing), AHEAD, 0.9).most
        }

        assert!(most(1.6) < most(0.0) && most(0.0) < most(-0.8), "{} {}", most(0.0), most(-0.8));
        let settings = CollisionMonitorSettings::default();
        assert!((reach_m(&settings, 0.0, 0.5) - 0.25).abs() < 1e-12);
        assert!((reach_m(&settings, 1.6, 0.5) - 0.8).abs() < 1e-12);
        assert!((reach_m(&settings, 9.0, 0.5) - 0.8).abs() < 1e-12);
        assert_eq!(reach_m(&settings, -1.6, 0.5), 0.0);
    }

    #[test]
    fn beside_a_person_who_stands_the_robot_turns_and_does_not_drive() {
        let turn = Path::Turn { left: true };
        let gap_m = 0.65 - octagon().front_m();
        assert!(gap_m > CollisionMonitorSettings::default().protective_m);
        assert_eq!(allowed(moving(0.65, 0.0, 0.0), AHEAD, 0.9).most, 0.0);
        assert_eq!(allowed(moving(0.65, 0.0, 0.0), turn, 0.5), Allowance::FREE);
        // One that comes, or is nearer than the protective distance, stops the turn, too.
        assert_eq!(allowed(moving(0.65, 0.0, 1.2), turn, 0.5).most, 0.0);
        assert_eq!(allowed(moving(0.4, 0.0, 0.0), turn, 0.5).most, 0.0);
    }

    #[test]
    fn before_the_followed_person_a_last_distance_is_kept() {
        fn followed(x: f64, closing: f64) -> f64 {
            let kind = HazardKind::Followed(closing);
            allowed(Hazard { kind, ..still(x, 0.0) }, AHEAD, 0.9).most
        }

        assert_eq!(followed(0.5, 0.0), 0.0, "0.25 m before the front");
        assert!(followed(1.0, 0.0) > 0.3, "{}", followed(1.0, 0.0));
        assert!(followed(1.0, 1.0) < followed(1.0, 0.0));
        assert_eq!(followed(2.0, 0.0), f64::INFINITY);
    }

    #[test]
    fn single_points_are_noise_and_add_up_along_the_way() {
        let settings = CollisionMonitorSettings::default();
        let cases = [vec![(0.9, 5)], vec![(0.9, 6)], vec![(0.9, 3), (1.2, 3)], vec![(1.2, 6)]];
        let [few, enough, both, together] = cases.map(|points| {
            let hazards: Vec<Hazard> =
                points.into_iter().map(|(x, points)| Hazard { points, ..still(x, 0.0) }).collect();
            allowance(&settings, &octagon(), &hazards, AHEAD, 0.9, &BRAKING).most
        });
        assert_eq!(few, f64::INFINITY);
        assert!(enough < 0.5, "{enough}");
        assert_eq!(both, together, "both together");
    }
}
