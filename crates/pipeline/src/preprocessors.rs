//! Stages that complete a frame: `[stereo]` and `[odometry]`.

use nalgebra::Point2;
use tagalong_core::{EgoMotion, Frame, Funnel, Result};
use tagalong_odometry::VisualOdometry;
use tagalong_stereo::StereoDepth;
use tagalong_tracking::Guarded;
use tagalong_tracking::{Preprocessed, Preprocessor};

/// Depth from the stereo pair, for frames that have none.
struct DepthOfPair(StereoDepth);

impl Preprocessor for DepthOfPair {
    fn process(
        &mut self,
        frame: &Frame,
        motion: Option<EgoMotion>,
        _: &[Point2<f64>],
        funnel: &mut Funnel,
    ) -> Result<Preprocessed> {
        if frame.depth().is_ok() {
            return Ok(Preprocessed { frame: None, motion });
        }
        let depth = self.0.depth(frame, funnel)?;
        Ok(Preprocessed { frame: Some(frame.with_depth(depth)), motion })
    }
}

/// Robot motion, corrected by static structure in the images.
struct MotionOfImages(VisualOdometry);

impl Preprocessor for MotionOfImages {
    fn process(
        &mut self,
        frame: &Frame,
        motion: Option<EgoMotion>,
        people: &[Point2<f64>],
        funnel: &mut Funnel,
    ) -> Result<Preprocessed> {
        let motion = self.0.see(frame, motion, people, funnel);
        Ok(Preprocessed { frame: None, motion })
    }
}

/// Returns the stages that a config asks for, in the order in which they work.
pub(crate) fn preprocessors(
    stereo: Option<StereoDepth>,
    odometry: Option<VisualOdometry>,
) -> Vec<Guarded<dyn Preprocessor>> {
    // Stereo goes first, because odometry needs depth.
    let mut stages: Vec<Guarded<dyn Preprocessor>> = Vec::new();
    stages.extend(
        stereo.map(|s| Guarded::<dyn Preprocessor>::new("stereo", Box::new(DepthOfPair(s)))),
    );
    stages.extend(
        odometry.map(|o| Guarded::<dyn Preprocessor>::new("odometry", Box::new(MotionOfImages(o)))),
    );
    stages
}
