use crate::{Detection, Track};

/// Limits on the pairs of a track and a detection that are considered in one frame, and what is
/// known of a pair beside its place.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Gate<'a> {
    /// Time since the frame before, s.
    pub dt_s: f64,
    /// Log-odds at and above which a detection may start a track
    /// ([`crate::TrackManager::start_log_odds`]).
    pub start_log_odds: f64,
    /// Log-likelihood ratios of the appearances, by track and detection: above 0 for a detection
    /// that looks like the person of the track. Empty without an appearance memory.
    pub appearance: &'a [Vec<f64>],
}

impl<'a> Gate<'a> {
    /// Creates the limits of a frame: the time since the frame before, s, and the log-odds from which
    /// a detection may start a track.
    pub const fn new(dt_s: f64, start_log_odds: f64) -> Self {
        Self { dt_s, start_log_odds, appearance: &[] }
    }

    /// Returns the limits with the log-likelihood ratios of the appearances, by track and detection.
    pub const fn with_appearance(self, appearance: &'a [Vec<f64>]) -> Self {
        Self { appearance, ..self }
    }

    /// Returns false for a pair that is probably no person. A detection that alone would start no
    /// track still supports a track that probably is a person, because log-odds add up.
    pub fn admits(&self, track: &Track, detection: &Detection) -> bool {
        detection.score >= self.start_log_odds || track.score + detection.score >= 0.0
    }

    /// Returns the log-likelihood ratio of the appearances of a pair, by the indices of the track
    /// and the detection; 0 if nothing is known.
    ///
    /// ```
    /// use tagalong_core::Gate;
    /// let appearance = [vec![0.5, -2.0]];
    /// let gate = Gate::default().with_appearance(&appearance);
    /// assert_eq!(gate.appearance_of(0, 1), -2.0);
    /// assert_eq!(Gate::default().appearance_of(0, 1), 0.0);
    /// ```
    pub fn appearance_of(&self, track: usize, detection: usize) -> f64 {
        let row = self.appearance.get(track);
        row.and_then(|row| row.get(detection)).copied().unwrap_or(0.0)
    }
}

/// One detection as evidence for one track.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Association {
    /// Index of the track in the input of the associator.
    pub track: usize,
    /// Index of the detection.
    pub detection: usize,
    /// Probability that the detection belongs to the track, above 0 and at most 1. The difference
    /// between 1 and the sum over a track is the probability that the track was missed.
    pub weight: f64,
}

impl Association {
    /// Creates the pair of a track and a detection, by their indices, with its probability.
    pub fn new(track: usize, detection: usize, weight: f64) -> Self {
        Self { track, detection, weight }
    }
}

/// Decisions of an associator about one frame.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Associations {
    /// The pairs. A track or a detection may appear in several of them.
    pub pairs: Vec<Association>,
    /// Indices of detections that belong to no pair and must not start a track either.
    pub spent: Vec<usize>,
}

impl Associations {
    /// Creates the decisions of a frame from its pairs.
    pub fn new(pairs: Vec<Association>) -> Self {
        Self { pairs, spent: Vec::new() }
    }

    /// Returns the decisions with the detections that must not start a track either.
    pub fn with_spent(self, spent: Vec<usize>) -> Self {
        Self { spent, ..self }
    }

    /// Returns the decisions of a one-to-one assignment: the detection of each track.
    ///
    /// ```
    /// use tagalong_core::Associations;
    /// let associations = Associations::one_to_one([Some(1), None]);
    /// assert_eq!(associations.pairs[0].detection, 1);
    /// assert_eq!(associations.pairs.len(), 1);
    /// ```
    pub fn one_to_one(detection_of_track: impl IntoIterator<Item = Option<usize>>) -> Self {
        let rows = detection_of_track.into_iter().enumerate();
        let pairs = rows
            .filter_map(|(track, detection)| {
                detection.map(|detection| Association::new(track, detection, 1.0))
            })
            .collect();
        Self::new(pairs)
    }
}

/// Decides which detections belong to which tracks: nearest neighbour, global assignment,
/// several stages, or probabilities.
///
/// ```
/// # use tagalong_core::*;
/// /// Gives each track the first detection within a metre.
/// struct FirstComer;
///
/// impl Associator for FirstComer {
///     fn fits(&self, track: &Track, detection: &Detection, _: &Gate) -> bool {
///         (track.estimate.person.position - detection.position).norm() < 1.0
///     }
///
///     fn associate(&mut self, tracks: &[Track], found: &[Detection], gate: &Gate) -> Associations {
///         let mut free = vec![true; found.len()];
///         Associations::one_to_one(tracks.iter().map(|track| {
///             let fits = |i: &usize| free[*i] && self.fits(track, &found[*i], gate);
///             let index = (0..found.len()).find(fits)?;
///             free[index] = false;
///             Some(index)
///         }))
///     }
/// }
///
/// # use nalgebra::{Matrix3, SMatrix, zero};
/// # let person = Person { position: [2.0, 0.0, 1.6].into(), velocity: zero() };
/// # let (covariance, region) = (SMatrix::identity(), tagalong_geometry::Rect::default());
/// # let track = Track::new(TrackId(1), Estimate::new(person, covariance, region), 1.0);
/// # let covariance = Matrix3::identity();
/// let found = [5.0, 2.5].map(|x| {
///     let position = [x, 0.0, 1.6].into();
///     Detection::new("example", position, covariance, 1.0)
/// });
/// let answer = FirstComer.associate(&[track], &found, &Gate::default());
/// assert_eq!(answer, Associations::one_to_one([Some(1)]));
/// ```
pub trait Associator: Send {
    /// Returns true if the detection may belong to the track. A search near a track takes the best
    /// detection that fits. [`Gate::admits`] has been checked before.
    fn fits(&self, track: &Track, detection: &Detection, gate: &Gate) -> bool;

    /// Assigns detections to all tracks of a frame at once. `tracks` are predicted to the frame and
    /// sorted from near to far; pairs that [`Gate::admits`] or [`Associator::fits`] refuses must
    /// not be returned. The same input gives the same result.
    fn associate(
        &mut self,
        tracks: &[Track],
        detections: &[Detection],
        gate: &Gate,
    ) -> Associations;
}
