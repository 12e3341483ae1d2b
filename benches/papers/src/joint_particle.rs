//! P3: joint particles that weigh scenes of overlapping silhouettes.

mod fair;

use nalgebra::Point3;
use tagalong_core::Track;
use tagalong_geometry::Camera;
use tagalong_pipeline::{FrameReport, StereoSettings};
use tagalong_report::{Cell, Row, Table};
use tagalong_sim::{Scene, Split, Truth};
use tagalong_trials::{Contender, Crossing, Failing, Moment, Run, Trial, TrialError, crossing};
use toml::Value;

use crate::findings::{Experiment, Findings, Picture, System};
use crate::forms::{self, Forms, Headline, ON_A_PAIR, ON_THE_FLOOR, Reading, VERIFIED};
use crate::lab::{Lab, ReproduceError};
use crate::scatter::Scatter;
use crate::variant::{parsed, with_values};

/// The system of P3.
pub const SYSTEM: System = System {
    name: "joint-particle",
    about: "P3: joint particles, overlapping silhouettes, likelihood maps",
    experiments: &[
        forms::experiment(|lab| OF_P3.compare(lab)),
        Experiment {
            name: "table-1",
            about: "Table I: two people cross parallel to the image; cost, error, success",
            run: parallel,
        },
        Experiment {
            name: "hidden",
            about: "two people in like clothes, one hidden for long: turns back, stops, walks along",
            run: hidden,
        },
        Experiment {
            name: "misprints",
            about: "what each misprint of P3 costs, and what the method lacks",
            run: misprints,
        },
        Experiment {
            name: "fair",
            about: "what leads the printed form away, in our rooms and in an empty one",
            run: fair::causes,
        },
        Experiment {
            name: "choices",
            about: "choices of the particles that make a likelihood map",
            run: fair::choices,
        },
        Experiment {
            name: "figure-9",
            about: "Fig. 9: two people of different height cross while their depths change",
            run: oblique,
        },
        Experiment {
            name: "three",
            about: "three people cross, one may turn back, stop, or swap places while hidden",
            run: three,
        },
        Experiment {
            name: "fit",
            about: "free parameters of the printed form, on the split validation",
            run: fit,
        },
        Experiment {
            name: "fit-fair",
            about: "free parameters of the printed form in an empty room, on the split validation",
            run: fair::fit,
        },
    ],
};

/// Forms of P3.
pub(crate) const OF_P3: Forms = Forms {
    paper: "P3",
    configs: ["joint-particle-as-printed", "joint-particle-kde50", "stereo-particle"],
    contenders: on_a_pair,
    judge: ON_THE_FLOOR,
    has_real: true,
    scene: "crossing-parallel",
    scenes: crossings,
    headline: Headline {
        column: "success across, %",
        published: 97.1,
        digits: 0,
        is_share: true,
        of: successes,
    },
    otherwise: Some(Reading {
        words: "one window for all scenes, no ConDensation",
        values: &fair::OTHER_READING,
    }),
    notes: &[
        "Read otherwise: the paper prints neither the window in which it compares images nor its \
         filter. As printed has a window around the people of each scene and OpenCV's \
         ConDensation; read otherwise is the same, misprints included, with the whole image as the \
         window of all scenes of a frame, and resampling that reports what was weighed instead of \
         what it predicts.",
        ON_A_PAIR,
        VERIFIED,
        "Success as in the next table; published is method (c) with 50 particles, over 140 \
         crossings.",
    ],
};

/// Setting of all scenes: a stereo pair, which has no colour.
const SEEN_BY: [(&str, &str); 1] = [("camera.kind", "stereo")];
/// Config with the `[stereo]` stage that computes all their depth, and with settings of the
/// detector that suit it.
const STEREO: &str = "stereo-ekf";
const PRINTED: &str = "joint-particle-as-printed";
/// Sigma for the dissimilarity with the size of the window inside of the root, m.
const RMS_SIGMA: &str = "0.15";
/// Largest distance between an estimate and its head on the floor, m.
const FAR_M: f64 = 1.0;
/// Least visible part of a person that counts as seen (the default of `[occlusion]`).
const SEEN: f64 = 0.4;
/// Table I: matches per frame, matching ms, total ms, error in pixels, success %.
const TABLE_1: [(&str, [f64; 5]); 4] = [
    ("(a) every particle", [625.0, 247.0, 328.0, 7.18, 97.8]),
    ("(b) reference table", [1281.0, 475.0, 555.0, 8.08, 97.1]),
    ("(c) 50 particles", [50.0, 20.0, 101.0, 8.27, 97.1]),
    ("(c) 30 particles", [30.0, 11.0, 93.0, 8.36, 91.4]),
];
/// The methods of the table and those compared with them.
const METHODS: [&str; 7] = [
    "joint-particle-all",
    "joint-particle-table",
    "joint-particle-kde50",
    "joint-particle-kde30",
    PRINTED,
    "joint-particle",
    "depth-ekf",
];

