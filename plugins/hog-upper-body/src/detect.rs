use std::ops::RangeInclusive;

use nalgebra::Matrix3;
use tagalong_core::{
    Camera, Capabilities, Context, DepthImage, Detection, Detector, Frame, Funnel, HEAD_RADIUS_M,
    Input, Inputs, Rect, Result, Search, UPPER_BODY_SIDE_M,
};

use crate::lattice::Lattice;
use crate::{Config, Grid, Kind, Model, NAME, Scanner, Wanted, Window, merge};

/// The models that are part of the program.
const TREES: &str = include_str!("../../../configs/models/hog-upper-body.toml");
const LINEAR: &str = include_str!("../../../configs/models/hog-upper-body-linear.toml");

/// What is above a head is looked at so far above the square, sides; the windows that show
/// a head best end there well above it.
const ABOVE: f64 = 0.25;
/// In so many places.
const TAPS: usize = 5;
/// A search near a track looks at windows so many times as wide as the track expects.
const ALIKE: RangeInclusive<f64> = 0.7..=1.4;

/// Finds heads and shoulders.
pub struct HogUpperBody {
    config: Config,
    model: Model,
    scanner: Scanner,
    lattice: Lattice,
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
        let (scanner, lattice) = (Scanner::new(&model), Lattice::default());
        Ok(Self { config, model, scanner, lattice, windows: Vec::new() })
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

/// The sizes that are looked for, pixels; near a track, those like its own.
fn sides(config: &Config, camera: &Camera, near: Option<Rect>) -> impl Iterator<Item = f64> {
    let most = config.max_side * camera.width.min(camera.height) as f64;
    let step = config.scale_step;
    std::iter::successors(Some(config.min_side_px), move |side| Some(side * step))
        .take_while(move |side| *side <= most)
        .filter(move |side| near.is_none_or(|near| ALIKE.contains(&(side / near.width.max(1.0)))))
}

/// Which windows are worth a look, and how many were not, by test.
struct Proposer<'a> {
    config: &'a Config,
    camera: &'a Camera,
    depth: Option<&'a DepthImage>,
    lattice: &'a mut Lattice,
    /// The square that a search near a track expects.
    near: Option<Rect>,
    unfit: u64,
    goes_on: u64,
    out_of_place: u64,
}

impl<'a> Proposer<'a> {
    fn new(
        config: &'a Config,
        camera: &'a Camera,
        depth: Option<&'a DepthImage>,
        lattice: &'a mut Lattice,
        near: Option<Rect>,
    ) -> Self {
        let (unfit, goes_on, out_of_place) = (0, 0, 0);
        Self { config, camera, depth, lattice, near, unfit, goes_on, out_of_place }
    }

    /// Adds the windows of one size that are worth a look.
    fn propose(&mut self, grid: &Grid, wanted: &mut Vec<Wanted>) {
        match self.depth {
            Some(depth) => self.propose_by_depth(depth, grid, wanted),
            None => wanted.extend(grid.windows(|square| self.is_near(square).then_some(None))),
        }
    }

    /// Those that show something as far away as somebody would be who is so large.
    fn propose_by_depth(&mut self, depth: &DepthImage, grid: &Grid, wanted: &mut Vec<Wanted>) {
        let config = self.config;
        let fits_m = self.camera.focal_px() * UPPER_BODY_SIDE_M / grid.side;
        let nearest_m = (fits_m / config.size_tolerance).max(config.min_depth_m);
        let farthest_m = (fits_m * config.size_tolerance).min(config.max_depth_m);
        self.lattice.fill(depth, grid, nearest_m..=farthest_m);
        let mut index = 0..;
        wanted.extend(grid.windows(|square| {
            let index = index.next()?;
            if !self.is_near(square) {
                return None;
            }
            let face_m = self.lattice.surface_m(index);
            self.unfit += u64::from(face_m.is_none());
            self.is_head(depth, square, face_m?).then_some(face_m)
        }));
    }

