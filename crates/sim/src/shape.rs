//! The solids of which all objects consist, and their intersection with rays.

use nalgebra::{Matrix3, Point3, Rotation3, Unit, Vector3};

use crate::lanes::{LANES, Lanes, Vectors, dot, product, transposed_product};
use crate::material::Material;
use crate::seen::SolidView;

/// Margin for rounding, m.
const SLACK_M: f64 = 1e-6;
/// Half side from which on a flat side is large, m.
const SLAB_M: f64 = 0.3;

/// The geometry of a solid in its own axes, origin at its centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Form {
    /// An ellipsoid with these half axes, m.
    Ellipsoid(Vector3<f64>),
    /// A block with these half sides, m.
    Block(Vector3<f64>),
    /// The convex hull of a ball at the origin and one along Z: `length` away,
    /// with the radii of the two, m. Neither ball contains the other.
    Capsule {
        /// Distance of the centres.
        length: f64,
        /// Radius at the origin.
        first: f64,
        /// Radius at the far end.
        second: f64,
    },
}

/// A solid in the world.
#[derive(Clone, Copy, Debug)]
pub struct Shape {
    /// Geometry.
    pub form: Form,
    /// Origin in the world, m.
    pub origin: Point3<f64>,
    /// Rotation from its own axes to those of the world.
    pub world_from_own: Rotation3<f64>,
    /// Material of the solid.
    pub material: Material,
    /// Centre and squared radius of the bounding ball.
    ball: (Point3<f64>, f64),
}

impl Shape {
    /// Creates a solid.
    pub fn new(
        form: Form,
        origin: Point3<f64>,
        world_from_own: Rotation3<f64>,
        material: Material,
    ) -> Self {
        let mut shape = Self { form, origin, world_from_own, material, ball: (origin, 0.0) };
        let (centre, radius) = shape.bound();
        shape.ball = (centre, radius * radius);
        shape
    }

    /// Returns the solid raised by `by_m`, m.
    pub fn raised(&self, by_m: f64) -> Self {
        let origin = self.origin + Vector3::new(0.0, 0.0, by_m);
        Self::new(self.form, origin, self.world_from_own, self.material)
    }

