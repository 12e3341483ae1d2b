use std::collections::BTreeMap;

use tagalong_core::{
    Capabilities, Detection, Detector, Frame, Funnel, GreyImage, Input, Inputs, Query, Result,
    Track, TrackId,
};
use tagalong_geometry::{HEAD_RADIUS_M, Rect};
use tagalong_vision::{BoxSettings, BoxedBody};

use crate::fourier::{Fourier, Spectrum};
use crate::patch::{Change, SIDE, WINDOW};
use crate::{Config, Filter, NAME, Patch, Peak, filter};

/// Upper bodies are at least and at most so wide, pixels.
const SIDES_PX: std::ops::RangeInclusive<f64> = 12.0..=1000.0;
/// A detection that overlaps the track's box by less was not the one that the track was given
/// (IoU).
const SAME_PLACE: f64 = 0.7;

/// Something, or the test that failed.
type TestResult<T> = std::result::Result<T, &'static str>;
/// The test of a box that cannot be sampled.
const UNUSABLE: &str = "mosse: box outside, too small or too large";

/// Follows people by correlation filters.
pub struct Mosse {
    config: Config,
    fourier: Fourier,
    goal: Spectrum,
    targets: BTreeMap<TrackId, Target>,
}

/// Memory of one person.
struct Target {
    filter: Filter,
    /// The detection of this frame, and its ratio of peak to sidelobes.
    found: Option<(Rect, f64)>,
}

impl Mosse {
    /// Creates a detector with these settings.
    ///
    /// # Errors
    /// [`tagalong_core::Error::Settings`] for numbers that cannot work.
    pub fn new(config: Config) -> Result<Self> {
        config.check()?;
        let fourier = Fourier::default();
        let goal = filter::goal(&fourier, config.peak_width * SIDE as f64 / WINDOW);
        Ok(Self { config, fourier, goal, targets: BTreeMap::new() })
    }

    /// Returns the place of a known person, or the test that failed.
    fn near(&mut self, frame: &Frame, grey: &GreyImage, track: &Track) -> TestResult<Detection> {
        let expected = track.estimate.region;
        let target = self.targets.get_mut(&track.id).ok_or("mosse: not learnt yet")?;
        if !is_usable(grey, &expected) {
            return Err(UNUSABLE);
        }
        let window = self.fourier.spectrum(&Patch::new(grey, &expected).0);
        let part = self.config.regularisation as f32;
        let peak = Peak::of(&target.filter.correlation(&self.fourier, &window, part));
        if peak.ratio < self.config.min_ratio {
            return Err("mosse: peak");
        }
        let region = moved(&expected, &peak);
        if !shows(&self.config, frame, track, &region) {
            return Err("mosse: depth");
        }
        target.found = Some((region, peak.ratio));
        let settings = BoxSettings {
            body: BoxedBody::Upper,
            sigma_px: self.config.sigma_box * region.width,
            sigma_depth_m: self.config.sigma_depth_m,
            ..BoxSettings::default()
        };
        settings.detection(frame, &region, self.config.score, NAME).ok_or(UNUSABLE)
    }

    /// Adapts the filter of one person to this frame.
    fn teach(&mut self, frame: &Frame, track: &Track) -> Result<()> {
        let (grey, region) = (frame.grey()?, track.estimate.region);
        let found = self.targets.get_mut(&track.id).and_then(|target| target.found.take());
        let is_clear = track.seen && !track.occluded && is_usable(grey, &region);
        if !is_clear || !shows(&self.config, frame, track, &region) {
            return Ok(());
        }
        let spectrum =
            |change: Change| self.fourier.spectrum(&Patch::changed(grey, &region, change).0);
        match self.targets.get_mut(&track.id) {
            Some(target) => {
                if let Some(memory) = memory(&self.config, found, &region) {
                    target.filter.learn(&spectrum(Change::NONE), &self.goal, memory as f32);
                }
            }
            None => {
                let windows: Vec<Spectrum> = changes(&self.config).map(spectrum).collect();
                let filter = Filter::new(&windows, &self.goal);
                self.targets.insert(track.id, Target { filter, found: None });
            }
        }
        Ok(())
    }
}

/// Returns the windows from which a filter begins: as it is, turned, and of other sizes.
fn changes(config: &Config) -> impl Iterator<Item = Change> {
    let (turn, growth) = (config.turn_deg.to_radians(), config.growth);
    let steps = || [0.0, -1.0, 1.0].into_iter();
    steps().flat_map(move |a| {
        steps().map(move |b| Change { turn_rad: a * turn, growth: 1.0 + b * growth })
    })
}

/// Returns the weight of the past against this frame; `None` where the detection of the frame is
/// too unsure to learn from.
fn memory(config: &Config, found: Option<(Rect, f64)>, region: &Rect) -> Option<f64> {
    match found {
        Some((own, ratio)) if own.iou(region) >= SAME_PLACE => {
            (ratio >= config.learn_ratio).then_some(config.memory)
        }
        _ => Some(config.anchored_memory),
    }
}

/// Returns true if the middle of a square is in the image and its size can be sampled.
fn is_usable(grey: &GreyImage, square: &Rect) -> bool {
    let image = Rect::new(0.0, 0.0, grey.width() as f64, grey.height() as f64);
    SIDES_PX.contains(&square.width)
        && SIDES_PX.contains(&square.height)
        && image.contains(square.centre())
}

/// Returns the square, moved to the peak.
fn moved(square: &Rect, peak: &Peak) -> Rect {
    let [across, down] = peak.offset.map(|cells| cells * WINDOW / SIDE as f64);
    Rect { x: square.x + across * square.width, y: square.y + down * square.height, ..*square }
}

/// Returns true if the depth image shows something at the distance of the track in a square, or is
/// not asked, or is not there.
fn shows(config: &Config, frame: &Frame, track: &Track, square: &Rect) -> bool {
    let Some(depth) = frame.depth().ok().filter(|_| config.depth_tolerance_m > 0.0) else {
        return true;
    };
    let face_m = frame.camera.depth_of(&track.estimate.person.position) - HEAD_RADIUS_M;
    let shown = depth.surface_m(square);
    shown.is_some_and(|shown| (shown - face_m).abs() < config.depth_tolerance_m)
}

impl Detector for Mosse {
    fn capabilities(&self) -> Capabilities {
        Capabilities {
            inputs: Inputs::NONE.require(Input::Colour).accept(Input::Depth),
            discovers: false,
            tracks: true,
            weighs: false,
        }
    }

    fn detect(
        &mut self,
        frame: &Frame,
        search: &Query<'_>,
        funnel: &mut Funnel,
    ) -> Result<Vec<Detection>> {
        let Query::Track(track) = search else { return Ok(Vec::new()) };
        match self.near(frame, frame.grey()?, track) {
            Ok(found) => Ok(vec![found]),
            Err(test) => {
                funnel.drop_at(test, track.estimate.region);
                Ok(Vec::new())
            }
        }
    }

    fn learn(&mut self, frame: &Frame, tracks: &[Track]) -> Result<()> {
        self.targets.retain(|id, _| tracks.iter().any(|track| track.id == *id));
        tracks.iter().try_for_each(|track| self.teach(frame, track))
    }
}
