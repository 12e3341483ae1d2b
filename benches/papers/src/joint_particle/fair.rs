//! Causes that lead the printed form of P3 away from people, step by step, in our rooms and in an empty
//! one.

use tagalong_report::{Cell, Row, Table};
use tagalong_sim::{Scene, Split};
use tagalong_trials::{Contender, Crossing, Failing, Run, Trial, TrialError, crossing};

use super::{
    KERNEL, NOISE, PRINTED, SEEN_BY, Trials, estimate, first_overlap_s, in_stereo, mean, overlaps,
    pixels_apart,
};
use crate::findings::Findings;
use crate::lab::{Lab, ReproduceError};
use crate::variant::with_values;

const SCENE: &str = "crossing-parallel";
/// A room that asks nothing of a method: one wall with a pattern, well lit, and nothing in front
/// of it. P3 says nothing of its rooms; all that it does say holds in both.
const EMPTY: [(&str, &str); 5] = [
    SEEN_BY[0],
    ("room.clutter", "0"),
    ("room.wallpaper", "true"),
    ("room.size_m.0", "7.5"),
    ("light.lux", "600.0"),
];

/// Values, TOML, at dotted keys of a config.
type Values = [(&'static str, &'static str)];

/// One window for all scenes of a frame, and a sigma for the mean error of that many pixels.
const WINDOW: [(&str, &str); 2] =
    [("detectors.0.config.whole_image", "true"), ("detectors.0.config.likelihood_sigma", "0.0004")];
/// The printed form, misprints included, with both read the other way: what the paper compares, and
/// what its filter reports.
pub(crate) const OTHER_READING: [(&str, &str); 3] = [WINDOW[0], WINDOW[1], SAMPLING];
const RATIO: (&str, &str) = ("detectors.0.config.weighing", "\"ratio\"");
const MOTION: [(&str, &str); 2] =
    [("filter.config.position_noise", "0.158"), ("filter.config.velocity_noise", "0.32")];
const SAMPLING: (&str, &str) = ("filter.config.condensation", "false");
const TOP: (&str, &str) = ("filter.config.top", "false");
const AXES: (&str, &str) = ("filter.config.printed_axes", "false");

/// Changes of the printed form.
const STEPS: [(&str, &[&Values]); 9] = [
    ("one window for all scenes", &[&WINDOW]),
    ("weighed by a likelihood ratio", &[&[RATIO]]),
    ("no ConDensation", &[&[SAMPLING]]),
    ("one window, no ConDensation", &[&OTHER_READING]),
    ("likelihood ratio, no ConDensation", &[&[RATIO, SAMPLING]]),
    ("one window, no ConDensation, noise of each person's own", &[&WINDOW, &[SAMPLING, NOISE]]),
    ("and kernels of 2 sigma squared", &[&WINDOW, &[SAMPLING, NOISE, KERNEL]]),
    ("and more noise", &[&WINDOW, &[SAMPLING, NOISE, KERNEL], &MOTION]),
    (
        "and resampled when groups form, across the viewing ray",
        &[&WINDOW, &[SAMPLING, NOISE, KERNEL, TOP, AXES], &MOTION],
    ),
];

/// Outcome of one crossing.
#[derive(Default)]
struct Fate {
    /// Every person had a track before silhouettes overlapped.
    is_trial: bool,
    is_kept: bool,
    has_ended: bool,
    near_astray: bool,
    far_astray: bool,
    /// Time of the failure since the first overlap, s.
    after_s: Option<f64>,
    pixels: Vec<f64>,
    /// While squares overlap: error across the line of sight in the direction of the walk, m.
    ahead_m: Vec<f64>,
    /// While squares overlap: error along the line of sight, m.
    beyond_m: Vec<f64>,
}

