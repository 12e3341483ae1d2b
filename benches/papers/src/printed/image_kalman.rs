//! `image-kalman-as-printed`: the filter of P2, section III-D.
//!
//! The printed measurement matrix (equation 8) contains the time step although it is applied to a
//! state that is predicted already, so that estimates lag by the motion of a frame; and the motion
//! of the robot is not compensated.

use std::collections::BTreeMap;

use nalgebra::Matrix5;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_config::Registry;
use tagalong_core::{
    Detection, EgoMotion, Estimate, Evidence, Filter, FilterRequirements, Inputs, Result, TrackId,
    Update,
};
use tagalong_filters::image_kalman::State;
use tagalong_geometry::Camera;

/// Settings of the filter `image-kalman-as-printed`: none, all others are those of `image-kalman`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Config {}

/// The printed filter.
#[derive(Default)]
pub struct PrintedImageKalman {
    settings: tagalong_filters::image_kalman::Config,
    states: BTreeMap<TrackId, State>,
    /// Time between the last two frames, s.
    step_s: f64,
}

impl PrintedImageKalman {
    /// Updates a state by the printed measurement matrix `H = H0 T(dt)`, where `T` predicts and `H0`
    /// is the right one: `H` measures of a state what `H0` measures of the state one step later.
    fn correct(&self, state: &mut State, detection: &Detection, camera: &Camera) -> Update {
        shift(state, self.step_s);
        let update = state.correct(&self.settings, detection, camera);
        shift(state, -self.step_s);
        update
    }
}

/// Moves a state by its velocity for a time, s.
fn shift(state: &mut State, dt_s: f64) {
    let mut step = Matrix5::identity();
    step[(0, 2)] = dt_s;
    step[(1, 3)] = dt_s;
    state.image = step * state.image;
    let moved = step * state.image_covariance * step.transpose();
    state.image_covariance = 0.5 * (moved + moved.transpose());
}

impl Filter for PrintedImageKalman {
    fn requirements(&self) -> FilterRequirements {
        FilterRequirements::new(Inputs::NONE).with_image_box()
    }

    fn start(&mut self, id: TrackId, detection: &Detection, camera: &Camera) {
        self.states.insert(id, State::start(&self.settings, detection, camera));
    }

    fn predict(&mut self, motion: &EgoMotion, camera: &Camera) {
        self.step_s = motion.dt;
        let at_rest = EgoMotion::at_rest(motion.dt);
        self.states.values_mut().for_each(|state| state.predict(&self.settings, &at_rest, camera));
    }

    fn update(&mut self, evidence: &Evidence<'_>) -> Result<BTreeMap<TrackId, Update>> {
        let camera = &evidence.frame.camera;
        let mut supported = BTreeMap::new();
        for (id, detection) in evidence.best_matches() {
            let Some(mut state) = self.states.remove(&id) else { continue };
            supported.insert(id, self.correct(&mut state, detection, camera));
            self.states.insert(id, state);
        }
        Ok(supported)
    }

    fn estimates(&self, camera: &Camera) -> BTreeMap<TrackId, Estimate> {
        self.states.iter().map(|(id, state)| (*id, state.estimate(camera))).collect()
    }

    fn stop(&mut self, id: TrackId) {
        self.states.remove(&id);
    }
}

/// Registers the filter.
pub fn register(registry: &mut Registry) {
    registry.filter(
        "image-kalman-as-printed",
        "Kalman filter of the box in the image with the equations of P2 as printed",
        |_: Config, _| Ok(PrintedImageKalman::default()),
    );
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::{Matrix3, Point3};
    use tagalong_core::{Frame, Images, Matched, Stamp};
    use tagalong_geometry::{Distortion, ImageBox, Pinhole, Rect};

    use tagalong_filters::image_kalman::ImageKalman;

    use super::*;

    fn corrected() -> ImageKalman {
        ImageKalman::new(tagalong_filters::image_kalman::Config::default()).unwrap()
    }

    const DT_S: f64 = 1.0 / 23.0;
    const ID: TrackId = TrackId(1);

    fn camera() -> Arc<Camera> {
        let lens =
            Pinhole { fx: 525.0, fy: 520.0, cx: 319.5, cy: 239.5, distortion: Distortion::None };
        Arc::new(Camera::mounted(lens, 640, 480, 1.3, 0.15, 0.05))
    }

    fn person(head: Point3<f64>) -> Detection {
        Detection::new("test", head, Matrix3::identity() * 1e-4, 3.0)
            .with_image(ImageBox::upper_body(camera().upper_body(&head)))
    }

    /// Returns the estimate after the detections of one person, each after a motion of the robot.
    fn fed(filter: &mut dyn Filter, detections: &[Detection], motion: EgoMotion) -> Estimate {
        let camera = camera();
        filter.start(ID, &detections[0], &camera);
        for seen in &detections[1..] {
            filter.predict(&motion, &camera);
            let frame =
                Frame::new(1, Stamp::default(), Arc::clone(&camera), motion, Images::default());
            let matched = [Matched::certain(ID, seen)];
            let evidence = Evidence::new(&frame, &matched);
            filter.update(&evidence).unwrap();
        }
        filter.estimates(&camera)[&ID].clone()
    }

    /// Of a box that moves by 120 pixels a second.
    #[test]
    fn the_estimate_lags_by_one_frame_and_the_corrected_one_does_not() {
        let start = person(Point3::new(4.0, 1.0, 1.6));
        let first = start.rect().unwrap();
        let sliding: Vec<Detection> = (0..60)
            .map(|i| {
                let rect = Rect { x: first.x + 120.0 * DT_S * f64::from(i), ..first };
                start.clone().with_image(ImageBox::upper_body(rect))
            })
            .collect();
        let last = sliding[59].rect().unwrap().centre().x;
        let still = EgoMotion::at_rest(DT_S);
        let seen = fed(&mut PrintedImageKalman::default(), &sliding, still);
        let printed = last - seen.region.centre().x;
        assert!((printed - 120.0 * DT_S).abs() < 0.2, "{printed}");
        let seen = fed(&mut corrected(), &sliding, still);
        assert!((last - seen.region.centre().x).abs() < 0.1);
    }

    #[test]
    fn a_standing_person_runs_while_the_robot_turns_and_stands_by_the_corrected_filter() {
        let motion = EgoMotion { forward: 0.02, turn: 0.015, ..EgoMotion::at_rest(DT_S) };
        let mut place = Point3::new(5.0, -0.5, 1.65);
        let mut seen = vec![person(place)];
        for _ in 1..30 {
            let floor = motion.apply_to_point(place.xy());
            place = Point3::new(floor.x, floor.y, place.z);
            seen.push(person(place));
        }
        let printed = fed(&mut PrintedImageKalman::default(), &seen, motion);
        assert!(printed.person.velocity.norm() > 1.0);
        assert!(fed(&mut corrected(), &seen, motion).person.velocity.norm() < 0.1);
    }
}
