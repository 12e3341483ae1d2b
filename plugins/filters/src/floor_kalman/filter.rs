use std::collections::BTreeMap;

use nalgebra::{Isometry2, Matrix2, Matrix2x3, Point3, Rotation2, SMatrix, Vector2};
use tagalong_core::{
    Detection, EgoMotion, Estimate, Evidence, Filter, Person, Result, TrackId, Update,
};
use tagalong_geometry::Camera;

use crate::floor_kalman::state::State;
use crate::floor_kalman::{Config, Measurement};

/// A coordinate with a larger variance, m², was not measured.
const UNMEASURED_M2: f64 = 100.0;

/// The filter: states about everybody in the room.
pub struct FloorKalman {
    config: Config,
    room_from_robot: Isometry2<f64>,
    states: BTreeMap<TrackId, State>,
}

impl FloorKalman {
    /// A filter whose room begins where the robot is.
    ///
    /// # Errors
    /// [`tagalong_core::Error::Settings`] for numbers that cannot work.
    pub fn new(config: Config) -> Result<Self> {
        config.check()?;
        let turn = -config.room_heading_deg.to_radians();
        let room_from_robot = Isometry2::new(Vector2::zeros(), turn);
        Ok(Self { config, room_from_robot, states: BTreeMap::new() })
    }

    fn rotation(&self) -> Matrix2<f64> {
        *self.room_from_robot.rotation.to_rotation_matrix().matrix()
    }

    /// Where a detection is in the room, and R in room axes.
    fn measured(&self, detection: &Detection) -> (Vector2<f64>, Matrix2<f64>) {
        let at = detection.position.xy();
        let in_room = self.room_from_robot * at;
        let r = match self.config.measurement {
            Measurement::Fixed => return (in_room.coords, self.config.fixed_measurement()),
            Measurement::Polar => self.polar(&at.coords),
            Measurement::Detection => detection.covariance.fixed_view::<2, 2>(0, 0).into_owned(),
        };
        (in_room.coords, turned(&self.rotation(), &r))
    }

    /// R = J diag(sigma_r², sigma_bearing²) J' in the robot's axes.
    fn polar(&self, at: &Vector2<f64>) -> Matrix2<f64> {
        let range = at.norm();
        let along = self.config.sigma_range_m + self.config.sigma_range_per_m * range;
        let across = range.max(0.1) * self.config.sigma_bearing_deg.to_radians();
        let out = Rotation2::new(at.y.atan2(at.x));
        turned(out.matrix(), &Matrix2::new(along * along, 0.0, 0.0, across * across))
    }

    /// Returns the noise of a place in the room, in robot axes, due to the uncertain motion of the
    /// robot.
    fn ego_noise(&self, at: &Vector2<f64>, motion: &EgoMotion) -> Matrix2<f64> {
        let from_robot = at - self.room_from_robot.translation.vector;
        let mut j = Matrix2x3::zeros();
        j.fixed_view_mut::<2, 2>(0, 0).copy_from(&self.rotation());
        j.set_column(2, &Vector2::new(-from_robot.y, from_robot.x));
        j * motion.covariance * j.transpose()
    }

    fn estimate(&self, state: &State, camera: &Camera) -> Estimate {
        let back = self.room_from_robot.inverse();
        let turn = *back.rotation.to_rotation_matrix().matrix();
        let place = back * nalgebra::Point2::from(state.position());
        let position = Point3::new(place.x, place.y, state.height.0);
        let (velocity, velocity_covariance) = state.velocity();
        let mut covariance = SMatrix::<f64, 5, 5>::zeros();
        let cross = state.covariance.fixed_view::<2, 2>(0, 2).into_owned();
        for (row, column, block) in [
            (0, 0, state.position_covariance()),
            (3, 3, velocity_covariance),
            (0, 3, cross),
            (3, 0, cross.transpose()),
        ] {
            covariance.fixed_view_mut::<2, 2>(row, column).copy_from(&turned(&turn, &block));
        }
        covariance[(2, 2)] = state.height.1;
        Estimate::new(
            Person { position, velocity: turn * velocity },
            covariance,
            camera.upper_body(&position),
        )
    }
}

impl Filter for FloorKalman {
    fn start(&mut self, id: TrackId, detection: &Detection, _: &Camera) {
        let (at, r) = self.measured(detection);
        let height = (detection.position.z, detection.covariance[(2, 2)]);
        self.states.insert(id, State::new(at, &r, height, &self.config));
    }

    fn predict(&mut self, motion: &EgoMotion, _: &Camera) {
        let mut states = std::mem::take(&mut self.states);
        self.room_from_robot *= motion.isometry();
        for state in states.values_mut() {
            let ego = self.ego_noise(&state.position(), motion);
            state.predict(motion.dt, &ego, &self.config);
        }
        self.states = states;
    }

    fn update(&mut self, evidence: &Evidence<'_>) -> Result<BTreeMap<TrackId, Update>> {
        let mut supported = BTreeMap::new();
        for (id, detection) in evidence.best_matches() {
            let (z, r) = self.measured(detection);
            let Some(state) = self.states.get_mut(&id) else { continue };
            let nis = state.correct(&z, &r, self.config.form);
            let height = detection.covariance[(2, 2)];
            if height < UNMEASURED_M2 {
                state.correct_height(detection.position.z, height);
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

/// A covariance in other axes.
fn turned(turn: &Matrix2<f64>, covariance: &Matrix2<f64>) -> Matrix2<f64> {
    turn * covariance * turn.transpose()
}
