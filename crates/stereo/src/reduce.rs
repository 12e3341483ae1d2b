//! Downscaling of images by the mean over the area of each new pixel.

use tagalong_core::GreyImage;

/// Downscales images to one size; keeps its buffers between calls.
#[derive(Debug, Default)]
pub struct Reducer {
    row: Vec<f32>,
    reduced: GreyImage,
}

impl Reducer {
    /// Reduces the image to `width` x `height` pixels, neither of them greater than its own.
    pub fn reduce(&mut self, image: &GreyImage, width: usize, height: usize) -> &GreyImage {
        if (self.reduced.width(), self.reduced.height()) != (width, height) {
            self.reduced = GreyImage::filled(width, height, 0);
        }
        let rows = self.reduced.pixels_mut().chunks_exact_mut(width.max(1));
        for (y, reduced) in rows.enumerate() {
            self.row.clear();
            self.row.resize(image.width(), 0.0);
            for (row, share) in shares(y, height, image.height()) {
                for (sum, pixel) in self.row.iter_mut().zip(image.row(row)) {
                    *sum += share * f32::from(*pixel);
                }
            }
            for (x, pixel) in reduced.iter_mut().enumerate() {
                let parts = shares(x, width, image.width());
                *pixel = parts.map(|(i, share)| share * self.row[i]).sum::<f32>().round() as u8;
            }
        }
        &self.reduced
    }
}

/// Yields the source cells, of `from` in all, that the target cell `at` of `to` covers, each with
/// its share.
fn shares(at: usize, to: usize, from: usize) -> impl Iterator<Item = (usize, f32)> {
    let size = from as f32 / to as f32;
    let begin = at as f32 * size;
    let end = (at + 1) as f32 * size;
    let last = (end.ceil() as usize).min(from);
    (begin as usize..last).map(move |cell| {
        let covered = end.min((cell + 1) as f32) - begin.max(cell as f32);
        (cell, covered.max(0.0) / size)
    })
}
