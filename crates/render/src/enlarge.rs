use tagalong_core::RgbImage;

/// Least number of columns of an image in a picture: smaller images are enlarged.
const LEAST_COLUMNS: usize = 640;

/// Largest factor of the enlargement.
const MOST: usize = 16;

/// Returns the integer factor by which an image with some number of columns is enlarged.
pub fn factor(columns: usize) -> usize {
    LEAST_COLUMNS.div_ceil(columns.max(1)).clamp(1, MOST)
}

/// Enlarges an image by an integer factor, with linear interpolation.
pub fn enlarge(image: &RgbImage, by: usize) -> RgbImage {
    if by <= 1 || image.width() == 0 || image.height() == 0 {
        return image.clone();
    }
    let columns: Vec<Tap> = (0..by * image.width()).map(|x| tap(x, by, image.width())).collect();
    RgbImage::from_fn(by * image.width(), by * image.height(), |x, y| {
        let across = columns[x];
        let down = tap(y, by, image.height());
        let upper = image.row(down.first);
        let lower = image.row(down.second);
        std::array::from_fn(|c| {
            let upper = across.mix(upper[across.first][c], upper[across.second][c]);
            let lower = across.mix(lower[across.first][c], lower[across.second][c]);
            let sum = upper * (2 * by - down.share) + lower * down.share;
            // Rounded; `share` counts in parts of twice the factor.
            ((sum + 2 * by * by) / (4 * by * by)) as u8
        })
    })
}

/// Two source pixels of a target pixel, and the share of the second one of `whole`.
#[derive(Clone, Copy)]
struct Tap {
    first: usize,
    second: usize,
    share: usize,
    whole: usize,
}

impl Tap {
    fn mix(self, first: u8, second: u8) -> usize {
        usize::from(first) * (self.whole - self.share) + usize::from(second) * self.share
    }
}

/// Returns the source of a target pixel: pixel centres correspond, and borders are repeated.
fn tap(target: usize, by: usize, length: usize) -> Tap {
    // The centre of the target in parts of 2 * by of a source pixel, moved by one pixel so that it
    // is never negative.
    let whole = 2 * by;
    let at = 2 * target + 1 + by;
    let first = (at / whole).saturating_sub(1);
    let second = (at / whole).min(length - 1);
    Tap { first: first.min(length - 1), second, share: at % whole, whole }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_images_get_at_least_640_columns_by_a_whole_number() {
        assert_eq!([160, 320, 400, 639, 640, 1440].map(factor), [4, 2, 2, 2, 1, 1]);
        assert_eq!(factor(0), MOST);
    }

    #[test]
    fn a_ramp_stays_a_ramp() {
        let ramp = RgbImage::from_fn(4, 2, |x, y| [(40 * x) as u8, (100 * y) as u8, 7]);
        let large = enlarge(&ramp, 4);
        assert_eq!((large.width(), large.height()), (16, 8));
        let reds: Vec<u8> = large.row(0).iter().map(|pixel| pixel[0]).collect();
        assert_eq!(reds, [0, 0, 5, 15, 25, 35, 45, 55, 65, 75, 85, 95, 105, 115, 120, 120]);
        let greens: Vec<u8> = (0..8).map(|y| large.row(y)[3][1]).collect();
        assert_eq!(greens, [0, 0, 13, 38, 63, 88, 100, 100]);
        assert!(large.pixels().iter().all(|pixel| pixel[2] == 7));
    }
}
