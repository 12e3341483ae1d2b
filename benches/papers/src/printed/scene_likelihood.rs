use std::f64::consts::PI;
use std::sync::{Arc, Mutex, PoisonError};

use tagalong_core::{Derived, Frame, Result};
use tagalong_depth_template::{
    FrameLikelihood, PlacedPerson, SceneLikelihood, Span, TemplateRow, Working, background, outside,
};
use tagalong_vision::RowSums;

/// P3's likelihood of a scene, `exp(-d² / (2 sigma²)) / (sqrt(2 pi) sigma)`: `d` is the
/// printed dissimilarity of the depths in a window around all silhouettes from a
/// picture of two values a person, near over far, in front of one background.
#[derive(Debug)]
pub struct PrintedLikelihood {
    settings: Settings,
    /// The frame that was asked for last.
    kept: Mutex<Option<Arc<Canvas>>>,
}

/// Free parameters of the likelihood.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Standard deviation of the dissimilarity of a scene that is as imagined, m.
    pub sigma_m: f64,
    /// Background of the frame as a percentile of its depths.
    pub background_percentile: f64,
    /// The size of the window stands inside of the root.
    pub is_rms: bool,
    /// All scenes of a frame are compared in one window, the whole image.
    pub whole_image: bool,
}

/// The depths of a frame with running sums along each row, m: the papers compare depths,
/// everything else here compares inverse depths.
#[derive(Clone, Debug)]
pub struct Metres {
    width: i64,
    height: i64,
    sums: Vec<Sums>,
}

/// Number, sum and sum of squares of the readings up to a pixel.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sums {
    /// Pixels with a reading.
    pub count: f64,
    sum: f64,
    squares: f64,
}

/// No scene is less likely than this, nats: where nothing is seen, nothing is known.
const LEAST: f64 = -1e5;

impl Sums {
    /// Returns the sum of `(depth - expected_m)²` over the readings, m².
    pub fn squared_error(&self, expected_m: f64) -> f64 {
        self.count * expected_m * expected_m - 2.0 * expected_m * self.sum + self.squares
    }
}

impl Derived for Metres {
    fn derive(frame: &Frame) -> Result<Self> {
        Ok(Self::new(&frame.derived::<Working>()?.0))
    }
}

impl Metres {
    /// Sums up a reduced image.
    pub fn new(image: &RowSums) -> Self {
        let mut sums = Vec::with_capacity((image.width() + 1) * image.height());
        for line in 0..image.height() {
            let mut running = Sums::default();
            sums.push(running);
            sums.extend(image.values(line).iter().map(|value| {
                if *value > 0 {
                    let depth_m = RowSums::UNITS / f64::from(*value);
                    running.count += 1.0;
                    running.sum += depth_m;
                    running.squares += depth_m * depth_m;
                }
                running
            }));
        }
        Self { width: image.width() as i64, height: image.height() as i64, sums }
    }

    /// The readings of a run of a row, as far as it is inside the image.
    pub fn run(&self, line: i64, (from, to): Span) -> Sums {
        if !(0..self.height).contains(&line) {
            return Sums::default();
        }
        let [a, b] = [from, to.max(from)]
            .map(|x| self.sums[(line * (self.width + 1) + x.clamp(0, self.width)) as usize]);
        Sums { count: b.count - a.count, sum: b.sum - a.sum, squares: b.squares - a.squares }
    }
}

/// A frame, ready for scenes.
#[derive(Debug)]
pub struct Canvas {
    settings: Settings,
    metres: Arc<Metres>,
    background_m: f64,
}

impl PrintedLikelihood {
    /// Creates the likelihood.
    pub fn new(settings: Settings) -> Self {
        Self { settings, kept: Mutex::new(None) }
    }

