//! Conversion of numpy arrays: images, poses and points.

use std::sync::Arc;

use nalgebra::{
    Isometry2, Isometry3, Matrix3, Matrix4, Point3, Rotation3, UnitQuaternion, Vector2,
};
use numpy::{
    PyArray2, PyArray3, PyArrayDescrMethods as _, PyArrayMethods as _, PyReadonlyArray2,
    PyReadonlyArray3, PyUntypedArray, PyUntypedArrayMethods as _, ToPyArray as _,
};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use tagalong::core::{DepthImage, ExternalDetection, GreyImage, Images, RgbImage, planar_pose};
use tagalong::geometry::Rect;

use crate::errors::wrong;

/// Maximum side of an image, pixels, as in logs.
const MAX_SIDE: usize = 16_384;
/// Maximum error of a rotation matrix: elements of `R R' - I`.
const ROTATION_TOLERANCE: f64 = 1e-3;

/// Adds a colour image of rows x columns x 3, or a grey one of rows x columns, to the images of a
/// frame.
///
/// # Errors
/// `TypeError` for another type than uint8, `ValueError` for another shape.
pub fn add_colour(images: &mut Images, array: &Bound<'_, PyAny>) -> PyResult<()> {
    let shape = shape_of(array, "colour")?;
    match shape[..] {
        [_, _, 3] => images.colour = Some(Arc::new(rgb(array)?)),
        [_, _] => images.grey = Some(Arc::new(grey(array, "colour")?)),
        _ => {
            return Err(wrong(format!(
                "colour has shape {shape:?}; give rows x columns x 3 (red, green, blue), or rows x \
                 columns for grey"
            )));
        }
    }
    Ok(())
}

fn rgb(array: &Bound<'_, PyAny>) -> PyResult<RgbImage> {
    let pixels: PyReadonlyArray3<'_, u8> =
        array.extract().map_err(|_| odd(array, "colour", "uint8"))?;
    let (height, width) = sides(pixels.shape(), "colour")?;
    let view = pixels.as_array();
    let packed = match view.as_slice() {
        Some(bytes) => bytes.as_chunks().0.to_vec(),
        // A cropped or flipped image is copied row by row.
        None => view.rows().into_iter().map(|p| [p[0], p[1], p[2]]).collect(),
    };
    RgbImage::from_pixels(width, height, packed).ok_or_else(|| wrong("colour has a wrong size"))
}

/// Returns a grey image.
pub fn grey(array: &Bound<'_, PyAny>, name: &str) -> PyResult<GreyImage> {
    let pixels: PyReadonlyArray2<'_, u8> =
        array.extract().map_err(|_| odd(array, name, "uint8"))?;
    let (height, width) = sides(pixels.shape(), name)?;
    let packed = pixels.as_array().iter().copied().collect();
    GreyImage::from_pixels(width, height, packed)
        .ok_or_else(|| wrong(format!("{name} has a wrong size")))
}

/// Returns a depth image: float32 or float64 in metres, or uint16 in millimetres. Values that are
/// not finite or not above 0, and 65535, mean that there is no reading.
pub fn depth(array: &Bound<'_, PyAny>) -> PyResult<DepthImage> {
    let shape = shape_of(array, "depth")?;
    if shape.len() != 2 {
        return Err(wrong(format!("depth has shape {shape:?}; give rows x columns")));
    }
    let (height, width) = sides(&shape, "depth")?;
    let image = if let Ok(pixels) = array.extract::<PyReadonlyArray2<'_, f32>>() {
        let packed = pixels.as_array().iter().map(|value| of_metres(*value)).collect();
        DepthImage::from_pixels(width, height, packed)
    } else if let Ok(pixels) = array.extract::<PyReadonlyArray2<'_, u16>>() {
        let view = pixels.as_array();
        match view.as_slice() {
            Some(packed) => DepthImage::from_millimetres(width, height, packed),
            // A cropped or flipped image is copied row by row.
            None => {
                let packed: Vec<u16> = view.iter().copied().collect();
                DepthImage::from_millimetres(width, height, &packed)
            }
        }
    } else if let Ok(pixels) = array.extract::<PyReadonlyArray2<'_, f64>>() {
        let packed = pixels.as_array().iter().map(|value| of_metres(*value as f32)).collect();
        DepthImage::from_pixels(width, height, packed)
    } else {
        return Err(odd(array, "depth", "float32 (metres) or uint16 (millimetres)"));
    };
    image.ok_or_else(|| wrong("depth has a wrong size"))
}

/// Returns a depth in metres; NaN if it is not a reading.
fn of_metres(value: f32) -> f32 {
    if DepthImage::is_reading(value) { value } else { f32::NAN }
}

fn shape_of(array: &Bound<'_, PyAny>, name: &str) -> PyResult<Vec<usize>> {
    let array = array.cast::<PyUntypedArray>().map_err(|_| {
        let kind = array.get_type();
        PyTypeError::new_err(format!("{name} is a {kind}, not a numpy array"))
    })?;
    Ok(array.shape().to_vec())
}

fn sides(shape: &[usize], name: &str) -> PyResult<(usize, usize)> {
    let height = shape[0];
    let width = shape[1];
    if [height, width].iter().any(|side| *side == 0 || *side > MAX_SIDE) {
        return Err(wrong(format!(
            "{name} has {width} x {height} pixels; a side has 1 to {MAX_SIDE}"
        )));
    }
    Ok((height, width))
}

/// Returns the exception for an array of another type.
fn odd(array: &Bound<'_, PyAny>, name: &str, wanted: &str) -> PyErr {
    let kind = match array.cast::<PyUntypedArray>() {
        Ok(array) => array.dtype().typeobj().to_string(),
        Err(_) => array.get_type().to_string(),
    };
    PyTypeError::new_err(format!("{name} is an array of {kind}; give {wanted}"))
}

