//! The newest frame, and the part of the past that its trails and events need.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use crate::page::data::{FrameData, TestData};
use crate::page::events::Watch;
use crate::page::frame::{add_trails, frame_data, scan_points, tests, view_edges};
use crate::page::moment::Moment;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use nalgebra::{Isometry2, Point3};
use serde::Serialize;
use tagalong_app::remedies::Remedies;
use tagalong_core::{Frame, Images, Stamp};
use tagalong_geometry::Camera;
use tagalong_pipeline::FrameReport;
use tagalong_render::{background, jpeg};
use toml::Table;

/// Number of frames that are kept for trails and for the times of events.
const PAST_FRAMES: usize = 64;

/// Length of a trail, s.
const TRAIL_S: f64 = 2.0;

/// Number of past events for a page that has just been opened or was disconnected.
const EVENTS: usize = 200;

/// Longest wait of a page for the next frame. In a test it exceeds all other times, so that every
/// answer is caused by an event.
pub(super) const WAIT: Duration = Duration::from_secs(if cfg!(test) { 120 } else { 1 });

/// Time since the last request within which the page counts as watched.
const WATCHED: Duration = Duration::from_secs(2);

/// Columns and quality of JPEG.
const IMAGE: (usize, u8) = (640, 72);

/// Slot for the newest frame.
pub struct Newest {
    config: Table,
    remedies: Remedies,
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Default)]
struct State {
    shot: Option<Arc<Shot>>,
    first: Option<Stamp>,
    past: VecDeque<(u64, f64, Arc<FrameData>)>,
    watch: Watch,
    events: VecDeque<LiveEvent>,
    ended: Option<String>,
    asked: Option<Instant>,
    farewells: usize,
}

/// Event with its time.
#[derive(Clone, Debug, Serialize)]
pub struct LiveEvent {
    #[serde(skip)]
    seq: u64,
    /// Time since the first frame, s.
    t: f64,
    kind: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    track: Option<u32>,
    text: String,
}

/// A frame with everything that the page shows.
struct Shot {
    seq: u64,
    t: f64,
    frame: FrameData,
    tests: BTreeMap<String, TestData>,
    camera: Arc<Camera>,
    images: Images,
    scan: Option<Arc<[Point3<f64>]>>,
    odom_from_robot: Isometry2<f64>,
    past: Vec<Arc<FrameData>>,
    /// Created when the first page requests it.
    parts: OnceLock<Parts>,
}

/// Parts of a frame that take time to create.
struct Parts {
    frame: FrameData,
    image: String,
    scan: Option<Vec<i32>>,
    view_rad: Option<[f64; 2]>,
}

/// Answer to a page.
#[derive(Serialize)]
pub struct Now<'a> {
    seq: u64,
    t: f64,
    image_px: [usize; 2],
    frame: Option<&'a FrameData>,
    image: &'a str,
    scan: Option<&'a [i32]>,
    view_rad: Option<[f64; 2]>,
    tests: Option<&'a BTreeMap<String, TestData>>,
    events: Vec<LiveEvent>,
    ended: Option<String>,
}

