use std::ops::RangeInclusive;

use tagalong_config::Context;
use tagalong_core::{
    Capabilities, DepthImage, Detection, Detector, Frame, Funnel, Input, Inputs, Query, Result,
};
use tagalong_geometry::{Camera, FaceDepth, ImageBox, PointEstimate, Rect, UPPER_BODY_SIDE_M};

use crate::lattice::Lattice;
use crate::{
    Config, Coverage, DepthTrees, Grid, Kind, Model, NAME, Scanner, Wanted, Window, merge,
};

/// Models that are compiled into the program.
const TREES: &str = include_str!("../models/hog-upper-body.toml");
const WHOLE_BODIES: &str = include_str!("../models/hog-whole-body.toml");
const LINEAR: &str = include_str!("../models/hog-upper-body-linear.toml");

/// Distance above the square at which depth is read to test for the end of a head, in sides; the
/// windows that show a head best end well above it.
const ABOVE: f64 = 0.25;
/// Number of places at which it is read.
const TAPS: usize = 5;
/// Widths in a search near a track, relative to that of the track.
const ALIKE: RangeInclusive<f64> = 0.7..=1.4;

/// Detector of heads and shoulders.
pub struct HogUpperBody {
    config: Config,
    model: Model,
    scanner: Scanner,
    lattice: Lattice,
    windows: Vec<Window>,
}

impl HogUpperBody {
    /// Creates a detector and reads its model.
    ///
    /// # Errors
    /// [`tagalong_core::Error::Model`] for a file that cannot be read or is not a model,
    /// [`tagalong_core::Error::Settings`] for settings outside their ranges.
    pub fn new(config: Config, context: &Context) -> Result<Self> {
        config.check()?;
        let built_in = match (config.machine, config.coverage) {
            (Kind::Linear, _) => LINEAR,
            (Kind::Trees, Coverage::UpperBody) => TREES,
            (Kind::Trees, Coverage::WholeBody) => WHOLE_BODIES,
        };
        let model = context.model(&config.model, built_in, Model::from_text)?;
        let scanner = Scanner::new(&model);
        let lattice = Lattice::default();
        Ok(Self { config, model, scanner, lattice, windows: Vec::new() })
    }

    fn detection(&self, camera: &Camera, window: &Window) -> Option<Detection> {
        let config = &self.config;
        let width = window.region.width;
        let face = FaceDepth::by_size(camera, UPPER_BODY_SIDE_M, width, config.sigma_distance)
            .or_measured(window.depth_m, config.sigma_depth_m);
        let PointEstimate { position, covariance } =
            camera.locate_head(&window.region, face, config.sigma_place * width);
        let detection = Detection::new(
            NAME,
            position,
            covariance,
            self.model.log_odds(window.sum).min(config.max_score),
        )
        .with_image(ImageBox::upper_body(window.region));
        detection.is_sane().then_some(detection)
    }
}

/// Returns the sizes of a search, pixels; near a track, those similar to its own.
pub(crate) fn sides(
    config: &Config,
    camera: &Camera,
    near: Option<Rect>,
) -> impl Iterator<Item = f64> {
    let most = config.max_side * camera.width.min(camera.height) as f64;
    let step = config.scale_step;
    std::iter::successors(Some(config.min_side_px), move |side| Some(side * step))
        .take_while(move |side| *side <= most)
        .filter(move |side| near.is_none_or(|near| ALIKE.contains(&(side / near.width.max(1.0)))))
}

/// Adds the log-odds of their depth to the sums of windows.
fn add_depth(channel: &DepthTrees, depth: &DepthImage, model: &Model, windows: &mut [Window]) {
    for window in windows {
        let Some(depth_m) = window.depth_m else { continue };
        window.sum += (channel.log_odds(depth, &window.region, depth_m) / model.slope) as f32;
    }
}

/// Selector of the windows to scan, with the number of windows that each test rejects.
pub(crate) struct Proposer<'a> {
    config: &'a Config,
    camera: &'a Camera,
    depth: Option<&'a DepthImage>,
    lattice: &'a mut Lattice,
    /// Expected square in a search near a track.
    near: Option<Rect>,
    unfit: u64,
    goes_on: u64,
    out_of_place: u64,
}

