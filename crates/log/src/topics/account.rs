//! Account of the topics: what each one is used for, and why others are not used.

use std::fmt;

use serde::Serialize;

/// One topic in the account.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct TopicUse {
    /// Name of the topic.
    pub topic: String,
    /// Type and encoding of its messages.
    pub kind: String,
    /// Camera, with its streams, that the topic belongs to; none for other sensors.
    pub camera: Option<String>,
    /// Input that the messages are used as: `colour`, `depth`, `right`, `laser`, `odometry` and so
    /// on; `None` if they are not used.
    pub used_as: Option<String>,
    /// Calibration of the images.
    pub calibration: Option<String>,
    /// Reason for which it is not used, or for which its use fails.
    pub problem: Option<String>,
    /// Input that it could be used as, if the problem were cured and nothing else serves as that; also
    /// `laser` for a scanner beside others.
    pub could_be: Option<&'static str>,
    /// Setting or action that cures the problem.
    pub remedy: Option<String>,
}

/// Account of all images, scans, detections and odometry of a log.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(transparent)]
#[non_exhaustive]
pub struct InputAccount {
    /// Used topics first, each kind in the order of names.
    pub topics: Vec<TopicUse>,
}

/// Order of the inputs in the account.
const ORDER: [&str; 6] = ["colour", "depth", "right", "odometry", "laser", "detections"];

impl InputAccount {
    /// Returns the topic that is used as an input.
    pub fn used_as(&self, input: &str) -> Option<&TopicUse> {
        self.topics.iter().find(|topic| topic.used_as.as_deref() == Some(input))
    }

    /// Yields the topics that are not used, or not used with success.
    pub fn problems(&self) -> impl Iterator<Item = &TopicUse> {
        self.topics.iter().filter(|topic| topic.problem.is_some())
    }

    /// Returns the names of the inputs that the log has and that can be used.
    pub fn usable(&self) -> Vec<&str> {
        let used = self.topics.iter().filter(|topic| topic.problem.is_none());
        let mut names: Vec<&str> = used.filter_map(|topic| topic.used_as.as_deref()).collect();
        names.dedup();
        names
    }

    /// Yields the topics that could serve as an input that is missing, or as a further scanner, if their
    /// problem were cured.
    pub fn curable(&self) -> impl Iterator<Item = &TopicUse> {
        self.topics.iter().filter(|topic| topic.could_be.is_some())
    }

    /// Returns the account as lines of text.
    pub fn lines(&self) -> Vec<String> {
        self.topics.iter().map(ToString::to_string).collect()
    }

    pub(super) fn sort(&mut self) {
        self.topics.sort_by_cached_key(|topic| {
            let used = topic.used_as.as_deref();
            let place = ORDER.iter().position(|input| used == Some(*input));
            (used.is_none(), place.unwrap_or(ORDER.len()), topic.topic.clone())
        });
    }
}

impl fmt::Display for TopicUse {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { topic, kind, camera, used_as, calibration, problem, remedy, .. } = self;
        match used_as {
            Some(input) => write!(f, "{input}: {topic} ({kind}")?,
            None => write!(f, "not used: {topic} ({kind}")?,
        }
        match calibration {
            Some(calibration) => write!(f, "; calibration {calibration})")?,
            // Without one, positions in metres are guesses.
            None if used_as.is_some() && camera.is_some() => write!(f, "; no calibration)")?,
            None => write!(f, ")")?,
        }
        if let Some(problem) = problem {
            let but = if used_as.is_some() { " cannot be used" } else { "" };
            write!(f, "{but}: {problem}")?;
        }
        if let Some(remedy) = remedy {
            write!(f, "; {remedy}")?;
        }
        Ok(())
    }
}
