use tagalong_log::TopicFacts;

use super::super::evidence::Evidence;
use super::super::finding::{Finding, Severity};

/// Walking speed of people, m/s.
const WALK_MPS: f64 = 1.4;

impl Evidence {
    /// Returns the topic that makes the frames.
    pub(super) fn primary(&self) -> Option<&TopicFacts> {
        let facts = &self.inspection.facts;
        let images = facts.colour_topic.as_ref().or(facts.depth_topic.as_ref());
        self.inspection.topic(images.or(facts.laser_topic.as_ref())?)
    }

    /// Returns the median time from one frame to the next, ms.
    pub fn period_ms(&self) -> Option<f64> {
        Some(1e3 * self.primary()?.timing?.median_period_s)
    }
}

/// Checks the rate of the images, or of the scans if these make the frames.
pub fn rate(evidence: &Evidence) -> Option<Finding> {
    let topic = evidence.primary()?;
    let Some(timing) = topic.timing else {
        let measured = if topic.count > 1 {
            let name = &topic.topic;
            format!(
                "no message of {name} is stamped later than the one before: the rate is not known"
            )
        } else {
            format!("{} has one message", topic.topic)
        };
        return Some(Finding::new("rate", Severity::Unknown, measured));
    };
    let hz = 1.0 / timing.median_period_s;
    let walked = WALK_MPS * timing.median_period_s;
    let finding = Finding::new(
        "rate",
        Severity::beyond(walked, 0.6, f64::INFINITY),
        format!("{hz:.1} {} a second: a person walks {walked:.2} m between two", kind_of(topic)),
    );
    let finding = finding.figure("rate_hz", hz).why(
        "a person who walks far between two of them matches no track, and tracks are confirmed late",
    );
    Some(finding.remedy(format!(
        "record 5 a second or more; else\n[associator.config] gate_m = {:.1}\n[manager.config] \
         confirm_hits = 2",
        (1.0 + walked).min(3.0)
    )))
}

/// Returns the noun for the messages of a topic.
fn kind_of(topic: &TopicFacts) -> &'static str {
    if topic.image.is_some() { "images" } else { "scans" }
}
