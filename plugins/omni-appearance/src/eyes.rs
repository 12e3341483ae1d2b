use tagalong_core::{EgoMotion, Frame, Funnel, Result, Stamp, Track};
use tagalong_geometry::Panorama;

use crate::background::{HELD, Pace, TURNS};
use crate::changes::Changes;
use crate::expected::{Expected, Known, divided};
use crate::warp::{Bounds, Sweep, Warp, is_moving};
use crate::{AfterMeasuring, Background, Blob, Config, PanoramaGeometry, Segmenter};

/// Tracks the background over the images, and finds the blobs that differ from it.
pub struct Eyes {
    config: Config,
    scene: Option<ImageState>,
}

/// State that is kept between images of one size.
struct ImageState {
    size: (usize, usize),
    background: Background,
    segmenter: Segmenter,
    bounds: Bounds,
    sweep: Sweep,
    changes: Changes,
    /// Background pixels that must not follow the image at once, and those that must not at all.
    taken: Vec<u8>,
    /// Frame number and time of the image in `blobs`.
    seen: Option<(u64, Stamp)>,
    blobs: Vec<Blob>,
    /// Tracks that were known after the previous image.
    known: Vec<Known>,
    /// True if the robot has moved since the background was made.
    uncertain: bool,
    /// Grey images converted to three equal colours.
    grey: Vec<u8>,
    /// Number of images since the background was made.
    phase: usize,
}

impl Eyes {
    /// Creates a detector of blobs without a background.
    ///
    /// # Errors
    /// [`tagalong_core::Error::Settings`] for settings outside their ranges.
    pub fn new(config: Config) -> Result<Self> {
        config.check()?;
        Ok(Self { config, scene: None })
    }

    /// Returns true once the background is known.
    pub fn is_ready(&self) -> bool {
        self.scene
            .as_ref()
            .is_some_and(|scene| scene.background.frames() >= self.config.background_frames)
    }

    /// Returns the blobs of an image that may be people, the largest first. Empty while the
    /// background is being made.
    ///
    /// # Errors
    /// [`tagalong_core::Error::MissingImage`] for a frame with neither colour nor grey.
    pub fn look(&mut self, frame: &Frame, funnel: &mut Funnel) -> Result<Vec<Blob>> {
        let Some(panorama) = frame.camera.panorama() else {
            funnel.drop_many("no panorama", 1);
            return Ok(Vec::new());
        };
        let grey = frame.colour().is_err();
        let size = if grey {
            (frame.grey()?.width(), frame.grey()?.height())
        } else {
            (frame.colour()?.width(), frame.colour()?.height())
        };
        if size != (panorama.columns, panorama.rows) || size.0 < 8 || size.1 < 8 {
            funnel.drop_many("image of another size", 1);
            return Ok(Vec::new());
        }
        let scene = match &mut self.scene {
            // A clock that was set back means another recording.
            Some(scene)
                if scene.size == size
                    && scene.seen.is_none_or(|(_, stamp)| stamp <= frame.stamp) =>
            {
                scene
            }
            scene => scene.insert(ImageState::new(size, &self.config)),
        };
        if scene.seen != Some((frame.index, frame.stamp)) {
            scene.seen = Some((frame.index, frame.stamp));
            scene.see(frame, grey, &self.config, funnel)?;
        }
        Ok(scene.blobs.clone())
    }

    /// Lets the background follow the last processed image, and stores the known tracks; to be
    /// called once after each image.
    ///
    /// # Errors
    /// [`tagalong_core::Error::MissingImage`] for a frame without images.
    pub fn adapt(&mut self, frame: &Frame, tracks: &[Track]) -> Result<()> {
        let Some(scene) = &mut self.scene else { return Ok(()) };
        if scene.seen == Some((frame.index, frame.stamp)) {
            scene.known = tracks.iter().filter_map(Known::of).collect();
            scene.adapt(frame, &self.config)?;
        }
        Ok(())
    }
}

