use tagalong_log::{StampSource, Timing};

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

/// Checks for gaps, clocks that jump, and stamps that were never set.
pub fn stamps(evidence: &Evidence) -> Option<Finding> {
    if let Some(topic) =
        evidence.primary().filter(|topic| topic.count > 1 && topic.timing.is_none())
    {
        return Some(unset(
            &topic.topic,
            evidence.input.stamps,
            evidence.inspection.counters.contains_key(REPLACED),
        ));
    }
    let judged = evidence.timings().map(|(topic, timing)| judge(topic, &timing));
    // With equal severity the first topic wins: `max_by` alone would return the last.
    judged.max_by(|a, b| a.severity.cmp(&b.severity).then(std::cmp::Ordering::Greater))
}

/// Counter of the reader for a log whose stamps it replaces by the times of recording.
const REPLACED: &str = "logs_without_stamps";

/// Returns the finding for a topic without a stamp that is later than the one before.
fn unset(topic: &str, used: StampSource, is_replaced: bool) -> Finding {
    let recording = "the times of recording are used instead of all stamps";
    let (severity, taken) = match used {
        StampSource::Recording => (Severity::Ok, recording),
        StampSource::Auto if is_replaced => (Severity::Warn, recording),
        StampSource::Auto | StampSource::Header => (Severity::Bad, "no other times are used"),
    };
    let measured = format!("no message of {topic} is stamped later than the one before: {taken}");
    Finding::new("stamps", severity, measured)
        .why(
            "times of recording include the delays of transport, so motion is less exact; without \
             any times motion is not known",
        )
        .remedy(
            "let the driver set header.stamp when it takes the image; until then\n\
             [input] stamps = \"recording\"",
        )
}

/// Returns the worst problem with the stamps of a topic.
fn judge(topic: &str, timing: &Timing) -> Finding {
    let period = timing.median_period_s;
    if timing.longest_step_back_s > (4.0 * period).max(0.5) {
        let measured =
            format!("{topic}: the clock is set back by {:.2} s", timing.longest_step_back_s);
        return about_stamps(timing, Severity::Bad, measured)
            .why("tracks end at the jump, and people get new IDs after it")
            .remedy(
                "record with one clock (use_sim_time on all nodes or on none; no looping bag)",
            );
    }
    if timing.longest_gap_s > (6.0 * period).max(1.0) {
        let measured = format!("{topic}: a pause of {:.2} s", timing.longest_gap_s);
        return about_stamps(timing, Severity::Warn, measured)
            .why("tracks end if no frame comes for a long time")
            .remedy(format!("[clock] reset_gap_s = {:.1}", timing.longest_gap_s.ceil() + 1.0));
    }
    if timing.steps_back + timing.repeated > 0 {
        let measured = format!(
            "{topic}: {} messages out of order, {} with the stamp of another",
            timing.steps_back, timing.repeated
        );
        return about_stamps(timing, Severity::Warn, measured)
            .why("messages that come later than a few others are dropped")
            .remedy("[input] reorder_frames = 8");
    }
    let measured = format!("in order; the longest gap is {:.2} s", timing.longest_gap_s);
    about_stamps(timing, Severity::Ok, measured)
}

/// A finding on the stamps of a topic, with its figures.
fn about_stamps(timing: &Timing, severity: Severity, measured: String) -> Finding {
    Finding::new("stamps", severity, measured)
        .figure("longest_gap_s", timing.longest_gap_s)
        .figure("longest_step_back_s", timing.longest_step_back_s)
        .figure("steps_back", timing.steps_back as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_that_were_never_set_are_told_with_the_times_that_are_taken() {
        let told = unset("/camera", StampSource::Auto, true);
        assert_eq!((told.id, told.severity), ("stamps", Severity::Warn));
        assert!(told.measured.contains("the times of recording are used"), "{}", told.measured);
        assert!(told.remedy.unwrap().contains("[input] stamps = \"recording\""));
        let told = unset("/camera", StampSource::Auto, false);
        assert_eq!(told.severity, Severity::Bad);
        assert!(told.measured.contains("no other times are used"), "{}", told.measured);
        assert_eq!(unset("/camera", StampSource::Header, false).severity, Severity::Bad);
        assert_eq!(unset("/camera", StampSource::Recording, false).severity, Severity::Ok);
    }
}
