//! Intersection of a ray and a solid, split into the part that depends only on the eye, computed
//! once per image, and the part that depends on the ray, computed millions of times.

use nalgebra::{Matrix3, Vector3};

use crate::lanes::{LANES, Lanes, Vectors, dot, product};

/// A solid as it is seen from one point.
#[derive(Clone, Copy, Debug)]
pub struct SolidView {
    /// Rotation from the world's axes to those in which the solid is simple: its own, divided by
    /// the half axes if there are any.
    turn: Matrix3<f64>,
    /// Position of the eye in these axes.
    start: Vector3<f64>,
    solid: Solid,
}

#[derive(Clone, Copy, Debug)]
enum Solid {
    /// The ball of radius one; with the squared length of the tangent from the eye.
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
    /// Start and end of the mantle.
    ends: [f64; 2],
    /// As for [`Solid::Ball`], for the two balls.
    tangent2: [f64; 2],
}

impl SolidView {
    /// Creates the view of an ellipsoid in its own axes, to which `turn` leads.
    pub fn ellipsoid(turn: &Matrix3<f64>, eye: &Vector3<f64>, half: &Vector3<f64>) -> Self {
        let start = eye.component_div(half);
        let solid = Solid::Ball { tangent2: start.norm_squared() - 1.0 };
        Self { turn: divided(turn, half), start, solid }
    }

    /// Creates the view of a block in its own axes.
    pub fn block(turn: &Matrix3<f64>, eye: &Vector3<f64>, half: &Vector3<f64>) -> Self {
        Self { turn: divided(turn, half), start: eye.component_div(half), solid: Solid::Block }
    }

    /// Creates the view of a capsule in its own axes.
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

    /// Returns the smallest positive distance, in ray lengths, at which the ray enters the solid.
    pub fn meet(&self, ray: &Vector3<f64>) -> Option<f64> {
        let t = match &self.solid {
            Solid::Ball { tangent2 } => self.meet_ball(*tangent2, ray),
            Solid::Block => self.meet_block(ray),
            Solid::Capsule(capsule) => self.meet_capsule(capsule, ray),
        };
        (t < f64::INFINITY).then_some(t)
    }

    /// Shortens the distance `t` of each ray that hits this solid, with index `number`, before its
    /// present end. No part of the solid is closer to the eye than `nearest`.
    #[inline(always)]
    pub fn shorten(&self, rays: &Vectors, nearest: f64, number: u64, met: &mut Met) {
        match &self.solid {
            Solid::Ball { tangent2 } => {
                for lane in 0..LANES {
                    let t = self.meet_ball(*tangent2, &rays.at(lane));
                    met.shorten(lane, t, nearest, number);
                }
            }
            Solid::Block => {
                for lane in 0..LANES {
                    let t = self.meet_block(&rays.at(lane));
                    met.shorten(lane, t, nearest, number);
                }
            }
            Solid::Capsule(capsule) => {
                for lane in 0..LANES {
                    let t = self.meet_capsule(capsule, &rays.at(lane));
                    met.shorten(lane, t, nearest, number);
                }
            }
        }
    }

    /// Sets `barred` to one for each ray that hits this solid within `reach` ray lengths.
    #[inline(always)]
    pub fn bar(&self, rays: &Vectors, reach: f64, barred: &mut [u64; LANES]) {
        match &self.solid {
            Solid::Ball { tangent2 } => {
                for lane in 0..LANES {
                    let t = self.meet_ball(*tangent2, &rays.at(lane));
                    barred[lane] |= u64::from(t < reach);
                }
            }
            Solid::Block => {
                for lane in 0..LANES {
                    let t = self.meet_block(&rays.at(lane));
                    barred[lane] |= u64::from(t < reach);
                }
            }
            Solid::Capsule(capsule) => {
                for lane in 0..LANES {
                    let t = self.meet_capsule(capsule, &rays.at(lane));
                    barred[lane] |= u64::from(t < reach);
                }
            }
        }
    }

    // Without branches, so that loops over lanes become vector instructions; infinite for a ray
    // that misses.

    #[inline(always)]
    fn meet_ball(&self, tangent2: f64, ray: &Vector3<f64>) -> f64 {
        ahead(enter_ball(&self.start, &product(&self.turn, ray), tangent2))
    }

