use super::super::evidence::Evidence;
use super::super::finding::{Finding, Severity};

/// Checks that each colour image has a depth image.
pub fn skew(evidence: &Evidence) -> Option<Finding> {
    let skew = evidence.inspection.skew?;
    let facts = &evidence.inspection.facts;
    let [colour, depth] = [&facts.colour_topic, &facts.depth_topic].map(|topic| {
        topic.as_ref().and_then(|t| evidence.inspection.topic(t)).map_or(0, |t| t.count)
    });
    // A slower depth camera cannot pair with every colour image, which is no fault of the stamps.
    let possible = (depth as f64 / colour.max(1) as f64).min(1.0);
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
        .why(
            "an image without its partner is not used, and with a late partner the depth of \
             people who walk lies beside them",
        );
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
        "make the camera stamp both at capture: the depth of people who walk is shifted by this delay"
            .to_owned()
    }))
}
