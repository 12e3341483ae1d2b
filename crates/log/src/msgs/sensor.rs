use serde::{Deserialize, Serialize};

use super::{Header, message};

/// `sensor_msgs/Image`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Image<'a> {
    /// When and from which camera.
    pub header: Header,
    /// Rows.
    pub height: u32,
    /// Columns.
    pub width: u32,
    /// Pixel format, for example `rgb8`.
    pub encoding: String,
    /// Not 0: values of more than one byte have the high byte first.
    pub is_bigendian: u8,
    /// Bytes from one row to the next.
    pub step: u32,
    /// `step * height` bytes.
    #[serde(with = "serde_bytes", borrow)]
    pub data: &'a [u8],
}

message!(Image<'_>, "sensor_msgs/msg/Image", "Image.msg");

/// `sensor_msgs/CompressedImage`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CompressedImage<'a> {
    /// When and from which camera.
    pub header: Header,
    /// For example `jpeg`, `rgb8; jpeg compressed bgr8`, `16UC1; compressedDepth`.
    pub format: String,
    /// The compressed bytes.
    #[serde(with = "serde_bytes", borrow)]
    pub data: &'a [u8],
}

message!(CompressedImage<'_>, "sensor_msgs/msg/CompressedImage", "CompressedImage.msg");

/// `sensor_msgs/RegionOfInterest`, in unbinned pixels of the full image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct RegionOfInterest {
    /// First column.
    pub x_offset: u32,
    /// First row.
    pub y_offset: u32,
    /// Rows; 0 together with a width of 0 is the full image.
    pub height: u32,
    /// Columns.
    pub width: u32,
    /// The region is to be rectified; says nothing about this image.
    pub do_rectify: bool,
}

/// `sensor_msgs/CameraInfo`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CameraInfo {
    /// When and which camera.
    pub header: Header,
    /// Rows of the full image.
    pub height: u32,
    /// Columns of the full image.
    pub width: u32,
    /// `plumb_bob`, `rational_polynomial` or empty.
    pub distortion_model: String,
    /// Distortion coefficients.
    pub d: Vec<f64>,
    /// 3x3 intrinsics of the raw image, row by row; all zero = uncalibrated.
    pub k: [f64; 9],
    /// 3x3 rectification, row by row.
    pub r: [f64; 9],
    /// 3x4 projection of the rectified image, row by row.
    pub p: [f64; 12],
    /// Columns combined into one; 0 means 1.
    pub binning_x: u32,
    /// Rows combined into one; 0 means 1.
    pub binning_y: u32,
    /// The part of the full image that is delivered.
    pub roi: RegionOfInterest,
}

message!(CameraInfo, "sensor_msgs/msg/CameraInfo", "CameraInfo.msg");

/// `sensor_msgs/LaserScan`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LaserScan {
    /// When the first ray was sent, and by which scanner.
    pub header: Header,
    /// Direction of the first ray, rad, from X towards Y.
    pub angle_min: f32,
    /// Direction of the last one, rad.
    pub angle_max: f32,
    /// From one ray to the next, rad.
    pub angle_increment: f32,
    /// From one ray to the next, s.
    pub time_increment: f32,
    /// From one scan to the next, s.
    pub scan_time: f32,
    /// Nearest range that is measured, m.
    pub range_min: f32,
    /// Farthest range that is measured, m.
    pub range_max: f32,
    /// What the rays measured, m; what lies beyond the limits is no reading.
    pub ranges: Vec<f32>,
    /// How much came back, in units of the maker; may be empty.
    pub intensities: Vec<f32>,
}

message!(LaserScan, "sensor_msgs/msg/LaserScan", "LaserScan.msg");

/// `sensor_msgs/JointState`: lists of one length, or empty where nothing is known.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct JointState {
    /// When.
    pub header: Header,
    /// The joints.
    pub name: Vec<String>,
    /// Angles of joints that turn, rad; else m.
    pub position: Vec<f64>,
    /// Speeds, rad/s or m/s.
    pub velocity: Vec<f64>,
    /// Efforts, N m or N.
    pub effort: Vec<f64>,
}

message!(JointState, "sensor_msgs/msg/JointState", "JointState.msg");
