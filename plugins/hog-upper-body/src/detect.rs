use nalgebra::Matrix3;
use tagalong_core::{
    Camera, Context, DepthImage, Detection, Detector, Frame, Funnel, HEAD_RADIUS_M, Rect, Result,
    Search, UPPER_BODY_SIDE_M,
};

use crate::{Config, Kind, Model, NAME, Scanner, Window, merge};

/// The models that are part of the program.
const TREES: &str = include_str!("../../../configs/models/hog-upper-body.toml");
const LINEAR: &str = include_str!("../../../configs/models/hog-upper-body-linear.toml");

/// Places a side at which the depth of a window is read.
const TAPS: usize = 5;
/// Depth readings that a window needs.
const LEAST_READINGS: usize = 8;

/// Finds heads and shoulders.
pub struct HogUpperBody {
    config: Config,
    model: Model,
    scanner: Scanner,
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
        Ok(Self { config, scanner: Scanner::new(model.kind()), model })
    }

    /// The sizes that are looked for, pixels.
    fn sides(&self, camera: &Camera) -> impl Iterator<Item = f64> + use<> {
        let most = self.config.max_side * camera.width.min(camera.height) as f64;
        let step = self.config.scale_step;
        std::iter::successors(Some(self.config.min_side_px), move |side| Some(side * step))
            .take_while(move |side| *side <= most)
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

/// The median depth in the middle of a square, m.
fn surface_m(depth: &DepthImage, square: &Rect) -> Option<f64> {
    let mut readings = [0.0_f32; TAPS * TAPS];
    let mut count = 0;
    let tap = |from: f64, size: f64, i: usize| (from + size * (0.3 + 0.1 * i as f64)) as i64;
    for row in 0..TAPS {
        for column in 0..TAPS {
            let x = tap(square.x, square.width, column);
            let y = tap(square.y, square.height, row);
            if let Some(metres) = depth.get(x, y).filter(|m| m.is_finite() && *m > 0.0) {
                readings[count] = metres;
                count += 1;
            }
        }
    }
    let readings = &mut readings[..count];
    (count >= LEAST_READINGS).then(|| {
        let (_, median, _) = readings.select_nth_unstable_by(count / 2, f32::total_cmp);
        f64::from(*median)
    })
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
        let (config, focal) = (self.config, self.camera.focal_px());
        let face_m = surface_m(depth, square).filter(|m| {
            let fits = focal * UPPER_BODY_SIDE_M / (m * square.width);
            let is_fit = fits <= config.size_tolerance && fits >= 1.0 / config.size_tolerance;
            is_fit && (config.min_depth_m..=config.max_depth_m).contains(m)
        });
        let Some(face_m) = face_m else {
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
        let config = self.config.clone();
        let mut proposer =
            Proposer { config: &config, camera, depth, near, unfit: 0, out_of_place: 0 };
        let least = self.model.sum_at(config.min_score);
        let sides = self.sides(camera);
        let propose = |square: &Rect| proposer.propose(square);
        let before = self.scanner.looked_at();
        let windows = self.scanner.scan(grey, &self.model, sides, least, propose);
        let looked_at = self.scanner.looked_at() - before;
        funnel.drop_many("window: size and depth", proposer.unfit);
        funnel.drop_many("window: head height", proposer.out_of_place);
        funnel.drop_many("window: gradients", looked_at - windows.len() as u64);
        let all = windows.len();
        let best = merge(windows, config.overlap, config.apart_m);
        funnel.drop_many("window: beside a better one", (all - best.len()) as u64);
        let mut found: Vec<Detection> =
            best.iter().filter_map(|window| self.detection(camera, window)).collect();
        if near.is_some() {
            found.truncate(1);
        }
        Ok(found)
    }
}
