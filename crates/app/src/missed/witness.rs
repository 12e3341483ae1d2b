//! The record of each frame of a run: dropped candidates, tracks, and depth.

use std::collections::{BTreeMap, BTreeSet};

use tagalong_core::Track;
use tagalong_geometry::Rect;
use tagalong_log::LogFrame;
use tagalong_pipeline::FrameReport;

use super::{Depths, PersonAt};
use crate::frame_notes::{FateNote, FrameNotes, MeasuredValue};

/// Maximum ratio between the widths of a person's box and of a candidate for that person.
const SIMILAR: f64 = 2.0;

/// Fraction of the smaller of two boxes that both must share for a candidate to be near a person:
/// one on the chest shares little with the box around head and shoulders. Tracks share more with
/// their persons.
const NEAR_SHARE: f64 = 0.1;
const NEAR_SHARE_OF_TRACK: f64 = 0.25;

/// Overlap from which on a candidate is another detection of a tracked person.
const SAME_IOU: f64 = 0.5;

/// Maximum distance on the floor at which a candidate or a track is near a person, m.
const NEAR_M: f64 = 0.75;

/// Tests of the score of a candidate, whose limit is in the config of the track manager.
pub(super) const OF_SCORE: [&str; 2] = ["score", "verifier"];

/// Beginning of the names of the tests that end tracks.
const OF_TRACKS: &str = "track: ";

/// Name of the test of a place that no test dropped.
const NO_TEST: &str = "";

/// State of a track in one frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TrackStage {
    /// Confirmed, with evidence in this frame: it is reported.
    Seen,
    /// Confirmed, without evidence in this frame.
    Predicted,
    /// Not confirmed yet.
    Tentative,
}

impl TrackStage {
    /// Returns the state of a track from its two flags.
    pub fn of(confirmed: bool, seen: bool) -> Self {
        if !confirmed {
            Self::Tentative
        } else if seen {
            Self::Seen
        } else {
            Self::Predicted
        }
    }
}

/// Track in one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SightedTrack {
    /// ID of the track.
    pub id: u32,
    /// State of the track.
    pub stage: TrackStage,
    /// Box of head and shoulders, pixels: left, top, width, height.
    pub box_px: [f32; 4],
    /// Position on the floor, odometry frame, m.
    pub floor_m: [f32; 2],
}

/// Position at which a candidate was dropped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct DroppedPlace {
    /// Index of the test in [`Witness::tests`].
    test: u16,
    /// Left, top, width, height; single precision halves the memory of a long log.
    pub(super) box_px: [f32; 4],
    /// Position on the floor, odometry frame, m; not finite if it is not known.
    floor_m: [f32; 2],
    /// Index of its value in [`Sight::measured`].
    measured: Option<u16>,
}

/// Track that got a candidate in a frame and ended in it.
#[derive(Clone, Debug)]
pub(super) struct EndedTrack {
    /// ID of the track.
    pub(super) id: u32,
    /// Test by which it ended, if only one test ended tracks in the frame.
    pub(super) test: Option<String>,
    /// Position of its candidate.
    at: DroppedPlace,
}

/// One frame of a run.
#[derive(Clone, Debug, Default)]
struct Sight {
    places: Vec<DroppedPlace>,
    ended: Vec<EndedTrack>,
    measured: Vec<MeasuredValue>,
    tracks: Vec<SightedTrack>,
    /// Pose of the robot in the odometry frame.
    robot_odom: [f64; 3],
    depths: Option<Depths>,
}

/// The record of each frame of a run, by its number.
#[derive(Clone, Debug, Default)]
pub struct Witness {
    tests: Vec<String>,
    frames: BTreeMap<u64, Sight>,
}

impl Witness {
    /// Adds the report of a pipeline on a frame, whose depth image is reduced once for all pipelines.
    pub fn take(&mut self, item: &LogFrame, report: &FrameReport, depths: Option<Depths>) {
        let notes = FrameNotes::of(report, &item.frame.camera, &item.odom_from_robot);
        let tracks = report.tracks.iter().map(|track| SightedTrack::of(track, item)).collect();
        self.add(report.index, &notes, tracks, depths);
    }

