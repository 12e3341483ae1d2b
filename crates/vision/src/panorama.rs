//! Unwrapping of the circular image of a conical mirror.
//!
//! Towards the centre of the circle one raw pixel covers many columns of the panorama, which are
//! interpolated there. Towards the rim a pixel of the panorama covers several raw ones. Sampling
//! only one of them would alias, so each row is read from a raw image that is halved as often as
//! its resolution allows without falling below that of the row (Williams, "Pyramidal parametrics",
//! SIGGRAPH 1983, without blending between levels: a row has one level). All positions and weights
//! are computed once.

use std::f64::consts::TAU;
use std::sync::Arc;

use tagalong_core::{Error, Image, Images, Result};
use tagalong_geometry::Panorama;

/// Pixel type that can be interpolated.
pub trait Blend: Copy + Default {
    /// Returns the mean of four pixels, rounded.
    fn mean(four: [Self; 4]) -> Self;
    /// Interpolates bilinearly between upper left, upper right, lower left and lower right, with
    /// the offsets to the right and down in 256ths.
    fn bilinear(four: [Self; 4], across: u32, down: u32) -> Self;
}

impl Blend for u8 {
    #[inline]
    fn mean(four: [Self; 4]) -> Self {
        ((four.map(u32::from).iter().sum::<u32>() + 2) >> 2) as Self
    }

    #[inline]
    fn bilinear(four: [Self; 4], across: u32, down: u32) -> Self {
        let [a, b, c, d] = four.map(u32::from);
        let upper = a * (256 - across) + b * across;
        let lower = c * (256 - across) + d * across;
        ((upper * (256 - down) + lower * down + 32_768) >> 16) as Self
    }
}

impl Blend for [u8; 3] {
    #[inline]
    fn mean(four: [Self; 4]) -> Self {
        let [a, b, c, d] = four;
        std::array::from_fn(|i| u8::mean([a[i], b[i], c[i], d[i]]))
    }

    #[inline]
    fn bilinear(four: [Self; 4], across: u32, down: u32) -> Self {
        let [a, b, c, d] = four;
        std::array::from_fn(|i| u8::bilinear([a[i], b[i], c[i], d[i]], across, down))
    }
}

/// Position in a level from which a pixel of the panorama is read.
#[derive(Clone, Copy, Debug)]
struct Tap {
    /// Index of the upper left of four pixels, within its level.
    at: u32,
    /// Offsets to the right and down, 256ths of a pixel.
    across: u8,
    down: u8,
}

/// Size and position of the raw image or of a halved one.
#[derive(Clone, Copy, Debug)]
struct Level {
    width: usize,
    height: usize,
    /// Offset among the halved images; the raw image is not stored.
    start: usize,
}

impl Level {
    fn halved(&self, start: usize) -> Self {
        Self { width: self.width / 2, height: self.height / 2, start }
    }

    fn len(&self) -> usize {
        self.width * self.height
    }

    /// Splits a position into the index of the lower of two pixels and the offset beyond it.
    fn split(place: f64, size: usize) -> (usize, u8) {
        // The upper bound keeps the pixel after `cell` within the image.
        let most = size as f64 - 1.0 - 1.0 / 256.0;
        let fine = (place.clamp(0.0, most) * 256.0).round() as usize;
        let cell = (fine / 256).min(size - 2);
        (cell, (fine - 256 * cell).min(255) as u8)
    }
}

/// Unwraps raw images of one camera, with buffers that are kept between images.
///
/// ```
/// use tagalong_core::GreyImage;
/// use tagalong_geometry::{ConicalMirror, Panorama};
/// use tagalong_vision::Unwrapper;
/// let d = [67.5_f64.to_radians(), 0.05, 8.0, 230.0];
/// let mirror = ConicalMirror::new(175.0, [239.5, 239.5], d).unwrap();
/// let panorama = Panorama { mirror, columns: 480, rows: 120 };
/// let mut unwrapper = Unwrapper::new(&panorama, 480, 480).unwrap();
/// let mut out = GreyImage::default();
/// unwrapper.apply(&GreyImage::filled(480, 480, 9), &mut out).unwrap();
/// assert_eq!(out, GreyImage::filled(480, 120, 9));
/// ```
#[derive(Clone, Debug)]
pub struct Unwrapper<P> {
    columns: usize,
    levels: Vec<Level>,
    /// Level of each row.
    rows: Vec<usize>,
    taps: Vec<Tap>,
    halved: Vec<P>,
}

