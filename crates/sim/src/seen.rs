//! Intersection of a ray and a solid, split into the part that depends on the eye alone, computed
//! once per image, and the part that depends on the ray, computed millions of times.

use nalgebra::{Matrix3, Vector3};

/// A solid as it is seen from one point.
#[derive(Clone, Copy, Debug)]
pub struct SolidView {
    /// From the world's axes to those in which the solid is simple: its own,
    /// divided by the half axes where there are any.
    turn: Matrix3<f64>,
    /// The eye in these.
    start: Vector3<f64>,
    solid: Solid,
}

#[derive(Clone, Copy, Debug)]
enum Solid {
    /// The ball of radius one; the eye's squared distance from its surface
    /// along a tangent.
    Ball {
        tangent2: f64,
    },
    /// The block of half side one.
    Block,
    Capsule(Capsule),
}

/// The hull of two balls. With `s` the sine of the mantle's slope and `c` its
/// cosine, mantle points satisfy `r c + z s = first`; the mantle touches the
/// balls at `first * s` and `length + second * s`.
#[derive(Clone, Copy, Debug)]
struct Capsule {
    length: f64,
    sine: f64,
    cosine2: f64,
    /// `first - s z` at the eye.
    reach: f64,
    /// The mantle's constant term.
    mantle: f64,
    /// Where the mantle begins and ends.
    ends: [f64; 2],
    /// As of [`Solid::Ball`], for the two balls.
    tangent2: [f64; 2],
}

impl SolidView {
    /// An ellipsoid in its own axes, which `turn` leads to.
    pub fn ellipsoid(turn: &Matrix3<f64>, eye: &Vector3<f64>, half: &Vector3<f64>) -> Self {
        let start = eye.component_div(half);
        let solid = Solid::Ball { tangent2: start.norm_squared() - 1.0 };
        Self { turn: divided(turn, half), start, solid }
    }

    /// A block in its own axes.
    pub fn block(turn: &Matrix3<f64>, eye: &Vector3<f64>, half: &Vector3<f64>) -> Self {
        Self { turn: divided(turn, half), start: eye.component_div(half), solid: Solid::Block }
    }

    /// A capsule in its own axes.
    pub fn capsule(
        turn: &Matrix3<f64>,
        eye: &Vector3<f64>,
        length: f64,
        first: f64,
        second: f64,
    ) -> Self {
        let sine = (first - second) / length;
        let cosine2 = 1.0 - sine * sine;
        let reach = first - sine * eye.z;
        let far = eye - Vector3::new(0.0, 0.0, length);
        let capsule = Capsule {
            length,
            sine,
            cosine2,
            reach,
            mantle: cosine2 * eye.xy().norm_squared() - reach * reach,
            ends: [first * sine, length + second * sine],
            tangent2: [eye.norm_squared() - first * first, far.norm_squared() - second * second],
        };
        Self { turn: *turn, start: *eye, solid: Solid::Capsule(capsule) }
    }

    /// The smallest positive number of lengths of the ray after which it enters.
    pub fn meet(&self, ray: &Vector3<f64>) -> Option<f64> {
        let step = self.turn * ray;
        let t = match &self.solid {
            Solid::Ball { tangent2 } => enter_ball(&self.start, &step, *tangent2),
            Solid::Block => enter_block(&self.start, &step),
            Solid::Capsule(capsule) => capsule.enter(&self.start, &step),
        };
        t.filter(|t| *t > 1e-6)
    }
}

fn divided(turn: &Matrix3<f64>, half: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::from_diagonal(&half.map(f64::recip)) * turn
}

fn enter_ball(start: &Vector3<f64>, step: &Vector3<f64>, tangent2: f64) -> Option<f64> {
    let a = step.norm_squared();
    let b = start.dot(step);
    let root = b * b - a * tangent2;
    (root >= 0.0).then(|| (-b - root.sqrt()) / a)
}

/// Slabs: Kay & Kajiya 1986.
fn enter_block(start: &Vector3<f64>, step: &Vector3<f64>) -> Option<f64> {
    let (mut enter, mut leave) = (f64::NEG_INFINITY, f64::INFINITY);
    for axis in 0..3 {
        let inverse = 1.0 / step[axis];
        let (a, b) = ((-1.0 - start[axis]) * inverse, (1.0 - start[axis]) * inverse);
        enter = enter.max(a.min(b));
        leave = leave.min(a.max(b));
    }
    (enter <= leave).then_some(enter)
}

impl Capsule {
    fn enter(&self, start: &Vector3<f64>, step: &Vector3<f64>) -> Option<f64> {
        let a = self.cosine2 * step.xy().norm_squared() - self.sine * self.sine * step.z * step.z;
        let b = self.cosine2 * start.xy().dot(&step.xy()) + self.sine * step.z * self.reach;
        let root = b * b - a * self.mantle;
        if a.abs() > 1e-12 {
            // The mantle goes on without end and has the balls inside of it.
            if root < 0.0 {
                return None;
            }
            let t = (-b - root.sqrt()) / a;
            let z = start.z + t * step.z;
            if (self.ends[0]..=self.ends[1]).contains(&z) {
                return Some(t);
            }
        }
        let far = start - Vector3::new(0.0, 0.0, self.length);
        let balls =
            (enter_ball(start, step, self.tangent2[0]), enter_ball(&far, step, self.tangent2[1]));
        match balls {
            (Some(a), Some(b)) => Some(a.min(b)),
            (a, b) => a.or(b),
        }
    }
}