impl<'a> Proposer<'a> {
    pub(crate) fn new(
        config: &'a Config,
        camera: &'a Camera,
        depth: Option<&'a DepthImage>,
        lattice: &'a mut Lattice,
        near: Option<Rect>,
    ) -> Self {
        let unfit = 0;
        let goes_on = 0;
        let out_of_place = 0;
        Self { config, camera, depth, lattice, near, unfit, goes_on, out_of_place }
    }

    /// Adds the windows of one size that are to be scanned.
    pub(crate) fn propose(&mut self, grid: &Grid, wanted: &mut Vec<Wanted>) {
        match self.depth {
            Some(depth) => self.propose_by_depth(depth, grid, wanted),
            None => wanted.extend(grid.windows(|square| self.is_near(square).then_some(None))),
        }
    }

    /// Adds the windows in which the depth is that of a person of this size.
    fn propose_by_depth(&mut self, depth: &DepthImage, grid: &Grid, wanted: &mut Vec<Wanted>) {
        let config = self.config;
        let fits_m = self.camera.focal_px() * UPPER_BODY_SIDE_M / grid.side;
        let nearest_m = (fits_m / config.size_tolerance).max(config.min_depth_m);
        let farthest_m = (fits_m * config.size_tolerance).min(config.max_depth_m);
        self.lattice.fill(depth, grid, nearest_m..=farthest_m);
        let mut index = 0..;
        // The grid and the lattice count their windows in the same order.
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

    /// Returns true if the object in a square ends there, at a height where heads are.
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

    /// Returns true if the object has no upper end here: walls, trunks of people, furniture.
    fn goes_on_above(&self, depth: &DepthImage, square: &Rect, face_m: f64) -> bool {
        let y = (square.y - ABOVE * square.height) as i64;
        let columns =
            (0..TAPS).map(|i| (square.x + square.width * (0.25 + 0.125 * i as f64)) as i64);
        columns
            .filter_map(|x| depth.get(x, y))
            .filter(|m| (f64::from(*m) - face_m).abs() < self.config.above_m)
            .count()
            > TAPS / 2
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
        let inputs = if self.config.depth_proposals { grey.accept(Input::Depth) } else { grey };
        Capabilities::new(inputs).discovering().tracking()
    }

    fn detect(
        &mut self,
        frame: &Frame,
        query: &Query<'_>,
        funnel: &mut Funnel,
    ) -> Result<Vec<Detection>> {
        let grey = frame.grey()?;
        let camera = &*frame.camera;
        let depth = frame.depth().ok().filter(|_| self.config.depth_proposals);
        let near = match query {
            Query::Track(track) => Some(track.estimate.region),
            Query::Discover { .. } => None,
        };
        let Self { config, model, scanner, lattice, windows } = self;
        let mut proposer = Proposer::new(config, camera, depth, lattice, near);
        let channel = model.depth.as_ref().filter(|_| config.depth_channel).zip(depth);
        // A window below the limit stays as long as its depth may lift it above.
        let lift = channel.map_or(0.0, |_| DepthTrees::most());
        let sides = sides(config, camera, near);
        let least = model.sum_at(config.min_score - lift);
        let before = scanner.looked_at();
        windows.clear();
        scanner.scan(grey, sides, least, |grid, wanted| proposer.propose(grid, wanted), windows);
        if let Some((channel, depth)) = channel {
            add_depth(channel, depth, model, windows);
            windows.retain(|window| model.log_odds(window.sum) >= config.min_score);
        }
        let looked_at = scanner.looked_at() - before;
        funnel.drop_many("window: size and depth", proposer.unfit);
        funnel.drop_many("window: goes on above", proposer.goes_on);
        funnel.drop_many("window: head height", proposer.out_of_place);
        funnel.drop_many("window: gradients", looked_at - windows.len() as u64);
        let all = windows.len();
        merge(windows, model.coverage, config.overlap, config.apart_m);
        funnel.drop_many("window: beside a better one", (all - windows.len()) as u64);
        let mut found: Vec<Detection> =
            self.windows.iter().filter_map(|window| self.detection(camera, window)).collect();
        // `merge` has sorted the windows by their sums, so the first is the best.
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
    use std::sync::Arc;

    use nalgebra::{Point3, SMatrix, Vector2};
    use tagalong_core::{EgoMotion, Estimate, GreyImage, Images, Person, Stamp, Track, TrackId};
    use tagalong_geometry::{HEAD_RADIUS_M, Pinhole};

    use super::*;

    /// Tests the square of a person 3 m away with surroundings at `depth`: returns true if it shows
    /// a head, and the number of squares that are rejected because the object goes on above.
    fn is_head(depth: impl Fn(f64) -> f32) -> (bool, u64) {
        let camera = camera();
        let square = camera.upper_body(&Point3::new(3.0, 0.0, 1.5));
        let depth =
            DepthImage::from_fn(640, 480, |_, y| depth((square.y - y as f64) / square.height));
        let config = Config::default();
        let mut lattice = Lattice::default();
        let mut proposer = Proposer::new(&config, &camera, Some(&depth), &mut lattice, None);
        (proposer.is_head(&depth, &square, 2.9), proposer.goes_on)
    }

    fn camera() -> Camera {
        Camera::mounted(Pinhole::centred(525.0, 640, 480), 640, 480, 1.3, 0.0, 0.0)
    }

    #[test]
    fn sizes_grow_by_a_step_and_near_a_track_are_like_its_own() {
        let config =
            Config { min_side_px: 40.0, max_side: 0.5, scale_step: 1.5, ..Config::default() };
        let all: Vec<f64> = sides(&config, &camera(), None).collect();
        assert_eq!(all, [40.0, 60.0, 90.0, 135.0, 202.5], "up to half of 480 pixels");
        // The first one from 45.5 to 91.
        for (width, expected) in [(65.0, &[60.0, 90.0][..]), (150.0, &[135.0, 202.5]), (20.0, &[])]
        {
            let region = Rect::new(10.0, 10.0, width, width);
            let found: Vec<f64> = sides(&config, &camera(), Some(region)).collect();
            assert_eq!(found, expected, "{width}");
        }
    }

    #[test]
    fn near_is_within_half_a_width_of_the_expected_middle() {
        let config = Config::default();
        let camera = camera();
        let expected = Rect::new(100.0, 100.0, 60.0, 60.0);
        for (near, dx, dy, expected) in [
            (Some(expected), 29.0, 0.0, true),
            (Some(expected), 0.0, -29.0, true),
            (Some(expected), 31.0, 0.0, false),
            // Round, not square.
            (Some(expected), 25.0, 25.0, false),
            // Everything is near where nobody is expected.
            (None, 400.0, 0.0, true),
        ] {
            let mut lattice = Lattice::default();
            let proposer = Proposer::new(&config, &camera, None, &mut lattice, near);
            // A smaller square with the same middle, moved.
            let square = Rect::new(110.0 + dx, 110.0 + dy, 40.0, 40.0);
            assert_eq!(proposer.is_near(&square), expected, "{dx} {dy}");
        }
    }

    #[test]
    fn heads_are_at_heights_of_heads() {
        let config = Config::default();
        let camera = camera();
        let depth = DepthImage::filled(640, 480, f32::NAN);
        let mut lattice = Lattice::default();
        let mut proposer = Proposer::new(&config, &camera, Some(&depth), &mut lattice, None);
        let [low, high] = [config.min_head_height_m, config.max_head_height_m];
        for (height_m, expected) in
            [(low - 0.05, false), (low + 0.05, true), (high - 0.05, true), (high + 0.05, false)]
        {
            let head = Point3::new(4.0, 0.0, height_m);
            let face_m = camera.depth_of(&head) - HEAD_RADIUS_M;
            let is_head = proposer.is_head(&depth, &camera.upper_body(&head), face_m);
            assert_eq!(is_head, expected, "{height_m}");
        }
        assert_eq!((proposer.out_of_place, proposer.goes_on, proposer.unfit), (2, 0, 0));
    }

    fn detector(config: Config) -> HogUpperBody {
        let wheels = tagalong_core::DiffDrive { half_separation_m: 0.2, slip: 0.0 };
        let context = Context::new(1, ".", wheels);
        HogUpperBody::new(config, &context).unwrap()
    }

    #[test]
    fn a_window_is_a_head_at_its_distance() {
        let detector = detector(Config::default());
        let camera = camera();
        let config = &detector.config;
        let side = 525.0 * UPPER_BODY_SIDE_M / 4.0;
        let region = Rect::new(319.5 - 0.5 * side, 239.5 - 0.5 * side, side, side);
        let sum = detector.model.sum_at(1.0);
        let flat = Window { region, depth_m: None, sum };
        let deep = Window { depth_m: Some(3.0), ..flat };
        let by_depth = detector.detection(&camera, &deep).unwrap();
        let by_size = detector.detection(&camera, &flat).unwrap();
        for (found, face_m, sigma_m) in
            [(&by_depth, 3.0, config.sigma_depth_m), (&by_size, 4.0, 4.0 * config.sigma_distance)]
        {
            assert!((found.position - camera.head_of(&region, face_m)).norm() < 1e-9);
            assert!((found.covariance[(0, 0)].sqrt() / sigma_m - 1.0).abs() < 0.02);
            let aside = config.sigma_place * side / 525.0 * (face_m + HEAD_RADIUS_M);
            assert!((found.covariance[(1, 1)].sqrt() / aside - 1.0).abs() < 0.02);
            assert!((found.score - 1.0).abs() < 1e-4 && found.rect().unwrap() == region);
        }
        let sure = Window { sum: detector.model.sum_at(99.0), ..flat };
        assert_eq!(detector.detection(&camera, &sure).unwrap().score, config.max_score);
    }

    /// Returns the numbers of windows that are rejected by depth and by gradients in a frame of
    /// noise, and the number of detections.
    fn dropped(config: Config, depth_m: Option<f32>, near: Option<&Track>) -> ([u64; 2], usize) {
        let camera =
            Arc::new(Camera::mounted(Pinhole::centred(131.0, 160, 120), 160, 120, 1.3, 0.0, 0.0));
        let grey = GreyImage::from_fn(160, 120, |x, y| (x * x * 31 + y * y * 17 + x * y) as u8);
        let images = Images {
            grey: Some(Arc::new(grey)),
            depth: depth_m.map(|metres| Arc::new(DepthImage::filled(160, 120, metres))),
            ..Images::default()
        };
        let frame = Frame::new(1, Stamp::default(), camera, EgoMotion::at_rest(0.1), images);
        let query = near.map_or(Query::Discover { occupied: &[] }, Query::Track);
        let mut funnel = Funnel::default();
        let found = detector(config).detect(&frame, &query, &mut funnel).unwrap();
        let counts = ["window: size and depth", "window: gradients"].map(|test| funnel.count(test));
        (counts, found.len())
    }

    #[test]
    fn windows_that_depth_rules_out_are_not_looked_at() {
        let config = Config { machine: Kind::Linear, min_score: -99.0, ..Config::default() };
        let ([unfit, _], found) = dropped(config.clone(), None, None);
        assert!(unfit == 0 && found > 0, "{unfit} {found}");
        let ([unfit, looked_at], found) = dropped(config.clone(), Some(9.0), None);
        assert!(unfit > 100 && looked_at == 0 && found == 0, "{unfit} {looked_at} {found}");
        let off = Config { depth_proposals: false, ..config };
        assert_eq!(dropped(off.clone(), Some(9.0), None), dropped(off, None, None));
    }

    #[test]
    fn a_search_near_a_track_finds_one() {
        let config = Config {
            machine: Kind::Linear,
            min_score: -99.0,
            min_side_px: 20.0,
            ..Config::default()
        };
        let region = Rect::new(30.0, 30.0, 40.0, 40.0);
        let person = Person { position: Point3::new(2.0, 0.0, 1.3), velocity: Vector2::zeros() };
        let track = Track::new(TrackId(1), Estimate::new(person, SMatrix::identity(), region), 1.0)
            .with_age(9);
        assert!(dropped(config.clone(), None, None).1 > 1);
        assert_eq!(dropped(config, None, Some(&track)).1, 1);
    }

    #[test]
    fn a_wall_goes_on_above_and_a_head_does_not() {
        assert_eq!(is_head(|_: f64| 2.9), (false, 1));
        assert_eq!(is_head(|above: f64| if above < 0.0 { 2.9 } else { 3.3 }), (true, 0));
        assert_eq!(is_head(|above: f64| if above < 0.0 { 2.9 } else { f32::NAN }), (true, 0));
    }

    /// Only columns of the object above a square count that lie over its middle half.
    #[test]
    fn a_head_ends_where_most_columns_above_it_are_of_something_else() {
        let camera = camera();
        let config = Config::default();
        let square = camera.upper_body(&Point3::new(3.0, 0.0, 1.5));
        let all = [-9.0, 9.0];
        // The object between two columns and two rows, in sides of the square; the rest is far.
        for (columns, above, expected) in [
            // Read at 0.25, 0.375, 0.5, 0.625 and 0.75 of the width: three of five are most.
            ([0.2, 0.53], all, true),
            ([0.2, 0.47], all, false),
            ([0.47, 0.8], all, true),
            ([0.53, 0.8], all, false),
            ([0.3, 0.59], all, false),
            ([0.35, 0.65], all, true),
            ([-9.0, 0.22], all, false),
            ([0.78, 9.0], all, false),
            // A quarter of the square above it.
            (all, [0.22, 0.28], true),
            (all, [-9.0, 0.22], false),
            (all, [0.28, 9.0], false),
        ] {
            let depth = DepthImage::from_fn(640, 480, |x, y| {
                let x = (x as f64 + 0.5 - square.x) / square.width;
                let y = (square.y - y as f64 - 0.5) / square.height;
                let is_object = x > columns[0] && x < columns[1] && y > above[0] && y < above[1];
                if is_object { 2.9 } else { 5.0 }
            });
            let mut lattice = Lattice::default();
            let proposer = Proposer::new(&config, &camera, Some(&depth), &mut lattice, None);
            let goes_on = proposer.goes_on_above(&depth, &square, 2.9);
            assert_eq!(goes_on, expected, "{columns:?} {above:?}");
        }
    }

    /// Returns true if windows with a square of `side` pixels are proposed before a wall.
    fn is_proposed(config: &Config, side: f64, metres: f64) -> bool {
        let camera = camera();
        let depth = DepthImage::filled(640, 480, metres as f32);
        let mut lattice = Lattice::default();
        let mut proposer = Proposer::new(config, &camera, Some(&depth), &mut lattice, None);
        let grid = Grid::new((640, 480), side);
        let mut wanted = Vec::new();
        proposer.propose(&grid, &mut wanted);
        let all = grid.windows(|_| Some(None)).count();
        assert!(wanted.is_empty() || wanted.len() == all, "{side} {metres}");
        assert_eq!(proposer.unfit as usize, all - wanted.len());
        assert!(wanted.iter().all(|window| window.depth_m == Some(f64::from(metres as f32))));
        !wanted.is_empty()
    }

    #[test]
    fn windows_are_proposed_at_the_depth_of_a_person_of_their_size() {
        // Neither the height of heads nor their upper end is tested.
        let config = Config {
            size_tolerance: 1.25,
            above_m: 0.0,
            min_head_height_m: -99.0,
            max_head_height_m: 99.0,
            ..Config::default()
        };
        let side = 525.0 * UPPER_BODY_SIDE_M / 3.0;
        let narrow = Config { min_depth_m: 2.8, max_depth_m: 3.2, ..config.clone() };
        for (config, side, metres, expected) in [
            (&config, side, 3.0, true),
            (&config, side, 2.42, true),
            (&config, side, 3.74, true),
            (&config, side, 2.38, false),
            (&config, side, 3.76, false),
            (&narrow, side, 2.81, true),
            (&narrow, side, 3.19, true),
            (&narrow, side, 2.79, false),
            (&narrow, side, 3.21, false),
            (&config, 2.0 * side, 1.5, true),
            (&config, 2.0 * side, 3.0, false),
        ] {
            assert_eq!(is_proposed(config, side, metres), expected, "{side} {metres}");
        }
    }
}
