//! Points and voxels of a camera in lanes, so that one instruction processes several of them.
//!
//! Loops over lanes have one body without branches, which the compiler turns into vector
//! instructions. Each lane does the same operations in the same order as [`Camera`] does for one
//! point, so the result has the same bits.

use nalgebra::{Matrix3, Point2, Vector3};
use tagalong_geometry::{Camera, Distortion, Lens, Pinhole};

/// Numbers side by side: two vectors of AVX-512, four of AVX2.
pub(crate) const LANES: usize = 16;

/// A number for each lane.
pub(crate) type Lanes = [f64; LANES];

/// No number of a cell or of a pixel.
pub(crate) const NONE: u64 = u64::MAX;

/// Points of neighbouring pixels in the robot frame, m.
pub(crate) struct Points {
    pub(crate) x: Lanes,
    pub(crate) y: Lanes,
    pub(crate) z: Lanes,
    /// Area that each pixel covers, m².
    pub(crate) area_m2: Lanes,
}

/// Viewing rays of neighbouring pixels in the camera frame.
struct Rays {
    x: Lanes,
    y: Lanes,
    z: Lanes,
}

/// Pixels in which neighbouring voxels lie.
pub(crate) struct VoxelPixels {
    /// Number of the pixel in row order, or [`NONE`].
    pub(crate) pixel: [u64; LANES],
    /// Depth of the voxel, m.
    pub(crate) depth_m: Lanes,
}

/// A camera, ready for many pixels.
pub(crate) struct PixelRays<'a> {
    camera: &'a Camera,
    turn: Matrix3<f64>,
    origin: Vector3<f64>,
    /// The lens, if its rays are straight lines of column and row.
    straight: Option<Pinhole>,
}

impl<'a> PixelRays<'a> {
    pub(crate) fn new(camera: &'a Camera) -> Self {
        let pose = camera.robot_from_camera;
        Self {
            camera,
            turn: pose.rotation.to_rotation_matrix().into_inner(),
            origin: pose.translation.vector,
            straight: straight_lens(camera),
        }
    }

    /// Returns the points of pixels of a row with these depths, m, from a column on; NaN for those
    /// whose depth is.
    #[inline(always)]
    pub(crate) fn points(&self, [column, row]: [usize; 2], depth_m: &Lanes) -> Points {
        let mut rays = Rays { x: [0.0; LANES], y: [0.0; LANES], z: [1.0; LANES] };
        if let Some(lens) = &self.straight {
            let first = column as f64;
            let y = (row as f64 - lens.cy) / lens.fy;
            for lane in 0..LANES {
                // Columns are whole numbers, so that this is exact.
                rays.x[lane] = (first + lane as f64 - lens.cx) / lens.fx;
                rays.y[lane] = y;
            }
        } else {
            // Rays of bent lenses take long, so only those with a reading are computed.
            for lane in (0..LANES).filter(|lane| !depth_m[*lane].is_nan()) {
                let pixel = Point2::new((column + lane) as f64, row as f64);
                let ray = self.camera.ray(pixel);
                (rays.x[lane], rays.y[lane], rays.z[lane]) = (ray.x, ray.y, ray.z);
            }
        }
        let mut points =
            Points { x: [0.0; LANES], y: [0.0; LANES], z: [0.0; LANES], area_m2: [0.0; LANES] };
        let m = &self.turn;
        let focal_px = self.camera.focal_px();
        for (lane, depth_m) in depth_m.iter().enumerate() {
            let [x, y, z] = [rays.x[lane], rays.y[lane], rays.z[lane]];
            points.x[lane] = (m.m11 * x + m.m12 * y + m.m13 * z) * depth_m + self.origin.x;
            points.y[lane] = (m.m21 * x + m.m22 * y + m.m23 * z) * depth_m + self.origin.y;
            points.z[lane] = (m.m31 * x + m.m32 * y + m.m33 * z) * depth_m + self.origin.z;
            let side_m = depth_m / focal_px;
            points.area_m2[lane] = side_m * side_m;
        }
        points
    }
}

/// Returns the lens of a camera that bends no lines.
fn straight_lens(camera: &Camera) -> Option<Pinhole> {
    match &camera.lens {
        Lens::Pinhole(lens) if lens.distortion == Distortion::None => Some(*lens),
        _ => None,
    }
}

/// A camera without distortion, ready for many points in the robot frame.
pub(crate) struct Projector {
    lens: Pinhole,
    width: f64,
    height: f64,
    origin: Vector3<f64>,
    /// Vector and scalar part of the quaternion from the robot's axes to the camera's.
    turn: Vector3<f64>,
    scalar: f64,
}

impl Projector {
    /// Creates a projector for depth images of a size; `None` for a camera that bends lines.
    pub(crate) fn new(camera: &Camera, [width, height]: [usize; 2]) -> Option<Self> {
        let turn = camera.robot_from_camera.rotation.inverse();
        Some(Self {
            lens: straight_lens(camera)?,
            width: width as f64,
            height: height as f64,
            origin: camera.robot_from_camera.translation.vector,
            turn: Vector3::new(turn.i, turn.j, turn.k),
            scalar: turn.w,
        })
    }