impl<P: Blend> Unwrapper<P> {
    /// Creates the unwrapping for raw images of `width` x `height` pixels.
    ///
    /// # Errors
    /// [`Error::Other`] for numbers that describe no valid mirror, an empty panorama, or raw images
    /// smaller than 2 x 2 pixels.
    pub fn new(panorama: &Panorama, width: usize, height: usize) -> Result<Self> {
        let empty = panorama.columns == 0 || panorama.rows == 0 || width.min(height) < 2;
        if !panorama.mirror.is_sane() || empty {
            return Err(Error::Other(format!(
                "{width}x{height} pixels of {:?} cannot be unwrapped to {}x{}",
                panorama.mirror, panorama.columns, panorama.rows
            )));
        }
        let wanted: Vec<usize> = (0..panorama.rows).map(|row| coarseness(panorama, row)).collect();
        let levels = pyramid(width, height, wanted.iter().copied().max().unwrap_or(0));
        let rows: Vec<usize> = wanted.into_iter().map(|w| w.min(levels.len() - 1)).collect();
        let places =
            (0..panorama.rows).flat_map(|row| (0..panorama.columns).map(move |c| (row, c)));
        let taps =
            places.map(|(row, column)| tap(panorama, &levels, rows[row], column, row)).collect();
        let halved = vec![P::default(); levels[1..].iter().map(Level::len).sum()];
        Ok(Self { columns: panorama.columns, levels, rows, taps, halved })
    }

    /// Unwraps `raw` into `out`, which is reallocated only if its size is wrong.
    ///
    /// # Errors
    /// [`Error::Other`] if the size of the raw image differs from that given to [`Self::new`].
    pub fn apply(&mut self, raw: &Image<P>, out: &mut Image<P>) -> Result<()> {
        let Level { width, height, .. } = self.levels[0];
        if (raw.width(), raw.height()) != (width, height) {
            let w = raw.width();
            let h = raw.height();
            let why =
                format!("a raw panorama of {w}x{h} pixels where {width}x{height} were set up");
            return Err(Error::Other(why));
        }
        if (out.width(), out.height()) != (self.columns, self.rows.len()) {
            *out = Image::filled(self.columns, self.rows.len(), P::default());
        }
        self.halve(raw.pixels());
        self.fill(raw.pixels(), out.pixels_mut());
        Ok(())
    }

    fn halve(&mut self, raw: &[P]) {
        for pair in self.levels.windows(2) {
            let fine = pair[0];
            let coarse = pair[1];
            let (before, after) = self.halved.split_at_mut(coarse.start);
            let from = if fine.width == self.levels[0].width { raw } else { &before[fine.start..] };
            let rows = from.chunks_exact(2 * fine.width).zip(after.chunks_exact_mut(coarse.width));
            for (two, to) in rows.take(coarse.height) {
                halve_row(two.split_at(fine.width), to);
            }
        }
    }

    fn fill(&self, raw: &[P], out: &mut [P]) {
        let rows = out.chunks_exact_mut(self.columns).zip(self.taps.chunks_exact(self.columns));
        for ((out, taps), level) in rows.zip(&self.rows) {
            let Level { width, start, .. } = self.levels[*level];
            let from = if *level == 0 { raw } else { &self.halved[start..] };
            for (out, tap) in out.iter_mut().zip(taps) {
                let four = &from[tap.at as usize..][..width + 2];
                let four = [four[0], four[1], four[width], four[width + 1]];
                *out = P::bilinear(four, u32::from(tap.across), u32::from(tap.down));
            }
        }
    }
}

/// Unwrapping of colour and grey images of one camera. The [`Unwrapper`]s are created when they are
/// first needed.
#[derive(Clone, Debug, Default)]
pub struct Unwrapping {
    colour: Option<(Panorama, Unwrapper<[u8; 3]>)>,
    grey: Option<(Panorama, Unwrapper<u8>)>,
}

impl Unwrapping {
    /// Returns the images with the circular ones of the mirror unwrapped. A mirror camera has
    /// neither depth nor a right image.
    ///
    /// # Errors
    /// As [`Unwrapper::new`] and [`Unwrapper::apply`].
    pub fn apply(&mut self, panorama: &Panorama, raw: &Images) -> Result<Images> {
        let colour =
            raw.colour.as_deref().map(|image| unwrapped(&mut self.colour, panorama, image));
        let grey = raw.grey.as_deref().map(|image| unwrapped(&mut self.grey, panorama, image));
        Ok(Images { colour: colour.transpose()?, grey: grey.transpose()?, ..Images::default() })
    }
}

