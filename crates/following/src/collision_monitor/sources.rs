use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::{Error, Result, settings};

settings! {
    /// Further source of obstacles: a `[[collision_monitor.sources]]` section, like an entry of
    /// `observation_sources` of Nav2's collision monitor. The depth image and the laser scan of the
    /// frames are sources without a section.
    #[non_exhaustive]
    pub struct SourceSettings {
        /// Name of the source in reports; it must be unique.
        pub name: String,
        /// Kind of the sensor: "scan", "depth", "range" (sonar, infrared) or "bumper".
        #[serde(rename = "type")]
        pub kind: SourceKind = SourceKind::Scan,
        /// Topic of its messages. If left out, only programs that fill the frames themselves
        /// deliver its readings.
        pub topic: String,
        /// Topic of the calibration of a depth camera; if left out, the one found beside `topic`.
        pub info_topic: String,
        /// Pose of the sensor in the robot frame: x, y, z in m, roll, pitch, yaw in degrees. Every
        /// sensor looks along its x axis, a camera too. If left out, the pose from tf.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub mount: Option<[f64; 6]>,
        /// Age of the newest reading above which the robot stops, s (Nav2's `source_timeout`).
        #[schemars(range(min = 0.05, max = 5.0))]
        pub source_timeout_s: f64 = 0.5,
        /// Least share of valid readings in the part of the swept region that the source sees;
        /// below it the robot stops.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub min_share: f64 = 0.3,
    }
}

/// Kind of a source of obstacles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum SourceKind {
    /// `sensor_msgs/LaserScan`.
    #[default]
    Scan,
    /// A depth image: `sensor_msgs/Image` or `CompressedImage`.
    Depth,
    /// `sensor_msgs/Range`.
    Range,
    /// A contact message: `std_msgs/Bool`, or the bumper message of a common base.
    Bumper,
}

impl SourceSettings {
    /// Refuses sources without a name, or two of one name.
    ///
    /// # Errors
    /// [`Error::Settings`] names the key and the remedy.
    pub(super) fn check_all(sources: &[Self]) -> Result<()> {
        for (at, source) in sources.iter().enumerate() {
            if source.name.is_empty() {
                return Err(Error::setting("sources", "each needs a `name`".to_owned()));
            }
            if sources[..at].iter().any(|earlier| earlier.name == source.name) {
                let why = format!("has two sources called `{}`: rename one", source.name);
                return Err(Error::setting("sources", why));
            }
            let mut mount = source.mount.iter().flatten();
            if !mount.all(|value| value.is_finite()) {
                let why = format!("`{}` has a mount that is no number", source.name);
                return Err(Error::setting("sources", why));
            }
        }
        Ok(())
    }
}
