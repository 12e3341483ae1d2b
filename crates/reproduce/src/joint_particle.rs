//! P3: joint particles that weigh scenes of overlapping silhouettes.

use nalgebra::Point3;
use tagalong_core::{Camera, Track};
use tagalong_pipeline::FrameReport;
use tagalong_sim::Truth;
use tagalong_trials::{Contender, Crossing, Failing, Moment, Run, Trial, TrialError, crossing};

use crate::scatter::Scatter;
use crate::{Cell, Experiment, Findings, Lab, Picture, ReproduceError, Row, System, Table};

/// The system.
pub const SYSTEM: System = System {
    name: "joint-particle",
    about: "P3: joint particles, overlapping silhouettes, likelihood maps",
    experiments: &[
        Experiment {
            name: "table-1",
            about: "Table I: two people cross parallel to the image; cost, error, success",
            run: parallel,
        },
        Experiment {
            name: "cluttered",
            about: "the same in rooms with furniture that looks like people",
            run: cluttered,
        },
        Experiment {
            name: "figure-9",
            about: "Fig. 9: two people of different height cross while their depths change",
            run: oblique,
        },
        Experiment { name: "three", about: "three people cross", run: three },
        Experiment {
            name: "three-tricks",
            about: "the same, and one may turn back, stop, or swap places while hidden",
            run: three_tricks,
        },
        Experiment { name: "four", about: "four people cross", run: four },
    ],
};

/// An estimate farther from a head than this on the floor is no estimate of it, m.
const FAR_M: f64 = 1.0;
/// Who is seen less than this is hidden (the default of `[occlusion]`).
const SEEN: f64 = 0.4;
/// Table I: matches a frame, matching ms, total ms, error in pixels, success %.
const TABLE_1: [(&str, [f64; 5]); 4] = [
    ("(a) every particle", [625.0, 247.0, 328.0, 7.18, 97.8]),
    ("(b) reference table", [1281.0, 475.0, 555.0, 8.08, 97.1]),
    ("(c) 50 particles", [50.0, 20.0, 101.0, 8.27, 97.1]),
    ("(c) 30 particles", [30.0, 11.0, 93.0, 8.36, 91.4]),
];
/// The methods of the table and what stands beside them.
const METHODS: [&str; 7] = [
    "joint-particle-all",
    "joint-particle-table",
    "joint-particle-kde50",
    "joint-particle-kde30",
    "joint-particle-as-printed",
    "particle-best",
    "depth-ekf",
];

/// What one contender made of one crossing.
#[derive(Default)]
struct Result {
    /// Everybody had a track before silhouettes overlapped; otherwise this is
    /// no trial, for P3 starts from tracks.
    is_trial: bool,
    in_image: bool,
    on_floor: bool,
    while_seen: bool,
    pixels: Vec<f64>,
    metres: Vec<f64>,
    /// Frames in which squares overlap: scenes that were weighed, ms for that,
    /// ms for everything.
    costs: Vec<[f64; 3]>,
}

fn parallel(lab: &Lab) -> std::result::Result<Findings, ReproduceError> {
    let scenes = [("room.clutter", "0")];
    let mut contenders = lab.contenders(&METHODS)?;
    contenders.insert(4, interpolated(lab)?);
    let title = "Two people cross parallel to the image (P3, Table I)";
    let mut trials = Trials::new(lab, "crossing-parallel", &scenes, 140, contenders)?;
    trials.notes.push("Rooms without furniture that is taken for a person.".into());
    let picture = Picture { name: "cost-and-error".into(), svg: trials.chart() };
    Ok(Findings { tables: vec![trials.table(title, true)], pictures: vec![picture] })
}

fn cluttered(lab: &Lab) -> std::result::Result<Findings, ReproduceError> {
    let title = "Two people cross parallel to the image, furniture in the background";
    compare(lab, "crossing-parallel", &[], 280, title)
}

fn oblique(lab: &Lab) -> std::result::Result<Findings, ReproduceError> {
    let title = "Two people cross and change depth (P3, Fig. 9)";
    compare(lab, "crossing-oblique", &[], 140, title)
}

