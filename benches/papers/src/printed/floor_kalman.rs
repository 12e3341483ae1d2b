//! `floor-kalman-as-printed`: the filter of P5, section 5, with the displacement u taken as the last
//! posterior difference.
//!
//! Equation 6 leaves the noise of u out of the prediction: the covariance is `P + Q`, where that of
//! the difference of two posteriors is larger.

use std::collections::BTreeMap;

use nalgebra::{Isometry2, Matrix2, Point2, Point3, SMatrix, Vector2};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_config::Registry;
use tagalong_core::{
    Detection, EgoMotion, Estimate, Evidence, Filter, Person, Result, TrackId, Update,
};
use tagalong_geometry::Camera;

/// A coordinate with a larger variance, m², was not measured.
const UNMEASURED_M2: f64 = 100.0;
/// Random walk of the height of the head, m per square root of a second, of which the paper says
/// nothing.
const HEIGHT_NOISE: f64 = 0.03;
/// Variance of each velocity component of a new track, m²/s², likewise.
const INITIAL_SPEED_M2: f64 = 1.0;
/// Q of the paper, m², ...
const PROCESS_M2: Matrix2<f64> = Matrix2::new(0.024, -0.001, -0.001, 0.043);
/// ... for the time between two of its images, s.
const STEP_S: f64 = 1.0 / 3.0;
/// R of the paper, m².
const MEASUREMENT_M2: Matrix2<f64> = Matrix2::new(0.011, -0.004, -0.004, 0.020);

/// Settings of the filter `floor-kalman-as-printed`: none.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Config {}

/// Gaussian state of a person, in the room.
#[derive(Clone, Debug)]
struct State {
    position: Point2<f64>,
    covariance: Matrix2<f64>,
    /// Velocity by the last prediction, m/s.
    velocity: Vector2<f64>,
    /// Height of the head, m, and its variance, m².
    height_m: f64,
    height_m2: f64,
    /// Posterior before the last one.
    before: Option<Point2<f64>>,
}

impl State {
    /// Predicts by the last posterior difference (equations 5 and 6).
    fn predict(&mut self, dt_s: f64, ego: &Matrix2<f64>) {
        let here = self.position;
        if let Some(before) = self.before {
            let u = here - before;
            self.position = here + u;
            if dt_s > 0.0 {
                self.velocity = u / dt_s;
            }
        }
        self.covariance += PROCESS_M2 * (dt_s / STEP_S);
        self.covariance += ego;
        self.before = Some(here);
        self.height_m2 += HEIGHT_NOISE.powi(2) * dt_s;
    }

    /// Updates by a place (equations 7 to 9); returns the normalised innovation squared, or `None`
    /// for a covariance that rounding has spoilt.
    fn correct(&mut self, place: &Point2<f64>) -> Option<f64> {
        let innovation = place - self.position;
        let s = (self.covariance + MEASUREMENT_M2).cholesky()?;
        let nis = innovation.dot(&s.solve(&innovation));
        let gain = s.solve(&self.covariance).transpose();
        self.position += gain * innovation;
        let kept = Matrix2::identity() - gain;
        let p =
            kept * self.covariance * kept.transpose() + gain * MEASUREMENT_M2 * gain.transpose();
        self.covariance = 0.5 * (p + p.transpose());
        Some(nis)
    }

    /// Updates the height alone.
    fn correct_height(&mut self, z_m: f64, variance_m2: f64) {
        let gain = self.height_m2 / (self.height_m2 + variance_m2);
        if gain.is_finite() {
            self.height_m += gain * (z_m - self.height_m);
            self.height_m2 *= 1.0 - gain;
        }
    }
}

/// The printed filter; its room is the frame of the robot at the start.
#[derive(Default)]
pub struct PrintedFloorKalman {
    room_from_robot: Isometry2<f64>,
    states: BTreeMap<TrackId, State>,
}

impl PrintedFloorKalman {
    fn place(&self, detection: &Detection) -> Point2<f64> {
        self.room_from_robot * detection.position.xy()
    }

    /// Returns the noise of a place in the room due to the uncertain motion of the robot.
    fn ego_noise(&self, at: &Point2<f64>, motion: &EgoMotion) -> Matrix2<f64> {
        let away = at.coords - self.room_from_robot.translation.vector;
        let turn = *self.room_from_robot.rotation.to_rotation_matrix().matrix();
        let mut jacobian = SMatrix::<f64, 2, 3>::zeros();
        jacobian.fixed_view_mut::<2, 2>(0, 0).copy_from(&turn);
        jacobian.set_column(2, &Vector2::new(-away.y, away.x));
        jacobian * motion.covariance * jacobian.transpose()
    }

    fn estimate(&self, state: &State, camera: &Camera) -> Estimate {
        let back = self.room_from_robot.inverse();
        let turn = *back.rotation.to_rotation_matrix().matrix();
        let place = back * state.position;
        let position = Point3::new(place.x, place.y, state.height_m);
        let mut covariance = SMatrix::<f64, 5, 5>::zeros();
        let block = turn * state.covariance * turn.transpose();
        covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&block);
        covariance[(2, 2)] = state.height_m2;
        covariance[(3, 3)] = INITIAL_SPEED_M2;
        covariance[(4, 4)] = INITIAL_SPEED_M2;
        Estimate::new(
            Person { position, velocity: turn * state.velocity },
            covariance,
            camera.upper_body(&position),
        )
    }
}

