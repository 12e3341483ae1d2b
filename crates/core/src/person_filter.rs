use std::collections::BTreeMap;

use crate::{Detection, EgoMotion, Estimate, Evidence, Filter, Matched, Result, TrackId, Update};
use tagalong_geometry::Camera;

/// A filter of one person.
pub trait PersonFilter: Send {
    /// State of a person.
    type State: Clone + Send;

    /// Returns the state after the first detection.
    fn start(&self, detection: &Detection) -> Self::State;

    /// Moves a state into the robot's new frame and forward in time.
    fn predict(&self, state: &mut Self::State, motion: &EgoMotion);

    /// Updates a state with a detection.
    fn correct(&self, state: &mut Self::State, detection: &Detection, camera: &Camera) -> Update;

    /// Merges alternative states of one person into one; the weights sum to 1 and the heaviest
    /// comes first. A filter with mean and covariance matches the moments of the mixture; by
    /// default the heaviest alternative is kept.
    fn merge(&self, alternatives: &[(f64, Self::State)]) -> Self::State {
        alternatives[0].1.clone()
    }

    /// Converts a state to an estimate.
    fn estimate(&self, state: &Self::State, camera: &Camera) -> Estimate;
}

/// Adapter from a [`PersonFilter`] to a [`Filter`] with one state per person.
pub struct PerPerson<F: PersonFilter> {
    filter: F,
    states: BTreeMap<TrackId, F::State>,
}

impl<F: PersonFilter> PerPerson<F> {
    /// Wraps `filter`.
    pub fn new(filter: F) -> Self {
        Self { filter, states: BTreeMap::new() }
    }
}

impl<F: PersonFilter> PerPerson<F> {
    /// Updates a state with weighted alternatives: each detection, and a missed detection with the
    /// weight that is missing from 1 (Bar-Shalom and Tse's probabilistic data association).
    fn correct_weighted(
        filter: &F,
        state: &mut F::State,
        matches: &[Matched<'_>],
        camera: &Camera,
    ) -> Update {
        let mut supports = Vec::new();
        let mut alternatives: Vec<(f64, F::State)> = Vec::new();
        for matched in matches {
            let mut corrected = state.clone();
            supports.push(filter.correct(&mut corrected, matched.detection, camera));
            alternatives.push((matched.weight, corrected));
        }
        let missed = 1.0 - matches.iter().map(|matched| matched.weight).sum::<f64>();
        if missed > CERTAINTY {
            alternatives.push((missed, state.clone()));
        }
        // The sort is stable, so equal weights keep the order of the detections and runs are
        // repeatable.
        alternatives.sort_by(|a, b| b.0.total_cmp(&a.0));
        *state = filter.merge(&alternatives);
        let heaviest =
            matches.iter().zip(&supports).max_by(|a, b| a.0.weight.total_cmp(&b.0.weight));
        heaviest.map_or(Update::default(), |(_, support)| *support)
    }
}

/// Difference from 0 or 1 below which a weight counts as a decision without alternatives.
const CERTAINTY: f64 = 1e-9;

impl<F: PersonFilter> Filter for PerPerson<F> {
    fn start(&mut self, id: TrackId, detection: &Detection, _: &Camera) {
        self.states.insert(id, self.filter.start(detection));
    }

    fn predict(&mut self, motion: &EgoMotion, _: &Camera) {
        for state in self.states.values_mut() {
            self.filter.predict(state, motion);
        }
    }

    fn update(&mut self, evidence: &Evidence<'_>) -> Result<BTreeMap<TrackId, Update>> {
        let camera = &evidence.frame.camera;
        let mut supported = BTreeMap::new();
        // A stable sort, so that the matches of a track stay in the order of the detections.
        let mut matched = evidence.matched.to_vec();
        matched.sort_by_key(|matched| matched.id);
        for matches in matched.chunk_by(|a, b| a.id == b.id) {
            let id = matches[0].id;
            let Some(state) = self.states.get_mut(&id) else { continue };
            let support = match matches {
                // A single certain match skips the mixture, so that one-to-one associations stay
                // exact.
                [only] if only.weight > 1.0 - CERTAINTY => {
                    self.filter.correct(state, only.detection, camera)
                }
                several => Self::correct_weighted(&self.filter, state, several, camera),
            };
            supported.insert(id, support);
        }
        Ok(supported)
    }