fn unwrapped<P: Blend>(
    kept: &mut Option<(Panorama, Unwrapper<P>)>,
    panorama: &Panorama,
    raw: &Image<P>,
) -> Result<Arc<Image<P>>> {
    let mut known = match kept.take().filter(|known| known.0 == *panorama) {
        Some(known) => known,
        None => (*panorama, Unwrapper::new(panorama, raw.width(), raw.height())?),
    };
    let mut out = Image::default();
    let done = known.1.apply(raw, &mut out);
    *kept = Some(known);
    done.map(|()| Arc::new(out))
}

fn halve_row<P: Blend>((upper, lower): (&[P], &[P]), to: &mut [P]) {
    let pairs = upper.chunks_exact(2).zip(lower.chunks_exact(2));
    for (to, (a, b)) in to.iter_mut().zip(pairs) {
        *to = P::mean([a[0], a[1], b[0], b[1]]);
    }
}

/// Returns the number of halvings after which the raw image is still as fine as a row, by the
/// geometric mean of the raw pixels per column and per row of the panorama.
fn coarseness(panorama: &Panorama, row: usize) -> usize {
    let row = row as f64;
    let [above, own, below] =
        [row - 0.5, row, row + 0.5].map(|row| panorama.mirror.radius_px(panorama.elevation(row)));
    let across = TAU * own / panorama.columns as f64;
    let down = (above - below).abs();
    (across * down).sqrt().max(1.0).log2() as usize
}

/// Returns the levels: the raw image and up to `halvings` smaller ones of at least 2 x 2 pixels.
fn pyramid(width: usize, height: usize, halvings: usize) -> Vec<Level> {
    let mut levels = vec![Level { width, height, start: 0 }];
    let mut start = 0;
    for _ in 0..halvings {
        let next = levels[levels.len() - 1].halved(start);
        if next.width.min(next.height) < 2 {
            break;
        }
        start += next.len();
        levels.push(next);
    }
    levels
}

