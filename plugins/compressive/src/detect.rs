use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::Matrix3;
use tagalong_core::{
    Capabilities, DepthImage, Detection, Detector, Frame, Funnel, Input, Inputs, Query, Result,
    Track, TrackId,
};
use tagalong_geometry::{Camera, HEAD_RADIUS_M, ImageBox, PointEstimate, Rect};
use tagalong_vision::Integral;

use crate::appearance::Samples;
use crate::candidates::{Pixels, disc, ring};
use crate::{Appearance, Config, Features, NAME, Scaled};

/// Boxes are at least and at most so wide and high, pixels.
const SIDES_PX: std::ops::RangeInclusive<f64> = 12.0..=1000.0;
/// Another mode is at least so far from the best box, widths.
const OTHER_MODE: f64 = 0.5;
/// The standard deviation of a distance that is only expected, as a fraction.
const SIGMA_EXPECTED: f64 = 0.5;

/// Follows people by their appearance.
pub struct Compressive {
    config: Config,
    features: Features,
    targets: BTreeMap<TrackId, Target>,
    scratch: Scratch,
}

/// Memory of one person.
struct Target {
    appearance: Appearance,
    /// It has learnt from a frame at least.
    is_taught: bool,
    /// The features for boxes of this person's size.
    scaled: Scaled,
    /// Width of the box times the distance it was learnt at, pixels m.
    width_at_1m: Option<f64>,
    /// The sighting of this frame, and how sure it is.
    found: Option<(Rect, f32)>,
}

/// Memory that is used again in every frame.
#[derive(Default)]
struct Scratch {
    numbers: Vec<f32>,
    person: Samples,
    other: Samples,
    coarse: Vec<Scored>,
}

/// A box and how sure it is of the person.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Scored {
    x: i64,
    y: i64,
    confidence: f32,
}

/// The images of a frame that this detector looks at.
struct FrameImages<'a> {
    integral: Arc<Integral>,
    depth: Option<&'a DepthImage>,
    camera: &'a Camera,
}

/// Boxes that were not looked at, and why.
#[derive(Default)]
struct Dropped {
    outside: u64,
    nearer: u64,
    farther: u64,
}

impl<'a> FrameImages<'a> {
    fn of(frame: &'a Frame) -> Result<Self> {
        let integral = frame.derived::<Integral>()?;
        Ok(Self { integral, depth: frame.depth().ok(), camera: &frame.camera })
    }

    /// Expected depth of a track's face, m, where there are depths to compare.
    fn expected_m(&self, track: &Track) -> Option<f64> {
        let face_m = self.camera.depth_of(&track.estimate.person.position) - HEAD_RADIUS_M;
        self.depth.is_some().then_some(face_m).filter(|m| m.is_finite() && *m > 0.1)
    }
}

impl Compressive {
    /// A detector with these settings.
    ///
    /// # Errors
    /// [`tagalong_core::Error::Settings`] for numbers that cannot work.
    pub fn new(config: Config, seed: u64) -> Result<Self> {
        config.check()?;
        let features = Features::draw(config.features, config.most_rectangles, seed);
        let scratch = Scratch { numbers: vec![0.0; features.len()], ..Scratch::default() };
        Ok(Self { config, features, targets: BTreeMap::new(), scratch })
    }