/// Result of one contender on one crossing.
#[derive(Default)]
struct Result {
    /// True if every person had a track before silhouettes overlapped; other crossings are no
    /// trial, because P3 starts from tracks.
    is_trial: bool,
    in_image: bool,
    /// Success across the line of sight, and on the floor, in the frames in which the person is
    /// seen.
    across_seen: bool,
    floor_seen: bool,
    pixels: Vec<f64>,
    metres: Vec<f64>,
    /// For each frame with overlapping squares: weighed scenes, ms of weighing, ms in total.
    costs: Vec<[f64; 3]>,
}

fn parallel(lab: &Lab) -> std::result::Result<Findings, ReproduceError> {
    let scenes = lab.scenes("crossing-parallel", &SEEN_BY, lab.seeds(140))?;
    let trials = Trials::new(lab, "crossing-parallel", &scenes, lab.contenders(&METHODS)?)?;
    let picture = Picture { name: "cost-and-error".into(), svg: trials.chart() };
    let title = "Two people cross parallel to the image (P3, Table I)";
    Ok(Findings { tables: vec![trials.table(title, true)], pictures: vec![picture] })
}

/// Number of crossings of the first table.
const FEW: u64 = 8;

/// Returns crossings parallel to the image, before a stereo pair.
fn crossings(lab: &Lab) -> std::result::Result<Vec<Scene>, ReproduceError> {
    lab.scenes("crossing-parallel", &SEEN_BY, lab.seeds(FEW))
}

/// Returns for each run whether all people keep their tracks across the line of sight, 100 or 0;
/// nothing if the crossing is no trial.
fn successes(trial: Trial) -> std::result::Result<Vec<Vec<f64>>, TrialError> {
    let successes = results(trial)?.into_iter().map(|result| {
        let success = if result.in_image { 100.0 } else { 0.0 };
        result.is_trial.then_some(success).into_iter().collect()
    });
    Ok(successes.collect())
}

fn hidden(lab: &Lab) -> std::result::Result<Findings, ReproduceError> {
    let names =
        ["joint-particle-all", "joint-particle-kde50", PRINTED, "joint-particle", "depth-ekf"];
    let title = "One of two people turns back, stops, passes or walks along while hidden";
    compare(lab, "crossing-hidden", 84, title, lab.contenders(&names)?)
}

fn oblique(lab: &Lab) -> std::result::Result<Findings, ReproduceError> {
    let names = ["joint-particle-all", "joint-particle-kde50", "joint-particle", "depth-ekf"];
    let title = "Two people cross and change depth (P3, Fig. 9)";
    compare(lab, "crossing-oblique", 28, title, lab.contenders(&names)?)
}

fn three(lab: &Lab) -> std::result::Result<Findings, ReproduceError> {
    let names = ["joint-particle-all", "joint-particle", "depth-ekf"];
    let title = "Three people cross, one of whom may turn back, stop or swap places while hidden";
    compare(lab, "crossing-three", 28, title, lab.contenders(&names)?)
}

fn compare(
    lab: &Lab,
    scene: &str,
    whole: u64,
    title: &str,
    contenders: Vec<Contender>,
) -> std::result::Result<Findings, ReproduceError> {
    let scenes = lab.scenes(scene, &SEEN_BY, lab.seeds(whole))?;
    Ok(Trials::new(lab, scene, &scenes, contenders)?.table(title, false).into())
}

const KERNEL: (&str, &str) = ("filter.config.printed_kernel", "false");
const NOISE: (&str, &str) = ("filter.config.shared_noise", "false");
const ROOT: [(&str, &str); 2] = [
    ("detectors.0.config.weighing", "\"rms\""),
    ("detectors.0.config.likelihood_sigma", RMS_SIGMA),
];