impl ImageState {
    fn new(size: (usize, usize), config: &Config) -> Self {
        Self {
            size,
            background: Background::new(size.0, size.1),
            segmenter: Segmenter::new(size.0, config),
            bounds: Bounds::default(),
            sweep: Sweep::default(),
            changes: Changes::default(),
            taken: Vec::new(),
            seen: None,
            blobs: Vec::new(),
            known: Vec::new(),
            uncertain: false,
            grey: Vec::new(),
            phase: 0,
        }
    }

    /// Processes an image: adds it to the background at first, and searches for blobs later.
    fn see(
        &mut self,
        frame: &Frame,
        grey: bool,
        config: &Config,
        funnel: &mut Funnel,
    ) -> Result<()> {
        self.blobs.clear();
        if grey {
            self.grey.clear();
            self.grey.extend(frame.grey()?.pixels().iter().flat_map(|v| [*v; 3]));
        }
        self.follow_robot(frame, grey, config)?;
        let Self { background, segmenter, bounds, .. } = self;
        let colours = if grey { &self.grey[..] } else { frame.colour()?.pixels().as_flattened() };
        let learning = background.frames() < config.background_frames;
        if learning {
            // The spread of a few images is too uncertain to compare with.
            if background.frames() > 4 && !self.uncertain {
                segmenter.compare(colours, background, !grey, config);
                segmenter.learn_empty(config);
            }
            if self.uncertain {
                background.add_moving(colours, config);
            } else {
                background.add(colours, config);
            }
            funnel.drop_many("background is being learned", 1);
            return Ok(());
        }
        // After a motion the background is known to a few pixels only: a pixel differs if it
        // fits none of them.
        if self.uncertain {
            bounds.of(&background.level, self.size.0, config.slack_px);
            let between = [&bounds.low[..], &bounds.high[..]];
            segmenter.compare_between(colours, between, background, !grey, config);
        } else {
            segmenter.compare(colours, background, !grey, config);
        }
        let expected = expected(&self.known, frame);
        self.blobs = people(segmenter, colours, &expected, config, funnel);
        if config.changed_part > 0.0 {
            self.changes.keep(colours);
        }
        self.drop_static(config, funnel);
        Ok(())
    }

    /// Drops blobs that show what the previous image showed: edges of furniture that the moved
    /// background has in another place.
    fn drop_static(&mut self, config: &Config, funnel: &mut Funnel) {
        let solid = &self.segmenter.counts().solid;
        let width = self.size.0;
        let before = self.blobs.len();
        let changes = &self.changes;
        self.blobs.retain(|blob| changes.part(blob.run, width, solid) >= config.changed_part);
        funnel.drop_many("no change since the last image", (before - self.blobs.len()) as u64);
    }

    /// Moves the background and the previous image with the robot.
    fn follow_robot(&mut self, frame: &Frame, grey: bool, config: &Config) -> Result<()> {
        self.changes.clear();
        let Some(panorama) = frame.camera.panorama() else { return Ok(()) };
        if self.background.frames() == 0 {
            return Ok(());
        }
        let colours = if grey { &self.grey[..] } else { frame.colour()?.pixels().as_flattened() };
        let mut last_warps = None;
        if is_moving(&frame.motion) {
            self.uncertain = true;
            let warps = last_warps.insert(warps_of(&frame.motion, frame, panorama, config));
            self.background.move_by(&mut self.sweep, warps, colours);
        }
        self.changes.move_by(&frame.motion);
        let compared =
            self.changes.motion().filter(|_| self.uncertain && config.changed_part > 0.0);
        if let Some(since) = compared {
            let warps = last_warps.filter(|_| since == frame.motion);
            let warps = warps.unwrap_or_else(|| warps_of(&since, frame, panorama, config));
            self.changes.compare(&mut self.sweep, &warps, colours);
        }
        Ok(())
    }

