use std::collections::BTreeMap;

use serde::Serialize;

/// How bad it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Severity {
    /// As it should be.
    Ok,
    /// Could not be measured on this log.
    Unknown,
    /// Costs people in some frames.
    Warn,
    /// Explains why nobody, or the wrong thing, is found.
    Bad,
}

impl Severity {
    /// Of a deviation, by the limits from which on it matters.
    pub fn beyond(deviation: f64, warn: f64, bad: f64) -> Self {
        if deviation >= bad {
            Self::Bad
        } else if deviation >= warn {
            Self::Warn
        } else {
            Self::Ok
        }
    }

    /// As it is printed.
    pub fn word(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Unknown => "?",
            Self::Warn => "warn",
            Self::Bad => "BAD",
        }
    }
}

/// One thing that was looked at.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// What was looked at, for scripts.
    pub id: &'static str,
    /// How bad it is.
    pub severity: Severity,
    /// What was measured, with units.
    pub measured: String,
    /// The same as numbers; the names end in the unit.
    pub figures: BTreeMap<&'static str, f64>,
    /// Why it matters.
    pub why: &'static str,
    /// What to change: a line of the config where there is one.
    pub remedy: Option<String>,
}

impl Finding {
    /// A finding that needs no remedy yet.
    pub fn new(id: &'static str, severity: Severity, measured: impl Into<String>) -> Self {
        let measured = measured.into();
        Self { id, severity, measured, figures: BTreeMap::new(), why: "", remedy: None }
    }

    /// With a number.
    pub fn figure(mut self, name: &'static str, value: f64) -> Self {
        self.figures.insert(name, value);
        self
    }

    /// With the reason why it matters.
    pub fn why(self, why: &'static str) -> Self {
        Self { why, ..self }
    }

    /// With what to change, where something is wrong.
    pub fn remedy(self, remedy: impl Into<String>) -> Self {
        let remedy = (self.severity >= Severity::Warn).then(|| remedy.into());
        Self { remedy, ..self }
    }
}