/// Compares the printed form with one misprint corrected at a time, with all corrected, with the
/// filter corrected as well, with another likelihood, and with the best pipeline.
fn misprints(lab: &Lab) -> std::result::Result<Findings, ReproduceError> {
    let printed = lab.contender(PRINTED)?;
    let all = [KERNEL, NOISE, ROOT[0], ROOT[1]];
    let resampled: Vec<(&str, &str)> = all
        .into_iter()
        .chain([
            ("filter.config.condensation", "false"),
            ("filter.config.top", "false"),
            ("filter.config.printed_axes", "false"),
        ])
        .collect();
    let repaired = [
        ("kernels of 2 sigma squared", &[KERNEL][..]),
        ("noise of each person's own", &[NOISE]),
        ("size of the window inside of the root", &ROOT),
        ("all three repaired", &all),
        ("and resampled, across the viewing ray", &resampled),
    ];
    let mut contenders = vec![printed.clone()];
    for (name, values) in repaired {
        contenders.push(with_values(&printed, name, values)?);
    }
    contenders.push(Contender {
        name: "and weighed by a likelihood ratio (joint-particle-kde50)".into(),
        ..lab.contender("joint-particle-kde50")?
    });
    contenders.push(lab.contender("joint-particle")?);
    let title = "What the misprints of P3 cost, and what the method lacks";
    compare(lab, "crossing-parallel", 28, title, contenders)
}

/// Values that are tried for the printed form, one change at a time.
const TRIED: [&[(&str, &str)]; 14] = [
    &[],
    &[("detectors.0.config.likelihood_sigma", "0.002")],
    &[("detectors.0.config.likelihood_sigma", "0.004")],
    &[("detectors.0.config.likelihood_sigma", "0.016")],
    &[("detectors.0.config.likelihood_sigma", "0.032")],
    &[("detectors.0.config.likelihood_sigma", "0.064")],
    &[("filter.config.position_noise", "0.16")],
    &[("filter.config.position_noise", "0.3")],
    &[("filter.config.velocity_noise", "0.1")],
    &[("filter.config.velocity_noise", "1.0")],
    &[("filter.config.height_noise", "0.06")],
    &[ROOT[0], ("detectors.0.config.likelihood_sigma", "0.15")],
    &[ROOT[0], ("detectors.0.config.likelihood_sigma", "0.3")],
    &[ROOT[0], ("detectors.0.config.likelihood_sigma", "0.6")],
];

/// Compares values of the parameters that P3 does not print, for the printed form.
fn fit(lab: &Lab) -> std::result::Result<Findings, ReproduceError> {
    let printed = lab.contender(PRINTED)?;
    let contenders = TRIED.into_iter().map(|values| {
        let words = values.iter().map(|(key, value)| {
            format!("{} = {value}", key.rsplit('.').next().unwrap_or_default())
        });
        let name = words.collect::<Vec<_>>().join(", ");
        let name = if name.is_empty() { PRINTED.to_owned() } else { name };
        with_values(&printed, &name, values)
    });
    let contenders: std::result::Result<Vec<_>, _> = contenders.collect();
    let seeds = lab.seeds(14);
    let scenes = lab.scenes_of(Split::Validation, "crossing-parallel", &SEEN_BY, seeds)?;
    let mut trials = Trials::new(lab, "crossing-parallel", &scenes, contenders?)?;
    trials
        .notes
        .push("Simulated with seeds of the split validation: the settings are chosen here.".into());
    Ok(trials.table("Free parameters of the printed form", false).into())
}

/// Returns shipped configs with the `[stereo]` stage of `stereo-ekf` and its settings of a detector,
/// unless they have a stage of their own.
fn on_a_pair(lab: &Lab, names: &[&str]) -> std::result::Result<Vec<Contender>, ReproduceError> {
    let stage = parsed(&lab.contender(STEREO)?)?.remove("stereo");
    let contenders = names.iter().map(|name| {
        let contender = lab.contender(name)?;
        if parsed(&contender)?.contains_key("stereo") {
            return Ok(contender);
        }
        let contender = in_stereo(lab, &[contender])?.1.remove(0);
        let mut config = parsed(&contender)?;
        config.extend(stage.clone().map(|stage| ("stereo".to_owned(), stage)));
        Ok(Contender { config: config.to_string(), ..contender })
    });
    contenders.collect()
}

