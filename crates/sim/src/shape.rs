//! The solids of which everything is made, and how a ray meets them.

use nalgebra::{Matrix3, Point3, Rotation3, Unit, Vector3};

use crate::material::Material;

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
    /// Its geometry.
    pub form: Form,
    /// Its origin in the world, m.
    pub origin: Point3<f64>,
    /// From its own axes to those of the world.
    pub world_from_own: Rotation3<f64>,
    /// What it is made of.
    pub material: Material,
    /// Centre and squared radius of a ball around it.
    ball: (Point3<f64>, f64),
}

impl Shape {
    /// A solid.
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

    /// A capsule between two points; `forward` fixes how a texture lies on it.
    pub fn limb(
        ends: (Point3<f64>, Point3<f64>),
        radii: (f64, f64),
        forward: Vector3<f64>,
        material: Material,
    ) -> Self {
        let axis = ends.1 - ends.0;
        // A ball that swallows the other is drawn as itself.
        let length = axis.norm().max((radii.0 - radii.1).abs() * 1.01).max(1e-6);
        let up = Unit::try_new(axis, 1e-9).unwrap_or_else(Vector3::z_axis);
        let right = Unit::try_new(up.cross(&forward), 1e-6)
            .or_else(|| Unit::try_new(up.cross(&Vector3::x()), 1e-6))
            .unwrap_or_else(Vector3::y_axis);
        let columns = [right.cross(&up), right.into_inner(), up.into_inner()];
        let turn = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&columns));
        let form = Form::Capsule { length, first: radii.0, second: radii.1 };
        Self::new(form, ends.0, turn, material)
    }

    /// Centre and radius of a ball around the solid.
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

    /// False if a ray passes by the ball around the solid: the cheap question
    /// to ask first. `per_length` is one over the squared length of the ray.
    pub fn near(&self, eye: &Point3<f64>, ray: &Vector3<f64>, per_length: f64) -> bool {
        let way = self.ball.0 - eye;
        let along = way.dot(ray);
        way.norm_squared() - along * along * per_length <= self.ball.1
    }

    /// A point of the world in the solid's own axes.
    pub fn own(&self, point: &Point3<f64>) -> Vector3<f64> {
        self.world_from_own.inverse_transform_vector(&(point - self.origin))
    }

    /// The smallest positive `t` at which `eye + t * ray` enters the solid.
    pub fn meet(&self, eye: &Point3<f64>, ray: &Vector3<f64>) -> Option<f64> {
        let start = self.own(eye);
        let step = self.world_from_own.inverse_transform_vector(ray);
        let t = match self.form {
            Form::Ellipsoid(half) => {
                ball(start.component_div(&half), step.component_div(&half), 1.0)
            }
            Form::Block(half) => block(&start, &step, &half),
            Form::Capsule { length, first, second } => {
                capsule(&start, &step, length, first, second)
            }
        };
        t.filter(|t| *t > 1e-6)
    }

    /// The outward normal at a point of the surface.
    pub fn normal(&self, own: &Vector3<f64>) -> Vector3<f64> {
        let normal = match self.form {
            Form::Ellipsoid(half) => own.component_div(&half.component_mul(&half)),
            Form::Block(half) => block_normal(own, &half),
            Form::Capsule { length, first, second } => {
                let sine = (first - second) / length;
                let cosine = (1.0 - sine * sine).sqrt();
                let nearest = (own.z - own.xy().norm() * sine / cosine).clamp(0.0, length);
                own - Vector3::new(0.0, 0.0, nearest)
            }
        };
        self.world_from_own * normal.try_normalize(1e-12).unwrap_or_else(Vector3::z)
    }
}

/// Where a ray enters a ball about the origin.
fn ball(start: Vector3<f64>, step: Vector3<f64>, radius: f64) -> Option<f64> {
    let a = step.norm_squared();
    let b = start.dot(&step);
    let c = start.norm_squared() - radius * radius;
    let root = b * b - a * c;
    (root >= 0.0).then(|| (-b - root.sqrt()) / a)
}

/// Where a ray enters a block (slabs: Kay & Kajiya 1986).
fn block(start: &Vector3<f64>, step: &Vector3<f64>, half: &Vector3<f64>) -> Option<f64> {
    let (mut enter, mut leave) = (f64::NEG_INFINITY, f64::INFINITY);
    for axis in 0..3 {
        let inverse = 1.0 / step[axis];
        let (a, b) = ((-half[axis] - start[axis]) * inverse, (half[axis] - start[axis]) * inverse);
        enter = enter.max(a.min(b));
        leave = leave.min(a.max(b));
    }
    (enter <= leave).then_some(enter)
}

fn block_normal(own: &Vector3<f64>, half: &Vector3<f64>) -> Vector3<f64> {
    let axis = own.component_div(half).iamax();
    let mut normal = Vector3::zeros();
    normal[axis] = own[axis].signum();
    normal
}

/// Where a ray enters the hull of two balls. With `s` the sine of the mantle's
/// slope and `c` its cosine, mantle points satisfy `r c + z s = first`; the
/// mantle touches the balls at `first * s` and `length + second * s`.
fn capsule(
    start: &Vector3<f64>,
    step: &Vector3<f64>,
    length: f64,
    first: f64,
    second: f64,
) -> Option<f64> {
    let s = (first - second) / length;
    let c2 = 1.0 - s * s;
    let reach = first - s * start.z;
    let a = c2 * step.xy().norm_squared() - s * s * step.z * step.z;
    let b = c2 * start.xy().dot(&step.xy()) + s * step.z * reach;
    let c = c2 * start.xy().norm_squared() - reach * reach;
    let root = b * b - a * c;
    if root >= 0.0 && a.abs() > 1e-12 {
        let t = (-b - root.sqrt()) / a;
        let z = start.z + t * step.z;
        if (first * s..=length + second * s).contains(&z) {
            return Some(t);
        }
    }
    let far = start - Vector3::new(0.0, 0.0, length);
    match (ball(*start, *step, first), ball(far, *step, second)) {
        (Some(a), Some(b)) => Some(a.min(b)),
        (a, b) => a.or(b),
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
                    let point = eye + turn * ray * t;
                    let normal = shape.normal(&shape.own(&point));
                    prop_assert!(normal.dot(&(turn * ray)) < 1e-6);
                    prop_assert!(!inside(&form, &shape.own(&(point + normal * 2e-3))));
                    let (centre, radius) = shape.bound();
                    prop_assert!((point - centre).norm() < radius + 1e-9);
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
