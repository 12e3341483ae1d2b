//! Figure 5 and section 6.1: features, bearing, distance, models of persons.

use std::collections::{BTreeMap, BTreeSet};

use tagalong_omni_appearance::train::{Collector, Sample, Training, head};
use tagalong_omni_appearance::{Config, Distance, Head};
use tagalong_sim::{Scene, Truth};
use tagalong_trials::Draw;

use super::{BLOCK, IMAGES, alone, mean};
use crate::{Cell, Findings, Lab, ReproduceError, Row, Table};

/// Random splits.
const REPEATS: u64 = 10;
/// Part of the samples that is used for training.
const TRAINING_PART: f64 = 0.3;
/// Seeds of `omni-strangers`: two people each.
const STRANGERS: u64 = 4;
/// Images of each of them.
const STRANGER_IMAGES: usize = IMAGES / 3;

const WAYS: [(&str, Distance); 4] = [
    ("network 3-4-1", Distance::Network),
    ("ridge", Distance::Ridge),
    ("analytic", Distance::Analytic),
    ("network of all features", Distance::Rich),
];

/// What the detector sees of the person in a scene.
fn samples(lab: &Lab, scene: &Scene, person: u64) -> Result<Vec<Sample>, ReproduceError> {
    let failed = |error: tagalong_core::Error| ReproduceError::Other(error.to_string());
    let mut collector = Collector::new(Config::default()).map_err(failed)?;
    let mut draw = Draw::new(scene, lab.jobs);
    while let Some(drawn) = draw.next_frame() {
        let seen = |truth: &&Truth| !truth.ignore;
        let people: Vec<_> =
            drawn.truth.iter().filter(seen).map(|truth| (person, truth.head_in_robot)).collect();
        collector.add(&drawn.frame, &people).map_err(failed)?;
    }
    lab.progress.step();
    Ok(collector.samples)
}

pub(super) fn appearance(lab: &Lab) -> Result<Findings, ReproduceError> {
    let known = alone(lab, "omni-room", 1, IMAGES)?;
    let seeds = lab.seeds(STRANGERS).min(STRANGERS);
    let strangers = alone(lab, "omni-strangers", seeds, STRANGER_IMAGES)?;
    lab.progress.begin(known.len() + strangers.len(), "drawing the room");
    let mut persons = Vec::new();
    for (number, scene) in known.iter().enumerate() {
        // Images of different persons are never neighbours.
        let mut own = samples(lab, scene, number as u64)?;
        own.iter_mut().for_each(|sample| sample.frame += 10_000 * number as u64);
        persons.push(own);
    }
    let unseen: Vec<Vec<Sample>> =
        strangers.iter().map(|scene| samples(lab, scene, 99)).collect::<Result<_, _>>()?;
    let all: Vec<Sample> = persons.iter().flatten().copied().collect();
    let tables =
        vec![distances(&all)?, correlations(&all)?, bearings(&all), of_persons(&persons, &unseen)?];
    Ok(Findings { tables, pictures: Vec::new() })
}

/// Samples for training and for testing: 30 % of them, whole blocks or not.
fn divided(samples: &[Sample], block: u64, seed: u64) -> (Vec<Sample>, Vec<Sample>) {
    let mut keys: Vec<u64> = samples.iter().map(|s| s.frame / block).collect();
    keys.dedup();
    let mut order: Vec<(u64, u64)> =
        keys.iter().map(|key| (tagalong_learn::mix(key ^ (seed << 40)), *key)).collect();
    order.sort_unstable();
    let count = (TRAINING_PART * order.len() as f64).round() as usize;
    let chosen: BTreeSet<u64> = order.iter().take(count).map(|(_, key)| *key).collect();
    samples.iter().partition(|s| chosen.contains(&(s.frame / block)))
}

fn fitted(samples: &[Sample], seed: u64) -> Result<Head, ReproduceError> {
    head(samples, &Training::default(), seed)
        .map_err(|error| ReproduceError::Other(error.to_string()))
}

fn errors(samples: &[Sample], head: &Head, how: Distance) -> Vec<f64> {
    samples.iter().map(|s| (s.distance(head, how) - s.distance_m).abs()).collect()
}

/// Section 6.1, the first table.
fn distances(all: &[Sample]) -> Result<Table, ReproduceError> {
    let published = |mean, deviation| Cell { deviation: Some(deviation), ..Cell::number(mean, 3) };
    let mut rows = vec![Row::published(
        "network 3-4-1, random split",
        vec![published(0.126, 0.167), published(0.110, 0.099), published(0.163, 0.325)],
    )];
    for (split, block) in [("random split", 1), ("block split", BLOCK)] {
        let mut repeats: BTreeMap<&str, Vec<Vec<f64>>> = BTreeMap::new();
        for seed in 0..REPEATS {
            let (training, test) = divided(all, block, seed);
            let head = fitted(&training, seed)?;
            for (name, how) in WAYS {
                repeats.entry(name).or_default().push(errors(&test, &head, how));
            }
        }
        for (name, _) in WAYS {
            let mut runs = repeats.remove(name).unwrap_or_default();
            runs.sort_by(|a, b| mean(a).total_cmp(&mean(b)));
            let cells = [Some(runs.concat()), runs.first().cloned(), runs.last().cloned()];
            let cells = cells.map(|run| Cell::mean(&run.unwrap_or_default(), 3));
            rows.push(Row::ours(format!("{name}, {split}"), cells.to_vec()));
        }
    }
    Ok(Table {
        title: "Error of the distance, m: mean and deviation (P5, section 6.1)".into(),
        columns: ["average", "best", "worst"].map(String::from).to_vec(),
        rows,
        notes: vec![
            format!(
                "{} samples; {REPEATS} times 30 % for training, the rest for testing",
                all.len()
            ),
            "A random split has near-duplicates of its training images among the test images; \
             a block split keeps 5 s together."
                .into(),
            "The average is over all errors of all repeats.".into(),
        ],
    })
}