impl Filter for PrintedFloorKalman {
    fn start(&mut self, id: TrackId, detection: &Detection, _: &Camera) {
        let state = State {
            position: self.place(detection),
            covariance: MEASUREMENT_M2,
            velocity: Vector2::zeros(),
            height_m: detection.position.z,
            height_m2: detection.covariance[(2, 2)],
            before: None,
        };
        self.states.insert(id, state);
    }

    fn predict(&mut self, motion: &EgoMotion, _: &Camera) {
        let mut states = std::mem::take(&mut self.states);
        self.room_from_robot *= motion.isometry();
        for state in states.values_mut() {
            let ego = self.ego_noise(&state.position, motion);
            state.predict(motion.dt, &ego);
        }
        self.states = states;
    }

    fn update(&mut self, evidence: &Evidence<'_>) -> Result<BTreeMap<TrackId, Update>> {
        let mut supported = BTreeMap::new();
        for (id, detection) in evidence.best_matches() {
            let place = self.place(detection);
            let Some(state) = self.states.get_mut(&id) else { continue };
            let nis = state.correct(&place);
            let height_m2 = detection.covariance[(2, 2)];
            if height_m2 < UNMEASURED_M2 {
                state.correct_height(detection.position.z, height_m2);
            }
            supported.insert(id, Update::new(nis.map(|nis| (nis, 2))));
        }
        Ok(supported)
    }

    fn estimates(&self, camera: &Camera) -> BTreeMap<TrackId, Estimate> {
        self.states.iter().map(|(id, state)| (*id, self.estimate(state, camera))).collect()
    }

    fn stop(&mut self, id: TrackId) {
        self.states.remove(&id);
    }
}

/// Registers the filter.
pub fn register(registry: &mut Registry) {
    registry.filter(
        "floor-kalman-as-printed",
        "Kalman filter on the floor plan with the equations of P5, u the last difference",
        |_: Config, _| Ok(PrintedFloorKalman::default()),
    );
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::Matrix3;
    use tagalong_core::{Frame, Images, Matched, Stamp};
    use tagalong_filters::floor_kalman::{FloorKalman, Form, Measurement};
    use tagalong_geometry::{Distortion, ImageBox, Pinhole, Rect};

    use super::*;

    const ID: TrackId = TrackId(1);

    fn camera() -> Camera {
        let lens =
            Pinhole { fx: 300.0, fy: 300.0, cx: 160.0, cy: 120.0, distortion: Distortion::None };
        Camera::mounted(lens, 320, 240, 1.2, 0.0, 0.0)
    }

    fn detection(x: f64) -> Detection {
        Detection::new("test", Point3::new(x, 0.0, 1.6), Matrix3::from_diagonal_element(0.02), 1.0)
            .with_image(ImageBox::upper_body(Rect::new(0.0, 0.0, 9.0, 9.0)))
    }

    /// Returns the prediction after a steady walk that was observed without noise.
    fn after_a_walk(filter: &mut dyn Filter) -> Estimate {
        let motion = EgoMotion::at_rest(1.0 / 3.0);
        let frame = Frame::new(1, Stamp::default(), Arc::new(camera()), motion, Images::default());
        filter.start(ID, &detection(2.0), &camera());
        for step in 1..=30 {
            filter.predict(&motion, &camera());
            let seen = detection(2.0 + 0.2 * f64::from(step));
            let matched = [Matched::certain(ID, &seen)];
            let evidence = Evidence::new(&frame, &matched);
            filter.update(&evidence).unwrap();
        }
        filter.predict(&motion, &camera());
        filter.estimates(&camera())[&ID].clone()
    }

    #[test]
    fn a_walk_is_foreseen_with_too_small_a_covariance() {
        let settings = tagalong_filters::floor_kalman::Config {
            form: Form::LastDifference,
            measurement: Measurement::Fixed,
            ..Default::default()
        };
        let corrected = after_a_walk(&mut FloorKalman::new(settings).unwrap());
        let printed = after_a_walk(&mut PrintedFloorKalman::default());
        assert!((printed.person.position.x - 8.2).abs() < 0.03, "{}", printed.person.position);
        assert!(corrected.covariance[(0, 0)] > 1.3 * printed.covariance[(0, 0)]);
    }

    #[test]
    fn equations_5_to_9_are_those_of_the_paper() {
        let mut filter = PrintedFloorKalman::default();
        filter.start(ID, &detection(1.0), &camera());
        let state = filter.states.get_mut(&ID).unwrap();
        let mut x = [Vector2::new(1.0, 0.0); 2];
        let mut p = MEASUREMENT_M2;
        for (step, z) in [(1.2, 2.1), (1.3, 2.5), (1.1, 2.9)].into_iter().enumerate() {
            let u = if step == 0 { Vector2::zeros() } else { x[1] - x[0] };
            let predicted = x[1] + u;
            p += PROCESS_M2;
            let gain = p * (p + MEASUREMENT_M2).try_inverse().unwrap();
            x = [x[1], predicted + gain * (Vector2::new(z.0, z.1) - predicted)];
            p = (Matrix2::identity() - gain) * p;
            state.predict(STEP_S, &Matrix2::zeros());
            state.correct(&Point2::new(z.0, z.1)).unwrap();
            assert!((state.position.coords - x[1]).norm() < 1e-12, "{step}");
            assert!((state.covariance - p).norm() < 1e-12, "{step}");
        }
    }
}
