//! Stages that complete a frame: `[stereo]` and `[odometry]`.

use nalgebra::Point2;
use std::sync::Arc;

use tagalong_core::{EgoMotion, Estimate, Frame, Funnel, Input, Inputs, Result};
use tagalong_stereo::StereoDepth;
use tagalong_tracking::Guarded;
use tagalong_tracking::{Preprocessed, Preprocessor};
use tagalong_vision::odometry::{CameraMotion, MotionSource, OdometrySettings, VisualOdometry};

/// Depth from the stereo pair, for frames that have none.
struct DepthOfPair(StereoDepth);

impl Preprocessor for DepthOfPair {
    fn process(
        &mut self,
        frame: &Frame,
        motion: Option<EgoMotion>,
        _: &[Estimate],
        funnel: &mut Funnel,
    ) -> Result<Preprocessed> {
        if frame.depth().is_ok() {
            return Ok(Preprocessed { frame: None, motion });
        }
        let depth = self.0.depth(frame, funnel)?;
        Ok(Preprocessed { frame: Some(frame.with_depth(depth)), motion })
    }

    fn lacks(&self, frame: &Frame) -> Option<Input> {
        if frame.holds(Input::Depth) {
            return None;
        }
        [Input::Right, Input::Colour].into_iter().find(|input| !frame.holds(*input))
    }

    fn adds(&self) -> Inputs {
        Inputs::NONE.accept(Input::Depth)
    }
}

/// Robot motion, corrected by static structure in the images.
struct MotionOfImages(VisualOdometry);

impl Preprocessor for MotionOfImages {
    fn process(
        &mut self,
        frame: &Frame,
        motion: Option<EgoMotion>,
        people: &[Estimate],
        funnel: &mut Funnel,
    ) -> Result<Preprocessed> {
        let people: Vec<Point2<f64>> =
            people.iter().map(|person| person.person.position.xy()).collect();
        let motion = self.0.see(frame, motion, &people, funnel);
        Ok(Preprocessed { frame: None, motion })
    }
}

/// Motion of the camera by the images alone.
struct MotionOfCorners(CameraMotion);

impl Preprocessor for MotionOfCorners {
    fn process(
        &mut self,
        frame: &Frame,
        motion: Option<EgoMotion>,
        people: &[Estimate],
        funnel: &mut Funnel,
    ) -> Result<Preprocessed> {
        let moved = self.0.see(frame, motion, people, funnel);
        let frame = moved.camera.map(|camera| frame.with_camera(Arc::new(camera)));
        Ok(Preprocessed { frame, motion: moved.motion })
    }
}

/// Returns the stage of `[odometry]`.
fn odometry_stage(settings: OdometrySettings) -> Box<dyn Preprocessor> {
    match settings.source {
        MotionSource::Depth => Box::new(MotionOfImages(VisualOdometry::new(settings))),
        MotionSource::Image => Box::new(MotionOfCorners(CameraMotion::new(settings))),
    }
}

/// Returns the stages that a config asks for, in the order in which they work.
pub(crate) fn preprocessors(
    stereo: Option<StereoDepth>,
    odometry: Option<OdometrySettings>,
) -> Vec<Guarded<dyn Preprocessor>> {
    // Stereo goes first, because odometry needs depth.
    let mut stages: Vec<Guarded<dyn Preprocessor>> = Vec::new();
    stages.extend(
        stereo.map(|s| Guarded::<dyn Preprocessor>::new("stereo", Box::new(DepthOfPair(s)))),
    );
    stages
        .extend(odometry.map(|o| Guarded::<dyn Preprocessor>::new("odometry", odometry_stage(o))));
    stages
}
