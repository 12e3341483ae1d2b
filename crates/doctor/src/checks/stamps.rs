use tagalong_log::Timing;

use super::super::evidence::Evidence;
use super::super::finding::{Finding, Severity};

impl Evidence {
    /// Returns the topics of the images and of the laser scans, with their stamps.
    fn timings(&self) -> impl Iterator<Item = (&str, Timing)> {
        let facts = &self.inspection.facts;
        let topics =
            [&facts.colour_topic, &facts.depth_topic, &facts.right_topic, &facts.laser_topic];
        let known = topics.into_iter().flatten().filter_map(|name| self.inspection.topic(name));
        known.filter_map(|topic| Some((topic.topic.as_str(), topic.timing?)))
    }
}

/// Checks for gaps, and clocks that jump.
pub fn stamps(evidence: &Evidence) -> Option<Finding> {
    let judged = evidence.timings().map(|(topic, timing)| judge(topic, &timing));
    // With equal severity the first topic wins: `max_by` alone would return the last.
    judged.max_by(|a, b| a.severity.cmp(&b.severity).then(std::cmp::Ordering::Greater))
}

/// Returns the worst problem with the stamps of a topic.
fn judge(topic: &str, timing: &Timing) -> Finding {
    let period = timing.median_period_s;
    let finding = |severity, measured| {
        Finding::new("stamps", severity, measured)
            .figure("longest_gap_s", timing.longest_gap_s)
            .figure("longest_step_back_s", timing.longest_step_back_s)
            .figure("steps_back", timing.steps_back as f64)
    };
    if timing.longest_step_back_s > (4.0 * period).max(0.5) {
        let measured =
            format!("{topic}: the clock is set back by {:.2} s", timing.longest_step_back_s);
        return finding(Severity::Bad, measured)
            .why("whoever was tracked before the jump is forgotten, and gets a new number")
            .remedy(
                "record with one clock (use_sim_time on all nodes or on none; no looping bag)",
            );
    }
    if timing.longest_gap_s > (6.0 * period).max(1.0) {
        let measured = format!("{topic}: a pause of {:.2} s", timing.longest_gap_s);
        return finding(Severity::Warn, measured)
            .why("tracks end when nothing is seen for long")
            .remedy(format!("[clock] reset_gap_s = {:.1}", timing.longest_gap_s.ceil() + 1.0));
    }
    if timing.steps_back + timing.repeated > 0 {
        let measured = format!(
            "{topic}: {} messages out of order, {} with the stamp of another",
            timing.steps_back, timing.repeated
        );
        return finding(Severity::Warn, measured)
            .why("messages that come later than a few others are dropped")
            .remedy("[input] reorder_frames = 8");
    }
    finding(Severity::Ok, format!("in order, the longest pause is {:.2} s", timing.longest_gap_s))
}
