//! Seconds in the private zone of others that the robot could have avoided.
//!
//! A ride with such seconds is driven again, with a robot that stands from some time before them on. What
//! a robot that stands has as well is the doing of the others.

use tagalong_report::{Cell, Row, Table};
use tagalong_sim::{FaultKind, InjectedFault};
use tagalong_trials::{Ride, Tick, TrialError, in_order};

use super::rides::{Job, PLANNERS, SETTINGS, Source, jobs};
use crate::findings::Findings;
use crate::lab::{Lab, ReproduceError};

/// Gap to another person below which the robot is in the private zone, m.
const PRIVATE_M: f64 = 0.45;
/// Times before it at which the robot stops instead, s. The shortest one is that of the braking.
const EARLIER_S: [f64; 3] = [1.0, 2.0, 4.0];
/// Two times in the private zone that are less than this apart are one, s.
const APART_S: f64 = 1.0;
/// A gap that is smaller by less than this is the same, s: that of one step of the measures.
const STEP_S: f64 = 0.1;

/// Time in the private zone, s.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Intrusion {
    from_s: f64,
    to_s: f64,
}

/// Counts of the rides of one setting.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Counts {
    rides: u64,
    intrusions: u64,
    private_s: f64,
    avoidable: u64,
    avoidable_s: f64,
    moving_s: f64,
}

/// Returns the table of the times that a robot could have avoided.
pub(super) fn avoidable(lab: &Lab) -> Result<Findings, ReproduceError> {
    let jobs = jobs(lab, &PLANNERS, Source::Told, None)?;
    lab.progress.begin(jobs.len(), "rides anew");
    let counts = in_order(&jobs, lab.jobs, |job| of_job(lab, job), |_| lab.progress.step())?;
    let mut rows = Vec::new();
    for setting in SETTINGS.map(Some).into_iter().chain([None]) {
        for (planner, _) in PLANNERS {
            let own = jobs.iter().zip(&counts).filter(|(job, _)| {
                job.planner == planner && setting.is_none_or(|name| job.setting == name)
            });
            let sum = own.fold(Counts::default(), |sum, (_, one)| sum.plus(one));
            let setting = setting.unwrap_or("all settings");
            rows.push(Row::ours(format!("avoidable, {setting}: {planner}"), sum.cells()));
        }
    }
    let columns =
        ["rides", "times", "private zone s", "of it moving s", "avoidable times", "avoidable s"];
    let notes = [
        "Told where people are. Times in the private zone of others (below 0.45 m) of all rides \
         together; of it moving: while the robot drove faster than 0.02 m/s.",
        "Each of these times was ridden again with a robot that stands from 1, 2 or 4 s before it on, and \
         is avoidable by as much as the best of the three has less.",
    ];
    Ok(Table {
        title: "Times in the private zone that the robot could have avoided".into(),
        columns: columns.map(str::to_owned).to_vec(),
        rows,
        notes: notes.map(str::to_owned).to_vec(),
    }
    .into())
}

impl Counts {
    fn plus(self, other: &Self) -> Self {
        Self {
            rides: self.rides + other.rides,
            intrusions: self.intrusions + other.intrusions,
            private_s: self.private_s + other.private_s,
            avoidable: self.avoidable + other.avoidable,
            avoidable_s: self.avoidable_s + other.avoidable_s,
            moving_s: self.moving_s + other.moving_s,
        }
    }

    fn cells(&self) -> Vec<Cell> {
        vec![
            Cell::number(self.rides as f64, 0),
            Cell::number(self.intrusions as f64, 0),
            Cell::number(self.private_s, 1),
            Cell::number(self.moving_s, 1),
            Cell::number(self.avoidable as f64, 0),
            Cell::number(self.avoidable_s, 1),
        ]
    }
}

fn of_job(lab: &Lab, job: &Job) -> Result<Counts, TrialError> {
    let ride = job.ride(lab)?;
    let mut counts = Counts { rides: 1, ..Counts::default() };
    for intrusion in intrusions(&ride.ticks) {
        let earliest_s = EARLIER_S.iter().fold(0.0, |most: f64, s| most.max(*s));
        let window = Intrusion { from_s: intrusion.from_s - earliest_s, ..intrusion };
        let had_s = private_s(&ride.ticks, window, |_| true);
        let mut least_s = had_s;
        for earlier_s in EARLIER_S {
            let stopped = stopped(lab, job, intrusion.from_s - earlier_s, intrusion.to_s)?;
            least_s = least_s.min(private_s(&stopped.ticks, window, |_| true));
        }
        counts.intrusions += 1;
        counts.private_s += private_s(&ride.ticks, intrusion, |_| true);
        counts.moving_s += private_s(&ride.ticks, intrusion, |tick| tick.body_mps() > 0.02);
        let avoidable_s = had_s - least_s;
        if avoidable_s > STEP_S {
            counts.avoidable += 1;
            counts.avoidable_s += avoidable_s;
        }
    }
    Ok(counts)
}

