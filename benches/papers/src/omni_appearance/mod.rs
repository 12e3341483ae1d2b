//! P5: a person in the panorama of a conical mirror, a learned distance, and a Kalman filter on the
//! floor plan.

mod appearance;
mod calibration;
mod kalman;
mod people;
mod splits;

use tagalong_sim::Scene;

use crate::findings::{Experiment, System};
use crate::forms::{self, Forms, Headline, ON_THE_FLOOR};
use crate::lab::{Lab, ReproduceError};

/// The system of P5.
pub const SYSTEM: System = System {
    name: "omni-appearance",
    about: "P5: a person in a conical mirror, the distance by a network, a Kalman filter",
    experiments: &[
        forms::experiment(|lab| OF_P5.compare(lab)),
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

/// Forms of P5.
pub(crate) const OF_P5: Forms = Forms {
    paper: "P5",
    configs: ["omni-appearance-as-printed", "omni-appearance", "omni-rich"],
    contenders: forms::shipped,
    judge: ON_THE_FLOOR,
    has_real: false,
    scene: "omni-room",
    scenes: kalman::rooms,
    headline: Headline {
        column: "error of all answers, m",
        published: 0.145,
        digits: 3,
        is_share: false,
        of: kalman::answers_m,
    },
    otherwise: None,
    notes: &[
        "No real log of a conical mirror is at hand, so the real columns are empty.",
        "The headline is section 6.2's, appearance model and Kalman filter in one room; here the \
         mean over rooms, in none of which the models were trained.",
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
