//! A laser scanner: rays in one plane around the robot.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Point3, Vector3};

use tagalong_core::{LaserScan, settings};

use crate::random::normal_at;
use crate::world::{self, Object, World};

/// Minimum number of rays that must hit an object for it to count as seen.
const LEAST_RAYS: usize = 2;

settings! {
    /// A laser scanner on the robot, above the point between its wheels. It measures at the times
    /// of the camera.
    pub struct LaserSettings {
        /// Number of rays per scan.
        #[schemars(range(min = 2, max = 4096))]
        pub rays: usize = 360,
        /// Field of view around the forward direction, degrees; 360 is a full turn.
        #[schemars(range(min = 10.0, max = 360.0))]
        pub field_of_view_deg: f64 = 360.0,
        /// Height above the floor, m.
        #[schemars(range(min = 0.02, max = 2.0))]
        pub height_m: f64 = 0.2,
        /// Minimum range that is measured, m.
        #[schemars(range(min = 0.0))]
        pub min_range_m: f64 = 0.12,
        /// Maximum range that is measured, m.
        #[schemars(range(max = 100.0))]
        pub max_range_m: f64 = 8.0,
        /// Standard deviation of a range, m.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub sigma_m: f64 = 0.01,
        /// Standard deviation that grows with the range, m per m, in addition to `sigma_m`: cheap
        /// scanners determine the range from the angle of a spot, and have 0.005, which is 2 cm at
        /// 4 m.
        #[schemars(range(min = 0.0, max = 0.2))]
        pub sigma_per_m: f64 = 0.0,
    }
}

