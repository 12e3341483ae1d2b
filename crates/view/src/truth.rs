//! Annotated people, and which of them each run missed.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{Isometry2, Point2};
use tagalong_app::missed::{Missed, Rules, Witness, find_missed, sentences_of};
use tagalong_app::outcome::Failure;
use tagalong_app::scoring::{
    Shots, TruthFile, TruthOptions, comparable, comparison, other_log_notes,
};
use tagalong_eval::{
    Clear, Event, EventKind, Frame, Prepared, Region, Report, Role, Sequence, Similarity, Truth,
    events,
};
use tagalong_geometry::Rect;

use crate::page::data::{EventData, FrameData, RunData, TruthBox};

/// Truth by frame of the page.
pub struct PageTruth {
    file: TruthFile,
    /// Indications that it is the truth of another log.
    pub signs: Vec<String>,
    /// People that are annotated in each frame.
    pub frames: Vec<Vec<TruthBox>>,
    /// The same people in the form for scoring.
    people: Vec<(Vec<Truth>, Vec<Region>)>,
}

impl PageTruth {
    /// Reads truth for the frames of a log.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn read(
        path: &Path,
        upper_body: bool,
        log_name: Option<&str>,
        shots: &Shots,
        stamps: &[u64],
    ) -> Result<Self, Failure> {
        let file = TruthFile::read(path, TruthOptions { upper_body, ..TruthOptions::default() })?;
        let signs = other_log_notes(path, &file, log_name, shots);
        let mut by_number = file.frames(shots);
        let by_stamp: BTreeMap<u64, (u32, Isometry2<f64>)> =
            shots.iter().map(|shot| (shot.stamp_ns, (shot.number, shot.odom_from_robot))).collect();
        let mut frames = Vec::new();
        let mut people = Vec::new();
        for stamp in stamps {
            let shot = by_stamp.get(stamp);
            let there = shot.and_then(|(number, _)| by_number.remove(number)).unwrap_or_default();
            let pose = shot.map_or_else(Isometry2::identity, |(_, pose)| *pose);
            frames.push(there.0.iter().map(|truth| shown(truth, &pose)).collect());
            people.push(there);
        }
        Ok(Self { file, frames, people, signs })
    }

    /// Returns true if any frame has a person.
    pub fn has_people(&self) -> bool {
        self.frames.iter().any(|frame| !frame.is_empty())
    }

    /// Matches a run with the truth, and adds its hits and its misses with their causes.
    ///
    /// # Errors
    /// A sentence on truth that contradicts itself.
    pub fn judge(
        &self,
        times: &[f64],
        size: [usize; 2],
        run: &mut RunData,
        (witness, rules): (&Witness, Rules<'_>),
    ) -> Result<(), String> {
        let sequence = self.sequence(times, size, &run.frames);
        let similarity = [Similarity::Iou, Similarity::Metres];
        let found = similarity.into_iter().find_map(|s| Some((s, comparable(&sequence, s)?)));
        let Some((similarity, sequence)) = found else { return Ok(()) };
        let prepared = Prepared::new(&sequence, &comparison(&self.file, similarity))
            .map_err(|error| error.to_string())?;
        let (_, matches) = Clear::measure(&prepared);
        let mut hits = Vec::new();
        for (frame, matches) in prepared.frames.iter().zip(&matches) {
            let mut on: BTreeMap<i64, Option<i64>> = frame
                .truths
                .iter()
                .map(|truth| (prepared.truth_ids[*truth as usize], None))
                .collect();
            for m in matches {
                let person = prepared.truth_ids[frame.truths[m.row as usize] as usize];
                on.insert(person, Some(prepared.track_ids[frame.tracks[m.col as usize] as usize]));
            }
            hits.push(on);
        }
        run.hits = Some(hits);
        add_missed(&find_missed(&sequence, &prepared, &matches, witness, rules), run);
        let happened = events(&prepared, &matches);
        let found_at = matches.iter().position(|pairs| !pairs.is_empty());
        let (early, rest): (Vec<&Event>, Vec<&Event>) =
            happened.iter().partition(|event| is_early_miss(event, found_at));
        run.events.extend(missed_early(&early));
        run.events.extend(rest.into_iter().filter_map(described));
        run.events.sort_by_key(|event| event.i);
        Ok(())
    }

    fn sequence(&self, times: &[f64], size: [usize; 2], run: &[Option<FrameData>]) -> Sequence {
        let frames = self.people.iter().enumerate().map(|(at, (truths, regions))| Frame {
            stamp_ns: (times[at] * 1e9).round() as i64,
            truths: truths.clone(),
            reports: run[at].as_ref().map(|frame| reports(frame, size)).unwrap_or_default(),
            ignore_regions: regions.clone(),
        });
        Sequence { name: "page".into(), frames: frames.collect() }
    }
}

