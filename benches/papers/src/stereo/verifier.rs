//! P4, Table I and P1, Fig. 5: false detections that a verifier removes, and people that it
//! rejects.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Point2;
use tagalong_core::{Detection, Track};
use tagalong_pipeline::{Fate, FrameReport};
use tagalong_report::{Cell, Row, Table};
use tagalong_sim::{Furniture, FurnitureKind, Truth};
use tagalong_trials::{Moment, Trial, TrialError};

use super::STEREO;
use crate::findings::Findings;
use crate::lab::{Lab, ReproduceError};
use crate::real::{self, NOT_TRAINED_ON, TRAINED_ON};

/// A title, a scene, and its settings.
type Sequence = (&'static str, &'static str, &'static [(&'static str, &'static str)]);

/// Sequences with no, one and two people among objects that resemble people.
const SEQUENCES: [Sequence; 3] = [
    ("no person", "empty-clutter", &[STEREO, ("duration_s", "8")]),
    ("one person", "turntable", &[STEREO, ("duration_s", "8"), ("room.clutter", "9")]),
    ("two people", "square-walk", &[STEREO, ("duration_s", "10"), ("room.clutter", "9")]),
];
/// Pipelines without a verifier, with P4's, and with the better one.
const PIPELINES: [&str; 3] = ["stereo-ekf", "stereo-svm-ekf", "stereo-verified"];

/// Logs of real rooms, first those in which no shipped verifier was trained.
const REAL: [(&str, &[&str]); 2] =
    [("real rooms not trained on", &NOT_TRAINED_ON), ("real rooms trained on", &TRAINED_ON)];
/// The detector of `depth-ekf`, with verifiers by the config that has them.
const REAL_VERIFIERS: [(&str, Option<&str>); 5] = [
    ("depth-ekf", None),
    ("with the verifier of stereo-svm-ekf-as-printed", Some("stereo-svm-ekf-as-printed")),
    ("with the verifier of stereo-svm-ekf", Some("stereo-svm-ekf")),
    ("with the verifier of depth-color-ekf", Some("depth-color-ekf")),
    ("with the verifiers of stereo-verified", Some("stereo-verified")),
];

/// Note on the rows of real rooms.
const REAL_ROOMS: &str = "Real rooms: annotated logs of colour and depth images, left out \
    where they are not there. `svm-patch`, `color-texture` and `body-net` were trained in simulated \
    rooms and in the logs `filinha` and `um`, the verifier as printed in simulated rooms alone.";

/// Largest distance on the floor at which a detection belongs to a person, m, ...
const SAME_M: f64 = 0.5;
/// ... least overlap (IoU) with head and shoulders, which excludes an arm; ...
const SAME_OVERLAP: f64 = 0.4;
/// ... and least distance to every person of a false detection, m.
const NOBODY_M: f64 = 0.9;
/// Largest distance on the floor at which a detection belongs to a piece of furniture, m.
const FURNITURE_M: f64 = 0.6;

/// Furniture that is simulated with the silhouette of a person.
const LOOK_ALIKES: [FurnitureKind; 6] = [
    FurnitureKind::BinOnTable,
    FurnitureKind::CardboardFigure,
    FurnitureKind::CoatStand,
    FurnitureKind::DrapedChair,
    FurnitureKind::FloorLamp,
    FurnitureKind::Plant,
];

/// Results of one pipeline on one scene, or on many.
#[derive(Clone, Debug, Default)]
struct Tally {
    frames: u64,
    /// False detections that the detector accepts, and of these rejected.
    nobody: [u64; 2],
    /// The same by the object at the position.
    things: BTreeMap<&'static str, [u64; 2]>,
    /// The same of detections of people.
    people: [u64; 2],
    false_tracks: u64,
    false_track_frames: u64,
    /// People times frames with a confirmed track without the verifier, and of these without one
    /// with it.
    covered: [u64; 2],
    /// People with a confirmed track at any time without the verifier, and of these without one at
    /// any time with it.
    tracked: [u64; 2],
}

/// Compares detections and tracks without a verifier and with one.
pub fn verifier(lab: &Lab) -> Result<Findings, ReproduceError> {
    let contenders = lab.contenders(&PIPELINES)?;
    let (mut sightings, mut tracks) = real_rooms(lab)?;
    let published = [f64::NAN, 100.0, 6.0].map(|number| Cell::number(number, 0));
    sightings.push(Row::published("three sequences, counts lost", published.to_vec()));
    let mut everything = vec![Tally::default(); PIPELINES.len()];
    let mut scenes_simulated = 0;
    for (name, scene, set) in SEQUENCES {
        let scenes = lab.scenes(scene, set, lab.seeds(50))?;
        scenes_simulated += scenes.len();
        let all = lab.trials(name, &scenes, &contenders, tallies)?;
        let mut tallies = vec![Tally::default(); PIPELINES.len()];
        for trial in &all {
            tallies.iter_mut().zip(trial).for_each(|(sum, one)| sum.add(one));
        }
        everything.iter_mut().zip(&tallies).for_each(|(sum, one)| sum.add(one));
        let name = format!("simulated, {name}");
        sightings.extend(rows(&name, &PIPELINES, &tallies, Tally::sighting_cells));
        tracks.extend(rows(&name, &PIPELINES, &tallies, Tally::track_cells));
    }
    sightings.extend(rows("simulated, all", &PIPELINES, &everything, Tally::sighting_cells));
    tracks.extend(rows("simulated, all", &PIPELINES, &everything, Tally::track_cells));
    let simulated =
        format!("{scenes_simulated} simulated stereo scenes that nothing was trained on; Wilson");
    let tables = vec![
        sightings_table(sightings, &simulated),
        things_table(&everything),
        tracks_table(tracks, &simulated),
    ];
    Ok(Findings { tables, pictures: Vec::new() })
}

/// Returns the rows of detections and of tracks in real rooms.
fn real_rooms(lab: &Lab) -> Result<(Vec<Row>, Vec<Row>), ReproduceError> {
    let names = REAL_VERIFIERS.map(|(name, _)| name);
    let contenders = REAL_VERIFIERS
        .iter()
        .map(|(name, of)| real::contender(lab, name, *of))
        .collect::<Result<Vec<_>, _>>()?;
    let mut sightings = Vec::new();
    let mut tracks = Vec::new();
    for (rooms, logs) in REAL {
        lab.progress.begin(logs.len(), rooms);
        let mut sums = vec![Tally::default(); names.len()];
        for log in logs {
            let Some(trial) = real::trial(lab, log, &contenders)? else { continue };
            sums.iter_mut().zip(tallies(trial)?).for_each(|(sum, one)| sum.add(&one));
            lab.progress.step();
        }
        if sums[0].frames > 0 {
            sightings.extend(rows(rooms, &names, &sums, Tally::sighting_cells));
            tracks.extend(rows(rooms, &names, &sums, Tally::track_cells));
        }
    }
    Ok((sightings, tracks))
}

fn rows(
    name: &str,
    pipelines: &[&str],
    tallies: &[Tally],
    cells: fn(&Tally, &Tally) -> Vec<Cell>,
) -> Vec<Row> {
    pipelines
        .iter()
        .zip(tallies)
        .map(|(pipeline, tally)| {
            Row::ours(format!("{name}, {pipeline}"), cells(tally, &tallies[0]))
        })
        .collect()
}

fn sightings_table(rows: Vec<Row>, simulated: &str) -> Table {
    let columns = ["false sightings a frame", "false ones removed %", "people's rejected %"];
    Table {
        title: "Single sightings: what the verifier rejects (P4, Table I; P1, Fig. 5)".into(),
        columns: columns.map(str::to_owned).to_vec(),
        rows,
        notes: vec![
            format!("{simulated} intervals take sightings as independent: they are too narrow"),
            REAL_ROOMS.into(),
            "False sightings a frame: before the verifier. People's: of head and shoulders; \
             an arm is neither."
                .into(),
        ],
    }
}

/// Builds the table of false detections by object.
fn things_table(tallies: &[Tally]) -> Table {
    let kinds: BTreeSet<&str> =
        tallies.iter().flat_map(|tally| tally.things.keys().copied()).collect();
    let removed = PIPELINES[1..].iter().map(|name| format!("{name}: removed %"));
    let rows = kinds.into_iter().map(|kind| {
        let mut counts =
            tallies.iter().map(|tally| tally.things.get(kind).copied().unwrap_or_default());
        let before = counts.next().unwrap_or_default();
        let before = Cell::number(before[0] as f64, 0);
        Row::ours(kind, std::iter::once(before).chain(counts.map(share)).collect())
    });
    Table {
        title: "False sightings by what stands there".into(),
        columns: std::iter::once(format!("{}: sightings", PIPELINES[0])).chain(removed).collect(),
        rows: rows.collect(),
        notes: vec![
            format!(
                "Shaped to be taken for people: {}.",
                LOOK_ALIKES.map(FurnitureKind::name).join(", ")
            ),
            "Wilson intervals take sightings as independent: they are too narrow.".into(),
        ],
    }
}

fn tracks_table(rows: Vec<Row>, simulated: &str) -> Table {
    let columns = [
        "false tracks",
        "their frames",
        "false frames removed %",
        "people never tracked %",
        "tracked people's frames lost %",
    ];
    Table {
        title: "Confirmed tracks: what the verifier is worth over time".into(),
        columns: columns.map(str::to_owned).to_vec(),
        rows,
        notes: vec![
            format!(
                "{simulated} intervals take people and frames as independent: they are too narrow"
            ),
            REAL_ROOMS.into(),
            "Lost: had a track in the same frame without the verifier.".into(),
        ],
    }
}

fn tallies(trial: Trial) -> Result<Vec<Tally>, TrialError> {
    let mut covers: Vec<Vec<BTreeSet<u16>>> = Vec::new();
    for run in &trial.runs {
        let both = trial.moments.iter().zip(&run.reports);
        covers.push(both.map(|(moment, report)| covered(moment, report)).collect());
    }
    let tallies = (0..trial.runs.len()).map(|run| {
        let mut tally = Tally::default();
        let mut false_tracks = BTreeSet::new();
        for (moment, report) in trial.moments.iter().zip(&trial.runs[run].reports) {
            tally.frame(moment, report, &trial.furniture, &mut false_tracks);
        }
        tally.false_tracks = false_tracks.len() as u64;
        tally.compare(&covers[0], &covers[run]);
        tally
    });
    Ok(tallies.collect())
}

impl Tally {
    fn frame(
        &mut self,
        moment: &Moment,
        report: &FrameReport,
        furniture: &[Furniture],
        false_tracks: &mut BTreeSet<u32>,
    ) {
        self.frames += 1;
        for candidate in &report.candidates {
            let rejected = match candidate.fate {
                // The manager drops by `doubt` at positions where verifiers have rejected
                // candidates before.
                Fate::Dropped("verifier" | "doubt") => true,
                Fate::Dropped(_) => continue,
                Fate::Matched(_) | Fate::Started(_) => false,
            };
            let one = [1, u64::from(rejected)];
            match whose(&candidate.detection, &moment.truth) {
                Whose::Somebody => add(&mut self.people, one),
                Whose::Nobody => {
                    let at = moment.world_from_robot * candidate.detection.position.xy();
                    add(self.things.entry(what_stands_at(at, furniture)).or_default(), one);
                    add(&mut self.nobody, one);
                }
                Whose::Unclear => {}
            }
        }
        for track in report.tracks.iter().filter(|track| track.confirmed) {
            if moment.truth.iter().all(|truth| off_m(track, truth) > NOBODY_M) {
                self.false_track_frames += 1;
                false_tracks.insert(track.id.0);
            }
        }
    }

    fn compare(&mut self, plain: &[BTreeSet<u16>], own: &[BTreeSet<u16>]) {
        fn ever(frames: &[BTreeSet<u16>]) -> BTreeSet<u16> {
            frames.iter().flatten().copied().collect()
        }

        for (before, now) in plain.iter().zip(own) {
            self.covered[0] += before.len() as u64;
            self.covered[1] += before.difference(now).count() as u64;
        }
        let (before, now): (BTreeSet<u16>, BTreeSet<u16>) = (ever(plain), ever(own));
        self.tracked = [before.len() as u64, before.difference(&now).count() as u64];
    }

    fn add(&mut self, other: &Self) {
        let pairs = [
            (&mut self.nobody, other.nobody),
            (&mut self.people, other.people),
            (&mut self.covered, other.covered),
            (&mut self.tracked, other.tracked),
        ];
        pairs.into_iter().for_each(|(sum, one)| add(sum, one));
        for (thing, one) in &other.things {
            add(self.things.entry(thing).or_default(), *one);
        }
        self.frames += other.frames;
        self.false_tracks += other.false_tracks;
        self.false_track_frames += other.false_track_frames;
    }

    fn sighting_cells(&self, _: &Self) -> Vec<Cell> {
        let a_frame = self.nobody[0] as f64 / self.frames as f64;
        vec![Cell::number(a_frame, 3), share(self.nobody), share(self.people)]
    }

    fn track_cells(&self, plain: &Self) -> Vec<Cell> {
        let before = plain.false_track_frames;
        let removed = [before, before.saturating_sub(self.false_track_frames)];
        vec![
            Cell::number(self.false_tracks as f64, 0),
            Cell::number(self.false_track_frames as f64, 0),
            share(removed),
            share(self.tracked),
            share(self.covered),
        ]
    }
}

fn add(sum: &mut [u64; 2], one: [u64; 2]) {
    sum.iter_mut().zip(one).for_each(|(sum, one)| *sum += one);
}

/// Returns the second number as a share of the first.
pub fn share([of, count]: [u64; 2]) -> Cell {
    Cell::share(count, of, 1)
}

/// Label of a detection.
pub enum Whose {
    /// Head and shoulders of a person that counts.
    Somebody,
    /// No person is near.
    Nobody,
    /// Too near to a person to be false, and too far off to be true.
    Unclear,
}

/// Labels a detection by the truth.
pub fn whose(detection: &Detection, people: &[Truth]) -> Whose {
    let nearest = people
        .iter()
        .map(|truth| ((detection.position - truth.head_in_robot).xy().norm(), truth))
        .min_by(|a, b| a.0.total_cmp(&b.0));
    match nearest {
        None => Whose::Nobody,
        Some((off_m, _)) if off_m > NOBODY_M => Whose::Nobody,
        Some((off_m, truth)) if off_m <= SAME_M && overlaps(detection, truth) => Whose::Somebody,
        Some(_) => Whose::Unclear,
    }
}

/// Returns true if the person counts and the detection overlaps head and shoulders.
fn overlaps(detection: &Detection, truth: &Truth) -> bool {
    let both = truth.upper_body.zip(detection.rect());
    let overlap = both.map_or(0.0, |(region, seen)| region.iou(&seen));
    !truth.ignore && overlap >= SAME_OVERLAP
}

/// Returns the name of the furniture at a position in the world.
pub fn what_stands_at(at: Point2<f64>, furniture: &[Furniture]) -> &'static str {
    let nearest = furniture
        .iter()
        .map(|piece| ((at - Point2::from(piece.at)).norm(), piece))
        .min_by(|a, b| a.0.total_cmp(&b.0));
    match nearest {
        Some((off_m, piece)) if off_m <= FURNITURE_M => piece.kind.name(),
        _ => "anything else",
    }
}

