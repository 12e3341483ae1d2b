//! Behaviour of verifiers on furniture of a kind that they were not trained on. A verifier is
//! fitted again without each kind in turn, and tested in rooms with that kind: the scores of models
//! that were trained on all kinds say little about a new room.

use std::fs;

use tagalong_config::{ConfigError, Context, Example, Trainer, Value};
use tagalong_core::{Detection, DiffDrive, Frame, Funnel, Verifier};
use tagalong_pipeline::{Fate, Pipeline};
use tagalong_report::{Cell, Row, Table as Page};
use tagalong_sim::{Furniture, FurnitureKind, Scene, Split, Truth};
use tagalong_stereo::StereoDepth;
use tagalong_trials::{Contender, Draw};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::verifier::{Whose, share, what_stands_at, whose};
use super::{STEREO, variants};
use crate::findings::Findings;
use crate::lab::{Lab, ReproduceError};

/// Kinds that are left out in turn.
const KINDS: [FurnitureKind; 6] = [
    FurnitureKind::CoatStand,
    FurnitureKind::CardboardFigure,
    FurnitureKind::BinOnTable,
    FurnitureKind::FloorLamp,
    FurnitureKind::Plant,
    FurnitureKind::Poster,
];
/// Verifiers, with the settings of their training (with the numbers that cross-validation chose for
/// the shipped one, which saves an hour), and with their settings in use.
const VERIFIERS: [(&str, &str, &str); 2] = [
    ("svm-patch", "training = { gammas = [2.0], penalties = [3.0] }", ""),
    ("color-texture", "training = { trees = [200] }", "weight = 2.0\nbias = -4.0"),
];
/// Seed of training and of verifiers.
const SEED: u64 = 1;
/// Config of the detector, used without its verifiers.
pub(super) const DETECTS: &str = "stereo-verified";
/// Lowered thresholds, so that training gets many candidates (as by `tagalong train`).
pub(super) const LOWERED: [(&str, f64); 9] = [
    ("detectors.0.config.boundary_margin_m", 0.2),
    ("detectors.0.config.min_head_height_m", 1.0),
    ("detectors.0.config.min_head_width_m", 0.06),
    ("detectors.0.config.max_head_width_m", 0.5),
    ("detectors.0.config.min_body", 0.5),
    ("detectors.0.config.discover_cost", 0.26),
    ("detectors.0.config.follow_cost", 0.36),
    ("manager.config.start_score", -4.0),
    ("manager.config.drop_score", -8.0),
];
/// Scenes, with few frames of many draws instead of many frames of few, because frames of one scene
/// resemble each other.
const ROOMS: [(&str, &[(&str, &str)]); 3] = [
    (
        "empty-clutter",
        &[STEREO, ("duration_s", "7"), ("camera.rate_hz", "1"), ("room.clutter", "9")],
    ),
    ("turntable", &[STEREO, ("duration_s", "7"), ("camera.rate_hz", "1"), ("room.clutter", "9")]),
    (
        "square-walk",
        &[STEREO, ("duration_s", "10"), ("camera.rate_hz", "1"), ("room.clutter", "9")],
    ),
];

/// Judged detections, and rejected ones: by the model that was trained on all kinds, and by the one
/// without this kind.
#[derive(Clone, Copy, Debug, Default)]
struct Judged {
    with: [u64; 2],
    without: [u64; 2],
}

/// Runs the experiment.
pub fn left_out(lab: &Lab) -> Result<Findings, ReproduceError> {
    let detects = without_verifiers(&lab.contender(DETECTS)?)?;
    let mut trainers = Vec::new();
    for (plugin, training, _) in VERIFIERS {
        let each = (0..=KINDS.len()).map(|_| trainer(lab, plugin, training, SEED));
        trainers.push(each.collect::<Result<Vec<_>, _>>()?);
    }
    // Training has two draws for each draw of the test.
    let seeds = lab.seeds(40);
    let lowered = variants::with(&detects, &LOWERED)?;
    let mut counts = [0u64; 2];
    visit(lab, Split::Train, 2 * seeds, &lowered, &mut |frame, sighting| {
        counts[usize::from(sighting.is_person)] += 1;
        for trainer in trainers.iter_mut().flatten().enumerate() {
            // The last trainer of each verifier leaves no kind out.
            let left_out = KINDS.get(trainer.0 % (KINDS.len() + 1));
            if left_out.is_some_and(|kind| sighting.thing == Some(kind.name())) {
                continue;
            }
            let example = Example { is_person: sighting.is_person, group: sighting.group };
            trainer.1.add(frame, sighting.detection, example).map_err(ReproduceError::other)?;
        }
        Ok(())
    })?;
    let mut judges = Vec::new();
    lab.progress.begin(VERIFIERS.len() * (KINDS.len() + 1), "models, each without a kind");
    for ((plugin, _, settings), trainers) in VERIFIERS.iter().zip(trainers) {
        judges.push(judges_of(lab, plugin, settings, trainers)?);
    }
    let mut things = [[Judged::default(); KINDS.len()]; VERIFIERS.len()];
    let mut people = [Judged::default(); VERIFIERS.len()];
    visit(lab, Split::Test, seeds, &detects, &mut |frame, sighting| {
        // Candidates that the detector drops itself never matter to a verifier.
        if !sighting.is_believed {
            return Ok(());
        }
        for (judges, (things, people)) in judges.iter_mut().zip(things.iter_mut().zip(&mut people))
        {
            let all = count_rejection(judges[KINDS.len()].as_mut(), frame, sighting.detection)?;
            for (at, kind) in KINDS.iter().enumerate() {
                let of = match sighting.thing {
                    _ if sighting.is_person => &mut *people,
                    Some(thing) if thing == kind.name() => &mut things[at],
                    _ => continue,
                };
                of.with = [of.with[0] + 1, of.with[1] + all];
                let rejected = count_rejection(judges[at].as_mut(), frame, sighting.detection)?;
                of.without = [of.without[0] + 1, of.without[1] + rejected];
            }
        }
        Ok(())
    })?;
    Ok(table(&things, &people, counts, seeds).into())
}

