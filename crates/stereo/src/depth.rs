use std::ops::RangeInclusive;
use std::sync::Arc;

use tagalong_core::{DepthImage, Error, Frame, Funnel, GreyImage, Result};
use tagalong_geometry::Lens;

use crate::matcher::size_error;
use crate::rectification::Rectification;
use crate::reduce::Reducer;
use crate::settings::MAX_DISPARITIES;
use crate::{Disparities, Dropped, Matcher, StereoSettings};

/// Number of frames between two checks of the rectification.
const CHECK_EVERY: u64 = 30;

/// Mean brightness up to which an image counts as black.
const BLACK: u8 = 8;
/// Brightness from which a pixel counts as saturated.
const SATURATED: u8 = 250;
/// Maximum fraction of saturated pixels.
const MAX_SATURATED: f64 = 0.9;
/// Maximum ratio of the mean brightness of equally exposed cameras.
const MAX_RATIO: f64 = 1.2;
/// Minimum difference between the brightest and the darkest pixel.
const MIN_CONTRAST: u8 = 8;

/// Computes the depth of frames with a right image.
#[derive(Debug)]
pub struct StereoDepth {
    settings: StereoSettings,
    matcher: Matcher,
    left: Reducer,
    right: Reducer,
    rectification: Rectification,
    frames: u64,
    depth: Arc<DepthImage>,
}

impl StereoDepth {
    /// Creates the computation with these settings.
    ///
    /// # Errors
    /// As [`StereoSettings::check`].
    pub fn new(settings: StereoSettings) -> Result<Self> {
        Ok(Self {
            matcher: Matcher::new(settings.clone())?,
            settings,
            left: Reducer::default(),
            right: Reducer::default(),
            rectification: Rectification::default(),
            frames: 0,
            depth: Arc::default(),
        })
    }

    /// Returns the depth of a frame's left image, of the same size: metres along the optical axis,
    /// NaN = unknown. The funnel counts the reasons for unknown pixels, or for an image without any
    /// depth. It also counts frames in which the least depth has a disparity above the largest one
    /// that is searched, 255 px: nearer points are then unknown.
    ///
    /// # Errors
    /// [`Error::MissingImage`] without a right or a left image; [`Error::Other`] if they differ in
    /// size, the camera is not a pinhole, or its focal length or the baseline is not positive.
    pub fn depth(&mut self, frame: &Frame, funnel: &mut Funnel) -> Result<Arc<DepthImage>> {
        let right = frame.right()?;
        let left = frame.grey()?;
        if let Some(error) = size_error(left, &right.image) {
            return Err(error);
        }
        let fx = focal_px(frame)?;
        if !(right.baseline_m.is_finite() && right.baseline_m > 0.0) {
            let message = format!("the baseline of a stereo pair is not {} m", right.baseline_m);
            return Err(Error::Other(message));
        }
        let size = reduced_size(left, self.settings.width);
        let scale = size.0 as f64 / left.width() as f64;
        let fine = left;
        let left = at_size(&mut self.left, left, size);
        let right_image = at_size(&mut self.right, &right.image, size);
        let focal_baseline = fx * scale * right.baseline_m;
        let wanted = max_disparity(&self.settings, focal_baseline);
        let max_disparity = wanted.min(MAX_DISPARITIES - 1);
        // Not for each frame, because the search in all directions is slow.
        if self.frames.is_multiple_of(CHECK_EVERY) {
            self.rectification = Rectification::measure(left, right_image, max_disparity);
        }
        self.frames += 1;
        let depth = unshared(&mut self.depth, fine.width(), fine.height());
        depth.pixels_mut().fill(f32::NAN);
        if let Some(reason) = unusable(left, right_image, &self.rectification) {
            funnel.drop_many(reason, 1);
            return Ok(Arc::clone(&self.depth));
        }
        let too_near = wanted > max_disparity;
        funnel.drop_many("stereo: least depth beyond 255 px of disparity", u64::from(too_near));
        let off = self.rectification.vertical_px.abs() > self.settings.max_vertical_px;
        funnel.drop_many("stereo: images vertically off", u64::from(off));
        let unequal = are_unequal(left, right_image);
        funnel.drop_many("stereo: cameras differ in brightness", u64::from(unequal));
        let disparities = self.matcher.disparities(left, right_image, max_disparity)?;
        count(&disparities.dropped, funnel);
        let range = self.settings.min_depth_m as f32..=self.settings.max_depth_m as f32;
        let out = write(&disparities, focal_baseline as f32, &range, depth);
        funnel.drop_many("stereo pixels: outside of the depth range", out);
        Ok(Arc::clone(&self.depth))
    }

    /// Returns the rectification measured on a recent pair.
    pub fn rectification(&self) -> Rectification {
        self.rectification
    }
}

fn focal_px(frame: &Frame) -> Result<f64> {
    match &frame.camera.lens {
        Lens::Pinhole(lens) if lens.fx.is_finite() && lens.fx > 0.0 => Ok(lens.fx),
        Lens::Pinhole(lens) => {
            let message = format!("the focal length of a stereo camera is not {} px", lens.fx);
            Err(Error::Other(message))
        }
        _ => Err(Error::Other("a stereo pair needs pinhole cameras".into())),
    }
}

