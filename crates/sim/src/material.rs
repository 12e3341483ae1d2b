//! Appearance of surfaces: colours and procedural patterns. Patterns lie in the axes of the solid
//! that they are on, so that a stripe moves with its shirt.

use nalgebra::Vector3;

use crate::random::uniform_at;

/// Red, green and blue reflectance, 0 to 1, linear in light.
pub type Colour = [f64; 3];

/// A surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// The colour that most of it has.
    pub colour: Colour,
    /// The other colour of the pattern; hair on heads.
    pub second: Colour,
    /// Layout of the two colours.
    pub pattern: Pattern,
    /// Reflectance in the near infrared of a structured-light camera. Cloth that
    /// is black to the eye often is not black there.
    pub infrared: f64,
}

/// Layout of the two colours of a surface. Lengths in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pattern {
    /// One colour.
    Plain,
    /// Rings across the solid's Z axis, one pair every this many metres.
    Stripes(f64),
    /// A chequered pattern with squares of this size.
    Checks(f64),
    /// Cloudy, with spots of this size.
    Mottled(f64),
    /// Floor boards of this width along X.
    Planks(f64),
    /// A head with these half axes: face, hair and the hairline's height at the
    /// forehead as a fraction of the half height.
    Head {
        /// Half axes: forward, left, up, m.
        half: Vector3<f64>,
        /// Height of the hairline, 1 is the top of the head.
        hairline: f64,
    },
    /// A printed person on a sheet that spans Y and Z, half sides given.
    Print(f64, f64),
}

impl Material {
    /// One colour.
    pub fn plain(colour: Colour) -> Self {
        // Bright cloth usually reflects more infrared, too.
        Self { colour, second: colour, pattern: Pattern::Plain, infrared: 0.3 + 0.6 * luma(colour) }
    }

    /// Two colours in a pattern.
    pub fn patterned(colour: Colour, second: Colour, pattern: Pattern) -> Self {
        Self { second, pattern, ..Self::plain(colour) }
    }

    /// The same with another reflectance in the near infrared.
    pub fn with_infrared(self, infrared: f64) -> Self {
        Self { infrared, ..self }
    }

    /// The colour at a point in the solid's own axes.
    pub fn at(&self, own: &Vector3<f64>) -> Colour {
        match self.pattern {
            Pattern::Plain => self.colour,
            Pattern::Stripes(period) => self.blend(part(own.z / period) > 0.5),
            Pattern::Checks(side) => {
                let cells = own.map(|v| floor(v / side));
                self.blend((cells.x ^ cells.y ^ cells.z) & 1 == 1)
            }
            Pattern::Mottled(size) => mixed(self.colour, self.second, clouds(own, size)),
            Pattern::Planks(width) => self.planks(own, width),
            Pattern::Head { half, hairline } => self.head(&own.component_div(&half), hairline),
            Pattern::Print(half_width, half_height) => {
                self.print(own.y / half_width, own.z / half_height)
            }
        }
    }

    fn blend(&self, second: bool) -> Colour {
        if second { self.second } else { self.colour }
    }

    fn planks(&self, own: &Vector3<f64>, width: f64) -> Colour {
        let row = floor(own.y / width) as u64;
        let board = floor(own.x / (8.0 * width) + uniform_at(11, row)) as u64;
        let tone = uniform_at(row, board);
        let grain = clouds(&Vector3::new(own.x * 0.1, own.y, 0.0), 0.15 * width);
        mixed(self.colour, self.second, 0.6 * tone + 0.4 * grain)
    }

    /// `n` is the point on the unit ball: x forward, y left, z up.
    fn head(&self, n: &Vector3<f64>, hairline: f64) -> Colour {
        // The hairline is high at the forehead and low at the neck.
        let line = hairline - (1.4 * (0.55 - n.x)).clamp(0.0, 1.2);
        if n.z > line {
            let strand = uniform_at(5, (n.y * 60.0) as i64 as u64);
            return scaled(self.second, 0.8 + 0.4 * strand);
        }
        if n.x > 0.2 { self.face(n.y.abs(), n.y, n.z) } else { self.colour }
    }

    fn face(&self, side: f64, y: f64, z: f64) -> Colour {
        let within = |cy: f64, cz: f64, ry: f64, rz: f64| {
            ((side - cy) / ry).powi(2) + ((z - cz) / rz).powi(2) < 1.0
        };
        if within(0.36, 0.10, 0.06, 0.07) {
            return [0.02, 0.015, 0.01];
        }
        if within(0.36, 0.10, 0.15, 0.07) {
            return [0.65, 0.62, 0.6];
        }
        if within(0.38, 0.28, 0.20, 0.05) {
            return scaled(self.second, 0.7);
        }
        if y.abs() < 0.26 && (z + 0.50).abs() < 0.06 {
            return [0.8 * self.colour[0], 0.4 * self.colour[1], 0.4 * self.colour[2]];
        }
        if within(0.09, -0.24, 0.05, 0.03) || within(0.37, 0.12, 0.24, 0.16) {
            return scaled(self.colour, 0.6);
        }
        self.colour
    }

