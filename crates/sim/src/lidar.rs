//! A 3-D lidar: beams in many directions around the robot.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Point3, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::{PointCloud, settings};

use crate::random::normal_at;
use crate::world::World;

settings! {
    /// A level 3-D lidar on the robot, above the point between its wheels. It measures at the times
    /// of the camera.
    pub struct LidarSettings {
        /// Pattern of the beams.
        pub pattern: BeamPattern = BeamPattern::Rings,
        /// Number of beams per cloud.
        #[schemars(range(max = 200_000))]
        pub beams: usize = 14_400,
        /// Number of rings of a spinning lidar.
        #[schemars(range(min = 1, max = 128))]
        pub rings: usize = 16,
        /// Field of view around the forward direction, degrees; 360 is a full turn.
        #[schemars(range(min = 10.0, max = 360.0))]
        pub field_of_view_deg: f64 = 360.0,
        /// Elevation of the lowest beams, degrees ...
        #[schemars(range(min = -90.0))]
        pub lowest_deg: f64 = -15.0,
        /// ... and of the highest ones, degrees.
        #[schemars(range(max = 90.0))]
        pub highest_deg: f64 = 15.0,
        /// Height above the floor, m.
        #[schemars(range(min = 0.02, max = 3.0))]
        pub height_m: f64 = 0.8,
        /// Minimum range that is measured, m.
        #[schemars(range(min = 0.0))]
        pub min_range_m: f64 = 0.3,
        /// Maximum range that is measured, m.
        #[schemars(range(max = 200.0))]
        pub max_range_m: f64 = 30.0,
        /// Standard deviation of a range, m.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub sigma_m: f64 = 0.02,
    }
}

/// Pattern of the beams of a lidar.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum BeamPattern {
    /// A spinning lidar: rings at equal angles above each other.
    Rings,
    /// Two rotating prisms, as in solid-state lidars: a rosette whose petals are at other positions
    /// in each cloud.
    Rosette,
}

/// Number of turns of the two prisms per cloud. They have no small common multiple, otherwise the
/// rosette would close.
const PRISM_TURNS: [f64; 2] = [121.377, -78.521];

