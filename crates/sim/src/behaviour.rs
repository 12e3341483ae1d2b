//! Behaviour of people: they walk along their paths and avoid each other and furniture, and some of
//! them perform tricks when the robot cannot see them.

use crate::obstacle::Obstacle;
use nalgebra::{Point2, Rotation2, Vector2};

use crate::body::{Stance, feet_ahead_m};
use crate::gait::Gait;
use crate::material::Material;
use crate::person::{Extra, Outfit, Person};
use crate::posture::Posture;
use crate::scene::{AtEnd, PersonSettings, Trick};

mod react;

/// Maximum acceleration of a walker, m/s².
const MAX_ACCELERATION: f64 = 1.2;
/// Maximum turn rate of a body, rad/s.
const MAX_TURN: f64 = 2.6;
/// A point of the path is reached at this distance, m.
const REACHED_M: f64 = 0.25;
/// Distance from a waypoint, m, at which a walker skips it if an obstacle blocks the way.
const NEAR_ENOUGH_M: f64 = 1.0;
/// Strength, m/s², and range, m, of the repulsion between people (Helbing & Molnár 1995, with the
/// range of indoor crowds).
const PUSH: f64 = 2.2;
const PUSH_REACH_M: f64 = 0.45;
/// Range of the repulsion from obstacles, m: people pass close to door jambs.
const THING_REACH_M: f64 = 0.18;
/// Detour around an obstacle. A walker is blocked if the progress, as a fraction of the speed, is
/// this low for this time, s, this close to the surface of the obstacle, m. The walker then goes
/// around it for some time, s, at this angle to the side, rad.
const HEADWAY: f64 = 0.3;
const HELD_UP_S: f64 = 0.6;
const HELD_UP_M: f64 = 0.7;
const ROUND_S: f64 = 2.0;
const ROUND_RAD: f64 = 1.4;
/// Bending of a person with the posture [`Posture::Bending`]: in the second half of each period, s,
/// by this angle, rad, which takes some time, s.
const BEND_EVERY_S: f64 = 6.0;
const BEND_RAD: f64 = 1.1;
const BEND_TAKES_S: f64 = 0.4;
/// Time that a seated person needs to get up, s, and the bend of the trunk meanwhile, rad.
const GETS_UP_S: f64 = 1.8;
const GETS_UP_BEND_RAD: f64 = 0.7;
/// Speed below which a walker counts as standing and leaves the avoidance to the others, m/s.
const STANDS_MPS: f64 = 0.1;
/// Approximate minimum distance between companions, m.
const TOO_NEAR_M: f64 = 0.6;
/// Time in which a companion closes the gap to the wanted position, s.
const CATCH_UP_S: f64 = 0.8;

/// Wanted position and motion of a companion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lead {
    /// Position beside the leader, m.
    pub place: Point2<f64>,
    /// Velocity of the leader, m/s.
    pub velocity: Vector2<f64>,
    /// Heading of the leader, rad.
    pub heading_rad: f64,
}

/// A simulated person on the way.
#[derive(Clone, Debug)]
pub struct Walker {
    /// Size and appearance.
    pub person: Person,
    /// Position and pose.
    pub stance: Stance,
    /// Leader of a companion, and the offset in the leader's axes, m.
    pub beside: Option<(usize, Vector2<f64>)>,
    settings: PersonSettings,
    /// Clothes under a coat that has not been taken off yet.
    under_coat: Option<Outfit>,
    velocity: Vector2<f64>,
    /// Index of the next point of the path; past its end on arrival.
    ahead: usize,
    waits_until_s: f64,
    tricked: bool,
    /// Time for which an obstacle has blocked the walker, s.
    held_up_s: f64,
    /// Points of the way around blocks to the next point of the path, which is the last of them.
    turns: Vec<Point2<f64>>,
}

impl Walker {
    /// Creates a walker at the first point of the path, which must exist.
    pub fn new(person: Person, settings: PersonSettings) -> Self {
        let mut settings = settings;
        for point in &mut settings.path {
            *point = [point[0] + settings.offset[0], point[1] + settings.offset[1]];
        }
        let points: Vec<Point2<f64>> = settings.path.iter().map(|p| Point2::from(*p)).collect();
        let way = points.get(1).map_or(Vector2::x(), |next| next - points[0]);
        let heading_rad = settings.heading_deg.map_or(way.y.atan2(way.x), f64::to_radians);
        let stance = Stance {
            posture: settings.posture,
            seated: if settings.posture == Posture::Seated { 1.0 } else { 0.0 },
            ..Stance::standing(points[0], heading_rad)
        };
        let waits_until_s = settings.start_s.max(settings.enters_s);
        Self {
            person,
            stance,
            beside: None,
            settings,
            under_coat: None,
            velocity: Vector2::zeros(),
            ahead: 1,
            waits_until_s,
            tricked: false,
            held_up_s: 0.0,
            turns: Vec::new(),
        }
    }

