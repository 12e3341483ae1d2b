//! Results of plugins for a frame, shared with other pipelines that process the same frame.

use std::collections::BTreeMap;
use std::fmt::Debug;
use std::sync::{Mutex, PoisonError};

use tagalong_core::{Derived, Detection, Frame, Funnel, Query, Result};

/// Results by query. They live as long as their frame.
#[derive(Default)]
struct Memo {
    found: Mutex<BTreeMap<String, (Vec<Detection>, Funnel)>>,
    log_odds: Mutex<BTreeMap<String, f64>>,
}

impl Derived for Memo {
    fn derive(_: &Frame) -> Result<Self> {
        Ok(Self::default())
    }
}

/// Identities of plugins: all data on which a result depends, except the frame and the query.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Identities {
    /// Identity of each detector; none for a detector with memory, because its results cannot be
    /// shared.
    pub detectors: Vec<Option<String>>,
    /// Identity of each verifier.
    pub verifiers: Vec<String>,
}

/// Returns the result of `find`, or the stored result of the same query.
pub(crate) fn found(
    identity: &str,
    frame: &Frame,
    query: &Query<'_>,
    funnel: &mut Funnel,
    find: impl FnOnce(&mut Funnel) -> Result<Vec<Detection>>,
) -> Result<Vec<Detection>> {
    let memo = frame.derived::<Memo>()?;
    let question = match query {
        Query::Discover { occupied } => key(identity, occupied),
        Query::Track(track) => key(identity, track),
    };
    if let Some((found, dropped)) = lock(&memo.found).get(&question) {
        funnel.merge(dropped);
        return Ok(found.clone());
    }
    let mut dropped = Funnel::default();
    let found = find(&mut dropped);
    funnel.merge(&dropped);
    let found = found?;
    lock(&memo.found).insert(question, (found.clone(), dropped));
    Ok(found)
}

/// Returns the result of `judge` for a candidate, or the stored result of the same query.
pub(crate) fn log_odds(
    identity: &str,
    frame: &Frame,
    candidate: &Detection,
    judge: impl FnOnce() -> Result<f64>,
) -> Result<f64> {
    let memo = frame.derived::<Memo>()?;
    let question = key(identity, &candidate);
    if let Some(log_odds) = lock(&memo.log_odds).get(&question) {
        return Ok(*log_odds);
    }
    let log_odds = judge()?;
    lock(&memo.log_odds).insert(question, log_odds);
    Ok(log_odds)
}

/// Builds a key from the `Debug` form, in which different numbers have different text.
fn key(identity: &str, question: &impl Debug) -> String {
    format!("{identity}\n{question:?}")
}

fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    // Entries are inserted whole, so a map that another pipeline's panic poisoned is still valid.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::{Matrix3, Point3, one};
    use tagalong_core::{EgoMotion, Images, Stamp};
    use tagalong_geometry::Camera;

    use super::*;

    fn frame() -> Frame {
        let camera = Arc::new(Camera::blind(one()));
        Frame::new(1, Stamp::default(), camera, EgoMotion::at_rest(0.1), Images::default())
    }

    fn person(score: f64) -> Detection {
        Detection::new("test", Point3::new(3.0, 0.0, 1.6), Matrix3::identity(), score)
    }

    /// Returns the scores that a pipeline gets for the same query, where a detector would find
    /// `score` now; it drops one candidate in each search.
    fn ask(frame: &Frame, identity: &str, occupied: &[Detection], score: f64) -> (Vec<f64>, u64) {
        let mut funnel = Funnel::default();
        let query = Query::Discover { occupied };
        let answer = found(identity, frame, &query, &mut funnel, |funnel| {
            funnel.drop_many("too small", 1);
            Ok(vec![person(score)])
        });
        let scores = answer.unwrap().iter().map(|detection| detection.score).collect();
        (scores, funnel.count("too small"))
    }

    #[test]
    fn the_same_detector_is_asked_the_same_once_a_frame() {
        let first = frame();
        assert_eq!(ask(&first, "one", &[], 1.0), (vec![1.0], 1));
        assert_eq!(ask(&first, "one", &[], 2.0), (vec![1.0], 1), "the same, with what was dropped");
        assert_eq!(ask(&first, "one", &[person(5.0)], 3.0), (vec![3.0], 1), "another query");
        assert_eq!(ask(&first, "other", &[], 4.0), (vec![4.0], 1), "another detector");
        assert_eq!(ask(&frame(), "one", &[], 6.0), (vec![6.0], 1), "another frame");
    }

    #[test]
    fn the_same_verifier_judges_the_same_candidate_once_a_frame() {
        let frame = frame();
        for (identity, candidate, would_say, says) in [
            ("one", 1.0, -0.25, -0.25),
            ("one", 1.0, 0.5, -0.25),
            ("one", 2.0, 0.75, 0.75),
            ("other", 1.0, 1.25, 1.25),
        ] {
            let said = log_odds(identity, &frame, &person(candidate), || Ok(would_say));
            assert_eq!(said.unwrap(), says, "{identity} {candidate} {would_say}");
        }
    }
}
