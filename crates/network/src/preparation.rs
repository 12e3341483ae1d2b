//! Conversion of an image to the input of a network, and of pixels of the input back to the image.

use nalgebra::Point2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::{Joints, RgbImage};
use tagalong_geometry::Rect;

use crate::Tensor;

/// Way in which an image fills the input of a network.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Fit {
    /// Both sides are scaled to the input, whatever the aspect ratio.
    Stretch,
    /// Scaled with its aspect ratio, with the padding on two opposite sides.
    Centre,
    /// Scaled with its aspect ratio, with padding on the right and below.
    TopLeft,
}

/// Order of the colour channels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Colours {
    /// Red, green, blue.
    Rgb,
    /// Blue, green, red, as OpenCV reads images.
    Bgr,
}

/// Preparation of images for a network: an input value is `(pixel - mean) / deviation`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Preparation {
    /// Way in which the image fills the input.
    pub fit: Fit,
    /// Value of the padding, 0 to 255.
    pub padding: f32,
    /// Order of the colour channels.
    pub colours: Colours,
    /// Mean that is subtracted from each channel, in the order of the channels, 0 to 255.
    pub mean: [f32; 3],
    /// Deviation by which each channel is divided.
    pub deviation: [f32; 3],
}

/// Size and layout of the input image of a network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InputSize {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// True if the channels of a pixel lie together (NHWC), false if each has its own plane (NCHW).
    pub channels_last: bool,
}

impl InputSize {
    /// Returns the shape of the tensor.
    pub fn shape(&self) -> Vec<usize> {
        if self.channels_last {
            vec![1, self.height, self.width, 3]
        } else {
            vec![1, 3, self.height, self.width]
        }
    }
}

/// Position of an image in the input of a network: input pixel = image pixel * scale + offset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    scale: [f64; 2],
    offset: [f64; 2],
    /// Size of the scaled image, input pixels.
    size: [usize; 2],
}

impl Placement {
    /// Computes the position of an image of `width` times `height` pixels, both above zero.
    pub fn new(fit: Fit, width: usize, height: usize, input: InputSize) -> Self {
        let room = [input.width as f64, input.height as f64];
        let image = [width as f64, height as f64];
        let each = [room[0] / image[0], room[1] / image[1]];
        let common = each[0].min(each[1]);
        let scale = if fit == Fit::Stretch { each } else { [common; 2] };
        let size = [0, 1].map(|k| ((image[k] * scale[k]).round().clamp(1.0, room[k])) as usize);
        let offset = match fit {
            Fit::Centre => [0, 1].map(|k| (0.5 * (room[k] - size[k] as f64)).floor()),
            Fit::Stretch | Fit::TopLeft => [0.0; 2],
        };
        // The size is rounded to pixels, so the scale differs slightly from that of the aspect
        // ratio.
        let scale = [0, 1].map(|k| size[k] as f64 / image[k]);
        Self { scale, offset, size }
    }

    /// Converts a pixel of the input to the image.
    pub fn to_image(&self, input: Point2<f64>) -> Point2<f64> {
        Point2::new(
            (input.x - self.offset[0]) / self.scale[0],
            (input.y - self.offset[1]) / self.scale[1],
        )
    }

    /// Converts a box in the input to the image.
    pub fn rect_to_image(&self, input: &Rect) -> Rect {
        let corner = self.to_image(Point2::new(input.x, input.y));
        Rect::new(corner.x, corner.y, input.width / self.scale[0], input.height / self.scale[1])
    }

    /// Converts joints in the input to the image.
    pub fn joints_to_image(&self, input: &Joints) -> Joints {
        input.moved(|at| self.to_image(at))
    }
}

/// Weights of two neighbours along one axis.
struct Tap {
    first: usize,
    second: usize,
    weight: f32,
}

impl Tap {
    /// Interpolates a colour between the two neighbours.
    #[inline]
    fn mix_pixels(&self, pixels: &[[u8; 3]], colour: usize) -> f32 {
        let first = f32::from(pixels[self.first][colour]);
        let second = f32::from(pixels[self.second][colour]);
        first + (second - first) * self.weight
    }
}

/// Returns for each of `to` pixels its neighbours among `from` pixels; pixel centres are at a half.
fn taps(from: usize, to: usize) -> Vec<Tap> {
    let last = from - 1;
    (0..to)
        .map(|index| {
            let at = ((index as f64 + 0.5) * from as f64 / to as f64 - 0.5).clamp(0.0, last as f64);
            let first = at as usize;
            Tap { first, second: (first + 1).min(last), weight: (at - first as f64) as f32 }
        })
        .collect()
}