/// Adds the missed people to a run, with the causes.
fn add_missed(missed: &[Missed], run: &mut RunData) {
    let (sentences, places) = sentences_of(missed);
    run.causes = sentences;
    for (one, place) in missed.iter().zip(places) {
        run.missed.entry(one.at).or_default().insert(one.person, place);
    }
}

fn shown(truth: &Truth, odom_from_robot: &Isometry2<f64>) -> TruthBox {
    TruthBox {
        id: truth.id,
        box_px: truth
            .region
            .map(|r| [r.x, r.y, r.width, r.height].map(|v| (v * 10.0).round() / 10.0)),
        at: truth.floor_m.map(|floor| {
            let place = odom_from_robot * Point2::from(floor);
            [place.x, place.y].map(|v| (v * 1e3).round() / 1e3)
        }),
        counts: truth.role == Role::Counts,
    }
}

/// Returns the tracks of a frame that `tracks.csv` contains: confirmed, seen and inside the image.
fn reports(frame: &FrameData, size: [usize; 2]) -> Vec<Report> {
    let (sin, cos) = frame.robot[2].sin_cos();
    let seen = frame.tracks.iter().filter(|track| track.state == "seen");
    let reports = seen.map(|track| {
        let [x, y, width, height] = track.box_px;
        let inside = Rect::new(x, y, width, height).clipped(size[0], size[1]);
        let dx = track.at[0] - frame.robot[0];
        let dy = track.at[1] - frame.robot[1];
        Report {
            id: i64::from(track.id),
            region: (inside.area() > 0.0).then(|| tagalong_app::scoring::region(&inside)),
            floor_m: Some([cos * dx + sin * dy, cos * dy - sin * dx]),
            score: track.p,
        }
    });
    reports.collect()
}

/// Returns true for a miss before the first person is found, because no track can be confirmed at
/// once.
fn is_early_miss(event: &Event, found_at: Option<usize>) -> bool {
    matches!(event.kind, EventKind::Miss { .. }) && found_at.is_none_or(|at| event.frame <= at)
}

/// Describes the misses before the first person is found; those of one frame are one event.
fn missed_early(early: &[&Event]) -> Vec<EventData> {
    let mut told = Vec::new();
    for of_frame in early.chunk_by(|a, b| a.frame == b.frame) {
        let [_, _, ..] = of_frame else {
            told.extend(of_frame.iter().filter_map(|event| described(event)));
            continue;
        };
        let people: Vec<i64> = of_frame
            .iter()
            .filter_map(|event| match event.kind {
                EventKind::Miss { person, .. } => Some(person),
                _ => None,
            })
            .collect();
        let ids: Vec<String> = people.iter().map(i64::to_string).collect();
        told.push(EventData {
            i: of_frame[0].frame.saturating_sub(1),
            kind: "missed",
            track: None,
            person: people.first().copied(),
            text: format!(
                "annotated people {} are missed: no track is confirmed yet",
                ids.join(", ")
            ),
        });
    }
    told
}

