use nalgebra::Point3;

use crate::{Capabilities, Detection, Frame, Funnel, Inputs, Person, Result, Track, Visualisation};

/// Query to a detector.
#[derive(Clone, Copy)]
pub enum Query<'a> {
    /// *Discover*: find all people in the image. The people in `occupied` were already found in
    /// this frame and need not be found again.
    Discover {
        /// Detections already made in this frame.
        occupied: &'a [Detection],
    },
    /// *Follow*: find the person of this track again. The track is predicted to this frame.
    Track(&'a Track),
}

/// Performs one or more of three tasks on an image: finding new people (*discover*), finding a
/// tracked person again (*follow*), and, through its [`Likelihood`], weighing a hypothetical scene
/// against the image (*weigh*).
///
/// ```
/// # use tagalong_core::*;
/// # use nalgebra::Isometry3;
/// # use tagalong_geometry::Camera;
/// /// Takes the nearest point of the laser scan for a person.
/// struct Nearest;
///
/// impl Detector for Nearest {
///     fn capabilities(&self) -> Capabilities {
///         let inputs = Inputs::NONE.require(Input::Laser);
///         Capabilities::new(inputs).discovering()
///     }
///
///     fn detect(
///         &mut self,
///         frame: &Frame,
///         query: &Query<'_>,
///         _: &mut Funnel,
///     ) -> Result<Vec<Detection>> {
///         // It finds new people only, and knows nothing of tracks.
///         if matches!(query, Query::Track(_)) {
///             return Ok(Vec::new());
///         }
///         let points = frame.scan()?.points.iter();
///         let nearest = points.min_by(|a, b| a.coords.norm().total_cmp(&b.coords.norm()));
///         let covariance = nalgebra::Matrix3::identity() * 0.04;
///         let found = nearest.map(|at| Detection::new("nearest", *at, covariance, 1.0));
///         Ok(found.into_iter().collect())
///     }
/// }
///
/// let scan = LaserScan::of_points([[2.0, 0.0, 0.3].into(), [1.0, 0.5, 0.3].into()]);
/// let (blind, motion) = (Camera::blind(Isometry3::identity()).into(), EgoMotion::at_rest(0.1));
/// let sensors = Sensors::default().with(scan);
/// let frame = Frame::of_sensors(1, Stamp::default(), blind, motion, sensors);
/// let query = Query::Discover { occupied: &[] };
/// let found = Nearest.detect(&frame, &query, &mut Funnel::default())?;
/// assert_eq!(found[0].position.x, 1.0);
/// # Ok::<(), Error>(())
/// ```
pub trait Detector: Send {
    /// Returns the inputs and the roles that the detector has with its settings. A frame holds no
    /// image that no plugin of the pipeline declares, and a config that gives a detector another
    /// role is refused.
    fn capabilities(&self) -> Capabilities;

    /// Finds people. Candidates that a test drops are counted in `funnel` under the name of the
    /// test. For [`Query::Track`] the best detection comes first and lies within the uncertainty of
    /// the track.
    ///
    /// # Errors
    /// [`crate::Error::MissingImage`] if the frame lacks an input that the detector needs.
    fn detect(
        &mut self,
        frame: &Frame,
        query: &Query<'_>,
        funnel: &mut Funnel,
    ) -> Result<Vec<Detection>>;

    /// Adapts appearance models to the tracks of this frame. All tracks are passed, so that the
    /// models of people that left can be discarded.
    ///
    /// # Errors
    /// As [`Detector::detect`].
    fn learn(&mut self, frame: &Frame, tracks: &[Track]) -> Result<()> {
        let _ = (frame, tracks);
        Ok(())
    }

    /// Returns true if the detections may depend on more than the settings, the frame and the
    /// search: on earlier frames, on learned models, on random numbers. The detections of a
    /// detector without memory are reused for the same search in the same frame.
    fn remembers(&self) -> bool {
        true
    }

    /// Returns the scene likelihood of this detector, if it has one.
    fn likelihood(&self) -> Option<&dyn Likelihood> {
        None
    }
}

