//! Fits the parameters that the papers do not print, for their printed forms: a comparison with
//! untuned parameters would be unfair to them. All scenes have seeds of `validation`.

use tagalong_core::{Frame, Funnel};
use tagalong_eval::Tally;
use tagalong_geometry::Camera;
use tagalong_pipeline::Pipeline;
use tagalong_report::{Cell, Row, Table};
use tagalong_sim::{Scene, Split};
use tagalong_stereo::{StereoDepth, StereoSettings};
use tagalong_trials::{Contender, Draw, Judge, Moment, Run, Trial, TrialError, in_order};

use super::STEREO;
use super::variants::{self, Variant};
use super::walk::{FOLLOWED, only_the_walker_counts};
use crate::findings::Findings;
use crate::lab::{Lab, ReproduceError};

/// Error of a frame without an estimate, m: the judge matches no estimate that is farther away.
const WITHOUT_M: f64 = 0.5;

/// Thresholds to try for the printed dissimilarity, m². The other costs keep the proportions of the
/// corrected config.
const THRESHOLDS: [f64; 5] = [2000.0, 4000.0, 8000.0, 16_000.0, 32_000.0];
/// Values to try for the process noise, m/s², ...
const SIGMAS_W: [f64; 5] = [1.0, 2.5, 5.0, 10.0, 20.0];
/// ... and for the measurement noise, m, in all combinations; ...
const SIGMAS_V: [f64; 3] = [0.03, 0.1, 0.2];
/// ... for the variance of a new track's velocity, m²/s², ...
const INITIAL: [f64; 3] = [0.5, 2.0, 8.0];
/// ... and for the gate, in all combinations.
const GATES: [f64; 3] = [11.34, 20.0, 40.0];

/// Criterion for the choice of a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Goal {
    /// Position error of the followed person, predicted positions included.
    Place,
    /// Misses and false alarms, MOTA.
    Sightings,
}

