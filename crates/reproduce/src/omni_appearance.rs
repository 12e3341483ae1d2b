//! P5: a person in the panorama of a conical mirror, the distance learned, and a
//! Kalman filter on the floor plan.

use std::collections::BTreeMap;

use nalgebra::{Point2, Vector2, Vector3};
use tagalong_core::{Camera, Lens};
use tagalong_eval::Bootstrap;
use tagalong_omni_appearance::train::{Collector, Sample, Training, head};
use tagalong_omni_appearance::{Config, Distance, Head};
use tagalong_sim::{Event, Scene, Simulation, Truth};
use tagalong_trials::{Contender, Draw, Trial, TrialError};
use tagalong_triangulate::{Cameras, HatColour, Known, Sight, Station, calibrate, find_hat};

use crate::{Cell, Experiment, Findings, Lab, ReproduceError, Row, System, Table};

/// The system.
pub const SYSTEM: System = System {
    name: "omni-appearance",
    about: "P5: a person in a conical mirror, the distance by a network, a Kalman filter",
    experiments: &[
        Experiment {
            name: "calibration",
            about: "section 3: four webcams that see a hat, calibrated by known places",
            run: calibration,
        },
        Experiment {
            name: "appearance",
            about: "Fig. 5 and section 6.1: features, bearing, distance, models of persons",
            run: appearance,
        },
        Experiment {
            name: "kalman",
            about: "section 6.2: the filter against the appearance model alone",
            run: kalman,
        },
    ],
};

/// Images of one person; two persons are the 684 of the paper.
const IMAGES: usize = 342;
/// The room is empty for so long, s.
const EMPTY_S: f64 = 10.0;
/// Random splits.
const REPEATS: u64 = 10;
/// Part of the samples that is used for training.
const TRAINING_PART: f64 = 0.3;
/// Images of a block, 5 s.
const BLOCK: u64 = 15;
/// Seeds of `omni-strangers`: two people each.
const STRANGERS: u64 = 4;

const WAYS: [(&str, Distance); 4] = [
    ("network 3-4-1", Distance::Network),
    ("ridge", Distance::Ridge),
    ("analytic", Distance::Analytic),
    ("network of all features", Distance::Rich),
];

