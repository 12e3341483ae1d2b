//! Checks of rates, stamps, and the pairing of images.

use tagalong_log::{Timing, TopicFacts};

use super::super::evidence::Evidence;
use super::super::finding::{Finding, Severity};

/// Walking speed of people, m/s.
const WALK_MPS: f64 = 1.4;

impl Evidence {
    /// Returns the topic that makes the frames.
    fn primary(&self) -> Option<&TopicFacts> {
        let facts = &self.inspection.facts;
        let topic = facts.colour_topic.as_ref().or(facts.depth_topic.as_ref())?;
        self.inspection.topic(topic)
    }

    /// Returns the topics of the images, with their stamps.
    fn timings(&self) -> impl Iterator<Item = (&str, Timing)> {
        let facts = &self.inspection.facts;
        let topics = [&facts.colour_topic, &facts.depth_topic, &facts.right_topic];
        let known = topics.into_iter().flatten().filter_map(|name| self.inspection.topic(name));
        known.filter_map(|topic| Some((topic.topic.as_str(), topic.timing?)))
    }
}

/// Checks the rate of the images.
pub fn rate(evidence: &Evidence) -> Option<Finding> {
    let topic = evidence.primary()?;
    let Some(timing) = topic.timing else {
        let measured = format!("{} has {} image", topic.topic, topic.count);
        return Some(Finding::new("rate", Severity::Unknown, measured));
    };
    let hz = 1.0 / timing.median_period_s;
    let walked = WALK_MPS * timing.median_period_s;
    let finding = Finding::new(
        "rate",
        Severity::beyond(walked, 0.6, f64::INFINITY),
        format!("{hz:.1} images a second: somebody walks {walked:.2} m between two"),
    );
    let finding = finding.figure("rate_hz", hz).why(
        "a person who goes far between two images fits no track, and tracks are confirmed late",
    );
    Some(finding.remedy(format!(
        "record 5 images a second or more; else\n[associator.config] gate_m = {:.1}\n[manager.config] \
         confirm_hits = 2",
        (1.0 + walked).min(3.0)
    )))
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
            "{topic}: {} images out of order, {} with the stamp of another",
            timing.steps_back, timing.repeated
        );
        return finding(Severity::Warn, measured)
            .why("images that come later than a few others are dropped")
            .remedy("[input] reorder_frames = 8");
    }
    finding(Severity::Ok, format!("in order, the longest pause is {:.2} s", timing.longest_gap_s))
}

/// Checks that each colour image has a depth image.
pub fn skew(evidence: &Evidence) -> Option<Finding> {
    let skew = evidence.inspection.skew?;
    let facts = &evidence.inspection.facts;
    let count = |topic: &Option<String>| {
        topic.as_ref().and_then(|t| evidence.inspection.topic(t)).map_or(0, |t| t.count)
    };
    // A slower depth camera cannot pair with every colour image, which is no fault of the stamps.
    let possible =
        (count(&facts.depth_topic) as f64 / count(&facts.colour_topic).max(1) as f64).min(1.0);
    let share = skew.paired / possible.max(1e-9);
    let late = skew.median_s.abs();
    let severity = Severity::beyond(1.0 - share, 0.1, 0.5).max(Severity::beyond(late, 0.025, 0.2));
    let measured = format!(
        "depth {:+.0} ms after colour; {:.0} % of the colour images have a depth image within {:.0} ms",
        1e3 * skew.median_s,
        100.0 * skew.paired,
        1e3 * evidence.input.pair_tolerance_s
    );
    let finding = Finding::new("skew", severity, measured)
        .figure("skew_ms", 1e3 * skew.median_s)
        .figure("paired", skew.paired)
        .why("an image without its partner is not used, and one with a late partner shows people beside themselves");
    Some(finding.remedy(if share < 0.9 && late > 0.5 {
        "the two have different clocks: make the camera stamp both at capture".to_owned()
    } else if share < 0.9 && late > evidence.input.pair_tolerance_s {
        format!(
            "make the camera stamp both at capture; until then\n[input] pair_tolerance_s = {:.2}",
            1.2 * late + 0.01
        )
    } else if share < 0.9 {
        "record both topics at the full rate".to_owned()
    } else {
        "make the camera stamp both at capture: people who walk are this much beside themselves"
            .to_owned()
    }))
}

/// Way below which a robot stands, m: noise of the odometry adds up.
const STANDS_M: f64 = 0.3;

/// Share of points that come and go beyond which the camera itself moves.
const ALL_MOVES: f64 = 0.5;

/// Checks that the robot's motion is known.
pub fn odometry(evidence: &Evidence) -> Option<Finding> {
    let counters = &evidence.inspection.counters;
    let count = |name| counters.get(name).copied().unwrap_or(0);
    let (gaps, jumps) = (count("odometry_gap_frames"), count("odometry_jump_frames"));
    let metres = evidence.driven.metres;
    let stands = metres < STANDS_M;
    let all_moves = stands && evidence.changed.is_some_and(|share| share > ALL_MOVES);
    let way = match stands {
        true => "the robot stands still".to_owned(),
        false => format!(
            "{metres:.1} m driven, {:.0} degrees turned",
            evidence.driven.turned_rad.to_degrees()
        ),
    };
    let source = evidence.inspection.facts.odometry_topic.as_deref();
    let (severity, measured) = match (source, gaps + jumps) {
        (_, 1..) => (Severity::Warn, format!("silent at {gaps} frames, jumps at {jumps}; {way}")),
        _ if all_moves => {
            let share = 100.0 * evidence.changed.unwrap_or(0.0);
            let told = if source.is_some() { "the robot stands still" } else { "there is none" };
            (Severity::Bad, format!("{told}, but {share:.0} % of all points come and go"))
        }
        (Some(topic), _) => (Severity::Ok, format!("{topic}: {way}")),
        (None, _) if !stands => (Severity::Ok, format!("from tf: {way}")),
        (None, _) => match evidence.changed {
            Some(_) => (Severity::Ok, "none, and the camera stands still".to_owned()),
            // A scanner alone cannot tell, so nothing is said about how right that is.
            None => (Severity::Unknown, "none: the robot is taken to stand still".to_owned()),
        },
    };
    let finding = Finding::new("odometry", severity, measured)
        .figure("driven_m", metres)
        .figure("turned_deg", evidence.driven.turned_rad.to_degrees())
        .why("while the robot moves and does not say so, people seem to move instead");
    Some(
        finding.remedy(
            "record the odometry throughout, and name it:\n[input] odometry_topic = \"/odom\"",
        ),
    )
}
