//! Appearance of surfaces: colours and procedural patterns. Patterns are in the axes of their
//! solid, so that a stripe moves with its shirt.

use nalgebra::Vector3;

use crate::lanes::{LANES, Lanes, Vectors};
use crate::random::uniform_at;

/// Red, green and blue reflectance, 0 to 1, linear in light.
pub type Colour = [f64; 3];

/// A surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Main colour.
    pub colour: Colour,
    /// Second colour of the pattern; the hair of heads.
    pub second: Colour,
    /// Layout of the two colours.
    pub pattern: Pattern,
    /// Reflectance in the near infrared of a structured-light camera. Cloth that looks black to the
    /// eye is often not black there.
    pub infrared: f64,
    /// Fraction of the light that is mirrored.
    pub reflects: f64,
    /// Fraction of the light that passes through from behind; the rest is the surface's own.
    pub passes: f64,
    /// Light that it emits: it is as bright as if this much more light fell on it, lx.
    pub glow_lux: f64,
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
    /// A head with these half axes: face, hair, and the height of the hairline at the forehead as a
    /// fraction of the half height.
    Head {
        /// Half axes: forward, left, up, m.
        half: Vector3<f64>,
        /// Height of the hairline, 1 is the top of the head.
        hairline: f64,
    },
    /// A printed person on a sheet that spans Y and Z, with these half sides.
    Print(f64, f64),
}

impl Material {
    /// Creates a material with one colour.
    pub fn plain(colour: Colour) -> Self {
        // Bright cloth usually also reflects more infrared.
        Self {
            colour,
            second: colour,
            pattern: Pattern::Plain,
            infrared: 0.3 + 0.6 * luma(colour),
            reflects: 0.0,
            passes: 0.0,
            glow_lux: 0.0,
        }
    }

    /// Creates a silvered mirror, slightly dusty.
    pub fn mirror() -> Self {
        Self { reflects: 0.9, infrared: 0.0, ..Self::plain([0.5; 3]) }
    }

    /// Creates clear glass: its two faces together reflect some 8 % of the light at normal
    /// incidence (Fresnel, index 1.5).
    pub fn glass() -> Self {
        Self { reflects: 0.08, passes: 0.88, infrared: 0.0, ..Self::plain([0.4, 0.5, 0.45]) }
    }

    /// Returns the material with emitted light.
    pub fn glowing(self, glow_lux: f64) -> Self {
        Self { glow_lux, ..self }
    }

    /// Creates a material with two colours in a pattern.
    pub fn patterned(colour: Colour, second: Colour, pattern: Pattern) -> Self {
        Self { second, pattern, ..Self::plain(colour) }
    }

    /// Returns the material with another reflectance in the near infrared.
    pub fn with_infrared(self, infrared: f64) -> Self {
        Self { infrared, ..self }
    }

    /// Returns true for a surface that is neither a mirror nor glass.
    pub fn shows_itself(&self) -> bool {
        self.reflects == 0.0 && self.passes == 0.0
    }

    /// Returns the colour at a point in the solid's own axes.
    pub fn at(&self, own: &Vector3<f64>) -> Colour {
        match self.pattern {
            Pattern::Plain => self.colour,
            Pattern::Stripes(period) => self.blend(part(own.z / period) > 0.5),
            Pattern::Checks(side) => self.blend(odd(own, side) == 1),
            Pattern::Mottled(size) => mixed(self.colour, self.second, clouds(own, size)),
            Pattern::Planks(width) => mixed(self.colour, self.second, plank(own, width)),
            Pattern::Head { half, hairline } => self.head(&own.component_div(&half), hairline),
            Pattern::Print(half_width, half_height) => {
                self.print(own.y / half_width, own.z / half_height)
            }
        }
    }

    /// Returns red, green and blue at points in the solid's own axes; only the `wanted` ones count.
    pub fn colours(&self, own: &Vectors, wanted: &[bool; LANES]) -> [Lanes; 3] {
        let tones = match self.pattern {
            Pattern::Plain => return self.colour.map(|c| [c; LANES]),
            // Mixing with a tone of one would not give exactly the second colour.
            Pattern::Checks(side) => return self.chequered(own, side),
            Pattern::Mottled(size) => mottles(own, size),
            Pattern::Planks(width) => planks(own, width),
            Pattern::Stripes(_) | Pattern::Head { .. } | Pattern::Print(..) => {
                return self.colours_one_by_one(own, wanted);
            }
        };
        let tint = |c: usize| tones.map(|tone| between(self.colour[c], self.second[c], tone));
        [tint(0), tint(1), tint(2)]
    }

    fn chequered(&self, own: &Vectors, side: f64) -> [Lanes; 3] {
        let odd = checks(own, side);
        let tint = |c: usize| odd.map(|odd| if odd == 1 { self.second[c] } else { self.colour[c] });
        [tint(0), tint(1), tint(2)]
    }

    /// Computes the colours one by one. Small objects have so few pixels that vector instructions
    /// would not gain anything.
    fn colours_one_by_one(&self, own: &Vectors, wanted: &[bool; LANES]) -> [Lanes; 3] {
        let mut colours = [[0.0; LANES]; 3];
        for lane in (0..LANES).filter(|lane| wanted[*lane]) {
            let colour = self.at(&own.at(lane));
            (colours[0][lane], colours[1][lane], colours[2][lane]) =
                (colour[0], colour[1], colour[2]);
        }
        colours
    }

    fn blend(&self, second: bool) -> Colour {
        if second { self.second } else { self.colour }
    }

    /// Returns the colour of a head; `n` is the point on the unit ball: x forward, y left, z up.
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