    /// A head and shoulders in the second colour's clothes; -1 to 1 both ways.
    fn print(&self, y: f64, z: f64) -> Colour {
        const SKIN: Colour = [0.55, 0.36, 0.27];
        let ellipse = |cz: f64, ry: f64, rz: f64| (y / ry).powi(2) + ((z - cz) / rz).powi(2) < 1.0;
        if ellipse(0.58, 0.20, 0.16) && z > 0.62 {
            [0.05, 0.04, 0.03]
        } else if ellipse(0.55, 0.19, 0.17) || (y.abs() < 0.08 && z < 0.5 && z > 0.3) {
            SKIN
        } else if ellipse(-0.35, 0.62, 0.70) {
            self.second
        } else {
            self.colour
        }
    }
}

/// Brightness of a colour, 0 to 1 (weights of ITU-R BT.709).
pub fn luma(colour: Colour) -> f64 {
    0.2126 * colour[0] + 0.7152 * colour[1] + 0.0722 * colour[2]
}

/// A colour made brighter or darker.
pub fn scaled(colour: Colour, by: f64) -> Colour {
    colour.map(|c| (c * by).min(1.0))
}

fn mixed(a: Colour, b: Colour, part: f64) -> Colour {
    [0, 1, 2].map(|i| a[i] + (b[i] - a[i]) * part)
}

/// Value noise of two octaves, 0 to 1.
fn clouds(own: &Vector3<f64>, size: f64) -> f64 {
    0.65 * value_noise(&(own / size)) + 0.35 * value_noise(&(own * (2.3 / size)))
}

/// The largest whole number that is not larger. `f64::floor` calls a function
/// where the processor need not have an instruction for it.
fn floor(value: f64) -> i64 {
    let towards_zero = value as i64;
    towards_zero - i64::from(value < towards_zero as f64)
}

/// Returns the part of a number above its [`floor`].
fn part(value: f64) -> f64 {
    value - floor(value) as f64
}

fn smooth(part: f64) -> f64 {
    part * part * (3.0 - 2.0 * part)
}

/// Random values at the corners of a grid, smoothly joined.
fn value_noise(p: &Vector3<f64>) -> f64 {
    let cell = p.map(floor);
    let part = p.map(|v| smooth(part(v)));
    let corner = |i: u64| {
        let at = |axis: usize| cell[axis] + ((i >> axis) & 1) as i64;
        // Large primes spread neighbouring cells over the keys (Teschner et al., VMV 2003).
        let key = at(0).wrapping_mul(73_856_093) ^ at(1).wrapping_mul(19_349_663);
        uniform_at(3, (key ^ at(2).wrapping_mul(83_492_791)) as u64)
    };
    let along = |axis: usize, a: f64, b: f64| a + (b - a) * part[axis];
    let edge = |i: u64| along(0, corner(i), corner(i + 1));
    along(2, along(1, edge(0), edge(2)), along(1, edge(4), edge(6)))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_face_has_dark_eyes_under_hair_and_a_bare_cheek() {
        let half = Vector3::new(0.1, 0.08, 0.11);
        let head = Material::patterned([0.5; 3], [0.1; 3], Pattern::Head { half, hairline: 0.6 });
        let at = |y: f64, z: f64| {
            let n = Vector3::new((1.0 - y * y - z * z).sqrt(), y, z);
            luma(head.at(&n.component_mul(&half)))
        };
        assert!(at(0.36, 0.10) < 0.05 && at(-0.36, 0.10) < 0.05);
        assert!(at(0.0, 0.9) < 0.2 && (at(0.4, -0.3) - 0.5).abs() < 1e-9);
        let nape = Vector3::new(-1.0, 0.0, 0.0).component_mul(&half);
        assert!(luma(head.at(&nape)) < 0.2, "hair reaches down behind");
    }

    proptest! {
        #[test]
        fn every_pattern_stays_between_black_and_white(
            x in -9.0..9.0f64, y in -9.0..9.0f64, z in -9.0..9.0f64,
        ) {
            for pattern in [
                Pattern::Plain, Pattern::Stripes(0.1), Pattern::Checks(0.2), Pattern::Mottled(0.1),
                Pattern::Planks(0.12), Pattern::Print(0.3, 0.8),
            ] {
                let colour = Material::patterned([0.9; 3], [0.1; 3], pattern).at(&Vector3::new(x, y, z));
                prop_assert!(colour.iter().all(|c| (0.0..=1.0).contains(c)));
            }
        }

        #[test]
        fn clouds_are_continuous(x in -3.0..3.0f64, y in -3.0..3.0f64) {
            let (a, b) = (Vector3::new(x, y, 0.0), Vector3::new(x + 1e-6, y, 0.0));
            prop_assert!((clouds(&a, 0.1) - clouds(&b, 0.1)).abs() < 1e-3);
        }
    }
}
