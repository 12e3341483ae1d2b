use std::borrow::Cow;

use serde::{Deserialize, Serialize};

use super::{Header, message};

/// `sensor_msgs/Image`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Image<'a> {
    /// Time and camera.
    pub header: Header,
    /// Number of rows.
    pub height: u32,
    /// Number of columns.
    pub width: u32,
    /// Pixel format, for example `rgb8`.
    pub encoding: String,
    /// Byte order: if not 0, values of more than one byte have the high byte first.
    pub is_bigendian: u8,
    /// Number of bytes from one row to the next.
    pub step: u32,
    /// Pixels, `step * height` bytes.
    #[serde(with = "serde_bytes", borrow)]
    pub data: &'a [u8],
}

impl<'a> Image<'a> {
    /// Returns an image of `width` columns and `height` rows, without padding between the rows;
    /// values of more than one byte have the low byte first.
    pub fn packed(header: Header, encoding: &str, width: u32, height: u32, data: &'a [u8]) -> Self {
        let step = (data.len() as u32).checked_div(height).unwrap_or(0);
        Self { header, height, width, encoding: encoding.to_owned(), is_bigendian: 0, step, data }
    }
}

message!(Image<'_>, "sensor_msgs/msg/Image", "Image.msg");

/// `sensor_msgs/CompressedImage`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CompressedImage<'a> {
    /// Time and camera.
    pub header: Header,
    /// Format, for example `jpeg`, `rgb8; jpeg compressed bgr8`, `16UC1; compressedDepth`.
    pub format: String,
    /// Compressed bytes.
    #[serde(with = "serde_bytes", borrow)]
    pub data: &'a [u8],
}

message!(CompressedImage<'_>, "sensor_msgs/msg/CompressedImage", "CompressedImage.msg");

/// `stereo_msgs/DisparityImage`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DisparityImage<'a> {
    /// Time and camera, as in the image.
    pub header: Header,
    /// Disparities of the rectified left image, pixels.
    #[serde(borrow)]
    pub image: Image<'a>,
    /// Focal length, pixels.
    pub f: f32,
    /// Baseline, m.
    pub t: f32,
    /// Part of the image that may have disparities; 0 by 0 means the whole image.
    pub valid_window: RegionOfInterest,
    /// Minimum of the range that was searched, pixels; lower values are invalid.
    pub min_disparity: f32,
    /// Maximum of the range that was searched, pixels.
    pub max_disparity: f32,
    /// Resolution, pixels.
    pub delta_d: f32,
}

message!(DisparityImage<'_>, "stereo_msgs/msg/DisparityImage", "DisparityImage.msg");

/// `sensor_msgs/RegionOfInterest`, in unbinned pixels of the full image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct RegionOfInterest {
    /// First column.
    pub x_offset: u32,
    /// First row.
    pub y_offset: u32,
    /// Number of rows; 0 together with a width of 0 means the full image.
    pub height: u32,
    /// Number of columns.
    pub width: u32,
    /// True if the region is to be rectified; not used for this image.
    pub do_rectify: bool,
}

/// `sensor_msgs/CameraInfo`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CameraInfo {
    /// Time and camera.
    pub header: Header,
    /// Rows of the full image.
    pub height: u32,
    /// Columns of the full image.
    pub width: u32,
    /// `plumb_bob`, `rational_polynomial`, `equidistant`, `fisheye` or empty.
    pub distortion_model: String,
    /// Distortion coefficients.
    pub d: Vec<f64>,
    /// 3x3 intrinsics of the raw image, row by row; all zero = uncalibrated.
    pub k: [f64; 9],
    /// 3x3 rectification, row by row.
    pub r: [f64; 9],
    /// 3x4 projection of the rectified image, row by row.
    pub p: [f64; 12],
    /// Number of columns combined into one; 0 means 1.
    pub binning_x: u32,
    /// Number of rows combined into one; 0 means 1.
    pub binning_y: u32,
    /// Part of the full image that is delivered.
    pub roi: RegionOfInterest,
}

message!(CameraInfo, "sensor_msgs/msg/CameraInfo", "CameraInfo.msg");

