//! Detection in a frame, and verification of the detections.

use crate::{Guarded, StepError};
use tagalong_core::{Detector, Frame, Funnel, Input, Likelihood, Query, Track, Usage, Verifier};

use crate::detections::PendingDetection;
use crate::memo::{self, Identities};
use crate::{DetectorSettings, Fate, Role};

/// Log-odds that stand for certainty. Larger ones would outweigh all other evidence.
const CERTAIN: f64 = 100.0;

/// A detector and its settings.
pub struct DetectorSlot {
    /// Its settings.
    pub settings: DetectorSettings,
    /// The plugin.
    pub plugin: Guarded<dyn Detector>,
}

impl DetectorSlot {
    /// Returns true if the config gives the detector this role.
    pub fn has(&self, role: Role) -> bool {
        self.settings.roles.contains(&role)
    }

    /// Returns true if the detector runs on the frame with this count from 0. On a frame without a
    /// message of another detector, which may be slower than the images, it has not looked.
    pub(crate) fn is_due(&self, frame: &Frame, count: u64) -> bool {
        let every = u64::from(self.settings.every.max(1));
        let inputs = self.plugin.plugin().capabilities().inputs;
        let lacks_message = inputs.of(Usage::Required).any(|input| input == Input::Detections)
            && !frame.holds(Input::Detections);
        count % every == u64::from(self.settings.offset) && !lacks_message
    }
}

/// All detectors and verifiers.
pub(crate) struct SearchStage {
    pub(crate) detectors: Vec<DetectorSlot>,
    pub(crate) verifiers: Vec<Guarded<dyn Verifier>>,
    /// True if the filter uses detections with a box in the image alone.
    pub(crate) requires_box: bool,
    /// Identities of the plugins if their results are shared with other pipelines.
    pub(crate) shared: Option<Identities>,
}

impl SearchStage {
    /// Returns the detectors that run on the frame with this count from 0.
    pub(crate) fn due(&self, frame: &Frame, count: u64) -> Vec<usize> {
        (0..self.detectors.len()).filter(|i| self.detectors[*i].is_due(frame, count)).collect()
    }

    /// Returns those of `due` with a role.
    pub(crate) fn with_role(&self, due: &[usize], role: Role) -> Vec<usize> {
        due.iter().copied().filter(|i| self.detectors[*i].has(role)).collect()
    }

    /// Returns the likelihood that weighs scenes for the filter, if a detector has that role.
    pub(crate) fn likelihood(&self) -> Option<&dyn Likelihood> {
        self.detectors.iter().find(|slot| slot.has(Role::Weigh))?.plugin.plugin().likelihood()
    }

    /// Returns the best detection of one track that fails no test, if there is one, and the others
    /// with the tests that they failed.
    pub(crate) fn find_track(
        &mut self,
        frame: &Frame,
        detectors: &[usize],
        track: &Track,
        mut failed_test: impl FnMut(&PendingDetection) -> Result<Option<&'static str>, StepError>,
        funnel: &mut Funnel,
    ) -> Result<(Option<PendingDetection>, Vec<PendingDetection>), StepError> {
        let mut best: Option<PendingDetection> = None;
        let mut dropped = Vec::new();
        for &index in detectors {
            for found in self.detect(frame, index, &Query::Track(track), funnel)? {
                let score = found.detection.score;
                let is_best = best.as_ref().is_none_or(|best| score > best.detection.score);
                let test = match failed_test(&found)? {
                    None if !is_best => Some(NOT_BEST),
                    test => test,
                };
                let loser = match test {
                    Some(test) => Some((found, test)),
                    None => best.replace(found).map(|worse| (worse, NOT_BEST)),
                };
                dropped.extend(loser.map(|(loser, test)| loser.with(Fate::Dropped(test))));
            }
        }
        Ok((best, dropped))
    }

    /// Runs a detector, and the verifiers on its detections.
    pub(crate) fn detect(
        &mut self,
        frame: &Frame,
        index: usize,
        query: &Query<'_>,
        funnel: &mut Funnel,
    ) -> Result<Vec<PendingDetection>, StepError> {
        let slot = &mut self.detectors[index];
        let identity = self.shared.as_ref().and_then(|shared| shared.detectors[index].as_deref());
        let found = slot.plugin.call(frame.index, |detector| match identity {
            Some(identity) => memo::found(identity, frame, query, funnel, |funnel| {
                detector.detect(frame, query, funnel)
            }),
            None => detector.detect(frame, query, funnel),
        })?;
        let discovered = matches!(query, Query::Discover { .. });
        let mut passed = Vec::new();
        for detection in found {
            if !detection.is_sane() {
                funnel.drop_many("detection not finite", 1);
                continue;
            }
            if self.requires_box && detection.image.is_none() {
                funnel.drop_many("no image box", 1);
                continue;
            }
            let pending = PendingDetection::new(detection, index, discovered);
            if self.detectors[index].settings.verify {
                passed.extend(self.verify(frame, pending, funnel)?);
            } else {
                passed.push(pending);
            }
        }
        Ok(passed)
    }

