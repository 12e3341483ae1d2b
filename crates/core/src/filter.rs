use std::collections::BTreeMap;

use nalgebra::{Point3, SMatrix, Vector2};

use crate::{Camera, Detection, Frame, Inputs, Likelihood, Motion, Rect, Result, Sketch, TrackId};

/// A person in the robot frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Person {
    /// Centre of the head, m.
    pub position: Point3<f64>,
    /// Velocity over ground (not relative to the robot), in robot axes, m/s.
    pub velocity: Vector2<f64>,
}

/// What a filter believes of a person.
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
    /// True if every number is finite and no variance is negative.
    pub fn is_sane(&self) -> bool {
        self.person.position.iter().all(|v| v.is_finite())
            && self.person.velocity.iter().all(|v| v.is_finite())
            && self.covariance.iter().all(|v| v.is_finite())
            && self.covariance.diagonal().iter().all(|v| *v >= 0.0)
            && self.region.is_sane()
    }
}

/// A detection that the association gave to a track.
#[derive(Clone, Copy)]
pub struct Matched<'a> {
    /// The track.
    pub id: TrackId,
    /// Its detection.
    pub detection: &'a Detection,
    /// Probability that the detection is of the track, above 0 and at most 1.
    pub weight: f64,
}

impl<'a> Matched<'a> {
    /// Returns a match without doubt.
    pub fn certain(id: TrackId, detection: &'a Detection) -> Self {
        Self { id, detection, weight: 1.0 }
    }
}

/// Everything that one frame says about the people a filter believes in.
pub struct Evidence<'a> {
    /// The frame.
    pub frame: &'a Frame,
    /// Detections with their track. A track appears once, with the weight 1, or several times
    /// with weights whose sum is at most 1 where the associator weighs alternatives.
    pub matched: &'a [Matched<'a>],
    /// Detections that the association left alone.
    pub unmatched: &'a [Detection],
    /// Weighs scenes, where the pipeline has a detector that can.
    pub likelihood: Option<&'a dyn Likelihood>,
}

impl<'a> Evidence<'a> {
    /// Returns the most probable detection of each track, for filters that take one.
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

/// How the evidence of one frame supports one track.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Support {
    /// Normalised innovation squared and its degrees of freedom, from filters
    /// that have an innovation. Its mean over a consistent filter's run equals
    /// the degrees of freedom.
    pub nis: Option<(f64, u32)>,
}

/// Holds the beliefs about **all** people at once, so that a joint filter is
/// nothing special. Filters for one person are lifted by [`PerPerson`].
pub trait Filter: Send {
    /// Returns the inputs that the filter itself uses; most leave images to detectors.
    fn inputs(&self) -> Inputs {
        Inputs::NONE
    }

    /// Starts a belief. `id` is new.
    fn start(&mut self, id: TrackId, detection: &Detection, camera: &Camera);

    /// Moves every belief into the robot's new frame and forward in time. `camera` is that of
    /// the new frame.
    fn predict(&mut self, motion: &Motion, camera: &Camera);

    /// Takes in the evidence of a frame and returns whom it supports.
    ///
    /// # Errors
    /// [`crate::Error::MissingImage`] if a scene cannot be weighed.
    fn update(&mut self, evidence: &Evidence<'_>) -> Result<BTreeMap<TrackId, Support>>;

    /// All beliefs, as the camera would see them.
    fn estimates(&self, camera: &Camera) -> BTreeMap<TrackId, Estimate>;

    /// Forgets a person.
    fn stop(&mut self, id: TrackId);

    /// What the filter would show of its work on a frame that it was just updated
    /// with, by the same evidence. Asked for pictures alone.
    ///
    /// # Errors
    /// As [`Filter::update`].
    fn sketch(&self, evidence: &Evidence<'_>) -> Result<Sketch> {
        let _ = evidence;
        Ok(Sketch::default())
    }

    /// True if the filter cannot work without a [`Likelihood`]; checked when
    /// the pipeline is built.
    fn weighs_scenes(&self) -> bool {
        false
    }
}

/// A filter of one person.
pub trait PersonFilter: Send {
    /// What is believed of a person.
    type Belief: Clone + Send;

    /// The belief after the first sighting.
    fn start(&self, detection: &Detection) -> Self::Belief;

    /// Into the robot's new frame and forward in time.
    fn predict(&self, belief: &mut Self::Belief, motion: &Motion);

    /// Corrects the belief by a sighting.
    fn correct(&self, belief: &mut Self::Belief, detection: &Detection, camera: &Camera)
    -> Support;

    /// Merges alternatives of one person into one belief; the weights sum to 1 and the
    /// heaviest comes first. A filter of means and covariances matches the moments of the
    /// mixture; by default the heaviest alternative stays.
    fn merge(&self, alternatives: &[(f64, Self::Belief)]) -> Self::Belief {
        alternatives[0].1.clone()
    }