/// Returns one if a verifier rejects a candidate, and zero if not.
fn count_rejection(
    judge: &mut dyn Verifier,
    frame: &Frame,
    candidate: &Detection,
) -> Result<u64, ReproduceError> {
    let margin = judge.log_odds(frame, candidate).map_err(ReproduceError::other)?;
    Ok(u64::from(candidate.score + margin < 0.0))
}

fn table(
    things: &[[Judged; KINDS.len()]; VERIFIERS.len()],
    people: &[Judged; VERIFIERS.len()],
    [others, persons]: [u64; 2],
    seeds: u64,
) -> Page {
    fn cells(of: [Judged; VERIFIERS.len()]) -> Vec<Cell> {
        let each = of.into_iter().flat_map(|judged| [share(judged.without), share(judged.with)]);
        std::iter::once(Cell::number(of[0].with[0] as f64, 0)).chain(each).collect()
    }

    fn sum(of: [Judged; KINDS.len()]) -> Judged {
        of.iter().fold(Judged::default(), |sum, one| Judged {
            with: [sum.with[0] + one.with[0], sum.with[1] + one.with[1]],
            without: [sum.without[0] + one.without[0], sum.without[1] + one.without[1]],
        })
    }

    let mut rows = vec![Row::ours("all kinds", cells(things.map(sum)))];
    let kinds = KINDS.iter().enumerate();
    rows.extend(kinds.map(|(at, kind)| Row::ours(kind.name(), cells(things.map(|of| of[at])))));
    // Each model is tested on each person, so that the sums count people once per kind.
    let times = KINDS.len() as u64;
    let mut of_people: Vec<Cell> = cells(*people);
    of_people[0] = Cell::number((people[0].with[0] / times) as f64, 0);
    rows.push(Row::ours("people", of_people));
    let columns = VERIFIERS.iter().flat_map(|(name, ..)| {
        ["trained without this kind", "trained with all"]
            .map(|how| format!("{name} {how}: removed %"))
    });
    Page {
        title: "Things of a kind that no model has seen: sightings removed".into(),
        columns: std::iter::once("sightings".to_owned()).chain(columns).collect(),
        rows,
        notes: vec![
            format!(
                "Fitted to {persons} proposals of people and {others} of others in {} simulated stereo \
                 scenes of the split `train`, judged in {} of `test`; Wilson intervals, over \
                 sightings",
                2 * seeds * ROOMS.len() as u64,
                seeds * ROOMS.len() as u64
            ),
            "Sightings are those that the detector of `stereo-verified` believes. People: rejected \
             by the models without a kind, all together, and by the one with all."
                .into(),
            "`svm-patch` with gamma 2 and penalty 3, `color-texture` with 200 trees and asked as \
             in `stereo-verified`: fewer scenes than the shipped models have seen. `body-net`, \
             twenty minutes a model, is left out."
                .into(),
        ],
    }
}

/// A labelled candidate of the detector.
pub(super) struct LabelledCandidate<'a> {
    pub(super) detection: &'a Detection,
    pub(super) is_person: bool,
    /// Furniture at the position of a candidate that is not a person.
    pub(super) thing: Option<&'static str>,
    pub(super) is_believed: bool,
    pub(super) group: u64,
}

/// Callback for each candidate.
pub(super) type See<'a> =
    &'a mut dyn FnMut(&Frame, &LabelledCandidate<'_>) -> Result<(), ReproduceError>;

/// Runs the detector on `seeds` draws of each room of a split.
pub(super) fn visit(
    lab: &Lab,
    split: Split,
    seeds: u64,
    detects: &Contender,
    see: See<'_>,
) -> Result<(), ReproduceError> {
    lab.progress.begin(seeds as usize * ROOMS.len(), "rooms full of furniture");
    for (name, set) in ROOMS {
        for scene in lab.scenes_of(split, name, set, seeds)? {
            in_scene(lab, &scene, detects, see)?;
            lab.progress.step();
        }
    }
    Ok(())
}

