use tagalong_core::{Detection, Frame, Result};
use tagalong_vision::Upright;

/// Depth is known in every second row and column of the plane.
const EVERY: usize = 2;
/// Depth farther from the plane than this, m, is cut off.
const REACH_M: f32 = 1.0;
/// Depth is kept in steps of this, m.
const STEP_M: f32 = 0.01;
/// Depth that is not known.
const UNKNOWN: i8 = i8::MIN;

/// Input of the network: an upright plane through the candidate, in intensity and in depth.
#[derive(Clone, Debug, PartialEq)]
pub struct NetworkInput {
    pub(crate) grey: Vec<u8>,
    /// Distance of the surface behind the plane, in hundredths of a metre.
    pub(crate) behind: Vec<i8>,
}

impl NetworkInput {
    /// Rows and columns of the intensity ...
    pub const GREY: [usize; 2] = [Upright::ROWS, Upright::COLUMNS];
    /// ... and of the depth.
    pub const DEPTH: [usize; 2] = [Upright::ROWS / EVERY, Upright::COLUMNS / EVERY];

    /// Looks at a candidate; `None` if it is too near to be seen whole, and without the depth that
    /// is wanted. If it is not, all of it counts as not known.
    ///
    /// # Errors
    /// [`tagalong_core::Error::MissingImage`] for a frame without intensity.
    pub fn new(frame: &Frame, candidate: &Detection, with_depth: bool) -> Result<Option<Self>> {
        fn intensity(value: &f32) -> u8 {
            *value as u8
        }

        let grey = frame.grey()?;
        let depth = frame.depth().ok().filter(|_| with_depth);
        let Some(plane) = Upright::new(&frame.camera, &candidate.position) else {
            return Ok(None);
        };
        if with_depth && depth.is_none() {
            return Ok(None);
        }
        let behind = match depth {
            Some(depth) => plane
                .behind_m(depth, EVERY)
                .map(|behind_m| {
                    // A surface farther from the plane than this is not part of the person anyway.
                    behind_m
                        .map_or(UNKNOWN, |m| (m.clamp(-REACH_M, REACH_M) / STEP_M).round() as i8)
                })
                .collect(),
            None => vec![UNKNOWN; Self::DEPTH[0] * Self::DEPTH[1]],
        };
        let seen = plane.grey(grey);
        Ok(seen.map(|seen| Self { grey: seen.grey.iter().map(intensity).collect(), behind }))
    }

    /// Depth in units of the network, and 1 where it is known.
    pub(crate) fn depth(&self, cell: usize) -> [f32; 2] {
        match self.behind[cell] {
            UNKNOWN => [0.0; 2],
            steps => [f32::from(steps) * STEP_M * 3.0, 1.0],
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use tagalong_conformance::patch::{candidate, frame, picture};
    use tagalong_core::DepthImage;

    use super::*;

    #[test]
    fn without_depth_there_is_no_view() {
        let bare = frame(picture(true, 1));
        assert_eq!(NetworkInput::new(&bare, &candidate(), true).unwrap(), None);
    }

    #[test]
    fn where_depth_is_not_wanted_none_is_known() {
        let depth = DepthImage::from_fn(64, 64, |_, _| 2.0);
        let frame = frame(picture(true, 1)).with_depth(Arc::new(depth));
        let [with, without] = [true, false]
            .map(|wanted| NetworkInput::new(&frame, &candidate(), wanted).unwrap().unwrap());
        assert_eq!(with.grey, without.grey);
        assert!(without.behind.iter().all(|steps| *steps == UNKNOWN) && with != without);
    }

    #[test]
    fn depth_is_beside_the_plane_cut_off_and_known_or_not() {
        fn at(x: usize) -> f32 {
            match x {
                0..32 => 0.5,
                32..40 => 2.25,
                _ => f32::NAN,
            }
        }

        let depth = DepthImage::from_fn(64, 64, |x, _| at(x));
        let frame = frame(picture(true, 1)).with_depth(Arc::new(depth));
        let view = NetworkInput::new(&frame, &candidate(), true).unwrap().unwrap();
        // A row at the height of the camera; the plane is 27 pixels wide.
        let row = 20 * NetworkInput::DEPTH[1];
        assert_eq!([0, 8, 10, 17].map(|column| view.behind[row + column]), [-100, -100, 25, -128]);
        assert_eq!(view.depth(row + 10), [0.75, 1.0]);
        assert_eq!(view.depth(row + 17), [0.0; 2]);
    }
}
