//! Images of the log as small JPEGs, with a limit on their total size.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use tagalong_core::RgbImage;
use tagalong_math::counted;
use tagalong_render::jpeg;

/// Widths and qualities of JPEG, best first.
const LEVELS: [(usize, u8); 5] = [(640, 72), (480, 65), (400, 55), (320, 50), (240, 40)];

/// Encoder that keeps the total size of its images below a limit.
pub struct Pictures {
    images: Vec<String>,
    /// Average limit of one image, bytes of base64.
    share: usize,
    left: usize,
    level: usize,
    left_out: usize,
    width: usize,
}

impl Pictures {
    /// Creates an encoder for `frames` images with at most `bytes` of base64 in total.
    pub fn within(bytes: usize, frames: usize) -> Self {
        let share = bytes / frames.max(1);
        let images = vec![String::new(); frames];
        Self { images, share, left: bytes, level: 0, left_out: 0, width: 0 }
    }

    /// Adds the image of a frame, with the best quality that the limit allows.
    pub fn add(&mut self, at: usize, image: &RgbImage) {
        let mut text = encode(image, LEVELS[self.level]);
        // The level is lowered for all later images, so that consecutive images look alike.
        while text.len() > self.share && self.level + 1 < LEVELS.len() {
            self.level += 1;
            text = encode(image, LEVELS[self.level]);
        }
        if text.len() > self.left {
            self.left_out += 1;
            return;
        }
        self.left -= text.len();
        self.width = LEVELS[self.level].0.min(image.width());
        if let Some(place) = self.images.get_mut(at) {
            *place = text;
        }
    }

    /// Describes the images in a sentence; `None` if there are none.
    pub fn summary(&self) -> Option<String> {
        let count = self.images.iter().filter(|text| !text.is_empty()).count();
        let bytes: usize = self.images.iter().map(String::len).sum();
        let width = self.width;
        let images = counted(count, "image");
        let whole = format!("{images}, {width} px wide, {:.1} MB", bytes as f64 / 1e6);
        match (count, self.left_out) {
            (0, _) => None,
            (_, 0) => Some(whole),
            (_, more) => {
                let more = counted(more, "image");
                Some(format!("{whole}; {more} more than --max-mb allows left out"))
            }
        }
    }

    /// Returns the images in base64; `None` if there are none.
    pub fn into_images(self) -> Option<Vec<String>> {
        self.images.iter().any(|text| !text.is_empty()).then_some(self.images)
    }
}

/// Encodes an image, reduced to a width, as JPEG in base64; empty for an image without pixels.
fn encode(image: &RgbImage, (width, quality): (usize, u8)) -> String {
    STANDARD.encode(jpeg(image, width, quality))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noisy() -> RgbImage {
        RgbImage::from_fn(800, 600, |x, y| [((x * 37) ^ (y * 91)) as u8, (x * y) as u8, y as u8])
    }

    #[test]
    fn images_become_smaller_until_they_fit() {
        fn total(images: &[String]) -> usize {
            images.iter().map(String::len).sum::<usize>()
        }

        let mut roomy = Pictures::within(40_000_000, 4);
        let mut tight = Pictures::within(200_000, 4);
        for at in 0..4 {
            roomy.add(at, &noisy());
            tight.add(at, &noisy());
        }
        assert!(roomy.summary().unwrap().contains("640 px"), "{:?}", roomy.summary());
        assert!(!tight.summary().unwrap().contains("640 px"), "{:?}", tight.summary());
        let roomy = roomy.into_images().unwrap();
        let tight = tight.into_images().unwrap();
        assert!(total(&tight) <= 200_000 && total(&tight) < total(&roomy));
    }

    #[test]
    fn what_is_left_out_is_said() {
        let mut pictures = Pictures::within(60_000, 40);
        (0..40).for_each(|at| pictures.add(at, &noisy()));
        let said = pictures.summary().unwrap();
        assert!(said.contains("left out"), "{said}");
        let images = pictures.into_images().unwrap();
        assert!(images.iter().map(String::len).sum::<usize>() <= 60_000);
    }

    #[test]
    fn an_image_is_a_jpeg_with_its_colours() {
        let red = RgbImage::filled(700, 20, [200, 10, 10]);
        let mut pictures = Pictures::within(1_000_000, 1);
        pictures.add(0, &red);
        let bytes = STANDARD.decode(&pictures.into_images().unwrap()[0]).unwrap();
        let read = image::load_from_memory(&bytes).unwrap().to_rgb8();
        assert_eq!((read.width(), read.height()), (640, 18));
        let pixel = read.get_pixel(300, 9).0;
        assert!(pixel[0] > 180 && pixel[1] < 40, "{pixel:?}");
        assert_eq!(Pictures::within(1000, 3).into_images(), None);
    }
}