    /// Returns the pixels of points that share all coordinates but y.
    #[inline(always)]
    pub(crate) fn pixels(&self, x: f64, y: &Lanes, z: f64) -> VoxelPixels {
        let mut found = VoxelPixels { pixel: [NONE; LANES], depth_m: [0.0; LANES] };
        for (lane, y) in y.iter().enumerate() {
            let point = self.in_camera(&Vector3::new(
                x - self.origin.x,
                y - self.origin.y,
                z - self.origin.z,
            ));
            let column = (self.lens.fx * (point.x / point.z) + self.lens.cx).round();
            let row = (self.lens.fy * (point.y / point.z) + self.lens.cy).round();
            // As `Camera::project`, which has no pixel for a point in the plane of the lens.
            let is_inside = (point.z > 1e-6)
                & (column >= 0.0)
                & (column < self.width)
                & (row >= 0.0)
                & (row < self.height);
            let pixel = whole(row * self.width + column);
            found.pixel[lane] = if is_inside { pixel } else { NONE };
            found.depth_m[lane] = point.z;
        }
        found
    }

    /// Turns a vector into the camera's axes, in the order of operations of `nalgebra`.
    #[inline(always)]
    fn in_camera(&self, v: &Vector3<f64>) -> Vector3<f64> {
        let q = &self.turn;
        let t = cross(q, v);
        let t = Vector3::new(t.x * 2.0, t.y * 2.0, t.z * 2.0);
        let across = cross(q, &t);
        Vector3::new(
            t.x * self.scalar + across.x + v.x,
            t.y * self.scalar + across.y + v.y,
            t.z * self.scalar + across.z + v.z,
        )
    }
}

#[inline(always)]
fn cross(a: &Vector3<f64>, b: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)
}

/// Returns a whole number from 0 to below 2^32 as such. A cast that checks for others would keep a
/// loop from becoming vector instructions.
#[inline(always)]
pub(crate) fn whole(number: f64) -> u64 {
    // From this power of two on, the last bits of the float are the integer itself.
    const WHOLE: f64 = 4_503_599_627_370_496.0;
    (number + WHOLE).to_bits() & u64::from(u32::MAX)
}

/// Returns the part of a row from a column on in metres, and NaN beyond its end and where there is no
/// reading farther than `nearest_m`.
#[inline(always)]
pub(crate) fn readings(row: &[f32], nearest_m: f32) -> Lanes {
    let mut readings = [f64::NAN; LANES];
    for (reading, depth_m) in readings.iter_mut().zip(row) {
        *reading = if *depth_m > nearest_m { f64::from(*depth_m) } else { f64::NAN };
    }
    readings
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Point3};
    use proptest::prelude::*;

    use super::*;

    fn camera(turn: [f64; 3], at: [f64; 3], distortion: Distortion) -> Camera {
        let lens = Pinhole { fx: 61.3, fy: 60.7, cx: 39.2, cy: 29.9, distortion };
        let level = Camera::mounted(lens, 80, 60, 1.1, 0.2, 0.05);
        let pose = Isometry3::new(at.into(), turn.into());
        Camera { robot_from_camera: pose * level.robot_from_camera, ..level }
    }

    proptest! {
        #[test]
        fn lanes_have_the_bits_of_the_camera(
            turn in prop::array::uniform3(-0.6..0.6f64),
            at in prop::array::uniform3(-1.0..1.0f64),
            depth_m in prop::array::uniform16(0.2..8.0f64),
            y in prop::array::uniform16(-3.0..3.0f64),
            column in 0..64usize, row in 0..60usize, x in 0.2..6.0f64, z in 0.0..2.0f64,
            is_bent: bool,
        ) {
            let bent = Distortion::PlumbBob([0.1, -0.05, 0.001, -0.002, 0.01]);
            let camera = camera(turn, at, if is_bent { bent } else { Distortion::None });
            let points = PixelRays::new(&camera).points([column, row], &depth_m);
            let pose = camera.robot_from_camera;
            for (lane, depth_m) in depth_m.into_iter().enumerate() {
                let ray = camera.ray(Point2::new((column + lane) as f64, row as f64));
                let turn = pose.rotation.to_rotation_matrix();
                let point = turn * ray * depth_m + pose.translation.vector;
                prop_assert_eq!([points.x[lane], points.y[lane], points.z[lane]], [point.x, point.y, point.z]);
                prop_assert_eq!(points.area_m2[lane], (depth_m / camera.focal_px()).powi(2));
            }
            let projector = Projector::new(&camera, [80, 60]);
            prop_assert_eq!(projector.is_none(), is_bent);
            let Some(projector) = projector else { return Ok(()) };
            let found = projector.pixels(x, &y, z);
            for lane in 0..LANES {
                let point = Point3::new(x, y[lane], z);
                let at = camera.project(&point).map(|at| [at.x.round() as i64, at.y.round() as i64]);
                let inside = at.filter(|[x, y]| (0..80).contains(x) && (0..60).contains(y));
                let pixel = inside.map_or(NONE, |[x, y]| (y * 80 + x) as u64);
                prop_assert_eq!(found.pixel[lane], pixel);
                prop_assert_eq!(found.depth_m[lane], camera.depth_of(&point));
            }
        }
    }

    #[test]
    fn a_row_ends_and_a_near_reading_is_none() {
        let read = readings(&[1.5, 0.05, f32::NAN], 0.1);
        assert_eq!(read[0], 1.5);
        assert!(read[1..].iter().all(|depth_m| depth_m.is_nan()));
    }
}