    /// Creates a capsule between two points; `forward` determines the orientation of a texture on
    /// it.
    pub fn limb(
        ends: (Point3<f64>, Point3<f64>),
        radii: (f64, f64),
        forward: Vector3<f64>,
        material: Material,
    ) -> Self {
        let axis = ends.1 - ends.0;
        // A ball that contains the other is rendered alone.
        let length = axis.norm().max((radii.0 - radii.1).abs() * 1.01).max(1e-6);
        let up = Unit::try_new(axis, 1e-9).unwrap_or_else(Vector3::z_axis);
        // Any forward direction is right for a limb along it.
        let right = Unit::try_new(up.cross(&forward), 1e-6)
            .or_else(|| Unit::try_new(up.cross(&Vector3::x()), 1e-6))
            .unwrap_or_else(Vector3::y_axis);
        let columns = [right.cross(&up), right.into_inner(), up.into_inner()];
        let turn = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&columns));
        let form = Form::Capsule { length, first: radii.0, second: radii.1 };
        Self::new(form, ends.0, turn, material)
    }

    /// Returns centre and radius of the bounding ball.
    pub fn bound(&self) -> (Point3<f64>, f64) {
        match self.form {
            Form::Ellipsoid(half) => (self.origin, half.max()),
            Form::Block(half) => (self.origin, half.norm()),
            Form::Capsule { length, first, second } => {
                let radius = 0.5 * (length + first + second);
                let along = radius - first;
                (self.origin + self.world_from_own * Vector3::new(0.0, 0.0, along), radius)
            }
        }
    }

    /// Returns the centre, and for a block also the middles of its sides, in the world, m.
    pub fn spots(&self) -> Vec<Point3<f64>> {
        let Form::Block(half) = self.form else { return vec![self.bound().0] };
        let sides = (0..3).flat_map(|axis| [-1.0, 1.0].map(|sign| (axis, sign)));
        let middle = |(axis, sign): (usize, f64)| {
            let mut own = Vector3::zeros();
            own[axis] = sign * half[axis];
            self.origin + self.world_from_own * own
        };
        std::iter::once(self.origin).chain(sides.map(middle)).collect()
    }

    /// Returns false if a ray misses the bounding ball, which is a cheap first test. `per_length`
    /// is one over the squared length of the ray.
    pub fn near(&self, eye: &Point3<f64>, ray: &Vector3<f64>, per_length: f64) -> bool {
        let way = self.ball.0 - eye;
        let along = way.dot(ray);
        way.norm_squared() - along * along * per_length <= self.ball.1
    }

    /// Returns true if the bounding ball is on one side of the plane through an eye with this unit
    /// normal.
    pub fn is_beside(&self, eye: &Point3<f64>, normal: &Vector3<f64>) -> bool {
        let away = normal.dot(&(self.ball.0 - eye));
        away * away > self.ball.1
    }

    /// Returns true if the bounding ball is behind the plane through an eye with this unit normal.
    pub fn is_behind(&self, eye: &Point3<f64>, normal: &Vector3<f64>) -> bool {
        let ahead = normal.dot(&(self.ball.0 - eye));
        ahead < 0.0 && ahead * ahead > self.ball.1
    }

    /// Returns true if parts of the solid are on the inner sides of some planes through an eye, to
    /// which the unit vectors point.
    pub fn reaches(&self, eye: &Point3<f64>, normals: &[Vector3<f64>]) -> bool {
        let way = self.origin - eye;
        // The test of the bounding ball is cheap, so it comes first.
        normals.iter().all(|normal| {
            !self.is_behind(eye, normal) && normal.dot(&way) + self.extent(normal) > -SLACK_M
        })
    }

    /// Returns the extent of the solid from its origin along a unit vector (its support function),
    /// m.
    pub fn extent(&self, along: &Vector3<f64>) -> f64 {
        let own = self.world_from_own.inverse_transform_vector(along);
        match self.form {
            Form::Ellipsoid(half) => own.component_mul(&half).norm(),
            Form::Block(half) => own.abs().dot(&half),
            Form::Capsule { length, first, second } => first.max(own.z * length + second),
        }
    }

    /// Returns true for a block with a large flat side: a wall, a pane, the floor.
    pub fn is_slab(&self) -> bool {
        let Form::Block(half) = self.form else { return false };
        let large = half.iter().filter(|metres| **metres >= SLAB_M).count();
        large >= 2
    }

    /// Converts a point of the world to the solid's own axes.
    pub fn own(&self, point: &Point3<f64>) -> Vector3<f64> {
        self.world_from_own.inverse_transform_vector(&(point - self.origin))
    }

    /// Returns the smallest positive `t` at which `eye + t * ray` enters the solid. For many rays
    /// from one eye, [`Shape::seen_from`] is faster.
    pub fn meet(&self, eye: &Point3<f64>, ray: &Vector3<f64>) -> Option<f64> {
        self.seen_from(eye).meet(ray)
    }

    /// Computes the part of the intersection that depends on the eye alone.
    pub fn seen_from(&self, eye: &Point3<f64>) -> SolidView {
        let turn = self.world_from_own.matrix().transpose();
        let start = self.own(eye);
        match self.form {
            Form::Ellipsoid(half) => SolidView::ellipsoid(&turn, &start, &half),
            Form::Block(half) => SolidView::block(&turn, &start, &half),
            Form::Capsule { length, first, second } => {
                SolidView::capsule(&turn, &start, length, first, second)
            }
        }
    }

    /// Returns the outward normal in the world at a point of the surface in own axes.
    pub fn normal(&self, own: &Vector3<f64>) -> Vector3<f64> {
        let normal = match self.form {
            Form::Ellipsoid(half) => ellipsoid_normal(own, &half),
            Form::Block(half) => block_normal(own, &half),
            Form::Capsule { length, first, second } => {
                capsule_normal(own, length, (first - second) / length)
            }
        };
        self.world_from_own * normal
    }

    /// Returns the surface at the points at which rays hit it.
    pub fn surface(&self, points: &Vectors, rays: &Vectors) -> Surface {
        surface(self, points, rays)
    }
}