    /// Returns the colour of a printed head and shoulders in clothes of the second colour; -1 to 1
    /// in both directions.
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

/// Returns the brightness of a colour, 0 to 1 (weights of ITU-R BT.709).
pub fn luma(colour: Colour) -> f64 {
    0.2126 * colour[0] + 0.7152 * colour[1] + 0.0722 * colour[2]
}

/// Returns a colour made brighter or darker.
pub fn scaled(colour: Colour, by: f64) -> Colour {
    colour.map(|c| (c * by).min(1.0))
}

fn mixed(a: Colour, b: Colour, part: f64) -> Colour {
    [0, 1, 2].map(|i| between(a[i], b[i], part))
}

#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn checks(own: &Vectors, side: f64) -> [i64; LANES] {
    let mut checks = [0; LANES];
    for lane in 0..LANES {
        checks[lane] = odd(&own.at(lane), side);
    }
    checks
}

#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn mottles(own: &Vectors, size: f64) -> Lanes {
    let mut tones = [0.0; LANES];
    for lane in 0..LANES {
        tones[lane] = clouds(&own.at(lane), size);
    }
    tones
}

#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn planks(own: &Vectors, width: f64) -> Lanes {
    let mut tones = [0.0; LANES];
    for lane in 0..LANES {
        tones[lane] = plank(&own.at(lane), width);
    }
    tones
}

// Without branches, so that loops over lanes become vector instructions. Integers wrap, because a
// check for overflow would be a branch.

/// Returns one where the indices of the squares along all axes add up to an odd number, zero
/// elsewhere.
#[inline(always)]
fn odd(own: &Vector3<f64>, side: f64) -> i64 {
    (floor(own.x / side) ^ floor(own.y / side) ^ floor(own.z / side)) & 1
}

/// Returns the tone of a floor board, 0 to 1.
#[inline(always)]
fn plank(own: &Vector3<f64>, width: f64) -> f64 {
    let row = floor(own.y / width) as u64;
    let board = floor(own.x / (8.0 * width) + uniform_at(11, row)) as u64;
    let tone = uniform_at(row, board);
    // Boards are horizontal, so their grain does not depend on the height.
    let x = own.x * 0.1;
    let y = own.y;
    let size = 0.15 * width;
    let fine = 2.3 / size;
    let grain = 0.65 * flat_noise(x / size, y / size) + 0.35 * flat_noise(x * fine, y * fine);
    0.6 * tone + 0.4 * grain
}

/// Returns value noise of two octaves, 0 to 1.
#[inline(always)]
fn clouds(own: &Vector3<f64>, size: f64) -> f64 {
    let fine = 2.3 / size;
    let coarse = value_noise(own.x / size, own.y / size, own.z / size);
    0.65 * coarse + 0.35 * value_noise(own.x * fine, own.y * fine, own.z * fine)
}

/// Adding this number leaves no fractional digits: half of those of a mantissa are above it.
const WHOLE: f64 = 6_755_399_441_055_744.0;

/// Returns the largest integer that is not larger, for numbers below 2^51. `f64::floor` would call
/// a function if the target processor may lack the instruction, and conversions to 64 bits are not
/// vector instructions before AVX-512.
#[inline(always)]
fn floor(value: f64) -> i64 {
    let shifted = value + WHOLE;
    let nearest = (shifted.to_bits() as i64).wrapping_sub(WHOLE.to_bits() as i64);
    nearest.wrapping_sub(i64::from(shifted - WHOLE > value))
}

/// Returns the fractional part of a number, above its [`floor`].
#[inline(always)]
fn part(value: f64) -> f64 {
    let whole = (value + WHOLE) - WHOLE;
    value - if whole > value { whole - 1.0 } else { whole }
}

#[inline(always)]
fn smooth(part: f64) -> f64 {
    part * part * (3.0 - 2.0 * part)
}

/// Returns smoothly interpolated random values at the corners of a grid.
#[inline(always)]
fn value_noise(x: f64, y: f64, z: f64) -> f64 {
    let below = floor(z);
    let above = floor(z).wrapping_add(1);
    between(layer(x, y, below), layer(x, y, above), smooth(part(z)))
}

/// Returns [`value_noise`] in the plane `z = 0`, where the layer above has no weight.
#[inline(always)]
fn flat_noise(x: f64, y: f64) -> f64 {
    layer(x, y, 0)
}

/// Interpolates one layer of the grid.
#[inline(always)]
fn layer(x: f64, y: f64, layer: i64) -> f64 {
    let column = floor(x);
    let row = floor(y);
    let along = smooth(part(x));
    let across = smooth(part(y));
    let next_column = column.wrapping_add(1);
    let next_row = row.wrapping_add(1);
    let near = between(corner(column, row, layer), corner(next_column, row, layer), along);
    let far = between(corner(column, next_row, layer), corner(next_column, next_row, layer), along);
    between(near, far, across)
}

#[inline(always)]
fn between(a: f64, b: f64, part: f64) -> f64 {
    a + (b - a) * part
}

/// Returns the random value at a corner. Large primes spread neighbouring cells over the keys
/// (Teschner et al., VMV 2003).
#[inline(always)]
fn corner(column: i64, row: i64, layer: i64) -> f64 {
    let key = column.wrapping_mul(73_856_093) ^ row.wrapping_mul(19_349_663);
    uniform_at(3, (key ^ layer.wrapping_mul(83_492_791)) as u64)
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
            let a = Vector3::new(x, y, 0.0);
            let b = Vector3::new(x + 1e-6, y, 0.0);
            prop_assert!((clouds(&a, 0.1) - clouds(&b, 0.1)).abs() < 1e-3);
        }
    }
}
