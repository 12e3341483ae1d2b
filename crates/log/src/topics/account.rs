//! Account of the topics: the use of each one, or the reason why it is not used.

use std::fmt;

use serde::Serialize;

/// One topic in the account.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct TopicUse {
    /// Name of the topic.
    pub topic: String,
    /// Type and encoding of its messages.
    pub kind: String,
    /// Camera, with its streams, to which the topic belongs; `None` for other sensors.
    pub camera: Option<String>,
    /// Input for which the messages are used: `colour`, `depth`, `right`, `laser`, `odometry` and
    /// so on; `None` if they are not used.
    pub used_as: Option<String>,
    /// Calibration of the images.
    pub calibration: Option<String>,
    /// Reason why the topic is not used, or why its use fails.
    pub problem: Option<String>,
    /// Input for which the topic could be used if the problem were solved and no other topic were
    /// used for it; also `laser` for a scanner beside others.
    pub could_be: Option<&'static str>,
    /// Setting or action that solves the problem.
    pub remedy: Option<String>,
}

/// Account of all images, scans, detections and odometry of a log.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(transparent)]
#[non_exhaustive]
pub struct InputAccount {
    /// Used topics first, each kind sorted by name.
    pub topics: Vec<TopicUse>,
}

/// Order of the inputs in the account.
const ORDER: [&str; 6] = ["colour", "depth", "right", "odometry", "laser", "detections"];

impl InputAccount {
    /// Returns the topic that is used for an input.
    pub fn used_as(&self, input: &str) -> Option<&TopicUse> {
        self.topics.iter().find(|topic| topic.used_as.as_deref() == Some(input))
    }

    /// Yields the topics that are not used, or whose use fails.
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

    /// Yields the topics that could be used for a missing input, or as a further scanner, if their
    /// problem were solved.
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
            // Without a calibration, positions in metres are guesses.
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
