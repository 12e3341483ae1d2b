use tagalong_log::{Input, TopicUse};

use super::super::evidence::Evidence;
use super::super::finding::{Finding, Severity};

/// Checks that no unused topic would give the pipeline an input that it lacks.
pub fn topics(evidence: &Evidence) -> Option<Finding> {
    let account = &evidence.inspection.inputs;
    let wanted = account.curable().filter(|topic| {
        let is_scanner = topic.could_be == Some(Input::Laser.name());
        !is_scanner || evidence.inputs.uses(Input::Laser)
    });
    let curable: Vec<&TopicUse> = wanted.collect();
    if curable.is_empty() {
        let used = account.usable().join(", ");
        let measured = format!("used: {}", if used.is_empty() { "none" } else { &used });
        return Some(Finding::new("topics", Severity::Ok, measured));
    }
    Some(unused(&curable))
}

/// Returns the finding for topics that cannot be used, with what would cure each of them.
fn unused(topics: &[&TopicUse]) -> Finding {
    let mut measured: Vec<String> = Vec::new();
    let mut remedies: Vec<String> = Vec::new();
    for topic in topics {
        let input = topic.could_be.unwrap_or_default();
        let problem = topic.problem.as_deref().unwrap_or_default();
        measured
            .push(format!("{input} of {} ({}) cannot be used: {problem}", topic.topic, topic.kind));
        let remedy = topic.remedy.clone().unwrap_or_else(|| "record it again".to_owned());
        if !remedies.contains(&remedy) {
            remedies.push(remedy);
        }
    }
    Finding::new("topics", Severity::Warn, measured.join("; "))
        .why("the pipeline works without an input that the log seems to have")
        .remedy(remedies.join("\n"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_topic_that_cannot_be_used_is_told_with_its_remedy() {
        let rear = TopicUse {
            topic: "/scan_rear".to_owned(),
            kind: "sensor_msgs/LaserScan".to_owned(),
            camera: None,
            used_as: None,
            calibration: None,
            problem: Some("its messages are invalid: angle_increment is 0".to_owned()),
            could_be: Some("laser"),
            remedy: Some("correct the driver".to_owned()),
        };
        let left = TopicUse { topic: "/scan_left".to_owned(), ..rear.clone() };
        let told = unused(&[&rear, &left]);
        assert_eq!(
            told.measured,
            "laser of /scan_rear (sensor_msgs/LaserScan) cannot be used: its messages are invalid: \
             angle_increment is 0; laser of /scan_left (sensor_msgs/LaserScan) cannot be used: its \
             messages are invalid: angle_increment is 0"
        );
        assert_eq!(told.remedy.as_deref(), Some("correct the driver"));
    }
}