impl Newest {
    /// Creates an empty slot. The config is the resolved one.
    pub fn new(config: Table, remedies: Remedies) -> Self {
        Self { config, remedies, state: Mutex::default(), changed: Condvar::new() }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Replaces the previous frame. Images are shared, not copied or encoded.
    pub fn put(&self, frame: &Frame, odom_from_robot: &Isometry2<f64>, report: &FrameReport) {
        let moment = Moment::of(report, &frame.camera, odom_from_robot);
        let tests = tests(std::iter::once(&moment.notes), &self.config, &self.remedies);
        let data = frame_data(&moment);
        let mut state = self.lock();
        let first = *state.first.get_or_insert(report.stamp);
        let t = (report.stamp.seconds_since(first) * 1e3).round() * 1e-3;
        let seq = state.shot.as_ref().map_or(0, |shot| shot.seq) + 1;
        state.note_events(seq, t, &moment);
        let shot = Shot {
            seq,
            t,
            frame: data.clone(),
            tests,
            camera: Arc::clone(&frame.camera),
            images: frame.images(),
            scan: frame.laser().map(|laser| Arc::clone(&laser.points)),
            odom_from_robot: *odom_from_robot,
            past: trail_at(&state.past, t),
            parts: OnceLock::new(),
        };
        state.past.push_back((seq, t, Arc::new(data)));
        while state.past.len() > PAST_FRAMES {
            state.past.pop_front();
        }
        state.shot = Some(Arc::new(shot));
        drop(state);
        self.changed.notify_all();
    }

    /// Ends the run with a reason; the first reason is kept.
    pub fn end(&self, why: &str) {
        let mut state = self.lock();
        state.ended.get_or_insert_with(|| why.to_owned());
        drop(state);
        self.changed.notify_all();
    }

    /// Returns true if a page has sent a request.
    #[cfg(test)]
    pub(super) fn was_asked(&self) -> bool {
        self.lock().asked.is_some()
    }

    /// Returns true if a page sent a request recently and does not know of the end.
    pub fn is_watched(&self) -> bool {
        let state = self.lock();
        state.farewells == 0 && state.asked.is_some_and(|asked| asked.elapsed() < WATCHED)
    }

    /// Answers with the newest frame after `after`, and waits up to a second for it. `answer`
    /// converts it to text without delaying the pipeline.
    pub fn answer<T>(&self, after: u64, answer: impl FnOnce(&Now<'_>) -> T) -> T {
        let (shot, events, ended) = self.wait_for(after);
        let parts = shot.as_ref().map(|shot| shot.parts.get_or_init(|| shot.make_parts()));
        let now = Now {
            seq: shot.as_ref().map_or(0, |shot| shot.seq),
            t: shot.as_ref().map_or(0.0, |shot| shot.t),
            image_px: shot.as_ref().map_or([0, 0], |s| [s.camera.width, s.camera.height]),
            frame: parts.map(|parts| &parts.frame),
            image: parts.map_or("", |parts| &parts.image),
            scan: parts.and_then(|parts| parts.scan.as_deref()),
            view_rad: parts.and_then(|parts| parts.view_rad),
            tests: shot.as_ref().map(|shot| &shot.tests),
            events,
            ended,
        };
        answer(&now)
    }

    fn wait_for(&self, after: u64) -> (Option<Arc<Shot>>, Vec<LiveEvent>, Option<String>) {
        let mut state = self.lock();
        state.asked = Some(Instant::now());
        let waited = self.changed.wait_timeout_while(state, WAIT, |state: &mut State| {
            let newest = state.shot.as_ref().map_or(0, |shot| shot.seq);
            newest <= after && state.ended.is_none()
        });
        let (mut state, _) = waited.unwrap_or_else(PoisonError::into_inner);
        state.farewells += usize::from(state.ended.is_some());
        let shot = state.shot.clone().filter(|shot| shot.seq > after);
        let events = state.events.iter().filter(|event| event.seq > after).cloned().collect();
        (shot, events, state.ended.clone())
    }
}

impl State {
    fn note_events(&mut self, seq: u64, t: f64, moment: &Moment) {
        let at = usize::try_from(seq).unwrap_or(usize::MAX);
        self.watch.take(at, t, moment);
        for event in self.watch.drain() {
            let mut past = self.past.iter();
            let began = past.find(|(seq, ..)| usize::try_from(*seq) == Ok(event.i));
            let t = began.map_or(t, |(_, t, _)| *t);
            let kind = event.kind;
            let track = event.track;
            let text = event.text;
            self.events.push_back(LiveEvent { seq, t, kind, track, text });
        }
        while self.events.len() > EVENTS {
            self.events.pop_front();
        }
    }
}

/// Returns the frames of the trails at a time.
fn trail_at(past: &VecDeque<(u64, f64, Arc<FrameData>)>, now_s: f64) -> Vec<Arc<FrameData>> {
    let recent = past.iter().filter(|(_, t, _)| now_s - t <= TRAIL_S);
    recent.map(|(_, _, frame)| Arc::clone(frame)).collect()
}

impl Shot {
    fn make_parts(&self) -> Parts {
        let mut frame = self.frame.clone();
        let past: Vec<&FrameData> = self.past.iter().map(AsRef::as_ref).collect();
        let has_image = !self.camera.is_blind();
        if has_image {
            add_trails(&past, &mut frame, &self.camera, &self.odom_from_robot);
        }
        let (width, quality) = IMAGE;
        let image = background(&self.images).map(|image| jpeg(&image, width, quality));
        let is_flat = has_image && self.camera.panorama().is_none();
        let scan = self.scan.as_deref();
        Parts {
            frame,
            image: STANDARD.encode(image.unwrap_or_default()),
            scan: scan.map(|points| scan_points(points, &self.odom_from_robot)),
            view_rad: is_flat.then(|| view_edges(&self.camera)),
        }
    }
}
