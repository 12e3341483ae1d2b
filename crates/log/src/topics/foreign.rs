//! Message types of sensors that are not read: their contents, and the topic to record instead.
//!
//! Without them, a log of colour images and lidar packets would be reported as one of "colour
//! alone".

use super::kinds::unread_encoding;
use crate::images::VIDEO_REMEDY;
use crate::scan::{Topic, Type};

/// Messages of a sensor that are not read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Foreign {
    /// Contents of the messages, and the statement that they are not read.
    pub(super) why: String,
    /// Topic to record instead.
    pub(super) remedy: String,
    /// Inputs for which the recorded topic could be used, the best first.
    pub(super) could_be: &'static [&'static str],
}

/// Types with the same contents and the same remedy.
struct Group {
    /// Package and name of each type, written as in ROS 1; `*` stands for any package.
    types: &'static [&'static str],
    contents: &'static str,
    remedy: &'static str,
    could_be: &'static [&'static str],
}

const POINTS_REMEDY: &str =
    "record the points that the driver of the lidar makes of them (sensor_msgs/PointCloud2)";
const PARTS_REMEDY: &str =
    "record the topics of the images themselves (sensor_msgs/Image), each with its camera_info";
const SENSOR_REMEDY: &str = "record the topic of the sensor itself";

const GROUPS: [Group; 12] = [
    Group {
        types: &[
            "realsense2_camera_msgs/RGBD",
            "rtabmap_msgs/RGBDImage",
            "rtabmap_msgs/RGBDImages",
            "rtabmap_msgs/SensorData",
            "rtabmap_ros/RGBDImage",
            "rtabmap_ros/RGBDImages",
            "*/RGBD",
            "*/RGBDImage",
        ],
        contents: "colour and depth in one message",
        remedy: PARTS_REMEDY,
        could_be: &["depth", "colour"],
    },
    Group {
        types: &["wfov_camera_msgs/WFOVImage", "*/ImageArray", "*/CompressedImageArray"],
        contents: "images within other messages",
        remedy: PARTS_REMEDY,
        could_be: &["colour"],
    },
    Group {
        types: &[
            "theora_image_transport/Packet",
            "h264_image_transport/Packet",
            "h264_msgs/Packet",
            "x264_image_transport/x264Video",
            "x264_image_transport/x265Video",
            "*/EncodedVideo",
            "*/VideoPacket",
        ],
        contents: "video",
        remedy: VIDEO_REMEDY,
        could_be: &["colour"],
    },
    Group {
        types: &[
            "dvs_msgs/EventArray",
            "event_array_msgs/EventArray",
            "event_camera_msgs/EventPacket",
            "prophesee_event_msgs/EventArray",
        ],
        contents: "events of single pixels",
        remedy: "record the images of the camera as well, if it has any",
        could_be: &[],
    },
    Group {
        types: &["sensor_msgs/PointCloud"],
        contents: "points in the layout of before PointCloud2",
        remedy: "record sensor_msgs/PointCloud2; `point_cloud_converter` of ROS 1 makes it of them",
        could_be: &["points"],
    },
    Group {
        types: &["*/PointCloud", "*/PointCloud2"],
        contents: "points in a type of another package",
        remedy: "record sensor_msgs/PointCloud2",
        could_be: &["points"],
    },
    Group {
        types: &["*/CompressedPointCloud2"],
        contents: "compressed points",
        remedy: "record the raw topic (sensor_msgs/PointCloud2)",
        could_be: &["points"],
    },
    Group {
        types: &[
            "livox_ros_driver/CustomMsg",
            "livox_ros_driver2/CustomMsg",
            "livox_interfaces/CustomMsg",
            "livox_sdk_vendor/CustomMsg",
        ],
        contents: "points in a type of Livox",
        remedy: "set `xfer_format` of the driver to 0, so that it publishes sensor_msgs/PointCloud2, and \
                 record that",
        could_be: &["points"],
    },
    Group {
        types: &[
            "velodyne_msgs/VelodyneScan",
            "velodyne_msgs/VelodynePacket",
            "ouster_ros/PacketMsg",
            "ouster_msgs/PacketMsg",
            "ouster_sensor_msgs/PacketMsg",
            "rslidar_msg/RslidarPacket",
            "rslidar_msgs/rslidarScan",
            "rslidar_msgs/rslidarPacket",
            "hesai_lidar/PandarScan",
            "pandar_msgs/PandarScan",
            "hesai_ros_driver/UdpFrame",
            "nebula_msgs/NebulaPackets",
            "robosense_msgs/RobosenseScan",
            "lslidar_msgs/LslidarScan",
            "cepton_messages/Packets",
            "*/PacketMsg",
        ],
        contents: "raw packets of a lidar",
        remedy: POINTS_REMEDY,
        could_be: &["points"],
    },
    Group {
        types: &["sensor_msgs/MultiEchoLaserScan", "*/MultiEchoLaserScan"],
        contents: "scans with several echoes a beam",
        remedy: "record the sensor_msgs/LaserScan that `laser_proc` makes of them (topics `first`, `last` \
                 and `most_intense`)",
        could_be: &["laser"],
    },
    Group {
        types: &[
            "sick_safetyscanners/RawMicroScanData",
            "sick_safetyscanners/ExtendedLaserScanMsg",
            "sick_safetyscanners2_interfaces/RawMicroScanData",
            "sick_safetyscanners2_interfaces/ExtendedLaserScan",
        ],
        contents: "scans in a type of their driver",
        remedy: "record the sensor_msgs/LaserScan of the same driver",
        could_be: &["laser"],
    },
    Group {
        types: &[
            "radar_msgs/RadarScan",
            "radar_msgs/RadarTracks",
            "ti_mmwave_rospkg/RadarScan",
            "conti_radar/Measurement",
            "*/RadarScan",
            "*/RadarTracks",
        ],
        contents: "readings of a radar",
        remedy: "no pipeline uses a radar: record a camera or a laser scanner",
        could_be: &[],
    },
];