    /// Returns true if the person takes off a coat.
    pub fn has_coat(&self) -> bool {
        self.settings.coat_off_s.is_some()
    }

    /// Puts a coat of this material over the clothes.
    pub fn in_coat(mut self, material: Material) -> Self {
        let own = self.person.look.clone();
        self.person.look.top = material;
        if !own.extras.contains(&Extra::Coat) {
            self.person.look.extras.push(Extra::Coat);
        }
        self.under_coat = Some(own);
        self
    }

    /// Takes the coat off when it is time.
    fn take_off_coat(&mut self, now_s: f64) {
        if self.settings.coat_off_s.is_some_and(|at_s| now_s >= at_s)
            && let Some(own) = self.under_coat.take()
        {
            self.person.look = own;
        }
    }

    /// Makes this walker a companion of the walker `leader`, at `offset` in that person's axes, m.
    pub fn along(mut self, leader: (usize, &Self), offset: Vector2<f64>) -> Self {
        let (index, leader) = leader;
        self.stance.place = leader.place_beside(offset);
        self.stance.heading_rad = leader.stance.heading_rad;
        self.beside = Some((index, offset));
        self
    }

    /// Returns true if the person is in the room.
    pub fn is_there(&self, now_s: f64) -> bool {
        now_s >= self.settings.enters_s && self.settings.leaves_s.is_none_or(|end_s| now_s < end_s)
    }

    /// Returns the points of the path.
    #[cfg(test)]
    pub fn points(&self) -> Vec<Point2<f64>> {
        self.settings.path.iter().map(|point| Point2::from(*point)).collect()
    }

    /// Returns the position at which a companion should be.
    pub fn lead(&self, offset: Vector2<f64>) -> Lead {
        let heading_rad = self.stance.heading_rad;
        Lead { place: self.place_beside(offset), velocity: self.velocity, heading_rad }
    }

    fn place_beside(&self, offset: Vector2<f64>) -> Point2<f64> {
        self.stance.place + Rotation2::new(self.stance.heading_rad) * offset
    }

    /// Moves the walker by a time step. `keep_off` are the positions of all people other than
    /// companions; `lead` is the wanted position of a companion.
    pub fn step(
        &mut self,
        now_s: f64,
        dt: f64,
        lead: Option<&Lead>,
        keep_off: &[Point2<f64>],
        obstacles: &[Obstacle],
    ) {
        let near_m = if self.held_up_s > HELD_UP_S { NEAR_ENOUGH_M } else { REACHED_M };
        self.look_ahead(now_s, near_m);
        let wanted = match lead {
            Some(lead) => self.follow(lead),
            None if now_s < self.waits_until_s => Vector2::zeros(),
            None => self.round(self.wanted(), dt, obstacles),
        };
        let mut change = (wanted - self.velocity) / 0.5;
        // A standing person leaves the avoidance to the others.
        if wanted != Vector2::zeros() {
            change +=
                keep_off.iter().map(|p| self.push(p, 0.6, PUSH_REACH_M)).sum::<Vector2<f64>>();
            change += obstacles
                .iter()
                .map(|o| self.push(&o.at, 0.25 + o.radius_m, THING_REACH_M))
                .sum::<Vector2<f64>>();
        }
        let limit = MAX_ACCELERATION.max(2.0 * self.velocity.norm());
        self.velocity += change.cap_magnitude(limit) * dt;
        self.velocity = self.velocity.cap_magnitude(1.3 * self.settings.speed_mps.max(0.1));
        self.stance.place += self.velocity * dt;
        self.stance.speed_mps = self.velocity.norm();
        if wanted != Vector2::zeros() || self.stance.speed_mps > STANDS_MPS {
            self.stay_outside(obstacles);
        }
        self.finish_step(now_s, dt, lead);
    }

