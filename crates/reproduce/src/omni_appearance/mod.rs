//! P5: a person in the panorama of a conical mirror, the distance learned, and a
//! Kalman filter on the floor plan.

mod appearance;
mod calibration;
mod kalman;
mod people;

use tagalong_sim::Scene;

use crate::{Experiment, Lab, ReproduceError, System};

/// The system.
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
            about: "section 6.2: the filter against the appearance model alone",
            run: kalman::kalman,
        },
        Experiment {
            name: "people",
            about: "beyond the paper: two and three people, and a robot that drives",
            run: people::people,
        },
    ],
};

/// Images of one person; two persons are the 684 of the paper.
const IMAGES: usize = 342;
/// The room is empty for so long, s.
const EMPTY_S: f64 = 10.0;
/// Images of a block, 5 s.
const BLOCK: u64 = 15;

/// Scenes with one person each, long enough for the images.
fn alone(lab: &Lab, name: &str, seeds: u64, images: usize) -> Result<Vec<Scene>, ReproduceError> {
    let images = if lab.quick { images.min(IMAGES / 6) } else { images };
    let mut scenes = Vec::new();
    for scene in lab.scenes(name, &[], seeds)? {
        for person in 0..scene.people.len() {
            let mut one = scene.clone();
            one.people = vec![scene.people[person].clone()];
            one.webcams.clear();
            one.duration_s = EMPTY_S + images as f64 / one.camera.rate_hz;
            scenes.push(one);
        }
    }
    Ok(scenes)
}

/// The mean; 0 of nothing.
fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}