    fn estimates(&self, camera: &Camera) -> BTreeMap<TrackId, Estimate> {
        self.states.iter().map(|(id, state)| (*id, self.filter.estimate(state, camera))).collect()
    }

    fn stop(&mut self, id: TrackId) {
        self.states.remove(&id);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use crate::{FilterRequirements, Frame, Images, Person, Stamp};
    use nalgebra::{Matrix3, Point3, SMatrix, Vector2};
    use tagalong_geometry::{Distortion, Pinhole};

    use super::*;

    /// A filter that keeps the last position, moved along by the robot.
    struct Last;

    impl PersonFilter for Last {
        type State = Point3<f64>;

        fn start(&self, detection: &Detection) -> Point3<f64> {
            detection.position
        }

        fn predict(&self, state: &mut Point3<f64>, motion: &EgoMotion) {
            state.x -= motion.forward;
        }

        fn correct(&self, state: &mut Point3<f64>, seen: &Detection, _: &Camera) -> Update {
            let off = seen.position - *state;
            *state = seen.position;
            Update::new(Some((off.norm_squared(), 3)))
        }

        fn estimate(&self, state: &Point3<f64>, camera: &Camera) -> Estimate {
            let person = Person { position: *state, velocity: Vector2::zeros() };
            let region = camera.upper_body(state);
            Estimate::new(person, SMatrix::identity(), region)
        }
    }

    fn frame() -> Frame {
        let lens = Pinhole { fx: 50.0, fy: 50.0, cx: 32.0, cy: 24.0, distortion: Distortion::None };
        let camera = Arc::new(Camera::mounted(lens, 64, 48, 1.2, 0.0, 0.0));
        Frame::new(1, Stamp::default(), camera, EgoMotion::at_rest(0.1), Images::default())
    }

    fn seen(x: f64) -> Detection {
        let position = Point3::new(x, 0.0, 1.6);
        let covariance = Matrix3::identity();
        Detection::new("test", position, covariance, 1.0)
    }

    #[test]
    fn a_filter_of_one_person_is_lifted_to_all() {
        let frame = frame();
        let mut filter = PerPerson::new(Last);
        let places = |filter: &PerPerson<Last>| {
            let estimates = filter.estimates(&frame.camera).into_iter();
            estimates.map(|(id, e)| (id.0, e.person.position.x)).collect::<Vec<_>>()
        };
        filter.start(TrackId(1), &seen(2.0), &frame.camera);
        filter.start(TrackId(2), &seen(5.0), &frame.camera);
        filter.predict(&EgoMotion { forward: 0.5, ..EgoMotion::at_rest(0.1) }, &frame.camera);
        assert_eq!(places(&filter), [(1, 1.5), (2, 4.5)]);
        let detection = seen(4.0);
        let stranger = seen(9.0);
        let matched =
            [Matched::certain(TrackId(2), &detection), Matched::certain(TrackId(7), &stranger)];
        let evidence = Evidence::new(&frame, &matched);
        let supported = filter.update(&evidence).unwrap();
        let expected = [(TrackId(2), Update::new(Some((0.25, 3))))];
        assert_eq!(supported, BTreeMap::from(expected), "and nobody else");
        assert_eq!(places(&filter), [(1, 1.5), (2, 4.0)]);
        filter.stop(TrackId(1));
        assert_eq!(places(&filter), [(2, 4.0)]);
        assert_eq!(filter.requirements(), FilterRequirements::default());
        assert!(filter.visualise(&evidence).unwrap().is_none());
    }
}