/// Drives a ride again until `to_s` with wheels that stand from `from_s` on.
fn stopped(lab: &Lab, job: &Job, from_s: f64, to_s: f64) -> Result<Ride, TrialError> {
    let mut scene = job.scene.clone();
    let fault = InjectedFault {
        kind: Some(FaultKind::WheelsStuck),
        at_s: Some(from_s.max(0.0)),
        ..InjectedFault::default()
    };
    scene.faults.inject.push(fault);
    let Job { setting, planner, ref contender, source, .. } = *job;
    let again = Job { setting, planner, scene, contender: contender.clone(), source };
    again.ride_until(lab, to_s)
}

/// Returns the times in the private zone of others until the target has arrived.
fn intrusions(ticks: &[Tick]) -> Vec<Intrusion> {
    let mut all: Vec<Intrusion> = Vec::new();
    for tick in ticks.iter().filter(|tick| is_private(tick)) {
        match all.last_mut().filter(|last| tick.at_s - last.to_s < APART_S) {
            Some(last) => last.to_s = tick.at_s,
            None => all.push(Intrusion { from_s: tick.at_s, to_s: tick.at_s }),
        }
    }
    all
}

fn is_private(tick: &Tick) -> bool {
    tick.crowd.is_some_and(|view| view.others_gap_m < PRIVATE_M)
}

/// Returns the time in the private zone within a window, of the ticks that count.
fn private_s(ticks: &[Tick], window: Intrusion, counts: impl Fn(&Tick) -> bool) -> f64 {
    let mut sum_s = 0.0;
    for pair in ticks.windows(2) {
        let is_within = (window.from_s..=window.to_s).contains(&pair[1].at_s);
        if is_within && is_private(&pair[1]) && counts(&pair[1]) {
            sum_s += pair[1].at_s - pair[0].at_s;
        }
    }
    sum_s
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry2;
    use tagalong_sim::{Clearance, CrowdView};

    use super::*;

    /// Ticks every tenth of a second, in the private zone where `is_near` says so.
    fn ticks(is_near: impl Fn(f64) -> bool) -> Vec<Tick> {
        let mut ticks = Vec::new();
        for number in 0..100 {
            let at_s = 0.1 * f64::from(number);
            let view = CrowdView {
                world_from_robot: Isometry2::identity(),
                target_gap_m: Some(1.0),
                others_gap_m: if is_near(at_s) { 0.4 } else { 0.5 },
                target_in_sight: true,
                target_arrived: false,
            };
            ticks.push(Tick {
                at_s,
                speed_mps: if at_s < 3.0 { 0.5 } else { 0.0 },
                turn_rate: 0.0,
                clearance: Clearance { people_m: 1.0, things_m: 1.0 },
                crowd: Some(view),
                approach: None,
                reason: None,
                effect: "stands",
            });
        }
        ticks
    }

    #[test]
    fn times_in_the_private_zone_are_apart_by_a_second() {
        let near = ticks(|at_s| {
            (1.95..2.55).contains(&at_s) || (2.95..3.55).contains(&at_s) || at_s > 8.95
        });
        let all = intrusions(&near);
        assert_eq!(all.len(), 2, "{all:?}");
        assert!((all[0].from_s - 2.0).abs() < 1e-9 && (all[0].to_s - 3.5).abs() < 1e-9);
        assert!((private_s(&near, all[0], |_| true) - 1.2).abs() < 1e-6);
        let moving = private_s(&near, all[0], |tick| tick.body_mps() > 0.02);
        assert!((moving - 0.6).abs() < 1e-6, "{moving}");
        assert!(intrusions(&ticks(|_| false)).is_empty());
    }

    #[test]
    fn sums_are_over_rides() {
        let one = Counts { rides: 1, intrusions: 2, private_s: 1.5, ..Counts::default() };
        let two = one.plus(&one);
        assert_eq!((two.rides, two.intrusions, two.private_s), (2, 4, 3.0));
    }
}
