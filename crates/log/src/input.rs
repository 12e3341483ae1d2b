use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::{Input, settings};

use crate::camera_settings::{CameraSettings, MountSettings};
use crate::obstacles::ObstacleTopic;

settings! {
    /// Settings for reading a log. Topics that are not named are found by message type and
    /// encoding.
    pub struct InputSettings {
        /// Topic of the colour (or grey) images; for a stereo pair, of the left ones.
        pub colour_topic: Option<String>,
        /// Topic of the depth images.
        pub depth_topic: Option<String>,
        /// Topic of the colour camera's calibration.
        pub colour_info_topic: Option<String>,
        /// Topic of the depth camera's calibration.
        pub depth_info_topic: Option<String>,
        /// Topic of the odometry; without one, tf from `odom_frame` to the robot is used.
        pub odometry_topic: Option<String>,
        /// Topic of a laser scanner's scans (`sensor_msgs` LaserScan), for detectors that use them
        /// and for the command limiter of a steered robot.
        pub laser_topic: Option<String>,
        /// Topic of detections that another program recorded (`vision_msgs` Detection2DArray or
        /// Detection3DArray), for `recorded-detections`.
        pub detections_topic: Option<String>,
        /// Classes of recorded detections that are people, by name or number; by default those with
        /// a usual name (`person`, `pedestrian`, ...), the number 0, and detections without a
        /// class.
        #[serde(skip_serializing_if = "Vec::is_empty")]
        pub detection_classes: Vec<String>,
        /// Topics of further sensors, keyed by the names of their inputs.
        #[serde(skip_serializing_if = "BTreeMap::is_empty")]
        pub topics: BTreeMap<String, String> = BTreeMap::new(),
        /// Topic of the right images of a stereo pair.
        pub right_topic: Option<String>,
        /// Topic of the right camera's calibration, which holds the baseline.
        pub right_info_topic: Option<String>,
        /// Maximum difference between the stamps of images that belong together, s.
        #[schemars(range(min = 0.0, max = 10.0))]
        pub pair_tolerance_s: f64 = 0.03,
        /// Robot frame: X forward, Y left, Z up, on the floor. If tf also has `base_footprint`, and
        /// this is left at `base_link`, `base_footprint` is used.
        pub base_frame: String = "base_link".into(),
        /// Frame in which tf gives the robot's motion.
        pub odom_frame: String = "odom".into(),
        /// Metres per unit of depth, if the log deviates from the convention (millimetres for
        /// 16UC1, metres for 32FC1); also makes mono16 images count as depth.
        #[schemars(range(min = 1e-6, max = 1e3))]
        pub depth_unit_m: Option<f64>,
        /// Makes the depth topic one of disparities, for images without the geometry that
        /// `stereo_msgs/DisparityImage` contains; that type needs no setting.
        pub disparity: Option<DisparitySettings>,
        /// Columns and rows by which depth images are shifted to match the colour images, if those
        /// of the log are not registered well (`tagalong doctor` measures it).
        #[schemars(inner(range(min = -1000, max = 1000)))]
        pub depth_offset_px: [i32; 2] = [0, 0],
        /// Camera whose images are used, if there are several: the prefix that its topics share.
        /// Or, as a table, the pose of the camera, for logs without it in tf, or with a wrong one.
        pub camera: Option<CameraSettings>,
        /// Source of the times of messages.
        pub stamps: StampSource,
        /// Columns and rows to which the circular image of a conical mirror is unwrapped.
        #[schemars(inner(range(min = 8, max = 8192)))]
        pub panorama: [usize; 2] = [480, 120],
        /// Number of frames by which an image may be late and still be sorted in.
        #[schemars(range(max = 64))]
        pub reorder_frames: usize = 3,
        /// Standard deviation of odometry as a fraction of the travel.
        #[schemars(range(min = 0.0, max = 10.0))]
        pub odometry_sigma: f64 = 0.02,
        /// Further obstacle sources. They are not keys of `[input]`: a program fills them in from
        /// `[[collision_monitor.sources]]` of its pipeline.
        #[serde(skip)]
        #[schemars(skip)]
        pub sources: Vec<ObstacleTopic>,
    }
}

impl InputSettings {
    /// Returns the name of the camera whose images are wanted.
    pub(crate) fn camera_name(&self) -> Option<&str> {
        match self.camera.as_ref()? {
            CameraSettings::Named(name) => Some(name),
            CameraSettings::Mounted(mount) => mount.name.as_deref(),
        }
    }

    /// Returns the topic that the settings name for an input. A log without it is rejected.
    pub fn topic_of(&self, input: Input) -> Option<&str> {
        match input {
            Input::Colour => self.colour_topic.as_deref(),
            Input::Depth => self.depth_topic.as_deref(),
            Input::Right => self.right_topic.as_deref(),
            Input::Laser => self.laser_topic.as_deref(),
            Input::Detections => self.detections_topic.as_deref(),
            other => self.topics.get(other.name()).map(String::as_str),
        }
    }

    /// Returns the pose of the camera, if the settings give one.
    pub fn mount(&self) -> Option<&MountSettings> {
        match self.camera.as_ref()? {
            CameraSettings::Named(_) => None,
            CameraSettings::Mounted(mount) => Some(mount),
        }
    }
}

/// Settings of disparity images: depth is focal length times baseline, divided by disparity.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct DisparitySettings {
    /// Pixels per unit of disparity. By default 1, and 1/16 for 16SC1; 16UC1 and mono16 have no
    /// default.
    #[schemars(range(min = 1e-6, max = 1e3))]
    pub unit_px: Option<f64>,
    /// Baseline: distance of the right camera from the left one, m; by default that of the right
    /// camera's calibration.
    #[schemars(range(min = 1e-4, max = 100.0))]
    pub baseline_m: Option<f64>,
}

/// Source of the times of messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum StampSource {
    /// Their stamps, or the recording times if the stamps are never set.
    #[default]
    Auto,
    /// Their stamps.
    Header,
    /// The recording times.
    Recording,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn topics_of_sensors_that_are_not_read_are_refused() {
        let [unknown, known] = ["sonar", "laser"].map(|name: &str| {
            let topics = [(name.to_owned(), "/sonar".to_owned())].into();
            InputSettings { topics, ..InputSettings::default() }.check()
        });
        let refusal = unknown.unwrap_err().to_string();
        assert!(refusal.contains("`topics.sonar`: no sensor of that name"), "{refusal}");
        assert!(refusal.contains("laser_topic, detections_topic"), "{refusal}");
        assert!(known.is_err(), "it has a key of its own");
        assert!(InputSettings::default().check().is_ok());
    }
}
