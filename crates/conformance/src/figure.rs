//! Simulated scenes: people made of ellipsoids on a floor in front of a wall, ray cast into the
//! depth and the colour image of a camera, and into the scan of a laser at the height of their legs.
//!
//! The proportions are those of the head-and-shoulder template measured by Jafari et al. (ICRA
//! 2014).

use std::sync::Arc;

use nalgebra::{Isometry3, Point2, Point3, Rotation3, Vector3};
use tagalong_core::{DepthImage, Images, LaserScan, RgbImage};
use tagalong_geometry::Camera;
use tagalong_math::{RandomSource, SplitMix64};

/// Height of the laser scanner above the floor, m: that of the shins.
pub const SCANNER_HEIGHT_M: f64 = 0.3;
/// Range of the laser scanner, m.
pub const SCANNER_RANGE_M: f64 = 10.0;
/// Number of rays of a scan: one for each quarter of a degree.
const RAYS: u32 = 721;
/// Standard deviation of a range, m.
const SCANNER_SIGMA_M: f64 = 0.005;

/// A person standing on the floor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Figure {
    /// Centre of the head in the robot frame, m.
    pub head: Point3<f64>,
    /// Direction in which the person faces, about the vertical of the robot frame, rad.
    pub heading_rad: f64,
}

/// A simulated scene, in the robot frame.
#[derive(Clone, Debug, Default)]
pub struct World {
    /// The people.
    pub people: Vec<Figure>,
    /// Distance of a wall across the forward axis, m; `None` is open space.
    pub wall_m: Option<f64>,
    /// Seed of axial depth noise like that of a structured-light camera (Nguyen, Izadi & Lovell
    /// 2012); `None` renders without noise.
    pub noise_seed: Option<u64>,
}

impl Figure {
    /// Returns a person of average height that faces the robot, at a position on the floor.
    pub fn at(x: f64, y: f64) -> Self {
        Self { head: Point3::new(x, y, 1.6), heading_rad: (-y).atan2(-x) }
    }
}

impl World {
    /// Returns a scene of people in front of a wall at 5 m.
    pub fn with(people: &[Figure]) -> Self {
        Self { people: people.to_vec(), wall_m: Some(5.0), noise_seed: None }
    }

    /// Renders the colour and the depth image of the camera. Depth is along the optical axis in
    /// metres, NaN without a hit.
    pub fn draw(&self, camera: &Camera) -> Images {
        let shapes: Vec<Ellipsoid> = self.people.iter().flat_map(body).collect();
        let eye = camera.robot_from_camera.translation.vector;
        let mut depth = DepthImage::filled(camera.width, camera.height, f32::NAN);
        let mut colour = RgbImage::filled(camera.width, camera.height, [20, 24, 32]);
        let pixels = depth.pixels_mut().iter_mut().zip(colour.pixels_mut());
        for (index, (depth, colour)) in pixels.enumerate() {
            let column = index % camera.width;
            let row = index / camera.width;
            let ray = camera.ray(Point2::new(column as f64, row as f64));
            let ray = camera.robot_from_camera.rotation * ray;
            if let Some(hit) = self.cast(&shapes, eye, ray) {
                *depth = hit.depth_m as f32;
                *colour = hit.colour;
            }
        }
        self.add_noise(&mut depth);
        Images { colour: Some(Arc::new(colour)), depth: Some(Arc::new(depth)), ..Images::default() }
    }

    /// Measures the scan of a laser at the origin of the robot, [`SCANNER_HEIGHT_M`] above the
    /// floor, over the front half circle. Rays that hit nothing within [`SCANNER_RANGE_M`] are left
    /// out.
    pub fn scan(&self) -> LaserScan {
        let shapes: Vec<Ellipsoid> = self.people.iter().flat_map(body).collect();
        let eye = Vector3::new(0.0, 0.0, SCANNER_HEIGHT_M);
        // Another stream of random numbers than that of the depth image.
        let mut random = self.noise_seed.map(|seed| SplitMix64::new(!seed));
        let mut rays = Vec::new();
        let mut points = Vec::new();
        for ray in 0..RAYS {
            let angle = (f64::from(ray) / f64::from(RAYS - 1) - 0.5) * std::f64::consts::PI;
            let direction = Vector3::new(angle.cos(), angle.sin(), 0.0);
            let noise_m = random.as_mut().map_or(0.0, |random| SCANNER_SIGMA_M * random.normal());
            let hit = self.cast(&shapes, eye, direction).map(|hit| hit.depth_m);
            if let Some(range_m) = hit.filter(|range_m| *range_m < SCANNER_RANGE_M) {
                rays.push(ray);
                points.push(Point3::from(eye + direction * (range_m + noise_m)));
            }
        }
        let increment_rad = std::f64::consts::PI / f64::from(RAYS - 1);
        LaserScan::of_points(points)
            .with_scanner(Isometry3::from_parts(eye.into(), Default::default()))
            .with_rays(-std::f64::consts::FRAC_PI_2, increment_rad, rays)
    }

