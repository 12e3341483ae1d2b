use std::sync::Arc;

use nalgebra::{Matrix3, Point3, Vector3};
use tagalong_core::{
    Camera, Context, Detection, Detector, Error, Frame, Funnel, Result, Search, Stamp, Track,
};

use crate::warp::{Bounds, Warp, is_moving};
use crate::{Background, Blob, Config, Geometry, Model, NAME, Segmenter, View};

/// The model that is part of the program.
const BUILT_IN: &str = include_str!("../../../configs/models/omni-distance.toml");
/// The top of a head is so far above its centre, m.
const HALF_HEAD_M: f64 = 0.115;
/// Score of somebody of ordinary height, and what a height off by a standard
/// deviation of this many metres costs.
const SURE: f64 = 3.0;
const STATURE: [f64; 2] = [1.6, 0.2];
/// A search near a track takes what is within so many standard deviations.
const NEAR_SIGMAS: f64 = 3.0;

/// The detector.
pub struct OmniAppearance {
    config: Config,
    model: Model,
    scene: Option<Scene>,
}

/// What is kept from image to image of one size.
struct Scene {
    size: (usize, usize),
    background: Background,
    segmenter: Segmenter,
    bounds: Bounds,
    moved: Vec<f32>,
    /// The image that was looked at last, and who is in it.
    seen: Option<(u64, Stamp)>,
    blobs: Vec<Blob>,
    /// The robot has moved since the background was made.
    uncertain: bool,
    /// Grey images as colours.
    grey: Vec<u8>,
}

impl OmniAppearance {
    /// A detector; reads its model.
    ///
    /// # Errors
    /// [`Error::Model`] for a file that cannot be read or is no model, or a
    /// person whom it does not know; [`Error::Settings`] for impossible numbers.
    pub fn new(config: Config, context: &Context) -> Result<Self> {
        config.check()?;
        let model = read(&config.model, context)?;
        let known = ["general", "nearest"].contains(&config.person.as_str())
            || model.people.iter().any(|person| person.name == config.person);
        if !known {
            let names: Vec<&str> = model.people.iter().map(|p| p.name.as_str()).collect();
            let why = format!("it does not know `{}`, only {names:?}", config.person);
            return Err(Error::Model { path: config.model, why });
        }
        Ok(Self { config, model, scene: None })
    }

    /// The model in use.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Who may be in an image: what [`Detector::detect`] turns into places. Empty
    /// while the background is being made.
    ///
    /// # Errors
    /// [`Error::MissingImage`] for a frame with neither colour nor grey.
    pub fn look(&mut self, frame: &Frame, funnel: &mut Funnel) -> Result<Vec<Blob>> {
        let Some(panorama) = frame.camera.panorama() else {
            funnel.drop_many("no panorama", 1);
            return Ok(Vec::new());
        };
        let grey = frame.images().colour.is_none();
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
            Some(scene) if scene.size == size => scene,
            scene => scene.insert(Scene::new(size, &self.config)),
        };
        if scene.seen != Some((frame.index, frame.stamp)) {
            scene.seen = Some((frame.index, frame.stamp));
            scene.see(frame, grey, &self.config, funnel)?;
        }
        Ok(scene.blobs.clone())
    }

    /// The place of somebody.
    fn placed(&self, blob: &Blob, camera: &Camera, view: &View<'_>) -> Detection {
        let how = self.config.distance;
        let head = self.model.head(&self.config.person, blob, view, how);
        let (distance, sigma) = head.distance(&blob.features, view, how);
        let distance = distance.clamp(0.3, 30.0);
        let bearing = view.panorama.bearing(blob.column);
        let (sine, cosine) = bearing.sin_cos();
        let flat = Point3::new(distance * sine, -distance * cosine, 0.0);
        let mut position = camera.robot_from_camera * flat;
        let [low, high] = self.config.head_height_m;
        let top = view.top_m(&blob.features, distance);
        position.z = (top - HALF_HEAD_M).clamp(low - 0.5, high + 0.5);
        Detection {
            region: camera.upper_body(&position),
            position,
            covariance: self.covariance(&position, camera, distance, sigma),
            score: self.score(position.z),
            source: NAME,
        }
    }

    /// Polar: the distance's own spread along the ray, the bearing's across.
    fn covariance(
        &self,
        position: &Point3<f64>,
        camera: &Camera,
        distance: f64,
        sigma: f64,
    ) -> Matrix3<f64> {
        let from = camera.robot_from_camera.translation.vector;
        let out = Vector3::new(position.x - from.x, position.y - from.y, 0.0);
        let out = out.try_normalize(1e-9).unwrap_or_else(Vector3::x);
        let aside = Vector3::new(-out.y, out.x, 0.0);
        let across = distance * self.config.sigma_bearing_deg.to_radians();
        out * out.transpose() * (sigma * sigma)
            + aside * aside.transpose() * (across * across).max(1e-6)
            + Vector3::z() * Vector3::z().transpose() * self.config.sigma_height_m.powi(2)
    }

    fn score(&self, height_m: f64) -> f64 {
        let [usual, sigma] = STATURE;
        let off = (height_m - usual) / sigma;
        (SURE - 0.5 * off * off).max(-SURE)
    }

    fn check_camera(&self, view: &View<'_>) -> Result<()> {
        if self.model.geometry.is_like(&Geometry::of(view))
            || self.config.distance == crate::Distance::Analytic
        {
            return Ok(());
        }
        let why = format!(
            "it was fitted for another camera ({:?}) than this one ({:?}); train one for this \
             camera, or set distance = \"analytic\"",
            self.model.geometry,
            Geometry::of(view)
        );
        Err(Error::Model { path: self.config.model.clone(), why })
    }
}

