//! `sensor_msgs/PointCloud2`: depth from a camera that publishes an organised cloud, with a point
//! for each pixel, and the points of a lidar.

use nalgebra::Point3;
use tagalong_core::DepthImage;
use tagalong_geometry::{Distortion, Pinhole};

use super::raw::exact;
use super::{ImageError, check_size};
use crate::Limits;
use crate::msgs::{PointCloud2, PointField};

/// Minimum number of points for estimating the lens.
const MIN_POINTS: usize = 100;
/// Maximum mean error of the lens, pixels, up to which rows and columns are those of a camera.
const MAX_ERROR_PX: f64 = 1.0;
/// Minimum fraction of the points that are in front of the camera.
const IN_FRONT: f64 = 0.99;
/// Approximate number of pixels along the longer side that are used for estimating the lens.
const SAMPLES_A_SIDE: usize = 160;

/// Axes of the points of a cloud.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum CloudAxes {
    /// Z forward, X right, Y down: an optical frame.
    Optical,
    /// X forward, Y left, Z up: a frame of the robot's body.
    Body,
}

/// Camera of an organised point cloud, estimated from the points.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct CloudCamera {
    /// Axes of the points.
    pub axes: CloudAxes,
    /// Lens, pixels.
    pub lens: Pinhole,
}

impl CloudAxes {
    /// Returns a point as right, down and forward.
    fn optical(self, [x, y, z]: [f32; 3]) -> [f64; 3] {
        match self {
            Self::Optical => [x.into(), y.into(), z.into()],
            Self::Body => [-f64::from(y), -f64::from(z), x.into()],
        }
    }
}

/// Returns columns and rows of a cloud.
///
/// # Errors
/// [`ImageError`]: an unorganised cloud, a size beyond the limits, fields or data that contradict
/// the size.
pub fn size_of_cloud(
    cloud: &PointCloud2<'_>,
    limits: &Limits,
) -> Result<(usize, usize), ImageError> {
    Points::new(cloud, limits).map(|points| (points.width, points.height))
}

/// Decodes the points of a camera into depth along its optical axis. A point that is not finite, or
/// not in front of the camera, gives no reading.
///
/// # Errors
/// As [`size_of_cloud`].
pub fn decode_cloud(
    cloud: &PointCloud2<'_>,
    axes: CloudAxes,
    limits: &Limits,
) -> Result<DepthImage, ImageError> {
    let points = Points::new(cloud, limits)?;
    let mut depth = Vec::with_capacity(points.width * points.height);
    for row in 0..points.height {
        for column in 0..points.width {
            let [_, _, ahead_m] = axes.optical(points.at(column, row));
            let is_reading = ahead_m.is_finite() && ahead_m > 0.0;
            depth.push(if is_reading { ahead_m as f32 } else { f32::NAN });
        }
    }
    Ok(exact(points.width, points.height, depth))
}

/// Estimates axes and lens of the camera of a cloud. `None` if too few points are valid, as in a
/// first image that is still dark.
///
/// # Errors
/// As [`size_of_cloud`], and points whose rows and columns are not those of a camera without
/// distortion, for example those of a lidar.
pub fn camera_of_cloud(
    cloud: &PointCloud2<'_>,
    limits: &Limits,
) -> Result<Option<CloudCamera>, ImageError> {
    let points = Points::new(cloud, limits)?;
    let step = (points.width.max(points.height) / SAMPLES_A_SIDE).max(1);
    let mut sampled = Vec::new();
    for row in (0..points.height).step_by(step) {
        for column in (0..points.width).step_by(step) {
            let point = points.at(column, row);
            // Some drivers write zeros for pixels without depth.
            if point.iter().all(|value| value.is_finite()) && point != [0.0; 3] {
                sampled.push(([column as f64, row as f64], point));
            }
        }
    }
    if sampled.len() < MIN_POINTS {
        return Ok(None);
    }
    for axes in [CloudAxes::Optical, CloudAxes::Body] {
        if let Some(lens) = fitted_lens(&sampled, axes) {
            return Ok(Some(CloudCamera { axes, lens }));
        }
    }
    Err(ImageError::Cloud(
        "its points do not belong to the pixels of a camera, like those of a lidar".into(),
    ))
}