/// The surface of a solid at some points of it.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// The points in the solid's own axes, m.
    pub own: Vectors,
    /// Outward normals in the world.
    pub normal: Vectors,
    /// Cosines between the normals and the rays back.
    pub facing: Lanes,
}

#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn surface(of: &Shape, points: &Vectors, rays: &Vectors) -> Surface {
    match of.form {
        Form::Ellipsoid(half) => surface_with(of, points, rays, |own| ellipsoid_normal(own, &half)),
        Form::Block(half) => surface_with(of, points, rays, |own| block_normal(own, &half)),
        Form::Capsule { length, first, second } => {
            let sine = (first - second) / length;
            surface_with(of, points, rays, |own| capsule_normal(own, length, sine))
        }
    }
}

#[inline(always)]
fn surface_with(
    of: &Shape,
    points: &Vectors,
    rays: &Vectors,
    normal: impl Fn(&Vector3<f64>) -> Vector3<f64>,
) -> Surface {
    let mut surface = Surface { own: Vectors::ZERO, normal: Vectors::ZERO, facing: [0.0; LANES] };
    let turn = of.world_from_own.matrix();
    for lane in 0..LANES {
        let ray = rays.at(lane);
        let own = transposed_product(turn, &(points.at(lane) - of.origin.coords));
        let normal = product(turn, &normal(&own));
        surface.own.set(lane, &own);
        surface.normal.set(lane, &normal);
        surface.facing[lane] = -dot(&normal, &ray) / dot(&ray, &ray).sqrt();
    }
    surface
}

// Without branches, so that loops over lanes become vector instructions.

#[inline(always)]
fn ellipsoid_normal(own: &Vector3<f64>, half: &Vector3<f64>) -> Vector3<f64> {
    unit(&Vector3::new(
        own.x / (half.x * half.x),
        own.y / (half.y * half.y),
        own.z / (half.z * half.z),
    ))
}

/// Returns the normal of a capsule whose mantle slopes with this sine.
#[inline(always)]
fn capsule_normal(own: &Vector3<f64>, length: f64, sine: f64) -> Vector3<f64> {
    let cosine = (1.0 - sine * sine).sqrt();
    let across = (own.x * own.x + own.y * own.y).sqrt();
    let nearest = own.z - across * sine / cosine;
    let nearest = if nearest < 0.0 { 0.0 } else { nearest };
    let nearest = if nearest > length { length } else { nearest };
    unit(&Vector3::new(own.x, own.y, own.z - nearest))
}

#[inline(always)]
fn unit(vector: &Vector3<f64>) -> Vector3<f64> {
    let length = dot(vector, vector).sqrt();
    // The centre has no normal; any direction will do.
    let known = length > 1e-12;
    Vector3::new(
        if known { vector.x / length } else { 0.0 },
        if known { vector.y / length } else { 0.0 },
        if known { vector.z / length } else { 1.0 },
    )
}

/// Returns the normal of the side on which a point lies.
#[inline(always)]
fn block_normal(own: &Vector3<f64>, half: &Vector3<f64>) -> Vector3<f64> {
    let x = own.x.abs() / half.x;
    let y = own.y.abs() / half.y;
    let z = own.z.abs() / half.z;
    let on_x = (x >= y) & (x >= z);
    let on_y = !on_x & (y >= z);
    Vector3::new(
        if on_x { own.x.signum() } else { 0.0 },
        if on_y { own.y.signum() } else { 0.0 },
        if on_x | on_y { 0.0 } else { own.z.signum() },
    )
}

/// Forms and turns for tests.
#[cfg(test)]
pub(crate) mod samples {
    use super::*;