fn three(lab: &Lab) -> std::result::Result<Findings, ReproduceError> {
    let title = "Three people cross (P3 leaves them to the future)";
    compare(lab, "crossing-three", &[("people.1.trick", "none")], 100, title)
}

fn three_tricks(lab: &Lab) -> std::result::Result<Findings, ReproduceError> {
    let title = "Three people cross, one of whom may turn back, stop or swap places while hidden";
    compare(lab, "crossing-three", &[], 100, title)
}

fn four(lab: &Lab) -> std::result::Result<Findings, ReproduceError> {
    compare(lab, "crossing-four", &[], 50, "Four people cross (P3 leaves them to the future)")
}

fn compare(
    lab: &Lab,
    scene: &str,
    set: &[(&str, &str)],
    whole: u64,
    title: &str,
) -> std::result::Result<Findings, ReproduceError> {
    let names = ["joint-particle-all", "joint-particle-kde50", "particle-best", "depth-ekf"];
    let trials = Trials::new(lab, scene, set, whole, lab.contenders(&names)?)?;
    Ok(trials.table(title, false).into())
}

/// The places of `joint-particle-kde50`, interpolated instead of summed.
fn interpolated(lab: &Lab) -> std::result::Result<Contender, ReproduceError> {
    let kde = lab.contender("joint-particle-kde50")?;
    let config = kde.config.replace("method = \"kde\"", "method = \"gp\"");
    let config = config.replace("\"previous-best\"", "\"spread\"");
    Ok(Contender { name: "gp50 (as kde50, interpolated)".into(), config, ..kde })
}

/// All contenders on the draws of one scene.
struct Trials {
    contenders: Vec<Contender>,
    /// One a draw and contender.
    results: Vec<Vec<Result>>,
    notes: Vec<String>,
}

