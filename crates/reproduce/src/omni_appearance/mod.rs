//! P5: a person in the panorama of a conical mirror, a learned distance, and a Kalman filter on the
//! floor plan.

mod appearance;
mod calibration;
mod kalman;
mod people;
mod splits;

use tagalong_eval::{mean_interval, paired_gain};
use tagalong_sim::Scene;

use crate::{Cell, Experiment, Lab, ReproduceError, System};

/// The system of P5.
pub const SYSTEM: System = System {
    name: "omni-appearance",
    about: "P5: a person in a conical mirror, the distance by a network, a Kalman filter",
    experiments: &[
        Experiment {
            name: "calibration",
            about: "section 3: four webcams that see a hat, calibrated by known places",
            run: calibration::calibration,
        },
        Experiment {
            name: "appearance",
            about: "Fig. 5 and section 6.1: features, bearing, distance, models of persons",
            run: appearance::appearance,
        },
        Experiment {
            name: "kalman",
            about: "section 6.2: the filter against the appearance model alone, and from the \
                    printed method to ours step by step",
            run: kalman::kalman,
        },
        Experiment {
            name: "people",
            about: "beyond the paper: two and three people, and a robot that drives",
            run: people::people,
        },
    ],
};

/// Note on the draws.
const FRESH: &str = "Each draw is another room with other furniture, light, people and ways, and \
    another mirror, which differs from what the log says of it by chance.";

/// Returns rooms with two people each, one after the other, each for `each_s`.
fn in_turn(lab: &Lab, seeds: u64, each_s: f64) -> Result<Vec<Scene>, ReproduceError> {
    let scenes = lab.scenes("omni-room", &[], lab.seeds(seeds))?;
    let alone = |scene: Scene| Scene { webcams: Vec::new(), ..scene.in_turn(each_s) };
    Ok(scenes.into_iter().map(alone).collect())
}

/// Returns the mean; 0 of no values.
fn mean(values: &[f64]) -> f64 {
    tagalong_stats::mean(values).unwrap_or(0.0)
}

/// Returns the means of the draws that have any values.
fn means<'a>(draws: impl IntoIterator<Item = &'a Vec<f64>>) -> Vec<f64> {
    draws.into_iter().filter(|values| !values.is_empty()).map(|values| mean(values)).collect()
}

/// Returns the mean of the means of draws, its interval over draws, and the deviation of all
/// values.
fn over_draws(draws: &[Vec<f64>], digits: usize) -> Cell {
    let all = Cell::mean(&draws.concat(), digits);
    // Values of one draw depend on each other, so the interval is that of the means of draws.
    let means = means(draws);
    match mean_interval(&means) {
        Some(interval) => {
            Cell { deviation: all.deviation, ..Cell::estimate(Some(interval), digits) }
        }
        None => Cell { value: all.value.map(|_| mean(&means)), ..all },
    }
}

/// Returns the mean difference of draws to those of a rival, with its interval over draws.
fn difference(rival: &[Vec<f64>], draws: &[Vec<f64>], digits: usize) -> Cell {
    let both = rival.iter().zip(draws).filter(|(a, b)| !a.is_empty() && !b.is_empty());
    let (a, b): (Vec<f64>, Vec<f64>) = both.map(|(a, b)| (mean(a), mean(b))).unzip();
    let gain = paired_gain(&a, &b);
    Cell::estimate(gain.map(|gain| gain.difference), digits)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn draws_count_alike_however_long_they_are() {
        let cell = over_draws(&[vec![1.0; 9], vec![3.0], vec![]], 3);
        assert_eq!(cell.value, Some(2.0));
        assert!((cell.deviation.unwrap() - 0.6).abs() < 1e-12);
        assert_eq!(over_draws(&[], 3).value, None);
        let cell =
            difference(&[vec![1.0], vec![2.0, 4.0], vec![]], &[vec![2.0], vec![5.0], vec![9.0]], 3);
        assert_eq!(cell.value, Some(1.5));
    }
}
