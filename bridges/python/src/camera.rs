//! Cameras.

use std::sync::Arc;

use numpy::PyArray2;
use pyo3::prelude::*;
use tagalong::geometry::{Camera, Distortion, Lens, Pinhole};

use crate::arrays;
use crate::errors::wrong;

/// A pinhole camera: its image, its lens and its pose on the robot.
///
/// width, height: pixels. fx, fy, cx, cy: pixels; (0, 0) is the centre of the upper left pixel.
/// distortion: the coefficients of OpenCV for `model`, one of "plumb_bob",
/// "rational_polynomial", "equidistant". The pose is either `height_m` above the floor with
/// `pitch_down_deg` and `roll_deg`, looking forward, or `robot_from_camera`, 4 x 4: x right, y down,
/// z forward of the camera in the robot's frame (x forward, y left, z up from the floor).
#[pyclass(name = "Camera", module = "tagalong", frozen, eq, from_py_object)]
#[derive(Clone, PartialEq)]
pub struct PyCamera(pub Arc<Camera>);

#[pymethods]
impl PyCamera {
    #[new]
    #[pyo3(signature = (width, height, *, fx, fy=None, cx=None, cy=None, distortion=None,
        model="plumb_bob", height_m=None, pitch_down_deg=0.0, roll_deg=0.0,
        robot_from_camera=None))]
    #[allow(clippy::too_many_arguments, reason = "they are the keywords of a Python constructor")]
    fn new(
        width: usize,
        height: usize,
        fx: f64,
        fy: Option<f64>,
        cx: Option<f64>,
        cy: Option<f64>,
        distortion: Option<Vec<f64>>,
        model: &str,
        height_m: Option<f64>,
        pitch_down_deg: f64,
        roll_deg: f64,
        robot_from_camera: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let distortion = distorted(model, &distortion.unwrap_or_default())?;
        let lens = Pinhole {
            fx,
            fy: fy.unwrap_or(fx),
            cx: cx.unwrap_or(0.5 * (width as f64 - 1.0)),
            cy: cy.unwrap_or(0.5 * (height as f64 - 1.0)),
            distortion,
        };
        check(width, height, &lens)?;
        let camera = match (height_m, robot_from_camera) {
            (Some(at), None) => mounted(lens, width, height, [at, pitch_down_deg, roll_deg])?,
            (None, Some(pose)) => {
                let pose = arrays::isometry(pose, "robot_from_camera")?;
                Camera { lens: Lens::Pinhole(lens), width, height, robot_from_camera: pose }
            }
            _ => {
                return Err(wrong(
                    "the camera's pose is missing, or given twice: height_m= (with pitch_down_deg= \
                     and roll_deg=), or robot_from_camera=",
                ));
            }
        };
        Ok(Self(Arc::new(camera)))
    }

    /// Columns of the image.
    #[getter]
    fn width(&self) -> usize {
        self.0.width
    }

    /// Rows of the image.
    #[getter]
    fn height(&self) -> usize {
        self.0.height
    }

    /// Focal length along columns, pixels; for a panorama pixels per radian.
    #[getter]
    fn focal_px(&self) -> f64 {
        self.0.focal_px()
    }

    /// Pose of the camera in the robot frame, 4 x 4.
    #[getter]
    fn robot_from_camera<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        arrays::of_isometry(py, &self.0.robot_from_camera)
    }

    /// Pixel (column, row) of a point in the robot frame, m; None behind the camera.
    fn project(&self, point: [f64; 3]) -> Option<(f64, f64)> {
        self.0.project(&point.into()).map(|pixel| (pixel.x, pixel.y))
    }

    fn __repr__(&self) -> String {
        let Camera { width, height, robot_from_camera, .. } = &*self.0;
        let at = robot_from_camera.translation.vector;
        let focal = self.0.focal_px();
        format!("Camera({width} x {height}, focal {focal:.1} px, {:.3} m high)", at.z)
    }
}

fn check(width: usize, height: usize, lens: &Pinhole) -> PyResult<()> {
    if width == 0 || height == 0 {
        return Err(wrong(format!("the image has {width} x {height} pixels")));
    }
    // Far beyond any lens; a larger number must be in other units.
    let longest = 1e3 * width.max(height) as f64;
    for (name, focal) in [("fx", lens.fx), ("fy", lens.fy)] {
        if !(focal > 0.0 && focal <= longest) {
            return Err(wrong(format!(
                "{name} is {focal}; it must be above 0 and at most {longest} pixels"
            )));
        }
    }
    for (name, centre, side) in [("cx", lens.cx, width), ("cy", lens.cy, height)] {
        if !(centre >= 0.0 && centre <= side as f64) {
            return Err(wrong(format!(
                "{name} is {centre}; it must be within the image, 0 to {side}"
            )));
        }
    }
    Ok(())
}

fn mounted(lens: Pinhole, width: usize, height: usize, mount: [f64; 3]) -> PyResult<Camera> {
    let [height_m, pitch, roll] = mount;
    let is_possible =
        height_m > 0.0 && height_m < 100.0 && pitch.abs() <= 180.0 && roll.abs() <= 180.0;
    if !is_possible {
        return Err(wrong(
            "height_m must be above 0 and below 100, pitch_down_deg and roll_deg within 180 degrees",
        ));
    }
    Ok(Camera::mounted(lens, width, height, height_m, pitch.to_radians(), roll.to_radians()))
}

fn distorted(model: &str, given: &[f64]) -> PyResult<Distortion> {
    if given.iter().any(|value| !value.is_finite()) {
        return Err(wrong("distortion has numbers that are not finite"));
    }
    if given.iter().all(|value| *value == 0.0) {
        return Ok(Distortion::None);
    }
    let (distortion, most) = match model {
        "plumb_bob" => (Distortion::PlumbBob(padded(given)), 5),
        "rational_polynomial" => (Distortion::Rational(padded(given)), 14),
        "equidistant" => (Distortion::Equidistant(padded(given)), 4),
        _ => {
            return Err(wrong(format!(
                "no distortion model `{model}`; there are plumb_bob, rational_polynomial, equidistant"
            )));
        }
    };
    if given.len() > most {
        return Err(wrong(format!("{model} has at most {most} coefficients, not {}", given.len())));
    }
    Ok(distortion)
}

fn padded<const N: usize>(given: &[f64]) -> [f64; N] {
    std::array::from_fn(|at| given.get(at).copied().unwrap_or(0.0))
}
