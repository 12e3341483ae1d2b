use super::super::evidence::Evidence;
use super::super::finding::{Finding, Severity};

/// Height of legs, m.
const LEGS_M: std::ops::RangeInclusive<f64> = 0.05..=0.9;

/// Checks the scans of a laser scanner.
pub fn laser(evidence: &Evidence) -> Option<Finding> {
    let topic = evidence.inspection.facts.laser_topic.as_ref()?;
    let scans = &evidence.samples.scans;
    if scans.count == 0 {
        let finding = Finding::new("laser", Severity::Warn, format!("{topic}: no usable scan"))
            .why("scans without angles, ranges or a pose are left out");
        return Some(
            finding
                .remedy("publish tf from the robot to the scanner; [input] laser_topic = \"...\""),
        );
    }
    let facts = evidence.inspection.topic(topic);
    let period_s = facts.and_then(|facts| facts.timing).map(|timing| timing.median_period_s);
    let rate = rate_words(period_s, facts.and_then(|facts| facts.rate_hz));
    let step_deg = scans.increment_rad.to_degrees();
    let valid = scans.valid();
    // A scanner outdoors sees the sky in most directions, which is no fault.
    let severity = Severity::beyond(1.0 - valid, 0.8, 0.97);
    let mut measured = format!(
        "{topic}: {rate}, {} rays over {:.0} degrees ({step_deg:.2} each), readings in {:.0} % up to \
         {:.1} m",
        scans.rays,
        step_deg * f64::from(scans.rays),
        100.0 * valid,
        scans.farthest_m
    );
    // At a height of zero tf gives the place on the floor and not the height.
    if scans.height_m > 0.0 {
        measured += &format!(", {:.2} m above the floor", scans.height_m);
    }
    let is_high = scans.height_m > 0.0 && !LEGS_M.contains(&scans.height_m);
    let finding = Finding::new("laser", severity.max(wrong_height(is_high)), measured)
        .figure("rays", f64::from(scans.rays))
        .figure("valid", valid)
        .figure("farthest_m", scans.farthest_m)
        .figure("height_m", scans.height_m)
        .why("legs are looked for in the scans, 0.05 to 0.9 m above the floor");
    Some(finding.remedy(if is_high {
        "mount the scanner at the height of legs, or correct its transform"
    } else {
        "few rays have a return: clean the window; check the range that is set and the driver's filter"
    }))
}

fn wrong_height(is_wrong: bool) -> Severity {
    if is_wrong { Severity::Warn } else { Severity::Ok }
}

/// Returns the rate from the median period of the stamps, s, as in the finding `rate`; without one from
/// the rate of recording, which transport may change.
fn rate_words(period_s: Option<f64>, recorded_hz: Option<f64>) -> String {
    match (period_s, recorded_hz) {
        (Some(period_s), _) => format!("{:.1} scans a second", 1.0 / period_s),
        (None, Some(recorded_hz)) => format!("scans recorded at {recorded_hz:.1} a second"),
        (None, None) => "one scan".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rate_of_scans_is_that_of_their_stamps() {
        assert_eq!(rate_words(Some(0.1), Some(408.8)), "10.0 scans a second");
        assert_eq!(rate_words(None, Some(408.8)), "scans recorded at 408.8 a second");
        assert_eq!(rate_words(None, None), "one scan");
    }
}
