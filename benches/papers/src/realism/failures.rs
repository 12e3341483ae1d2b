//! Known failures that must occur in simulation, too: the detector without a verifier takes
//! furniture for people.

use nalgebra::Point2;
use tagalong_app::threads::threads;
use tagalong_config::Registry;
use tagalong_pipeline::{Candidate, Fate};
use tagalong_sim::Scene;
use tagalong_trials::{Contender, Trial, TrialError, each};

use super::{Check, scene, scenes};
use crate::draws::mean;

const GROUP: &str = "failures that must show";
const EMPTY: &str = include_str!("../../../../configs/scenes/empty-clutter.toml");
const EKF: &str = include_str!("../../../../configs/depth-ekf.toml");

pub fn checks(registry: &Registry, seeds: u64) -> Result<Vec<Check>, TrialError> {
    let alarms = false_alarms(registry, seeds)?;
    let stands = coat_stands(registry, seeds)?;
    let what = "false alarms per image in empty rooms, no verifier";
    Ok(vec![
        Check::between(GROUP, what, alarms, "", [0.1, 1.0]),
        Check::between(GROUP, "coat stands taken for people", 100.0 * stands, "%", [5.0, 100.0]),
    ])
}

fn ekf() -> Contender {
    Contender::new("depth-ekf", EKF)
}

/// Returns the number of accepted detections in rooms without people, per image.
fn false_alarms(registry: &Registry, seeds: u64) -> Result<f64, TrialError> {
    fn count(trial: Trial) -> Result<f64, TrialError> {
        let reports = &trial.runs[0].reports;
        let believed = reports.iter().flat_map(|r| &r.candidates).filter(|c| is_believed(c));
        Ok(believed.count() as f64 / reports.len().max(1) as f64)
    }

    let scenes: Vec<Scene> =
        scenes(EMPTY, seeds).into_iter().map(|scene| Scene { duration_s: 6.0, ..scene }).collect();
    Ok(mean(&each(&scenes, &[ekf()], registry, threads(None), count, |_| ())?))
}

fn is_believed(candidate: &Candidate) -> bool {
    matches!(candidate.fate, Fate::Matched(_) | Fate::Started(_))
}

/// Returns the share of single coat stands, three metres ahead, with an accepted detection.
fn coat_stands(registry: &Registry, seeds: u64) -> Result<f64, TrialError> {
    fn taken(trial: Trial) -> Result<f64, TrialError> {
        let all = trial.runs[0].reports.iter().flat_map(|r| &r.candidates);
        let stand_at = Point2::new(3.0, 0.0);
        let mut near = all.filter(|c| (c.detection.position.xy() - stand_at).norm() < 0.6);
        Ok(f64::from(u8::from(near.any(is_believed))))
    }

    // Eight seeds cover all headings, 45 degrees apart.
    let scenes: Vec<Scene> = (1..=seeds.max(8))
        .map(|seed| {
            scene(&format!(
                "seed = {seed}\nduration_s = 0.4\n[robot]\nstart = [1.0, 3.0]\n[[furniture]]\n\
             kind = \"coat-stand\"\nat = [4.0, 3.0]\nheading_deg = {}\n",
                45 * seed % 360
            ))
        })
        .collect();
    Ok(mean(&each(&scenes, &[ekf()], registry, threads(None), taken, |_| ())?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_built_in_scenes_can_be_read() {
        assert!(scene(EMPTY).people.is_empty());
    }
}