impl LaserSettings {
    /// Returns the conditions on the settings, each with the message for a violation.
    pub(crate) fn rules(&self) -> [(bool, &'static str); 1] {
        let grows = self.min_range_m < self.max_range_m;
        [(grows, "laser.max_range_m must be above laser.min_range_m")]
    }

    /// Returns the direction of the first ray in the robot frame, rad, positive to the left.
    pub fn first_rad(&self) -> f64 {
        -0.5 * self.field_of_view_deg.to_radians()
    }

    /// Returns the angle from one ray to the next, rad.
    pub fn step_rad(&self) -> f64 {
        let whole = self.field_of_view_deg >= 360.0;
        let gaps = if whole { self.rays } else { self.rays - 1 };
        self.field_of_view_deg.to_radians().min(TAU) / gaps as f64
    }

    /// Yields the directions of the rays in the robot frame, rad, positive to the left.
    pub fn directions(&self) -> impl Iterator<Item = f64> + use<> {
        let first = self.first_rad();
        let step = self.step_rad();
        (0..self.rays).map(move |ray| first + ray as f64 * step)
    }

    /// Measures the ranges of the rays, m; infinite if nothing is within range, NaN if an object is
    /// too near. The noise depends on the seed.
    pub(crate) fn measure(
        &self,
        world: &World,
        world_from_robot: &Isometry3<f64>,
        seed: u64,
    ) -> Vec<f32> {
        let eye = world_from_robot * Point3::new(0.0, 0.0, self.height_m);
        let seed = tagalong_math::number_at(seed, self.rays as u64);
        let slice = world.slice(eye, &(world_from_robot.rotation * Vector3::z()));
        let mut ranges = Vec::with_capacity(self.rays);
        for (ray, direction) in (0..).zip(self.directions()) {
            let ahead = Vector3::new(direction.cos(), direction.sin(), 0.0);
            let metres = world.distance(&slice, &(world_from_robot.rotation * ahead));
            let measured = metres + self.sigma_at(metres) * normal_at(seed, ray);
            ranges.push(if measured > self.max_range_m {
                f32::INFINITY
            } else if measured < self.min_range_m {
                f32::NAN
            } else {
                measured as f32
            });
        }
        ranges
    }

    /// Returns the standard deviation of a range, m; it is constant beyond the maximum range.
    fn sigma_at(&self, metres: f64) -> f64 {
        if self.sigma_per_m == 0.0 {
            return self.sigma_m;
        }
        let growing_m = self.sigma_per_m * metres.min(self.max_range_m);
        (self.sigma_m * self.sigma_m + growing_m * growing_m).sqrt()
    }

    /// Returns true if at least two rays hit an object within the range, with none of the other
    /// objects in front of it.
    pub(crate) fn reaches(
        &self,
        own: &Object,
        others: &[&Object],
        world_from_robot: &Isometry3<f64>,
    ) -> bool {
        let eye = world_from_robot * Point3::new(0.0, 0.0, self.height_m);
        let meets = self.directions().filter(|direction| {
            let ahead = Vector3::new(direction.cos(), direction.sin(), 0.0);
            let ray = world_from_robot.rotation * ahead;
            let metres = world::distance([own], &eye, &ray);
            (self.min_range_m..=self.max_range_m).contains(&metres)
                && world::distance(others.iter().copied(), &eye, &ray) > metres
        });
        meets.take(LEAST_RAYS).count() == LEAST_RAYS
    }

    /// Returns the scan with these ranges; the scanner is above the robot's origin.
    pub fn scan(&self, ranges: &[f32]) -> LaserScan {
        let mount = Isometry3::translation(0.0, 0.0, self.height_m);
        let limits_m = [self.min_range_m, self.max_range_m];
        let ranges = ranges.iter().copied().map(f64::from);
        LaserScan::of_ranges(mount, self.first_rad(), self.step_rad(), limits_m, ranges)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::Rotation3;

    use super::*;
    use crate::material::Material;
    use crate::shape::{Form, Shape};
    use crate::world::Stage;

    const FOUR: LaserSettings = LaserSettings {
        rays: 4,
        field_of_view_deg: 360.0,
        height_m: 0.2,
        min_range_m: 0.3,
        max_range_m: 8.0,
        sigma_m: 0.0,
        sigma_per_m: 0.0,
    };

    /// Balls of half a metre at these places.
    fn world(places: &[[f64; 2]]) -> World {
        fn ball(at: &[f64; 2]) -> Shape {
            let form = Form::Ellipsoid(Vector3::repeat(0.5));
            let at = Point3::new(at[0], at[1], 0.2);
            Shape::new(form, at, Rotation3::identity(), Material::plain([0.5; 3]))
        }

        let objects = vec![Object::new(places.iter().map(ball).collect(), Some(1), true)];
        World::new(&Arc::new(Stage::new(objects, Vec::new(), 100.0)), Vec::new())
    }

    #[test]
    fn rays_go_round_the_robot_and_meet_what_is_nearest() {
        fn near(range: f32, metres: f32) -> bool {
            (range - metres).abs() < 1e-5
        }

        let world = world(&[[3.0, 1.0], [5.0, 1.0], [1.0, 4.0], [0.3, 1.0]]);
        let robot = Isometry3::translation(1.0, 1.0, 0.0);
        let ranges = FOUR.measure(&world, &robot, 1);
        assert!(ranges[0].is_nan(), "behind, something is too near: {ranges:?}");
        assert_eq!(ranges[1], f32::INFINITY, "nothing to the right");
        assert!(near(ranges[2], 1.5) && near(ranges[3], 2.5), "ahead and left: {ranges:?}");
        let points = FOUR.scan(&ranges).points;
        assert!((points[0] - Point3::new(1.5, 0.0, 0.2)).norm() < 1e-6);
        assert!((points[1] - Point3::new(0.0, 2.5, 0.2)).norm() < 1e-6);
        assert_eq!(points.len(), 2);
    }

    #[test]
    fn the_rays_of_a_narrow_scanner_reach_both_ends_of_its_view() {
        let narrow = LaserSettings { field_of_view_deg: 90.0, rays: 91, ..FOUR };
        let directions: Vec<f64> = narrow.directions().map(f64::to_degrees).collect();
        assert!((directions[0] + 45.0).abs() < 1e-9 && (directions[90] - 45.0).abs() < 1e-9);
        assert!((FOUR.step_rad().to_degrees() - 90.0).abs() < 1e-9);
    }

    /// Returns the standard deviation of the ranges to a ball that begins at a distance, m, over 400
    /// seeds.
    fn deviation_m(laser: &LaserSettings, ahead_m: f64) -> f64 {
        let world = world(&[[ahead_m + 0.5, 0.0]]);
        let mut variance = 0.0;
        for seed in 0..400 {
            let ranges = laser.measure(&world, &Isometry3::identity(), seed);
            variance += (f64::from(ranges[2]) - ahead_m).powi(2) / 400.0;
        }
        variance.sqrt()
    }

    #[test]
    fn noise_has_the_deviation_that_is_asked_for() {
        let deviation_m = deviation_m(&LaserSettings { sigma_m: 0.05, ..FOUR }, 2.5);
        assert!((0.04..0.06).contains(&deviation_m), "{deviation_m}");
    }

    #[test]
    fn the_noise_of_a_cheap_scanner_grows_with_the_range() {
        let cheap = LaserSettings { sigma_m: 0.003, sigma_per_m: 0.005, ..FOUR };
        for (ahead_m, expected_m) in [(0.5, 0.004), (4.0, 0.02), (7.5, 0.038)] {
            let deviation_m = deviation_m(&cheap, ahead_m);
            let off = deviation_m / expected_m - 1.0;
            assert!(off.abs() < 0.15, "{deviation_m} m at {ahead_m} m");
        }
        // Where nothing is, nothing is measured, whatever the noise.
        let ranges = cheap.measure(&world(&[]), &Isometry3::identity(), 1);
        assert_eq!(ranges, [f32::INFINITY; 4]);
    }
}
