//! An annotated frame and its random variations (data augmentation).

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use tagalong_config::AnnotatedPerson;
use tagalong_core::{DepthImage, Frame, Result};
use tagalong_geometry::{Camera, Lens};
use tagalong_learn::mix;

use super::Targets;
use crate::{FloorMap, reduced};

/// Depth is kept in steps of this, m.
const STEP_M: f32 = 0.001;
/// Largest turn of the robot, rad.
const TURN_RAD: f64 = 0.45;
/// Range of the factor by which the scene grows.
const SCALE: [f64; 2] = [0.95, 1.06];
/// Standard deviations of the camera's pitch and roll, rad, and of its height, m.
const TILT_RAD: f64 = 0.006;
const HEIGHT_M: f64 = 0.02;

/// Numbers that look random.
pub struct Draws(pub u64);

impl Draws {
    /// Returns the next number.
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(1);
        mix(self.0)
    }

    /// Returns a number between two others.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Returns a whole number below `end`.
    pub fn below(&mut self, end: usize) -> usize {
        (self.next() % end.max(1) as u64) as usize
    }

    /// Returns true with this probability.
    pub fn chance(&mut self, probability: f64) -> bool {
        self.between(0.0, 1.0) < probability
    }

    /// Returns a number of standard deviation 1 (nearly normal: a sum of four).
    pub fn normal(&mut self) -> f64 {
        (0..4).map(|_| self.between(-1.0, 1.0)).sum::<f64>() * 0.75f64.sqrt()
    }
}

/// An annotated frame, thinned out.
pub struct Sample {
    /// The camera of the thinned image.
    pub camera: Camera,
    /// Depth in steps of a millimetre; 0 is no reading.
    steps: Vec<u16>,
    /// All annotated people.
    pub people: Vec<AnnotatedPerson>,
    /// The real room, if it is one.
    pub room: Option<String>,
    /// Number of the scene.
    pub group: u64,
}

impl Sample {
    /// Keeps a frame.
    ///
    /// # Errors
    /// [`tagalong_core::Error::MissingImage`] for a frame without depth.
    pub fn new(
        frame: &Frame,
        people: &[AnnotatedPerson],
        room: Option<&str>,
        group: u64,
    ) -> Result<Self> {
        let depth = frame.depth()?;
        let (camera, depth) = reduced(&frame.camera, depth)
            .unwrap_or_else(|| ((*frame.camera).clone(), depth.clone()));
        let steps = depth.pixels().iter().map(|metres| (metres / STEP_M).round() as u16).collect();
        let people = people.to_vec();
        let room = room.map(str::to_owned);
        Ok(Self { camera, steps, people, room, group })
    }

    /// Returns the depth image.
    pub fn depth(&self) -> DepthImage {
        fn metres(step: u16) -> f32 {
            if step == 0 { f32::NAN } else { f32::from(step) * STEP_M }
        }

        let pixels = self.steps.iter().map(|step| metres(*step)).collect();
        DepthImage::from_pixels(self.camera.width, self.camera.height, pixels).unwrap_or_default()
    }

    /// Returns the map of a variation, and the answer to it: the robot turned, the scene a little
    /// larger or smaller, the camera a little off, the image cut, noisier and with holes, all of it
    /// perhaps mirrored.
    pub fn varied(&self, draws: &mut Draws) -> (FloorMap, Targets) {
        let mut camera = self.camera.clone();
        let mut people = self.people.clone();
        let scale = draws.between(SCALE[0], SCALE[1]);
        let mut depth = self.depth();
        depth.pixels_mut().iter_mut().for_each(|metres| *metres *= scale as f32);
        let turn = Isometry3::rotation(Vector3::z() * draws.between(-TURN_RAD, TURN_RAD));
        for person in &mut people {
            person.head = turn * Point3::from(person.head.coords * scale);
        }
        let mut pose = turn * camera.robot_from_camera;
        let place = camera.robot_from_camera.translation.vector;
        pose.translation.vector = (turn * Point3::from(place * scale)).coords;
        camera.robot_from_camera = misjudged(&pose, draws);
        degrade(&mut depth, draws);
        let (camera, depth) = cut(camera, depth, draws);
        let map = FloorMap::new(&camera, &depth);
        let targets = Targets::new(&people, &camera, &depth);
        if draws.chance(0.5) { (map.mirrored(), targets.mirrored()) } else { (map, targets) }
    }
}