    /// Updates the body of a walker after a step.
    fn finish_step(&mut self, now_s: f64, dt: f64, lead: Option<&Lead>) {
        self.get_up(now_s);
        self.take_off_coat(now_s);
        self.turn(dt, lead);
        self.stride(dt);
        self.bend(now_s, dt);
    }

    /// Returns the wanted velocity or, if an obstacle blocks the walker, one that leads around its
    /// nearer side.
    fn round(&mut self, wanted: Vector2<f64>, dt: f64, obstacles: &[Obstacle]) -> Vector2<f64> {
        let nearest = obstacles
            .iter()
            .map(|o| ((o.at - self.stance.place).norm() - o.radius_m, o))
            .min_by(|a, b| a.0.total_cmp(&b.0));
        let thing = nearest.filter(|(surface_m, _)| *surface_m < HELD_UP_M).map(|(_, o)| o);
        let goes_round = self.held_up_s > HELD_UP_S;
        let held_up = self.velocity.dot(&wanted) < HEADWAY * wanted.norm_squared();
        let (Some(thing), true) = (thing, goes_round || held_up) else {
            self.held_up_s = 0.0;
            return wanted;
        };
        self.held_up_s += dt;
        if self.held_up_s > HELD_UP_S + ROUND_S {
            self.held_up_s = 0.0;
        }
        let middle = thing.at + thing.ahead;
        let is_left = wanted.perp(&(middle - self.stance.place)) >= 0.0;
        let aside = if is_left { -ROUND_RAD } else { ROUND_RAD };
        match wanted.try_normalize(1e-6) {
            Some(way) if goes_round => Rotation2::new(aside) * way * self.settings.speed_mps,
            _ => wanted,
        }
    }

    /// Places a walker whose motion is computed elsewhere; the legs move at this speed.
    pub fn carry(&mut self, place: Point2<f64>, heading_rad: f64, speed_mps: f64, dt: f64) {
        self.velocity = Rotation2::new(heading_rad) * Vector2::new(speed_mps, 0.0);
        self.stance.place = place;
        self.stance.heading_rad = heading_rad;
        self.stance.speed_mps = speed_mps;
        self.stride(dt);
    }

    /// Moves the walker out of obstacles, because the repulsion of others must not push through
    /// them.
    fn stay_outside(&mut self, obstacles: &[Obstacle]) {
        for obstacle in obstacles {
            let away = self.stance.place - obstacle.at;
            if let Some(out) = away.try_normalize(1e-6).filter(|_| away.norm() < obstacle.radius_m)
            {
                self.stance.place = obstacle.at + out * obstacle.radius_m;
            }
        }
    }

    /// Returns the velocity that closes the gap to the position beside the leader.
    fn follow(&self, lead: &Lead) -> Vector2<f64> {
        let gap = lead.place - self.stance.place;
        if lead.velocity.norm() < 0.1 && gap.norm() < 0.15 {
            return Vector2::zeros();
        }
        (lead.velocity + gap / CATCH_UP_S).cap_magnitude(1.3 * self.settings.speed_mps)
    }

    /// Rises from the seat in time to leave; the feet stay in place.
    fn get_up(&mut self, now_s: f64) {
        if self.settings.path.len() < 2 || self.stance.seated == 0.0 {
            return;
        }
        let left = ((self.waits_until_s - now_s) / GETS_UP_S).clamp(0.0, 1.0);
        let seated = left.min(self.stance.seated);
        let [before_m, after_m] =
            [self.stance.seated, seated].map(|seated| feet_ahead_m(&self.person.build, seated));
        let heading = Rotation2::new(self.stance.heading_rad) * Vector2::x();
        self.stance.place += heading * (before_m - after_m);
        self.stance.seated = seated;
    }

    fn bend(&mut self, now_s: f64, dt: f64) {
        let down = self.settings.posture == Posture::Bending
            && self.stance.speed_mps < 0.1
            && now_s.rem_euclid(BEND_EVERY_S) > 0.5 * BEND_EVERY_S;
        let rising = 4.0 * self.stance.seated * (1.0 - self.stance.seated);
        let goal = if down { BEND_RAD } else { GETS_UP_BEND_RAD * rising };
        self.stance.bend_rad += (goal - self.stance.bend_rad) * (dt / BEND_TAKES_S).min(1.0);
    }