    /// The belief in the common form.
    fn estimate(&self, belief: &Self::Belief, camera: &Camera) -> Estimate;
}

/// Makes a [`Filter`] of a [`PersonFilter`] by keeping one belief a person.
pub struct PerPerson<F: PersonFilter> {
    filter: F,
    beliefs: BTreeMap<TrackId, F::Belief>,
}

impl<F: PersonFilter> PerPerson<F> {
    /// Lifts `filter`.
    pub fn new(filter: F) -> Self {
        Self { filter, beliefs: BTreeMap::new() }
    }
}

impl<F: PersonFilter> PerPerson<F> {
    /// Corrects a belief by weighted alternatives: each detection, and none at all with the
    /// weight that is missing from 1 (Bar-Shalom and Tse's probabilistic data association).
    fn correct_weighted(
        filter: &F,
        belief: &mut F::Belief,
        matches: &[Matched<'_>],
        camera: &Camera,
    ) -> Support {
        let mut supports = Vec::new();
        let mut alternatives: Vec<(f64, F::Belief)> = Vec::new();
        for matched in matches {
            let mut corrected = belief.clone();
            supports.push(filter.correct(&mut corrected, matched.detection, camera));
            alternatives.push((matched.weight, corrected));
        }
        let missed = 1.0 - matches.iter().map(|matched| matched.weight).sum::<f64>();
        if missed > CERTAINTY {
            alternatives.push((missed, belief.clone()));
        }
        // A stable sort: equal weights stay in the order of the detections.
        alternatives.sort_by(|a, b| b.0.total_cmp(&a.0));
        *belief = filter.merge(&alternatives);
        let heaviest =
            matches.iter().zip(&supports).max_by(|a, b| a.0.weight.total_cmp(&b.0.weight));
        heaviest.map_or(Support::default(), |(_, support)| *support)
    }
}

/// Weights closer to 0 than this, or to 1, are those of a decision without alternatives.
const CERTAINTY: f64 = 1e-9;

impl<F: PersonFilter> Filter for PerPerson<F> {
    fn start(&mut self, id: TrackId, detection: &Detection, _: &Camera) {
        self.beliefs.insert(id, self.filter.start(detection));
    }

    fn predict(&mut self, motion: &Motion, _: &Camera) {
        for belief in self.beliefs.values_mut() {
            self.filter.predict(belief, motion);
        }
    }

    fn update(&mut self, evidence: &Evidence<'_>) -> Result<BTreeMap<TrackId, Support>> {
        let camera = &evidence.frame.camera;
        let mut supported = BTreeMap::new();
        for (id, matches) in by_track(evidence.matched) {
            let Some(belief) = self.beliefs.get_mut(&id) else { continue };
            let support = match &matches[..] {
                [only] if only.weight > 1.0 - CERTAINTY => {
                    self.filter.correct(belief, only.detection, camera)
                }
                several => Self::correct_weighted(&self.filter, belief, several, camera),
            };
            supported.insert(id, support);
        }
        Ok(supported)
    }

    fn estimates(&self, camera: &Camera) -> BTreeMap<TrackId, Estimate> {
        self.beliefs
            .iter()
            .map(|(id, belief)| (*id, self.filter.estimate(belief, camera)))
            .collect()
    }

    fn stop(&mut self, id: TrackId) {
        self.beliefs.remove(&id);
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
    use crate::{Distortion, Images, Pinhole, Stamp};

    /// Believes the last place, moved along by the robot.
    struct Last;

    impl PersonFilter for Last {
        type Belief = Point3<f64>;

        fn start(&self, detection: &Detection) -> Point3<f64> {
            detection.position
        }

        fn predict(&self, belief: &mut Point3<f64>, motion: &Motion) {
            belief.x -= motion.forward;
        }

        fn correct(&self, belief: &mut Point3<f64>, seen: &Detection, _: &Camera) -> Support {
            let off = seen.position - *belief;
            *belief = seen.position;
            Support { nis: Some((off.norm_squared(), 3)) }
        }

        fn estimate(&self, belief: &Point3<f64>, camera: &Camera) -> Estimate {
            let person = Person { position: *belief, velocity: Vector2::zeros() };
            let region = camera.upper_body(belief);
            Estimate { person, covariance: SMatrix::identity(), region }
        }
    }

    fn frame() -> Frame {
        let lens = Pinhole { fx: 50.0, fy: 50.0, cx: 32.0, cy: 24.0, distortion: Distortion::None };
        let camera = Arc::new(Camera::mounted(lens, 64, 48, 1.2, 0.0, 0.0));
        Frame::new(1, Stamp::default(), camera, Motion::at_rest(0.1), Images::default())
    }

    fn seen(x: f64) -> Detection {
        let position = Point3::new(x, 0.0, 1.6);
        let (region, covariance) = (Rect::default(), Matrix3::identity());
        Detection { region, position, covariance, score: 1.0, source: "test" }
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
        filter.predict(&Motion { forward: 0.5, ..Motion::at_rest(0.1) }, &frame.camera);
        assert_eq!(places(&filter), [(1, 1.5), (2, 4.5)]);
        let (detection, stranger) = (seen(4.0), seen(9.0));
        let matched =
            [Matched::certain(TrackId(2), &detection), Matched::certain(TrackId(7), &stranger)];
        let evidence =
            Evidence { frame: &frame, matched: &matched, unmatched: &[], likelihood: None };
        let supported = filter.update(&evidence).unwrap();
        let expected = [(TrackId(2), Support { nis: Some((0.25, 3)) })];
        assert_eq!(supported, BTreeMap::from(expected), "and nobody else");
        assert_eq!(places(&filter), [(1, 1.5), (2, 4.0)]);
        filter.stop(TrackId(1));
        assert_eq!(places(&filter), [(2, 4.0)]);
        assert!(!filter.weighs_scenes());
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