/// Compares the printed form with one thing changed and with several, in both rooms.
pub(super) fn causes(lab: &Lab) -> Result<Findings, ReproduceError> {
    let printed = lab.contender(PRINTED)?;
    let mut contenders = vec![printed.clone()];
    for (name, values) in STEPS {
        contenders.push(with_values(&printed, name, &values.concat())?);
    }
    contenders.push(lab.contender("joint-particle-kde50")?);
    let seeds = lab.seeds(14);
    let ours = fates(lab, &lab.scenes(SCENE, &SEEN_BY, seeds)?, &contenders)?;
    let empty = fates(lab, &lab.scenes(SCENE, &EMPTY, seeds)?, &contenders)?;
    let rows = contenders.iter().enumerate();
    let rows = rows.map(|(at, contender)| Row::ours(&contender.name, cells(&ours, &empty, at)));
    let columns = [
        "kept, our rooms %",
        "kept, empty room %",
        "error px, empty",
        "track ended",
        "near one astray",
        "far one astray",
        "s after overlap",
        "ahead m",
        "beyond m",
    ];
    let table = Table {
        title: "What leads the printed form of P3 away".into(),
        columns: columns.iter().map(|name| (*name).to_owned()).collect(),
        rows: rows.collect(),
        notes: vec![
            format!("{seeds} draws of {SCENE} in each room, success across the line of sight"),
            "Empty room: nothing stands in it, its walls have a pattern, 600 lux; the far wall is \
             6.7 m away. People, paths, speeds, image size, images a second and numbers of \
             particles are those of P3 in both rooms."
                .into(),
            "All columns from the third on are of the empty room. How a crossing failed first: \
             counts; the median time from the first overlap to it; ahead and beyond: mean signed \
             error while squares overlap, across the line of sight in the direction of the walk, \
             and along the line of sight."
                .into(),
        ],
    };
    Ok(table.into())
}

fn fates(
    lab: &Lab,
    scenes: &[Scene],
    contenders: &[Contender],
) -> Result<Vec<Vec<Fate>>, ReproduceError> {
    let (stereo, contenders) = in_stereo(lab, contenders)?;
    lab.pair_trials(SCENE, scenes, &contenders, &stereo, fates_of)
}

fn fates_of(trial: Trial) -> Result<Vec<Fate>, TrialError> {
    Ok(trial.runs.iter().map(|run| fate(&trial, run)).collect())
}

fn fate(trial: &Trial, run: &Run) -> Fate {
    let overlap_s = first_overlap_s(trial);
    let rules = Crossing { settle_s: overlap_s, across_only: true, ..Crossing::default() };
    let mut fate = Fate { is_trial: true, ..Fate::default() };
    match crossing(trial, run, &rules) {
        Ok(_) => fate.is_kept = true,
        Err(Failing::Lost { at_s, .. }) => {
            fate.has_ended = true;
            fate.after_s = Some(at_s - overlap_s);
        }
        Err(Failing::Astray { person, at_s }) => {
            // The first person of the scene is the nearer one.
            let is_near = trial.moments[0].truth.iter().all(|truth| person <= truth.id);
            fate.near_astray = is_near;
            fate.far_astray = !is_near;
            fate.after_s = Some(at_s - overlap_s);
        }
        Err(_) => fate.is_trial = false,
    }
    add_errors(&mut fate, trial, run);
    fate
}

fn add_errors(fate: &mut Fate, trial: &Trial, run: &Run) {
    let frames = trial.moments.iter().zip(&trial.moments[1..]).zip(&run.reports);
    for ((moment, next), report) in frames {
        for truth in moment.truth.iter().filter(|truth| truth.upper_body.is_some()) {
            let Some(place) = estimate(truth, &report.tracks) else { continue };
            fate.pixels.extend(pixels_apart(&trial.camera, &place, &truth.head_in_robot));
            let later = next.truth.iter().find(|later| later.id == truth.id);
            let Some(later) = later.filter(|_| overlaps(moment)) else { continue };
            // The robot stands and looks along X.
            let walks = (later.head_in_robot - truth.head_in_robot).y.signum();
            let off = place - truth.head_in_robot;
            fate.ahead_m.push(walks * off.y);
            fate.beyond_m.push(off.x);
        }
    }
}