/// Returns the settings of the `[stereo]` stage, and the contenders with those of a detector in its
/// depth.
fn in_stereo(
    lab: &Lab,
    contenders: &[Contender],
) -> std::result::Result<(StereoSettings, Vec<Contender>), ReproduceError> {
    fn wrong(what: &str) -> ReproduceError {
        ReproduceError::Other(format!("{STEREO}: {what}"))
    }

    let model = parsed(&lab.contender(STEREO)?)?;
    let stereo = model.get("stereo").cloned().ok_or_else(|| wrong("no [stereo]"))?;
    let stereo = stereo.try_into().map_err(|error: toml::de::Error| wrong(&error.to_string()))?;
    let detector = model.get("detectors").and_then(|all| all.get(0)?.get("config")?.as_table());
    let detector = detector.ok_or_else(|| wrong("no [detectors.config]"))?;
    let values: Vec<(String, String)> = detector
        .iter()
        .map(|(key, value): (_, &Value)| (format!("detectors.0.config.{key}"), value.to_string()))
        .collect();
    let values: Vec<(&str, &str)> = values.iter().map(|(k, v)| (&**k, &**v)).collect();
    let contenders: std::result::Result<Vec<_>, _> = contenders
        .iter()
        .map(|contender| with_values(contender, &contender.name, &values))
        .collect();
    Ok((stereo, contenders?))
}

/// Results of all contenders on the draws of one scene.
struct Trials {
    contenders: Vec<Contender>,
    /// One result per draw and contender.
    results: Vec<Vec<Result>>,
    notes: Vec<String>,
}

impl Trials {
    fn new(
        lab: &Lab,
        name: &str,
        scenes: &[Scene],
        contenders: Vec<Contender>,
    ) -> std::result::Result<Self, ReproduceError> {
        let (stereo, contenders) = in_stereo(lab, &contenders)?;
        let results = lab.pair_trials(name, scenes, &contenders, &stereo, results)?;
        let notes = vec![
            format!("{} draws of {name}, depth by stereo, no colour", scenes.len()),
            "Success: each head within 22 cm, half the shoulders, in all frames, by one track; \
             across the line of sight (as P3, who looked at images), or on the floor; \"while \
             seen\": in the frames in which 40 % of the upper body is seen. Where a person is \
             who turned back or stopped while hidden cannot be known."
                .into(),
            "No trial is a draw in which a person had no track before silhouettes overlapped: P3 \
             starts from tracks."
                .into(),
            "Errors: the nearest confirmed track within 1 m, hidden people included; over \
             successes across, and over all."
                .into(),
            "Costs: mean over frames in which two upper-body squares overlap, without the \
             matching of the stereo pair; P3's processor is of 2008, so only ratios compare."
                .into(),
        ];
        Ok(Self { contenders, results, notes })
    }

    fn table(&self, title: &str, published: bool) -> Table {
        let columns = [
            "matches/frame",
            "matching ms",
            "total ms",
            "error px, successes",
            "error px, all",
            "error m, all",
            "success across %",
            "across, while seen %",
            "floor, while seen %",
            "trials",
            "across, of all draws %",
        ];
        let mut rows: Vec<Row> = Vec::new();
        if published {
            rows.extend(TABLE_1.iter().map(|(name, numbers)| Row::published(*name, p3(numbers))));
        }
        let ours = self.contenders.iter().enumerate();
        rows.extend(ours.map(|(at, c)| Row::ours(&c.name, self.row(at))));
        Table {
            title: title.into(),
            columns: columns.iter().map(|name| (*name).to_owned()).collect(),
            rows,
            notes: self.notes.clone(),
        }
    }

    fn of(&self, at: usize) -> impl Iterator<Item = &Result> {
        self.results.iter().map(move |draw| &draw[at])
    }

    fn row(&self, at: usize) -> Vec<Cell> {
        fn share_of(all: usize, count: usize) -> Cell {
            Cell::share(count as u64, all as u64, 1)
        }

        fn mean_cell<'a>(values: impl Iterator<Item = &'a f64>, digits: usize) -> Cell {
            Cell::number(mean(&values.copied().collect::<Vec<f64>>()), digits)
        }