    /// Where a person is whose appearance is known.
    fn near(
        &mut self,
        view: &FrameImages<'_>,
        track: &Track,
        funnel: &mut Funnel,
    ) -> Option<Detection> {
        let Self { config, features, targets, scratch } = self;
        let expected = track.estimate.region;
        let Some(target) = targets.get_mut(&track.id).filter(|target| target.is_taught) else {
            funnel.drop_at("appearance: not learnt yet", expected);
            return None;
        };
        if target.resize(config, features, view, track).is_none() {
            funnel.drop_at("appearance: box too small or too large", expected);
            return None;
        }
        let mut hunt = Hunt { config, view, target, scratch, expected_m: view.expected_m(track) };
        let mut dropped = Dropped::default();
        let best = hunt.search(&expected, &mut dropped);
        let lead = best.map_or(f32::INFINITY, |best| hunt.lead(best));
        let test = match best {
            None => Some(dropped.reason()),
            Some(best) if f64::from(best.confidence) < config.min_confidence => {
                Some("appearance: confidence")
            }
            Some(_) if f64::from(lead) < config.min_lead => Some("appearance: two places"),
            Some(_) => None,
        };
        dropped.count(funnel);
        funnel.drop_many("box: another is surer", scratch.coarse.len().saturating_sub(1) as u64);
        if let Some(test) = test {
            funnel.drop_at(test, expected);
            return None;
        }
        let best = best?;
        let (width, height) = target.scaled.size();
        let of = Pixels { x: best.x, y: best.y, width, height };
        let region = of.rect();
        target.found = Some((region, best.confidence));
        let face_m = view.depth.and_then(|depth| depth.surface_m(&of.rect()));
        Some(sighting(config, view.camera, track, region, face_m))
    }

    /// Adapts the model of one person to this frame.
    fn teach(&mut self, view: &FrameImages<'_>, track: &Track) {
        let Self { config, features, targets, scratch } = self;
        let target = targets.entry(track.id).or_insert_with(|| Target::new(features.len()));
        let found = target.found.take();
        let rule = config.learning.rule();
        let Some(memory) = rule.memory(config, track, found, !target.is_taught) else { return };
        let Some(of) = target.fit_to(features, view, &track.estimate.region) else { return };
        let expected_m = view.expected_m(track);
        let shown = view.depth.and_then(|depth| depth.surface_m(&of.rect()));
        let is_there = match (expected_m, shown) {
            (Some(expected), Some(shown)) => (shown - expected).abs() < config.depth_tolerance_m,
            (Some(_), None) => false,
            (None, _) => true,
        };
        if config.depth_filter && !is_there && !rule.ignores_depth() {
            return;
        }
        if !sample(config, view, target, of, scratch) {
            return;
        }
        target.appearance.learn(&scratch.person, &scratch.other, memory, config.min_sigma);
        target.is_taught = true;
        target.width_at_1m = expected_m.map(|metres| metres * track.estimate.region.width);
    }
}

/// Collects boxes on the person and beside them; false if there are too few.
fn sample(
    config: &Config,
    view: &FrameImages<'_>,
    target: &Target,
    of: Pixels,
    scratch: &mut Scratch,
) -> bool {
    let Scratch { numbers, person, other, .. } = scratch;
    let width = of.width as f64;
    let radius = (config.positive_radius * width).max(2.0);
    let near = disc(radius, (radius / 4.0).round() as i64);
    let away = ring(config.negative_from * width, config.negative_to * width, config.negatives);
    person.clear(numbers.len());
    other.clear(numbers.len());
    add_samples(view, target, of, near, numbers, person);
    add_samples(view, target, of, away, numbers, other);
    person.len() >= 4 && other.len() >= 4
}

/// Adds the numbers of the boxes at some offsets from another one, where they lie in the image.
fn add_samples(
    view: &FrameImages<'_>,
    target: &Target,
    of: Pixels,
    offsets: impl Iterator<Item = (i64, i64)>,
    numbers: &mut [f32],
    samples: &mut Samples,
) {
    for (dx, dy) in offsets {
        let x = of.x + dx;
        let y = of.y + dy;
        if target.scaled.fits(&view.integral, x, y) {
            target.scaled.measure(&view.integral, x as usize, y as usize, numbers);
            samples.add(numbers);
        }
    }
}

impl Target {
    fn new(numbers: usize) -> Self {
        Self {
            appearance: Appearance::blank(numbers),
            is_taught: false,
            scaled: Scaled::default(),
            width_at_1m: None,
            found: None,
        }
    }

