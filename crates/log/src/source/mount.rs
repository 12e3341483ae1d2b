//! Pose of the camera on the robot.

use nalgebra::Isometry3;
use tagalong_core::Stamp;
use tagalong_geometry::{Camera, ConicalMirror, Pinhole};

use crate::scan::Scan;
use crate::tf::TfBuffer;
use crate::{InputSettings, MountSettings};

/// Source of the camera's pose.
#[derive(Clone, Debug)]
pub(super) enum Mount {
    /// Looked up in tf for each image.
    Tf { base: String, camera: String },
    /// Constant for all images.
    Fixed { pose: Isometry3<f64>, source: String },
}

/// Height of the camera that is assumed if nothing gives it and nothing depends on it, m.
const ASSUMED_HEIGHT_M: f64 = 1.2;

impl Mount {
    /// Returns the mount from the settings, or otherwise from tf; `None` with neither. A camera
    /// that looks into a mirror is assumed to be upright.
    pub(super) fn find(
        scan: &Scan,
        camera: Option<&str>,
        input: &InputSettings,
        mirror: bool,
    ) -> Option<Self> {
        let Some(mount) = input.mount() else { return Self::of_tf(scan, camera, input) };
        let source = "[input.camera] of the config".into();
        if mirror {
            return Some(Self::Fixed { pose: ConicalMirror::upright(mount.height_m), source });
        }
        Some(Self::fixed(mount, source))
    }

    /// Returns the mount of the sensor with this frame id from tf; `None` if tf does not connect it
    /// with the robot.
    pub(super) fn of_tf(scan: &Scan, frame: Option<&str>, input: &InputSettings) -> Option<Self> {
        let base = robot_frame(scan, input);
        let camera = frame.filter(|frame| scan.tf.connects(base, frame))?;
        Some(Self::Tf { base: base.to_owned(), camera: camera.to_owned() })
    }

    pub(super) fn fixed(mount: &MountSettings, source: String) -> Self {
        Self::Fixed { pose: pose_of(mount), source }
    }

    pub(super) fn assumed() -> Self {
        let mount = MountSettings { height_m: ASSUMED_HEIGHT_M, ..MountSettings::default() };
        let MountSettings { height_m, pitch_down_deg, .. } = mount;
        let source = format!(
            "an assumption (neither tf, nor [input.camera], nor depth): {height_m:?} m high, level; measure \
             it, and write `input.camera = {{ height_m = {height_m:?}, pitch_down_deg = {pitch_down_deg:?} }}` \
             into the config"
        );
        Self::fixed(&mount, source)
    }

    /// Returns the mount of a laser scanner that is not in tf.
    pub(super) fn scanner_at_origin() -> Self {
        let source = "an assumption (tf does not connect it): the scanner sits at the robot's origin, \
                      level, and looks ahead";
        Self::Fixed { pose: Isometry3::identity(), source: source.into() }
    }

    /// Returns a description of the source for users.
    pub(super) fn source(&self) -> String {
        match self {
            Self::Tf { base, camera } => format!("tf ({base} to {camera})"),
            Self::Fixed { source, .. } => source.clone(),
        }
    }

    /// Returns the pose of the camera in the robot frame at a given time, if it is known.
    pub(super) fn at(&self, tf: &TfBuffer, stamp: Stamp) -> Option<Isometry3<f64>> {
        match self {
            Self::Tf { base, camera } => tf.lookup(base, camera, stamp),
            Self::Fixed { pose, .. } => Some(*pose),
        }
    }

    /// Returns the age of the pose at a given time, s; 0 if the camera does not move on the robot.
    pub(super) fn age_s(&self, tf: &TfBuffer, stamp: Stamp) -> f64 {
        match self {
            Self::Tf { base, camera } => tf.pose_age_s(base, camera, stamp),
            Self::Fixed { .. } => 0.0,
        }
    }
}

/// Returns the robot frame on the floor: `base_footprint` if tf has it and the settings do not name
/// another frame.
pub(crate) fn robot_frame<'a>(scan: &Scan, input: &'a InputSettings) -> &'a str {
    if input.base_frame == "base_link" && scan.tf.knows("base_footprint") {
        return "base_footprint";
    }
    &input.base_frame
}

fn pose_of(mount: &MountSettings) -> Isometry3<f64> {
    let pitch = mount.pitch_down_deg.to_radians();
    let roll = mount.roll_deg.to_radians();
    // The lens does not matter, because only the pose of the camera is used.
    let any = Pinhole { fx: 1.0, fy: 1.0, cx: 0.0, cy: 0.0, distortion: Default::default() };
    Camera::mounted(any, 1, 1, mount.height_m, pitch, roll).robot_from_camera
}