/// Returns the points of a lidar, m, in its own frame. Beams without a reflection, for which
/// drivers write values that are not finite or the position of the lidar itself, are left out.
///
/// # Errors
/// [`ImageError`]: a size beyond the limits, fields or data that contradict the size.
pub fn points_of_cloud(
    cloud: &PointCloud2<'_>,
    limits: &Limits,
) -> Result<Vec<Point3<f64>>, ImageError> {
    let points = Points::unordered(cloud, limits)?;
    let mut found = Vec::new();
    for row in 0..points.height {
        for column in 0..points.width {
            let point = points.at(column, row);
            if point.iter().all(|value| value.is_finite()) && point != [0.0; 3] {
                found.push(Point3::from(point.map(f64::from)));
            }
        }
    }
    Ok(found)
}

/// Pixel and its point.
type Sample = ([f64; 2], [f32; 3]);

/// Returns the lens that maps points to their pixels; `None` if there is none for these axes.
fn fitted_lens(samples: &[Sample], axes: CloudAxes) -> Option<Pinhole> {
    let mut across = Line::default();
    let mut down = Line::default();
    let mut in_front = 0;
    for ([column, row], point) in samples {
        let [x, y, ahead_m] = axes.optical(*point);
        if ahead_m > 0.0 {
            in_front += 1;
            across.add(x / ahead_m, *column);
            down.add(y / ahead_m, *row);
        }
    }
    if (f64::from(in_front)) < IN_FRONT * samples.len() as f64 {
        return None;
    }
    let [cx, fx] = across.fit()?;
    let [cy, fy] = down.fit()?;
    (fx > 0.0 && fy > 0.0).then_some(Pinhole { fx, fy, cx, cy, distortion: Distortion::None })
}

/// Straight line through pairs of numbers, fitted by least squares.
#[derive(Default)]
struct Line {
    count: f64,
    x: f64,
    y: f64,
    xx: f64,
    xy: f64,
    yy: f64,
}

impl Line {
    fn add(&mut self, x: f64, y: f64) {
        self.count += 1.0;
        self.x += x;
        self.y += y;
        self.xx += x * x;
        self.xy += x * y;
        self.yy += y * y;
    }

    /// Returns the value at 0 and the slope; `None` if the pairs do not determine a line.
    fn fit(&self) -> Option<[f64; 2]> {
        let mean_x = self.x / self.count;
        let mean_y = self.y / self.count;
        let spread = self.xx / self.count - mean_x * mean_x;
        let common = self.xy / self.count - mean_x * mean_y;
        let slope = common / spread;
        let square = self.yy / self.count - mean_y * mean_y - slope * common;
        let is_line = slope.is_finite() && square <= MAX_ERROR_PX * MAX_ERROR_PX;
        is_line.then_some([mean_y - slope * mean_x, slope])
    }
}

/// Points of a cloud with a checked layout.
struct Points<'a> {
    data: &'a [u8],
    width: usize,
    height: usize,
    row_step: usize,
    point_step: usize,
    /// Offsets of x, y and z in a point, bytes.
    offsets: [usize; 3],
    is_big_endian: bool,
}

impl<'a> Points<'a> {
    fn new(cloud: &'a PointCloud2<'_>, limits: &Limits) -> Result<Self, ImageError> {
        if cloud.height == 1 {
            return Err(ImageError::Cloud(
                "its points are in one row (height 1), not in the rows and columns of an image: \
                 record the depth images, or let the driver publish ordered points"
                    .into(),
            ));
        }
        check_size(cloud.width.into(), cloud.height.into(), cloud.point_step.into(), limits)?;
        Self::unordered(cloud, limits)
    }

