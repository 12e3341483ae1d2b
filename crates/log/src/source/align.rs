//! Transformation of depth images to the view of the colour camera.

use std::sync::Arc;

use nalgebra::Isometry3;
use tagalong_core::DepthImage;
use tagalong_geometry::Camera;

use super::plan::Plan;
use crate::pairing::Payload;
use crate::register::Registration;
use crate::tally::Tally;
use crate::tf::TfBuffer;
use crate::topics::{Problem, geometry_problem, transform_problem};

/// A depth image together with its colour image.
pub(super) struct DepthMoment<'a> {
    pub(super) image: &'a Payload,
    pub(super) depth: &'a Payload,
    /// Camera of the colour image.
    pub(super) camera: &'a Camera,
    pub(super) tf: &'a TfBuffer,
}

impl DepthMoment<'_> {
    fn has_one_frame(&self) -> bool {
        self.image.frame_id == self.depth.frame_id
    }

    /// Returns the pose of the depth camera in the colour camera.
    fn colour_from_depth(&self) -> Option<Isometry3<f64>> {
        if self.has_one_frame() {
            return Some(Isometry3::identity());
        }
        self.tf.lookup(&self.image.frame_id, &self.depth.frame_id, self.depth.stamp)
    }
}

/// Transforms depth images to the view of the colour camera.
#[derive(Default)]
pub(super) struct DepthAligner {
    registration: Option<Registration>,
    /// True once it was reported that depth is assumed to be registered.
    is_told: bool,
}

impl DepthAligner {
    /// Returns a depth image as seen by the colour camera; `None` if that is impossible, which is
    /// counted.
    pub(super) fn align(
        &mut self,
        plan: &Plan,
        moment: &DepthMoment<'_>,
        seen: DepthImage,
        tally: &mut Tally,
    ) -> Option<Arc<DepthImage>> {
        let seen = shifted(seen, plan.input.depth_offset_px);
        let camera = moment.camera;
        let has_same_size = (seen.width(), seen.height()) == (camera.width, camera.height);
        // The driver has registered the image if size, frame and lens are the same.
        if has_same_size && moment.has_one_frame() && plan.same_lens() {
            return Some(Arc::new(seen));
        }
        if let (Some(pose), Some(from)) = (moment.colour_from_depth(), plan.depth_camera(&seen)) {
            return self.register(&from, camera, pose, &seen, tally);
        }
        let topic = plan.chosen.depth.as_deref().unwrap_or_default();
        if has_same_size {
            if !self.is_told {
                self.is_told = true;
                let Problem { why, remedy } = problem_at(plan, moment, &seen);
                tally.note(format!(
                    "{topic} is taken to be registered to colour, as its images have the same size: \
                     {why}; if it is not registered, {remedy}"
                ));
            }
            return Some(Arc::new(seen));
        }
        tally.lose("depth_not_registrable", || {
            if let Some(problem) = &plan.chosen.depth_problem {
                return format!("{topic} cannot be used: {}", problem.why);
            }
            let Problem { why, remedy } = problem_at(plan, moment, &seen);
            format!(
                "{topic} cannot be used: its images are {}x{}, those of colour {}x{}, and {why}; \
                 {remedy}",
                seen.width(),
                seen.height(),
                camera.width,
                camera.height
            )
        });
        None
    }

    fn register(
        &mut self,
        from: &Camera,
        camera: &Camera,
        colour_from_depth: Isometry3<f64>,
        seen: &DepthImage,
        tally: &mut Tally,
    ) -> Option<Arc<DepthImage>> {
        tally.remark("depth_registered", || {
            "depth is registered to the colour camera through tf and both calibrations".to_owned()
        });
        // Recomputed only if the transform has changed, because its rays are costly.
        if !self.registration.as_ref().is_some_and(|known| known.is_for(&colour_from_depth)) {
            self.registration = Some(Registration::new(from, camera, colour_from_depth));
        }
        self.registration.as_ref()?.apply(seen).map(Arc::new)
    }
}

/// Returns the reason why a depth image cannot be transformed to the view of the colour camera:
/// what the whole log lacks, or otherwise what is missing at the time of the image.
fn problem_at(plan: &Plan, moment: &DepthMoment<'_>, seen: &DepthImage) -> Problem {
    let colour = plan.primary();
    let depth = plan.chosen.depth.as_deref().unwrap_or_default();
    if let Some(problem) = geometry_problem(&plan.scan, &plan.input, colour, depth) {
        return problem;
    }
    let [to, from] = [moment.image, moment.depth].map(|payload| payload.frame_id.as_str());
    let stamp = moment.depth.stamp;
    if moment.colour_from_depth().is_some() {
        return Problem {
            why: format!(
                "its calibration is not for the {}x{} pixels of its image at {stamp}",
                seen.width(),
                seen.height()
            ),
            remedy: "record depth in one size".to_owned(),
        };
    }
    if let Some(problem) = transform_problem(&plan.scan, colour, to, from) {
        return problem;
    }
    let is_connected = plan.scan.tf.connects(to, from);
    let when =
        if is_connected { format!(" at {stamp}, but at other times") } else { String::new() };
    Problem {
        why: format!("tf has no transform from its frame `{from}` to `{to}`{when}"),
        remedy: if is_connected {
            "record /tf from before the first image to the last one"
        } else {
            "record /tf_static with the mounts of both cameras"
        }
        .to_owned(),
    }
}

/// Shifts the image by columns and rows; pixels from outside have no reading.
fn shifted(depth: DepthImage, offset: [i32; 2]) -> DepthImage {
    let [right, down] = offset.map(i64::from);
    if (right, down) == (0, 0) {
        return depth;
    }
    DepthImage::from_fn(depth.width(), depth.height(), |x, y| {
        depth.get(x as i64 - right, y as i64 - down).unwrap_or(f32::NAN)
    })
}
