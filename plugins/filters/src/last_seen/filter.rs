use std::collections::VecDeque;

use nalgebra::{Matrix2, Matrix3, Point2, Point3, SMatrix, Vector2};
use tagalong_config::check_settings;
use tagalong_core::{Detection, EgoMotion, Estimate, Person, PersonFilter, Result, Update};
use tagalong_geometry::Camera;

use crate::last_seen::Config;

/// Random walk of the height of an unobserved head, metres per square root of a second.
const HEIGHT_WANDER: f64 = 0.1;
/// Variance of a velocity component, m²/s²: it is hardly known.
const VELOCITY_VARIANCE: f64 = 1.0;
/// Sightings of one person that are remembered at most.
const MOST_SIGHTINGS: usize = 64;

/// State of a person, in the robot frame.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// Centre of the head when last seen, m.
    position: Point3<f64>,
    /// Its covariance, m².
    covariance: Matrix3<f64>,
    /// Age of each detection of the person, s, and its place on the floor; newest last.
    sightings: VecDeque<(f64, Point2<f64>)>,
}

/// The filter.
pub struct LastSeen {
    config: Config,
}

impl LastSeen {
    /// A filter.
    ///
    /// # Errors
    /// [`tagalong_core::Error::Settings`] for numbers that cannot work.
    pub fn new(config: Config) -> Result<Self> {
        check_settings(&config)?;
        Ok(Self { config })
    }

    fn remember(&self, sightings: &mut VecDeque<(f64, Point2<f64>)>, place: Point2<f64>) {
        sightings.push_back((0.0, place));
        while sightings.len() > MOST_SIGHTINGS
            || sightings.front().is_some_and(|(ago, _)| *ago > self.config.velocity_over_s)
        {
            sightings.pop_front();
        }
    }
}

impl PersonFilter for LastSeen {
    type State = State;

    fn start(&self, seen: &Detection) -> State {
        let mut sightings = VecDeque::new();
        self.remember(&mut sightings, seen.position.xy());
        State { position: seen.position, covariance: seen.covariance, sightings }
    }

    fn predict(&self, state: &mut State, motion: &EgoMotion) {
        let motion = if self.config.ego_motion { *motion } else { EgoMotion::at_rest(motion.dt) };
        let floor = motion.apply_to_point(state.position.xy());
        state.position = Point3::new(floor.x, floor.y, state.position.z);
        for (ago, place) in &mut state.sightings {
            *ago += motion.dt;
            *place = motion.apply_to_point(*place);
        }
        let mut turn = Matrix3::identity();
        turn.fixed_view_mut::<2, 2>(0, 0).copy_from(&turn_back(&motion));
        let floor = self.config.wander.powi(2);
        let height = HEIGHT_WANDER.powi(2);
        let grown = Matrix3::from_diagonal(&[floor, floor, height].into()) * motion.dt;
        let turned = turn * state.covariance * turn.transpose();
        state.covariance = 0.5 * (turned + turned.transpose()) + grown;
    }

    fn correct(&self, state: &mut State, seen: &Detection, _: &Camera) -> Update {
        state.position = seen.position;
        state.covariance = seen.covariance;
        self.remember(&mut state.sightings, seen.position.xy());
        Update::default()
    }

    fn estimate(&self, state: &State, camera: &Camera) -> Estimate {
        let mut covariance = SMatrix::<f64, 5, 5>::identity() * VELOCITY_VARIANCE;
        covariance.fixed_view_mut::<3, 3>(0, 0).copy_from(&state.covariance);
        Estimate::new(
            Person { position: state.position, velocity: velocity(&state.sightings) },
            covariance,
            camera.upper_body(&state.position),
        )
    }
}

/// From the first to the last sighting.
fn velocity(sightings: &VecDeque<(f64, Point2<f64>)>) -> Vector2<f64> {
    match (sightings.front(), sightings.back()) {
        (Some((then, from)), Some((now, to))) if then > now => (to - from) / (then - now),
        _ => Vector2::zeros(),
    }
}

