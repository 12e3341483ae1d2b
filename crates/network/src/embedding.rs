//! Networks that turn the image of a person into an embedding, for re-identification.

use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::RgbImage;
use tagalong_geometry::Rect;

use crate::detector::{OpenSize, start};
use crate::family::OutputShape;
use crate::network::rten;
use crate::worker::Worker;
use crate::{About, Colours, Family, Fit, IMAGENET, InputSize, Limits, Preparation};

/// Columns and rows of an input whose size the file leaves open: those of the usual data sets.
const USUAL_SIZE: [usize; 2] = [128, 256];
/// Number of values of an embedding.
const NUMBERS: std::ops::RangeInclusive<usize> = 2..=65_536;
/// Number of values by which the convention of OpenVINO's models is recognised.
const OMZ_NUMBERS: usize = 256;

/// Convention of the input of an embedding network.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Convention {
    /// OSNet and most others: red, green, blue, normalised by mean and deviation of ImageNet.
    #[serde(rename = "osnet")]
    OsNet,
    /// `person-reidentification-retail` of the Open Model Zoo: blue, green, red, 0 to 255.
    Omz,
}

impl Convention {
    /// Returns the name of the convention in settings.
    pub const fn name(self) -> &'static str {
        match self {
            Self::OsNet => "osnet",
            Self::Omz => "omz",
        }
    }

    /// Returns the preparation of images with which the networks of this convention are trained.
    pub const fn preparation(self) -> Preparation {
        let [mean, deviation] = IMAGENET;
        let fit = Fit::Stretch;
        let padding = 0.0;
        match self {
            Self::OsNet => Preparation { fit, padding, colours: Colours::Rgb, mean, deviation },
            Self::Omz => Preparation {
                fit,
                padding,
                colours: Colours::Bgr,
                mean: [0.0; 3],
                deviation: [1.0; 3],
            },
        }
    }
}

/// Network that turns images of people into embeddings: those of one person differ by a small
/// angle.
pub struct EmbeddingNetwork {
    worker: Worker,
    about: About,
    input: InputSize,
    convention: Convention,
    numbers: usize,
    limits: Limits,
}

impl About {
    /// Returns the number of values of an embedding, and the convention of networks with that
    /// number, if this is an embedding network: one output [1, n].
    ///
    /// # Errors
    /// A sentence with the reason why it is not.
    pub fn embedding(&self) -> Result<(usize, Convention), String> {
        let shapes = self.run.clone()?;
        // An embedding of six or seven values would have the shape of a list with one box.
        let is_list = self.family() == Ok(Family::YoloV10);
        if let ([output], [_], false) = (&shapes[..], &self.inputs[..], is_list)
            && let Some(numbers) = vector_of(&output.shape)
        {
            let is_omz = numbers == OMZ_NUMBERS;
            return Ok((numbers, if is_omz { Convention::Omz } else { Convention::OsNet }));
        }
        let shown: Vec<String> = shapes.iter().map(OutputShape::to_string).collect();
        Err(format!(
            "is no network for re-identification: it has {}, not one image in and one vector \
             [1, n] out",
            shown.join(", ")
        ))
    }
}

/// Returns the length of an embedding with this shape; `None` if it is not one.
fn vector_of(shape: &[usize]) -> Option<usize> {
    let numbers = match *shape {
        [1, numbers] | [1, numbers, 1, 1] => numbers,
        _ => return None,
    };
    NUMBERS.contains(&numbers).then_some(numbers)
}

impl EmbeddingNetwork {
    /// Reads a file and runs the network once. Without a `convention` it is recognised from the
    /// outputs.
    ///
    /// # Errors
    /// A file that cannot be read or is beyond the limits, and one that is not an embedding
    /// network; the message is a sentence about the file.
    pub fn load(
        path: &Path,
        convention: Option<Convention>,
        limits: &Limits,
    ) -> Result<Self, String> {
        let size = OpenSize { chosen: None, usual: USUAL_SIZE };
        let (worker, about) = start(path, size, limits, rten)?;
        let input = about.input.clone()?;
        let (numbers, usual) = about.embedding()?;
        let convention = convention.unwrap_or(usual);
        Ok(Self { worker, about, input, convention, numbers, limits: *limits })
    }

    /// Returns the description of the file.
    pub fn about(&self) -> &About {
        &self.about
    }

    /// Returns the convention of the input.
    pub fn convention(&self) -> Convention {
        self.convention
    }

    /// Returns the size and layout of the input.
    pub fn input(&self) -> InputSize {
        self.input
    }

    /// Computes the embedding of the person in a box, pixels; a part of the box outside of the
    /// image is left out. `None` if no part of the box is inside, or if the call did not finish
    /// within the deadline.
    ///
    /// # Errors
    /// A failure of the runtime, in a sentence.
    pub fn embed(&mut self, image: &RgbImage, person: &Rect) -> Result<Option<Vec<f32>>, String> {
        let part = cut(image, person);
        let Some((tensor, _)) = self.convention.preparation().apply(&part, self.input) else {
            return Ok(None);
        };
        let Some(outputs) = self.worker.run(vec![tensor], self.limits.deadline)? else {
            return Ok(None);
        };
        match &outputs[..] {
            [output] if vector_of(output.shape()) == Some(self.numbers) => {
                Ok(Some(output.values().to_vec()))
            }
            _ => Err("its outputs change their shape from call to call".into()),
        }
    }
}

/// Returns a copy of the image inside a box; it is empty if they do not overlap.
fn cut(image: &RgbImage, part: &Rect) -> RgbImage {
    // Even a box of less than a pixel gets one pixel.
    fn end(from: usize, to: f64, most: usize) -> usize {
        (to.round() as usize).clamp(from + 1, most)
    }

    let inside = part.clipped(image.width(), image.height());
    if !part.is_sane() || inside.area() <= 0.0 {
        return RgbImage::default();
    }
    let left = inside.x as usize;
    let top = inside.y as usize;
    let right = end(left, inside.x + inside.width, image.width());
    let bottom = end(top, inside.y + inside.height, image.height());
    RgbImage::from_fn(right - left, bottom - top, |x, y| image.row(top + y)[left + x])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_part_of_a_box_inside_the_image_is_cut() {
        let image = RgbImage::from_fn(10, 8, |x, y| [x as u8, y as u8, 0]);
        let part = cut(&image, &Rect::new(-3.0, 2.0, 5.0, 3.4));
        assert_eq!((part.width(), part.height()), (2, 3));
        assert_eq!([part.row(0)[0], part.row(2)[1]], [[0, 2, 0], [1, 4, 0]]);
        let corner = cut(&image, &Rect::new(9.9, 7.9, 0.05, 0.05));
        assert_eq!((corner.width(), corner.height(), corner.row(0)[0]), (1, 1, [9, 7, 0]));
        for outside in [Rect::new(20.0, 0.0, 5.0, 5.0), Rect::new(f64::NAN, 0.0, 5.0, 5.0)] {
            assert_eq!(cut(&image, &outside).width(), 0);
        }
    }

    #[test]
    fn vectors_are_told_from_other_outputs() {
        assert_eq!(vector_of(&[1, 512]), Some(512));
        assert_eq!(vector_of(&[1, 256, 1, 1]), Some(256));
        for other in [&[1, 1][..], &[2, 512], &[1, 84, 8400], &[512], &[1, 512, 2, 1]] {
            assert_eq!(vector_of(other), None, "{other:?}");
        }
    }
}
