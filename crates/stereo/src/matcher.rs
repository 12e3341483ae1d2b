use tagalong_core::{Error, GreyImage, Result};

use crate::paths::Penalties;
use crate::refine::Refiner;
use crate::settings::MAX_DISPARITIES;
use crate::share::{band_rows, share};
use crate::speckle::SpeckleFilter;
use crate::strip::{Output, Pair, Strip};
use crate::texture::TextureTest;
use crate::{Dropped, Method, StereoSettings, fill};

/// Number of rows of a strip in semi-global matching, whose paths start above each strip. It does
/// not depend on the number of threads, so that the disparities do not, either.
const STRIP_ROWS: usize = 192;

/// Matcher of rectified pairs; keeps its buffers between calls.
#[derive(Debug)]
pub struct Matcher {
    settings: StereoSettings,
    penalties: Penalties,
    strips: Vec<Strip>,
    speckles: SpeckleFilter,
    refiner: Refiner,
    texture: TextureTest,
    disparities: Vec<f32>,
    confidences: Vec<u8>,
}

/// Disparities of the left image of a pair, row by row.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Disparities<'a> {
    /// Number of columns.
    pub width: usize,
    /// Shift of each pixel to the left in the right image, px; NaN = unknown.
    pub values: &'a [f32],
    /// Confidence of each disparity, 0 to 255: the relative difference between the second best cost
    /// and the best.
    pub confidences: &'a [u8],
    /// Number of pixels without a disparity, by reason.
    pub dropped: Dropped,
}

impl Matcher {
    /// Creates a matcher. It ignores the settings in metres and the width, which
    /// [`crate::StereoDepth`] uses.
    ///
    /// # Errors
    /// As [`StereoSettings::check`].
    pub fn new(settings: StereoSettings) -> Result<Self> {
        settings.check()?;
        Ok(Self {
            penalties: penalties(&settings),
            settings,
            strips: Vec::new(),
            speckles: SpeckleFilter::default(),
            refiner: Refiner::default(),
            texture: TextureTest::default(),
            disparities: Vec::new(),
            confidences: Vec::new(),
        })
    }

    /// Computes the disparities from 0 to at least `max_disparity` px. The range is rounded up to
    /// the next power of two, 16 at least, at no cost.
    ///
    /// # Errors
    /// [`Error::Settings`] if `max_disparity` is above 255; [`Error::Other`] if the images differ
    /// in size.
    pub fn disparities(
        &mut self,
        left: &GreyImage,
        right: &GreyImage,
        max_disparity: usize,
    ) -> Result<Disparities<'_>> {
        let width = left.width();
        let height = left.height();
        if let Some(error) = size_error(left, right) {
            return Err(error);
        }
        self.disparities.resize(width * height, f32::NAN);
        self.confidences.resize(width * height, 0);
        if width * height > 0 {
            self.fill(left, right, max_disparity)?;
        }
        let holes = self.holes();
        let threads = self.threads();
        let settings = &self.settings;
        let pixels = settings.speckle_pixels;
        let step = settings.speckle_step as f32;
        let mut dropped = Dropped::default();
        self.strips.iter().for_each(|strip| dropped.add(&strip.dropped));
        // Refined before the filters, which compare disparities to fractions of a pixel.
        if settings.refine_px > 0 && width * height > 0 {
            let radius = settings.refine_px;
            self.refiner.apply([left, right], radius, threads, &mut self.disparities);
        }
        dropped.unsupported =
            self.texture.apply(left, settings.texture, threads, &mut self.disparities);
        dropped.speckle = self.speckles.apply(&mut self.disparities, width, pixels, step);
        dropped.filled = fill::holes(&mut self.disparities, width, &holes);
        for (d, confidence) in self.disparities.iter().zip(&mut self.confidences) {
            *confidence = if d.is_nan() { 0 } else { *confidence };
        }
        let values = self.disparities.as_slice();
        let confidences = self.confidences.as_slice();
        Ok(Disparities { width, values, confidences, dropped })
    }

    fn threads(&self) -> usize {
        match self.settings.threads {
            0 => std::thread::available_parallelism().map_or(1, usize::from),
            n => n,
        }
    }

    fn holes(&self) -> fill::Most {
        let StereoSettings { fill_px, fill_baselines, speckle_step, .. } = self.settings;
        fill::Most { px: fill_px, baselines: fill_baselines as f32, step: speckle_step as f32 }
    }

    fn fill(&mut self, left: &GreyImage, right: &GreyImage, max_disparity: usize) -> Result<()> {
        // One instance per power of two, because loops of fixed length are vectorised.
        let run = match max_disparity {
            0..16 => Self::run::<16>,
            16..32 => Self::run::<32>,
            32..64 => Self::run::<64>,
            64..128 => Self::run::<128>,
            128..MAX_DISPARITIES => Self::run::<MAX_DISPARITIES>,
            _ => {
                let message = format!(
                    "disparities up to {max_disparity} px are more than the {} that are looked \
                     for: reduce the width or raise the least depth",
                    MAX_DISPARITIES - 1
                );
                return Err(Error::Other(message));
            }
        };
        run(self, left, right);
        Ok(())
    }

    fn run<const D: usize>(&mut self, left: &GreyImage, right: &GreyImage) {
        let threads = self.threads();
        let rows = match self.settings.method {
            Method::Block => band_rows(left.height(), threads),
            Method::SemiGlobal => STRIP_ROWS,
        };
        let cells = rows * left.width();
        let count = left.pixels().len().div_ceil(cells);
        self.strips.resize_with(count, Strip::default);
        let pair = Pair { left, right, settings: &self.settings, penalties: &self.penalties };
        let outputs = self.disparities.chunks_mut(cells).zip(self.confidences.chunks_mut(cells));
        let mut jobs: Vec<(&mut Strip, Output<'_>)> = self
            .strips
            .iter_mut()
            .zip(outputs.enumerate())
            .map(|(strip, (i, (disparities, confidences)))| {
                (strip, Output { first_row: i * rows, disparities, confidences })
            })
            .collect();
        let each = count.div_ceil(threads.min(count));
        share(jobs.chunks_mut(each), |jobs| {
            jobs.iter_mut().for_each(|(strip, output)| strip.fill::<D>(&pair, output));
        });
    }
}

/// Returns an error if the images differ in size.
pub(crate) fn size_error(left: &GreyImage, right: &GreyImage) -> Option<Error> {
    let [l, r] = [left, right].map(|image| (image.width(), image.height()));
    (l != r).then(|| {
        let message = format!(
            "the left image has {}x{} pixels, the right one {}x{}: a rectified stereo pair has one size",
            l.0, l.1, r.0, r.1
        );
        Error::Other(message)
    })
}

/// Computes the penalties. The large one decreases with the difference in brightness, because a
/// jump of the disparity is likely at an edge of the image (equation 14 of the paper).
fn penalties(settings: &StereoSettings) -> Penalties {
    let StereoSettings { small_penalty, large_penalty, edge_penalty, .. } = *settings;
    Penalties {
        small: small_penalty,
        large: std::array::from_fn(|difference| {
            let lower = f64::from(large_penalty) * 8.0 / (difference.max(8) as f64);
            (lower as u8).max(edge_penalty)
        }),
    }
}
