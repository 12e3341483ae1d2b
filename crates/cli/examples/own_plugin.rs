//! A plugin outside the workspace: the `tagalong` command with one more detector, which takes the
//! nearest object in the depth image for a person.
//!
//! ```text
//! cargo run --example own_plugin -- list
//! ```

use std::process::ExitCode;
use std::time::Duration;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::{
    Capabilities, DepthImage, Detection, Detector, Frame, Funnel, Input, Inputs, Query, Result,
};
use tagalong_geometry::{FaceDepth, ImageBox, PointEstimate, Rect};

fn main() -> ExitCode {
    tagalong_cli::main_with(|registry| {
        tagalong_catalog::register(registry);
        registry.detector(
            "nearest-thing",
            "whatever is nearest to the camera",
            |config: Config, _| Ok(NearestThing { config, frames: 0 }),
        );
    })
}

/// Settings of `nearest-thing`.
#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct Config {
    /// Depth beyond which a pixel is background, m.
    max_depth_m: f64,
    /// Panics after this many frames, to test the handling; 0 never does.
    panic_after_frames: u64,
    /// Takes at least this long for a frame, to test slow plugins, ms.
    delay_ms: u64,
}

impl Default for Config {
    fn default() -> Self {
        Self { max_depth_m: 4.0, panic_after_frames: 0, delay_ms: 0 }
    }
}

struct NearestThing {
    config: Config,
    frames: u64,
}

impl Detector for NearestThing {
    fn capabilities(&self) -> Capabilities {
        Capabilities::new(Inputs::NONE.require(Input::Depth)).discovering()
    }

    fn detect(&mut self, frame: &Frame, _: &Query<'_>, _: &mut Funnel) -> Result<Vec<Detection>> {
        self.frames += 1;
        let limit = self.config.panic_after_frames;
        assert!(limit == 0 || self.frames <= limit, "as the config asked for");
        std::thread::sleep(Duration::from_millis(self.config.delay_ms));
        let Some((bounds, depth_m)) = nearest(frame.depth()?, self.config.max_depth_m) else {
            return Ok(Vec::new());
        };
        let scale = frame.camera.focal_px() / depth_m;
        let side = 0.57 * scale;
        let left = bounds.centre().x - 0.5 * side;
        let region = Rect::new(left, bounds.y - 0.025 * scale, side, side);
        let face = FaceDepth { depth_m, sigma_m: 0.05 };
        let PointEstimate { position, covariance } = frame.camera.locate_head(&region, face, 3.0);
        Ok(vec![
            Detection::new("nearest-thing", position, covariance, 2.0)
                .with_image(ImageBox::upper_body(region)),
        ])
    }
}

/// Returns the box around everything nearer than the limit, and its mean depth.
fn nearest(depth: &DepthImage, max_depth_m: f64) -> Option<(Rect, f64)> {
    let mut left = usize::MAX;
    let mut top = usize::MAX;
    let mut right = 0;
    let mut bottom = 0;
    let mut sum = 0.0;
    let mut count = 0.0;
    for y in 0..depth.height() {
        for (x, metres) in depth.row(y).iter().enumerate() {
            if f64::from(*metres) < max_depth_m {
                (left, right) = (left.min(x), right.max(x + 1));
                (top, bottom) = (top.min(y), bottom.max(y + 1));
                sum += f64::from(*metres);
                count += 1.0;
            }
        }
    }
    let size = (right.saturating_sub(left) as f64, bottom.saturating_sub(top) as f64);
    (count > 0.0).then(|| (Rect::new(left as f64, top as f64, size.0, size.1), sum / count))
}