/// Returns the pose as a calibration might give it.
fn misjudged(pose: &Isometry3<f64>, draws: &mut Draws) -> Isometry3<f64> {
    let tilt = Vector3::new(draws.normal(), draws.normal(), 0.0) * TILT_RAD;
    let lift = Translation3::new(0.0, 0.0, draws.normal() * HEIGHT_M);
    let turned = UnitQuaternion::from_scaled_axis(tilt) * pose.rotation;
    lift * Isometry3::from_parts(pose.translation, turned)
}

/// Takes readings away, and adds noise.
fn degrade(depth: &mut DepthImage, draws: &mut Draws) {
    let width = depth.width();
    let height = depth.height();
    if draws.chance(0.3) {
        let share = draws.between(0.0, 0.4);
        depth.pixels_mut().iter_mut().for_each(|metres| {
            if draws.chance(share) {
                *metres = f32::NAN
            }
        });
    }
    if draws.chance(0.3) {
        for _ in 0..1 + draws.below(5) {
            let left = draws.below(width);
            let top = draws.below(height);
            let right = left + 5 + draws.below(45);
            let bottom = top + 5 + draws.below(45);
            for y in top..bottom.min(height) {
                let row = y * width;
                depth.pixels_mut()[row + left..row + right.min(width)].fill(f32::NAN);
            }
        }
    }
    if draws.chance(0.2) {
        let farthest = draws.between(3.0, 5.5) as f32;
        let far = depth.pixels_mut().iter_mut().filter(|metres| **metres > farthest);
        far.for_each(|metres| *metres = f32::NAN);
    }
    if draws.chance(0.5) {
        let sigma = draws.between(0.0, 0.004);
        depth
            .pixels_mut()
            .iter_mut()
            .for_each(|metres| *metres += *metres * *metres * (sigma * draws.normal()) as f32);
    }
}