impl Detector for OmniAppearance {
    fn detect(
        &mut self,
        frame: &Frame,
        search: &Search<'_>,
        funnel: &mut Funnel,
    ) -> Result<Vec<Detection>> {
        let blobs = self.look(frame, funnel)?;
        let Some(view) = View::of(&frame.camera).filter(|_| !blobs.is_empty()) else {
            return Ok(Vec::new());
        };
        self.check_camera(&view)?;
        let [low, high] = self.config.head_height_m;
        let mut found = Vec::new();
        for blob in &blobs {
            let person = self.placed(blob, &frame.camera, &view);
            if !(low..=high).contains(&person.position.z) {
                funnel.drop_at("head height", person.region);
            } else if !fits(search, &person) {
                funnel.drop_at("not near the track", person.region);
            } else {
                found.push(person);
            }
        }
        Ok(found)
    }

    fn learn(&mut self, frame: &Frame, _: &[Track]) -> Result<()> {
        let Some(scene) = &mut self.scene else { return Ok(()) };
        if scene.seen == Some((frame.index, frame.stamp)) {
            scene.adapt(frame, &self.config)?;
        }
        Ok(())
    }
}

/// Whether a search wants somebody.
fn fits(search: &Search<'_>, person: &Detection) -> bool {
    match search {
        Search::Everywhere { .. } => true,
        Search::Near(track) => {
            let off = (person.position - track.estimate.person.position).xy();
            let spread = track.estimate.covariance.fixed_view::<2, 2>(0, 0).trace();
            off.norm() <= NEAR_SIGMAS * (0.5 * spread).sqrt() + 0.3
        }
    }
}

impl Scene {
    fn new(size: (usize, usize), config: &Config) -> Self {
        Self {
            size,
            background: Background::new(size.0, size.1),
            segmenter: Segmenter::new(size.0, config),
            bounds: Bounds::default(),
            moved: Vec::new(),
            seen: None,
            blobs: Vec::new(),
            uncertain: false,
            grey: Vec::new(),
        }
    }