/// Parameters of a config that are chosen together.
struct Step {
    goal: Goal,
    tried: Vec<Vec<(&'static str, f64)>>,
}

fn threshold() -> Step {
    fn keys(most: &f64) -> Vec<(&str, f64)> {
        vec![
            ("detectors.0.config.discover_cost", *most),
            ("detectors.0.config.even_cost", 1.2 * most),
            ("detectors.0.config.follow_cost", 1.6 * most),
            ("detectors.0.config.refine_cost", 2.0 * most),
            ("detectors.0.config.score_per_cost", 4.0 / most),
        ]
    }

    Step { goal: Goal::Sightings, tried: THRESHOLDS.iter().map(keys).collect() }
}

fn noise() -> Step {
    let keys = ["filter.config.sigma_w", "filter.config.sigma_v_m"];
    Step { goal: Goal::Place, tried: each_with_each(keys, &SIGMAS_W, &SIGMAS_V) }
}

fn start_and_gate() -> Step {
    let keys = ["filter.config.initial_velocity_variance", "associator.config.gate"];
    Step { goal: Goal::Place, tried: each_with_each(keys, &INITIAL, &GATES) }
}

fn each_with_each(
    [first, second]: [&'static str; 2],
    a: &[f64],
    b: &[f64],
) -> Vec<Vec<(&'static str, f64)>> {
    a.iter().flat_map(|a| b.iter().map(move |b| vec![(first, *a), (second, *b)])).collect()
}

/// Results of one contender on one walk.
#[derive(Clone, Debug, Default)]
struct Score {
    errors_m: Vec<f64>,
    without: u64,
    tally: Tally,
}

/// A walk that is simulated, and matched, once and used many times.
struct Walk {
    seed: u64,
    camera: Camera,
    shots: Vec<(Frame, Moment)>,
}

/// Fits P1's filter, and the same with its velocity corrected, in stereo and in depth images.
pub fn of_p1(lab: &Lab) -> Result<Findings, ReproduceError> {
    const DEPTH: &str = "depth-ekf-as-printed";
    let mut findings = of_walks(lab, &FOLLOWED, &variants::OF_P1, &[])?;
    let set: Vec<_> = FOLLOWED.into_iter().filter(|set| *set != STEREO).collect();
    let depth = [Variant { name: DEPTH, of: DEPTH, set: &[] }];
    findings.tables.extend(of_walks(lab, &set, &depth, &[])?.tables);
    Ok(findings)
}

/// Fits P4's threshold and filter, and the same with its velocity corrected.
pub fn of_p4(lab: &Lab) -> Result<Findings, ReproduceError> {
    of_walks(lab, &FOLLOWED, &variants::OF_P4, &[threshold()])
}

/// Fits the printed forms among some variants, on walks in a cluttered room.
fn of_walks(
    lab: &Lab,
    set: &[(&str, &str)],
    all: &[Variant],
    first: &[Step],
) -> Result<Findings, ReproduceError> {
    let set: Vec<_> = set.iter().copied().chain([("room.clutter", "6")]).collect();
    let scenes = lab.scenes_of(Split::Validation, "square-walk", &set, lab.seeds(4))?;
    let stereo = variants::stereo_settings(&lab.contender(all[0].of)?)?;
    lab.progress.begin(scenes.len(), "walks to fit with");
    let walks =
        in_order(&scenes, lab.jobs, |scene| Walk::draw(scene, &stereo), |_| lab.progress.step())?;
    let mut findings = Findings::default();
    for variant in all.iter().filter(|variant| variant.is_printed()) {
        let rest = [noise(), start_and_gate()];
        // The parameters that a form shares with the one before it are chosen once.
        let steps: Vec<&Step> = match variant.set {
            [] => first.iter().chain(&rest).collect(),
            _ => vec![&rest[0]],
        };
        findings.tables.push(fitted(lab, variant, &steps, &walks)?);
    }
    Ok(findings)
}

/// Fits one step after the other, each with the values chosen before it.
fn fitted(
    lab: &Lab,
    variant: &Variant,
    steps: &[&Step],
    walks: &[Walk],
) -> Result<Table, ReproduceError> {
    let mut config = variant.contender(lab)?;
    let mut rows = Vec::new();
    for step in steps {
        let tried = step.tried.iter().map(|keys| variants::with(&config, keys));
        let all: Vec<Contender> = tried.collect::<Result<_, _>>()?;
        lab.progress.begin(walks.len(), variant.name);
        let of_walks = in_order(
            walks,
            lab.jobs,
            |walk| scores(walk.trial(&all, lab)?),
            |_| lab.progress.step(),
        )?;
        let scores: Vec<Score> =
            (0..all.len()).map(|at| Score::of_all(of_walks.iter().map(|walk| &walk[at]))).collect();
        let best = best(&scores, step.goal);
        for (at, (keys, score)) in step.tried.iter().zip(&scores).enumerate() {
            let chosen = if at == best { ", chosen" } else { "" };
            rows.push(Row::ours(format!("{}{chosen}", named(keys)), score.cells()));
        }
        config = all[best].clone();
    }
    let columns = ["mean error mm", "without a place %", "MOTA"];
    Ok(Table {
        title: format!("What no paper prints, fitted: {}", variant.name),
        columns: columns.map(str::to_owned).to_vec(),
        rows,
        notes: vec![
            format!(
                "{} simulated walks of the split `validation`, 6 pieces of clutter",
                walks.len()
            ),
            "One step after the other, with what was chosen before it: thresholds by MOTA, the \
             rest by the error of the place of the one who is followed, predicted places \
             included, to the millimetre, and by MOTA where that is the same; a frame without a \
             place counts as 500 mm."
                .into(),
        ],
    })
}

/// Formats the first key, or both if there are two; the rest follow from the first.
fn named(keys: &[(&str, f64)]) -> String {
    let words = keys
        .iter()
        .take(if keys.len() > 2 { 1 } else { 2 })
        .map(|(key, value)| format!("{} = {value}", key.rsplit('.').next().unwrap_or(key)));
    words.collect::<Vec<_>>().join(", ")
}

impl Walk {
    fn draw(scene: &Scene, stereo: &StereoSettings) -> Result<Self, TrialError> {
        fn failed(error: tagalong_core::Error) -> TrialError {
            TrialError::Witness(error.to_string())
        }

        let mut draw = Draw::new(scene, 1);
        let mut stereo = StereoDepth::new(stereo.clone()).map_err(failed)?;
        let camera = draw.camera().clone();
        let mut shots = Vec::new();
        while let Some(simulated) = draw.next_frame() {
            // The images of a depth camera need no stereo matching.
            let frame = match simulated.frame.depth() {
                Ok(_) => simulated.frame,
                Err(_) => {
                    let depth = stereo.depth(&simulated.frame, &mut Funnel::default());
                    simulated.frame.with_depth(depth.map_err(failed)?)
                }
            };
            let moment = Moment {
                stamp: frame.stamp,
                truth: simulated.truth,
                odom_from_robot: simulated.odom_from_robot,
                world_from_robot: simulated.world_from_robot,
            };
            shots.push((frame, moment));
        }
        Ok(Self { seed: scene.seed, camera, shots })
    }

    fn trial(&self, contenders: &[Contender], lab: &Lab) -> Result<Trial, TrialError> {
        fn run(one: &Contender) -> Run {
            Run { pipeline: one.name.clone(), reports: vec![], worked_ms: 0.0 }
        }

        let pipelines = contenders.iter().map(|one| one.pipeline(lab.registry, self.seed));
        let mut pipelines = pipelines.collect::<Result<Vec<Pipeline>, _>>()?;
        let mut runs: Vec<Run> = contenders.iter().map(run).collect();
        for (frame, _) in &self.shots {
            // A new frame for each trial, so that the data derived from it are freed afterwards.
            let images = frame.images();
            let camera = frame.camera.clone();
            let motion = frame.motion;
            let frame = Frame::new(frame.index, frame.stamp, camera, motion, images);
            for (pipeline, run) in pipelines.iter_mut().zip(&mut runs) {
                let report = pipeline.step(&frame).map_err(|error| TrialError::Step {
                    pipeline: run.pipeline.clone(),
                    seed: self.seed,
                    error,
                })?;
                run.reports.push(report);
            }
        }
        let moments = self.shots.iter().map(|(_, moment)| moment.clone()).collect();
        let camera = self.camera.clone();
        Ok(Trial { seed: self.seed, camera, furniture: Vec::new(), moments, runs })
    }
}

fn best(scores: &[Score], goal: Goal) -> usize {
    let losses = scores.iter().enumerate().map(|(at, score)| {
        let mota = score.tally.clear.mota();
        let loss = match goal {
            // Errors that agree to the millimetre count as equal, and MOTA decides.
            Goal::Place => (1e3 * score.error_m()).round(),
            Goal::Sightings => -mota,
        };
        (at, loss, mota)
    });
    losses
        .filter(|(_, loss, _)| loss.is_finite())
        .min_by(|a, b| a.1.total_cmp(&b.1).then_with(|| b.2.total_cmp(&a.2)))
        .map_or(0, |(at, ..)| at)
}

/// Scores the positions of the followed person, predicted ones included, and the detections of all
/// people.
fn scores(mut trial: Trial) -> Result<Vec<Score>, TrialError> {
    let sightings = trial
        .runs
        .iter()
        .map(|run| Ok(Judge::default().judge(&trial, run)?.tally))
        .collect::<Result<Vec<Tally>, TrialError>>()?;
    // The tallies above cover all people; the position error is that of the walker alone.
    only_the_walker_counts(&mut trial);
    let judge = Judge { coasting: true, ..Judge::default() };
    let both = trial.runs.iter().zip(sightings);
    both.map(|(run, tally)| {
        let judged = judge.judge(&trial, run)?;
        let without = judged.tally.scores().fn_;
        Ok(Score { errors_m: judged.errors_in_robot_m, without, tally })
    })
    .collect()
}

impl Score {
    fn of_all<'a>(scores: impl Iterator<Item = &'a Self> + Clone) -> Self {
        Self {
            errors_m: scores.clone().flat_map(|score| score.errors_m.clone()).collect(),
            without: scores.clone().map(|score| score.without).sum(),
            tally: Tally::combine(scores.map(|score| &score.tally)),
        }
    }

    fn frames(&self) -> f64 {
        self.errors_m.len() as f64 + self.without as f64
    }

    fn error_m(&self) -> f64 {
        let sum = self.errors_m.iter().sum::<f64>() + WITHOUT_M * self.without as f64;
        sum / self.frames()
    }

    fn cells(&self) -> Vec<Cell> {
        vec![
            Cell::number(1e3 * self.error_m(), 0),
            Cell::number(100.0 * self.without as f64 / self.frames(), 1),
            Cell::number(self.tally.clear.mota(), 3),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn score(errors_m: &[f64], without: u64) -> Score {
        Score { errors_m: errors_m.to_vec(), without, ..Score::default() }
    }

    #[test]
    fn a_frame_without_a_place_is_no_way_to_a_small_error() {
        let lost = score(&[0.05], 3);
        let there = score(&[0.05, 0.1, 0.2, 0.3], 0);
        assert!((lost.error_m() - (0.05 + 1.5) / 4.0).abs() < 1e-12);
        assert_eq!(best(&[lost, score(&[], 0), there], Goal::Place), 2);
    }

    #[test]
    fn scores_of_walks_add_up() {
        let a = score(&[0.1], 1);
        let b = score(&[0.3], 0);
        let both = Score::of_all([&a, &b].into_iter());
        assert_eq!((both.errors_m, both.without), (vec![0.1, 0.3], 1));
    }

    #[test]
    fn the_thresholds_keep_their_proportions() {
        let tried = threshold().tried;
        assert_eq!(tried.len(), THRESHOLDS.len());
        for keys in &tried {
            for ((key, one), (_, two)) in tried[0].iter().zip(keys) {
                let ratio = keys[0].1 / tried[0][0].1;
                let expected = if key.ends_with("score_per_cost") { 1.0 / ratio } else { ratio };
                assert!((two / one - expected).abs() < 1e-12, "{key}");
            }
        }
        assert_eq!(named(&tried[1]), "discover_cost = 4000");
    }

    #[test]
    fn each_value_is_tried_with_each() {
        let tried = start_and_gate().tried;
        assert_eq!(tried.len(), INITIAL.len() * GATES.len());
        assert_eq!(named(&tried[1]), "initial_velocity_variance = 0.5, gate = 20");
        assert!(tried.iter().enumerate().all(|(at, one)| !tried[..at].contains(one)));
    }
}