fn reduced_size(image: &GreyImage, width: usize) -> (usize, usize) {
    let from = image.width();
    let height = image.height();
    if from <= width {
        return (from, height);
    }
    // Rounded up, so that a flat image keeps at least one row.
    (width, (height * width).div_ceil(from))
}

fn at_size<'a>(
    reducer: &'a mut Reducer,
    image: &'a GreyImage,
    (width, height): (usize, usize),
) -> &'a GreyImage {
    if width == image.width() { image } else { reducer.reduce(image, width, height) }
}

fn max_disparity(settings: &StereoSettings, focal_baseline: f64) -> usize {
    match settings.max_disparity {
        0 => (focal_baseline / settings.min_depth_m).ceil() as usize,
        wanted => wanted,
    }
}

/// Returns the image to write depth to: that of the previous frame unless it is still shared.
fn unshared(depth: &mut Arc<DepthImage>, width: usize, height: usize) -> &mut DepthImage {
    let fits = (depth.width(), depth.height()) == (width, height);
    if !fits || Arc::get_mut(depth).is_none() {
        *depth = Arc::new(DepthImage::filled(width, height, f32::NAN));
    }
    Arc::make_mut(depth)
}

/// Sums a quantity of at most 255 over all pixels. The sum of a row cannot overflow, and a check
/// for it would keep the loop from becoming vector instructions.
fn count_up(image: &GreyImage, of: impl Fn(u8) -> u32) -> u64 {
    let rows = image.pixels().chunks(image.width().max(1));
    rows.map(|row| u64::from(row.iter().fold(0_u32, |sum, p| sum.wrapping_add(of(*p))))).sum()
}

/// Returns true if one image is so much brighter that semi-global matching, which also compares
/// brightness, does worse.
fn are_unequal(left: &GreyImage, right: &GreyImage) -> bool {
    fn sum(image: &GreyImage) -> u64 {
        count_up(image, u32::from)
    }

    let left = sum(left) as f64;
    let right = sum(right) as f64;
    left.max(right) > MAX_RATIO * left.min(right)
}

/// Returns the reason for which a pair cannot be matched.
fn unusable(
    left: &GreyImage,
    right: &GreyImage,
    rectification: &Rectification,
) -> Option<&'static str> {
    fn range(image: &GreyImage) -> (u8, u8) {
        let pixels = image.pixels().iter();
        pixels.fold((u8::MAX, 0), |(low, high), p| (low.min(*p), high.max(*p)))
    }

    fn bright(image: &GreyImage) -> bool {
        let bright = count_up(image, |p| u32::from(p >= SATURATED));
        bright as f64 > MAX_SATURATED * image.pixels().len() as f64
    }
    let ((low, high), (low_right, high_right)) = (range(left), range(right));
    if high.min(high_right) <= BLACK {
        Some("stereo: image is black")
    } else if bright(left) || bright(right) {
        Some("stereo: image is saturated")
    } else if (high - low).min(high_right - low_right) < MIN_CONTRAST {
        Some("stereo: image without texture")
    } else if rectification.is_swapped() {
        Some("stereo: left and right are swapped")
    } else {
        None
    }
}

fn count(dropped: &Dropped, funnel: &mut Funnel) {
    funnel.drop_many("stereo pixels: outside of the right image", dropped.outside);
    funnel.drop_many("stereo pixels: not unique", dropped.not_unique);
    funnel.drop_many("stereo pixels: left and right disagree", dropped.left_right);
    funnel.drop_many("stereo pixels: smooth", dropped.unsupported);
    funnel.drop_many("stereo pixels: speckle", dropped.speckle);
}

/// Writes the depths at full size, each to all pixels that its reduced pixel covers; returns the
/// number of depths out of range.
fn write(
    disparities: &Disparities<'_>,
    focal_baseline: f32,
    range: &RangeInclusive<f32>,
    depth: &mut DepthImage,
) -> u64 {
    let width = disparities.width;
    let fine = (depth.width(), depth.height());
    let height = disparities.values.len() / width.max(1);
    let mut out = 0;
    let columns: Vec<usize> = (0..fine.0).map(|x| x * width / fine.0).collect();
    for (y, row) in depth.pixels_mut().chunks_exact_mut(fine.0.max(1)).enumerate() {
        let from = y * height / fine.1 * width;
        let values = &disparities.values[from..from + width];
        if width == fine.0 {
            row.copy_from_slice(values);
        } else {
            row.iter_mut().zip(&columns).for_each(|(depth, column)| *depth = values[*column]);
        }
        out += u64::from(to_depth(row, focal_baseline, range));
    }
    out
}

/// Converts the disparities of a row into depths; returns the number out of range.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
fn to_depth(row: &mut [f32], focal_baseline: f32, range: &RangeInclusive<f32>) -> u32 {
    let nearest = *range.start();
    let farthest = *range.end();
    let mut out = 0_u32;
    for depth in row {
        let metres = focal_baseline / *depth;
        let inside = (metres >= nearest) & (metres <= farthest);
        // A sum with an overflow check cannot be vectorised.
        out = out.wrapping_add(u32::from(!inside & !metres.is_nan()));
        *depth = if inside { metres } else { f32::NAN };
    }
    out
}
