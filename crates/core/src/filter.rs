use std::collections::BTreeMap;

use nalgebra::{Point3, SMatrix, Vector2};

use crate::{Detection, EgoMotion, Frame, Inputs, Likelihood, Result, Sketch, TrackId};
use tagalong_geometry::{Camera, Rect};

/// State of a person in the robot frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Person {
    /// Centre of the head, m.
    pub position: Point3<f64>,
    /// Velocity over ground (not relative to the robot), in robot axes, m/s.
    pub velocity: Vector2<f64>,
}

/// State estimate of one person.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    /// The mean.
    pub person: Person,
    /// Covariance of (x, y, z, vx, vy).
    pub covariance: SMatrix<f64, 5, 5>,
    /// The expected upper-body square in the image.
    pub region: Rect,
}

impl Estimate {
    /// Returns true if every number is finite and no variance is negative.
    pub fn is_sane(&self) -> bool {
        self.person.position.iter().all(|v| v.is_finite())
            && self.person.velocity.iter().all(|v| v.is_finite())
            && self.covariance.iter().all(|v| v.is_finite())
            && self.covariance.diagonal().iter().all(|v| *v >= 0.0)
            && self.region.is_sane()
    }
}

/// A detection that the association assigned to a track.
#[derive(Clone, Copy)]
pub struct Matched<'a> {
    /// The track.
    pub id: TrackId,
    /// Its detection.
    pub detection: &'a Detection,
    /// Probability that the detection belongs to the track, above 0 and at most 1.
    pub weight: f64,
}

impl<'a> Matched<'a> {
    /// Returns a match of weight 1.
    pub fn certain(id: TrackId, detection: &'a Detection) -> Self {
        Self { id, detection, weight: 1.0 }
    }
}

/// Evidence of one frame for the tracks of a filter.
pub struct Evidence<'a> {
    /// The frame.
    pub frame: &'a Frame,
    /// Detections with their track. A track appears once, with the weight 1, or several times with
    /// weights that sum to at most 1 if the associator weighs alternatives.
    pub matched: &'a [Matched<'a>],
    /// Detections without a track.
    pub unmatched: &'a [Detection],
    /// The scene likelihood, if a detector of the pipeline has one.
    pub likelihood: Option<&'a dyn Likelihood>,
}

impl<'a> Evidence<'a> {
    /// Returns the most probable detection of each track, for filters that use one.
    pub fn best_matches(&self) -> BTreeMap<TrackId, &'a Detection> {
        let mut best: BTreeMap<TrackId, Matched<'a>> = BTreeMap::new();
        for matched in self.matched {
            let slot = best.entry(matched.id).or_insert(*matched);
            if matched.weight > slot.weight {
                *slot = *matched;
            }
        }
        best.into_iter().map(|(id, matched)| (id, matched.detection)).collect()
    }
}

/// Result of the update of one track.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Update {
    /// Normalised innovation squared and its degrees of freedom, from filters that have an
    /// innovation. Its mean over a run of a consistent filter equals the degrees of freedom.
    pub nis: Option<(f64, u32)>,
}

/// The declaration of a filter: the data that it uses. A pipeline that lacks them is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct FilterRequirements {
    /// The inputs that the filter itself uses; most filters leave images to detectors.
    pub inputs: Inputs,
    /// True if it uses detections with a box in the image alone. The tracker drops the others, as
    /// "no image box".
    pub image_box: bool,
    /// True if it requires a [`Likelihood`]. It then weighs each frame itself: a track that it does
    /// not support was searched for, whether or not a detector ran.
    pub likelihood: bool,
}

/// Estimates the states of **all** people at once, so that a joint filter needs no special
/// interface. Filters of one person are adapted by [`PerPerson`].
///
/// ```
/// # use std::collections::BTreeMap;
/// # use nalgebra::{Isometry3, Point3, SMatrix, Vector2};
/// # use tagalong_core::*;
/// # use tagalong_geometry::Camera;
/// /// Keeps each person where the last detection was.
/// #[derive(Default)]
/// struct LastSeen(BTreeMap<TrackId, Point3<f64>>);
///
/// impl Filter for LastSeen {
///     fn start(&mut self, id: TrackId, detection: &Detection, _: &Camera) {
///         self.0.insert(id, detection.position);
///     }
///
///     fn predict(&mut self, motion: &EgoMotion, _: &Camera) {
///         for position in self.0.values_mut() {
///             let floor = motion.apply_to_point(position.xy());
///             *position = Point3::new(floor.x, floor.y, position.z);
///         }
///     }
///
///     fn update(&mut self, evidence: &Evidence<'_>) -> Result<BTreeMap<TrackId, Update>> {
///         let seen = evidence.best_matches().into_iter();
///         let update = |(id, detection): (TrackId, &Detection)| {
///             self.0.insert(id, detection.position);
///             (id, Update::default())
///         };
///         Ok(seen.map(update).collect())
///     }
///
///     fn estimates(&self, camera: &Camera) -> BTreeMap<TrackId, Estimate> {
///         let estimate = |position: &Point3<f64>| Estimate {
///             person: Person { position: *position, velocity: Vector2::zeros() },
///             covariance: SMatrix::identity(),
///             region: camera.upper_body(position),
///         };
///         self.0.iter().map(|(id, position)| (*id, estimate(position))).collect()
///     }
///
///     fn stop(&mut self, id: TrackId) {
///         self.0.remove(&id);
///     }
/// }
///
/// # let (position, covariance) = (Point3::new(2.0, 0.0, 1.6), nalgebra::Matrix3::identity());
/// # let seen = Detection { image: None, position, covariance, score: 1.0, source: "example" };
/// let (mut filter, camera) = (LastSeen::default(), Camera::blind(Isometry3::identity()));
/// filter.start(TrackId(1), &seen, &camera);
/// filter.predict(&EgoMotion { forward: 0.5, ..EgoMotion::at_rest(0.1) }, &camera);
/// assert_eq!(filter.estimates(&camera)[&TrackId(1)].person.position.x, 1.5);
/// ```
pub trait Filter: Send {
    /// Returns the requirements of the filter with its settings; most filters have none.
    fn requirements(&self) -> FilterRequirements {
        FilterRequirements::default()
    }