    /// Takes the size that the person should have now: that of the expected box, or that of the
    /// measured distance, without jumps. `None` if the box is too small.
    fn resize(
        &mut self,
        config: &Config,
        features: &Features,
        view: &FrameImages<'_>,
        track: &Track,
    ) -> Option<()> {
        let expected = track.estimate.region;
        let by_depth = match (self.width_at_1m, view.expected_m(track)) {
            (Some(at_1m), Some(metres)) if config.scale_from_depth => Some(at_1m / metres),
            _ => None,
        };
        let last = self.scaled.size().0 as f64;
        let wanted = by_depth.unwrap_or(expected.width);
        let steady = wanted
            .clamp(last * (1.0 - config.max_scale_change), last * (1.0 + config.max_scale_change));
        let factor = steady.max(1.0) / expected.width.max(1.0);
        self.set_size(features, view, expected.width * factor, expected.height * factor)
    }

    /// Takes the size of a box, and returns it in whole pixels; `None` if it
    /// cannot be used.
    fn fit_to(
        &mut self,
        features: &Features,
        view: &FrameImages<'_>,
        region: &Rect,
    ) -> Option<Pixels> {
        self.set_size(features, view, region.width, region.height)?;
        let (width, height) = self.scaled.size();
        let of = Pixels { x: region.x.round() as i64, y: region.y.round() as i64, width, height };
        self.scaled.fits(&view.integral, of.x, of.y).then_some(of)
    }

    fn set_size(
        &mut self,
        features: &Features,
        view: &FrameImages<'_>,
        width: f64,
        height: f64,
    ) -> Option<()> {
        let usable = SIDES_PX.contains(&width) && SIDES_PX.contains(&height);
        let size = (width.round() as usize, height.round() as usize);
        let stride = view.integral.stride();
        if usable && (self.scaled.size() != size || self.scaled.stride() != stride) {
            self.scaled = features.scaled(size.0, size.1, stride);
        }
        usable.then_some(())
    }
}

/// The search for one person in one frame.
struct Hunt<'a> {
    config: &'a Config,
    view: &'a FrameImages<'a>,
    target: &'a Target,
    scratch: &'a mut Scratch,
    /// Expected depth of the face, m.
    expected_m: Option<f64>,
}

impl Hunt<'_> {
    /// The best box around the expected one: coarsely, then finely.
    fn search(&mut self, expected: &Rect, dropped: &mut Dropped) -> Option<Scored> {
        let (width, height) = self.target.scaled.size();
        let width_px = width as f64;
        let centre = expected.centre();
        let x = (centre.x - 0.5 * width_px).round() as i64;
        let y = (centre.y - 0.5 * height as f64).round() as i64;
        self.scratch.coarse.clear();
        let full = self.config.full_search;
        let coarse_px = self.config.coarse_step * width_px;
        let step = if full { 1 } else { (coarse_px.round() as i64).max(1) };
        for (dx, dy) in disc(self.config.search_radius * width_px, step) {
            if let Some(scored) = self.look(x + dx, y + dy, Some(&mut *dropped)) {
                self.scratch.coarse.push(scored);
            }
        }
        let coarse = best(self.scratch.coarse.iter().copied())?;
        if full {
            return Some(coarse);
        }
        let fine_px = self.config.fine_radius * width_px;
        let fine_step = (fine_px / 5.0).round() as i64;
        let mut finest = coarse;
        for (dx, dy) in disc(fine_px, fine_step) {
            if let Some(scored) = self.look(coarse.x + dx, coarse.y + dy, None)
                && scored.confidence > finest.confidence
            {
                finest = scored;
            }
        }
        Some(finest)
    }

    /// Scores the box with this upper left corner; `None` where it is skipped. The fine search has
    /// no depth test: its boxes are those of one that passed.
    fn look(&mut self, x: i64, y: i64, dropped: Option<&mut Dropped>) -> Option<Scored> {
        if !self.target.scaled.fits(&self.view.integral, x, y) {
            dropped.into_iter().for_each(|d| d.outside += 1);
            return None;
        }
        if let Some(dropped) = dropped
            && !self.passes_depth(x, y, dropped)
        {
            return None;
        }
        let numbers = &mut self.scratch.numbers;
        self.target.scaled.measure(&self.view.integral, x as usize, y as usize, numbers);
        Some(Scored { x, y, confidence: self.target.appearance.confidence(numbers) })
    }

    /// P2: something in the box is within half a metre of the person.
    fn passes_depth(&self, x: i64, y: i64, dropped: &mut Dropped) -> bool {
        let (Some(depth), Some(expected)) = (self.view.depth, self.expected_m) else { return true };
        if !self.config.depth_filter {
            return true;
        }
        let (width, height) = self.target.scaled.size();
        match depth.surface_m(&Pixels { x, y, width, height }.rect()) {
            Some(m) if (m - expected).abs() < self.config.depth_tolerance_m => return true,
            Some(m) if expected - m > self.config.hidden_by_m => dropped.nearer += 1,
            _ => dropped.farther += 1,
        }
        false
    }

    /// Returns the confidence of the best box above that of all boxes elsewhere.
    fn lead(&self, best: Scored) -> f32 {
        let far = OTHER_MODE * self.target.scaled.size().0 as f64;
        let elsewhere = self.scratch.coarse.iter().filter(|other| {
            let dx = (other.x - best.x) as f64;
            let dy = (other.y - best.y) as f64;
            dx.hypot(dy) >= far
        });
        let second = elsewhere.map(|s| s.confidence).fold(f32::NEG_INFINITY, f32::max);
        best.confidence - second
    }
}

