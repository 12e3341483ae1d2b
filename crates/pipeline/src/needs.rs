//! What a pipeline needs of whoever makes its frames.

use std::sync::Arc;

use tagalong_core::{
    Camera, DepthImage, Distortion, Error, Frame, GreyImage, Images, Motion, Needs, Pinhole,
    RgbImage, RightImage, Stamp,
};

use crate::{Pipeline, StepError};

/// Frames shown to a pipeline, so that detectors with `every` have their turn.
const FRAMES: u64 = 8;

/// Size of the blank frames, pixels.
const SIZE: (usize, usize) = (64, 48);

/// Asks the pipelines that `build` makes which images they need.
///
/// A plugin says what it cannot do without when it is given a frame that lacks
/// it. So pipelines are shown blank frames, with one more image each time one asks
/// for it, before there is a real one: whoever makes frames can then say which
/// images are missing, and knows which frames are of no use.
///
/// # Errors
/// What `build` returns.
pub fn needs<E>(mut build: impl FnMut() -> Result<Pipeline, E>) -> Result<Needs, E> {
    let mut needs = Needs::default();
    while let Some(what) = lacking(&mut build()?, needs) {
        let before = needs;
        match what {
            "depth" => needs.depth = true,
            "right stereo" => needs.right = true,
            _ => needs.colour = true,
        }
        if needs == before {
            break;
        }
    }
    Ok(needs)
}

/// The image that the pipeline misses when it gets no more than `given`.
fn lacking(pipeline: &mut Pipeline, given: Needs) -> Option<&'static str> {
    for index in 1..=FRAMES {
        match pipeline.step(&blank(index, given)) {
            Err(StepError::Plugin { error: Error::MissingImage { what }, .. }) => {
                return Some(what);
            }
            // Anything else will show, and be told better, with real frames.
            Err(_) => return None,
            Ok(_) => {}
        }
    }
    None
}

fn blank(index: u64, given: Needs) -> Frame {
    let (width, height) = SIZE;
    let lens = Pinhole { fx: 52.0, fy: 52.0, cx: 31.5, cy: 23.5, distortion: Distortion::None };
    let camera = Arc::new(Camera::mounted(lens, width, height, 1.2, 0.0, 0.0));
    let images = Images {
        colour: given.colour.then(|| Arc::new(RgbImage::filled(width, height, [90; 3]))),
        grey: None,
        depth: given.depth.then(|| Arc::new(DepthImage::filled(width, height, f32::NAN))),
        right: given.right.then(|| {
            let image = GreyImage::filled(width, height, 90);
            Arc::new(RightImage { image, baseline_m: 0.1 })
        }),
    };
    let stamp = Stamp::from_nanos(1_000_000_000 + index * 100_000_000);
    Frame::new(index, stamp, camera, Motion::at_rest(0.1), images)
}