fn tap(panorama: &Panorama, levels: &[Level], level: usize, column: usize, row: usize) -> Tap {
    let Level { width, height, .. } = levels[level];
    let raw = panorama.raw_pixel(column as f64, row as f64);
    // Pixel centres have integer coordinates on every level.
    let scale = f64::from(1u32 << level);
    let (x, across) = Level::split((raw.x + 0.5) / scale - 0.5, width);
    let (y, down) = Level::split((raw.y + 0.5) / scale - 0.5, height);
    Tap { at: (y * width + x) as u32, across, down }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point2;
    use proptest::prelude::*;
    use tagalong_core::{GreyImage, RgbImage};
    use tagalong_geometry::ConicalMirror;

    use super::*;

    fn panorama(side: usize, centre: [f64; 2], columns: usize, rows: usize) -> Panorama {
        let side = side as f64;
        let d = [67.5_f64.to_radians(), 0.05, 0.02 * side, 0.46 * side];
        let centre = [0.5 * side + centre[0], 0.5 * side + centre[1]];
        let mirror = ConicalMirror::new(0.36 * side, centre, d).unwrap();
        Panorama { mirror, columns, rows }
    }

    /// Returns the mean of the block of raw pixels that a pixel of a level stands for.
    fn block(raw: &GreyImage, level: usize, x: i64, y: i64) -> f64 {
        let side = 1i64 << level;
        let width = raw.width() as i64 / side;
        let height = raw.height() as i64 / side;
        let x = x.clamp(0, width - 1) * side;
        let y = y.clamp(0, height - 1) * side;
        let places = (0..side).flat_map(|dy| (0..side).map(move |dx| (dx, dy)));
        let sum: f64 = places.map(|(dx, dy)| f64::from(raw.get(x + dx, y + dy).unwrap())).sum();
        sum / (side * side) as f64
    }

    /// Computes one pixel of the panorama directly from the definition.
    fn slowly(raw: &GreyImage, panorama: &Panorama, column: usize, row: usize) -> f64 {
        let level = coarseness(panorama, row);
        let scale = f64::from(1u32 << level);
        let [last_x, last_y] = [raw.width(), raw.height()].map(|size| (size >> level) as f64 - 1.0);
        let place = panorama.raw_pixel(column as f64, row as f64);
        let x = ((place.x + 0.5) / scale - 0.5).clamp(0.0, last_x);
        let y = ((place.y + 0.5) / scale - 0.5).clamp(0.0, last_y);
        let cx = x.floor();
        let cy = y.floor();
        let mut sum = 0.0;
        for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let weight =
                (1.0 - (cx + f64::from(dx) - x).abs()) * (1.0 - (cy + f64::from(dy) - y).abs());
            sum += weight * block(raw, level, cx as i64 + i64::from(dx), cy as i64 + i64::from(dy));
        }
        sum
    }

    #[test]
    fn a_smooth_scene_is_what_it_is_in_every_direction() {
        fn colour(bearing: f64, elevation: f64) -> [f64; 3] {
            [
                120.0 + 90.0 * (2.0 * bearing).sin(),
                128.0 + 100.0 * elevation,
                120.0 + 90.0 * bearing.cos(),
            ]
        }

        let panorama = panorama(480, [2.3, -1.7], 480, 120);
        let raw = RgbImage::from_fn(480, 480, |x, y| {
            let from = Point2::new(x as f64, y as f64) - panorama.mirror.centre_px;
            let elevation = panorama.mirror.elevation(from.norm());
            colour(from.x.atan2(-from.y), elevation).map(|v| v.round() as u8)
        });
        let mut out = RgbImage::default();
        Unwrapper::new(&panorama, 480, 480).unwrap().apply(&raw, &mut out).unwrap();
        for (at, pixel) in out.pixels().iter().enumerate() {
            let column = (at % 480) as f64;
            let row = (at / 480) as f64;
            let expected = colour(panorama.bearing(column), panorama.elevation(row));
            // Near the centre a raw pixel covers degrees of bearing.
            let allowed = if row > 100.0 { 4.0 } else { 2.5 };
            for (seen, wanted) in pixel.iter().zip(expected) {
                assert!(
                    (f64::from(*seen) - wanted).abs() < allowed,
                    "{column} {row}: {pixel:?} {expected:?}"
                );
            }
        }
    }

    #[test]
    fn fine_stripes_at_the_rim_become_grey_instead_of_aliasing() {
        let panorama = panorama(480, [0.0, 0.0], 240, 60);
        let raw = GreyImage::from_fn(480, 480, |x, _| if x % 2 == 0 { 0 } else { 255 });
        let mut out = GreyImage::default();
        Unwrapper::new(&panorama, 480, 480).unwrap().apply(&raw, &mut out).unwrap();
        assert!(out.row(2).iter().all(|v| (120..=136).contains(v)), "{:?}", out.row(2));
    }

    #[test]
    fn wrong_sizes_are_refused() {
        let panorama = panorama(64, [0.0, 0.0], 60, 20);
        let mut unwrapper = Unwrapper::<u8>::new(&panorama, 64, 64).unwrap();
        let mut out = GreyImage::default();
        assert!(unwrapper.apply(&GreyImage::filled(63, 64, 0), &mut out).is_err());
        assert!(Unwrapper::<u8>::new(&panorama, 1, 64).is_err());
        assert!(Unwrapper::<u8>::new(&Panorama { rows: 0, ..panorama }, 64, 64).is_err());
    }

    proptest! {
        #[test]
        fn the_fast_way_agrees_with_the_definition(
            seed in 0u32..1000, side in 24usize..90, columns in 8usize..70, rows in 4usize..30,
            dx in -3.0..3.0f64, dy in -3.0..3.0f64,
        ) {
            let raw = GreyImage::from_fn(side, side, |x: usize, y: usize| {
                let mixed = (seed + 7 * x as u32 + 131 * y as u32).wrapping_mul(2_654_435_761);
                (mixed >> 24) as u8
            });
            let panorama = panorama(side, [dx, dy], columns, rows);
            let mut out = GreyImage::default();
            Unwrapper::new(&panorama, side, side).unwrap().apply(&raw, &mut out).unwrap();
            for row in 0..rows {
                for (column, fast) in out.row(row).iter().enumerate() {
                    let slow = slowly(&raw, &panorama, column, row);
                    // Half a level from each rounding, and 1/512 pixel each way.
                    prop_assert!((f64::from(*fast) - slow).abs() <= 3.0, "{fast} {slow}");
                }
            }
        }
    }
}
