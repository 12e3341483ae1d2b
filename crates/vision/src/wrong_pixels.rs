//! Wrong pixels, as a bad sensor, cable or decoder leaves them: single ones that are like none of their
//! eight neighbours.

use std::sync::Arc;

use tagalong_core::{DepthImage, Derived, Frame, Image, Input, Result, RgbImage};

/// An image is cleaned if it has more than one wrong pixel in this number. Recordings have at most one in
/// 2,500, mostly of thin lines and letters.
const FEW: usize = 500;
/// Of the rows each one of this number is searched for wrong pixels.
const ROW_STEP: usize = 4;
/// Least difference of a wrong pixel's intensity from those of its neighbours.
const LEAST_INTENSITY: u8 = 40;
/// Least difference of a wrong reading's inverse depth from those of its neighbours, as a fraction of
/// their mean ...
const LEAST_SHARE: f32 = 1.0 / 8.0;
/// ... and in 1/m: the noise of a sensor is the same at all ranges, but the inverse depth is small far
/// away.
const LEAST_INVERSE: f32 = 0.03;
/// Least number of neighbours with a reading for a hole to be closed: at a straight edge there are three.
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
        let is_noisy = frame.grey().is_ok_and(|grey| has_many(grey, is_wrong_intensity));
        if is_noisy {
            images.colour = images.colour.map(|image| Arc::new(cleaned_colour(&image)));
            images.grey = images.grey.map(|image| Arc::new(changed(&image, cleaned_intensity)));
        }
        let noisy_depth = images.depth.take_if(|depth| has_many(depth, is_wrong_reading));
        let is_changed = is_noisy || noisy_depth.is_some();
        images.depth = noisy_depth.map(|depth| Arc::new(cleaned_depth(&depth))).or(images.depth);
        Ok(Self(is_changed.then(|| frame.with_images(images))))
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

fn cleaned_intensity((pixel, around): Patch<u8>) -> u8 {
    if is_wrong_intensity((pixel, around)) { middle(around) } else { pixel }
}

fn is_wrong_intensity((pixel, around): Patch<u8>) -> bool {
    let least = around.into_iter().fold(u8::MAX, |least, other| least.min(pixel.abs_diff(other)));
    least >= LEAST_INTENSITY
}

/// Returns the image without wrong readings and, because they leave some, without holes of one pixel.
fn cleaned_depth(image: &DepthImage) -> DepthImage {
    let without =
        changed(
            image,
            |(metres, around)| {
                if is_wrong_reading((metres, around)) { f32::NAN } else { metres }
            },
        );
    changed(&without, closed)
}

/// Returns true for a reading that is on the surface of none of its neighbours.
fn is_wrong_reading((metres, around): Patch<f32>) -> bool {
    // No comparison holds for a pixel without a reading.
    let is_near = around.into_iter().fold(false, |is_near, other| {
        let most = (0.5 * LEAST_SHARE * (metres + other)).max(LEAST_INVERSE * metres * other);
        is_near | ((metres - other).abs() < most)
    });
    DepthImage::is_reading(metres) & !is_near
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

/// Returns true if more than one pixel in [`FEW`] is wrong.
fn has_many<P: Copy>(image: &Image<P>, is_wrong: impl Fn(Patch<P>) -> bool) -> bool {
    let mut wrong = 0;
    let mut seen = 0;
    for y in (1..image.height().saturating_sub(1)).step_by(ROW_STEP) {
        let row = row_of_patches(image, y).map(|patch| usize::from(is_wrong(patch)));
        wrong += row.sum::<usize>();
        seen += image.width();
    }
    wrong > seen / FEW
}

/// Returns the image with `change` applied to each pixel that has eight neighbours.
fn changed<P: Copy>(image: &Image<P>, change: impl Fn(Patch<P>) -> P) -> Image<P> {
    let mut to = image.clone();
    let width = image.width();
    for y in 1..image.height().saturating_sub(1) {
        let row = &mut to.pixels_mut()[y * width..(y + 1) * width];
        for (pixel, patch) in row.iter_mut().skip(1).zip(row_of_patches(image, y)) {
            *pixel = change(patch);
        }
    }
    to
}

/// Returns the patches of a row that is neither the first nor the last.
fn row_of_patches<P: Copy>(image: &Image<P>, y: usize) -> impl Iterator<Item = Patch<P>> {
    let inside = image.width().saturating_sub(2);
    // Nine rows of equal length: loops over them become vector instructions.
    let [above, row, below] = [y - 1, y, y + 1].map(|y| {
        let row = image.row(y);
        [0, 1, 2].map(|from| row.get(from..from + inside).unwrap_or(&[]))
    });
    (0..inside).map(move |x| {
        let around = [
            above[0][x],
            above[1][x],
            above[2][x],
            row[0][x],
            row[2][x],
            below[0][x],
            below[1][x],
            below[2][x],
        ];
        (row[1][x], around)
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use tagalong_core::{EgoMotion, GreyImage, Images, RightImage, Stamp};
    use tagalong_geometry::{Camera, Pinhole};
    use tagalong_math::{RandomSource, SplitMix64};

    use super::*;

    fn frame(images: Images) -> Frame {
        let camera = Camera::mounted(Pinhole::centred(80.0, 96, 64), 96, 64, 1.0, 0.0, 0.0);
        Frame::new(1, Stamp::default(), Arc::new(camera), EgoMotion::at_rest(0.0), images)
    }

    /// A wall at 4 m with a person-sized thing at 2 m before it, and a hole.
    fn depth() -> DepthImage {
        DepthImage::from_fn(96, 64, |x, y| match (x, y) {
            (10..20, 10..20) => f32::NAN,
            (40..60, 16..) => 2.0,
            _ => 4.0,
        })
    }

    fn colour() -> RgbImage {
        RgbImage::from_fn(96, 64, |x, y| if x < 48 { [90, 60, 200] } else { [y as u8, 180, 30] })
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
        let inside = (1..63).flat_map(|y| (1..95).map(move |x| (x, y)));
        inside.filter(|(x, y)| one.get(*x, *y) != other.get(*x, *y)).count()
    }

    #[test]
    fn an_image_with_wrong_pixels_becomes_the_one_without() {
        let white = salted(&colour(), 0.02, |_| [255; 3]);
        let noisy = salted(&depth(), 0.02, |random| random.between(0.5, 8.0) as f32);
        assert!(different(&white, &colour()) > 90);
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
        assert!(left < 25, "{left} pixels are wrong");
        // What is no reading differs from itself.
        let holes = depth().pixels().iter().filter(|metres| metres.is_nan()).count();
        let left = different(clean.depth().unwrap(), &depth()) - holes;
        assert!(left < 25, "{left} readings are wrong");
    }

    #[test]
    fn a_clean_image_and_a_stereo_pair_are_not_changed() {
        let mut few = depth();
        few.pixels_mut()[5 * 96 + 7] = 1.0;
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
        assert!(different(clean.grey().unwrap(), &white) > 90);
    }

    #[test]
    fn edges_thin_lines_and_small_images_stay() {
        let line = DepthImage::from_fn(96, 64, |x, y| if x == y { 1.0 } else { 4.0 });
        assert_eq!(cleaned_depth(&line), line);
        for (width, height) in [(0, 0), (1, 5), (2, 2), (5, 1)] {
            let image = GreyImage::filled(width, height, 9);
            assert!(!has_many(&image, |_| true) || width > 2, "{width}x{height}");
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
