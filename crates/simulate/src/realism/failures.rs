//! Known failures that must occur in simulation, too: the detector without a verifier takes
//! furniture for people, and the printed filter gives wrong velocities to a person before a moving
//! robot.

use nalgebra::Point2;
use tagalong_app::threads::threads;
use tagalong_config::Registry;
use tagalong_pipeline::{Candidate, Fate};
use tagalong_sim::Scene;
use tagalong_trials::{Contender, Run, Trial, TrialError, each};

use super::{Check, mean, scene, scenes};

const GROUP: &str = "failures that must show";
const EMPTY: &str = include_str!("../../configs/scenes/empty-clutter.toml");
const EKF: &str = include_str!("../../configs/depth-ekf.toml");
const AS_PRINTED: &str = include_str!("../../configs/depth-ekf-as-printed.toml");

pub fn checks(registry: &Registry, seeds: u64) -> Result<Vec<Check>, TrialError> {
    let alarms = false_alarms(registry, seeds)?;
    let stands = coat_stands(registry, seeds)?;
    let what = "false alarms per image in empty rooms, no verifier";
    let mut checks = vec![
        Check::between(GROUP, what, alarms, "", [0.1, 1.0]),
        Check::between(GROUP, "coat stands taken for people", 100.0 * stands, "%", [5.0, 100.0]),
    ];
    checks.extend(printed_filter(registry, seeds)?);
    Ok(checks)
}

fn ekf() -> Contender {
    Contender::new("depth-ekf", EKF)
}

/// Returns the number of accepted detections in rooms without people, per image.
fn false_alarms(registry: &Registry, seeds: u64) -> Result<f64, TrialError> {
    let short = |scene| Scene { duration_s: 6.0, ..scene };
    let scenes: Vec<Scene> = scenes(EMPTY, seeds).into_iter().map(short).collect();
    let count = |trial: Trial| {
        let reports = &trial.runs[0].reports;
        let believed = reports.iter().flat_map(|r| &r.candidates).filter(|c| is_believed(c));
        Ok(believed.count() as f64 / reports.len().max(1) as f64)
    };
    Ok(mean(&each(&scenes, &[ekf()], registry, threads(None), count, |_| ())?))
}

fn is_believed(candidate: &Candidate) -> bool {
    matches!(candidate.fate, Fate::Matched(_) | Fate::Started(_))
}

/// Returns the share of single coat stands, three metres ahead, with an accepted detection.
fn coat_stands(registry: &Registry, seeds: u64) -> Result<f64, TrialError> {
    let stand = |seed: u64| {
        scene(&format!(
            "seed = {seed}\nduration_s = 0.4\n[robot]\nstart = [1.0, 3.0]\n[[furniture]]\n\
             kind = \"coat-stand\"\nat = [4.0, 3.0]\nheading_deg = {}\n",
            45 * seed % 360
        ))
    };
    // Eight seeds cover all headings, 45 degrees apart.
    let scenes: Vec<Scene> = (1..=seeds.max(8)).map(stand).collect();
    let stand_at = Point2::new(3.0, 0.0);
    let taken = |trial: Trial| {
        let all = trial.runs[0].reports.iter().flat_map(|r| &r.candidates);
        let near = |c: &&Candidate| nalgebra::distance(&c.detection.position.xy(), &stand_at) < 0.6;
        Ok(f64::from(u8::from(all.filter(near).any(is_believed))))
    };
    Ok(mean(&each(&scenes, &[ekf()], registry, threads(None), taken, |_| ())?))
}

/// Checks the mean error of the forward velocity of a standing person, m/s, by the corrected and by
/// the printed filter, before a robot at rest and a moving one.
fn printed_filter(registry: &Registry, seeds: u64) -> Result<Vec<Check>, TrialError> {
    let contenders = [ekf(), Contender::new("depth-ekf-as-printed", AS_PRINTED)];
    let standing = |path: &str| {
        format!(
            "duration_s = 5.0\n[room]\nsize_m = [10.0, 6.0]\n[camera]\nwidth = 320\nheight = 240\n\
             [robot]\nstart = [1.0, 3.0]\npath = {path}\nspeed_mps = 0.5\n\
             [[people]]\npath = [[6.0, 3.2]]\nheading_deg = 180.0\n"
        )
    };
    let mut checks = Vec::new();
    for (robot, path) in [("a robot at rest", "[]"), ("a moving robot", "[[8.0, 3.0]]")] {
        let scenes = scenes(&standing(path), seeds.min(5));
        let keep = |trial: Trial| Ok([velocity_bias(&trial, 0), velocity_bias(&trial, 1)]);
        let all = each(&scenes, &contenders, registry, threads(None), keep, |_| ())?;
        let bias = |at: usize| mean(&all.iter().map(|both| both[at]).collect::<Vec<f64>>()).abs();
        // The printed filter must fail before a moving robot, and only there.
        let limits = [[0.0, 0.15], if path == "[]" { [0.0, 0.15] } else { [0.4, f64::INFINITY] }];
        for ((name, at), limits) in [("corrected", 0), ("printed", 1)].into_iter().zip(limits) {
            let what = format!("velocity bias, {name} filter, {robot}");
            checks.push(Check::between(GROUP, what, bias(at), "m/s", limits));
        }
    }
    Ok(checks)
}

/// Returns the mean forward velocity of the tracks near the only person, once they have settled.
fn velocity_bias(trial: &Trial, at: usize) -> f64 {
    let Run { reports, .. } = &trial.runs[at];
    let mut speeds = Vec::new();
    for (moment, report) in trial.moments.iter().zip(reports) {
        let Some(person) = moment.truth.first() else { continue };
        let near = report.tracks.iter().filter(|track| {
            let off = track.estimate.person.position - person.head_in_robot;
            track.confirmed && track.age > 10 && off.xy().norm() < 1.0
        });
        speeds.extend(near.map(|track| track.estimate.person.velocity.x));
    }
    mean(&speeds)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_built_in_scenes_can_be_read() {
        assert!(scene(EMPTY).people.is_empty());
    }
}
