use nalgebra::Matrix3;
use tagalong_core::{
    Camera, Context, DepthImage, Detection, Detector, Frame, Funnel, HEAD_RADIUS_M, Rect, Result,
    Search, UPPER_BODY_SIDE_M,
};

use crate::{Config, Kind, Model, NAME, Scanner, Window, merge};

/// The models that are part of the program.
const TREES: &str = include_str!("../../../configs/models/hog-upper-body.toml");
const LINEAR: &str = include_str!("../../../configs/models/hog-upper-body-linear.toml");

/// Finds heads and shoulders.
pub struct HogUpperBody {
    config: Config,
    model: Model,
    scanner: Scanner,
    windows: Vec<Window>,
}

impl HogUpperBody {
    /// A detector; reads its model.
    ///
    /// # Errors
    /// [`tagalong_core::Error::Model`] for a file that cannot be read or is no model,
    /// [`tagalong_core::Error::Settings`] for numbers that cannot work.
    pub fn new(config: Config, context: &Context) -> Result<Self> {
        config.check()?;
        let built_in = if config.machine == Kind::Linear { LINEAR } else { TREES };
        let model = context.model(&config.model, built_in, Model::from_text)?;
        Ok(Self { config, scanner: Scanner::new(&model), windows: Vec::new(), model })
    }

    fn detection(&self, camera: &Camera, window: &Window) -> Option<Detection> {
        let config = &self.config;
        let by_size = camera.focal_px() * UPPER_BODY_SIDE_M / window.region.width;
        let (face_m, sigma_m) = match window.depth_m {
            Some(depth_m) => (depth_m, config.sigma_depth_m),
            None => (by_size, by_size * config.sigma_distance),
        };
        let sigma_px = config.sigma_place * window.region.width;
        let depth_m = face_m + HEAD_RADIUS_M;
        let covariance: Matrix3<f64> =
            camera.covariance(window.region.centre(), depth_m, sigma_px, sigma_m);
        let detection = Detection {
            region: window.region,
            position: camera.head_of(&window.region, face_m),
            covariance,
            score: self.model.log_odds(window.sum).min(config.max_score),
            source: NAME,
        };
        detection.is_sane().then_some(detection)
    }
}

/// The sizes that are looked for, pixels.
fn sides(config: &Config, camera: &Camera) -> impl Iterator<Item = f64> + use<> {
    let most = config.max_side * camera.width.min(camera.height) as f64;
    let step = config.scale_step;
    std::iter::successors(Some(config.min_side_px), move |side| Some(side * step))
        .take_while(move |side| *side <= most)
}

/// Which windows are worth a look, and how many were not, by test.
struct Proposer<'a> {
    config: &'a Config,
    camera: &'a Camera,
    depth: Option<&'a DepthImage>,
    /// The square that a search near a track expects.
    near: Option<Rect>,
    unfit: u64,
    out_of_place: u64,
}

impl Proposer<'_> {
    /// The depth of what the square shows, where it is known; `None` for
    /// squares that are not worth a look.
    fn propose(&mut self, square: &Rect) -> Option<Option<f64>> {
        if !self.is_near(square) {
            return None;
        }
        let Some(depth) = self.depth else { return Some(None) };
        let config = self.config;
        let fits_m = self.camera.focal_px() * UPPER_BODY_SIDE_M / square.width;
        let nearest_m = (fits_m / config.size_tolerance).max(config.min_depth_m);
        let farthest_m = (fits_m * config.size_tolerance).min(config.max_depth_m);
        let Some(face_m) = depth.surface_within(square, nearest_m..=farthest_m) else {
            self.unfit += 1;
            return None;
        };
        let height_m = self.camera.head_of(square, face_m).z;
        if !(config.min_head_height_m..=config.max_head_height_m).contains(&height_m) {
            self.out_of_place += 1;
            return None;
        }
        Some(Some(face_m))
    }

    fn is_near(&self, square: &Rect) -> bool {
        self.near.is_none_or(|expected| {
            let off = (square.centre() - expected.centre()).norm();
            let ratio = square.width / expected.width.max(1.0);
            off < self.config.near * expected.width && (0.7..=1.4).contains(&ratio)
        })
    }
}

impl Detector for HogUpperBody {
    fn detect(
        &mut self,
        frame: &Frame,
        search: &Search<'_>,
        funnel: &mut Funnel,
    ) -> Result<Vec<Detection>> {
        let grey = frame.grey()?;
        let camera = &*frame.camera;
        let depth = frame.images().depth.as_deref().filter(|_| self.config.depth_proposals);
        let near = match search {
            Search::Near(track) => Some(track.estimate.region),
            Search::Everywhere { .. } => None,
        };
        let Self { config, model, scanner, windows } = self;
        let mut proposer = Proposer { config, camera, depth, near, unfit: 0, out_of_place: 0 };
        let (sides, least) = (sides(config, camera), model.sum_at(config.min_score));
        let before = scanner.looked_at();
        windows.clear();
        scanner.scan(grey, sides, least, |square| proposer.propose(square), windows);
        let looked_at = scanner.looked_at() - before;
        funnel.drop_many("window: size and depth", proposer.unfit);
        funnel.drop_many("window: head height", proposer.out_of_place);
        funnel.drop_many("window: gradients", looked_at - windows.len() as u64);
        let all = windows.len();
        merge(windows, config.overlap, config.apart_m);
        funnel.drop_many("window: beside a better one", (all - windows.len()) as u64);
        let mut found: Vec<Detection> =
            self.windows.iter().filter_map(|window| self.detection(camera, window)).collect();
        if near.is_some() {
            found.truncate(1);
        }
        Ok(found)
    }
}
