use nalgebra::{Isometry2, Point2, Point3, Rotation3, Vector2, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::material::Material;
use crate::shape::{Form, Shape};
use crate::world::Object;

/// A wall block from the floor to the ceiling.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Block {
    /// Centre, m.
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    pub at: [f64; 2],
    /// Length and width, m.
    #[schemars(inner(range(min = 0.05, max = 200.0)))]
    pub size_m: [f64; 2],
    /// Direction of its length, degrees.
    #[serde(default)]
    #[schemars(range(min = -1000.0, max = 1000.0))]
    pub heading_deg: f64,
}

impl Block {
    /// Returns the pose in the world.
    fn pose(&self) -> Isometry2<f64> {
        Isometry2::new(Vector2::from(self.at), self.heading_deg.to_radians())
    }

    /// Returns half its length and width, m.
    fn half_m(&self) -> Vector2<f64> {
        Vector2::from(self.size_m) * 0.5
    }

    /// Returns the nearest point of its surface or, for a position inside, that position.
    pub(crate) fn nearest(&self, place: &Point2<f64>) -> Point2<f64> {
        let own = self.pose().inverse_transform_point(place);
        let half = self.half_m();
        let inside = Point2::new(own.x.clamp(-half.x, half.x), own.y.clamp(-half.y, half.y));
        self.pose() * inside
    }

    /// Returns the position, moved if necessary to be at least this far outside, m.
    pub(crate) fn outside(&self, place: &Point2<f64>, margin_m: f64) -> Point2<f64> {
        let own = self.pose().inverse_transform_point(place);
        let half = self.half_m();
        let depth = half - own.coords.abs();
        if depth.min() > 0.0 {
            // Moved out through the nearest side.
            let axis = depth.imin();
            let mut out = own;
            out[axis] = (half[axis] + margin_m).copysign(own[axis]);
            return self.pose() * out;
        }
        let nearest = self.nearest(place);
        let away = place - nearest;
        match away.try_normalize(1e-9).filter(|_| away.norm() < margin_m) {
            Some(out) => nearest + out * margin_m,
            None => *place,
        }
    }

    /// Returns the free distance between the block and a position as the larger of those along and
    /// across it, m; negative inside.
    pub(crate) fn gap_m(&self, place: &Point2<f64>) -> f64 {
        let own = self.pose().inverse_transform_point(place);
        (own.coords.abs() - self.half_m()).max()
    }

    /// Returns its corners, each moved outward by a margin along both sides, m.
    pub(crate) fn corners(&self, margin_m: f64) -> [Point2<f64>; 4] {
        let half = self.half_m() + Vector2::repeat(margin_m);
        let pose = self.pose();
        [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]]
            .map(|[x, y]| pose * Point2::new(half.x * x, half.y * y))
    }

    /// Returns true if the straight line between two points passes through the block, widened by a
    /// margin, m.
    pub(crate) fn is_on_way(&self, from: &Point2<f64>, to: &Point2<f64>, margin_m: f64) -> bool {
        let start = self.pose().inverse_transform_point(from);
        let way = self.pose().inverse_transform_vector(&(to - from));
        let half = self.half_m() + Vector2::repeat(margin_m);
        let mut enters = 0.0_f64;
        let mut leaves = 1.0_f64;
        for axis in 0..2 {
            if way[axis].abs() < 1e-12 {
                if start[axis].abs() >= half[axis] {
                    return false;
                }
                continue;
            }
            let first = (-half[axis] - start[axis]) / way[axis];
            let second = (half[axis] - start[axis]) / way[axis];
            enters = enters.max(first.min(second));
            leaves = leaves.min(first.max(second));
        }
        enters < leaves
    }

    /// Returns the solid of the block, up to a ceiling of this height, m.
    pub(crate) fn solid(&self, height_m: f64) -> Object {
        let half = self.half_m().push(0.5 * height_m);
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), self.heading_deg.to_radians());
        let at = Point3::new(self.at[0], self.at[1], half.z);
        let paint = Material::plain([0.62, 0.60, 0.55]);
        // Casts no shadow, like the walls of the room, because a lamp may hang inside of it.
        Object::new(vec![Shape::new(Form::Block(half), at, turn, paint)], None, false)
    }
}
