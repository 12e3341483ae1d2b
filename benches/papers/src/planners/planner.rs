use nalgebra::{Point2, Vector2};
use tagalong_config::{Settings, check_settings};
use tagalong_controllers::step_s;
use tagalong_core::{Controller, EgoMotion, Input, Inputs, Result, Scene, Twist};

/// Above this no length or speed on the floor makes sense, whatever the unit.
pub(super) const MOST: f64 = 1e6;
/// Distance at which a lost person is approached, m.
const SEARCH_M: f64 = 0.2;

/// The equations of a planner, by its settings.
pub(super) trait Steering: Settings + Send {
    /// State from one frame to the next, forgotten with the person.
    type Memory: Default + Send;

    /// Returns the command for one frame, within the limits.
    fn steer(&self, now: &Situation<'_>, memory: &mut Self::Memory) -> Twist;

    /// Returns the distance kept from the centre of the person, m.
    fn stand_off_m(&self) -> f64;
}

/// Input of a planner for one frame.
pub(super) struct Situation<'a> {
    /// Input of the controller.
    pub(super) scene: &'a Scene<'a>,
    /// The followed person.
    pub(super) quarry: Quarry,
    /// The last command.
    pub(super) last: Twist,
    /// Largest speed, m/s, and turn rate, rad/s, of the drive.
    pub(super) max_mps: f64,
    pub(super) max_rps: f64,
    /// Time since the last command, s.
    pub(super) dt_s: f64,
}

/// A planner as a controller, with the followed person and the last command.
pub(super) struct Planner<S: Steering> {
    settings: S,
    quarry: Option<Quarry>,
    last: Twist,
    memory: S::Memory,
}

impl<S: Steering> Planner<S> {
    /// Creates a planner of a robot at rest.
    ///
    /// # Errors
    /// Settings outside their ranges.
    pub(super) fn new(settings: S) -> Result<Self> {
        check_settings(&settings)?;
        Ok(Self { settings, quarry: None, last: Twist::STOP, memory: S::Memory::default() })
    }

    /// Returns the command for the followed person; `None` without a person or a usable drive.
    fn steer(&mut self, scene: &Scene<'_>) -> Option<Twist> {
        let quarry = self.quarry?;
        let max_mps = scene.max_speed_mps;
        let half_m = scene.wheels.half_separation_m;
        if ![max_mps, half_m].iter().all(|value| *value > 0.0 && *value <= MOST) {
            return None;
        }
        let max_rps = max_mps / half_m;
        let dt_s = step_s(&scene.frame.motion);
        let now = Situation { scene, quarry, last: self.last, max_mps, max_rps, dt_s };
        Some(self.settings.steer(&now, &mut self.memory))
    }
}

impl<S: Steering> Controller for Planner<S> {
    fn inputs(&self) -> Inputs {
        Inputs::NONE.accept(Input::Laser)
    }

    fn command(&mut self, scene: &Scene<'_>) -> Twist {
        self.quarry = Quarry::next(self.quarry, scene);
        let steered = self.steer(scene);
        if steered.is_none() {
            self.memory = S::Memory::default();
        }
        self.last = steered.unwrap_or(Twist::STOP);
        self.last
    }

    fn stand_off_m(&self) -> Option<f64> {
        Some(self.settings.stand_off_m())
    }
}

/// The followed person where they were seen last, in the axes of the robot of now.
#[derive(Clone, Copy, Debug)]
pub(super) struct Quarry {
    /// Place, m.
    pub(super) place: Point2<f64>,
    /// Velocity over ground, m/s.
    velocity: Vector2<f64>,
    /// True if the person is seen in this frame.
    is_seen: bool,
}

impl Quarry {
    /// Returns the person of this frame, or, while their track lives on, where they were seen last, moved
    /// along with the robot. `None` without a target: the search of the config comes then.
    fn next(before: Option<Self>, scene: &Scene<'_>) -> Option<Self> {
        fn is_finite(place: &Point2<f64>, velocity: &Vector2<f64>) -> bool {
            place.iter().chain(velocity.iter()).all(|value| value.abs() < MOST)
        }

        let track = scene.target?;
        if track.seen {
            let person = &track.estimate.person;
            let place = person.position.xy();
            if is_finite(&place, &person.velocity) {
                return Some(Self { place, velocity: person.velocity, is_seen: true });
            }
        }
        before.map(|before| before.moved(&scene.frame.motion))
    }

    fn moved(self, motion: &EgoMotion) -> Self {
        let place = motion.apply_to_point(self.place);
        Self { place, velocity: motion.apply_to_velocity(self.velocity), is_seen: false }
    }

    /// Returns the point to drive to for where the person will be in `seconds`: on the line from the
    /// robot of now, `distance_m` before the person. A lost person is expected where they would be at
    /// the end of the horizon, and approached.
    pub(super) fn goal(&self, seconds: f64, horizon_s: f64, distance_m: f64) -> Point2<f64> {
        let distance_m = if self.is_seen { distance_m } else { SEARCH_M };
        let (place, towards) = self.expected(seconds, horizon_s);
        place - towards * distance_m
    }

    /// Returns the direction to the person at the time of [`Self::goal`], rad.
    pub(super) fn bearing(&self, seconds: f64, horizon_s: f64) -> f64 {
        let (_, towards) = self.expected(seconds, horizon_s);
        towards.y.atan2(towards.x)
    }

    /// Returns where the person is expected, and the direction to there.
    fn expected(&self, seconds: f64, horizon_s: f64) -> (Point2<f64>, Vector2<f64>) {
        let ahead_s = if self.is_seen { seconds } else { horizon_s };
        let place = self.place + self.velocity * ahead_s;
        (place, place.coords.try_normalize(1e-6).unwrap_or_else(Vector2::x))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WALKS: Quarry =
        Quarry { place: Point2::new(3.0, 0.0), velocity: Vector2::new(1.0, 0.0), is_seen: true };

    #[test]
    fn the_goal_lies_before_the_person_who_walks_on() {
        assert_eq!(WALKS.goal(0.0, 2.0, 1.5), Point2::new(1.5, 0.0));
        assert_eq!(WALKS.goal(1.0, 2.0, 1.5), Point2::new(2.5, 0.0));
    }

    #[test]
    fn a_lost_person_is_approached_where_they_are_expected() {
        let lost = WALKS.moved(&EgoMotion { forward: 1.0, ..EgoMotion::at_rest(0.1) });
        let goal = lost.goal(0.0, 2.0, 1.5);
        assert!((goal - Point2::new(2.0 + 2.0 - SEARCH_M, 0.0)).norm() < 1e-12, "{goal}");
    }
}
