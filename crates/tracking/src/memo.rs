//! What plugins said of a frame, for other pipelines that are shown the same frame.

use std::collections::BTreeMap;
use std::fmt::Debug;
use std::sync::{Mutex, PoisonError};

use tagalong_core::{Derived, Detection, Frame, Funnel, Result, Search};

/// Answers by question. They live as long as their frame.
#[derive(Default)]
struct Memo {
    found: Mutex<BTreeMap<String, (Vec<Detection>, Funnel)>>,
    margins: Mutex<BTreeMap<String, f64>>,
}

impl Derived for Memo {
    fn derive(_: &Frame) -> Result<Self> {
        Ok(Self::default())
    }
}

/// Who answers: all that an answer depends on, beside the frame and the question.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Identities {
    /// Of each detector; none of one that remembers, whose answers are its own.
    pub detectors: Vec<Option<String>>,
    /// Of each verifier.
    pub verifiers: Vec<String>,
}

/// Returns what `find` finds, or what was found when the same was asked before.
pub(crate) fn found(
    identity: &str,
    frame: &Frame,
    search: &Search<'_>,
    funnel: &mut Funnel,
    find: impl FnOnce(&mut Funnel) -> Result<Vec<Detection>>,
) -> Result<Vec<Detection>> {
    let memo = frame.derived::<Memo>()?;
    let question = match search {
        Search::Everywhere { occupied } => key(identity, occupied),
        Search::Near(track) => key(identity, track),
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

/// Returns what `judge` says of a candidate, or what was said of the same before.
pub(crate) fn margin(
    identity: &str,
    frame: &Frame,
    candidate: &Detection,
    judge: impl FnOnce() -> Result<f64>,
) -> Result<f64> {
    let memo = frame.derived::<Memo>()?;
    let question = key(identity, &candidate);
    if let Some(margin) = lock(&memo.margins).get(&question) {
        return Ok(*margin);
    }
    let margin = judge()?;
    lock(&memo.margins).insert(question, margin);
    Ok(margin)
}

/// Numbers are written so that different ones look different.
fn key(identity: &str, question: &impl Debug) -> String {
    format!("{identity}\n{question:?}")
}

fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