impl Dropped {
    /// Why no box is left: hidden if something nearer fills most of them.
    fn reason(&self) -> &'static str {
        match (self.nearer, self.farther, self.outside) {
            (near, far, out) if near + far < out => "appearance: outside the image",
            (near, far, _) if near > far => "appearance: hidden by something nearer",
            _ => "appearance: gone, something farther is seen",
        }
    }

    fn count(&self, funnel: &mut Funnel) {
        funnel.drop_many("box: outside", self.outside);
        funnel.drop_many("box: depth", self.nearer + self.farther);
    }
}

fn best(all: impl Iterator<Item = Scored>) -> Option<Scored> {
    all.max_by(|a, b| a.confidence.total_cmp(&b.confidence))
}

/// The place of a box: the head moves with it from where it was expected, to the
/// distance that the depth image shows.
fn sighting(
    config: &Config,
    camera: &Camera,
    track: &Track,
    region: Rect,
    face_m: Option<f64>,
) -> Detection {
    let expected = track.estimate.person.position;
    let (head_m, sigma_m) = match face_m {
        Some(face_m) => (face_m + HEAD_RADIUS_M, config.sigma_depth_m),
        None => (camera.depth_of(&expected), SIGMA_EXPECTED * camera.depth_of(&expected)),
    };
    let PointEstimate { position, covariance } = match camera.project(&expected) {
        Some(pixel) => {
            let before = track.estimate.region;
            let shift = region.centre() - before.centre();
            let grown = region.width / before.width.max(1.0);
            let pixel = before.centre() + shift + (pixel - before.centre()) * grown;
            camera.locate(pixel, head_m, config.sigma_box * region.width, sigma_m)
        }
        // A person behind the camera has no pixel: the answer is as good as none.
        None => PointEstimate { position: expected, covariance: Matrix3::identity() * 100.0 },
    };
    Detection::new(NAME, position, covariance, config.score)
        .with_image(ImageBox::upper_body(region))
}

impl Detector for Compressive {
    fn capabilities(&self) -> Capabilities {
        Capabilities::new(Inputs::NONE.require(Input::Colour).accept(Input::Depth)).tracking()
    }

    fn detect(
        &mut self,
        frame: &Frame,
        query: &Query<'_>,
        funnel: &mut Funnel,
    ) -> Result<Vec<Detection>> {
        match query {
            Query::Discover { .. } => Ok(Vec::new()),
            Query::Track(track) => {
                let view = FrameImages::of(frame)?;
                Ok(self.near(&view, track, funnel).into_iter().collect())
            }
        }
    }