/// `sensor_msgs/LaserScan`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LaserScan {
    /// Time of the first ray, and the scanner.
    pub header: Header,
    /// Direction of the first ray, rad, from X towards Y.
    pub angle_min: f32,
    /// Direction of the last ray, rad.
    pub angle_max: f32,
    /// Angle from one ray to the next, rad.
    pub angle_increment: f32,
    /// Time from one ray to the next, s.
    pub time_increment: f32,
    /// Time from one scan to the next, s.
    pub scan_time: f32,
    /// Minimum range that is measured, m.
    pub range_min: f32,
    /// Maximum range that is measured, m.
    pub range_max: f32,
    /// Ranges of the rays, m; values beyond the limits are no readings.
    pub ranges: Vec<f32>,
    /// Intensities of the reflections, in units of the maker; may be empty.
    pub intensities: Vec<f32>,
}

message!(LaserScan, "sensor_msgs/msg/LaserScan", "LaserScan.msg");

/// `sensor_msgs/Range`. Newer versions have a variance after the last field, which is not used.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Range {
    /// Time and frame of the sensor, which measures along its X axis.
    pub header: Header,
    /// 0 for ultrasound, 1 for infrared.
    pub radiation_type: u8,
    /// Angle of the cone, rad.
    pub field_of_view: f32,
    /// Minimum range that is measured, m.
    pub min_range: f32,
    /// Maximum range that is measured, m.
    pub max_range: f32,
    /// The range, m; infinity for no reflection, and minus infinity for a surface nearer than the
    /// minimum (REP 117).
    pub range: f32,
}

impl Range {
    /// [`Range::radiation_type`] of a sonar.
    pub const ULTRASOUND: u8 = 0;
    /// [`Range::radiation_type`] of an infrared sensor.
    pub const INFRARED: u8 = 1;
}

message!(Range, "sensor_msgs/msg/Range", "Range.msg");

/// `sensor_msgs/JointState`: lists of one length, or empty if unknown.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct JointState {
    /// Time.
    pub header: Header,
    /// Names of the joints.
    pub name: Vec<String>,
    /// Positions: angles of revolute joints, rad; else m.
    pub position: Vec<f64>,
    /// Speeds, rad/s or m/s.
    pub velocity: Vec<f64>,
    /// Efforts, N m or N.
    pub effort: Vec<f64>,
}

message!(JointState, "sensor_msgs/msg/JointState", "JointState.msg");

/// `sensor_msgs/PointCloud2`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PointCloud2<'a> {
    /// Time and frame.
    pub header: Header,
    /// Number of rows; 1 for an unorganised cloud.
    pub height: u32,
    /// Number of points of a row.
    pub width: u32,
    /// Layout of a point.
    pub fields: Vec<PointField>,
    /// True if values of more than one byte have the high byte first.
    pub is_bigendian: bool,
    /// Number of bytes of a point.
    pub point_step: u32,
    /// Number of bytes of a row.
    pub row_step: u32,
    /// Points, `row_step * height` bytes.
    #[serde(with = "serde_bytes", borrow)]
    pub data: Cow<'a, [u8]>,
    /// True if all points are finite.
    pub is_dense: bool,
}

message!(PointCloud2<'_>, "sensor_msgs/msg/PointCloud2", "PointCloud2.msg");

impl PointCloud2<'_> {
    /// Returns a message with these points, m, in one row.
    pub fn of_points(header: Header, points: &[[f32; 3]]) -> PointCloud2<'static> {
        let fields = [("x", 0), ("y", 4), ("z", 8)];
        let width = points.len() as u32;
        let point_step = 12;
        let data: Vec<u8> = points.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
        PointCloud2 {
            header,
            height: 1,
            width,
            fields: fields.map(|(name, offset)| PointField::float32(name, offset)).to_vec(),
            is_bigendian: false,
            point_step,
            row_step: point_step * width,
            data: data.into(),
            is_dense: true,
        }
    }
}

/// `sensor_msgs/PointField`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PointField {
    /// Name, for example `x`.
    pub name: String,
    /// Offset of the field in a point, bytes.
    pub offset: u32,
    /// Type of its values.
    pub datatype: u8,
    /// Number of values.
    pub count: u32,
}

impl PointField {
    /// Type of single-precision floats.
    pub const FLOAT32: u8 = 7;

    /// Returns a field of one single-precision float.
    pub fn float32(name: &str, offset: u32) -> Self {
        Self { name: name.to_owned(), offset, datatype: Self::FLOAT32, count: 1 }
    }
}