impl Preparation {
    /// Prepares an image, and returns its position in the input as well; `None` for an image
    /// without pixels.
    pub fn apply(&self, image: &RgbImage, input: InputSize) -> Option<(Tensor, Placement)> {
        let width = image.width();
        let height = image.height();
        if width == 0 || height == 0 {
            return None;
        }
        let place = Placement::new(self.fit, width, height, input);
        let area = input.width * input.height;
        let order = match self.colours {
            Colours::Rgb => [0, 1, 2],
            Colours::Bgr => [2, 1, 0],
        };
        let [per_pixel, per_channel] = if input.channels_last { [3, 1] } else { [1, area] };
        let mut values = vec![0.0; 3 * area];
        for channel in 0..3 {
            let padded = self.scaled_value(channel, self.padding);
            for pixel in 0..area {
                values[pixel * per_pixel + channel * per_channel] = padded;
            }
        }
        let columns = taps(width, place.size[0]);
        let [left, top] = place.offset.map(|offset| offset as usize);
        for (row, down) in taps(height, place.size[1]).iter().enumerate() {
            let upper = image.row(down.first);
            let lower = image.row(down.second);
            let start = (top + row) * input.width + left;
            for (column, across) in columns.iter().enumerate() {
                let pixel = (start + column) * per_pixel;
                for (channel, &colour) in order.iter().enumerate() {
                    let above = across.mix_pixels(upper, colour);
                    let below = across.mix_pixels(lower, colour);
                    let value = above + (below - above) * down.weight;
                    values[pixel + channel * per_channel] = self.scaled_value(channel, value);
                }
            }
        }
        Some((Tensor::new(input.shape(), values)?, place))
    }

    /// Normalises a value of a channel as in the training of the network.
    #[inline]
    fn scaled_value(&self, channel: usize, value: f32) -> f32 {
        (value - self.mean[channel]) / self.deviation[channel]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const INPUT: InputSize = InputSize { width: 8, height: 8, channels_last: false };
    const PLAIN: Preparation = Preparation {
        fit: Fit::Centre,
        padding: 114.0,
        colours: Colours::Rgb,
        mean: [0.0; 3],
        deviation: [1.0; 3],
    };

    fn image() -> RgbImage {
        RgbImage::from_fn(16, 8, |x, y| [x as u8, y as u8, 200])
    }

    #[test]
    fn padding_is_centred_or_on_the_right_and_below() {
        fn value(fit: Fit, row: usize) -> f32 {
            let preparation = Preparation { fit, ..PLAIN };
            let (tensor, _) = preparation.apply(&image(), INPUT).unwrap();
            tensor.values()[128 + row * 8]
        }

        fn rows(fit: Fit) -> [f32; 4] {
            [0, 2, 5, 7].map(|row| value(fit, row))
        }

        assert_eq!(rows(Fit::Centre), [114.0, 200.0, 200.0, 114.0]);
        assert_eq!(rows(Fit::TopLeft), [200.0, 200.0, 114.0, 114.0]);
        assert_eq!(rows(Fit::Stretch), [200.0; 4]);
    }

    #[test]
    fn pixels_are_interpolated_between_their_centres() {
        let (tensor, _) = PLAIN.apply(&image(), INPUT).unwrap();
        // Two columns of the image, and two rows, make one of the input.
        assert_eq!(tensor.values()[2 * 8..2 * 8 + 3], [0.5, 2.5, 4.5]);
        assert_eq!(tensor.values()[64 + 2 * 8], 0.5);
    }

    #[test]
    fn channels_are_ordered_and_scaled() {
        let bgr = Preparation {
            fit: Fit::Stretch,
            colours: Colours::Bgr,
            mean: [100.0, 0.0, 0.0],
            deviation: [50.0, 1.0, 1.0],
            ..PLAIN
        };
        let (planes, _) = bgr.apply(&image(), INPUT).unwrap();
        assert_eq!((planes.values()[0], planes.values()[128]), (2.0, 0.5));
        let last = InputSize { channels_last: true, ..INPUT };
        let (pixels, _) = bgr.apply(&image(), last).unwrap();
        assert_eq!(pixels.shape(), [1, 8, 8, 3]);
        assert_eq!(pixels.values()[3..6], [2.0, 0.0, 2.5]);
    }

    #[test]
    fn boxes_return_to_the_image() {
        for fit in [Fit::Stretch, Fit::Centre, Fit::TopLeft] {
            let place = Placement::new(fit, 640, 480, InputSize { width: 320, ..INPUT });
            let u = place.scale[0] * 100.0 + place.offset[0];
            let v = place.scale[1] * 60.0;
            let rect = Rect::new(u, v + place.offset[1], 50.0 * place.scale[0], place.scale[1]);
            let back = place.rect_to_image(&rect);
            let errors = [back.x - 100.0, back.y - 60.0, back.width - 50.0, back.height - 1.0];
            assert!(errors.iter().all(|error| error.abs() < 1e-9), "{fit:?}: {back:?}");
        }
    }

    #[test]
    fn images_of_any_size_are_taken() {
        for (width, height) in [(1, 1), (1, 500), (500, 1)] {
            let image = RgbImage::filled(width, height, [9; 3]);
            assert!(PLAIN.apply(&image, INPUT).is_some(), "{width} x {height}");
        }
        assert!(PLAIN.apply(&RgbImage::default(), INPUT).is_none());
    }
}
