//! Wrong pixels, as a bad sensor, cable or decoder leaves them: single ones that are like none of their
//! eight neighbours.

use std::ops::Range;
use std::sync::Arc;

use tagalong_core::{DepthImage, Derived, Frame, Image, Images, Input, Result, RgbImage};

/// An image is cleaned if it has more than one wrong pixel in this number. Recordings have at most one in
/// 2,500, mostly of thin lines and letters.
const FEW: usize = 500;
/// Of the rows each one of this number is searched for wrong pixels ...
const ROW_STEP: usize = 16;
/// ... which must be at least so many, because small images have few pixels there.
const LEAST_WRONG: usize = 16;
/// Least difference of a wrong pixel's intensity from those of its neighbours.
const LEAST_INTENSITY: u8 = 40;
/// Least difference of a wrong reading's inverse depth from those of its neighbours, as a fraction of
/// their mean ...
const LEAST_SHARE: f32 = 1.0 / 8.0;
/// ... and in 1/m: the noise of a sensor is the same at all ranges, but the inverse depth is small far
/// away.
const LEAST_INVERSE: f32 = 0.03;
/// Least number of neighbours with a reading for a hole to be closed, and for a reading to stand out: at a
/// straight edge there are three.
const LEAST_READ: usize = 4;

/// A frame whose colour, intensity and depth images have no wrong pixels.
///
/// It is for the stages that find people. Those that drive see the images as they came: a single reading
/// may be a thin thing in the way.
pub struct Cleaned(Option<Frame>);

impl Cleaned {
    /// Returns the cleaned frame. `None` if its images have few wrong pixels or are a stereo pair, whose
    /// matching drops them.
    pub fn frame(&self) -> Option<&Frame> {
        self.0.as_ref()
    }
}

impl Derived for Cleaned {
    fn derive(frame: &Frame) -> Result<Self> {
        if frame.holds(Input::Right) {
            return Ok(Self(None));
        }
        let mut images = frame.images();
        let noisy_colour =
            images.colour.take_if(|colour| has_many(colour, is_like_in_green, is_green_wrong));
        let noisy_grey = images.grey.take_if(|grey| has_many(grey, is_like, is_wrong_intensity));
        let noisy_depth = images.depth.take_if(|depth| has_many(depth, is_in_place, stands_out));
        let is_noisy = noisy_colour.is_some() || noisy_grey.is_some() || noisy_depth.is_some();
        let images = Images {
            colour: noisy_colour.map(|image| Arc::new(cleaned_colour(&image))).or(images.colour),
            grey: noisy_grey
                .map(|image| Arc::new(changed(&image, cleaned_intensity)))
                .or(images.grey),
            depth: noisy_depth.map(|image| Arc::new(cleaned_depth(&image))).or(images.depth),
            right: None,
        };
        Ok(Self(is_noisy.then(|| frame.with_images(images))))
    }
}

/// A pixel and its eight neighbours.
type Patch<P> = (P, [P; 8]);

fn cleaned_colour(image: &RgbImage) -> RgbImage {
    changed(image, |(pixel, around)| {
        let is_wrong =
            |colour: usize| is_wrong_intensity((pixel[colour], around.map(|other| other[colour])));
        if !(0..3).any(is_wrong) {
            return pixel;
        }
        [0, 1, 2].map(|colour| middle(around.map(|other| other[colour])))
    })
}

fn is_like_in_green(pixel: [u8; 3], other: [u8; 3]) -> bool {
    is_like(pixel[1], other[1])
}

/// Looks at the green alone, for speed: wrong pixels are black or white, or of any colour.
fn is_green_wrong((pixel, around): Patch<[u8; 3]>) -> bool {
    is_wrong_intensity((pixel[1], around.map(|other| other[1])))
}

fn cleaned_intensity((pixel, around): Patch<u8>) -> u8 {
    if is_wrong_intensity((pixel, around)) { middle(around) } else { pixel }
}

fn is_wrong_intensity((pixel, around): Patch<u8>) -> bool {
    !around.into_iter().any(|other| is_like(pixel, other))
}

fn is_like(pixel: u8, other: u8) -> bool {
    pixel.abs_diff(other) < LEAST_INTENSITY
}

/// Returns the image without wrong readings and, because they leave some, without holes of one pixel.
fn cleaned_depth(image: &DepthImage) -> DepthImage {
    let without = changed(image, |patch| if is_wrong_reading(patch) { f32::NAN } else { patch.0 });
    changed(&without, closed)
}

/// Returns true for a wrong reading among others. One with few readings around it may be right: of those
/// of a sparse image, many are alone.
fn stands_out(patch: Patch<f32>) -> bool {
    let read = patch.1.into_iter().map(|metres| usize::from(DepthImage::is_reading(metres)));
    is_wrong_reading(patch) & (read.sum::<usize>() >= LEAST_READ)
}

/// Returns true for a reading that is on the surface of none of its neighbours.
fn is_wrong_reading((metres, around): Patch<f32>) -> bool {
    DepthImage::is_reading(metres)
        && !around.into_iter().any(|other| are_on_one_surface(metres, other))
}