impl LidarSettings {
    /// Returns the conditions on the settings, each with the message for a violation.
    pub(crate) fn rules(&self) -> [(bool, &'static str); 3] {
        [
            (self.rings <= self.beams, "lidar.beams must be lidar.rings at least"),
            (
                self.lowest_deg < self.highest_deg,
                "lidar.highest_deg must be above lidar.lowest_deg",
            ),
            (
                self.min_range_m < self.max_range_m,
                "lidar.max_range_m must be above lidar.min_range_m",
            ),
        ]
    }

    /// Returns azimuth, positive to the left, and elevation of a beam in the cloud with this index,
    /// rad.
    fn angles(&self, cloud: u64, beam: usize) -> [f64; 2] {
        let width = self.field_of_view_deg.to_radians();
        let lowest = self.lowest_deg.to_radians();
        let height = self.highest_deg.to_radians() - lowest;
        match self.pattern {
            BeamPattern::Rings => {
                let columns = (self.beams / self.rings).max(1);
                let column = beam / self.rings;
                let ring = beam % self.rings;
                let gaps = (self.rings - 1).max(1) as f64;
                // Each column has its own direction, even if the field of view is a full turn.
                let along = (column as f64 + 0.5) / columns as f64 - 0.5;
                [along * width, lowest + height * ring as f64 / gaps]
            }
            BeamPattern::Rosette => {
                let time = cloud as f64 + beam as f64 / self.beams as f64;
                let turned = PRISM_TURNS.map(|turns| TAU * (turns * time).fract());
                let across = 0.25 * (turned[0].cos() + turned[1].cos());
                let up = 0.25 * (turned[0].sin() + turned[1].sin());
                [across * width, lowest + height * (0.5 + up)]
            }
        }
    }

    /// Measures the points of the cloud with this index, in the frame of the lidar, m; beams
    /// without a hit in range give none. The noise depends on the seed.
    pub(crate) fn measure(
        &self,
        world: &World,
        world_from_robot: &Isometry3<f64>,
        cloud: u64,
        seed: u64,
    ) -> Vec<[f32; 3]> {
        let eye = world_from_robot * Point3::new(0.0, 0.0, self.height_m);
        let seed = tagalong_math::number_at(seed, self.beams as u64);
        let view = world.around(eye);
        let beams = if self.pattern == BeamPattern::Rings {
            self.beams / self.rings * self.rings
        } else {
            self.beams
        };
        let mut points = Vec::with_capacity(beams);
        for beam in 0..beams {
            let [azimuth, elevation] = self.angles(cloud, beam);
            let level = elevation.cos();
            let ray = Vector3::new(azimuth.cos() * level, azimuth.sin() * level, elevation.sin());
            let range_m = world.distance(&view, &(world_from_robot.rotation * ray));
            let measured_m = range_m + self.sigma_m * normal_at(seed, beam as u64);
            if (self.min_range_m..=self.max_range_m).contains(&measured_m) {
                let point = ray * measured_m;
                points.push([point.x as f32, point.y as f32, point.z as f32]);
            }
        }
        points
    }

    /// Returns the cloud with these points in the frame of the lidar.
    pub fn cloud(&self, points: &[[f32; 3]]) -> PointCloud {
        let scanner = Point3::new(0.0, 0.0, self.height_m);
        let points = points.iter().map(|point| scanner + Vector3::from(point.map(f64::from)));
        PointCloud::new(scanner, points.collect::<Vec<_>>())
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::Rotation3;

    use super::*;
    use crate::material::Material;
    use crate::shape::{Form, Shape};
    use crate::world::{Object, Stage};

    /// A ball of half a metre around a place 3 m ahead, at the height of the lidar.
    fn world() -> World {
        let form = Form::Ellipsoid(Vector3::repeat(0.5));
        let at = Point3::new(3.0, 0.0, 0.8);
        let ball = Shape::new(form, at, Rotation3::identity(), Material::plain([0.5; 3]));
        let objects = vec![Object::new(vec![ball], Some(1), true)];
        World::new(&Arc::new(Stage::new(objects, Vec::new(), 100.0)), Vec::new())
    }

    fn points(settings: &LidarSettings, cloud: u64) -> Vec<[f32; 3]> {
        settings.measure(&world(), &Isometry3::identity(), cloud, 7)
    }

    #[test]
    fn both_patterns_show_the_side_of_a_ball_that_is_near() {
        for pattern in [BeamPattern::Rings, BeamPattern::Rosette] {
            let settings = LidarSettings { pattern, sigma_m: 0.0, ..LidarSettings::default() };
            let seen = points(&settings, 0);
            // The ball covers 19 of 30 degrees in height and 19 of 360 around.
            assert!((100..2_000).contains(&seen.len()), "{pattern:?}: {}", seen.len());
            for [x, y, z] in seen {
                let off = (x - 3.0).hypot(y).hypot(z);
                assert!((off - 0.5).abs() < 1e-4 && x < 3.0, "{pattern:?}: {x} {y} {z}");
            }
        }
    }

    #[test]
    fn rings_are_the_same_in_each_cloud_and_petals_are_not() {
        let rings = LidarSettings { sigma_m: 0.0, ..LidarSettings::default() };
        assert_eq!(points(&rings, 0), points(&rings, 5));
        let heights: Vec<f64> = (0..16).map(|ring| rings.angles(0, ring)[1].to_degrees()).collect();
        assert!((heights[0] + 15.0).abs() < 1e-9 && (heights[15] - 15.0).abs() < 1e-9);
        let rosette = LidarSettings { pattern: BeamPattern::Rosette, ..rings };
        assert_ne!(points(&rosette, 0), points(&rosette, 1));
        let all = (0..rosette.beams).map(|beam| rosette.angles(3, beam));
        let widest = all.map(|[azimuth, _]| azimuth.to_degrees()).fold(0.0, f64::max);
        assert!((170.0..=180.0).contains(&widest), "{widest}");
    }
}