    /// Advances to the next point of the path if the current one is within this distance, m.
    fn look_ahead(&mut self, now_s: f64, near_m: f64) {
        let path = &self.settings.path;
        let is_reached = path
            .get(self.ahead)
            .is_some_and(|point| (self.stance.place - Point2::from(*point)).norm() < near_m);
        if path.len() < 2 || !is_reached {
            return;
        }
        let rest_s = self.settings.rest_s.get(self.ahead).copied().unwrap_or(0.0);
        self.waits_until_s = self.waits_until_s.max(now_s + rest_s);
        self.ahead += 1;
        if self.ahead == path.len() {
            match self.settings.at_end {
                AtEnd::Stop => {}
                AtEnd::Loop => self.ahead = 0,
                AtEnd::Return => self.reverse(),
            }
        }
    }

    /// Reverses the path from the current position.
    fn reverse(&mut self) {
        let left = self.settings.path.len().saturating_sub(self.ahead);
        self.settings.path.reverse();
        self.settings.rest_s.resize(self.settings.path.len(), 0.0);
        self.settings.rest_s.reverse();
        self.ahead = (left + 1).min(self.settings.path.len() - 1);
        if left == 0 {
            self.ahead = 1;
        }
    }

    fn wanted(&self) -> Vector2<f64> {
        let Some(goal) = self.settings.path.get(self.ahead) else { return Vector2::zeros() };
        let way = Point2::from(*goal) - self.stance.place;
        let last =
            self.ahead + 1 == self.settings.path.len() && self.settings.at_end == AtEnd::Stop;
        // Brakes in time for the end, and slows down while facing in another direction.
        let speed = if last {
            self.settings.speed_mps.min(1.2 * way.norm())
        } else {
            self.settings.speed_mps
        };
        let off = angle_between(way.y.atan2(way.x), self.stance.heading_rad).abs();
        way.try_normalize(1e-6).unwrap_or_default() * speed * (1.0 - 0.7 * (off / 1.5).min(1.0))
    }

    /// Returns the repulsion from a position. It is stronger from ahead than from behind, and has a
    /// component to the right so that people pass each other when they meet head-on.
    fn push(&self, from: &Point2<f64>, radius_m: f64, reach_m: f64) -> Vector2<f64> {
        let away = self.stance.place - from;
        let distance = away.norm();
        if !(1e-6..2.5 + radius_m).contains(&distance) {
            return Vector2::zeros();
        }
        let away = away / distance;
        let heading = Vector2::new(self.stance.heading_rad.cos(), self.stance.heading_rad.sin());
        let ahead = 0.5 * (1.0 - heading.dot(&away));
        let right = Vector2::new(heading.y, -heading.x);
        let strength = PUSH * ((radius_m - distance) / reach_m).exp().min(3.0);
        (away + right * (0.9 * ahead)) * strength * (0.25 + 0.75 * ahead)
    }

    fn turn(&mut self, dt: f64, lead: Option<&Lead>) {
        let v = self.velocity;
        let seated = self.stance.seated > 0.0;
        if let Some(lead) = lead.filter(|_| self.stance.speed_mps < 0.4) {
            self.turn_to(lead.heading_rad, dt);
        } else if self.stance.speed_mps > 0.08 {
            self.turn_to(v.y.atan2(v.x), dt);
        } else if self.settings.spin_deg_per_s != 0.0 {
            self.stance.heading_rad += self.settings.spin_deg_per_s.to_radians() * dt;
        } else if let Some(goal) = self.settings.path.get(self.ahead).filter(|_| !seated) {
            let way = Point2::from(*goal) - self.stance.place;
            self.turn_to(way.y.atan2(way.x), dt);
        }
    }

    fn turn_to(&mut self, heading_rad: f64, dt: f64) {
        let off = angle_between(heading_rad, self.stance.heading_rad);
        self.stance.heading_rad += off.clamp(-MAX_TURN * dt, MAX_TURN * dt);
    }

    fn stride(&mut self, dt: f64) {
        let cycle_s = Gait::new(self.person.build.height_m, self.stance.speed_mps).cycle_s();
        self.stance.phase = (self.stance.phase + dt / cycle_s).rem_euclid(1.0);
    }

    fn plays(&mut self, trick: Trick) -> bool {
        let plays = self.settings.trick == trick && !self.tricked;
        self.tricked |= plays;
        plays
    }
}