/// Cuts rows off, as a camera of another pitch and field of view would.
fn cut(camera: Camera, depth: DepthImage, draws: &mut Draws) -> (Camera, DepthImage) {
    let height = depth.height();
    let top = if draws.chance(0.35) { draws.below(1 + height * 45 / 100) } else { 0 };
    let bottom = if draws.chance(0.15) { draws.below(1 + height * 40 / 100) } else { 0 };
    let Lens::Pinhole(mut lens) = camera.lens else { return (camera, depth) };
    lens.cy -= top as f64;
    let rows = height - top - bottom;
    let image = DepthImage::from_fn(depth.width(), rows, |x, y| depth.row(y + top)[x]);
    (Camera { lens: Lens::Pinhole(lens), height: rows, ..camera }, image)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use tagalong_conformance::figure::{Figure, World};
    use tagalong_core::{EgoMotion, Stamp};
    use tagalong_geometry::Pinhole;

    use super::*;

    fn sample() -> Sample {
        let camera =
            Arc::new(Camera::mounted(Pinhole::centred(250.0, 320, 240), 320, 240, 1.2, 0.0, 0.0));
        let images = World::with(&[Figure::at(2.5, 0.4)]).draw(&camera);
        let frame = Frame::new(1, Stamp::default(), camera, EgoMotion::at_rest(0.1), images);
        let head = Point3::new(2.5, 0.4, 1.6);
        let person = AnnotatedPerson::new(head);
        Sample::new(&frame, &[person], None, 0).unwrap()
    }

    #[test]
    fn the_person_moves_with_the_answer_in_every_variation() {
        let sample = sample();
        let mut places = Vec::new();
        for seed in 0..40 {
            let (map, targets) = sample.varied(&mut Draws(mix(seed)));
            // A person with few pixels left need not be found.
            let Some(place) = targets.places().first().copied() else { continue };
            let row = place[0] as usize;
            let column = place[1] as usize;
            let mut near =
                (row - 3..row + 4).flat_map(|y| (column - 3..column + 4).map(move |x| (y, x)));
            let has_tall = near.any(|(y, x)| {
                map.fine.at(2 * y, 2 * x)[FloorMap::FINE - 1] > 0.25 && map.in_view[y * 64 + x]
            });
            assert!(has_tall, "{seed}: {place:?}");
            places.push(place[1]);
        }
        places.sort_by(f64::total_cmp);
        assert!(places.len() > 30, "{}", places.len());
        // Turned and mirrored, the person is at both sides.
        assert!(places[0] < 26.0 && places[places.len() - 1] > 38.0, "{places:?}");
    }

    /// Where the scene grows by some hundredths, the surface of the person moves as the answer does.
    #[test]
    fn the_map_grows_with_the_answer() {
        fn distance([x, y]: [f64; 2]) -> f64 {
            x.hypot(y)
        }

        fn mean(cells: &[[f64; 2]]) -> [f64; 2] {
            let sum = cells.iter().fold([0.0; 2], |sum, cell| [sum[0] + cell[0], sum[1] + cell[1]]);
            sum.map(|sum| sum / cells.len() as f64)
        }

        fn floor(row: f64, column: f64) -> [f64; 2] {
            [0.2 + 0.1 * (row + 0.5), 0.1 * (column + 0.5) - 3.2]
        }

        let sample = sample();
        let mut pairs = Vec::new();
        for seed in 0..60 {
            let (map, targets) = sample.varied(&mut Draws(mix(seed)));
            let cells: Vec<[f64; 2]> =
                targets.places().into_iter().map(|[row, column]| floor(row, column)).collect();
            if cells.len() < 4 {
                continue;
            }
            let head = mean(&cells);
            let mut surface = Vec::new();
            for (row, column) in (0..128).flat_map(|row| (0..128).map(move |column| (row, column)))
            {
                let at = floor(row as f64 / 2.0 - 0.25, column as f64 / 2.0 - 0.25);
                let is_near = distance([at[0] - head[0], at[1] - head[1]]) < 0.4;
                if is_near && map.fine.at(row, column)[FloorMap::FINE - 1] > 0.3 {
                    surface.push(at);
                }
            }
            if surface.len() > 3 {
                pairs.push((distance(head), distance(mean(&surface))));
            }
        }
        assert!(pairs.len() > 30, "{}", pairs.len());
        let count = pairs.len() as f64;
        let (x, y) = pairs.iter().fold((0.0, 0.0), |(x, y), pair| (x + pair.0, y + pair.1));
        let x = x / count;
        let y = y / count;
        let across: f64 = pairs.iter().map(|pair| (pair.0 - x) * (pair.1 - y)).sum();
        let along: f64 = pairs.iter().map(|pair| (pair.0 - x).powi(2)).sum();
        assert!((0.7..1.3).contains(&(across / along)), "{}", across / along);
    }

    #[test]
    fn a_sample_keeps_depth_to_a_millimetre() {
        let sample = sample();
        let depth = sample.depth();
        let centre = depth.get(160, 120).unwrap();
        assert!((0.5..5.1).contains(&centre), "{centre}");
        assert_eq!((depth.width(), depth.height()), (320, 240));
        assert!((centre / STEP_M - (centre / STEP_M).round()).abs() < 1e-2);
    }

    /// Returns the variations of an image of one depth by some seeds.
    fn degraded(metres: f32) -> Vec<DepthImage> {
        (0..200)
            .map(|seed| {
                let mut depth = DepthImage::filled(120, 90, metres);
                degrade(&mut depth, &mut Draws(mix(seed)));
                depth
            })
            .collect()
    }

    /// Returns the readings of an image.
    fn readings(depth: &DepthImage) -> Vec<f64> {
        let pixels = depth.pixels().iter().filter(|metres| metres.is_finite());
        pixels.map(|metres| f64::from(*metres)).collect()
    }

    #[test]
    fn noise_grows_with_the_square_of_depth() {
        for metres in [1.0, 2.0] {
            let mut sigmas = Vec::new();
            for values in degraded(metres).iter().map(readings).filter(|v| v.len() > 1000) {
                let off: Vec<f64> = values.iter().map(|v| v - f64::from(metres)).collect();
                let mean = off.iter().sum::<f64>() / off.len() as f64;
                assert!(mean.abs() < 0.001, "noise has no direction: {mean}");
                sigmas.push((off.iter().map(|v| v * v).sum::<f64>() / off.len() as f64).sqrt());
            }
            // Up to 4 mm at 1 m, in half of the images.
            let most = 0.004 * f64::from(metres * metres);
            let largest = sigmas.iter().copied().fold(0.0, f64::max);
            assert!((0.9 * most..1.05 * most).contains(&largest), "{metres} m: {largest}");
            let still = sigmas.iter().filter(|sigma| **sigma < 1e-9).count();
            assert!((70..130).contains(&still), "{still} of 200");
        }
    }

    #[test]
    fn readings_are_lost_here_and_there_in_blocks_and_far_away() {
        fn lost(metres: f32) -> Vec<f64> {
            fn share(depth: &DepthImage) -> f64 {
                1.0 - readings(depth).len() as f64 / (120.0 * 90.0)
            }
            degraded(metres).iter().map(share).collect()
        }

        fn whole(shares: &[f64]) -> usize {
            shares.iter().filter(|share| **share < 1e-9).count()
        }

        fn none_left(shares: &[f64]) -> usize {
            shares.iter().filter(|share| **share > 1.0 - 1e-9).count()
        }

        let near = lost(2.9);
        let far = lost(6.0);
        // Nothing within 3 m is too far; a fifth of the cameras ends before 5.5 m.
        assert_eq!(none_left(&near), 0);
        assert!((20..65).contains(&none_left(&far)), "{}", none_left(&far));
        // Half of the images keep all: 0.7 have no single holes, and 0.7 no blocks.
        assert!((75..125).contains(&whole(&near)), "{}", whole(&near));
        assert!(near.iter().any(|share| *share > 0.3) && near.iter().all(|share| *share < 0.95));
    }

    #[test]
    fn a_hole_is_a_block_within_the_image() {
        let blocks = degraded(2.0).into_iter().filter(|depth| {
            let pixels = depth.pixels();
            let holes = pixels.iter().filter(|metres| metres.is_nan()).count();
            // A single block has no hole without one beside it; single holes are scattered.
            let pairs = pixels.windows(2).filter(|pair| pair.iter().all(|m| m.is_nan())).count();
            holes > 0 && 10 * pairs > 7 * holes
        });
        let sizes: Vec<[usize; 2]> = blocks
            .map(|depth| {
                let rows: Vec<usize> = (0..90)
                    .map(|y| depth.row(y).iter().filter(|metres| metres.is_nan()).count())
                    .collect();
                let widest = rows.iter().copied().max().unwrap_or(0);
                [widest, rows.iter().filter(|holes| **holes > 0).count()]
            })
            .collect();
        assert!(sizes.len() > 20, "{}", sizes.len());
        for k in [0, 1] {
            assert!(sizes.iter().any(|size| size[k] > 49), "several blocks: {sizes:?}");
        }
        assert!(sizes.iter().any(|[wide, high]| *wide < 50 && *high < 50), "{sizes:?}");
    }

    #[test]
    fn a_cut_image_shows_the_same_points() {
        fn same(a: &f32, b: &f32) -> bool {
            a == b || a.is_nan() && b.is_nan()
        }

        let sample = sample();
        let mut shifted = 0;
        let mut whole = 0;
        let mut shortest = usize::MAX;
        for seed in 0..100 {
            let (camera, image) = cut(sample.camera.clone(), sample.depth(), &mut Draws(mix(seed)));
            assert_eq!((camera.height, camera.width), (image.height(), 320));
            fn pixel(camera: &Camera) -> nalgebra::Point2<f64> {
                camera.project(&Point3::new(2.5, 0.4, 1.2)).unwrap()
            }
            let top = (pixel(&sample.camera).y - pixel(&camera).y).round() as usize;
            for y in [0, image.height() - 1] {
                let depth = sample.depth();
                assert!(image.row(y).iter().zip(depth.row(y + top)).all(|(a, b)| same(a, b)));
            }
            shifted += usize::from(top > 0);
            whole += usize::from(image.height() == 240);
            shortest = shortest.min(image.height());
        }
        // A third loses rows above; 0.65 x 0.85 lose none.
        assert!((20..50).contains(&shifted) && (40..70).contains(&whole), "{shifted} {whole}");
        assert!((36..130).contains(&shortest), "15 % are left at the least: {shortest}");
    }

    /// Returns the root of the mean square of some values.
    fn root_mean_square(values: impl ExactSizeIterator<Item = f64>) -> f64 {
        let count = values.len() as f64;
        (values.map(|value| value.powi(2)).sum::<f64>() / count).sqrt()
    }

    #[test]
    fn a_misjudged_camera_is_tilted_and_lifted_a_little() {
        let pose = sample().camera.robot_from_camera;
        let mut draws = Draws(9);
        let wrong: Vec<Isometry3<f64>> = (0..500).map(|_| misjudged(&pose, &mut draws)).collect();
        let turns: Vec<_> = wrong
            .iter()
            .map(|wrong| (wrong.rotation * pose.rotation.inverse()).scaled_axis())
            .collect();
        for axis in [0, 1] {
            let tilt = root_mean_square(turns.iter().map(|turn| turn[axis]));
            assert!((tilt / TILT_RAD - 1.0).abs() < 0.1, "{axis}");
        }
        let heading = root_mean_square(turns.iter().map(|turn| turn.z));
        assert!(heading < 1e-9, "its heading is known");
        let off = wrong.iter().map(|wrong| wrong.translation.vector - pose.translation.vector);
        let lifted = root_mean_square(off.clone().map(|off| off.z));
        assert!((lifted / HEIGHT_M - 1.0).abs() < 0.1);
        assert!(root_mean_square(off.map(|off| off.xy().norm())) < 1e-12);
    }

    #[test]
    fn numbers_that_look_random_are_spread_as_they_say() {
        fn mean(values: &[f64]) -> f64 {
            values.iter().sum::<f64>() / values.len() as f64
        }

        let mut draws = Draws(3);
        let normal: Vec<f64> = (0..4000).map(|_| draws.normal()).collect();
        let squares: Vec<f64> = normal.iter().map(|v| v * v).collect();
        assert!(mean(&normal).abs() < 0.05 && (mean(&squares) - 1.0).abs() < 0.06);
        let between: Vec<f64> = (0..4000).map(|_| draws.between(2.0, 6.0)).collect();
        assert!((mean(&between) - 4.0).abs() < 0.06);
        assert!(between.iter().all(|v| (2.0..6.0).contains(v)));
        let below: Vec<usize> = (0..400).map(|_| draws.below(3)).collect();
        assert!([0, 1, 2].iter().all(|k| below.contains(k)) && below.iter().all(|k| *k < 3));
        assert_eq!(draws.below(0), 0);
        let yes = (0..4000).filter(|_| draws.chance(0.2)).count();
        assert!((700..900).contains(&yes), "{yes}");
    }
}
