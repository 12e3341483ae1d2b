use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::LogError;

/// How a log is read. Topics that are not named are found by message type and
/// encoding.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct InputSettings {
    /// Topic of the colour (or grey) images; of the left ones of a stereo pair.
    pub colour_topic: Option<String>,
    /// Topic of the depth images.
    pub depth_topic: Option<String>,
    /// Topic of the colour camera's calibration.
    pub colour_info_topic: Option<String>,
    /// Topic of the depth camera's calibration.
    pub depth_info_topic: Option<String>,
    /// Topic of the odometry; without one, tf from `odom_frame` to the robot is used.
    pub odometry_topic: Option<String>,
    /// Topic of a laser scanner's scans (`sensor_msgs` LaserScan), for the governor of a
    /// robot that is steered.
    pub laser_topic: Option<String>,
    /// Topic of detections that another program recorded (`vision_msgs`
    /// Detection2DArray or Detection3DArray), for `recorded-detections`.
    pub detections_topic: Option<String>,
    /// Topic of the right images of a stereo pair.
    pub right_topic: Option<String>,
    /// Topic of the right camera's calibration, which has the baseline.
    pub right_info_topic: Option<String>,
    /// Images whose stamps differ by no more than this belong together, s.
    pub pair_tolerance_s: f64,
    /// The robot's frame: X forward, Y left, Z up, on the floor. Where tf has
    /// `base_footprint` too, and this is left at `base_link`, that one is used.
    pub base_frame: String,
    /// The frame in which tf gives the robot's motion.
    pub odom_frame: String,
    /// Metres per unit of depth, where the log departs from the convention
    /// (millimetres for 16UC1, metres for 32FC1); makes mono16 images depth.
    pub depth_unit_m: Option<f64>,
    /// Columns and rows by which depth images are moved to lie on colour, where the
    /// log's are not registered well (`tagalong doctor` measures it).
    pub depth_offset_px: [i32; 2],
    /// The pose of the camera, for logs whose tf does not give it, or gives it wrong.
    pub camera: Option<MountSettings>,
    /// Columns and rows to which the circular image of a conical mirror is unwrapped.
    pub panorama: [usize; 2],
    /// Images that arrive up to this many frames late are put in order.
    pub reorder_frames: usize,
    /// Standard deviation of odometry as a fraction of the travel.
    pub odometry_sigma: f64,
}

impl Default for InputSettings {
    fn default() -> Self {
        Self {
            colour_topic: None,
            depth_topic: None,
            colour_info_topic: None,
            depth_info_topic: None,
            odometry_topic: None,
            laser_topic: None,
            detections_topic: None,
            right_topic: None,
            right_info_topic: None,
            pair_tolerance_s: 0.03,
            base_frame: "base_link".into(),
            odom_frame: "odom".into(),
            depth_unit_m: None,
            depth_offset_px: [0, 0],
            camera: None,
            panorama: [480, 120],
            reorder_frames: 3,
            odometry_sigma: 0.02,
        }
    }
}

impl InputSettings {
    /// Checks the numbers.
    ///
    /// # Errors
    /// [`LogError::Settings`], which names the key.
    pub fn check(&self) -> Result<(), LogError> {
        let refuse = |text: &str| Err(LogError::Settings(text.to_owned()));
        if !(0.0..=10.0).contains(&self.pair_tolerance_s) {
            return refuse("pair_tolerance_s must lie between 0 and 10");
        }
        if !(0.0..=10.0).contains(&self.odometry_sigma) {
            return refuse("odometry_sigma must lie between 0 and 10");
        }
        if self.depth_unit_m.is_some_and(|unit| !(1e-6..=1e3).contains(&unit)) {
            return refuse("depth_unit_m must lie between 1e-6 and 1000");
        }
        if !self.depth_offset_px.iter().all(|offset| (-1000..=1000).contains(offset)) {
            return refuse("depth_offset_px must lie between -1000 and 1000");
        }
        if !self.panorama.iter().all(|side| (8..=8192).contains(side)) {
            return refuse("panorama must be 8 to 8192 columns and rows");
        }
        if self.reorder_frames > 64 {
            return refuse("reorder_frames must be at most 64: each keeps its images in memory");
        }
        self.camera.as_ref().map_or(Ok(()), MountSettings::check)
    }
}

/// Where the camera sits: above the robot's origin, looking forward.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MountSettings {
    /// Height above the floor, m.
    pub height_m: f64,
    /// How far the camera looks down, degrees.
    pub pitch_down_deg: f64,
    /// How far its right side is raised, degrees.
    pub roll_deg: f64,
}

impl MountSettings {
    fn check(&self) -> Result<(), LogError> {
        let angles = [self.pitch_down_deg, self.roll_deg];
        if !(self.height_m > 0.0 && self.height_m < 100.0) {
            return Err(LogError::Settings("camera.height_m must be positive".into()));
        }
        if angles.iter().any(|a| !(-180.0..=180.0).contains(a)) {
            return Err(LogError::Settings("the camera's angles are given in degrees".into()));
        }
        Ok(())
    }
}
