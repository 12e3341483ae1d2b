//! Features of a candidate.

mod body;
mod colour;
mod gradients;
mod place;
mod shape;
mod texture;
mod window;

use std::ops::Range;

use tagalong_core::{Detection, Frame, Result};

use self::window::{Surface, Window};

/// Numbers of a candidate.
pub const COUNT: usize =
    gradients::COUNT + texture::COUNT + colour::COUNT + shape::COUNT + place::COUNT + body::COUNT;

/// Family of a feature.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
    /// Directions of intensity edges.
    Gradients,
    /// Local binary patterns and contrast.
    Texture,
    /// Colours of head and torso.
    Colour,
    /// The surface in depth.
    Shape,
    /// Where it is, and how well its silhouette fits.
    Place,
    /// Intensity edges from the floor up.
    Body,
}

impl Family {
    /// All of them, in the order of their numbers.
    pub const ALL: [Self; 6] =
        [Self::Gradients, Self::Texture, Self::Colour, Self::Shape, Self::Place, Self::Body];

    /// Its place among the numbers.
    pub fn range(self) -> Range<usize> {
        const TEXTURE: usize = gradients::COUNT;
        const COLOUR: usize = TEXTURE + texture::COUNT;
        const SHAPE: usize = COLOUR + colour::COUNT;
        const PLACE: usize = SHAPE + shape::COUNT;
        const BODY: usize = PLACE + place::COUNT;
        match self {
            Self::Gradients => 0..TEXTURE,
            Self::Texture => TEXTURE..COLOUR,
            Self::Colour => COLOUR..SHAPE,
            Self::Shape => SHAPE..PLACE,
            Self::Place => PLACE..BODY,
            Self::Body => BODY..COUNT,
        }
    }

    /// Its name on cards.
    pub fn name(self) -> &'static str {
        match self {
            Self::Gradients => "gradients",
            Self::Texture => "texture",
            Self::Colour => "colour",
            Self::Shape => "shape",
            Self::Place => "place",
            Self::Body => "body",
        }
    }
}

/// The numbers of a candidate; NaN is "not known".
#[derive(Clone, Debug, Default)]
pub struct Features(Vec<f32>);

impl Features {
    /// Looks at a candidate; the numbers of the last one are forgotten.
    ///
    /// # Errors
    /// [`tagalong_core::Error::MissingImage`] for a frame without intensity.
    /// Colour and depth may be missing.
    pub fn look(&mut self, frame: &Frame, candidate: &Detection) -> Result<()> {
        let grey = frame.grey()?;
        let region = &candidate.rect_in(&frame.camera);
        let out = &mut self.0;
        out.clear();
        let Some(window) = Window::new(grey, region) else {
            out.resize(COUNT, f32::NAN);
            return Ok(());
        };
        let surface = frame.depth().ok().and_then(|depth| Surface::new(depth, region));
        let intensity = window.grey(grey);
        gradients::push(&intensity, out);
        texture::push(&intensity, out);
        // A colour image of another size is not registered to the grey one.
        match frame.colour().ok() {
            Some(image) if same_size(image, grey) => {
                colour::push(&window.colour(image), surface.as_ref(), out);
            }
            _ => unknown(colour::COUNT, out),
        }
        match &surface {
            Some(surface) => {
                shape::push(surface, out);
                place::push(&frame.camera, candidate, out);
                body::push(&frame.camera, grey, candidate, out);
            }
            None => unknown(COUNT - Family::Shape.range().start, out),
        }
        Ok(())
    }

    /// All numbers, [`COUNT`] of them.
    pub fn values(&self) -> &[f32] {
        &self.0
    }

    /// Whether any depth was seen.
    pub fn has_depth(&self) -> bool {
        self.0.get(Family::Shape.range()).is_some_and(|shape| shape.iter().any(|v| v.is_finite()))
    }
}

fn unknown(count: usize, out: &mut Vec<f32>) {
    out.extend(std::iter::repeat_n(f32::NAN, count));
}

fn same_size(colour: &tagalong_core::RgbImage, grey: &tagalong_core::GreyImage) -> bool {
    (colour.width(), colour.height()) == (grey.width(), grey.height())
}

/// Mean and standard deviation; NaN for nothing.
fn spread(values: impl Iterator<Item = f32>) -> [f32; 2] {
    let mut count = 0.0f32;
    let mut sum = 0.0f32;
    let mut squares = 0.0f32;
    for value in values {
        count += 1.0;
        sum += value;
        squares += value * value;
    }
    let mean = sum / count;
    // Rounding may bring the variance of an even zone below 0.
    [mean, (squares / count - mean * mean).max(0.0).sqrt()]
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use tagalong_conformance::patch::{candidate, frame, picture};
    use tagalong_core::{EgoMotion, Images, RgbImage, Stamp};

    use super::*;

    #[test]
    fn the_spread_is_mean_and_standard_deviation() {
        assert_eq!(spread([1.0, 3.0, 1.0, 3.0].into_iter()), [2.0, 1.0]);
        assert!(spread(std::iter::empty())[0].is_nan());
    }

    /// A colour image is looked at where its pixels are those of the grey one.
    #[test]
    fn a_colour_image_of_another_size_is_unknown() {
        fn known(side: usize) -> bool {
            let grey = frame(picture(true, 1));
            let images = Images {
                grey: Some(Arc::new(picture(true, 1))),
                colour: Some(Arc::new(RgbImage::filled(side, side, [200, 90, 60]))),
                ..Images::default()
            };
            let still = EgoMotion::at_rest(0.1);
            let frame = Frame::new(1, Stamp::default(), Arc::clone(&grey.camera), still, images);
            let mut features = Features::default();
            features.look(&frame, &candidate()).unwrap();
            assert!(!features.has_depth());
            features.values()[Family::Colour.range()].iter().all(|v| v.is_finite())
        }

        assert!(known(64) && !known(32));
    }
}