/// Weighs hypothetical scenes against an image.
///
/// ```
/// # use tagalong_core::*;
/// # use nalgebra::Isometry3;
/// # use tagalong_geometry::Camera;
/// /// Prefers scenes whose people stand where the laser scan has points.
/// struct AtPoints;
///
/// impl Likelihood for AtPoints {
///     fn log_likelihood(&self, frame: &Frame, scene: &[Person]) -> Result<f64> {
///         let points = &frame.scan()?.points;
///         let is_hit = |person: &&Person| {
///             points.iter().any(|point| (point - person.position).xy().norm() < 0.3)
///         };
///         let hits = scene.iter().filter(is_hit).count();
///         Ok(2.0 * hits as f64 - scene.len() as f64)
///     }
/// }
///
/// let sensors = Sensors::default().with(LaserScan::of_points([[2.0, 0.1, 0.3].into()]));
/// let (blind, motion) = (Camera::blind(Isometry3::identity()).into(), EgoMotion::at_rest(0.1));
/// let frame = Frame::of_sensors(1, Stamp::default(), blind, motion, sensors);
/// let person = |x| Person { position: [x, 0.0, 1.6].into(), velocity: nalgebra::zero() };
/// let mut weights = Vec::new();
/// AtPoints.log_likelihoods(&frame, &[person(2.0), person(5.0)], 1, &mut weights)?;
/// assert_eq!(weights, [1.0, -1.0]);
/// # Ok::<(), Error>(())
/// ```
pub trait Likelihood: Send + Sync {
    /// Returns the log-likelihood ratio of the scene against the empty background. Nearer people
    /// occlude farther ones; the order of `scene` does not matter. The body of a person faces in
    /// the direction of the velocity, or along the viewing ray at rest.
    ///
    /// # Errors
    /// [`crate::Error::MissingImage`] if the frame lacks a required input.
    fn log_likelihood(&self, frame: &Frame, scene: &[Person]) -> Result<f64>;

    /// Computes the log-likelihood ratios of many scenes with `people_per_scene` people each:
    /// `people` holds one scene after the other, and `out` receives one number per scene. Callers
    /// that weigh hundreds of scenes use this function, so that data that depend on the frame alone
    /// are prepared once.
    ///
    /// # Errors
    /// As [`Likelihood::log_likelihood`].
    fn log_likelihoods(
        &self,
        frame: &Frame,
        people: &[Person],
        people_per_scene: usize,
        out: &mut Vec<f64>,
    ) -> Result<()> {
        out.clear();
        // `chunks` panics at 0, the size of scenes without people.
        for scene in people.chunks(people_per_scene.max(1)) {
            out.push(self.log_likelihood(frame, scene)?);
        }
        Ok(())
    }

    /// Returns a picture of a scene as it is compared with the frame, if the likelihood has one.
    /// Called for visualisation only.
    ///
    /// # Errors
    /// As [`Likelihood::log_likelihood`].
    fn visualise(&self, frame: &Frame, scene: &[Person]) -> Result<Option<Visualisation>> {
        let _ = (frame, scene);
        Ok(None)
    }
}

/// Verifies detections (P4, II-C: an SVM on the intensity patch).
///
/// ```
/// # use nalgebra::{Isometry3, Matrix3};
/// # use tagalong_core::*;
/// # use tagalong_geometry::Camera;
/// /// Doubts heads that are lower or higher than those of people who stand.
/// struct Upright;
///
/// impl Verifier for Upright {
///     fn inputs(&self) -> Inputs {
///         Inputs::NONE
///     }
///
///     fn log_odds(&mut self, _: &Frame, candidate: &Detection) -> Result<f64> {
///         let is_upright = (1.2..2.0).contains(&candidate.position.z);
///         Ok(if is_upright { 0.5 } else { -2.0 })
///     }
/// }
///
/// # let (blind, motion) = (Camera::blind(Isometry3::identity()).into(), EgoMotion::at_rest(0.1));
/// # let frame = Frame::of_sensors(1, Stamp::default(), blind, motion, Sensors::default());
/// # let (covariance, source) = (Matrix3::identity(), "example");
/// let head_at = |z| {
///     let position = [2.0, 0.0, z].into();
///     Detection::new(source, position, covariance, 1.0)
/// };
/// assert_eq!(Upright.log_odds(&frame, &head_at(1.7))?, 0.5);
/// assert_eq!(Upright.log_odds(&frame, &head_at(0.4))?, -2.0);
/// # Ok::<(), Error>(())
/// ```
pub trait Verifier: Send {
    /// Returns the inputs that the verifier uses with its settings; see [`Detector::capabilities`].
    fn inputs(&self) -> Inputs;