    fn learn(&mut self, frame: &Frame, tracks: &[Track]) -> Result<()> {
        let view = FrameImages::of(frame)?;
        self.targets.retain(|id, _| tracks.iter().any(|track| track.id == *id));
        tracks.iter().for_each(|track| self.teach(&view, track));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, SMatrix, Vector2};
    use tagalong_core::{EgoMotion, Estimate, GreyImage, Images, Person, Stamp};
    use tagalong_geometry::Pinhole;

    use super::*;

    fn camera() -> Camera {
        Camera::mounted(Pinhole::centred(262.0, 320, 240), 320, 240, 1.3, 0.0, 0.0)
    }

    fn track(seen: bool, occluded: bool) -> Track {
        let position = Point3::new(3.0, 0.0, 1.35);
        let person = Person { position, velocity: Vector2::zeros() };
        let region = camera().upper_body(&position);
        Track::new(TrackId(1), Estimate::new(person, SMatrix::identity(), region), 1.0)
            .with_seen(seen)
            .with_occluded(occluded)
            .with_age(9)
    }

    /// The weight of the past after a sighting so sure and so far aside, widths.
    fn after(config: &Config, track: &Track, found: Option<(f64, f32)>) -> Option<f64> {
        let region = track.estimate.region;
        let found =
            found.map(|(off, sure)| (Rect { x: region.x + off * region.width, ..region }, sure));
        config.learning.rule().memory(config, track, found, false)
    }

    #[test]
    fn nothing_is_learnt_of_who_is_hidden_or_not_seen() {
        let config = Config::default();
        let sure = Some((0.0, 1.0));
        for (seen, occluded) in [(false, false), (true, true), (false, true)] {
            let track = track(seen, occluded);
            for found in [None, sure] {
                assert_eq!(after(&config, &track, found), None, "{seen} {occluded}");
            }
            assert_eq!(
                config.learning.rule().memory(&config, &track, None, true),
                None,
                "a model does not begin there"
            );
        }
    }

    #[test]
    fn the_past_weighs_by_who_saw_the_person_and_how_surely() {
        let config = Config::default();
        let track = track(true, false);
        assert_eq!(
            config.learning.rule().memory(&config, &track, None, true),
            Some(0.0),
            "the first frame counts fully"
        );
        // Another detector found the person: alone, or elsewhere.
        assert_eq!(after(&config, &track, None), Some(config.anchored_memory));
        assert_eq!(after(&config, &track, Some((0.5, 9.0))), Some(config.anchored_memory));
        // The overlap of a box that is off by a tenth of its width is 0.82, by a fifth 0.67.
        let least = config.learn_confidence as f32;
        assert_eq!(after(&config, &track, Some((0.1, least + 0.01))), Some(config.memory));
        assert_eq!(after(&config, &track, Some((0.1, least - 0.01))), None);
        assert_eq!(after(&config, &track, Some((0.2, 0.0))), Some(config.anchored_memory));
    }

