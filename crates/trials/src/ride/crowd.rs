//! Measures of Follow-Bench, a benchmark for robots that follow a person among people (arXiv
//! 2509.10796, section IV).

use nalgebra::Vector2;
use serde::Serialize;
use tagalong_sim::CrowdView;

use super::Tick;

/// Time between two samples of a ride, s.
const STEP_S: f64 = 0.1;
/// Maximum duration of a successful search for the target, steps.
const LONGEST_SEARCH: usize = 100;
/// Gap to another person below which the robot is in the private zone, and to the target from which
/// on it is in the personal zone, m.
const PRIVATE_M: f64 = 0.45;
/// Gap up to which the robot is in the personal zone of the target, m.
const PERSONAL_M: f64 = 1.2;
/// Difference in radius: people of the benchmark have a radius of 0.3 m, those of
/// [`tagalong_sim::Clearance`] one of 0.2 m.
const WIDER_M: f64 = 0.1;

/// Measures of a ride from its start until the target has arrived.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct CrowdMeasures {
    /// True if the robot touched no person and no object.
    pub success: bool,
    /// True if the target was never out of sight for more than 10 s without interruption.
    pub search_success: bool,
    /// Length of the robot's path, m.
    pub path_m: f64,
    /// Length of the part of the path during which the target was out of sight, m.
    pub search_m: f64,
    /// Mean speed, m/s.
    pub speed_mps: f64,
    /// Mean magnitude of the acceleration, m/s².
    pub acceleration_mps2: f64,
    /// Mean magnitude of the jerk, m/s³.
    pub jerk_mps3: f64,
    /// Time in the target's personal zone, s.
    pub personal_s: f64,
    /// Time in the private zone of another person, s.
    pub private_s: f64,
    /// Time in which the target was out of sight, s.
    pub out_of_sight_s: f64,
    /// Length of the ride, s.
    pub time_s: f64,
}

impl CrowdMeasures {
    /// Measures a ride; `None` in a scene whose people do not react.
    pub fn of(ticks: &[Tick]) -> Option<Self> {
        fn touches(tick: &Tick) -> bool {
            tick.clearance.people_m < WIDER_M || tick.clearance.things_m < 0.0
        }

        let samples = samples(ticks);
        if samples.is_empty() {
            return None;
        }
        let end_s = samples.last().map_or(0.0, |sample| sample.at_s);
        let mut ride = ticks.iter().take_while(|tick| tick.at_s <= end_s + 1e-6);
        let mut out_of_sight = 0;
        let mut longest_search = 0;
        let mut all = Self { success: !ride.any(touches), ..Self::default() };
        for (number, sample) in samples.iter().enumerate() {
            let view = &sample.view;
            out_of_sight = if view.target_in_sight { 0 } else { out_of_sight + 1 };
            longest_search = longest_search.max(out_of_sight);
            let is_personal =
                view.target_gap_m.is_some_and(|gap_m| gap_m > PRIVATE_M && gap_m < PERSONAL_M);
            all.personal_s += seconds_if(is_personal);
            all.private_s += seconds_if(view.others_gap_m < PRIVATE_M);
            all.out_of_sight_s += seconds_if(!view.target_in_sight);
            let before = number.checked_sub(1).map(|before| &samples[before]);
            let step_m = before.map_or(0.0, |before| (sample.place() - before.place()).norm());
            all.path_m += step_m;
            if !view.target_in_sight {
                all.search_m += step_m;
            }
        }
        all.search_success = longest_search <= LONGEST_SEARCH;
        all.time_s = samples.len() as f64 * STEP_S;
        let velocities: Vec<Vector2<f64>> = samples.iter().map(Sample::velocity).collect();
        let changes: Vec<Vector2<f64>> =
            velocities.windows(2).map(|pair| (pair[1] - pair[0]) / STEP_S).collect();
        let jerks: Vec<Vector2<f64>> =
            changes.windows(2).map(|pair| (pair[1] - pair[0]) / STEP_S).collect();
        all.speed_mps = mean_magnitude(&velocities);
        all.acceleration_mps2 = mean_magnitude(&changes);
        all.jerk_mps3 = mean_magnitude(&jerks);
        Some(all)
    }
}

/// State of the robot at one moment.
struct Sample {
    at_s: f64,
    speed_mps: f64,
    view: CrowdView,
}

impl Sample {
    fn place(&self) -> Vector2<f64> {
        self.view.world_from_robot.translation.vector
    }

    /// Returns the velocity over ground, m/s.
    fn velocity(&self) -> Vector2<f64> {
        self.view.world_from_robot.rotation * Vector2::new(self.speed_mps, 0.0)
    }
}