/// Scenes with one person each, long enough for the images.
fn alone(lab: &Lab, name: &str, seeds: u64) -> Result<Vec<Scene>, ReproduceError> {
    let images = if lab.quick { IMAGES / 6 } else { IMAGES };
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

fn appearance(lab: &Lab) -> Result<Findings, ReproduceError> {
    let known = alone(lab, "omni-room", 1)?;
    let strangers = alone(lab, "omni-strangers", lab.seeds(STRANGERS).min(STRANGERS))?;
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
    let chosen: std::collections::BTreeSet<u64> =
        order.iter().take(count).map(|(_, key)| *key).collect();
    samples.iter().partition(|s| chosen.contains(&(s.frame / block)))
}

fn fitted(samples: &[Sample], seed: u64) -> Result<Head, ReproduceError> {
    let training = Training { restarts: 3, rich_epochs: 2000, ..Training::default() };
    head(samples, &training, seed).map_err(|error| ReproduceError::Other(error.to_string()))
}

fn errors(samples: &[Sample], head: &Head, how: Distance) -> Vec<f64> {
    samples.iter().map(|s| (s.distance(head, how) - s.distance_m).abs()).collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
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

/// The filters of section 6.2, and what `u` may be.
const FILTERS: [(&str, &str); 6] = [
    ("appearance model alone", "plugin = \"last-seen\""),
    (
        "printed Q and R, u = 0",
        "plugin = \"floor-kalman\"\nconfig = { form = \"still\", measurement = \"fixed\" }",
    ),
    (
        "printed Q and R, u the last difference, without its noise",
        "plugin = \"floor-kalman\"\nconfig = { form = \"last-difference\", \
         measurement = \"fixed\", compat_printed_u = true }",
    ),
    (
        "printed Q and R, u the last difference",
        "plugin = \"floor-kalman\"\nconfig = { form = \"last-difference\", \
         measurement = \"fixed\" }",
    ),
    ("four states, polar noise", "plugin = \"floor-kalman\"\nconfig = { measurement = \"polar\" }"),
    ("four states, the detection's noise", "plugin = \"floor-kalman\""),
];

/// Errors of all filters in the images in which all of them have an answer.
struct Walk {
    errors: Vec<Vec<f64>>,
}

fn kalman(lab: &Lab) -> Result<Findings, ReproduceError> {
    let scenes = alone(lab, "omni-room", 1)?;
    let mut tables = Vec::new();
    for (title, distance) in [("network 3-4-1", "network"), ("network of all features", "rich")] {
        let contenders: Vec<Contender> = FILTERS
            .iter()
            .map(|(name, filter)| Contender {
                folder: lab.configs.clone(),
                ..Contender::new(*name, config(distance, filter))
            })
            .collect();
        let walks = lab.trials("walking about the room", &scenes, &contenders, walk)?;
        tables.push(filters(title, &walks));
    }
    Ok(Findings { tables, pictures: Vec::new() })
}

fn config(distance: &str, filter: &str) -> String {
    format!(
        "[[detectors]]\nplugin = \"omni-appearance\"\nconfig = {{ distance = \"{distance}\" }}\n\
         [filter]\n{filter}\n"
    )
}

fn walk(trial: Trial) -> Result<Walk, TrialError> {
    let mut errors = vec![Vec::new(); trial.runs.len()];
    for (at, moment) in trial.moments.iter().enumerate() {
        let Some(truth) = moment.truth.first().filter(|truth| !truth.ignore) else { continue };
        let error = |run: &tagalong_trials::Run| {
            let seen = run.reports[at].tracks.iter().filter(|track| track.seen);
            let off = |track: &tagalong_core::Track| {
                (track.estimate.person.position - truth.head_in_robot).xy().norm()
            };
            seen.map(off).min_by(f64::total_cmp)
        };
        let all: Option<Vec<f64>> = trial.runs.iter().map(error).collect();
        for (errors, error) in errors.iter_mut().zip(all.into_iter().flatten()) {
            errors.push(error);
        }
    }
    Ok(Walk { errors })
}

/// Section 6.2, with the gain over the first row by a bootstrap of blocks.
fn filters(title: &str, walks: &[Walk]) -> Table {
    let published = |mean, deviation| Cell { deviation: Some(deviation), ..Cell::number(mean, 3) };
    let mut rows = vec![
        Row::published("appearance model", vec![published(0.154, 0.094), Cell::default()]),
        Row::published("with Kalman filter", vec![published(0.145, 0.092), Cell::default()]),
    ];
    let blocks = |filter: usize| -> Vec<f64> {
        let of_walk = |walk: &Walk| {
            walk.errors[filter].chunks(BLOCK as usize).map(mean).collect::<Vec<f64>>()
        };
        walks.iter().flat_map(of_walk).collect()
    };
    for (at, (name, _)) in FILTERS.iter().enumerate() {
        let all: Vec<f64> = walks.iter().flat_map(|walk| walk.errors[at].clone()).collect();
        let gain = Bootstrap::default().paired(&blocks(0), &blocks(at));
        let gain = gain.filter(|_| at > 0).map(|gain| gain.difference);
        rows.push(Row::ours(*name, vec![Cell::mean(&all, 3), Cell::estimate(gain, 3)]));
    }
    let images = walks.iter().map(|walk| walk.errors[0].len()).sum::<usize>();
    Table {
        title: format!("Error of the position with the {title}, m (P5, section 6.2)"),
        columns: ["error", "difference to the model alone"].map(String::from).to_vec(),
        rows,
        notes: vec![
            format!(
                "{images} images of two walks; the shipped model, fitted to another draw of this scene"
            ),
            "Differences are paired, by a bootstrap of blocks of 5 s: neighbouring images are not \
             independent, as the paper's t-test takes them to be."
                .into(),
        ],
    }
}

/// How far off the first guess of a webcam is: m, rad, and part of the focal length.
const GUESS: (f64, f64, f64) = (0.3, 0.08, 0.1);

/// Places of a hat that are known, and what the webcams saw.
fn hats(lab: &Lab, scene: &Scene) -> (Vec<Station>, Vec<Known>) {
    let mut simulation = Simulation::new(scene, lab.jobs);
    let stations: Vec<Station> = simulation.webcams().filter_map(station).collect();
    let (mut known, mut sights): (Vec<Known>, BTreeMap<u64, Vec<Sight>>) =
        (Vec::new(), BTreeMap::new());
    let mut places: BTreeMap<u64, Point2<f64>> = BTreeMap::new();
    while let Some(event) = simulation.next_event() {
        match event {
            Event::Shot(shot) => {
                if let [person] = &shot.truth[..] {
                    let place = shot.world_from_robot * person.head_in_robot.xy();
                    places.insert(shot.captured_ns, place);
                }
            }
            Event::Webcam(shot) => {
                let hat = find_hat(&shot.image, &HatColour::default()).filter(|hat| !hat.cut);
                let sight = hat.map(|hat| Sight { station: shot.webcam, pixel: hat.centre });
                sights.entry(shot.captured_ns).or_default().extend(sight);
            }
            Event::Odometry(_) => {}
        }
    }
    for (at, sights) in sights {
        known.extend(places.get(&at).map(|place| Known { place: *place, sights }));
    }
    (stations, known)
}

fn station(camera: &Camera) -> Option<Station> {
    let Lens::Pinhole(lens) = &camera.lens else { return None };
    let looks = camera.robot_from_camera.rotation * Vector3::z();
    Some(Station {
        at: camera.robot_from_camera.translation.vector.xy().into(),
        heading_rad: looks.y.atan2(looks.x),
        pitch_down_rad: -looks.z.asin(),
        focal_px: lens.fx,
        centre_px: Point2::new(lens.cx, lens.cy),
    })
}

/// A guess that is off, each webcam otherwise.
fn guessed(truth: &[Station]) -> Vec<Station> {
    let (metres, radians, part) = GUESS;
    let sign = |number: usize, bit: usize| if (number >> bit) & 1 == 0 { 1.0 } else { -1.0 };
    let off = |(number, station): (usize, &Station)| Station {
        at: station.at + Vector2::new(sign(number, 0), sign(number, 1)) * metres,
        heading_rad: station.heading_rad + sign(number, 1) * radians,
        pitch_down_rad: station.pitch_down_rad + sign(number, 0) * radians,
        focal_px: station.focal_px * (1.0 + sign(number, 0) * part),
        ..*station
    };
    truth.iter().enumerate().map(off).collect()
}

/// Distances of measured from known places, cm.
fn distances_to(stations: &[Station], known: &[Known]) -> Vec<f64> {
    let cameras = Cameras::new(stations.to_vec());
    cameras.distances_m(known).iter().map(|m| 100.0 * m).collect()
}

/// Section 3.
fn calibration(lab: &Lab) -> Result<Findings, ReproduceError> {
    let mut scenes = lab.scenes("omni-hat", &[("duration_s", "60.0")], 1)?;
    let Some(scene) = scenes.first_mut() else { return Ok(Findings::default()) };
    // The robot's own camera is of no importance here.
    (scene.camera.width, scene.camera.height) = (16, 16);
    lab.progress.begin(1, "looking at a hat");
    let (truth, known) = hats(lab, scene);
    lab.progress.step();
    let every =
        |part: usize| -> Vec<Known> { known.iter().skip(part).step_by(2).cloned().collect() };
    let (used, held) = (every(0), every(1));
    let guess = guessed(&truth);
    let found = calibrate(&guess, &used).stations;
    let row = |name: &str, stations: &[Station]| {
        let cells = [&used, &held].map(|known| Cell::mean(&distances_to(stations, known), 1));
        Row::ours(name, cells.to_vec())
    };
    let table = Table {
        title: "Measured from known places of the hat, cm (P5, section 3)".into(),
        columns: ["calibrated with", "held out"].map(String::from).to_vec(),
        rows: vec![
            Row::published("\"in the order of\"", vec![Cell::number(1.0, 0), Cell::default()]),
            row("first guess", &guess),
            row("calibrated", &found),
            row("true cameras", &truth),
        ],
        notes: vec![format!(
            "{} places of somebody who walks; four webcams of 320x240; the first guess is off by \
             {} m each way, {:.0} degrees and {:.0} % of the focal length",
            known.len(),
            GUESS.0,
            GUESS.1.to_degrees(),
            100.0 * GUESS.2
        )],
    };
    Ok(table.into())
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

    #[test]
    fn every_filter_is_a_config() {
        for (_, filter) in FILTERS {
            let text = config("rich", filter);
            assert!(toml::from_str::<toml::Table>(&text).is_ok(), "{text}");
        }
    }
}
