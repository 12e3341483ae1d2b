//! Stereo systems of Satake and Miura: P1 without and P4 with a verifier.

mod apart;
mod few_samples;
mod fit;
mod ladder;
mod left_out;
mod occlusion;
mod times;
mod turntable;
mod variants;
mod verifier;
mod walk;

use tagalong_trials::{Trial, TrialError};

use crate::findings::{Experiment, System};
use crate::forms::{self, Forms, Headline, ON_A_PAIR, ON_THE_FLOOR, VERIFIED};

/// The system of P1.
pub const STEREO_EKF: System = System {
    name: "stereo-ekf",
    about: "P1: templates in stereo depth and an extended Kalman filter",
    experiments: &[
        forms::experiment(|lab| OF_P1.compare(lab)),
        Experiment {
            name: "times",
            about: "Section 4: 70 ms a frame at 512x384",
            run: times::of_p1,
        },
        Experiment {
            name: "directions",
            about: "Fig. 4: a body that turns, by the number of templates",
            run: turntable::directions,
        },
        Experiment {
            name: "rejection",
            about: "Fig. 5: objects with the silhouette of a person are rejected",
            run: verifier::verifier,
        },
        Experiment {
            name: "walk",
            about: "not in the paper: P4's walk, by the forms of the filter",
            run: walk::of_p1,
        },
        Experiment {
            name: "fit-printed",
            about: "what the paper does not print, fitted for its printed form (validation)",
            run: fit::of_p1,
        },
    ],
};

/// The system of P4.
pub const STEREO_SVM_EKF: System = System {
    name: "stereo-svm-ekf",
    about: "P4: templates in stereo depth, an SVM that verifies, an extended Kalman filter",
    experiments: &[
        forms::experiment(|lab| OF_P4.compare(lab)),
        Experiment {
            name: "times",
            about: "Table II: 40 + 20 + 10 + 20 = 90 ms at 512x384, two people",
            run: times::of_p4,
        },
        Experiment {
            name: "verifier",
            about: "Table I: false sightings removed, people lost",
            run: verifier::verifier,
        },
        Experiment {
            name: "left-out",
            about: "not in the paper: verifiers trained without a kind of furniture",
            run: left_out::left_out,
        },
        Experiment {
            name: "few-samples",
            about: "Section II-C: the verifier trained on 438 + 146 samples, and on all",
            run: few_samples::few_samples,
        },
        Experiment {
            name: "walk",
            about: "Fig. 11: error along two edges of a square, 125 mm on average",
            run: walk::of_p4,
        },
        Experiment {
            name: "wheels",
            about: "not in the paper: Fig. 11 by how wrong the robot's wheels are",
            run: walk::by_wheels,
        },
        Experiment {
            name: "occlusion",
            about: "Fig. 7: who is fully hidden is known again, by gap and duration",
            run: occlusion::occlusion,
        },
        Experiment {
            name: "two-people-apart",
            about: "Section III-C: how near two people may be to be told apart, by range",
            run: apart::apart,
        },
        Experiment {
            name: "directions",
            about: "Fig. 3: a body that turns, by the number of templates",
            run: turntable::directions,
        },
        Experiment {
            name: "depth",
            about: "Section II-A: the depth of a head is known to 1 % at 3 m",
            run: turntable::depth,
        },
        Experiment {
            name: "background",
            about: "Section II-A: the printed comparison by the percentile of the background",
            run: turntable::background,
        },
        Experiment {
            name: "boundary-points",
            about: "Section II-B: time of the search with and without three boundary points",
            run: times::boundary_points,
        },
        Experiment {
            name: "ladder",
            about: "not in the paper: printed, corrected and ours on the same scenes",
            run: ladder::ladder,
        },
        Experiment {
            name: "fit-printed",
            about: "what the paper does not print, fitted for its printed form (validation)",
            run: fit::of_p4,
        },
    ],
};

/// Forms of P1.
pub(crate) const OF_P1: Forms = Forms {
    paper: "P1",
    configs: ["stereo-ekf-as-printed", "stereo-ekf", "stereo-verified"],
    contenders: forms::shipped,
    judge: ON_THE_FLOOR,
    has_real: true,
    scene: "square-walk",
    scenes: walk::walks,
    headline: Headline {
        column: "frame, ms",
        published: 70.0,
        digits: 0,
        is_share: false,
        of: frame_ms,
    },
    otherwise: None,
    notes: &[
        ON_A_PAIR,
        VERIFIED,
        "The paper shows rides in pictures; its only figure is the time of a frame, on a Core2Duo of \
         2.6 GHz. Ours is processor time, the matching of the pair included.",
    ],
};

/// Forms of P4.
pub(crate) const OF_P4: Forms = Forms {
    paper: "P4",
    configs: ["stereo-svm-ekf-as-printed", "stereo-svm-ekf", "stereo-verified"],
    headline: Headline {
        column: "walker, frame of the start, m",
        published: 0.125,
        digits: 3,
        is_share: false,
        of: walk::walker_errors_m,
    },
    notes: &[
        ON_A_PAIR,
        "Trained on: the verifier as printed on simulated rooms, `svm-patch`, `color-texture` and \
         `body-net` also on photographs and the logs `filinha` and `um`.",
        "The headline is the mean error of Fig. 11, of one walk in the paper, predicted places \
         and the drift of the wheels included; here the mean over walks.",
    ],
    ..OF_P1
};

/// Returns the processor time of a frame, ms.
fn frame_ms(trial: Trial) -> Result<Vec<Vec<f64>>, TrialError> {
    Ok(trial.runs.iter().map(|run| vec![run.worked_ms / run.reports.len() as f64]).collect())
}

/// Setting that renders a scene with a stereo camera.
const STEREO: (&str, &str) = ("camera.kind", "stereo");

/// Configs as printed, corrected, and ours.
const PIPELINES: [&str; 3] = ["stereo-svm-ekf-as-printed", "stereo-svm-ekf", "stereo-verified"];
