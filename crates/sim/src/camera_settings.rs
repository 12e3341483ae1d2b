use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::settings;

use crate::mirror::MirrorSettings;

/// Images of the camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum CameraKind {
    /// Colour and registered depth of a structured-light camera.
    Rgbd,
    /// A rectified pair of grey images.
    Stereo,
    /// The circular colour image of a camera that looks up into a conical
    /// mirror, of which `width`, `height`, `rate_hz`, `height_m` and `mirror` hold.
    Panorama,
}

settings! {
    /// The camera on the robot. Where a scene leaves them out, width, height, field
    /// of view and baseline are those of the kind: 640x480, 58 degrees and 0.075 m
    /// of `rgbd`; 512x384, 100 degrees and 0.12 m of `stereo`.
    pub struct CameraSettings {
        /// Images that it delivers.
        pub kind: CameraKind = CameraKind::Rgbd,
        /// Without it an `rgbd` camera delivers depth only, and images are drawn
        /// several times faster.
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
        /// Looks this far down, degrees.
        pub pitch_down_deg: f64 = 0.0,
        /// Distance of the two cameras, or of camera and projector, m.
        pub baseline_m: f64 = 0.075,
        /// Nearest depth that is measured, m.
        pub min_depth_m: f64 = 0.5,
        /// Farthest depth that is measured, m.
        pub max_depth_m: f64 = 8.0,
        /// Exposure time, s.
        pub exposure_s: f64 = 0.012,
        /// From the first row to the last, s; 0 takes all rows at once. The stamp is
        /// that of the middle row, and people stand still meanwhile. Not for mirrors.
        #[schemars(range(min = 0.0, max = 0.05))]
        pub rolling_shutter_s: f64 = 0.0,
        /// The depth of an `rgbd` camera with colour is taken this much later than
        /// the colour, s; its stamp says so.
        #[schemars(range(min = 0.0, max = 0.02))]
        pub depth_offset_s: f64 = 0.0,
        /// Typical error of the mount as stated in the log, degrees and (in hundredths) metres.
        pub mount_error_deg: f64 = 0.4,
        /// The mirror of a panorama camera.
        pub mirror: MirrorSettings,
    }
}