    /// Returns the image that the scenes of a frame are compared with.
    fn canvas(&self, frame: &Frame) -> Result<Arc<Canvas>> {
        let metres = frame.derived::<Metres>()?;
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(canvas) = kept.as_ref().filter(|kept| Arc::ptr_eq(&kept.metres, &metres)) {
            return Ok(Arc::clone(canvas));
        }
        let inverse = background(frame.depth()?, self.settings.background_percentile);
        let background_m = RowSums::UNITS / inverse.max(f64::MIN_POSITIVE);
        let canvas = Canvas { settings: self.settings, metres, background_m };
        Ok(Arc::clone(kept.insert(Arc::new(canvas))))
    }
}

impl SceneLikelihood for PrintedLikelihood {
    fn prepare(&self, frame: &Frame) -> Result<Arc<dyn FrameLikelihood>> {
        let canvas: Arc<dyn FrameLikelihood> = self.canvas(frame)?;
        Ok(canvas)
    }
}

impl FrameLikelihood for Canvas {
    fn log_likelihood(&self, scene: &[PlacedPerson]) -> f64 {
        let sigma_m = self.settings.sigma_m;
        let constant = -(2.0 * PI).sqrt().ln() - sigma_m.ln();
        let dissimilarity = self.dissimilarity(scene);
        let log = dissimilarity.map(|d| constant - d * d / (2.0 * sigma_m * sigma_m));
        log.map_or(LEAST, |log| log.max(LEAST))
    }
}

impl Canvas {
    /// Returns the dissimilarity of a scene, m; `None` without a reading.
    fn dissimilarity(&self, scene: &[PlacedPerson]) -> Option<f64> {
        let mut columns = bounds(scene.iter().map(PlacedPerson::columns))?;
        let mut lines = bounds(scene.iter().map(PlacedPerson::lines))?;
        if self.settings.whole_image {
            columns = (0, self.metres.width);
            lines = (0, self.metres.height);
        }
        let mut count = 0.0;
        let mut error = 0.0;
        let lines = lines.0.max(0)..lines.1.min(self.metres.height);
        for line in lines {
            let row = self.metres.run(line, columns);
            count += row.count;
            error += row.squared_error(self.background_m);
            for (k, person) in scene.iter().enumerate() {
                let Some(body) = person.row(line).and_then(silhouette(person)) else { continue };
                let nearer = scene[..k].iter();
                let nearer = nearer.filter_map(|p| p.row(line).and_then(silhouette(p)));
                for part in outside(body, nearer.collect()) {
                    let pixels = self.metres.run(line, part);
                    error += pixels.squared_error(person.depth_m);
                    error -= pixels.squared_error(self.background_m);
                }
            }
        }
        let root = error.max(0.0).sqrt();
        (count > 0.0).then(|| if self.settings.is_rms { root / count.sqrt() } else { root / count })
    }
}

/// The body in a row, up to the middle of its guard.
fn silhouette(person: &PlacedPerson) -> impl Fn(&TemplateRow) -> Option<Span> {
    let x = person.x;
    move |row| {
        let span = (x + (row.from + row.guard_from) / 2, x + (row.to + row.guard_to) / 2);
        (span.0 < span.1).then_some(span)
    }
}