impl Trials {
    fn new(
        lab: &Lab,
        scene: &str,
        set: &[(&str, &str)],
        whole: u64,
        contenders: Vec<Contender>,
    ) -> std::result::Result<Self, ReproduceError> {
        let set: Vec<(&str, &str)> =
            set.iter().copied().chain([("camera.colour", "false")]).collect();
        let scenes = lab.scenes(scene, &set, lab.seeds(whole))?;
        let results = lab.trials(scene, &scenes, &contenders, results)?;
        let notes = vec![
            format!("{} draws of {scene}, RGB-D, no colour; Wilson intervals", scenes.len()),
            "Success: each head within 22 cm, half the shoulders, in all frames, by one track; \
             across the line of sight (as P3, who looked at images), on the floor, or on the \
             floor in the frames in which 40 % of the upper body is seen."
                .into(),
            "No trial is a draw in which somebody had no track before silhouettes overlapped: P3 \
             starts from tracks. Dark clothes without depth are the usual reason."
                .into(),
            "Errors: the nearest confirmed track within 1 m, hidden people included; over \
             successes across, and over all."
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
            "error m, successes",
            "error m, all",
            "success across %",
            "success on floor %",
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
        let mut notes = self.notes.clone();
        notes.push(
            "Costs: mean over frames in which two upper-body squares overlap; P3's processor is \
             of 2008, so only ratios compare."
                .into(),
        );
        Table {
            title: title.into(),
            columns: columns.iter().map(|name| (*name).to_owned()).collect(),
            rows,
            notes,
        }
    }

    fn of(&self, at: usize) -> impl Iterator<Item = &Result> {
        self.results.iter().map(move |draw| &draw[at])
    }

    fn row(&self, at: usize) -> Vec<Cell> {
        let all = |_: &&Result| true;
        let good = |result: &&Result| result.in_image;
        let trials = self.of(at).filter(|r| r.is_trial).count();
        let share_of = |all: usize, count: usize| Cell::share(count as u64, all as u64, 1);
        let share = |count: usize| share_of(trials, count);
        let across = self.of(at).filter(|r| r.in_image).count();
        let mean = |values: Vec<f64>, digits| Cell::number(mean(&values), digits);
        vec![
            Cell::number(self.cost(at, 0), 0),
            Cell::number(self.cost(at, 1), 2),
            Cell::number(self.cost(at, 2), 2),
            mean(self.of(at).filter(good).flat_map(|r| r.pixels.clone()).collect(), 2),
            mean(self.of(at).filter(all).flat_map(|r| r.pixels.clone()).collect(), 2),
            mean(self.of(at).filter(good).flat_map(|r| r.metres.clone()).collect(), 3),
            mean(self.of(at).filter(all).flat_map(|r| r.metres.clone()).collect(), 3),
            share(across),
            share(self.of(at).filter(|r| r.is_trial && r.on_floor).count()),
            share(self.of(at).filter(|r| r.is_trial && r.while_seen).count()),
            Cell::number(trials as f64, 0),
            share_of(self.results.len(), across),
        ]
    }

    fn cost(&self, at: usize, which: usize) -> f64 {
        mean(&self.of(at).flat_map(|r| &r.costs).map(|cost| cost[which]).collect::<Vec<_>>())
    }

    fn chart(&self) -> String {
        let error =
            |at| mean(&self.of(at).flat_map(|r| r.metres.iter().copied()).collect::<Vec<_>>());
        let point = |(at, contender): (usize, &Contender)| {
            let name = contender.name.trim_start_matches("joint-particle-").to_owned();
            (name, self.cost(at, 1), error(at))
        };
        let points = self.contenders.iter().enumerate().map(point).collect();
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
        none(),
        Cell::number(success, 1),
        none(),
        none(),
        Cell::number(140.0, 0),
        none(),
    ]
}

/// Not a number where there are none.
fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn results(trial: Trial) -> std::result::Result<Vec<Result>, TrialError> {
    Ok(trial.runs.iter().map(|run| result(&trial, run)).collect())
}

fn result(trial: &Trial, run: &Run) -> Result {
    let rules = Crossing { settle_s: first_overlap_s(trial), ..Crossing::default() };
    let across = crossing(trial, run, &Crossing { across_only: true, ..rules });
    let mut result = Result {
        is_trial: !matches!(across, Err(Failing::NotFound { .. } | Failing::Nobody)),
        in_image: across.is_ok(),
        on_floor: crossing(trial, run, &rules).is_ok(),
        while_seen: crossing(trial, run, &Crossing { min_visible: SEEN, ..rules }).is_ok(),
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

/// When two people's squares overlap for the first time, s.
fn first_overlap_s(trial: &Trial) -> f64 {
    let first = trial.moments.iter().find(|moment| overlaps(moment));
    first.map_or(0.0, |moment| moment.stamp.nanos() as f64 / 1e9)
}

fn estimate(truth: &Truth, tracks: &[Track]) -> Option<Point3<f64>> {
    let away = |place: &Point3<f64>| (place - truth.head_in_robot).xy().norm();
    let places = tracks.iter().filter(|t| t.confirmed).map(|t| t.estimate.person.position);
    places.filter(|p| away(p) < FAR_M).min_by(|a, b| away(a).total_cmp(&away(b)))
}

fn pixels_apart(camera: &Camera, a: &Point3<f64>, b: &Point3<f64>) -> Option<f64> {
    Some((camera.project(a)? - camera.project(b)?).norm())
}

/// True if two people's upper-body squares overlap.
fn overlaps(moment: &Moment) -> bool {
    let squares: Vec<_> = moment.truth.iter().filter_map(|truth| truth.upper_body).collect();
    let meets = |(at, square): (usize, &tagalong_core::Rect)| {
        squares[at + 1..].iter().any(|other| square.intersection(other).area() > 0.0)
    };
    squares.iter().enumerate().any(meets)
}

fn cost(report: &FrameReport) -> [f64; 3] {
    let total: f64 = report.timings.iter().map(|(_, ms)| ms).sum();
    [report.weighing.scenes as f64, report.weighing.ms, total]
}