    /// Checks the layout of an organised or unorganised cloud.
    fn unordered(cloud: &'a PointCloud2<'_>, limits: &Limits) -> Result<Self, ImageError> {
        if cloud.data.len() as u64 > limits.image_bytes {
            let width = cloud.width.into();
            return Err(ImageError::TooLarge { width, height: cloud.height.into() });
        }
        let point_step = cloud.point_step as usize;
        let row_step = cloud.row_step as usize;
        let width = cloud.width as usize;
        let height = cloud.height as usize;
        let mut offsets = [0; 3];
        for (offset, name) in offsets.iter_mut().zip(["x", "y", "z"]) {
            *offset = offset_of(cloud, name)?;
        }
        let row_bytes = point_step as u64 * width as u64;
        let expected = row_step as u64 * height as u64;
        if (row_step as u64) < row_bytes || cloud.data.len() as u64 != expected {
            return Err(ImageError::Layout(format!(
                "{} bytes of data, rows of {row_step} bytes and points of {point_step} do not make \
                 {width}x{height} points",
                cloud.data.len()
            )));
        }
        let is_big_endian = cloud.is_bigendian;
        let data = &*cloud.data;
        Ok(Self { data, width, height, row_step, point_step, offsets, is_big_endian })
    }

    fn at(&self, column: usize, row: usize) -> [f32; 3] {
        let start = row * self.row_step + column * self.point_step;
        self.offsets.map(|offset| {
            let bytes = self.data[start + offset..].first_chunk::<4>().copied();
            let bytes = bytes.unwrap_or(f32::NAN.to_le_bytes());
            if self.is_big_endian { f32::from_be_bytes(bytes) } else { f32::from_le_bytes(bytes) }
        })
    }
}

fn offset_of(cloud: &PointCloud2<'_>, name: &str) -> Result<usize, ImageError> {
    let field = cloud.fields.iter().find(|field| field.name == name);
    let field = field.filter(|field| field.datatype == PointField::FLOAT32);
    let Some(field) = field else {
        let message = format!("its points have no field `{name}` of type FLOAT32");
        return Err(ImageError::Cloud(message));
    };
    let end = u64::from(field.offset) + 4;
    if end > cloud.point_step.into() {
        return Err(ImageError::Layout(format!(
            "field `{name}` ends at byte {end} of points of {} bytes",
            cloud.point_step
        )));
    }
    Ok(field.offset as usize)
}

#[cfg(test)]
mod tests {
    use std::borrow::Cow;

    use proptest::prelude::*;

    use super::*;

    const LENS: Pinhole =
        Pinhole { fx: 60.0, fy: 62.0, cx: 20.3, cy: 14.1, distortion: Distortion::None };