    /// Adds the notes on a frame.
    pub fn add(
        &mut self,
        number: u64,
        notes: &FrameNotes,
        tracks: Vec<SightedTrack>,
        depths: Option<Depths>,
    ) {
        let mut places = Vec::new();
        let mut measured = Vec::new();
        let mut ended = Vec::new();
        for candidate in &notes.candidates {
            let [x, y, _] = candidate.head_odom_m;
            if let FateNote::Matched(id) | FateNote::Started(id) = candidate.fate
                && notes.ended.contains(&id)
            {
                let test = end_test(notes);
                let at = self.place(NO_TEST, candidate.box_px, [x, y]);
                ended.push(EndedTrack { id, test, at });
            }
            if let FateNote::Dropped(test) = &candidate.fate {
                let mut place = self.place(test, candidate.box_px, [x, y]);
                if OF_SCORE.contains(&test.as_str()) {
                    place.measured = u16::try_from(measured.len()).ok();
                    let what = "log-odds".to_owned();
                    measured.push(MeasuredValue {
                        what,
                        value: candidate.score,
                        limits: Vec::new(),
                    });
                }
                places.push(place);
            }
        }
        for dropped in &notes.dropped {
            let first = places.len();
            for box_px in &dropped.boxes_px {
                places.push(self.place(&dropped.test, *box_px, [f64::NAN; 2]));
            }
            for note in &dropped.measured {
                if let Some(place) = places.get_mut(first + note.at) {
                    place.measured = u16::try_from(measured.len()).ok();
                    measured.push(note.value.clone());
                }
            }
        }
        let robot_odom = notes.robot_odom;
        let sight = Sight { places, ended, measured, tracks, robot_odom, depths };
        self.frames.insert(number, sight);
    }

    fn place(&mut self, test: &str, box_px: [f64; 4], floor_m: [f64; 2]) -> DroppedPlace {
        let known = self.tests.iter().position(|name| name == test);
        let at = known.unwrap_or_else(|| {
            self.tests.push(test.to_owned());
            self.tests.len() - 1
        });
        let test = u16::try_from(at).unwrap_or(u16::MAX);
        let box_px = box_px.map(|v| v as f32);
        let floor_m = floor_m.map(|v| v as f32);
        DroppedPlace { test, box_px, floor_m, measured: None }
    }

    /// Converts a position in the robot frame to the odometry frame, at the time of a frame.
    pub(super) fn in_odom(&self, number: u64, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        let [robot_x, robot_y, heading] = self.frames.get(&number)?.robot_odom;
        let (sin, cos) = heading.sin_cos();
        Some([robot_x + cos * x - sin * y, robot_y + sin * x + cos * y])
    }

    /// Returns the tracks of a frame.
    pub(super) fn tracks(&self, number: u64) -> &[SightedTrack] {
        self.frames.get(&number).map_or(&[], |sight| &sight.tracks)
    }

    /// Returns the depth image of a frame, reduced.
    pub(super) fn depths(&self, number: u64) -> Option<&Depths> {
        self.frames.get(&number)?.depths.as_ref()
    }

    /// Returns the dropped candidates of a frame with their tests.
    pub(super) fn dropped(&self, number: u64) -> impl Iterator<Item = (&str, &DroppedPlace)> {
        let places = self.frames.get(&number).map_or(&[][..], |sight| &sight.places);
        places
            .iter()
            .filter_map(|place| Some((self.tests.get(usize::from(place.test))?.as_str(), place)))
    }

    /// Returns the value because of which a candidate was dropped, if it is known.
    pub(super) fn measured(&self, number: u64, dropped: &DroppedPlace) -> Option<&MeasuredValue> {
        self.frames.get(&number)?.measured.get(usize::from(dropped.measured?))
    }

