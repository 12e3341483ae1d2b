use tagalong_sim::{ApproachBy, Scene};
use tagalong_trials::{ApproachJudge, Approached, Contact, Ride, Tick};

use crate::experiments::follow::story::words;

/// Returns the course of an approach: the approacher and its direction, the faults, and a line for
/// each change of the target and of the reason for the motion.
pub fn story(
    scene: &Scene,
    ride: &Ride,
    judge: &ApproachJudge,
    approached: &Approached,
) -> Vec<String> {
    let mut lines = vec![opening(scene, approached)];
    lines.extend(approached.faults.iter().map(|fault| format!("fault: {fault}")));
    lines.extend(changes(ride, judge));
    lines.push(ending(approached));
    lines
}

/// Returns the initial situation in words.
fn opening(scene: &Scene, approached: &Approached) -> String {
    let Some(approach) = &scene.approach else { return String::new() };
    let [length, width, height] = approach.size_m;
    let kind = match approach.by {
        ApproachBy::Person => "a person".to_owned(),
        ApproachBy::Trolley => format!("a trolley of {length:.2} x {width:.2} x {height:.2} m"),
    };
    let side = approached.side().map_or("no side", |side| side.name());
    let way = if approach.aims { "turns to the robot all the time" } else { "keeps its direction" };
    let laser = if scene.laser.is_some() { "with a laser" } else { "without a laser" };
    format!(
        "seed {}: {kind} comes from {:.1} s on from the {side} ({:.0} degrees, {:.1} m) at {:.2} m/s \
         and {way}; camera at {} m, {laser}, wheels {} s late",
        approached.seed,
        approach.start_s,
        approached.bearing_deg.unwrap_or(f64::NAN),
        approach.distance_m(),
        approach.speed_mps,
        scene.camera.height_m,
        scene.robot.latency_s,
    )
}

/// Returns a line for each change, in chronological order.
fn changes(ride: &Ride, judge: &ApproachJudge) -> Vec<String> {
    let mut lines: Vec<(f64, String)> = Vec::new();
    let mut before = None;
    for tick in &ride.ticks {
        let is_touched = tick.approach.is_some_and(|state| state.gap_m <= 0.0);
        let now = (tick.reason, tick.approach.is_some(), is_touched, judge.moves(tick));
        if before != Some(now) {
            lines.push((tick.at_s, motion(tick, judge.moves(tick))));
            before = Some(now);
        }
    }
    let mut target = None;
    for (moment, report) in ride.moments.iter().zip(&ride.reports) {
        let now = words(report);
        if report.outcome.is_processed() && target.as_ref() != Some(&now) {
            lines.push((moment.stamp.nanos() as f64 * 1e-9, now.clone()));
            target = Some(now);
        }
    }
    lines.sort_by(|a, b| a.0.total_cmp(&b.0));
    lines.into_iter().map(|(at_s, line)| format!("{at_s:>6.2} s  {line}")).collect()
}

/// Returns the motion of the robot and the distance of the approacher in words.
fn motion(tick: &Tick, moves: bool) -> String {
    let motion = if moves { "moves" } else { "stands" };
    let reason = tick.reason.map_or("-", |reason| reason.name());
    let approacher = tick.approach.map_or(String::new(), |state| {
        let touches = if state.gap_m <= 0.0 { ", touches the robot" } else { "" };
        format!(
            "; the approacher is {:.2} m away at {:.0} degrees{touches}",
            state.gap_m,
            state.bearing_rad.to_degrees()
        )
    });
    format!(
        "    {motion} ({reason}): {:.2} m/s, {:.2} rad/s{approacher}",
        tick.speed_mps, tick.turn_rate
    )
}

/// Returns the result in words.
fn ending(approached: &Approached) -> String {
    match (&approached.contact, &approached.touched) {
        (Some(moving), _) => contact_in_words("CONTACT WHILE THE ROBOT MOVED", moving),
        (None, Some(standing)) => contact_in_words("contact of a standing robot", standing),
        (None, None) => "no contact".to_owned(),
    }
}

fn contact_in_words(kind: &str, contact: &Contact) -> String {
    format!(
        "{kind} at {:.2} s: {}, {:.2} m/s, {:.2} rad/s, reason {}; the approacher was {} in the \
         last second",
        contact.at_s,
        contact.with.name(),
        contact.speed_mps,
        contact.turn_rate,
        contact.reason.unwrap_or("-"),
        view_in_words(contact),
    )
}

/// Returns which sensors had the approacher in view.
fn view_in_words(contact: &Contact) -> &'static str {
    match (contact.camera_saw, contact.laser_saw) {
        (true, true) => "in view of the camera and the laser",
        (true, false) => "in view of the camera",
        (false, true) => "in view of the laser",
        (false, false) => "in view of no sensor",
    }
}