    /// Returns a form of each kind, by a number from 0 to 2.
    pub(crate) fn form(number: usize) -> Form {
        match number {
            0 => Form::Ellipsoid(Vector3::new(0.3, 0.15, 0.5)),
            1 => Form::Block(Vector3::new(0.2, 1.5, 0.05)),
            _ => Form::Capsule { length: 1.0, first: 0.3, second: 0.1 },
        }
    }

    /// Returns a turn about no axis of the form.
    pub(crate) fn turn(angle: f64) -> Rotation3<f64> {
        Rotation3::from_euler_angles(angle, 2.0 * angle, 0.3)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Signed distance, negative inside, by its definition: the hull of two
    /// balls is the union of the balls between them.
    fn inside(form: &Form, p: &Vector3<f64>) -> bool {
        match *form {
            Form::Ellipsoid(half) => p.component_div(&half).norm() < 1.0,
            Form::Block(half) => (0..3).all(|i| p[i].abs() < half[i]),
            Form::Capsule { length, first, second } => (0..=2000).any(|i| {
                let part = f64::from(i) / 2000.0;
                let centre = Vector3::new(0.0, 0.0, part * length);
                (p - centre).norm() < first + part * (second - first)
            }),
        }
    }

    /// Walks along the ray in small steps.
    fn slow(form: &Form, start: &Vector3<f64>, step: &Vector3<f64>) -> Option<f64> {
        (0..3000).map(|i| f64::from(i) * 1e-3).find(|t| inside(form, &(start + step * *t)))
    }

    fn forms() -> impl Strategy<Value = Form> {
        let size = || 0.05..0.4f64;
        prop_oneof![
            (size(), size(), size()).prop_map(|(x, y, z)| Form::Ellipsoid(Vector3::new(x, y, z))),
            (size(), size(), size()).prop_map(|(x, y, z)| Form::Block(Vector3::new(x, y, z))),
            (0.4..0.8f64, size(), size()).prop_map(|(length, first, second)| Form::Capsule {
                length,
                first,
                second
            }),
        ]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn rays_enter_where_small_steps_do(
            form in forms(), roll in -3.0..3.0f64, pitch in -1.5..1.5f64,
            x in -0.4..0.4f64, y in -0.4..0.4f64, z in -0.3..0.9f64, dir in 0.0..6.2f64, rise in -0.8..0.8f64,
        ) {
            let ray = Vector3::new(dir.cos(), dir.sin(), rise);
            let target = Vector3::new(x, y, z);
            let turn = Rotation3::from_euler_angles(roll, pitch, 0.3);
            let shape = Shape::new(form, Point3::new(0.1, 0.2, 0.3), turn, Material::plain([0.5; 3]));
            let start = target - ray * 1.6;
            let eye = shape.origin + turn * start;
            let found = shape.meet(&eye, &(turn * ray));
            match (found, slow(&form, &start, &ray)) {
                (Some(t), Some(expected)) => {
                    prop_assert!((t - expected).abs() < 3e-3, "{t} {expected} {form:?}");
                    let turned = turn * ray;
                    prop_assert!(shape.near(&eye, &turned, 1.0 / turned.norm_squared()));
                    let point = eye + turned * t;
                    let normal = shape.normal(&shape.own(&point));
                    prop_assert!(normal.dot(&turned) < 1e-6);
                    prop_assert!(!inside(&form, &shape.own(&(point + normal * 2e-3))));
                    let (centre, radius) = shape.bound();
                    prop_assert!((point - centre).norm() < radius + 1e-9);
                    // The plane that touches the solid there leaves all of it behind.
                    let reach = normal.dot(&(point - shape.origin));
                    prop_assert!((shape.extent(&normal) - reach).abs() < 1e-6);
                }
                // A ray that only grazes may slip between the steps.
                (Some(t), None) => {
                    let point = shape.own(&(eye + turn * ray * (t + 1e-6)));
                    let normal = turn.inverse() * shape.normal(&point);
                    prop_assert!(normal.dot(&ray.normalize()).abs() < 0.2, "{form:?}");
                }
                (None, expected) => prop_assert!(expected.is_none(), "{form:?}"),
            }
        }
    }
}
