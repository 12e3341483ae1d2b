//! Further obstacle sources: topics other than those from which the frames are made.
//!
//! A reader keeps the newest readings of its topic. Each frame gets the newest one, transformed to
//! the pose of the robot at the time of the frame. A source that falls silent keeps its last
//! reading, whose age increases.

mod bumper;
mod plan;
mod reader;
mod timed;

use nalgebra::{Isometry3, Translation3, UnitQuaternion};

pub(crate) use self::plan::{PlannedSource, planned_sources};
pub(crate) use self::reader::{DepthFormat, ObstacleReader};

/// Topic of a further obstacle source: a `[[collision_monitor.sources]]` section of a config.
#[derive(Clone, Debug, PartialEq)]
pub struct ObstacleTopic {
    /// Name of the source.
    pub name: String,
    /// Kind of the sensor.
    pub kind: ObstacleKind,
    /// Topic of its messages.
    pub topic: String,
    /// Topic of the calibration of a depth camera; `None` to find it beside `topic`.
    pub info_topic: Option<String>,
    /// Pose of the sensor in the robot frame: x, y, z in m, roll, pitch, yaw in degrees. The sensor
    /// looks along its x axis, even if it is a camera. `None` to take the pose from tf.
    pub mount: Option<[f64; 6]>,
}

/// Kind of an obstacle source.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ObstacleKind {
    /// `sensor_msgs/LaserScan`.
    Scan,
    /// Depth as `sensor_msgs/Image` or `CompressedImage`.
    Depth,
    /// `sensor_msgs/Range`.
    Range,
    /// A contact message: `std_msgs/Bool`, or one of those of common bases or simulators.
    Bumper,
}

impl ObstacleTopic {
    /// Creates a source whose pose comes from tf.
    pub fn new(name: &str, kind: ObstacleKind, topic: &str) -> Self {
        Self { name: name.to_owned(), kind, topic: topic.to_owned(), info_topic: None, mount: None }
    }

    /// Returns the pose of the sensor in the robot frame, if the settings give it.
    fn robot_from_sensor(&self) -> Option<Isometry3<f64>> {
        let [x, y, z, roll, pitch, yaw] = self.mount?;
        let [roll, pitch, yaw] = [roll, pitch, yaw].map(f64::to_radians);
        let turn = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
        let pose = Isometry3::from_parts(Translation3::new(x, y, z), turn);
        Some(match self.kind {
            ObstacleKind::Depth => pose * level_camera(),
            ObstacleKind::Scan | ObstacleKind::Range | ObstacleKind::Bumper => pose,
        })
    }
}

/// Returns the pose of a camera that looks along the x axis: the camera's own axes are right, down
/// and forward.
fn level_camera() -> Isometry3<f64> {
    let quarter = std::f64::consts::FRAC_PI_2;
    let turn = UnitQuaternion::from_euler_angles(-quarter, 0.0, -quarter);
    Isometry3::from_parts(Translation3::identity(), turn)
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, Vector3};

    use super::*;

    #[test]
    fn a_mount_looks_along_its_x_axis_with_any_kind() {
        let mount = Some([-0.2, 0.1, 0.3, 0.0, 0.0, 180.0]);
        let [range, camera] = [ObstacleKind::Range, ObstacleKind::Depth].map(|kind| {
            let topic = ObstacleTopic { mount, ..ObstacleTopic::new("rear", kind, "/rear") };
            topic.robot_from_sensor().unwrap()
        });
        assert!((range * Point3::new(1.0, 0.0, 0.0) - Point3::new(-1.2, 0.1, 0.3)).norm() < 1e-9);
        // Ahead of the camera, to its right and below it.
        assert!((camera * Point3::new(0.5, 0.2, 1.0) - Point3::new(-1.2, 0.6, 0.1)).norm() < 1e-9);
        let known = tagalong_geometry::Camera::mounted(
            tagalong_geometry::Pinhole {
                fx: 1.0,
                fy: 1.0,
                cx: 0.0,
                cy: 0.0,
                distortion: tagalong_geometry::Distortion::None,
            },
            1,
            1,
            0.0,
            0.0,
            0.0,
        );
        let off = known.robot_from_camera.inverse() * level_camera();
        assert!(off.rotation.angle() < 1e-9 && off.translation.vector == Vector3::zeros());
    }
}