/// Returns true for a hole, and for a reading on the surface of its neighbour.
fn is_in_place(metres: f32, other: f32) -> bool {
    !DepthImage::is_reading(metres) || are_on_one_surface(metres, other)
}

/// Returns true for two readings that may be of one surface.
fn are_on_one_surface(metres: f32, other: f32) -> bool {
    // The difference of the inverse depths, times both depths. No comparison holds without a reading.
    let most = (0.5 * LEAST_SHARE * (metres + other)).max(LEAST_INVERSE * metres * other);
    (metres - other).abs() < most
}

/// Returns a reading, or for a hole the median of its neighbours, if enough have a reading.
fn closed((metres, around): Patch<f32>) -> f32 {
    if DepthImage::is_reading(metres) {
        return metres;
    }
    let mut read =
        around.map(|other| if DepthImage::is_reading(other) { other } else { f32::INFINITY });
    read.sort_unstable_by(f32::total_cmp);
    let count = read.iter().take_while(|other| other.is_finite()).count();
    if count < LEAST_READ { metres } else { read[count / 2] }
}

/// Returns the fifth of eight intensities in order.
fn middle(mut around: [u8; 8]) -> u8 {
    around.sort_unstable();
    around[4]
}

/// Returns true if more than one pixel in [`FEW`] is wrong, by some of the rows. A pixel that is like the
/// one on its left, as most are, is not wrong.
fn has_many<P: Copy>(
    image: &Image<P>,
    is_like: impl Fn(P, P) -> bool,
    is_wrong: impl Fn(Patch<P>) -> bool,
) -> bool {
    let mut wrong = 0;
    let mut seen = 0;
    for y in inner(image).step_by(ROW_STEP) {
        let row = image.row(y);
        for x in 1..row.len() - 1 {
            if !is_like(row[x], row[x - 1]) && is_wrong(patch(image, x, y)) {
                wrong += 1;
            }
        }
        seen += row.len();
    }
    wrong >= LEAST_WRONG && wrong > seen / FEW
}

/// Returns the image with `change` applied to each pixel that has eight neighbours.
fn changed<P: Copy>(image: &Image<P>, change: impl Fn(Patch<P>) -> P) -> Image<P> {
    let mut to = image.clone();
    let width = image.width();
    for y in inner(image) {
        for x in 1..width - 1 {
            to.pixels_mut()[y * width + x] = change(patch(image, x, y));
        }
    }
    to
}

/// Returns the rows with pixels that have eight neighbours.
fn inner<P: Copy>(image: &Image<P>) -> Range<usize> {
    if image.width() < 3 { 0..0 } else { 1..image.height().saturating_sub(1) }
}