    #[test]
    fn the_place_of_a_box_moves_and_grows_with_it() {
        // Depth that is measured is known better than one that is expected.
        fn spread(at: &Detection) -> f64 {
            at.covariance[(0, 0)].sqrt()
        }

        let config = Config::default();
        let camera = camera();
        let track = track(true, false);
        let before = track.estimate.region;
        let expected = track.estimate.person.position;
        let face_m = camera.depth_of(&expected) - HEAD_RADIUS_M;
        let there = sighting(&config, &camera, &track, before, Some(face_m));
        assert!((there.position - expected).norm() < 1e-9, "{}", there.position);
        assert_eq!((there.rect().unwrap(), there.score), (before, config.score));
        // Half a width to the right in the image, and 0.3 m farther away.
        let aside = Rect { x: before.x + 0.5 * before.width, ..before };
        let moved = sighting(&config, &camera, &track, aside, Some(face_m + 0.3));
        let pixel = camera.project(&moved.position).unwrap();
        let from = camera.project(&expected).unwrap();
        assert!((pixel.x - from.x - 0.5 * before.width).abs() < 1e-6, "{pixel}");
        assert!((camera.depth_of(&moved.position) - face_m - 0.3 - HEAD_RADIUS_M).abs() < 1e-9);
        // Twice as large about the same middle: the head is twice as far above it.
        let twice = Rect::new(
            before.x - 0.5 * before.width,
            before.y - 0.5 * before.height,
            2.0 * before.width,
            2.0 * before.height,
        );
        let grown = sighting(&config, &camera, &track, twice, Some(face_m));
        let grown = camera.project(&grown.position).unwrap();
        let [above, above_before] = [grown, from].map(|pixel| before.centre().y - pixel.y);
        let ratio = above / above_before;
        assert!((ratio - 2.0).abs() < 1e-6, "{ratio}");
        let guessed = sighting(&config, &camera, &track, before, None);
        assert!((guessed.position - expected).norm() < 1e-9);
        assert!((spread(&there) - config.sigma_depth_m).abs() < 0.02, "{}", spread(&there));
        let half_m = SIGMA_EXPECTED * camera.depth_of(&expected);
        assert!((spread(&guessed) - half_m).abs() < 0.02, "{}", spread(&guessed));
        let across = there.covariance[(1, 1)].sqrt();
        let expected = config.sigma_box * before.width / 262.0 * camera.depth_of(&expected);
        assert!((across - expected).abs() < 0.1 * expected, "{across} {expected}");
    }

    #[test]
    fn a_search_without_boxes_says_why() {
        for (nearer, farther, outside, reason) in [
            (3, 2, 6, "appearance: outside the image"),
            (3, 2, 5, "appearance: hidden by something nearer"),
            (2, 3, 5, "appearance: gone, something farther is seen"),
            (2, 2, 0, "appearance: gone, something farther is seen"),
        ] {
            assert_eq!(Dropped { outside, nearer, farther }.reason(), reason);
        }
        let mut funnel = Funnel::default();
        Dropped { outside: 5, nearer: 3, farther: 1 }.count(&mut funnel);
        assert_eq!((funnel.count("box: outside"), funnel.count("box: depth")), (5, 4));
    }

    #[test]
    fn the_lead_is_over_boxes_half_a_width_away_in_any_direction() {
        let config = Config::default();
        let features = Features::draw(10, 4, 1);
        let grey = Some(Arc::new(GreyImage::filled(320, 240, 90)));
        let images = Images { grey, ..Images::default() };
        let frame =
            Frame::new(1, Stamp::default(), Arc::new(camera()), EgoMotion::at_rest(0.1), images);
        let view = FrameImages::of(&frame).unwrap();
        let mut target = Target::new(10);
        target.fit_to(&features, &view, &Rect::new(100.0, 80.0, 40.0, 50.0)).unwrap();
        let none = f32::INFINITY;
        // Half a width is 20 pixels, along the columns, along the rows, and across both.
        let mut cases = [
            (120, 80, 1.0),
            (119, 80, none),
            (80, 80, 1.0),
            (81, 80, none),
            (100, 100, 1.0),
            (100, 99, none),
            (100, 60, 1.0),
            (112, 96, 1.0),
            (112, 95, none),
            (88, 64, 1.0),
        ]
        .map(|(x, y, expected)| (vec![(x, y, 4.0)], expected))
        .to_vec();
        // Over the best of those elsewhere.
        cases.push((vec![(105, 80, 4.9), (140, 80, 2.0), (60, 80, 3.5), (100, 40, 3.0)], 1.5));
        for (others, expected) in cases {
            let coarse =
                others.iter().map(|&(x, y, confidence)| Scored { x, y, confidence }).collect();
            let mut scratch = Scratch { coarse, ..Scratch::default() };
            let hunt = Hunt {
                config: &config,
                view: &view,
                target: &target,
                scratch: &mut scratch,
                expected_m: None,
            };
            let lead = hunt.lead(Scored { x: 100, y: 80, confidence: 5.0 });
            assert_eq!(lead, expected, "{others:?}");
        }
    }
}