fn bounds(spans: impl Iterator<Item = Span>) -> Option<Span> {
    spans.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, Vector2};
    use proptest::prelude::*;
    use tagalong_core::{DepthImage, EgoMotion, Images, Likelihood, Person, Stamp};
    use tagalong_depth_template::{Bank, DepthTemplateConfig, Direction, Pose, Template, Weigher};
    use tagalong_geometry::{Camera, Pinhole};

    use super::*;

    const HEIGHT_M: f64 = 1.5;
    const WALL_M: f32 = 5.0;

    fn camera() -> Camera {
        Camera::mounted(Pinhole::centred(80.0, 80, 60), 80, 60, HEIGHT_M, 0.0, 0.0)
    }

    fn frame(depth: DepthImage) -> Frame {
        let images = Images { depth: Some(Arc::new(depth)), ..Images::default() };
        Frame::new(1, Stamp::default(), Arc::new(camera()), EgoMotion::at_rest(0.1), images)
    }

    fn likelihood(sigma_m: f64, is_rms: bool, whole_image: bool) -> PrintedLikelihood {
        let background_percentile = 90.0;
        PrintedLikelihood::new(Settings { sigma_m, background_percentile, is_rms, whole_image })
    }

    fn weigher(sigma_m: f64, is_rms: bool) -> Weigher {
        let weigher = Weigher::new(&DepthTemplateConfig::default());
        weigher.with_likelihood(Box::new(likelihood(sigma_m, is_rms, false)))
    }

    fn standing(x: f64, y: f64) -> Person {
        Person { position: Point3::new(x, y, HEIGHT_M), velocity: Vector2::zeros() }
    }

    /// A template, where its head centre is, and the depth of its face.
    struct Painted {
        template: Template,
        x: i64,
        y: i64,
        depth_m: f64,
    }

    impl Painted {
        fn new(person: &Person, direction: Direction) -> Self {
            let depth_m = person.position.x - tagalong_geometry::HEAD_RADIUS_M;
            let pixel = camera().project(&person.position).unwrap();
            let pose = Pose::nearest(direction, 0.0, 0.0, 80.0 / depth_m);
            let template = Bank::new(usize::MAX).template(pose).clone();
            Self { template, x: pixel.x.round() as i64, y: pixel.y.round() as i64, depth_m }
        }

        fn covers(&self, x: i64, y: i64) -> bool {
            fn middle(a: i64, b: i64) -> i64 {
                (a + b) / 2
            }

            let row = self.template.rows.iter().find(|row| row.dy == y - self.y);
            row.is_some_and(|row| {
                (middle(row.from, row.guard_from)..middle(row.to, row.guard_to))
                    .contains(&(x - self.x))
            })
        }
    }

    /// Renders the depth of people in front of a wall.
    fn picture(people: &[Painted]) -> DepthImage {
        DepthImage::from_fn(80, 60, |x, y| {
            let here = people.iter().filter(|p| p.covers(x as i64, y as i64));
            here.map(|p| p.depth_m as f32).fold(WALL_M, f32::min)
        })
    }

    /// P3's dissimilarity pixel by pixel, in the window around the cast or in the whole image.
    fn slow(
        frame: &Frame,
        cast: &[Painted],
        background_m: f64,
        [is_rms, whole_image]: [bool; 2],
    ) -> Option<f64> {
        fn half(p: &Painted) -> i64 {
            p.template.half_width
        }

        let image = frame.derived::<Working>().unwrap();
        let mut left = cast.iter().map(|p| p.x - half(p)).min()?;
        let mut right = cast.iter().map(|p| p.x + half(p)).max()?;
        let mut top = cast.iter().map(|p| p.y + p.template.rows[0].dy).min()?;
        let mut bottom = cast.iter().map(|p| p.y + p.template.rows.last().unwrap().dy).max()?;
        if whole_image {
            [left, right, top, bottom] = [0, 79, 0, 59];
        }
        let mut sum = 0.0;
        let mut count = 0.0;
        for (x, y) in (top..=bottom).flat_map(|y| (left..=right).map(move |x| (x, y))) {
            let Some(value) = image.0.value(x, y).filter(|value| *value > 0) else { continue };
            let here = cast.iter().filter(|p| p.covers(x, y)).map(|p| p.depth_m);
            let nearest = here.fold(f64::INFINITY, f64::min);
            let expected = if nearest.is_finite() { nearest } else { background_m };
            sum += (RowSums::UNITS / f64::from(value) - expected).powi(2);
            count += 1.0;
        }
        let d = if is_rms { (sum / count).sqrt() } else { sum.sqrt() / count };
        (count > 0.0).then_some(d)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]

        #[test]
        fn the_printed_likelihood_is_that_of_the_pixels(
            pixels in prop::collection::vec(
                prop_oneof![Just(f32::NAN), 1.0f32..2.5, 2.0f32..6.0], 80 * 60),
            near in -0.8f64..0.8, far in -1.2f64..1.2,
            is_rms in any::<bool>(), whole in any::<bool>(),
        ) {
            let frame = frame(DepthImage::from_pixels(80, 60, pixels).unwrap());
            let likelihood = likelihood(0.1, is_rms, whole);
            let background_m = likelihood.canvas(&frame).unwrap().background_m;
            let scene = [standing(3.0, far), standing(1.8, near)];
            let cast = [&scene[0], &scene[1]].map(|p| Painted::new(p, Direction::Along));
            let d = slow(&frame, &cast, background_m, [is_rms, whole]).unwrap();
            let log = -(0.1 * (2.0 * PI).sqrt()).ln() - d * d / (2.0 * 0.01);
            let weigher = Weigher::new(&DepthTemplateConfig::default());
            let weigher = weigher.with_likelihood(Box::new(likelihood));
            let found = weigher.log_likelihood(&frame, &scene).unwrap();
            prop_assert!((found - log.max(LEAST)).abs() < 1e-6 * log.abs().max(1.0), "{} {}", found, log);
        }
    }

    #[test]
    fn a_perfect_scene_is_as_likely_as_the_density_allows() {
        let people = [standing(1.8, 0.1), standing(3.0, -0.3)];
        let cast = [0, 1].map(|i| Painted::new(&people[i], Direction::Along));
        let frame = frame(picture(&cast));
        for is_rms in [false, true] {
            let weigher = weigher(0.1, is_rms);
            let log = weigher.log_likelihood(&frame, &people).unwrap();
            let most = -(0.1 * (2.0 * PI).sqrt()).ln();
            assert!((log - most).abs() < 0.02, "{log} {most}");
            let beside = [standing(1.8, 0.3), people[1]];
            assert!(weigher.log_likelihood(&frame, &beside).unwrap() < log);
        }
    }

    #[test]
    fn the_printed_form_tells_less_of_large_windows_than_a_root_mean_square() {
        fn d(is_rms: bool, x: f64) -> f64 {
            // A person expected where there is only the wall.
            let frame = frame(picture(&[]));
            let log = weigher(1.0, is_rms).log_likelihood(&frame, &[standing(x, 0.0)]).unwrap();
            (-2.0 * (log + (2.0 * PI).sqrt().ln())).sqrt()
        }

        // The square of the window is four times as large at half the distance.
        fn ratio(is_rms: bool) -> f64 {
            let [far, near] = [3.6, 1.8].map(|x| d(is_rms, x) / (f64::from(WALL_M) - x));
            far / near
        }

        assert!((ratio(true) - 1.0).abs() < 0.15, "{}", ratio(true));
        assert!((ratio(false) - 2.0).abs() < 0.3, "{}", ratio(false));
    }

    #[test]
    fn one_person_takes_the_best_template_and_two_those_of_their_motion() {
        let near = standing(1.8, 0.0);
        let frame = frame(picture(&[Painted::new(&near, Direction::Left)]));
        let weigher = weigher(0.1, false);
        let hidden = standing(4.0, 0.0);
        let [(alone, still), (alone_left, left), (alone_right, right)] =
            [0.0, 1.0, -1.0].map(|vy| {
                let person = Person { velocity: Vector2::new(0.0, vy), ..near };
                let alone = weigher.log_likelihood(&frame, &[person]).unwrap();
                (alone, weigher.log_likelihood(&frame, &[person, hidden]).unwrap())
            });
        assert_eq!([alone_left, alone_right], [alone; 2]);
        assert!(left > still && left > right, "{left} {still} {right}");
    }

    #[test]
    fn where_nothing_is_seen_no_scene_is_likely() {
        let frame = frame(DepthImage::filled(80, 60, f32::NAN));
        let weigher = weigher(0.1, false);
        assert_eq!(weigher.log_likelihood(&frame, &[standing(2.0, 0.0)]).unwrap(), LEAST);
        assert_eq!(weigher.log_likelihood(&frame, &[standing(-2.0, 0.0)]).unwrap(), LEAST);
        assert_eq!(weigher.log_likelihood(&frame, &[]).unwrap(), 0.0);
    }
}
