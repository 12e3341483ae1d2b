use tagalong_pipeline::FrameReport;
use tagalong_trials::Ride;

/// Returns the course of a ride: a line for each change of the target and of the reason for the
/// motion.
pub fn story(ride: &Ride) -> Vec<String> {
    let mut before = None;
    let mut lines = Vec::new();
    let frames = ride.moments.iter().zip(&ride.reports);
    for (moment, report) in frames.filter(|(_, report)| report.outcome.is_processed()) {
        let now = words(report);
        if before.as_ref() != Some(&now) {
            lines.push(format!("{:>6.1} s  {now}", moment.stamp.nanos() as f64 * 1e-9));
            before = Some(now);
        }
    }
    lines
}

/// Returns the target and the reason for the motion in words.
pub(super) fn words(report: &FrameReport) -> String {
    let whom = report.target.map_or("nobody".into(), |id| format!("track {id}"));
    let lock = report
        .lock
        .as_ref()
        .map_or(String::new(), |lock| format!(" ({}: {})", lock.state.name(), lock.why));
    let why = report.command.map_or("-", |command| command.reason.name());
    format!("{whom}{lock}: {why}")
}