    /// Starts the state of a new track. `id` is new.
    fn start(&mut self, id: TrackId, detection: &Detection, camera: &Camera);

    /// Moves every state into the robot's new frame and forward in time. `camera` is that of the
    /// new frame.
    fn predict(&mut self, motion: &EgoMotion, camera: &Camera);

    /// Updates the states with the evidence of a frame and returns the supported tracks.
    ///
    /// # Errors
    /// [`crate::Error::MissingImage`] if a scene cannot be weighed.
    fn update(&mut self, evidence: &Evidence<'_>) -> Result<BTreeMap<TrackId, Update>>;

    /// Returns the estimates of all tracks, with their regions in the image of `camera`.
    fn estimates(&self, camera: &Camera) -> BTreeMap<TrackId, Estimate>;

    /// Discards the state of a track.
    fn stop(&mut self, id: TrackId);

    /// Returns a visualisation of the last update, given the same evidence. Called for
    /// visualisation only.
    ///
    /// # Errors
    /// As [`Filter::update`].
    fn sketch(&self, evidence: &Evidence<'_>) -> Result<Sketch> {
        let _ = evidence;
        Ok(Sketch::default())
    }
}

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
        for (id, matches) in by_track(evidence.matched) {
            let Some(state) = self.states.get_mut(&id) else { continue };
            let support = match &matches[..] {
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

/// Groups the matches by track.
fn by_track<'a>(matched: &[Matched<'a>]) -> BTreeMap<TrackId, Vec<Matched<'a>>> {
    let mut groups: BTreeMap<TrackId, Vec<Matched<'a>>> = BTreeMap::new();
    for matched in matched {
        groups.entry(matched.id).or_default().push(*matched);
    }
    groups
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::Matrix3;

    use super::*;
    use crate::{Images, Stamp};
    use tagalong_geometry::{Distortion, Pinhole};

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
            Update { nis: Some((off.norm_squared(), 3)) }
        }

        fn estimate(&self, state: &Point3<f64>, camera: &Camera) -> Estimate {
            let person = Person { position: *state, velocity: Vector2::zeros() };
            let region = camera.upper_body(state);
            Estimate { person, covariance: SMatrix::identity(), region }
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
        Detection { image: None, position, covariance, score: 1.0, source: "test" }
    }

    #[test]
    fn a_filter_of_one_person_is_lifted_to_all() {
        let (frame, mut filter) = (frame(), PerPerson::new(Last));
        let places = |filter: &PerPerson<Last>| {
            let estimates = filter.estimates(&frame.camera).into_iter();
            estimates.map(|(id, e)| (id.0, e.person.position.x)).collect::<Vec<_>>()
        };
        filter.start(TrackId(1), &seen(2.0), &frame.camera);
        filter.start(TrackId(2), &seen(5.0), &frame.camera);
        filter.predict(&EgoMotion { forward: 0.5, ..EgoMotion::at_rest(0.1) }, &frame.camera);
        assert_eq!(places(&filter), [(1, 1.5), (2, 4.5)]);
        let (detection, stranger) = (seen(4.0), seen(9.0));
        let matched =
            [Matched::certain(TrackId(2), &detection), Matched::certain(TrackId(7), &stranger)];
        let evidence =
            Evidence { frame: &frame, matched: &matched, unmatched: &[], likelihood: None };
        let supported = filter.update(&evidence).unwrap();
        let expected = [(TrackId(2), Update { nis: Some((0.25, 3)) })];
        assert_eq!(supported, BTreeMap::from(expected), "and nobody else");
        assert_eq!(places(&filter), [(1, 1.5), (2, 4.0)]);
        filter.stop(TrackId(1));
        assert_eq!(places(&filter), [(2, 4.0)]);
        assert_eq!(filter.requirements(), FilterRequirements::default());
        assert_eq!(filter.sketch(&evidence), Ok(Sketch::default()));
    }

    #[test]
    fn every_number_of_an_estimate_is_looked_at() {
        let person = Person { position: Point3::new(3.0, 0.0, 1.6), velocity: Vector2::zeros() };
        let covariance = SMatrix::<f64, 5, 5>::zeros();
        let fine = Estimate { person, covariance, region: Rect::new(0.0, 0.0, 1.0, 1.0) };
        assert!(fine.is_sane());
        let mut endless = covariance;
        endless[(4, 0)] = f64::INFINITY;
        let mut negative = covariance;
        negative[(3, 3)] = -1e-9;
        let position = Point3::new(f64::NAN, 0.0, 0.0);
        let velocity = Vector2::new(0.0, f64::NAN);
        for broken in [
            Estimate { person: Person { position, ..person }, ..fine.clone() },
            Estimate { person: Person { velocity, ..person }, ..fine.clone() },
            Estimate { covariance: endless, ..fine.clone() },
            Estimate { covariance: negative, ..fine.clone() },
            Estimate { region: Rect::new(0.0, 0.0, -1.0, 1.0), ..fine.clone() },
        ] {
            assert!(!broken.is_sane(), "{broken:?}");
        }
    }
}
