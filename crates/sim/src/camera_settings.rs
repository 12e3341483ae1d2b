use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::settings;

use crate::mirror::MirrorSettings;

/// Kind of camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum CameraKind {
    /// Colour and registered depth of a structured-light camera.
    Rgbd,
    /// A rectified pair of grey images.
    Stereo,
    /// The circular colour image of a camera that looks up into a conical mirror, for which
    /// `width`, `height`, `rate_hz`, `height_m` and `mirror` apply.
    Panorama,
}

settings! {
    /// The camera on the robot. If a scene leaves them out, width, height, field of view and
    /// baseline are those of the kind: 640x480, 58 degrees and 0.075 m for `rgbd`; 512x384, 100
    /// degrees and 0.12 m for `stereo`.
    pub struct CameraSettings {
        /// Kind of images that it delivers.
        pub kind: CameraKind = CameraKind::Rgbd,
        /// If false, an `rgbd` camera delivers depth only, and images are rendered several times
        /// faster.
        pub colour: bool = true,
        /// Columns.
        #[schemars(range(min = 8, max = 4096))]
        pub width: usize = 640,
        /// Rows.
        #[schemars(range(min = 8, max = 4096))]
        pub height: usize = 480,
        /// Horizontal field of view, degrees.
        #[schemars(range(min = 10.0, max = 150.0))]
        pub field_of_view_deg: f64 = 58.0,
        /// Images per second.
        #[schemars(range(min = 0.1, max = 100.0))]
        pub rate_hz: f64 = 10.0,
        /// Height above the floor, m.
        pub height_m: f64 = 1.2,
        /// Pitch of the camera, degrees downwards.
        pub pitch_down_deg: f64 = 0.0,
        /// Distance between the two cameras, or between camera and projector, m.
        pub baseline_m: f64 = 0.075,
        /// Minimum depth that is measured, m.
        pub min_depth_m: f64 = 0.5,
        /// Maximum depth that is measured, m.
        pub max_depth_m: f64 = 8.0,
        /// Exposure time, s.
        pub exposure_s: f64 = 0.012,
        /// Time from the first row to the last, s; 0 exposes all rows at once. The stamp is that of
        /// the middle row, and people do not move during an image. Not for mirrors.
        #[schemars(range(min = 0.0, max = 0.05))]
        pub rolling_shutter_s: f64 = 0.0,
        /// Delay of the depth image behind the colour image of an `rgbd` camera, s, included in its
        /// stamp.
        #[schemars(range(min = 0.0, max = 0.02))]
        pub depth_offset_s: f64 = 0.0,
        /// Typical error of the mount in the log, in degrees and in hundredths of a metre.
        pub mount_error_deg: f64 = 0.4,
        /// The mirror of a panorama camera.
        pub mirror: MirrorSettings,
    }
}