/// Starts the tricks of hidden walkers; `hidden_by[i]` is the walker that hides walker `i`.
pub fn play_tricks(walkers: &mut [Walker], hidden_by: &[Option<usize>], now_s: f64) {
    for (i, hider) in hidden_by.iter().enumerate() {
        let Some(hider) = *hider else { continue };
        if walkers[i].plays(Trick::TurnBack) {
            walkers[i].reverse();
        } else if walkers[i].plays(Trick::Stop) {
            walkers[i].waits_until_s = now_s + walkers[i].settings.hide_s;
        } else if walkers[i].plays(Trick::Swap) {
            let mine = walkers[i].way();
            let theirs = walkers[hider].way();
            walkers[i].take(theirs);
            walkers[hider].take(mine);
            walkers[hider].tricked = true;
        }
    }
}

impl Walker {
    fn way(&self) -> (Vec<[f64; 2]>, usize, AtEnd) {
        (self.settings.path.clone(), self.ahead, self.settings.at_end)
    }

    fn take(&mut self, (path, ahead, at_end): (Vec<[f64; 2]>, usize, AtEnd)) {
        self.settings.path = path;
        self.ahead = ahead;
        self.settings.at_end = at_end;
    }
}

/// Returns the wanted position of a companion; `None` for other walkers.
pub fn lead_of(walkers: &[Walker], i: usize) -> Option<Lead> {
    walkers[i].beside.map(|(leader, offset)| walkers[leader].lead(offset))
}

/// Returns the positions that a walker avoids: those of all people in the room outside of the
/// walker's group, and of members of the group that come too close.
pub fn others(walkers: &[Walker], i: usize, now_s: f64) -> Vec<Point2<f64>> {
    let own = walkers[i].stance.place;
    let mut places = Vec::new();
    for (j, other) in walkers.iter().enumerate() {
        let place = other.stance.place;
        let is_in_the_way =
            leader_of(walkers, j) != leader_of(walkers, i) || (place - own).norm() < TOO_NEAR_M;
        if j != i && other.is_there(now_s) && is_in_the_way {
            places.push(place);
        }
    }
    places
}

/// Returns the index of the leader of a walker's group, or that of the walker.
fn leader_of(walkers: &[Walker], i: usize) -> usize {
    walkers[i].beside.map_or(i, |(leader, _)| leader)
}

/// Returns the walker that hides each walker, seen from this position: the middle of the hidden
/// body is behind a walker who is at least 0.3 m nearer, and whose body is taken to extend 0.2 m to
/// either side.
pub fn hidden_by(walkers: &[Walker], seen_from: &Point2<f64>) -> Vec<Option<usize>> {
    fn hides(near: (f64, f64), far: (f64, f64)) -> bool {
        near.0 + 0.3 < far.0 && angle_between(near.1, far.1).abs() < (0.2 / near.0.max(0.3)).atan()
    }

    let polar: Vec<(f64, f64)> = walkers
        .iter()
        .map(|w| w.stance.place - seen_from)
        .map(|way| (way.norm(), way.y.atan2(way.x)))
        .collect();
    polar.iter().map(|far| polar.iter().position(|near| hides(*near, *far))).collect()
}

