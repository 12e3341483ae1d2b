use tagalong_log::{StampSource, Timing};
use tagalong_math::counted;

use super::super::evidence::Evidence;
use super::super::finding::{Finding, Severity};

impl Evidence {
    /// Returns the topics of images and laser scans, with their stamps.
    fn timings(&self) -> impl Iterator<Item = (&str, Timing)> {
        let facts = &self.inspection.facts;
        let topics =
            [&facts.colour_topic, &facts.depth_topic, &facts.right_topic, &facts.laser_topic];
        let known = topics.into_iter().flatten().filter_map(|name| self.inspection.topic(name));
        known.filter_map(|topic| Some((topic.topic.as_str(), topic.timing?)))
    }
}

/// Checks for gaps, jumps of the clock, and stamps that were never set.
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
    let late = evidence.inspection.counters.get("late_frames").copied().unwrap_or(0);
    let primary = evidence.primary().map(|topic| topic.topic.as_str());
    let judged = evidence.timings().map(|(topic, timing)| {
        // Of other topics each message is found by its stamp, in whatever order they come.
        let late = if Some(topic) == primary { late } else { 0 };
        judge(topic, &timing, late, evidence.input.reorder_frames)
    });
    // With equal severity the first topic wins: `max_by` alone would return the last.
    judged.max_by(|a, b| a.severity.cmp(&b.severity).then(std::cmp::Ordering::Greater))
}

/// Counter of the reader for logs whose stamps it replaces with recording times.
const REPLACED: &str = "logs_without_stamps";

/// Returns the finding for a topic in which no stamp is later than the previous one.
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

/// Returns the worst problem with the stamps of a topic, of which so many messages came too late for an
/// order over `reorder_frames` images.
fn judge(topic: &str, timing: &Timing, late: u64, reorder_frames: usize) -> Finding {
    let period = timing.median_period_s;
    if timing.longest_step_back_s > (4.0 * period).max(0.5) {
        let measured =
            format!("{topic}: the clock is set back by {:.2} s", timing.longest_step_back_s);
        return about_stamps(timing, Severity::Bad, measured)
            .why(
                "tracks end at the jump, and people who are not re-identified get new IDs after it",
            )
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
        let mut parts: Vec<String> = Vec::new();
        if timing.steps_back > 0 {
            let messages = counted(timing.steps_back as u64, "message");
            parts.push(if late > 0 {
                format!("{messages} out of order, {late} too late to be put in order")
            } else {
                format!("{messages} out of order, put in order")
            });
        }
        if timing.repeated > 0 {
            let messages = counted(timing.repeated as u64, "message");
            parts.push(format!("{messages} with the stamp of the one before"));
        }
        let severity = if late > 0 { Severity::Warn } else { Severity::Ok };
        return about_stamps(timing, severity, format!("{topic}: {}", parts.join(", ")))
            .why("messages that come later than a few others are dropped")
            .remedy(format!("[input] reorder_frames = {}", (2 * reorder_frames).max(8)));
    }
    let measured = format!("in order; the longest gap is {:.2} s", timing.longest_gap_s);
    about_stamps(timing, Severity::Ok, measured)
}

/// Returns a finding on the stamps of a topic, with its figures.
fn about_stamps(timing: &Timing, severity: Severity, measured: String) -> Finding {
    Finding::new("stamps", severity, measured)
        .figure("longest_gap_s", timing.longest_gap_s)
        .figure("longest_step_back_s", timing.longest_step_back_s)
        .figure("steps_back", timing.steps_back as f64)
}

#[cfg(test)]
mod tests {
    use tagalong_core::Stamp;

    use super::*;

    #[test]
    fn messages_that_are_put_in_order_are_no_problem() {
        let stamps = [0.0, 0.1, 0.3, 0.2, 0.4].map(|at| Stamp::default().plus_seconds(1.0 + at));
        let timing = Timing::of(&stamps).unwrap();
        let told = judge("/camera", &timing, 0, 3);
        assert_eq!((told.severity, told.remedy), (Severity::Ok, None));
        assert_eq!(told.measured, "/camera: 1 message out of order, put in order");
        let told = judge("/camera", &timing, 1, 3);
        assert_eq!(told.severity, Severity::Warn);
        assert!(told.measured.ends_with("1 too late to be put in order"), "{}", told.measured);
        assert_eq!(told.remedy.as_deref(), Some("[input] reorder_frames = 8"));
        let told = judge("/camera", &timing, 1, 8);
        assert_eq!(told.remedy.as_deref(), Some("[input] reorder_frames = 16"));
    }

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
