use tagalong_pipeline::FrameReport;
use tagalong_trials::Ride;

/// Returns the course of a ride: a line for each change of the target and of the reason for the
/// motion, and for the begin and the end of each injected fault.
pub fn story(ride: &Ride) -> Vec<String> {
    let mut before = None;
    let mut events = fault_events(ride);
    let frames = ride.moments.iter().zip(&ride.reports);
    for (moment, report) in frames.filter(|(_, report)| report.outcome.is_processed()) {
        let now = words(report);
        if before.as_ref() != Some(&now) {
            events.push((moment.stamp.nanos() as f64 * 1e-9, now.clone()));
            before = Some(now);
        }
    }
    // Stable: a fault comes before the frame of the same time, which it changes.
    events.sort_by(|a, b| a.0.total_cmp(&b.0));
    events.into_iter().map(|(at_s, said)| format!("{at_s:>6.1} s  {said}")).collect()
}

/// Returns the begin and the end of each fault within the ride, s, with a text.
fn fault_events(ride: &Ride) -> Vec<(f64, String)> {
    let end_s = ride.ticks.last().map_or(0.0, |tick| tick.at_s);
    let mut events = Vec::new();
    for fault in &ride.faults {
        events.push((fault.from_s, format!("injected fault begins: {}", fault.kind)));
        events.push((fault.to_s, format!("injected fault ends: {}", fault.kind)));
    }
    events.retain(|(at_s, _)| *at_s <= end_s);
    events
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

#[cfg(test)]
mod tests {
    use tagalong_sim::{Clearance, FaultKind, InjectedFault, Scene};
    use tagalong_trials::Tick;

    use super::*;

    #[test]
    fn faults_are_told_where_they_begin_and_end_within_the_ride() {
        let mut scene = Scene::default();
        scene.faults.inject = vec![
            InjectedFault::new(FaultKind::Drop).at(3.0).lasting(2.0),
            InjectedFault::new(FaultKind::WheelsStuck).at(4.0),
            InjectedFault::new(FaultKind::Delay).at(12.0),
        ];
        let clearance = Clearance { people_m: 1.0, things_m: 1.0 };
        let ride = Ride {
            seed: 1,
            stand_off_m: None,
            moments: Vec::new(),
            reports: Vec::new(),
            took_ms: Vec::new(),
            ticks: vec![Tick {
                at_s: 9.98,
                speed_mps: 0.0,
                turn_rate: 0.0,
                clearance,
                crowd: None,
                approach: None,
                reason: None, is_still: false,
            }],
            in_view: Vec::new(),
            faults: scene.scheduled_faults(),
        };
        assert_eq!(
            story(&ride),
            [
                "   3.0 s  injected fault begins: drop",
                "   4.0 s  injected fault begins: wheels-stuck",
                "   5.0 s  injected fault ends: drop",
            ]
        );
    }
}
