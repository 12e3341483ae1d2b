use tagalong_pipeline::FrameReport;
use tagalong_trials::Ride;

/// Duration below which a spell of one reason is joined with other short ones beside it, s.
const SHORT_S: f64 = 1.0;

/// Spell with one target and one reason for the motion.
#[derive(Clone, Debug, PartialEq)]
struct Spell {
    from_s: f64,
    to_s: f64,
    /// The target and the state of its lock.
    whom: String,
    /// The reasons in chronological order.
    reasons: Vec<&'static str>,
    /// The person, the place or the sensor that was the first cause.
    cause: Option<String>,
}

/// Returns the course of a ride: a line for each change of the target and of the reason for the
/// motion, and for the beginning and the end of each injected fault. Reasons that alternate within
/// a second share a line.
pub fn story(ride: &Ride) -> Vec<String> {
    let mut events = fault_events(ride);
    let faults_s: Vec<f64> = events.iter().map(|(at_s, _)| *at_s).collect();
    for spell in joined(spells(ride), &faults_s) {
        events.push((spell.from_s, spell.words()));
    }
    // The sort is stable: a fault comes before the frame of the same time, which it affects.
    events.sort_by(|a, b| a.0.total_cmp(&b.0));
    events.into_iter().map(|(at_s, said)| format!("{at_s:>6.1} s  {said}")).collect()
}

/// Returns the spells of a ride, frame by frame.
fn spells(ride: &Ride) -> Vec<Spell> {
    let mut spells: Vec<Spell> = Vec::new();
    let frames = ride.moments.iter().zip(&ride.reports);
    for (moment, report) in frames.filter(|(_, report)| report.outcome.is_processed()) {
        let at_s = moment.stamp.nanos() as f64 * 1e-9;
        let whom = whom(report);
        let reasons = vec![reason(report)];
        if let Some(last) = spells.last_mut() {
            last.to_s = at_s;
            if (&last.whom, &last.reasons) == (&whom, &reasons) {
                continue;
            }
        }
        let cause = report.cause.as_ref().map(ToString::to_string);
        spells.push(Spell { from_s: at_s, to_s: at_s, whom, reasons, cause });
    }
    spells
}

/// Joins short spells of the same target that follow one another without a fault between them.
fn joined(spells: Vec<Spell>, faults_s: &[f64]) -> Vec<Spell> {
    let mut lines: Vec<Spell> = Vec::new();
    let mut is_open = false;
    for spell in spells {
        let is_short = spell.to_s - spell.from_s < SHORT_S;
        let last = lines.last_mut().filter(|last| {
            let is_apart = faults_s.iter().any(|at_s| last.from_s < *at_s && *at_s <= spell.from_s);
            is_open && is_short && last.whom == spell.whom && !is_apart
        });
        is_open = is_short;
        let Some(last) = last else {
            lines.push(spell);
            continue;
        };
        last.to_s = spell.to_s;
        for reason in spell.reasons {
            if !last.reasons.contains(&reason) {
                last.reasons.push(reason);
            }
        }
    }
    lines
}

impl Spell {
    fn words(&self) -> String {
        let Self { whom, reasons, cause, .. } = self;
        match (&reasons[..], cause) {
            ([reason], Some(cause)) => format!("{whom}: {reason} ({cause})"),
            _ => format!("{whom}: {}", reasons.join("/")),
        }
    }
}

/// Returns the beginning and the end of each fault within the ride, s, with a text.
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
    format!("{}: {}", whom(report), reason(report))
}

/// Returns the target with the state of its lock.
fn whom(report: &FrameReport) -> String {
    let whom = report.target.map_or("nobody".into(), |id| format!("track {id}"));
    let lock = report
        .lock
        .as_ref()
        .map_or(String::new(), |lock| format!(" ({}: {})", lock.state.name(), lock.why));
    format!("{whom}{lock}")
}

/// Returns the reason for the motion.
fn reason(report: &FrameReport) -> &'static str {
    report.command.map_or("-", |command| command.reason.name())
}

#[cfg(test)]
mod tests {
    use tagalong_sim::{Clearance, FaultKind, InjectedFault, Scene};
    use tagalong_trials::Tick;

    use super::*;

    fn spell(from_s: f64, to_s: f64, whom: &str, reason: &'static str) -> Spell {
        let cause = (reason == "blocked").then(|| "the place".to_owned());
        Spell { from_s, to_s, whom: whom.into(), reasons: vec![reason], cause }
    }

    fn told(spells: &[Spell], faults_s: &[f64]) -> Vec<(f64, String)> {
        let lines = joined(spells.to_vec(), faults_s);
        lines.iter().map(|line| (line.from_s, line.words())).collect()
    }

    #[test]
    fn reasons_that_change_to_and_fro_share_a_line_and_those_that_last_have_their_own() {
        let spells = [
            spell(0.0, 2.0, "track 1", "follow"),
            spell(2.0, 2.1, "track 1", "limited"),
            spell(2.1, 2.2, "track 1", "follow"),
            spell(2.2, 2.9, "track 1", "limited"),
            spell(2.9, 4.0, "track 1", "blocked"),
            spell(4.0, 4.1, "track 1", "limited"),
            spell(4.1, 4.2, "nobody", "limited"),
        ];
        let lines = told(&spells, &[]);
        let lines: Vec<_> = lines.iter().map(|(at_s, said)| (*at_s, said.as_str())).collect();
        assert_eq!(
            lines,
            [
                (0.0, "track 1: follow"),
                (2.0, "track 1: limited/follow"),
                (2.9, "track 1: blocked (the place)"),
                (4.0, "track 1: limited"),
                (4.1, "nobody: limited"),
            ]
        );
        let apart = told(&spells, &[2.15]);
        assert_eq!(apart[2], (2.2, "track 1: limited".to_owned()), "a fault is between them");
    }

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
            ticks: vec![Tick {
                at_s: 9.98,
                speed_mps: 0.0,
                turn_rate: 0.0,
                clearance,
                crowd: None,
                approach: None,
                reason: None,
                effect: "stands",
            }],
            faults: scene.scheduled_faults(),
            ..Ride::default()
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