/// Returns a sample every tenth of a second until the target has arrived.
fn samples(ticks: &[Tick]) -> Vec<Sample> {
    let mut samples: Vec<Sample> = Vec::new();
    for tick in ticks {
        let Some(view) = tick.crowd else { continue };
        // Ticks are more frequent than the steps of the benchmark; rounding must not skip one.
        if samples.last().is_none_or(|last| tick.at_s - last.at_s >= STEP_S - 1e-6) {
            samples.push(Sample { at_s: tick.at_s, speed_mps: tick.speed_mps, view });
        }
        if view.target_arrived {
            break;
        }
    }
    samples
}

fn seconds_if(counts: bool) -> f64 {
    if counts { STEP_S } else { 0.0 }
}

/// Returns the mean length of vectors; 0 without vectors.
fn mean_magnitude(vectors: &[Vector2<f64>]) -> f64 {
    let sum: f64 = vectors.iter().map(Vector2::norm).sum();
    sum / vectors.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry2;
    use tagalong_sim::Clearance;

    use super::*;

    /// A ride of 20 s at 1 m/s along X, a tick every 0.02 s, changed by `change`.
    fn ride(change: impl Fn(f64, &mut Tick, &mut CrowdView)) -> CrowdMeasures {
        let ticks = (0..1000).map(|i| {
            let at_s = f64::from(i) * 0.02;
            let mut view = CrowdView {
                world_from_robot: Isometry2::translation(at_s, 3.0),
                target_gap_m: Some(1.5),
                others_gap_m: 2.0,
                target_in_sight: true,
                target_arrived: false,
            };
            let mut tick = Tick {
                at_s,
                speed_mps: 1.0,
                turn_rate: 0.0,
                clearance: Clearance { people_m: 0.5, things_m: 0.5 },
                crowd: None,
                approach: None,
                reason: None,
                effect: "stands",
            };
            change(at_s, &mut tick, &mut view);
            tick.crowd = Some(view);
            tick
        });
        CrowdMeasures::of(&ticks.collect::<Vec<_>>()).unwrap()
    }

    fn near(a: f64, b: f64) -> bool {
        (a - b).abs() < 1e-6
    }

    #[test]
    fn a_steady_ride_has_its_length_and_speed_and_nothing_else() {
        let steady = ride(|_, _, _| {});
        let expected = CrowdMeasures {
            success: true,
            search_success: true,
            path_m: 19.9,
            speed_mps: 1.0,
            time_s: 20.0,
            ..CrowdMeasures::default()
        };
        assert!(near(steady.path_m, 19.9) && near(steady.time_s, 20.0), "{steady:?}");
        let rounded = CrowdMeasures { path_m: 19.9, speed_mps: 1.0, time_s: 20.0, ..steady };
        assert_eq!(rounded, expected);
        assert_eq!(CrowdMeasures::of(&[]), None);
    }

    #[test]
    fn a_touch_is_no_success_until_the_target_has_arrived() {
        let person = ride(|at_s, tick, _| {
            if at_s > 9.99 && at_s < 10.01 {
                tick.clearance.people_m = 0.09;
            }
        });
        assert!(!person.success && person.search_success);
        let late = ride(|at_s, tick, view| {
            view.target_arrived = at_s > 8.0;
            tick.clearance.things_m = if at_s > 9.0 { -0.01 } else { 0.5 };
        });
        assert!(late.success && near(late.time_s, 8.1), "{late:?}");
    }

    #[test]
    fn ten_seconds_out_of_sight_are_a_search_and_more_are_a_failure() {
        fn hidden(until_s: f64) -> CrowdMeasures {
            ride(move |at_s, _, view| view.target_in_sight = !(2.0..until_s).contains(&at_s))
        }

        let search = hidden(11.99);
        assert!(search.search_success && near(search.out_of_sight_s, 10.0), "{search:?}");
        assert!(near(search.search_m, 10.0), "{search:?}");
        assert!(!hidden(12.09).search_success);
    }

    #[test]
    fn zones_are_counted_by_their_gaps() {
        let zones = ride(|at_s, _, view| {
            view.target_gap_m = Some(if at_s < 2.95 { 0.44 } else { 0.46 });
            view.others_gap_m = if at_s < 3.95 { 0.44 } else { 0.46 };
            if at_s > 14.95 {
                view.target_gap_m = Some(1.21);
            }
        });
        assert!(near(zones.private_s, 4.0) && near(zones.personal_s, 12.0), "{zones:?}");
    }

    #[test]
    fn accelerations_and_jerks_are_those_of_the_velocity_over_ground() {
        let faster = ride(|at_s, tick, _| tick.speed_mps = 0.5 * at_s);
        assert!(near(faster.acceleration_mps2, 0.5) && faster.jerk_mps3 < 1e-6, "{faster:?}");
        // On a circle at 1 m/s the acceleration is speed times turn rate.
        let turning = ride(|at_s, _, view| {
            view.world_from_robot = Isometry2::new(Vector2::new(at_s, 3.0), 0.2 * at_s);
        });
        assert!((turning.acceleration_mps2 - 0.2).abs() < 1e-4, "{turning:?}");
        assert!((turning.jerk_mps3 - 0.04).abs() < 1e-4, "{turning:?}");
    }
}