    /// A wall that is not parallel to the image, with a dark pixel; a colour behind each point.
    fn cloud(axes: CloudAxes, is_bigendian: bool) -> PointCloud2<'static> {
        let mut data = Vec::new();
        for row in 0..30 {
            for column in 0..40 {
                let ahead = 2.0 + 0.02 * f64::from(column) + 0.01 * f64::from(row);
                let x = (f64::from(column) - LENS.cx) / LENS.fx * ahead;
                let y = (f64::from(row) - LENS.cy) / LENS.fy * ahead;
                let point = match axes {
                    CloudAxes::Optical => [x, y, ahead],
                    CloudAxes::Body => [ahead, -x, -y],
                };
                let is_dark = (column, row) == (3, 2);
                for value in point {
                    let value = if is_dark { f32::NAN } else { value as f32 };
                    let bytes =
                        if is_bigendian { value.to_be_bytes() } else { value.to_le_bytes() };
                    data.extend(bytes);
                }
                data.extend([7; 4]);
            }
            // Rows may be padded.
            data.extend([0; 5]);
        }
        let fields = [("x", 0), ("y", 4), ("z", 8), ("rgb", 12)];
        PointCloud2 {
            height: 30,
            width: 40,
            fields: fields.map(|(name, offset)| PointField::float32(name, offset)).to_vec(),
            is_bigendian,
            point_step: 16,
            row_step: 16 * 40 + 5,
            data: Cow::Owned(data),
            ..PointCloud2::default()
        }
    }

    #[test]
    fn points_in_rows_and_columns_are_depth_with_their_own_lens() {
        for axes in [CloudAxes::Optical, CloudAxes::Body] {
            for is_bigendian in [false, true] {
                let cloud = cloud(axes, is_bigendian);
                let camera = camera_of_cloud(&cloud, &Limits::default()).unwrap().unwrap();
                assert_eq!(camera.axes, axes);
                for (found, right) in [
                    (camera.lens.fx, LENS.fx),
                    (camera.lens.fy, LENS.fy),
                    (camera.lens.cx, LENS.cx),
                    (camera.lens.cy, LENS.cy),
                ] {
                    assert!((found - right).abs() < 1e-3, "{camera:?}");
                }
                let depth = decode_cloud(&cloud, axes, &Limits::default()).unwrap();
                assert_eq!((depth.width(), depth.height()), (40, 30));
                assert!(depth.row(2)[3].is_nan());
                assert!((f64::from(depth.row(10)[20]) - 2.5).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn what_is_no_image_is_refused_with_the_reason() {
        fn refused(change: fn(&mut PointCloud2<'static>), word: &str) {
            let mut cloud = cloud(CloudAxes::Optical, false);
            change(&mut cloud);
            let error = camera_of_cloud(&cloud, &Limits::default()).unwrap_err().to_string();
            assert!(error.contains(word), "{word}: {error}");
            assert!(
                size_of_cloud(&cloud, &Limits::default()).is_err() || word == "lidar",
                "{word}"
            );
        }

        refused(|cloud| (cloud.width, cloud.height) = (1200, 1), "height 1");
        refused(|cloud| cloud.fields[1].name = "Y".into(), "`y`");
        refused(|cloud| cloud.fields[2].datatype = 8, "`z`");
        refused(|cloud| cloud.fields[2].offset = u32::MAX, "ends at byte");
        refused(|cloud| cloud.data.to_mut().truncate(999), "999 bytes");
        refused(|cloud| cloud.row_step = 3, "rows of 3 bytes");
        refused(|cloud| (cloud.width, cloud.height) = (u32::MAX, u32::MAX), "exceed");
        refused(|cloud| cloud.point_step = 0, "points of 0");
        // Columns that are angles.
        refused(
            |cloud| {
                for (number, point) in cloud.data.to_mut().chunks_mut(16).take(1100).enumerate() {
                    let angle = 0.15 * (number % 40) as f32;
                    point[..4].copy_from_slice(&(3.0 * angle.sin()).to_le_bytes());
                    point[8..12].copy_from_slice(&(3.0 * angle.cos()).to_le_bytes());
                }
            },
            "lidar",
        );
    }

    proptest! {
        /// Any layout is read or refused.
        #[test]
        fn damaged_clouds_never_panic(
            size in prop::array::uniform4(prop_oneof![0..40_u32, any::<u32>()]),
            offsets in prop::array::uniform3(prop_oneof![0..20_u32, any::<u32>()]),
            length in 0..9000_usize, value in any::<u32>(), is_bigendian: bool,
        ) {
            let mut cloud = cloud(CloudAxes::Optical, is_bigendian);
            [cloud.width, cloud.height, cloud.point_step, cloud.row_step] = size;
            for (field, offset) in cloud.fields.iter_mut().zip(offsets) {
                field.offset = offset;
            }
            let values = value.to_le_bytes().into_iter().cycle();
            cloud.data = Cow::Owned(values.take(length).collect());
            let limits = Limits::default();
            let _ = camera_of_cloud(&cloud, &limits);
            let _ = decode_cloud(&cloud, CloudAxes::Body, &limits);
            let _ = points_of_cloud(&cloud, &limits);
            // And with a layout that fits the data.
            [cloud.width, cloud.height] = [size[0] % 30, size[1] % 30];
            cloud.point_step = 12;
            cloud.row_step = 12 * cloud.width;
            for (field, offset) in cloud.fields.iter_mut().zip([0, 4, 8]) {
                field.offset = offset;
            }
            let bytes = (cloud.row_step * cloud.height) as usize;
            cloud.data.to_mut().resize(bytes, 0);
            let read = decode_cloud(&cloud, CloudAxes::Optical, &limits);
            prop_assert_eq!(read.is_ok(), cloud.width > 0 && cloud.height > 1, "{:?}", read);
        }
    }

    #[test]
    fn a_dark_cloud_tells_no_camera() {
        let mut cloud = cloud(CloudAxes::Optical, false);
        cloud.data.to_mut().fill(0);
        assert_eq!(camera_of_cloud(&cloud, &Limits::default()), Ok(None));
        let depth = decode_cloud(&cloud, CloudAxes::Optical, &Limits::default()).unwrap();
        assert!(depth.pixels().iter().all(|metres| metres.is_nan()));
    }
}