fn in_scene(
    lab: &Lab,
    scene: &Scene,
    detects: &Contender,
    see: See<'_>,
) -> Result<(), ReproduceError> {
    let mut pipeline: Pipeline = detects.pipeline(lab.registry, 1)?;
    let mut stereo =
        StereoDepth::new(variants::stereo_settings(detects)?).map_err(ReproduceError::other)?;
    let mut draw = Draw::new(scene, lab.jobs);
    let furniture: Vec<Furniture> = draw.simulation().furniture().to_vec();
    while let Some(simulated) = draw.next_frame() {
        let depth = stereo
            .depth(&simulated.frame, &mut Funnel::default())
            .map_err(ReproduceError::other)?;
        let frame = simulated.frame.with_depth(depth);
        let report = pipeline.step(&frame).map_err(ReproduceError::other)?;
        for candidate in &report.candidates {
            let detection = &candidate.detection;
            let Some(is_person) = is_person(detection, &simulated.truth) else { continue };
            let at = simulated.world_from_robot * detection.position.xy();
            let thing = (!is_person).then(|| what_stands_at(at, &furniture));
            let is_believed = !matches!(candidate.fate, Fate::Dropped(_));
            // Candidates of one scene share a group, which cross-validation does not split.
            see(
                &frame,
                &LabelledCandidate { detection, is_person, thing, is_believed, group: scene.seed },
            )?;
        }
    }
    Ok(())
}

fn is_person(detection: &Detection, people: &[Truth]) -> Option<bool> {
    match whose(detection, people) {
        Whose::Somebody => Some(true),
        Whose::Nobody => Some(false),
        Whose::Unclear => None,
    }
}

/// Returns the contender without verifiers and odometry.
pub(super) fn without_verifiers(contender: &Contender) -> Result<Contender, ReproduceError> {
    let mut config = variants::table(contender)?;
    config.retain(|key, _| key != "verifiers" && key != "odometry");
    Ok(Contender { config: config.to_string(), ..contender.clone() })
}

/// Returns a trainer with settings of the plugin, TOML.
pub(super) fn trainer(
    lab: &Lab,
    plugin: &str,
    settings: &str,
    seed: u64,
) -> Result<Box<dyn Trainer>, ReproduceError> {
    build(settings, seed, |value, context| lab.registry.build_trainer(plugin, Some(value), context))
}

/// Fits the models, and builds the verifiers with them.
pub(super) fn judges_of(
    lab: &Lab,
    plugin: &str,
    settings: &str,
    trainers: Vec<Box<dyn Trainer>>,
) -> Result<Vec<Box<dyn Verifier>>, ReproduceError> {
    let folder = tempfile::tempdir().map_err(ReproduceError::other)?;
    let mut judges = Vec::new();
    for (at, mut trainer) in trainers.into_iter().enumerate() {
        let fitted = trainer.fit(&mut |_| ()).map_err(ReproduceError::other)?;
        // A verifier reads its model from a file.
        let path = folder.path().join(format!("{at}.toml"));
        fs::write(&path, fitted.model).map_err(ReproduceError::other)?;
        let settings = format!("{settings}\nmodel = '{}'", path.display());
        judges.push(build(&settings, SEED, |value, context| {
            lab.registry.build_verifier(plugin, Some(value), context)
        })?);
        lab.progress.step();
    }
    Ok(judges)
}

fn build<T>(
    settings: &str,
    seed: u64,
    make: impl FnOnce(Value<'_>, &Context) -> Result<T, ConfigError>,
) -> Result<T, ReproduceError> {
    let table = DeTable::parse(settings).map_err(ReproduceError::other)?;
    let value = Spanned::new(table.span(), DeValue::Table(table.into_inner()));
    let wheels = DiffDrive { half_separation_m: 0.167, slip: 0.02 };
    make(value, &Context::new(seed, ".", wheels))
        .map_err(|error| ReproduceError::other(error.message))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn people_are_counted_once_and_kinds_add_up() {
        fn judged(with: [u64; 2], without: [u64; 2]) -> Judged {
            Judged { with, without }
        }

        let things = [[judged([10, 9], [10, 5]); KINDS.len()]; VERIFIERS.len()];
        let people = [judged([60, 6], [60, 12]); VERIFIERS.len()];
        let page = table(&things, &people, [3, 4], 2);
        for (row, values) in [(0, [60.0, 50.0, 90.0]), (page.rows.len() - 1, [10.0, 20.0, 10.0])] {
            let cells = &page.rows[row].cells;
            assert_eq!([0, 1, 2].map(|column| cells[column].value.unwrap()), values);
        }
        assert_eq!(page.rows.len(), KINDS.len() + 2);
        assert!(page.notes[0].contains("4 proposals of people and 3 of others in 12"));
    }
}