    /// Looks at an image: part of the background at first, then who differs.
    fn see(&mut self, frame: &Frame, grey: bool, config: &Config, funnel: &mut Funnel) -> Result<()> {
        self.blobs.clear();
        if grey {
            self.grey.clear();
            self.grey.extend(frame.grey()?.pixels().iter().flat_map(|v| [*v; 3]));
        }
        self.follow_robot(frame, config);
        let Self { background, segmenter, bounds, .. } = self;
        let colours = if grey { &self.grey[..] } else { frame.colour()?.pixels().as_flattened() };
        let learning = background.frames() < config.background_frames;
        if learning {
            // The spread of a few images is no measure for anything.
            if background.frames() > 4 {
                segmenter.compare(colours, background, !grey, config);
                segmenter.learn_empty(config);
            }
            background.add(colours, config);
            funnel.drop_many("background is being learned", 1);
            return Ok(());
        }
        if self.uncertain {
            bounds.of(&background.level, self.size.0, config.slack_px);
            let between = [&bounds.low[..], &bounds.high[..]];
            segmenter.compare_between(colours, between, background, !grey, config);
        } else {
            segmenter.compare(colours, background, !grey, config);
        }
        self.blobs = people(segmenter, colours, config, funnel);
        Ok(())
    }

    fn follow_robot(&mut self, frame: &Frame, config: &Config) {
        let Some(panorama) = frame.camera.panorama() else { return };
        if self.background.frames() == 0 || !is_moving(&frame.motion) {
            return;
        }
        self.uncertain = true;
        let warp = Warp::new(&frame.camera, panorama, &frame.motion, config.wall_m);
        self.background.move_by(|from, to| warp.apply(from, to), &mut self.moved);
    }

    /// The background follows what is not taken for people.
    fn adapt(&mut self, frame: &Frame, config: &Config) -> Result<()> {
        if self.background.frames() < config.background_frames {
            return Ok(());
        }
        // What is carried along by the odometry must be renewed soon.
        let after = if self.uncertain { config.adapt_s.min(MOVING_ADAPT_S) } else { config.adapt_s };
        let part = |time_s: f64| {
            if time_s > 0.0 { (frame.motion.dt / time_s).min(1.0) as f32 } else { 0.0 }
        };
        let (free, taken) = (part(after), part(config.absorb_s));
        if free == 0.0 && taken == 0.0 {
            return Ok(());
        }
        let colour = frame.images().colour.as_ref().map(Arc::clone);
        let colours = colour.as_deref().map_or(&self.grey[..], |c| c.pixels().as_flattened());
        self.background.follow(colours, &self.segmenter.counts().solid, free, taken);
        Ok(())
    }
}

/// The background follows within this while the robot moves, s.
const MOVING_ADAPT_S: f64 = 1.0;

/// The largest runs that may be people, largest first.
fn people(
    segmenter: &Segmenter,
    colours: &[u8],
    config: &Config,
    funnel: &mut Funnel,
) -> Vec<Blob> {
    let mut blobs = Vec::new();
    for run in segmenter.runs(config) {
        let measured = Blob::measure(run, segmenter.counts(), colours);
        match measured.filter(|blob| blob.features.pixels >= f64::from(config.min_pixels)) {
            Some(blob) => blobs.push(blob),
            None => funnel.drop_many("too few pixels", 1),
        }
    }
    blobs.sort_by(|a, b| b.features.pixels.total_cmp(&a.features.pixels));
    funnel.drop_many("too many people", blobs.len().saturating_sub(config.max_people) as u64);
    blobs.truncate(config.max_people);
    if config.compat_printed_seam {
        let width = segmenter.counts().columns.len();
        blobs.iter_mut().for_each(|blob| forget_the_seam(blob, width, segmenter));
    }
    blobs
}

/// As printed: mean and extent of column numbers, as if none followed the last.
fn forget_the_seam(blob: &mut Blob, width: usize, segmenter: &Segmenter) {
    if blob.run.first + blob.run.length <= width {
        return;
    }
    let counts = &segmenter.counts().columns;
    let weight = |column: usize| f64::from(counts[column]);
    let total: f64 = blob.run.columns(width).map(weight).sum();
    let sum: f64 = blob.run.columns(width).map(|column| column as f64 * weight(column)).sum();
    blob.column = sum / total.max(1.0);
    blob.features.width = width as f64;
}

fn read(file: &str, context: &Context) -> Result<Model> {
    let broken = |why: String| Error::Model { path: file.into(), why };
    if file.is_empty() {
        return Model::from_text(BUILT_IN).map_err(broken);
    }
    let text = std::fs::read_to_string(context.base_dir.join(file))
        .map_err(|error| broken(error.to_string()))?;
    Model::from_text(&text).map_err(broken)
}