        let trials = self.of(at).filter(|r| r.is_trial).count();
        let across = self.of(at).filter(|r| r.in_image).count();
        vec![
            Cell::number(self.cost(at, 0), 0),
            Cell::number(self.cost(at, 1), 2),
            Cell::number(self.cost(at, 2), 2),
            mean_cell(self.of(at).filter(|r| r.in_image).flat_map(|r| &r.pixels), 2),
            mean_cell(self.of(at).flat_map(|r| &r.pixels), 2),
            mean_cell(self.of(at).flat_map(|r| &r.metres), 3),
            share_of(trials, across),
            share_of(trials, self.of(at).filter(|r| r.is_trial && r.across_seen).count()),
            share_of(trials, self.of(at).filter(|r| r.is_trial && r.floor_seen).count()),
            Cell::number(trials as f64, 0),
            // Here a draw that is no trial counts as a failure.
            share_of(self.results.len(), across),
        ]
    }

    fn cost(&self, at: usize, which: usize) -> f64 {
        mean(&self.of(at).flat_map(|r| &r.costs).map(|cost| cost[which]).collect::<Vec<_>>())
    }

    fn chart(&self) -> String {
        let points = self
            .contenders
            .iter()
            .enumerate()
            .map(|(at, contender)| {
                let name = contender.name.trim_start_matches("joint-particle-").to_owned();
                let errors: Vec<f64> = self.of(at).flat_map(|r| r.metres.iter().copied()).collect();
                (name, self.cost(at, 1), mean(&errors))
            })
            .collect();
        Scatter {
            title: "Two people cross: what the methods of P3 cost, and how good they are",
            across: "matching, ms per frame with an overlap",
            up: "mean error of the head, all draws, m",
            points,
        }
        .svg()
    }
}

fn p3(numbers: &[f64; 5]) -> Vec<Cell> {
    let [matches, matching, total, pixels, success] = *numbers;
    let none = Cell::default;
    vec![
        Cell::number(matches, 0),
        Cell::number(matching, 0),
        Cell::number(total, 0),
        Cell::number(pixels, 2),
        none(),
        none(),
        Cell::number(success, 1),
        none(),
        none(),
        Cell::number(140.0, 0),
        none(),
    ]
}

/// Returns the mean; NaN of no values.
fn mean(values: &[f64]) -> f64 {
    tagalong_math::mean(values).unwrap_or(f64::NAN)
}

fn results(trial: Trial) -> std::result::Result<Vec<Result>, TrialError> {
    Ok(trial.runs.iter().map(|run| result(&trial, run)).collect())
}

fn result(trial: &Trial, run: &Run) -> Result {
    // A person needs a track by the first overlap, because P3 starts from tracks.
    let rules = Crossing { settle_s: first_overlap_s(trial), ..Crossing::default() };
    let across = crossing(trial, run, &Crossing { across_only: true, ..rules });
    let [across_seen, floor_seen] = [true, false].map(|across_only| {
        let rules = Crossing { across_only, min_visible: SEEN, ..rules };
        crossing(trial, run, &rules).is_ok()
    });
    let mut result = Result {
        is_trial: !matches!(across, Err(Failing::NotFound { .. } | Failing::Nobody)),
        in_image: across.is_ok(),
        across_seen,
        floor_seen,
        ..Result::default()
    };
    for (moment, report) in trial.moments.iter().zip(&run.reports) {
        for truth in moment.truth.iter().filter(|truth| truth.upper_body.is_some()) {
            let Some(place) = estimate(truth, &report.tracks) else { continue };
            result.metres.push((place - truth.head_in_robot).norm());
            result.pixels.extend(pixels_apart(&trial.camera, &place, &truth.head_in_robot));
        }
        if overlaps(moment) {
            result.costs.push(cost(report));
        }
    }
    result
}

/// Returns the time of the first overlap of two people's squares, s.
fn first_overlap_s(trial: &Trial) -> f64 {
    let first = trial.moments.iter().find(|moment| overlaps(moment));
    first.map_or(0.0, |moment| moment.stamp.nanos() as f64 / 1e9)
}

fn estimate(truth: &Truth, tracks: &[Track]) -> Option<Point3<f64>> {
    let places = tracks.iter().filter(|t| t.confirmed).map(|t| t.estimate.person.position);
    let nearest = places
        .map(|place| ((place - truth.head_in_robot).xy().norm(), place))
        .min_by(|a, b| a.0.total_cmp(&b.0));
    // A track farther away belongs to another person, and its error says nothing.
    nearest.filter(|(away_m, _)| *away_m < FAR_M).map(|(_, place)| place)
}

fn pixels_apart(camera: &Camera, a: &Point3<f64>, b: &Point3<f64>) -> Option<f64> {
    Some((camera.project(a)? - camera.project(b)?).norm())
}

/// Returns true if two people's upper-body squares overlap.
fn overlaps(moment: &Moment) -> bool {
    let squares: Vec<_> = moment.truth.iter().filter_map(|truth| truth.upper_body).collect();
    squares.iter().enumerate().any(|(at, square)| {
        squares[at + 1..].iter().any(|other| square.intersection(other).area() > 0.0)
    })
}

fn cost(report: &FrameReport) -> [f64; 3] {
    let total: f64 = report.timings.iter().map(|(_, ms)| ms).sum();
    [report.weighing.scenes as f64, report.weighing.ms, total]
}