/// Describes an event of the comparison; the run itself reports people who are found again.
fn described(event: &Event) -> Option<EventData> {
    let (kind, person, track, text) = match event.kind {
        EventKind::Miss { person, track } => {
            let had = track.map(|id| format!(", who was track {id},")).unwrap_or_default();
            ("missed", Some(person), track, format!("annotated person {person}{had} is missed"))
        }
        EventKind::Switch { person, from, to } => {
            let text = format!("annotated person {person} changes from track {from} to {to}");
            ("switched", Some(person), Some(to), text)
        }
        EventKind::WrongPerson { track, began_with, person } => {
            let text = format!(
                "track {track}, which began on annotated person {began_with}, is now on {person}"
            );
            ("wrong person", Some(person), Some(track), text)
        }
        EventKind::FalseTrack { track } => {
            ("false track", None, Some(track), format!("track {track} begins where no person is"))
        }
        _ => return None,
    };
    let i = event.frame.saturating_sub(1);
    Some(EventData { i, kind, track: track.and_then(|id| u32::try_from(id).ok()), person, text })
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use tagalong_app::frame_notes::{CandidateNote, FateNote, FrameNotes};

    use crate::page::data::TrackData;

    fn run(boxes: &[Option<[f64; 4]>]) -> RunData {
        RunData {
            frames: boxes
                .iter()
                .map(|box_px| {
                    let tracks = box_px.map(|box_px| TrackData {
                        id: 7,
                        state: "seen",
                        box_px,
                        ..TrackData::default()
                    });
                    Some(FrameData { tracks: tracks.into_iter().collect(), ..FrameData::default() })
                })
                .collect(),
            ..RunData::default()
        }
    }

    #[test]
    fn misses_of_one_frame_before_anybody_is_found_are_one_event() {
        fn miss(frame: usize, person: i64) -> Event {
            let kind = EventKind::Miss { person, track: None };
            Event { frame, stamp_ns: 0, kind }
        }

        let all = [miss(1, 4), miss(1, 7), miss(2, 9), miss(3, 5), miss(3, 6)];
        let early: Vec<&Event> = all.iter().filter(|event| is_early_miss(event, Some(2))).collect();
        assert_eq!(early.len(), 3, "somebody is found in the third frame");
        assert!(is_early_miss(&all[4], None), "nobody is ever found");
        let told = missed_early(&early);
        let texts: Vec<&str> = told.iter().map(|event| event.text.as_str()).collect();
        assert_eq!(
            texts,
            [
                "annotated people 4, 7 are missed: no track is confirmed yet",
                "annotated person 9 is missed"
            ]
        );
        assert_eq!((told[0].i, told[0].person), (0, Some(4)));
    }

    #[test]
    fn a_person_without_a_track_is_a_miss_that_can_be_jumped_to() {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("gt.csv");
        std::fs::write(&path, "1,1,10,10,40,40,1\n2,1,10,10,40,40,1\n3,1,10,10,40,40,1\n").unwrap();
        let mut shots = Shots::default();
        for number in 1..4 {
            shots.push(tagalong_app::scoring::Shot {
                number,
                stamp_ns: u64::from(number) * 100_000_000,
                camera: Arc::new(tagalong_geometry::Camera {
                    lens: tagalong_geometry::Lens::Blind,
                    width: 640,
                    height: 480,
                    robot_from_camera: nalgebra::Isometry3::identity(),
                }),
                odom_from_robot: Isometry2::identity(),
            });
        }
        let stamps = [100_000_000, 200_000_000, 300_000_000];
        let truth = PageTruth::read(&path, false, None, &shots, &stamps).unwrap();
        assert!(truth.has_people());
        assert_eq!(truth.frames[0][0].box_px, Some([10.0, 10.0, 40.0, 40.0]));
        let on = Some([10.0, 10.0, 40.0, 40.0]);
        let mut run = run(&[on, Some([300.0, 9.0, 40.0, 40.0]), on]);
        let remedies = tagalong_app::remedies::Remedies::default();
        let rules = Rules { remedies: &remedies, config: &toml::Table::new() };
        let mut witness = Witness::default();
        let box_px = [12.0, 12.0, 40.0, 40.0];
        let candidate = CandidateNote {
            box_px,
            fate: FateNote::Dropped("score".into()),
            ..CandidateNote::default()
        };
        let notes = FrameNotes { candidates: vec![candidate], ..FrameNotes::default() };
        witness.add(2, &notes, Vec::new(), None);
        let times = [0.0, 0.1, 0.2];
        truth.judge(&times, [640, 480], &mut run, (&witness, rules)).unwrap();
        assert_eq!(run.missed.keys().collect::<Vec<_>>(), [&1]);
        let cause = &run.causes[run.missed[&1][&1]];
        assert!(
            cause.starts_with("Track 7 ended, and no new one began: the test \"score\" dropped"),
            "{cause}"
        );
        let hits = run.hits.unwrap();
        assert_eq!((hits[0][&1], hits[1][&1], hits[2][&1]), (Some(7), None, Some(7)));
        let missed: Vec<usize> =
            run.events.iter().filter(|e| e.kind == "missed").map(|e| e.i).collect();
        assert_eq!(missed, [1]);
    }
}