    #[inline(always)]
    fn meet_block(&self, ray: &Vector3<f64>) -> f64 {
        ahead(enter_block(&self.start, &product(&self.turn, ray)))
    }

    #[inline(always)]
    fn meet_capsule(&self, capsule: &Capsule, ray: &Vector3<f64>) -> f64 {
        ahead(capsule.enter(&self.start, &product(&self.turn, ray)))
    }
}

/// Distance of each ray, and the index of the solid that it hits there.
#[derive(Clone, Copy, Debug)]
pub struct Met {
    /// Distances in ray lengths; infinite if the ray hits nothing.
    pub t: Lanes,
    /// Index of the solid; [`Met::NONE`] if the ray hits nothing.
    pub number: [u64; LANES],
}

impl Met {
    /// Index that stands for no solid.
    pub const NONE: u64 = u64::MAX;
    /// Rays that have not hit anything yet.
    pub const NOTHING: Self = Self { t: [f64::INFINITY; LANES], number: [Self::NONE; LANES] };

    /// Returns true if any ray goes farther than `nearest`.
    #[inline(always)]
    pub fn reaches(&self, nearest: f64) -> bool {
        let far: u64 = self.t.iter().fold(0, |far, t| far | u64::from(*t >= nearest));
        far != 0
    }

    #[inline(always)]
    fn shorten(&mut self, lane: usize, t: f64, nearest: f64, number: u64) {
        let nearer = (t < self.t[lane]) & (nearest <= self.t[lane]);
        self.t[lane] = if nearer { t } else { self.t[lane] };
        self.number[lane] = if nearer { number } else { self.number[lane] };
    }
}

fn divided(turn: &Matrix3<f64>, half: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::from_diagonal(&half.map(f64::recip)) * turn
}

/// Excludes distances behind the eye, and those to the surface on which the eye lies.
#[inline(always)]
fn ahead(t: f64) -> f64 {
    if t > 1e-6 { t } else { f64::INFINITY }
}

#[inline(always)]
fn enter_ball(start: &Vector3<f64>, step: &Vector3<f64>, tangent2: f64) -> f64 {
    let a = dot(step, step);
    let b = dot(start, step);
    let root = b * b - a * tangent2;
    let t = (-b - root.sqrt()) / a;
    if root >= 0.0 { t } else { f64::INFINITY }
}

/// Intersects a ray with a block by the slab method (Kay & Kajiya 1986).
#[inline(always)]
fn enter_block(start: &Vector3<f64>, step: &Vector3<f64>) -> f64 {
    #[inline(always)]
    fn along(start: f64, step: f64) -> (f64, f64) {
        let inverse = 1.0 / step;
        let a = (-1.0 - start) * inverse;
        let b = (1.0 - start) * inverse;
        (a.min(b), a.max(b))
    }

    let x = along(start.x, step.x);
    let y = along(start.y, step.y);
    let z = along(start.z, step.z);
    let enter = f64::NEG_INFINITY.max(x.0).max(y.0).max(z.0);
    let leave = f64::INFINITY.min(x.1).min(y.1).min(z.1);
    if enter <= leave { enter } else { f64::INFINITY }
}

impl Capsule {
    #[inline(always)]
    fn enter(&self, start: &Vector3<f64>, step: &Vector3<f64>) -> f64 {
        let across = step.x * step.x + step.y * step.y;
        let a = self.cosine2 * across - self.sine * self.sine * step.z * step.z;
        let off = start.x * step.x + start.y * step.y;
        let b = self.cosine2 * off + self.sine * step.z * self.reach;
        let root = b * b - a * self.mantle;
        let t = (-b - root.sqrt()) / a;
        let z = start.z + t * step.z;
        let slanted = a.abs() > 1e-12;
        let on_mantle = slanted & (z >= self.ends[0]) & (z <= self.ends[1]);
        let far = Vector3::new(start.x, start.y, start.z - self.length);
        let near = enter_ball(start, step, self.tangent2[0]);
        let balls = near.min(enter_ball(&far, step, self.tangent2[1]));
        let t = if on_mantle { t } else { balls };
        // The mantle extends to infinity and contains the balls.
        if slanted & (root < 0.0) { f64::INFINITY } else { t }
    }
}