    /// True if what is in a square ends there, at a height where heads are.
    fn is_head(&mut self, depth: &DepthImage, square: &Rect, face_m: f64) -> bool {
        if self.goes_on_above(depth, square, face_m) {
            self.goes_on += 1;
            return false;
        }
        let height_m = self.camera.head_of(square, face_m).z;
        let heights_m = self.config.min_head_height_m..=self.config.max_head_height_m;
        let in_place = heights_m.contains(&height_m);
        self.out_of_place += u64::from(!in_place);
        in_place
    }

    /// True for what has no upper end here: walls, trunks of people, furniture.
    fn goes_on_above(&self, depth: &DepthImage, square: &Rect, face_m: f64) -> bool {
        let y = (square.y - ABOVE * square.height) as i64;
        let column = |i: usize| (square.x + square.width * (0.25 + 0.125 * i as f64)) as i64;
        let is_same = |m: &f32| (f64::from(*m) - face_m).abs() < self.config.above_m;
        (0..TAPS).filter_map(|i| depth.get(column(i), y)).filter(is_same).count() > TAPS / 2
    }

    fn is_near(&self, square: &Rect) -> bool {
        self.near.is_none_or(|expected| {
            let off = (square.centre() - expected.centre()).norm();
            off < self.config.near * expected.width
        })
    }
}

impl Detector for HogUpperBody {
    fn capabilities(&self) -> Capabilities {
        let grey = Inputs::NONE.require(Input::Colour);
        Capabilities {
            inputs: if self.config.depth_proposals { grey.accept(Input::Depth) } else { grey },
            discovers: true,
            tracks: true,
            weighs: false,
        }
    }

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
        let Self { config, model, scanner, lattice, windows } = self;
        let mut proposer = Proposer::new(config, camera, depth, lattice, near);
        let (sides, least) = (sides(config, camera, near), model.sum_at(config.min_score));
        let before = scanner.looked_at();
        windows.clear();
        scanner.scan(grey, sides, least, |grid, wanted| proposer.propose(grid, wanted), windows);
        let looked_at = scanner.looked_at() - before;
        funnel.drop_many("window: size and depth", proposer.unfit);
        funnel.drop_many("window: goes on above", proposer.goes_on);
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

    fn remembers(&self) -> bool {
        false
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;
    use tagalong_core::{Distortion, Pinhole};

    use super::*;

    /// Whether the square of somebody 3 m away whose surroundings are at `depth` shows a
    /// head, and how many squares do not because what they show goes on above.
    fn is_head(depth: impl Fn(f64) -> f32) -> (bool, u64) {
        let lens =
            Pinhole { fx: 525.0, fy: 525.0, cx: 319.5, cy: 239.5, distortion: Distortion::None };
        let camera = Camera::mounted(lens, 640, 480, 1.3, 0.0, 0.0);
        let square = camera.upper_body(&Point3::new(3.0, 0.0, 1.5));
        let above = |y: usize| (square.y - y as f64) / square.height;
        let depth = DepthImage::from_fn(640, 480, |_, y| depth(above(y)));
        let (config, mut lattice) = (Config::default(), Lattice::default());
        let mut proposer = Proposer::new(&config, &camera, Some(&depth), &mut lattice, None);
        (proposer.is_head(&depth, &square, 2.9), proposer.goes_on)
    }

    #[test]
    fn a_wall_goes_on_above_and_a_head_does_not() {
        let wall = |_: f64| 2.9;
        assert_eq!(is_head(wall), (false, 1));
        let head = |above: f64| if above < 0.0 { 2.9 } else { 3.3 };
        assert_eq!(is_head(head), (true, 0));
        let unknown_above = |above: f64| if above < 0.0 { 2.9 } else { f32::NAN };
        assert_eq!(is_head(unknown_above), (true, 0));
    }
}