    /// Returns true for a candidate at a track of another person that is nearer to that track.
    pub(super) fn is_of_another(
        &self,
        number: u64,
        dropped: &DroppedPlace,
        person: &PersonAt,
        taken: &BTreeSet<i64>,
    ) -> bool {
        let Some(rect) = person.rect else { return false };
        let own = rect_of(&dropped.box_px);
        let others = self.tracks(number).iter();
        let mut others = others.filter(|track| taken.contains(&i64::from(track.id)));
        others.any(|track| {
            let overlap = rect_of(&track.box_px).iou(&own);
            overlap >= SAME_IOU && overlap > rect.iou(&own)
        })
    }

    /// Returns the track that had a candidate of a person's size at a position and ended in the frame.
    pub(super) fn ended_at(&self, number: u64, person: &PersonAt) -> Option<&EndedTrack> {
        let mut ended = self.frames.get(&number)?.ended.iter();
        ended.find(|track| {
            let nearness = track.at.nearness(person);
            nearness.is_some_and(|(nearness, _)| nearness == Nearness::Fits)
        })
    }

    /// Returns the track at a position that is on no other person; confirmed ones have priority,
    /// then the nearest.
    pub(super) fn track_at(
        &self,
        number: u64,
        person: &PersonAt,
        taken: &BTreeSet<i64>,
    ) -> Option<SightedTrack> {
        let free = self.tracks(number).iter().filter(|track| !taken.contains(&i64::from(track.id)));
        let near = free.filter_map(|track| {
            let (_, distance) =
                nearness(&track.box_px, &track.floor_m, person, NEAR_SHARE_OF_TRACK)?;
            Some((track.stage == TrackStage::Tentative, distance, *track))
        });
        let best = near.min_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        best.map(|(.., track)| track)
    }
}

/// Returns the test that ended tracks in a frame; `None` for several tests.
fn end_test(notes: &FrameNotes) -> Option<String> {
    let mut tests = notes.dropped.iter().filter(|entry| entry.test.starts_with(OF_TRACKS));
    let first = tests.next()?;
    tests.next().is_none().then(|| first.test.clone())
}

impl SightedTrack {
    fn of(track: &Track, item: &LogFrame) -> Self {
        let region = track.estimate.region;
        let floor = item.odom_from_robot * track.estimate.person.position.xy();
        Self {
            id: track.id.0,
            stage: TrackStage::of(track.confirmed, track.seen),
            box_px: [region.x, region.y, region.width, region.height].map(|v| v as f32),
            floor_m: [floor.x as f32, floor.y as f32],
        }
    }
}

/// Closeness of a box to a person; of two values the larger one is closer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Nearness {
    /// Their boxes overlap.
    Overlaps,
    /// The centre of the box is inside of the person's box, and it is of the person's size.
    Fits,
}

impl DroppedPlace {
    /// Returns the closeness to a person, and the distance; `None` for a position of something
    /// else.
    pub(super) fn nearness(&self, person: &PersonAt) -> Option<(Nearness, f64)> {
        nearness(&self.box_px, &self.floor_m, person, NEAR_SHARE)
    }
}

fn rect_of(box_px: &[f32; 4]) -> Rect {
    let [x, y, width, height] = box_px.map(f64::from);
    Rect::new(x, y, width, height)
}

/// Compares boxes if the person has one, otherwise positions on the floor. Boxes that fit need not
/// share an area.
fn nearness(
    box_px: &[f32; 4],
    floor_m: &[f32; 2],
    person: &PersonAt,
    least_share: f64,
) -> Option<(Nearness, f64)> {
    let Some(rect) = person.rect else {
        let at = person.floor_m?;
        let distance = (f64::from(floor_m[0]) - at[0]).hypot(f64::from(floor_m[1]) - at[1]);
        return (distance <= NEAR_M).then_some((Nearness::Fits, distance));
    };
    let other = rect_of(box_px);
    let distance = (other.centre() - rect.centre()).norm();
    let is_similar = (1.0 / SIMILAR..=SIMILAR).contains(&(other.width / rect.width.max(1.0)));
    if is_similar && rect.contains(other.centre()) {
        return Some((Nearness::Fits, distance));
    }
    let smaller = rect.area().min(other.area());
    let is_near = smaller > 0.0 && rect.intersection(&other).area() >= least_share * smaller;
    is_near.then_some((Nearness::Overlaps, distance))
}