/// Returns `a - b`, normalised to half a turn.
fn angle_between(a: f64, b: f64) -> f64 {
    (a - b).sin().atan2((a - b).cos())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn walker(path: &[[f64; 2]], trick: Trick) -> Walker {
        let settings = PersonSettings { path: path.to_vec(), trick, ..PersonSettings::default() };
        Walker::new(Person::subject(1), settings)
    }

    /// Walks for some time; calls `see` after every step.
    fn walk(walkers: &mut [Walker], seconds: f64, mut see: impl FnMut(&[Walker])) {
        for step in 0..(seconds / 0.02) as usize {
            let now_s = step as f64 * 0.02;
            let hidden = hidden_by(walkers, &Point2::origin());
            play_tricks(walkers, &hidden, now_s);
            for i in 0..walkers.len() {
                let lead = lead_of(walkers, i);
                let others = others(walkers, i, now_s);
                walkers[i].step(now_s, 0.02, lead.as_ref(), &others, &[]);
            }
            see(walkers);
        }
    }

    #[test]
    fn a_coat_is_worn_until_it_is_taken_off() {
        let path = vec![[1.0, 1.0], [9.0, 1.0]];
        let settings = PersonSettings { path, coat_off_s: Some(2.0), ..PersonSettings::default() };
        let own = Person::subject(1);
        let coat = Person::subject(2).look.top;
        let mut one = Walker::new(own.clone(), settings).in_coat(coat);
        one.step(1.9, 0.1, None, &[], &[]);
        let look = &one.person.look;
        assert!(look.top == coat && look.extras.contains(&Extra::Coat), "{look:?}");
        assert_eq!(look.trousers, own.look.trousers);
        one.step(2.0, 0.1, None, &[], &[]);
        assert_eq!(one.person, own);
    }

    #[test]
    fn a_walker_arrives_and_stops_there() {
        let mut walkers = [walker(&[[1.0, 1.0], [4.0, 1.0], [4.0, 3.0]], Trick::None)];
        let mut fastest = 0f64;
        walk(&mut walkers, 12.0, |w| fastest = fastest.max(w[0].stance.speed_mps));
        assert!((walkers[0].stance.place - Point2::new(4.0, 3.0)).norm() < 0.3);
        assert!(walkers[0].stance.speed_mps < 0.02 && (fastest - 1.1).abs() < 0.1, "{fastest}");
    }

    #[test]
    fn a_seated_person_gets_up_and_walks() {
        fn feet_m(w: &Walker) -> f64 {
            w.stance.place.x + feet_ahead_m(&w.person.build, w.stance.seated)
        }

        let settings = PersonSettings {
            path: vec![[1.0, 1.0], [4.0, 1.0]],
            posture: Posture::Seated,
            start_s: 4.0,
            ..PersonSettings::default()
        };
        let mut walkers = [Walker::new(Person::subject(1), settings)];
        let on_chair_m = feet_m(&walkers[0]);
        walk(&mut walkers, 2.0, |w| assert_eq!(w[0].stance.seated, 1.0));
        let mut lean_rad = 0f64;
        walk(&mut walkers, 4.0, |w| {
            assert!((feet_m(&w[0]) - on_chair_m).abs() < 1e-9);
            lean_rad = lean_rad.max(w[0].stance.bend_rad);
        });
        assert!(walkers[0].stance.seated < 0.02 && lean_rad > 0.4, "{lean_rad}");
        walk(&mut walkers, 8.0, |_| {});
        assert_eq!(walkers[0].stance.seated, 0.0);
        assert!((walkers[0].stance.place.x - 4.0).abs() < 0.3);
    }

    #[test]
    fn a_walker_rests_where_it_says_and_then_goes_on() {
        let mut one = walker(&[[1.0, 1.0], [3.0, 1.0], [5.0, 1.0]], Trick::None);
        one.settings.rest_s = vec![0.0, 4.0];
        let mut walkers = [one];
        let mut rested = 0;
        walk(&mut walkers, 11.0, |w| {
            let there = (w[0].stance.place.x - 3.0).abs() < 0.6;
            rested += usize::from(there && w[0].stance.speed_mps < 0.1);
        });
        assert!((2.0..4.0).contains(&(rested as f64 * 0.02)), "{rested}");
        assert!(walkers[0].stance.place.x > 4.5, "{}", walkers[0].stance.place);
    }

    #[test]
    fn people_who_meet_head_on_pass_each_other_without_touching() {
        let mut walkers = [
            walker(&[[1.0, 1.0], [7.0, 1.0]], Trick::None),
            walker(&[[7.0, 1.0], [1.0, 1.0]], Trick::None),
        ];
        let mut nearest = f64::MAX;
        walk(&mut walkers, 12.0, |w| {
            nearest = nearest.min((w[0].stance.place - w[1].stance.place).norm())
        });
        assert!(nearest > 0.4, "{nearest}");
        assert!(walkers[0].stance.place.x > 6.0 && walkers[1].stance.place.x < 2.0);
    }

    #[test]
    fn companions_stay_beside_the_one_who_leads() {
        let leads = walker(&[[1.0, 1.0], [6.0, 1.0], [6.0, 4.0]], Trick::None);
        let along = walker(&[[0.0, 0.0]], Trick::None).along((0, &leads), Vector2::new(0.0, 0.8));
        let mut walkers = [leads, along];
        let mut apart = Vec::new();
        walk(&mut walkers, 12.0, |w| {
            apart.push((w[0].stance.place - w[1].stance.place).norm());
        });
        let (least, most) = apart.iter().fold((9f64, 0f64), |(l, m), d| (l.min(*d), m.max(*d)));
        assert!(least > 0.35 && most < 1.3, "{least} {most}");
        assert!(walkers[1].stance.place.y > 2.5 && walkers[1].stance.speed_mps < 0.1);
    }

    #[test]
    fn nobody_walks_through_things() {
        let mut walkers = [walker(&[[1.0, 1.0], [5.0, 1.0]], Trick::None)];
        let pillar = Obstacle::standing(Point2::new(3.0, 1.01), 0.4);
        for step in 0..500 {
            walkers[0].step(f64::from(step) * 0.02, 0.02, None, &[], &[pillar]);
            assert!((walkers[0].stance.place - pillar.at).norm() > 0.399);
        }
        assert!(walkers[0].stance.place.x > 4.5, "{}", walkers[0].stance.place);
    }

    #[test]
    fn who_comes_to_a_stop_does_not_glide_into_a_thing() {
        let mut nearest = f64::MAX;
        for (x, y) in (0..10).flat_map(|x| (-8..=8).map(move |y| (x, y))) {
            let mut one = walker(&[[1.0, 1.0], [3.0, 1.0], [5.0, 1.0]], Trick::None);
            one.settings.rest_s = vec![0.0, 5.0];
            let at = Point2::new(3.0 + 0.1 * f64::from(x), 1.0 + 0.1 * f64::from(y));
            for step in 0..250 {
                one.step(f64::from(step) * 0.02, 0.02, None, &[], &[Obstacle::standing(at, 0.5)]);
                nearest = nearest.min((one.stance.place - at).norm());
            }
        }
        let slow_m = 0.5 * STANDS_MPS;
        assert!(nearest > 0.5 - slow_m, "{nearest}");
    }

    #[test]
    fn nobody_stands_for_ever_before_a_thing() {
        for aside in -8..=8 {
            let way = 0.1 * f64::from(aside);
            for speed_mps in [0.55, 0.8, 1.2] {
                let mut one = walker(&[[1.0, 1.0], [6.0, 1.0 + way]], Trick::None);
                one.settings.speed_mps = speed_mps;
                let robot = Obstacle::standing(Point2::new(3.5, 1.0), 0.5);
                for step in 0..700 {
                    one.step(f64::from(step) * 0.02, 0.02, None, &[], &[robot]);
                }
                assert!(one.stance.place.x > 5.3, "{way} {speed_mps}: {}", one.stance.place);
            }
        }
    }

    /// A robot stopped on the way of a person.
    #[test]
    fn nobody_dances_around_a_point_that_is_taken() {
        let mut one = walker(&[[1.0, 1.0], [4.0, 1.0], [4.0, 4.0]], Trick::None);
        let robot = Obstacle::standing(Point2::new(4.3, 0.8), 0.5);
        for step in 0..600 {
            one.step(f64::from(step) * 0.02, 0.02, None, &[], &[robot]);
        }
        assert!((one.stance.place - Point2::new(4.0, 4.0)).norm() < 0.3, "{}", one.stance.place);
    }

    #[test]
    fn tricks_are_played_behind_somebody() {
        fn stands() -> Walker {
            walker(&[[2.0, 0.0]], Trick::None)
        }

        fn passes(trick: Trick) -> Walker {
            walker(&[[4.0, -2.0], [4.0, 2.0]], trick)
        }

        let mut back = [stands(), passes(Trick::TurnBack)];
        walk(&mut back, 8.0, |_| {});
        assert!(back[1].stance.place.y < -1.5, "{}", back[1].stance.place);
        let mut straight = [stands(), passes(Trick::None)];
        walk(&mut straight, 8.0, |_| {});
        assert!(straight[1].stance.place.y > 1.5);
        let mut stop = [stands(), passes(Trick::Stop)];
        let mut hidden_steps = 0;
        walk(&mut stop, 8.0, |w| {
            hidden_steps += usize::from(hidden_by(w, &Point2::origin())[1] == Some(0));
        });
        assert!(hidden_steps as f64 * 0.02 > 2.5, "{hidden_steps}");
        let mut swap = [walker(&[[3.0, 2.0], [3.0, -2.0]], Trick::None), passes(Trick::Swap)];
        walk(&mut swap, 9.0, |_| {});
        assert!(swap[0].stance.place.y > 1.0 && swap[1].stance.place.y < -1.0, "sides are swapped");
    }
}
