//! Points of 3-D lidars: the cloud nearest in time to an image, or frames of their own.

use nalgebra::{Isometry2, Isometry3, Point3};
use tagalong_core::{Input, PointCloud as Cloud, Sensors, Stamp, spatial_pose};

use super::recent::Recent;
use super::{Moment, SensorReader, SensorType};
use crate::Limits;
use crate::images::points_of_cloud;
use crate::msgs::{CdrError, PointCloud2, decode};
use crate::pairing::Payload;
use crate::tally::Tally;
use crate::walk::Message;

/// Entry of lidars. Their topics are those whose points were found by [`crate::scan`] not to be
/// those of a camera.
pub(super) const ENTRY: SensorType = SensorType {
    input: Input::POINTS,
    messages: &["sensor_msgs/PointCloud2"],
    wanted: "points of a lidar",
    rank: Some(rank),
    header: |message| decode::<PointCloud2<'_>>(message.data).map(|cloud| Some(cloud.header)),
    fault: |_| None,
    reader: |_, _| Box::<Clouds>::default(),
};

/// Ranks raw points before filtered ones, which lack surfaces that hide others.
fn rank(topic: &str) -> i32 {
    let is_part = ["filtered", "ground", "obstacle", "cluster", "map"];
    -i32::from(is_part.iter().any(|word| topic.contains(word)))
}

/// Maximum number of stored clouds: those of the frames that wait for their turn.
const KEPT: usize = 16;

/// Clouds of the last seconds, not yet decoded.
#[derive(Default)]
struct Clouds(Recent<Payload, KEPT>);

impl SensorReader for Clouds {
    fn take(&mut self, message: &Message<'_>, _: &mut Tally) -> Result<(), CdrError> {
        self.0.push(Payload::of_headed(message)?);
        Ok(())
    }

    fn set_aside(&mut self, _: Stamp) {
        self.0.set_aside();
    }

    fn restore(&mut self) {
        self.0.restore();
    }

    fn add_to(&self, sensors: Sensors, moment: &Moment<'_>, tally: &mut Tally) -> Sensors {
        let Some(cloud) = self.0.near(moment.stamp) else {
            tally.count("frames_without_points");
            return sensors;
        };
        let then = cloud.stamp;
        let Some(mount) = moment.tf.lookup(moment.robot_frame, &cloud.frame_id, then) else {
            tally.count("clouds_without_pose");
            let topic = moment.topic;
            tally.note(format!(
                "tf does not connect the lidar of {topic} with the robot: it is not used"
            ));
            return sensors;
        };
        match cloud_in_robot(cloud, moment.topic, &mount, &moment.robot_from(then), tally) {
            Some(cloud) => sensors.with(cloud),
            None => sensors,
        }
    }
}

/// Returns a cloud in the robot frame after the robot has moved by `robot_from_then`; `None` if it
/// cannot be read, which is counted.
pub(crate) fn cloud_in_robot(
    cloud: &Payload,
    topic: &str,
    robot_from_lidar: &Isometry3<f64>,
    robot_from_then: &Isometry2<f64>,
    tally: &mut Tally,
) -> Option<Cloud> {
    let robot_from_lidar = spatial_pose(robot_from_then) * robot_from_lidar;
    let decoded = decode::<PointCloud2<'_>>(&cloud.data).map_err(|error| error.to_string());
    let points = decoded.and_then(|cloud| {
        points_of_cloud(&cloud, &Limits::default()).map_err(|error| error.to_string())
    });
    match points {
        Ok(points) => {
            let points: Vec<_> = points.iter().map(|point| robot_from_lidar * point).collect();
            Some(Cloud::new(robot_from_lidar * Point3::origin(), points))
        }
        Err(why) => {
            tally.lose("clouds_invalid", || format!("{topic}: points cannot be used: {why}"));
            None
        }
    }
}