    fn cast(&self, shapes: &[Ellipsoid], eye: Vector3<f64>, ray: Vector3<f64>) -> Option<Hit> {
        let people = shapes.iter().filter_map(|shape| shape.hit(eye, ray));
        let wall =
            self.wall_m.and_then(|x| plane(x - eye.x, ray.x, 0.8 + 0.1 * ray.z, [200, 190, 170]));
        let floor = plane(-eye.z, ray.z, 0.7, [120, 110, 100]);
        people.chain(wall).chain(floor).min_by(|a, b| a.depth_m.total_cmp(&b.depth_m))
    }

    fn add_noise(&self, depth: &mut DepthImage) {
        let Some(seed) = self.noise_seed else { return };
        let mut random = SplitMix64::new(seed);
        for depth in depth.pixels_mut() {
            // Axial noise of a structured-light camera, Nguyen, Izadi & Lovell.
            let sigma_m = 0.0012 + 0.0019 * (f64::from(*depth) - 0.4).powi(2);
            *depth += (sigma_m * random.normal()) as f32;
        }
    }
}

/// First intersection of a ray.
struct Hit {
    depth_m: f64,
    colour: [u8; 3],
}

/// Intersects a ray with the plane at signed distance `away` along an axis on which the ray
/// advances by `along` per metre of depth.
fn plane(away: f64, along: f64, light: f64, colour: [u8; 3]) -> Option<Hit> {
    let depth_m = away / along;
    // A plane behind the camera, or beyond 50 m, is not visible.
    let seen = depth_m.is_finite() && depth_m > 0.01 && depth_m < 50.0;
    seen.then(|| Hit { depth_m, colour: shade(colour, light) })
}

fn shade(colour: [u8; 3], light: f64) -> [u8; 3] {
    colour.map(|c| (f64::from(c) * light.clamp(0.0, 1.0)) as u8)
}

/// An ellipsoid with one vertical axis.
struct Ellipsoid {
    centre: Vector3<f64>,
    /// Half axes: along the heading, across it, vertical, m.
    half: Vector3<f64>,
    /// Rotation from the robot's axes to those of the half axes.
    turn: Rotation3<f64>,
    colour: [u8; 3],
}

impl Ellipsoid {
    /// Returns the nearer intersection of `eye + t * ray`; `t` is the depth, because the ray is
    /// scaled to depth 1.
    fn hit(&self, eye: Vector3<f64>, ray: Vector3<f64>) -> Option<Hit> {
        let start = (self.turn * (eye - self.centre)).component_div(&self.half);
        let step = (self.turn * ray).component_div(&self.half);
        let a = step.norm_squared();
        let b = start.dot(&step);
        let c = start.norm_squared() - 1.0;
        let discriminant = b * b - a * c;
        if discriminant < 0.0 {
            return None;
        }
        let depth_m = (-b - discriminant.sqrt()) / a;
        let normal = (start + step * depth_m).component_div(&self.half).normalize();
        let facing = -normal.dot(&(self.turn * ray).normalize());
        let colour = shade(self.colour, 0.35 + 0.65 * facing);
        (depth_m > 0.01).then_some(Hit { depth_m, colour })
    }
}

/// Offset from the head (along the heading, left, down); the three half axes; colour.
type Part = ([f64; 3], [f64; 3], [u8; 3]);

const SKIN: [u8; 3] = [224, 172, 140];
const SHIRT: [u8; 3] = [60, 90, 170];

/// All parts above the hip, m. A head is about 19 cm long and 16 cm wide with hair, and lies some 4
/// cm in front of the axis of the trunk.
const UPPER_PARTS: [Part; 6] = [
    ([0.0, 0.0, 0.0], [0.095, 0.08, 0.115], SKIN),
    ([-0.02, 0.0, 0.15], [0.06, 0.065, 0.13], SKIN),
    ([-0.04, 0.0, 0.40], [0.11, 0.24, 0.21], SHIRT),
    ([-0.04, 0.0, 0.62], [0.12, 0.19, 0.38], SHIRT),
    ([-0.04, 0.22, 0.62], [0.06, 0.05, 0.31], SHIRT),
    ([-0.04, -0.22, 0.62], [0.06, 0.05, 0.31], SHIRT),
];

/// Distance of the hip below the centre of the head, m.
const HIP_M: f64 = 0.80;

