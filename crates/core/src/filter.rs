use std::collections::BTreeMap;

use crate::{
    Detection, EgoMotion, Estimate, Frame, Inputs, Likelihood, Result, TrackId, Visualisation,
};
use tagalong_geometry::Camera;

/// A detection that the association assigned to a track.
#[derive(Clone, Copy)]
#[non_exhaustive]
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
        Self::weighted(id, detection, 1.0)
    }

    /// Returns a match of this probability, above 0 and at most 1.
    pub fn weighted(id: TrackId, detection: &'a Detection, weight: f64) -> Self {
        Self { id, detection, weight }
    }
}

/// Evidence of one frame for the tracks of a filter.
#[non_exhaustive]
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
    /// Creates the evidence of a frame: its detections with their tracks.
    pub fn new(frame: &'a Frame, matched: &'a [Matched<'a>]) -> Self {
        Self { frame, matched, unmatched: &[], likelihood: None }
    }

    /// Returns the evidence with the detections that have no track.
    pub fn with_unmatched(self, unmatched: &'a [Detection]) -> Self {
        Self { unmatched, ..self }
    }

    /// Returns the evidence with the scene likelihood, if there is one.
    pub fn with_likelihood(self, likelihood: Option<&'a dyn Likelihood>) -> Self {
        Self { likelihood, ..self }
    }

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
#[non_exhaustive]
pub struct Update {
    /// Normalised innovation squared and its degrees of freedom, from filters that have an
    /// innovation. Its mean over a run of a consistent filter equals the degrees of freedom.
    pub nis: Option<(f64, u32)>,
}

impl Update {
    /// Creates the result of an update: its normalised innovation squared and the degrees of
    /// freedom, if the filter has an innovation.
    pub fn new(nis: Option<(f64, u32)>) -> Self {
        Self { nis }
    }
}

/// The declaration of a filter: the data that it uses. A pipeline that lacks them is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
#[non_exhaustive]
pub struct FilterRequirements {
    /// The inputs that the filter itself uses; most filters leave images to detectors.
    pub inputs: Inputs,
    /// True if it uses detections with a box in the image alone. The tracker drops the others, as
    /// "no image box".
    pub image_box: bool,
    /// True if it requires a [`Likelihood`].
    pub likelihood: bool,
    /// True if it looks for every track in every frame itself. A track that it does not support was
    /// then searched for, whether or not a detector ran.
    pub searches: bool,
}

impl FilterRequirements {
    /// Declares the inputs that the filter itself uses, and nothing else.
    pub fn new(inputs: Inputs) -> Self {
        Self { inputs, ..Self::default() }
    }

    /// Returns the declaration of a filter that uses detections with a box in the image alone.
    pub fn with_image_box(self) -> Self {
        Self { image_box: true, ..self }
    }

    /// Returns the declaration of a filter that requires a [`Likelihood`].
    pub fn with_likelihood(self) -> Self {
        Self { likelihood: true, ..self }
    }

    /// Returns the declaration of a filter that looks for every track in every frame itself.
    pub fn with_search(self) -> Self {
        Self { searches: true, ..self }
    }
}

/// Estimates the states of **all** people at once, so that a joint filter needs no special
/// interface. [`PerPerson`](crate::PerPerson) adapts filters of one person.
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
///         let estimate = |position: &Point3<f64>| {
///             let person = Person { position: *position, velocity: Vector2::zeros() };
///             Estimate::new(person, SMatrix::identity(), camera.upper_body(position))
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
/// # let seen = Detection::new("example", position, covariance, 1.0);
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

    /// Returns a picture of the state after the last update, given the same evidence, if the filter
    /// has one. Called for visualisation only.
    ///
    /// # Errors
    /// As [`Filter::update`].
    fn visualise(&self, evidence: &Evidence<'_>) -> Result<Option<Visualisation>> {
        let _ = evidence;
        Ok(None)
    }
}
