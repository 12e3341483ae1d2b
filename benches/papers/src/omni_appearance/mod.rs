//! P5: a person in the panorama of a conical mirror, a learned distance, and a Kalman filter on the
//! floor plan.

mod appearance;
mod calibration;
mod kalman;
mod people;
mod splits;

pub(crate) use kalman::{answers_m, rooms};

use tagalong_sim::Scene;

use crate::{Experiment, Lab, ReproduceError, System, forms};

/// The system of P5.
pub const SYSTEM: System = System {
    name: "omni-appearance",
    about: "P5: a person in a conical mirror, the distance by a network, a Kalman filter",
    experiments: &[
        forms::experiment(forms::of_p5),
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
pub(crate) fn in_turn(lab: &Lab, seeds: u64, each_s: f64) -> Result<Vec<Scene>, ReproduceError> {
    let scenes = lab.scenes("omni-room", &[], lab.seeds(seeds))?;
    Ok(scenes
        .into_iter()
        .map(|scene| Scene { webcams: Vec::new(), ..scene.in_turn(each_s) })
        .collect())
}
