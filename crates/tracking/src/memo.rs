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