    /// Lets the background follow the pixels that are not taken for people.
    fn adapt(&mut self, frame: &Frame, config: &Config) -> Result<()> {
        fn seconds(s: f64) -> f32 {
            if s > 0.0 { s as f32 } else { f32::INFINITY }
        }

        if self.background.frames() < config.background_frames {
            return Ok(());
        }
        let dt_s = frame.motion.dt as f32;
        let adapt_s = seconds(config.adapt_s);
        let absorb_s = seconds(config.absorb_s);
        // Errors of the odometry accumulate in a moved background, so it is renewed soon.
        let (adapt_s, absorb_s, turns) = if self.uncertain {
            (adapt_s.min(MOVING_ADAPT_S), absorb_s.min(MOVING_ABSORB_S), 1)
        } else {
            (adapt_s, absorb_s, TURNS)
        };
        let pace = Pace { part: dt_s / adapt_s, absorb_s, dt_s, turns };
        self.taken.clone_from(&self.segmenter.counts().taken);
        if self.uncertain {
            self.hold_people(frame);
        }
        let colour = frame.colour().ok();
        let colours = colour.map_or(&self.grey[..], |c| c.pixels().as_flattened());
        self.background.follow(colours, &self.taken, &pace, self.phase);
        self.phase = self.phase.wrapping_add(1);
        Ok(())
    }

    /// Holds the background where people are known: it is renewed so fast while the robot moves that
    /// it would take in who stays at one bearing.
    fn hold_people(&mut self, frame: &Frame) {
        let Some(view) = PanoramaGeometry::of(&frame.camera) else { return };
        let width = self.size.0;
        for person in self.known.iter().map(|known| Expected::of(known, frame, &view)) {
            for column in (0..width).filter(|c| person.is_near(*c, width, HELD_HALVES)) {
                self.taken.iter_mut().skip(column).step_by(width).for_each(|taken| *taken = HELD);
            }
        }
    }
}

/// Half widths of a known person to each side of it within which the background is held.
const HELD_HALVES: f64 = 1.3;
/// Time constant of the background while the robot moves, s.
const MOVING_ADAPT_S: f32 = 0.5;
/// Time after which a differing pixel becomes background while the robot moves, s: a difference
/// that stays in its place is not a walking person, unless a person is known there.
const MOVING_ABSORB_S: f32 = 4.0;

/// Returns where pixels come from by a motion, for each distance of a wall; none for a robot at rest.
fn warps_of(motion: &EgoMotion, frame: &Frame, panorama: &Panorama, config: &Config) -> Vec<Warp> {
    let walls = config.walls_m.iter().filter(|_| is_moving(motion));
    walls.map(|wall_m| Warp::new(&frame.camera, panorama, motion, *wall_m)).collect()
}

/// Returns the expected columns of the tracks that were known after the previous image.
fn expected(known: &[Known], frame: &Frame) -> Vec<Expected> {
    let Some(view) = PanoramaGeometry::of(&frame.camera) else { return Vec::new() };
    let dt_s = frame.motion.dt;
    let moved = frame.motion.isometry();
    known.iter().map(|known| Expected::of(&known.moved(dt_s, &moved), frame, &view)).collect()
}

/// Returns the largest runs that may be people, largest first.
fn people(
    segmenter: &Segmenter,
    colours: &[u8],
    expected: &[Expected],
    config: &Config,
    funnel: &mut Funnel,
) -> Vec<Blob> {
    let mut blobs = Vec::new();
    let width = segmenter.counts().columns.len();
    let runs = segmenter.runs(config);
    for part in runs.iter().flat_map(|run| divided(*run, width, expected)) {
        let measured = Blob::measure(part.run, segmenter.counts(), colours);
        match measured.filter(|blob| blob.features.pixels >= f64::from(config.min_pixels)) {
            Some(blob) => blobs.push(Blob { visible: part.visible, ..blob }),
            None => funnel.drop_many("too few pixels", 1),
        }
    }
    blobs.sort_by(|a, b| b.features.pixels.total_cmp(&a.features.pixels));
    funnel.drop_many("too many people", blobs.len().saturating_sub(config.max_people) as u64);
    blobs.truncate(config.max_people);
    if let Some(AfterMeasuring { correct, .. }) = config.after_measuring {
        blobs.iter_mut().for_each(|blob| correct(blob, &segmenter.counts().columns));
    }
    blobs
}
