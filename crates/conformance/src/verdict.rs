use crate::subject::Subject;

/// A check: its name and its function.
pub type Check = (&'static str, fn(&Subject<'_>) -> Verdict);

/// Result of a check: the error is a sentence.
pub type Verdict = Result<(), String>;

/// Fails with a sentence unless `holds` is true.
pub fn demand(holds: bool, otherwise: impl FnOnce() -> String) -> Verdict {
    if holds { Ok(()) } else { Err(otherwise()) }
}