fn cells(ours: &[Vec<Fate>], empty: &[Vec<Fate>], at: usize) -> Vec<Cell> {
    let [kept, kept_empty] = [ours, empty].map(|draws| {
        let trials = draws.iter().filter(|draw| draw[at].is_trial).count();
        let kept = draws.iter().filter(|draw| draw[at].is_kept).count();
        Cell::share(kept as u64, trials as u64, 1)
    });
    let fates: Vec<&Fate> = empty.iter().map(|draw| &draw[at]).collect();
    let mut after: Vec<f64> = fates.iter().filter_map(|fate| fate.after_s).collect();
    after.sort_by(f64::total_cmp);
    let median = after.get(after.len() / 2).copied().unwrap_or(f64::NAN);
    vec![
        kept,
        kept_empty,
        mean_cell(&fates, |fate| &fate.pixels, 2),
        count_cell(&fates, |fate| fate.has_ended),
        count_cell(&fates, |fate| fate.near_astray),
        count_cell(&fates, |fate| fate.far_astray),
        Cell::number(median, 1),
        mean_cell(&fates, |fate| &fate.ahead_m, 3),
        mean_cell(&fates, |fate| &fate.beyond_m, 3),
    ]
}

/// Counts the fates of which something is true.
fn count_cell(fates: &[&Fate], is_so: fn(&Fate) -> bool) -> Cell {
    Cell::number(fates.iter().filter(|fate| is_so(fate)).count() as f64, 0)
}

/// Returns the mean of all values of all fates.
fn mean_cell(fates: &[&Fate], values: fn(&Fate) -> &Vec<f64>, digits: usize) -> Cell {
    let all: Vec<f64> = fates.iter().flat_map(|fate| values(fate)).copied().collect();
    Cell::number(mean(&all), digits)
}

/// Values that are tried with one window for all scenes.
const TRIED: [&[(&str, &str)]; 7] = [
    &[("detectors.0.config.likelihood_sigma", "0.0001")],
    &[("detectors.0.config.likelihood_sigma", "0.0002")],
    &[],
    &[("detectors.0.config.likelihood_sigma", "0.0008")],
    &[("filter.config.position_noise", "0.08")],
    &[("filter.config.position_noise", "0.3")],
    &[("filter.config.velocity_noise", "1.0")],
];

/// Compares values of the parameters that P3 does not print, in an empty room.
pub(super) fn fit(lab: &Lab) -> Result<Findings, ReproduceError> {
    let changed = [&WINDOW[..], &[SAMPLING, NOISE, KERNEL], &MOTION].concat();
    let base = with_values(&lab.contender(PRINTED)?, "one window, misprints repaired", &changed)?;
    let mut contenders = Vec::new();
    for values in TRIED {
        let words: Vec<String> = values
            .iter()
            .map(|(key, value)| format!("{} = {value}", key.rsplit('.').next().unwrap_or(key)))
            .collect();
        let name = if words.is_empty() { base.name.clone() } else { words.join(", ") };
        contenders.push(with_values(&base, &name, values)?);
    }
    let scenes = lab.scenes_of(Split::Validation, SCENE, &EMPTY, lab.seeds(14))?;
    let mut trials = Trials::new(lab, SCENE, &scenes, contenders)?;
    trials
        .notes
        .push("Simulated with seeds of the split validation: the settings are chosen here.".into());
    Ok(trials.table("Free parameters of the printed form in an empty room", false).into())
}

/// Choices of the particles that are compared with the image.
const CHOICES: [(&str, &str); 2] = [
    ("the likeliest of the frame before (P3)", "\"previous-best\""),
    ("spread, and a grid", "\"spread\""),
];

/// Compares choices of the particles that make a map, for both maps and both numbers of P3.
pub(super) fn choices(lab: &Lab) -> Result<Findings, ReproduceError> {
    let base = lab.contender("joint-particle-kde50")?;
    let mut contenders = Vec::new();
    for (map, method) in [("sum of kernels", "\"kde\""), ("interpolated", "\"gp\"")] {
        for points in ["30", "50"] {
            for (choice, chosen) in CHOICES {
                let values = [
                    ("filter.config.method", method),
                    ("filter.config.points", points),
                    ("filter.config.chosen", chosen),
                ];
                let name = format!("{map}, {points} particles, {choice}");
                contenders.push(with_values(&base, &name, &values)?);
            }
        }
    }
    let scenes = lab.scenes(SCENE, &SEEN_BY, lab.seeds(14))?;
    let title = "Choices of the particles that make a likelihood map";
    Ok(Trials::new(lab, SCENE, &scenes, contenders)?.table(title, false).into())
}