    /// Returns the log-odds that the candidate is a person; negative rejects it. The same candidate
    /// in the same frame always gets the same result.
    ///
    /// # Errors
    /// [`crate::Error::MissingImage`] if the frame lacks a required input.
    fn log_odds(&mut self, frame: &Frame, candidate: &Detection) -> Result<f64>;
}

impl<'a> Query<'a> {
    /// Returns true if `position` belongs to a person that was already found in this frame (nearer
    /// than `within_m` on the floor).
    pub fn is_occupied(&self, position: &Point3<f64>, within_m: f64) -> bool {
        match self {
            Self::Discover { occupied } => {
                occupied.iter().any(|d| (d.position.xy() - position.xy()).norm() < within_m)
            }
            // A search near a track has to find that very person, even if already found.
            Self::Track(_) => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Error;

    fn seen(x: f64, y: f64, z: f64) -> Detection {
        Detection::new("test", Point3::new(x, y, z), nalgebra::Matrix3::identity(), 1.0)
    }

    #[test]
    fn a_place_is_taken_by_whoever_was_found_near_it_on_the_floor() {
        let occupied = [seen(3.0, 0.0, 1.6)];
        let query = Query::Discover { occupied: &occupied };
        assert!(query.is_occupied(&Point3::new(3.2, 0.1, 0.0), 0.3), "whatever the height");
        assert!(!query.is_occupied(&Point3::new(3.31, 0.0, 1.6), 0.3));
        assert!(!query.is_occupied(&Point3::new(0.3, 0.0, 1.6), 0.3));
        assert!(!Query::Discover { occupied: &[] }.is_occupied(&Point3::origin(), 9.0));
    }

    /// A likelihood that returns the number of people, and refuses three.
    struct Count;

    impl Likelihood for Count {
        fn log_likelihood(&self, _: &Frame, scene: &[Person]) -> Result<f64> {
            match scene.len() {
                3 => Err(Error::Other("three are a crowd".into())),
                people => Ok(people as f64),
            }
        }
    }

    #[test]
    fn many_scenes_are_weighed_one_after_the_other() {
        let lens = tagalong_geometry::Distortion::None;
        let lens =
            tagalong_geometry::Pinhole { fx: 5.0, fy: 5.0, cx: 1.5, cy: 1.5, distortion: lens };
        let camera =
            std::sync::Arc::new(tagalong_geometry::Camera::mounted(lens, 4, 4, 1.0, 0.0, 0.0));
        let motion = crate::EgoMotion::at_rest(0.0);
        let frame =
            Frame::new(1, crate::Stamp::default(), camera, motion, crate::Images::default());
        let somebody = Person { position: Point3::origin(), velocity: nalgebra::zero() };
        let people = [somebody; 5];
        let mut out = vec![9.0];
        Count.log_likelihoods(&frame, &people, 2, &mut out).unwrap();
        assert_eq!(out, [2.0, 2.0, 1.0], "and what was there before is gone");
        Count.log_likelihoods(&frame, &people[..1], 0, &mut out).unwrap();
        assert_eq!(out, [1.0]);
        assert!(Count.log_likelihoods(&frame, &people, 3, &mut out).is_err());
        assert!(Count.visualise(&frame, &people[..2]).unwrap().is_none());
    }
}