/// Returns a pixel that has eight neighbours, with them.
fn patch<P: Copy>(image: &Image<P>, x: usize, y: usize) -> Patch<P> {
    let above = &image.row(y - 1)[x - 1..x + 2];
    let row = &image.row(y)[x - 1..x + 2];
    let below = &image.row(y + 1)[x - 1..x + 2];
    let around = [above[0], above[1], above[2], row[0], row[2], below[0], below[1], below[2]];
    (row[1], around)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use tagalong_core::{EgoMotion, GreyImage, RightImage, Stamp};
    use tagalong_geometry::{Camera, Pinhole};
    use tagalong_math::{RandomSource, SplitMix64};

    use super::*;

    fn frame(images: Images) -> Frame {
        let camera = Camera::mounted(Pinhole::centred(260.0, 320, 240), 320, 240, 1.0, 0.0, 0.0);
        Frame::new(1, Stamp::default(), Arc::new(camera), EgoMotion::at_rest(0.0), images)
    }

    /// A wall at 4 m with a person-sized thing at 2 m before it, and a hole.
    fn depth() -> DepthImage {
        DepthImage::from_fn(320, 240, |x, y| match (x, y) {
            (30..60, 30..60) => f32::NAN,
            (130..200, 60..) => 2.0,
            _ => 4.0,
        })
    }

    fn colour() -> RgbImage {
        RgbImage::from_fn(320, 240, |x, y| match x {
            ..160 => [90, 60, 200],
            _ => [(y / 4) as u8, 180, 30],
        })
    }

    /// Returns an image with wrong pixels instead of a share of its own.
    fn salted<P: Copy>(
        image: &Image<P>,
        share: f64,
        wrong: impl Fn(&mut SplitMix64) -> P,
    ) -> Image<P> {
        let mut random = SplitMix64::new(7);
        image.map(|pixel| if random.uniform() < share { wrong(&mut random) } else { pixel })
    }

    /// The pixels of two images that differ, without the border.
    fn different<P: Copy + PartialEq>(one: &Image<P>, other: &Image<P>) -> usize {
        let inside = (1..239).flat_map(|y| (1..319).map(move |x| (x, y)));
        inside.filter(|(x, y)| one.get(*x, *y) != other.get(*x, *y)).count()
    }

    #[test]
    fn an_image_with_wrong_pixels_becomes_the_one_without() {
        let white = salted(&colour(), 0.02, |_| [255; 3]);
        let noisy = salted(&depth(), 0.02, |random| random.between(0.5, 8.0) as f32);
        let wrong = different(&white, &colour());
        assert!(wrong > 1000, "{wrong}");
        let images = Images {
            colour: Some(Arc::new(white)),
            depth: Some(Arc::new(noisy)),
            ..Images::default()
        };
        let frame = frame(images);
        let cleaned = frame.derived::<Cleaned>().unwrap();
        let clean = cleaned.frame().unwrap();
        // Two wrong pixels side by side stay.
        let left = different(clean.colour().unwrap(), &colour());
        assert!(left < wrong / 4, "{left} of {wrong} pixels are wrong");
        // What is no reading differs from itself.
        let holes = depth().pixels().iter().filter(|metres| metres.is_nan()).count();
        let left = different(clean.depth().unwrap(), &depth()) - holes;
        assert!(left < wrong / 4, "{left} readings are wrong");
    }

    #[test]
    fn a_clean_image_and_a_stereo_pair_are_not_changed() {
        let mut few = depth();
        // Of a row that is searched: fifteen wrong readings.
        (0..15).for_each(|at| few.pixels_mut()[17 * 320 + 3 + 7 * at] = 1.0);
        let images = Images {
            colour: Some(Arc::new(colour())),
            depth: Some(Arc::new(few)),
            ..Images::default()
        };
        assert!(frame(images).derived::<Cleaned>().unwrap().frame().is_none());
        let white = salted(&colour(), 0.05, |_| [255; 3]);
        let right = RightImage { image: white.to_grey(), baseline_m: 0.1 };
        let images = Images {
            colour: Some(Arc::new(white)),
            right: Some(Arc::new(right)),
            ..Images::default()
        };
        assert!(frame(images).derived::<Cleaned>().unwrap().frame().is_none());
    }

    /// Filters for it are in the detectors that need a dense image.
    #[test]
    fn an_image_with_half_of_its_readings_is_not_changed() {
        let sparse = salted(&depth(), 0.5, |_| f32::NAN);
        let images = Images { depth: Some(Arc::new(sparse)), ..Images::default() };
        assert!(frame(images).derived::<Cleaned>().unwrap().frame().is_none());
    }

    #[test]
    fn of_two_images_only_the_noisy_one_is_changed() {
        let white = salted(&colour().to_grey(), 0.02, |_| 255);
        let depth = Arc::new(depth());
        let images = Images {
            grey: Some(Arc::new(white.clone())),
            depth: Some(Arc::clone(&depth)),
            ..Images::default()
        };
        let frame = frame(images);
        let cleaned = frame.derived::<Cleaned>().unwrap();
        let clean = cleaned.frame().unwrap();
        assert!(std::ptr::eq(clean.depth().unwrap(), &*depth));
        assert!(different(clean.grey().unwrap(), &white) > 1000);
    }

    #[test]
    fn edges_thin_lines_and_small_images_stay() {
        let line = DepthImage::from_fn(96, 64, |x, y| if x == y { 1.0 } else { 4.0 });
        assert_eq!(cleaned_depth(&line), line);
        for (width, height) in [(0, 0), (1, 5), (2, 2), (5, 1)] {
            let image = GreyImage::filled(width, height, 9);
            assert!(!has_many(&image, |_, _| false, |_| true), "{width}x{height}");
            assert_eq!(changed(&image, |_| 0), image);
        }
        // A single reading in a hole is dropped, and a hole at a corner of a surface is not closed.
        let mut lone = DepthImage::filled(5, 5, f32::NAN);
        lone.pixels_mut()[12] = 2.0;
        assert!(cleaned_depth(&lone).pixels().iter().all(|metres| metres.is_nan()));
        let corner = DepthImage::from_fn(5, 5, |x, y| if x > 2 || y > 2 { f32::NAN } else { 3.0 });
        assert!(cleaned_depth(&corner).get(3, 3).unwrap().is_nan());
        assert!(cleaned_depth(&corner).get(2, 3).unwrap().is_nan());
    }

    proptest! {
        /// The definition, in inverse depth.
        #[test]
        fn a_wrong_reading_is_on_no_surface_of_its_neighbours(
            metres in 0.3f32..9.0,
            around in proptest::array::uniform8(prop_oneof![Just(f32::NAN), 0.3f32..9.0]),
        ) {
            let margins: Vec<f32> = around.iter().filter(|other| !other.is_nan()).map(|other| {
                let [a, b] = [1.0 / metres, 1.0 / other];
                (a - b).abs() - (0.5 * (a + b) / 8.0).max(0.03)
            }).collect();
            // At the very limit the two ways of writing it round differently.
            prop_assume!(margins.iter().all(|margin| margin.abs() > 1e-5));
            prop_assert_eq!(is_wrong_reading((metres, around)), margins.iter().all(|margin| *margin > 0.0));
        }
    }
}