fn body(figure: &Figure) -> impl Iterator<Item = Ellipsoid> {
    // The legs keep a positive length even if the head is at or below the height of the hip.
    let half_leg = (0.5 * (figure.head.z - HIP_M)).max(0.1);
    let legs = [0.09, -0.09].map(|across| -> Part {
        ([-0.04, across, HIP_M + half_leg], [0.09, 0.08, half_leg + 0.03], [50, 50, 60])
    });
    let parts = UPPER_PARTS.into_iter().chain(legs);
    let Figure { head, heading_rad } = *figure;
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), heading_rad);
    parts.map(move |([along, across, below], half, colour)| Ellipsoid {
        centre: head.coords + turn * Vector3::new(along, across, -below),
        half: Vector3::from(half),
        turn: turn.inverse(),
        colour,
    })
}

#[cfg(test)]
mod tests {
    use tagalong_geometry::{HEAD_RADIUS_M, Pinhole};

    use super::*;

    fn camera(pitch_down_rad: f64) -> Camera {
        Camera::mounted(Pinhole::centred(525.0, 640, 480), 640, 480, 1.2, pitch_down_rad, 0.0)
    }

    fn depth_at(images: &Images, camera: &Camera, point: Point3<f64>) -> f64 {
        let pixel = camera.project(&point).unwrap();
        let depth = images.depth.as_ref().unwrap();
        f64::from(depth.get(pixel.x.round() as i64, pixel.y.round() as i64).unwrap())
    }

    #[test]
    fn the_head_is_seen_about_a_head_radius_before_its_centre() {
        let camera = camera(0.0);
        let head = Point3::new(2.0, 0.0, 1.2);
        let images = World::with(&[Figure { head, heading_rad: 3.0 }]).draw(&camera);
        assert!((depth_at(&images, &camera, head) - (2.0 - HEAD_RADIUS_M)).abs() < 0.02);
    }

    #[test]
    fn every_pixel_of_an_empty_world_lies_on_the_floor_or_the_wall() {
        let camera = camera(0.3);
        let images = World::with(&[]).draw(&camera);
        let depth = images.depth.unwrap();
        for (index, depth) in depth.pixels().iter().enumerate().filter(|(_, d)| !d.is_nan()) {
            let pixel = Point2::new((index % 640) as f64, (index / 640) as f64);
            let point = camera.back_project(pixel, f64::from(*depth));
            assert!(point.z.abs() < 1e-4 || (point.x - 5.0).abs() < 1e-4, "{point}");
        }
    }

    #[test]
    fn the_upper_body_square_frames_the_shoulders() {
        let camera = camera(0.0);
        let figure = Figure::at(2.0, 0.2);
        let images = World::with(&[figure]).draw(&camera);
        let depth = images.depth.unwrap();
        let square = camera.upper_body(&figure.head);
        let row = depth.row(square.bottom() as usize - 1);
        let left = (0..640).find(|x| row[*x] < 3.0).unwrap();
        let right = (0..640).rfind(|x| row[*x] < 3.0).unwrap();
        let width = (right - left) as f64 / square.width;
        assert!((0.75..1.0).contains(&width), "shoulders take {width} of the square");
    }

    #[test]
    fn the_scan_shows_two_legs_in_front_of_the_wall() {
        let scan = World::with(&[Figure::at(2.0, 0.4)]).scan();
        let near = scan.points.iter().zip(&*scan.rays).filter(|(point, _)| point.x < 3.0);
        let (points, rays): (Vec<Point3<f64>>, Vec<u32>) = near.unzip();
        let legs = rays.chunk_by(|a, b| b - a == 1).count();
        assert_eq!(legs, 2, "with a gap between them: {rays:?}");
        for point in &points {
            assert!((point.xy() - Point2::new(2.0, 0.4)).norm() < 0.25, "{point}");
            assert!((point.z - SCANNER_HEIGHT_M).abs() < 1e-12);
        }
        let wall = World::with(&[]).scan();
        assert!(wall.points.iter().all(|point| (point.x - 5.0).abs() < 1e-9));
        assert!(wall.points.len() > 400 && wall.points.len() < RAYS as usize, "its end is far");
        assert!(World::default().scan().points.is_empty());
    }

    #[test]
    fn noise_is_seeded_and_small() {
        let camera = camera(0.0);
        let [clean, noisy, again] = [None, Some(3), Some(3)].map(|noise_seed| {
            World { noise_seed, ..World::with(&[]) }.draw(&camera).depth.unwrap()
        });
        assert_eq!(format!("{noisy:?}"), format!("{again:?}"));
        let both = clean.pixels().iter().zip(noisy.pixels()).filter(|(c, _)| **c < 5.0);
        let errors: Vec<f64> = both.map(|(c, n)| f64::from(n - c)).collect();
        let rms = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
        assert!((0.001..0.05).contains(&rms), "{rms}");
    }
}