/// Returns the points of a laser scan: rows of x, y (m, robot frame), or of x, y, z.
///
/// # Errors
/// As for [`add_colour`], and numbers that are not finite.
pub fn points(array: &Bound<'_, PyAny>) -> PyResult<Vec<Point3<f64>>> {
    let shape = shape_of(array, "scan")?;
    let rows: PyReadonlyArray2<'_, f64> =
        array.extract().map_err(|_| odd(array, "scan", "float64"))?;
    if !matches!(shape[..], [_, 2 | 3]) {
        return Err(wrong(format!("scan has shape {shape:?}; give rows of x, y or of x, y, z")));
    }
    let view = rows.as_array();
    let points = view.rows().into_iter();
    let points: Vec<_> =
        points.map(|p| Point3::new(p[0], p[1], p.get(2).copied().unwrap_or(0.0))).collect();
    if points.iter().any(|point| point.iter().any(|value| !value.is_finite())) {
        return Err(wrong("scan has numbers that are not finite; leave those rays out"));
    }
    Ok(points)
}

/// Returns the detections of the caller: rows of x, y, width, height, score (a box, pixels), or of x, y,
/// z, score (the centre of a head in the robot frame, m).
///
/// # Errors
/// `ValueError` for other rows, a box without an area, and numbers that are not finite.
pub fn detections(given: &Bound<'_, PyAny>) -> PyResult<Vec<ExternalDetection>> {
    let rows: Vec<Vec<f64>> = given.extract().map_err(|_| wrong(ROWS))?;
    rows.iter().map(|row| detection(row)).collect()
}

/// Message about detections of another shape.
const ROWS: &str = "detections are rows of x, y, width, height, score (a box in the image, pixels), or of \
                    x, y, z, score (the centre of the head in the robot frame, m)";

fn detection(row: &[f64]) -> PyResult<ExternalDetection> {
    if row.iter().any(|value| !value.is_finite()) {
        return Err(wrong("detections have numbers that are not finite"));
    }
    match *row {
        [x, y, width, height, score] if width > 0.0 && height > 0.0 => {
            Ok(ExternalDetection::in_image(Rect::new(x, y, width, height), score))
        }
        [_, _, width, height, _] => {
            Err(wrong(format!("a detection is {width} x {height} pixels; both must be above 0")))
        }
        [x, y, z, score] => Ok(ExternalDetection::at(Point3::new(x, y, z), score)),
        _ => Err(wrong(ROWS)),
    }
}

/// Returns a pose on the floor: x, y (m) and heading (rad), or a 4 x 4 matrix.
///
/// # Errors
/// `ValueError` for anything else, and for numbers that are not finite.
pub fn pose(given: &Bound<'_, PyAny>) -> PyResult<Isometry2<f64>> {
    if let Ok([x, y, heading]) = given.extract::<[f64; 3]>() {
        if [x, y, heading].iter().all(|value| value.is_finite()) {
            return Ok(Isometry2::new(Vector2::new(x, y), heading));
        }
        return Err(wrong("pose has numbers that are not finite"));
    }
    Ok(planar_pose(&isometry(given, "pose")?))
}

/// Returns a 3D pose from a 4 x 4 matrix.
///
/// # Errors
/// `ValueError` for another shape, and for a matrix that is not a rigid motion.
pub fn isometry(given: &Bound<'_, PyAny>, name: &str) -> PyResult<Isometry3<f64>> {
    let rows: [[f64; 4]; 4] = given.extract().map_err(|_| {
        wrong(format!("{name} is neither a 4 x 4 matrix nor, of the robot, (x, y, heading)"))
    })?;
    let matrix = Matrix4::from_fn(|row, column| rows[row][column]);
    let rotation: Matrix3<f64> = matrix.fixed_view::<3, 3>(0, 0).into_owned();
    let error = (rotation * rotation.transpose() - Matrix3::identity()).amax();
    let last = rows[3] == [0.0, 0.0, 0.0, 1.0];
    let is_rigid = error <= ROTATION_TOLERANCE && rotation.determinant() > 0.0 && last;
    let at = matrix.fixed_view::<3, 1>(0, 3).into_owned();
    if !(is_rigid && at.iter().all(|value| value.is_finite())) {
        return Err(wrong(format!(
            "{name} is no rigid motion: rotation and translation of finite numbers"
        )));
    }
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix(&rotation));
    Ok(Isometry3::from_parts(at.into(), rotation))
}

/// Returns a pose as a 4 x 4 array.
pub fn of_isometry<'py>(py: Python<'py>, pose: &Isometry3<f64>) -> Bound<'py, PyArray2<f64>> {
    let matrix = pose.to_homogeneous();
    PyArray2::from_owned_array(py, numpy::ndarray::Array2::from_shape_fn((4, 4), |at| matrix[at]))
}

/// Returns a colour image as rows x columns x 3.
pub fn of_rgb<'py>(py: Python<'py>, image: &RgbImage) -> PyResult<Bound<'py, PyArray3<u8>>> {
    let flat = image.pixels().as_flattened().to_pyarray(py);
    flat.reshape([image.height(), image.width(), 3])
}

/// Returns an image of one channel as rows x columns.
pub fn of_plane<'py, T: numpy::Element + Copy>(
    py: Python<'py>,
    image: &tagalong::core::Image<T>,
) -> PyResult<Bound<'py, PyArray2<T>>> {
    image.pixels().to_pyarray(py).reshape([image.height(), image.width()])
}