/// Types of `sensor_msgs` that may be contained in others, and the words for them.
const PARTS: [(&str, &str); 5] = [
    ("Image", "images"),
    ("CompressedImage", "images"),
    ("PointCloud2", "points"),
    ("LaserScan", "scans"),
    ("MultiEchoLaserScan", "scans"),
];

/// Packages whose messages contain images that no sensor took, such as textures of markers.
const DRAWN: &str = "visualization_msgs";

/// Returns the contents of a topic of a sensor whose type is not read; `None` for all other topics.
pub(super) fn foreign(topic: &Topic) -> Option<Foreign> {
    let (package, name) = parts_of(&topic.schema);
    if topic.kind != Type::Other || package == DRAWN {
        return None;
    }
    let mut groups = GROUPS.iter();
    if let Some(group) = groups.find(|group| group.has(package, name)) {
        let could_be = group.could_be;
        if let Some((why, remedy)) = unread_encoding(&topic.encoding) {
            return Some(Foreign { why, remedy: remedy.to_owned(), could_be });
        }
        let why = format!("its type is not read: {}", group.contents);
        return Some(Foreign { why, remedy: group.remedy.to_owned(), could_be });
    }
    let part = topic.part?;
    let (_, words) = PARTS.iter().find(|(name, _)| *name == part)?;
    let why = format!("its type is not read, and its messages hold {words} (sensor_msgs/{part})");
    let remedy = if *words == "images" { PARTS_REMEDY } else { SENSOR_REMEDY };
    Some(Foreign { why, remedy: remedy.to_owned(), could_be: &[] })
}

impl Group {
    /// Returns true for a type of the group.
    fn has(&self, package: &str, name: &str) -> bool {
        self.types.iter().any(|known| {
            let (of_package, of_name) = parts_of(known);
            of_name == name && (of_package == package || of_package == "*")
        })
    }
}

/// Returns package and name of a type, written as in ROS 1, ROS 2 or Protobuf.
fn parts_of(schema: &str) -> (&str, &str) {
    let package = schema.split(['/', '.']).next().unwrap_or_default();
    let name = schema.rsplit(['/', '.']).next().unwrap_or_default();
    (package, name)
}

/// Returns the first type of `sensor_msgs` with images, points or scans that is contained in the
/// messages of a type, according to its definition.
pub(crate) fn part_of(definition: &str) -> Option<&'static str> {
    let mut found = None;
    for line in definition.lines() {
        let named = line.strip_prefix("MSG: ").or_else(|| line.strip_prefix("IDL: "));
        let Some(named) = named else { continue };
        let (package, name) = parts_of(named.trim());
        if package == DRAWN {
            return None;
        }
        let known = PARTS.iter().find(|(part, _)| package == "sensor_msgs" && *part == name);
        found = found.or(known.map(|(part, _)| *part));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn types_are_known_in_all_spellings() {
        for (schema, contents) in [
            ("realsense2_camera_msgs/msg/RGBD", "colour and depth in one message"),
            ("rtabmap_ros/RGBDImage", "colour and depth in one message"),
            ("theora_image_transport/msg/Packet", "video"),
            ("foxglove.PointCloud", "points in a type of another package"),
            ("sensor_msgs/PointCloud", "points in the layout of before PointCloud2"),
            ("my_msgs/msg/PacketMsg", "raw packets of a lidar"),
        ] {
            let (package, name) = parts_of(schema);
            let group = GROUPS.iter().find(|group| group.has(package, name));
            assert_eq!(group.map(|group| group.contents), Some(contents), "{schema}");
        }
        for other in ["std_msgs/String", "my_msgs/Packet", "", "nav_msgs/msg/Path"] {
            let (package, name) = parts_of(other);
            assert!(!GROUPS.iter().any(|group| group.has(package, name)), "{other}");
        }
    }

    #[test]
    fn the_definition_tells_what_messages_contain() {
        let definition = "sensor_msgs/Image[] views\n===\nMSG: sensor_msgs/Image\nuint32 height\n";
        assert_eq!(part_of(definition), Some("Image"));
        assert_eq!(part_of("IDL: sensor_msgs/msg/PointCloud2\n"), Some("PointCloud2"));
        assert_eq!(part_of("Image data\n===\nMSG: my_msgs/Image\n"), None);
        let marker = "MSG: visualization_msgs/Marker\nMSG: sensor_msgs/CompressedImage\n";
        assert_eq!(part_of(marker), None, "a texture is no sensor");
        let texture = "MSG: sensor_msgs/CompressedImage\nMSG: visualization_msgs/Marker\n";
        assert_eq!(part_of(texture), None);
    }
}