    /// Adds the verifiers' log-odds to the score.
    fn verify(
        &mut self,
        frame: &Frame,
        mut pending: PendingDetection,
        funnel: &mut Funnel,
    ) -> Result<Option<PendingDetection>, StepError> {
        let mut sum = 0.0;
        for (at, verifier) in self.verifiers.iter_mut().enumerate() {
            let candidate = &pending.detection;
            sum += verifier.call(frame.index, |verifier| match &self.shared {
                Some(shared) => memo::log_odds(&shared.verifiers[at], frame, candidate, || {
                    verifier.log_odds(frame, candidate)
                }),
                None => verifier.log_odds(frame, candidate),
            })?;
        }
        if !sum.is_finite() {
            funnel.drop_detection("verifier not finite", &pending.detection);
            return Ok(None);
        }
        pending.detection.score = (pending.detection.score + sum).clamp(-CERTAIN, CERTAIN);
        Ok(Some(pending))
    }
}

/// Name of the test that the weaker of two detections of one track fails.
const NOT_BEST: &str = "not the best detection";

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::{Matrix3, Point3, SMatrix, Vector2};
    use tagalong_core::{
        Capabilities, Detection, EgoMotion, Estimate, Images, Inputs, Person, Result, Stamp,
        TrackId,
    };
    use tagalong_geometry::{Camera, Pinhole, Rect};

    use super::*;

    /// Finds people with these scores.
    struct Scored(Vec<f64>);

    impl Detector for Scored {
        fn capabilities(&self) -> Capabilities {
            Capabilities::new(Inputs::NONE).tracking()
        }

        fn detect(&mut self, _: &Frame, _: &Query<'_>, _: &mut Funnel) -> Result<Vec<Detection>> {
            Ok(self
                .0
                .iter()
                .map(|score| {
                    Detection::new(
                        "test",
                        Point3::new(3.0, 0.0, 1.6),
                        Matrix3::identity() * 0.01,
                        *score,
                    )
                })
                .collect())
        }
    }

    fn slot(scores: &[f64]) -> DetectorSlot {
        let plugin: Box<dyn Detector> = Box::new(Scored(scores.to_vec()));
        DetectorSlot {
            settings: DetectorSettings { roles: vec![Role::Track], ..DetectorSettings::default() },
            plugin: Guarded::new("scored", plugin),
        }
    }

    fn track() -> Track {
        let person = Person { position: Point3::new(3.0, 0.0, 1.6), velocity: Vector2::zeros() };
        let covariance = SMatrix::identity();
        Track::new(TrackId(1), Estimate::new(person, covariance, Rect::default()), 1.0).with_age(1)
    }

    #[test]
    fn a_track_gets_the_best_detection_that_passes_and_the_rest_say_why_not() {
        let camera =
            Arc::new(Camera::mounted(Pinhole::centred(500.0, 640, 480), 640, 480, 1.2, 0.0, 0.0));
        let motion = EgoMotion::at_rest(0.1);
        let frame = Frame::new(1, Stamp::default(), camera, motion, Images::default());
        let mut stage = SearchStage {
            detectors: vec![slot(&[1.0, 3.0]), slot(&[2.0, 9.0])],
            verifiers: Vec::new(),
            requires_box: false,
            shared: None,
        };
        let (best, dropped) = stage
            .find_track(
                &frame,
                &[0, 1],
                &track(),
                |found| Ok((found.detection.score > 8.0).then_some("sure")),
                &mut Funnel::default(),
            )
            .unwrap();
        assert_eq!(best.unwrap().detection.score, 3.0);
        let dropped: Vec<(f64, Option<Fate>)> =
            dropped.into_iter().map(|one| (one.detection.score, one.fate)).collect();
        let not_best = Some(Fate::Dropped(NOT_BEST));
        assert_eq!(dropped, [(1.0, not_best), (2.0, not_best), (9.0, Some(Fate::Dropped("sure")))]);
    }
}
