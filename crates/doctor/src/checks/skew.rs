use tagalong_log::Skew;

use super::super::evidence::Evidence;
use super::super::finding::{Finding, Severity};

/// Share of the period of the images from which on the one before and the one after are as near.
const HALFWAY: f64 = 0.48;

/// Checks that each colour image has a depth image.
pub fn skew(evidence: &Evidence) -> Option<Finding> {
    let skew = evidence.inspection.skew?;
    let facts = &evidence.inspection.facts;
    let [colour, depth] = [&facts.colour_topic, &facts.depth_topic].map(|topic| {
        topic.as_ref().and_then(|t| evidence.inspection.topic(t)).map_or(0, |t| t.count)
    });
    if let Some(words) = skew.other_clock() {
        let finding = about_pairs(Severity::Bad, format!("depth: {words}"), skew);
        return Some(finding.remedy(
            "use the times of recording instead of the stamps:\n[input] stamps = \"recording\"",
        ));
    }
    // A slower depth camera cannot pair with every colour image, which is not a fault of the
    // stamps.
    let possible = (depth as f64 / colour.max(1) as f64).min(1.0);
    let share = skew.paired / possible.max(1e-9);
    let late = skew.median_s.abs();
    let is_halfway = evidence.period_ms().is_some_and(|ms| 1e3 * late > HALFWAY * ms);
    let offset = if is_halfway {
        format!("{:.0} ms before or after", 1e3 * late)
    } else {
        format!("{:+.0} ms after", 1e3 * skew.median_s)
    };
    let severity = Severity::beyond(1.0 - share, 0.1, 0.5).max(Severity::beyond(late, 0.025, 0.2));
    let measured = format!(
        "depth {offset} colour; {:.0} % of the colour images have a depth image within {:.0} ms",
        100.0 * skew.paired,
        1e3 * evidence.input.pair_tolerance_s
    );
    let topic = facts.depth_topic.as_ref();
    let used = evidence.inspection.inputs.topics.iter().find(|used| Some(&used.topic) == topic);
    Some(about_pairs(severity, measured, skew).remedy(if share >= 0.9 {
        "make the camera stamp both at capture: the depth of people who walk is shifted by this delay"
            .to_owned()
    } else if let Some(remedy) = used.and_then(|used| used.remedy.clone()) {
        remedy
    } else if late > evidence.input.pair_tolerance_s && !is_halfway {
        format!(
            "make the camera stamp both at capture; until then\n[input] pair_tolerance_s = {:.2}",
            1.2 * late + 0.01
        )
    } else if depth < colour {
        "record both topics at the full rate".to_owned()
    } else {
        "make the camera stamp both at capture".to_owned()
    }))
}

/// Returns a finding on the pairs of colour and depth, with what they decide.
fn about_pairs(severity: Severity, measured: String, skew: Skew) -> Finding {
    Finding::new("skew", severity, measured)
        .figure("skew_ms", 1e3 * skew.clock_s.unwrap_or(skew.median_s))
        .figure("paired", skew.paired)
        .why(
            "an image without its partner is not used, and with a late partner the depth of \
             people who walk lies beside them",
        )
}