fn off_m(track: &Track, truth: &Truth) -> f64 {
    (track.estimate.person.position - truth.head_in_robot).xy().norm()
}

/// Returns the people that count and have a confirmed track.
fn covered(moment: &Moment, report: &FrameReport) -> BTreeSet<u16> {
    let tracks: Vec<_> = report.tracks.iter().filter(|track| track.confirmed).collect();
    let people = moment.truth.iter().filter(|truth| !truth.ignore);
    let found = people.filter(|truth| tracks.iter().any(|track| off_m(track, truth) <= SAME_M));
    found.map(|truth| truth.id).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_had_a_track_without_the_verifier_is_lost_without_one_now() {
        fn set(ids: &[u16]) -> BTreeSet<u16> {
            ids.iter().copied().collect::<BTreeSet<u16>>()
        }

        let mut tally = Tally::default();
        tally.compare(&[set(&[1, 2]), set(&[1])], &[set(&[1]), set(&[1, 3])]);
        assert_eq!((tally.covered, tally.tracked), ([3, 1], [2, 1]));
        let mut sum = tally.clone();
        sum.add(&tally);
        assert_eq!((sum.covered, sum.tracked), ([6, 2], [4, 2]));
    }

    #[test]
    fn what_is_seen_is_the_nearest_thing_if_it_is_near() {
        fn piece(kind: FurnitureKind, x: f64) -> Furniture {
            Furniture { kind, at: [x, 0.0], heading_deg: 0.0 }
        }

        let stand = FurnitureKind::CoatStand;
        let lamp = FurnitureKind::FloorLamp;
        let furniture = [piece(stand, 3.0), piece(lamp, 4.0)];
        assert_eq!(what_stands_at(Point2::new(3.6, 0.0), &furniture), "floor lamp");
        assert_eq!(what_stands_at(Point2::new(3.0, 0.5), &furniture), "coat stand");
        assert_eq!(what_stands_at(Point2::new(3.0, 0.7), &furniture), "anything else");
        assert_eq!(what_stands_at(Point2::new(3.0, 0.5), &[]), "anything else");
    }

    #[test]
    fn shares_have_intervals() {
        let cell = share([100, 98]);
        assert_eq!(cell.value, Some(98.0));
        assert!(cell.interval.unwrap()[0] < 95.0);
        assert_eq!(share([0, 0]).value, None);
    }
}
