use std::collections::BTreeMap;

use serde::Serialize;

/// Severity of a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Severity {
    /// No problem.
    Ok,
    /// It could not be measured on this log.
    Unknown,
    /// It causes missed people in some frames.
    Warn,
    /// It explains missing or false detections.
    Bad,
}

impl Severity {
    /// Returns the severity of a deviation from its two limits.
    pub fn beyond(deviation: f64, warn: f64, bad: f64) -> Self {
        if deviation >= bad {
            Self::Bad
        } else if deviation >= warn {
            Self::Warn
        } else {
            Self::Ok
        }
    }

    /// Returns the printed word.
    pub fn word(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Unknown => "?",
            Self::Warn => "warn",
            Self::Bad => "BAD",
        }
    }
}

/// Result of one check.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// Name of the check, for scripts.
    pub id: &'static str,
    /// Severity of the result.
    pub severity: Severity,
    /// Measured values, with units.
    pub measured: String,
    /// The same as numbers, with names that end in the unit.
    pub figures: BTreeMap<&'static str, f64>,
    /// Reason why it matters.
    pub why: &'static str,
    /// Remedy: a line of the config if there is one.
    pub remedy: Option<String>,
}

impl Finding {
    /// Creates a finding without figures and remedy.
    pub fn new(id: &'static str, severity: Severity, measured: impl Into<String>) -> Self {
        let measured = measured.into();
        Self { id, severity, measured, figures: BTreeMap::new(), why: "", remedy: None }
    }

    /// Adds a number.
    pub fn figure(mut self, name: &'static str, value: f64) -> Self {
        self.figures.insert(name, value);
        self
    }

    /// Adds the reason why it matters.
    pub fn why(self, why: &'static str) -> Self {
        Self { why, ..self }
    }

    /// Adds the remedy if the finding is a problem.
    pub fn remedy(self, remedy: impl Into<String>) -> Self {
        let remedy = (self.severity >= Severity::Warn).then(|| remedy.into());
        Self { remedy, ..self }
    }
}
