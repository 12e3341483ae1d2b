use nalgebra::Point2;
use tagalong_core::RgbImage;

/// Which colour the hat has: hue, and how far from it a pixel may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HatColour {
    /// Hue, degrees: 0 red, 120 green, 240 blue.
    pub hue_deg: f64,
    /// Largest difference of the hue, degrees.
    pub hue_within_deg: f64,
    /// Least saturation, 0 to 1.
    pub min_saturation: f64,
    /// Least value, 0 to 1.
    pub min_value: f64,
    /// Fewest pixels.
    pub min_pixels: u32,
}

impl Default for HatColour {
    /// A green that leaves of plants do not have: they are darker and less pure.
    fn default() -> Self {
        Self {
            hue_deg: 120.0,
            hue_within_deg: 30.0,
            min_saturation: 0.6,
            min_value: 0.1,
            min_pixels: 6,
        }
    }
}

impl HatColour {
    /// True if a pixel has the colour.
    pub fn is(&self, pixel: [u8; 3]) -> bool {
        let [r, g, b] = pixel.map(|c| f64::from(c) / 255.0);
        let most = r.max(g).max(b);
        let least = r.min(g).min(b);
        let spread = most - least;
        if most < self.min_value || spread < self.min_saturation * most || spread == 0.0 {
            return false;
        }
        let sixth = if most == r {
            (g - b) / spread
        } else if most == g {
            2.0 + (b - r) / spread
        } else {
            4.0 + (r - g) / spread
        };
        let off = (60.0 * sixth - self.hue_deg + 180.0).rem_euclid(360.0) - 180.0;
        off.abs() <= self.hue_within_deg
    }
}

/// A hat in an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hat {
    /// Its centre, pixels.
    pub centre: Point2<f64>,
    /// Pixels that have its colour.
    pub pixels: u32,
    /// It touches the edge of the image, so its centre is not known.
    pub cut: bool,
}

/// The largest connected patch of the hat's colour, if it is large enough.
pub fn find_hat(image: &RgbImage, colour: &HatColour) -> Option<Hat> {
    let width = image.width();
    let height = image.height();
    let mut open: Vec<bool> = image.pixels().iter().map(|pixel| colour.is(*pixel)).collect();
    let mut best: Option<Hat> = None;
    for start in 0..open.len() {
        if open[start] {
            let hat = patch(start, &mut open, (width, height));
            if best.is_none_or(|best| hat.pixels > best.pixels) {
                best = Some(hat);
            }
        }
    }
    best.filter(|hat| hat.pixels >= colour.min_pixels)
}

/// The patch around a pixel, which is taken out.
fn patch(start: usize, open: &mut [bool], (width, height): (usize, usize)) -> Hat {
    let mut waiting = vec![start];
    let mut sum = [0.0; 2];
    let mut pixels = 0;
    let mut cut = false;
    open[start] = false;
    while let Some(at) = waiting.pop() {
        let x = at % width;
        let y = at / width;
        (sum[0], sum[1], pixels) = (sum[0] + x as f64, sum[1] + y as f64, pixels + 1);
        cut |= x == 0 || y == 0 || x + 1 == width || y + 1 == height;
        let rows = y.saturating_sub(1)..(y + 2).min(height);
        for row in rows {
            for column in x.saturating_sub(1)..(x + 2).min(width) {
                let next = row * width + column;
                if std::mem::take(&mut open[next]) {
                    waiting.push(next);
                }
            }
        }
    }
    let count = f64::from(pixels);
    Hat { centre: Point2::new(sum[0] / count, sum[1] / count), pixels, cut }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GREEN: [u8; 3] = [20, 160, 40];
    const LEAF: [u8; 3] = [80, 129, 69];

    fn image(hats: &[(usize, usize, usize)]) -> RgbImage {
        RgbImage::from_fn(60, 40, |x, y| {
            let on = hats.iter().any(|(left, top, side)| {
                (*left..left + side).contains(&x) && (*top..top + side).contains(&y)
            });
            if on { GREEN } else { [120, 110, 100] }
        })
    }

    #[test]
    fn the_largest_patch_is_the_hat() {
        let hat = find_hat(&image(&[(5, 5, 3), (30, 20, 6)]), &HatColour::default()).unwrap();
        assert_eq!((hat.centre, hat.pixels, hat.cut), (Point2::new(32.5, 22.5), 36, false));
    }

    #[test]
    fn what_is_cut_off_says_so_and_small_things_are_no_hat() {
        assert!(find_hat(&image(&[(0, 10, 5)]), &HatColour::default()).unwrap().cut);
        assert_eq!(find_hat(&image(&[(9, 9, 2)]), &HatColour::default()), None);
        assert_eq!(find_hat(&RgbImage::default(), &HatColour::default()), None);
    }

    #[test]
    fn other_colours_are_not_green() {
        let green = HatColour::default();
        assert!(green.is(GREEN) && green.is([60, 200, 60]));
        for other in [[160, 20, 40], [20, 40, 160], [120, 120, 120], [0, 0, 0], LEAF] {
            assert!(!green.is(other), "{other:?}");
        }
    }
}
