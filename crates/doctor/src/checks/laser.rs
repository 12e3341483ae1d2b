use tagalong_log::{Input, InputAccount};

use super::super::evidence::{Evidence, Scans};
use super::super::finding::{Finding, Severity};

/// Height of legs, m.
const LEGS_M: std::ops::RangeInclusive<f64> = 0.05..=0.9;

/// Share of frames without a usable scan that is a warning, and a serious one.
const SILENT: (f64, f64) = (0.1, 0.5);

/// Checks the scans of each laser scanner: those of the first one, then of further ones.
pub fn scanners(evidence: &Evidence) -> Vec<Finding> {
    let Some(first) = evidence.inspection.facts.laser_topic.as_deref() else { return Vec::new() };
    let none = Scans::default();
    let mut found = Vec::new();
    for (number, topic) in topics(first, &evidence.inspection.inputs).into_iter().enumerate() {
        let scans = evidence.samples.scans.get(number).unwrap_or(&none);
        // A pipeline without lasers reads none.
        if scans.count == 0 && !evidence.inputs.uses(Input::Laser) {
            continue;
        }
        let facts = evidence.inspection.topic(topic);
        let period_s = facts.and_then(|facts| facts.timing).map(|timing| timing.median_period_s);
        let rate = rate_words(period_s, facts.and_then(|facts| facts.rate_hz));
        found.push(judge(topic, &rate, evidence.reading.made, scans));
    }
    found
}

/// Returns the topics of the scanners that are used, in the order of [`tagalong_core::FurtherScans`].
fn topics<'a>(first: &'a str, account: &'a InputAccount) -> Vec<&'a str> {
    let lasers = account.topics.iter().filter(|topic| topic.used_as.as_deref() == Some("laser"));
    let further = lasers.map(|topic| topic.topic.as_str()).filter(|topic| *topic != first);
    std::iter::once(first).chain(further).collect()
}

/// Judges the scans of one scanner, given its rate in words and the number of frames.
fn judge(topic: &str, rate: &str, frames: u64, scans: &Scans) -> Finding {
    if scans.count == 0 {
        return Finding::new("laser", Severity::Warn, format!("{topic}: no usable scan"))
            .why("scans without angles, ranges or a pose are left out")
            .remedy("publish tf from the robot to the scanner; [input] laser_topic = \"...\"");
    }
    let step_deg = scans.increment_rad.to_degrees();
    let valid = scans.valid();
    // Outdoors a scanner has no reflection in most directions, which is not a fault.
    let few_rays = Severity::beyond(1.0 - valid, 0.8, 0.97);
    let silent = frames.saturating_sub(scans.count as u64);
    let silence = Severity::beyond(silent as f64 / frames.max(1) as f64, SILENT.0, SILENT.1);
    let mut measured = format!(
        "{topic}: {rate}, {} rays over {:.0} degrees ({step_deg:.2} each), readings in {:.0} % up to \
         {:.1} m",
        scans.rays,
        step_deg * f64::from(scans.rays),
        100.0 * valid,
        scans.farthest_m
    );
    // At a height of zero, tf only has the position on the floor and not the height.
    if scans.height_m > 0.0 {
        measured += &format!(", {:.2} m above the floor", scans.height_m);
    }
    if silence > Severity::Ok {
        measured += &format!("; no usable scan at {silent} of {frames} frames");
    }
    let is_high = scans.height_m > 0.0 && !LEGS_M.contains(&scans.height_m);
    let severity = few_rays.max(silence).max(wrong_height(is_high));
    let finding = Finding::new("laser", severity, measured)
        .figure("rays", f64::from(scans.rays))
        .figure("valid", valid)
        .figure("farthest_m", scans.farthest_m)
        .figure("height_m", scans.height_m)
        .why("legs are looked for in the scans, 0.05 to 0.9 m above the floor");
    finding.remedy(if few_rays > Severity::Ok {
        "few rays have a return: clean the window; check the range that is set and the driver's filter"
    } else if is_high {
        "mount the scanner at the height of legs, or correct its transform"
    } else {
        "the scanner, or its tf, stops or pauses: record both throughout"
    })
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
    use tagalong_log::TopicUse;

    use super::*;

    fn laser(topic: &str, used_as: Option<&str>) -> TopicUse {
        TopicUse {
            topic: topic.to_owned(),
            kind: "sensor_msgs/LaserScan".to_owned(),
            camera: None,
            used_as: used_as.map(str::to_owned),
            calibration: None,
            problem: None,
            could_be: None,
            remedy: None,
        }
    }

    #[test]
    fn the_rate_of_scans_is_that_of_their_stamps() {
        assert_eq!(rate_words(Some(0.1), Some(408.8)), "10.0 scans a second");
        assert_eq!(rate_words(None, Some(408.8)), "scans recorded at 408.8 a second");
        assert_eq!(rate_words(None, None), "one scan");
    }

    #[test]
    fn each_scanner_that_is_used_has_its_place() {
        let mut account = InputAccount::default();
        account.topics = vec![
            laser("/a", Some("laser")),
            laser("/front", Some("laser")),
            laser("/rear", Some("laser")),
            laser("/zero", None),
        ];
        assert_eq!(topics("/front", &account), ["/front", "/a", "/rear"]);
    }

    #[test]
    fn a_scanner_without_readings_and_a_silent_one_are_told() {
        let good = Scans {
            count: 40,
            readings: 40 * 180,
            rays: 181,
            increment_rad: 0.01,
            farthest_m: 5.0,
            height_m: 0.3,
            ..Scans::default()
        };
        let told = judge("/rear", "10.0 scans a second", 40, &good);
        assert_eq!(told.severity, Severity::Ok, "{told:?}");
        assert!(!told.measured.contains("no usable scan"), "{told:?}");
        let blind = Scans { readings: 0, farthest_m: 0.0, ..good.clone() };
        let told = judge("/rear", "10.0 scans a second", 40, &blind);
        assert_eq!(told.severity, Severity::Bad, "{told:?}");
        assert!(told.remedy.unwrap().contains("few rays have a return"));
        let ending = Scans { count: 20, readings: 20 * 180, ..good };
        let told = judge("/rear", "10.0 scans a second", 40, &ending);
        assert_eq!(told.severity, Severity::Bad, "{told:?}");
        assert!(told.measured.contains("no usable scan at 20 of 40 frames"), "{told:?}");
        assert!(told.remedy.unwrap().contains("stops or pauses"));
    }
}