/// Turns a vector into the robot's new axes.
fn turn_back(motion: &EgoMotion) -> Matrix2<f64> {
    *motion.isometry().rotation.inverse().to_rotation_matrix().matrix()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use tagalong_geometry::{Distortion, ImageBox, Pinhole, Rect};

    use super::*;

    fn sighting(x: f64, y: f64) -> Detection {
        Detection::new("test", Point3::new(x, y, 1.6), Matrix3::identity() * 0.01, 1.0)
            .with_image(ImageBox::upper_body(Rect::new(0.0, 0.0, 9.0, 9.0)))
    }

    fn after_a_turn(ego_motion: bool) -> State {
        let filter = LastSeen::new(Config { ego_motion, ..Config::default() }).unwrap();
        let mut state = filter.start(&sighting(3.0, 0.0));
        let turn = FRAC_PI_2;
        filter.predict(&mut state, &EgoMotion { forward: 1.0, turn, ..EgoMotion::at_rest(0.5) });
        state
    }

    #[test]
    fn who_is_unseen_stays_in_the_room_or_before_the_robot() {
        assert!((after_a_turn(true).position - Point3::new(0.0, -2.0, 1.6)).norm() < 1e-12);
        assert_eq!(after_a_turn(false).position, Point3::new(3.0, 0.0, 1.6));
    }

    #[test]
    fn nothing_is_averaged() {
        let filter = LastSeen::new(Config::default()).unwrap();
        let mut state = after_a_turn(true);
        let camera = Camera::mounted(
            Pinhole { fx: 300.0, fy: 300.0, cx: 159.5, cy: 119.5, distortion: Distortion::None },
            320,
            240,
            1.2,
            0.0,
            0.0,
        );
        filter.correct(&mut state, &sighting(2.0, 0.5), &camera);
        assert_eq!(
            (state.position, state.covariance),
            (Point3::new(2.0, 0.5, 1.6), sighting(0.0, 0.0).covariance)
        );
    }

    #[test]
    fn settings_that_cannot_work_are_refused() {
        assert!(LastSeen::new(Config { wander: 0.0, ..Config::default() }).is_err());
        assert!(LastSeen::new(Config { velocity_over_s: f64::NAN, ..Config::default() }).is_err());
    }

    fn camera() -> Camera {
        Camera::mounted(Pinhole::centred(300.0, 320, 240), 320, 240, 1.2, 0.0, 0.0)
    }

    /// Returns the estimate of a person detected each half second at these places, by a robot with
    /// this motion.
    fn seen_at(config: Config, motion: EgoMotion, places: &[(f64, f64)]) -> Estimate {
        let filter = LastSeen::new(config).unwrap();
        let mut state = filter.start(&sighting(places[0].0, places[0].1));
        for (x, y) in &places[1..] {
            filter.predict(&mut state, &motion);
            filter.correct(&mut state, &sighting(*x, *y), &camera());
        }
        filter.estimate(&state, &camera())
    }

    #[test]
    fn the_velocity_is_the_way_of_the_last_second() {
        let still = EgoMotion::at_rest(0.5);
        for (places, expected) in [
            (&[(3.0, 0.0)][..], Vector2::zeros()),
            (&[(3.0, 0.0), (3.0, 0.4)], Vector2::new(0.0, 0.8)),
            // Two seconds ago is too long ago.
            (
                &[(9.0, 0.0), (9.0, 1.0), (3.0, 0.0), (3.0, 0.4), (2.0, 1.0)],
                Vector2::new(-1.0, 1.0),
            ),
        ] {
            let seen = seen_at(Config::default(), still, places);
            assert_eq!(seen.person.velocity, expected, "{places:?}");
        }
    }

    #[test]
    fn who_stands_does_not_walk_because_the_robot_drives() {
        let motion = EgoMotion { forward: 0.5, turn: 0.1, ..EgoMotion::at_rest(0.5) };
        let first = Point2::new(3.0, 1.0);
        let next = motion.apply_to_point(first);
        let places = [(first.x, first.y), (next.x, next.y)];
        let [by_odometry, without] = [true, false].map(|ego_motion| {
            let config = Config { ego_motion, ..Config::default() };
            seen_at(config, motion, &places).person.velocity.norm()
        });
        assert!(by_odometry < 1e-9 && without > 0.5, "{by_odometry} {without}");
    }

    #[test]
    fn who_is_unseen_may_have_gone_anywhere_ever_farther() {
        let filter = LastSeen::new(Config { wander: 0.4, ..Config::default() }).unwrap();
        let mut seen = sighting(3.0, 0.0);
        seen.covariance = Matrix3::from_diagonal(&[0.04, 0.01, 0.02].into());
        let mut state = filter.start(&seen);
        filter.predict(&mut state, &EgoMotion { turn: FRAC_PI_2, ..EgoMotion::at_rest(0.5) });
        let estimate = filter.estimate(&state, &camera());
        // After the turn, places ahead are to the right.
        let expected = [0.01 + 0.08, 0.04 + 0.08, 0.02 + 0.005, 1.0, 1.0];
        for (found, expected) in estimate.covariance.diagonal().iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12, "{}", estimate.covariance);
        }
        assert_eq!(estimate.region, camera().upper_body(&estimate.person.position));
    }

    #[test]
    fn no_more_sightings_are_kept_than_needed() {
        let filter = LastSeen::new(Config { velocity_over_s: 100.0, ..Config::default() }).unwrap();
        let mut state = filter.start(&sighting(3.0, 0.0));
        for _ in 0..99 {
            filter.correct(&mut state, &sighting(3.0, 0.0), &camera());
        }
        assert_eq!(state.sightings.len(), MOST_SIGHTINGS);
        assert!(LastSeen::new(Config { wander: 100.0, ..Config::default() }).is_ok());
        assert!(LastSeen::new(Config { wander: 100.1, ..Config::default() }).is_err());
    }
}