/// Fig. 5, whose values are lost.
fn correlations(all: &[Sample]) -> Result<Table, ReproduceError> {
    let (training, test) = divided(all, BLOCK, 0);
    let head = fitted(&training, 0)?;
    let truth: Vec<f64> = test.iter().map(|s| s.distance_m).collect();
    let of = |name: &str, value: &dyn Fn(&Sample) -> f64| {
        let values: Vec<f64> = test.iter().map(value).collect();
        let cells = [pearson(&values, &truth), pearson(&ranks(&values), &ranks(&truth))];
        Row::ours(name, cells.map(|r| Cell::number(r, 3)).to_vec())
    };
    Ok(Table {
        title: "Correlation with the true distance (P5, Fig. 5)".into(),
        columns: ["Pearson", "Spearman"].map(String::from).to_vec(),
        rows: vec![
            of("feature 1, width", &|s| s.features.width),
            of("feature 2, lower edge", &|s| s.features.bottom),
            of("feature 3, pixels", &|s| s.features.pixels),
            of("network 3-4-1", &|s| s.distance(&head, Distance::Network)),
        ],
        notes: vec!["Test samples of one block split; the paper's values are lost.".into()],
    })
}

fn pearson(a: &[f64], b: &[f64]) -> f64 {
    let (ma, mb) = (mean(a), mean(b));
    let product = |x: &[f64], mx: f64, y: &[f64], my: f64| {
        x.iter().zip(y).map(|(x, y)| (x - mx) * (y - my)).sum::<f64>()
    };
    product(a, ma, b, mb) / (product(a, ma, a, ma) * product(b, mb, b, mb)).sqrt()
}

/// Ranks; what is equal shares the mean of its ranks.
fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
    let mut ranks = vec![0.0; values.len()];
    let mut first = 0;
    for ties in order.chunk_by(|a, b| values[*a] == values[*b]) {
        let rank = first as f64 + 0.5 * (ties.len() as f64 - 1.0);
        ties.iter().for_each(|at| ranks[*at] = rank);
        first += ties.len();
    }
    ranks
}

fn bearings(all: &[Sample]) -> Table {
    let degrees: Vec<f64> = all.iter().map(|s| s.bearing_error_rad().to_degrees()).collect();
    let published = Cell { deviation: Some(1.60), ..Cell::number(2.01, 2) };
    Table {
        title: "Error of the bearing, degrees (P5, section 4.2)".into(),
        columns: vec!["mean".into()],
        rows: vec![
            Row::published("mean of the column histogram", vec![published]),
            Row::ours("circular mean, shadows left out", vec![Cell::mean(&degrees, 2)]),
        ],
        notes: vec![
            "The mount is off by up to 0.4 degrees about each axis, the centre of the mirror by \
             a third of a pixel, and the detector does not know."
                .into(),
        ],
    }
}

/// Section 6.1, the second table, and people whom no model knows.
fn of_persons(persons: &[Vec<Sample>], unseen: &[Vec<Sample>]) -> Result<Table, ReproduceError> {
    let parts: Vec<_> = persons.iter().map(|own| divided(own, BLOCK, 0)).collect();
    let mut heads = Vec::new();
    for (training, _) in &parts {
        heads.push(fitted(training, 0)?);
    }
    let both: Vec<Sample> = parts.iter().flat_map(|(training, _)| training).copied().collect();
    heads.push(fitted(&both, 0)?);
    let row = |name: String, test: &[Sample]| {
        let cell = |head| Cell::mean(&errors(test, head, Distance::Network), 3);
        Row::ours(name, heads.iter().map(cell).collect())
    };
    let published = |name, cells: [[f64; 2]; 2]| {
        let cells = cells.map(|[m, d]| Cell { deviation: Some(d), ..Cell::number(m, 3) });
        Row::published(name, cells.into_iter().chain([Cell::default()]).collect())
    };
    let mut rows = vec![
        published("person 1", [[0.096, 0.074], [0.133, 0.126]]),
        published("person 2", [[0.231, 0.276], [0.117, 0.111]]),
    ];
    for (number, (_, test)) in parts.iter().enumerate() {
        rows.push(row(format!("person {}", number + 1), test));
    }
    for (number, test) in unseen.iter().enumerate() {
        rows.push(row(format!("stranger {}", number + 1), test));
    }
    rows.push(row("all strangers".into(), &unseen.concat()));
    Ok(Table {
        title: "Error of the distance by models of persons, m (P5, section 6.1)".into(),
        columns: ["model 1", "model 2", "both"].map(String::from).to_vec(),
        rows,
        notes: vec![
            "Network 3-4-1; 30 % of the blocks of 5 s for training, the others for testing. \
             Strangers are all for testing."
                .into(),
        ],
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn correlations_are_those_of_the_definition() {
        let (a, b) = ([1.0, 2.0, 3.0, 4.0], [1.0, 4.0, 9.0, 16.0]);
        assert!((pearson(&a, &b) - 0.984_374_038_697_6).abs() < 1e-9);
        assert!((pearson(&ranks(&a), &ranks(&b)) - 1.0).abs() < 1e-12);
        assert_eq!(ranks(&[5.0, 1.0, 5.0, 0.0]), [2.5, 1.0, 2.5, 0.0]);
    }
}
