//! Shadows: for each direction from a lamp, the few solids that may be there. Solids at rest are
//! sorted into cells of directions (the light buffer of Haines & Greenberg 1986, on the faces of a
//! cube); moving solids have bounding balls around groups, which take less time to build than cells
//! for every image.

use std::ops::Range;

use nalgebra::{Point3, Vector3};

use crate::lanes::{LANES, Lanes, Vectors, dot};
use crate::seen::SolidView;
use crate::shape::Shape;
use crate::sight::{before, between};

/// Number of cells along the side of a face of the cube.
pub const SIDE: usize = 32;
/// A bundle of rays through more cells is tested against each solid instead.
const MOST_CELLS: usize = 64;
/// Margin for rounding, m, and on a face, whose half side is 1.
const SLACK_M: f64 = 1e-4;
const SLACK: f64 = 1e-6;

/// Centre of a ball as seen from the lamp, and its radius, m.
type Ball = (Vector3<f64>, f64);

/// Objects around a lamp that cast shadows.
#[derive(Clone, Debug)]
pub struct Shadows {
    lamp: Point3<f64>,
    shapes: Vec<Shape>,
    /// The objects as the lamp sees them.
    solids: Vec<SolidView>,
    /// Bounding balls of the solids.
    balls: Vec<Ball>,
    index: Index,
}

/// Index of the solids that may intersect a bundle of rays.
#[derive(Clone, Debug)]
enum Index {
    Cells(Cells),
    /// Bounding balls of groups of solids, and the indices of these.
    Groups(Vec<(Ball, Range<u32>)>),
}

/// Solids by their directions.
#[derive(Clone, Debug)]
struct Cells {
    /// Cells along the side of a face.
    side: usize,
    /// Indices of solids, cell by cell.
    numbers: Vec<u32>,
    /// End of the indices of each cell, for six faces of rows of cells.
    ends: Vec<u32>,
}

impl Shadows {
    /// Creates the shadows of solids at rest, with faces of `side` by `side` cells.
    pub fn still<'a>(
        side: usize,
        lamp: Point3<f64>,
        solids: impl Iterator<Item = (Option<u16>, &'a Shape)> + Clone,
    ) -> Self {
        let index = Index::Cells(Cells::new(side, lamp, solids.clone()));
        let mut shadows = Self::none(lamp, index);
        shadows.add(solids.map(|(_, solid)| solid));
        shadows
    }

    /// Creates the shadows of moving objects, given by the solids of each.
    pub fn moving<'a, S: Iterator<Item = &'a Shape>>(
        lamp: Point3<f64>,
        objects: impl Iterator<Item = S>,
    ) -> Self {
        let mut groups = Vec::new();
        let mut shadows = Self::none(lamp, Index::Groups(Vec::new()));
        for solids in objects {
            let first = shadows.balls.len();
            shadows.add(solids);
            let balls = &shadows.balls[first..];
            if !balls.is_empty() {
                groups.push((around(balls), first as u32..shadows.balls.len() as u32));
            }
        }
        shadows.index = Index::Groups(groups);
        shadows
    }

    fn none(lamp: Point3<f64>, index: Index) -> Self {
        Self { lamp, shapes: Vec::new(), solids: Vec::new(), balls: Vec::new(), index }
    }

    fn add<'a>(&mut self, solids: impl Iterator<Item = &'a Shape>) {
        for solid in solids {
            let (centre, radius) = solid.bound();
            self.shapes.push(*solid);
            self.solids.push(solid.seen_from(&self.lamp));
            self.balls.push((centre - self.lamp, radius));
        }
    }

    /// Returns true if a solid blocks the ray from the lamp to a point.
    pub fn on(&self, way: &Vector3<f64>) -> bool {
        match &self.index {
            Index::Cells(cells) => cells.on_way(way).iter().any(|number| self.is_in(*number, way)),
            Index::Groups(groups) => {
                let bundle = Bundle::new(*way, *way);
                let near = groups.iter().filter(|(ball, _)| bundle.reaches(ball));
                near.flat_map(|(_, numbers)| numbers.clone()).any(|number| self.is_in(number, way))
            }
        }
    }

    /// Returns true if this solid blocks the ray from the lamp to a point.
    fn is_in(&self, number: u32, way: &Vector3<f64>) -> bool {
        self.solids[number as usize].meet(way).is_some_and(|t| t < 1.0)
    }

    /// Writes the indices of all solids that may block a ray of a bundle, and perhaps of some
    /// others, to `found`.
    pub fn find(&self, bundle: &Bundle, found: &mut Vec<u32>) {
        found.clear();
        match &self.index {
            Index::Cells(cells) => {
                if !cells.find(bundle, found) {
                    found.extend(0..self.solids.len() as u32);
                }
            }
            Index::Groups(groups) => {
                for (_, numbers) in groups.iter().filter(|(ball, _)| bundle.reaches(ball)) {
                    found.extend(numbers.clone());
                }
            }
        }
        found.retain(|number| bundle.reaches(&self.balls[*number as usize]));
        // The test of a solid's shape is expensive, but less so than all that its ball would let
        // through.
        if !found.is_empty()
            && let Some(sides) = bundle.sides()
        {
            found.retain(|number| self.shapes[*number as usize].reaches(&self.lamp, &sides));
        }
    }

    /// Returns the rays of interest, as bits, that some of these solids block; the solids are those
    /// of [`Shadows::find`] for a bundle of these rays.
    pub fn bar(&self, numbers: &[u32], ways: &Vectors, interest: u32) -> u32 {
        if numbers.is_empty() || interest == 0 {
            return 0;
        }
        let (low, high) = bounds(ways, interest);
        barred(self, numbers, &Bundle::new(low, high), ways, interest) & interest
    }
}

impl Cells {
    fn new<'a>(
        side: usize,
        lamp: Point3<f64>,
        solids: impl Iterator<Item = (Option<u16>, &'a Shape)> + Clone,
    ) -> Self {
        let mut cells = Self { side, numbers: Vec::new(), ends: Vec::new() };
        for face in 0..6 {
            // Most solids are on one face only.
            let forward = on_face(face, 0.0, 0.0);
            let sights = before(
                solids.clone(),
                &lamp,
                &forward,
                [row_ends(face, -1.0), row_ends(face, 1.0)],
            );
            let sights = between(&sights, column_ends(face, -1.0), column_ends(face, 1.0));
            for above in 0..side {
                let top = row_ends(face, line(above, side));
                let bottom = row_ends(face, line(above + 1, side));
                let strip = between(sights.iter().copied(), top, bottom);
                for left in 0..side {
                    let start = column_ends(face, line(left, side));
                    let end = column_ends(face, line(left + 1, side));
                    let cell = between(strip.iter().copied(), start, end);
                    cells.numbers.extend(cell.iter().map(|sight| sight.number));
                    cells.ends.push(cells.numbers.len() as u32);
                }
            }
        }
        cells
    }

    /// Writes the indices of the solids in the cells of a bundle; returns false if it passes
    /// through several faces or many cells.
    fn find(&self, bundle: &Bundle, found: &mut Vec<u32>) -> bool {
        let Some((face, [left, right], [top, bottom])) = self.through(bundle) else { return false };
        for row in top..=bottom {
            for column in left..=right {
                let cell = (face * self.side + row) * self.side + column;
                found.extend_from_slice(self.within(cell));
            }
        }
        found.sort_unstable();
        found.dedup();
        true
    }

    /// Returns the face through which a bundle passes, and the ranges of columns and rows of cells
    /// there; `None` if it passes through several faces or many cells.
    fn through(&self, bundle: &Bundle) -> Option<(usize, [usize; 2], [usize; 2])> {
        let main = bundle.main_axis()?;
        let columns = bundle.cells_along((main + 1) % 3, main, self.side);
        let rows = bundle.cells_along((main + 2) % 3, main, self.side);
        let count = (columns[1] - columns[0] + 1) * (rows[1] - rows[0] + 1);
        let face = 2 * main + usize::from(bundle.high[main] < 0.0);
        (count <= MOST_CELLS).then_some((face, columns, rows))
    }

    /// Returns the indices of the solids in the cell through which a ray passes.
    fn on_way(&self, way: &Vector3<f64>) -> &[u32] {
        self.within(cell(way, self.side) as usize)
    }

    /// Returns the indices of the solids in a cell.
    fn within(&self, cell: usize) -> &[u32] {
        let start = cell.checked_sub(1).map_or(0, |before| self.ends[before]);
        &self.numbers[start as usize..self.ends[cell] as usize]
    }
}

/// Returns a bounding ball of some others, of which there is at least one.
fn around(balls: &[Ball]) -> Ball {
    let mut low = Vector3::repeat(f64::INFINITY);
    let mut high = -low;
    for (centre, radius) in balls {
        low = low.inf(&centre.add_scalar(-radius));
        high = high.sup(&centre.add_scalar(*radius));
    }
    let middle = 0.5 * (low + high);
    let reaches = balls.iter().map(|(centre, radius)| (centre - middle).norm() + radius);
    (middle, reaches.fold(0.0, f64::max))
}

/// Rays from a lamp whose ends are in a box.
#[derive(Clone, Copy, Debug)]
pub struct Bundle {
    low: Vector3<f64>,
    high: Vector3<f64>,
    /// The ray to the middle of the box, and one over its length.
    middle: Vector3<f64>,
    per_length: f64,
    /// Maximum distance of the end of a ray from that of the middle one, m; nearer to the lamp the
    /// rays are closer in proportion.
    radius: f64,
    /// One over the difference between the length of the middle ray and that distance, if the lamp
    /// is outside of the box.
    per_rest: Option<f64>,
}

impl Bundle {
    /// Creates the bundle of all rays to a box, given by two of its corners as seen from the lamp.
    pub fn new(low: Vector3<f64>, high: Vector3<f64>) -> Self {
        let middle = 0.5 * (low + high);
        // If the lamp is in the box, the middle ray may have no length.
        let length = middle.norm().max(SLACK_M);
        let radius = 0.5 * (high - low).norm() + SLACK_M;
        let per_rest = (length > radius + SLACK_M).then(|| (length - radius).recip());
        Self { low, high, middle, per_length: length.recip(), radius, per_rest }
    }

    /// Returns the axis of the cube face through which all rays pass; `None` if there are several.
    fn main_axis(&self) -> Option<usize> {
        (0..3).find(|axis| {
            let others = self.far_m((axis + 1) % 3).max(self.far_m((axis + 2) % 3));
            self.near_m(*axis) > others
        })
    }

    /// Returns the first and the last of the cells through which the rays pass, along an axis of
    /// the face of a main axis.
    fn cells_along(&self, axis: usize, main: usize, side: usize) -> [usize; 2] {
        let half = 0.5 * side as f64;
        self.slopes(axis, main).map(|at| ((at * half + half).max(0.0) as usize).min(side - 1))
    }

    /// Returns the minimum and the maximum slope of the rays along an axis, per length along the
    /// main one.
    fn slopes(&self, axis: usize, main: usize) -> [f64; 2] {
        // Points that are nearer along the main axis are farther out on the face.
        let near_m = self.near_m(main);
        let far_m = self.far_m(main);
        let from = self.low[axis] / if self.low[axis] < 0.0 { near_m } else { far_m };
        let to = self.high[axis] / if self.high[axis] > 0.0 { near_m } else { far_m };
        [from - SLACK, to + SLACK]
    }

    /// Returns the inward normals of four planes through the lamp between which all rays are;
    /// `None` if they pass through several faces of the cube.
    fn sides(&self) -> Option<[Vector3<f64>; 4]> {
        let main = self.main_axis()?;
        let sign = if self.high[main] < 0.0 { -1.0 } else { 1.0 };
        let mut sides = [Vector3::zeros(); 4];
        for (pair, axis) in sides.chunks_exact_mut(2).zip([(main + 1) % 3, (main + 2) % 3]) {
            for ((side, slope), inward) in
                pair.iter_mut().zip(self.slopes(axis, main)).zip([1.0, -1.0])
            {
                side[axis] = inward;
                side[main] = -inward * sign * slope;
                side.normalize_mut();
            }
        }
        Some(sides)
    }

    /// Returns the largest distance of an end from the lamp along an axis, m.
    fn far_m(&self, axis: usize) -> f64 {
        self.low[axis].abs().max(self.high[axis].abs())
    }

    /// Returns the minimum distance of an end from the lamp along an axis, m; not positive if there
    /// are ends on both sides.
    fn near_m(&self, axis: usize) -> f64 {
        self.low[axis].max(-self.high[axis])
    }

    /// Returns false if a ball is beside all rays.
    #[inline(always)]
    fn reaches(&self, (centre, radius): &Ball) -> bool {
        let along = dot(centre, &self.middle) * self.per_length;
        // Rays spread from the lamp: this is the farthest part of them that may touch the ball.
        let last =
            self.per_rest.map_or(1.0, |per_rest| ((along + radius) * per_rest).clamp(0.0, 1.0));
        let part = (along * self.per_length).clamp(0.0, last);
        let away = centre - self.middle * part;
        let reach = radius + self.radius * last + SLACK_M;
        dot(&away, &away) <= reach * reach
    }
}

/// Returns the lowest and the highest coordinates of some vectors, those in lanes whose bits are
/// set; at least one must be.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
pub fn bounds(of: &Vectors, wanted: u32) -> (Vector3<f64>, Vector3<f64>) {
    // Lanes that do not count get the value of one that does.
    let one = of.at(wanted.trailing_zeros() as usize % LANES);
    let (low_x, high_x) = range(&of.x, wanted, one.x);
    let (low_y, high_y) = range(&of.y, wanted, one.y);
    let (low_z, high_z) = range(&of.z, wanted, one.z);
    (Vector3::new(low_x, low_y, low_z), Vector3::new(high_x, high_y, high_z))
}

/// Returns the minimum and the maximum of some numbers. Halves are compared in parallel, because a
/// loop over all numbers would not become vector instructions.
#[inline(always)]
fn range(of: &Lanes, wanted: u32, one: f64) -> (f64, f64) {
    const HALF: usize = LANES / 2;
    const QUARTER: usize = LANES / 4;
    let mut counted = [0.0; LANES];
    for lane in 0..LANES {
        counted[lane] = if wanted >> lane & 1 == 1 { of[lane] } else { one };
    }
    let mut low = [0.0; HALF];
    let mut high = [0.0; HALF];
    for lane in 0..HALF {
        low[lane] = less(counted[lane], counted[lane + HALF]);
        high[lane] = -less(-counted[lane], -counted[lane + HALF]);
    }
    for lane in 0..QUARTER {
        low[lane] = less(low[lane], low[lane + QUARTER]);
        high[lane] = -less(-high[lane], -high[lane + QUARTER]);
    }
    let mut least = low[0];
    let mut most = high[0];
    for lane in 1..QUARTER {
        least = less(least, low[lane]);
        most = -less(-most, -high[lane]);
    }
    (least, most)
}

#[inline(always)]
fn less(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// Returns a bit for each lane.
#[inline(always)]
pub fn bits(of: &[bool; LANES]) -> u32 {
    let mut bits = 0;
    for lane in 0..LANES {
        bits |= u32::from(of[lane]) << lane;
    }
    bits
}

/// Returns the rays that some of these solids block, until none of those of interest, which are in
/// a bundle, is left; both as bits.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn barred(
    shadows: &Shadows,
    numbers: &[u32],
    bundle: &Bundle,
    ways: &Vectors,
    interest: u32,
) -> u32 {
    // As wide as the indices of the rays, because vector instructions convert slowly between
    // widths.
    let interest: [u64; LANES] = std::array::from_fn(|lane| u64::from(interest >> lane & 1));
    let mut barred = [0; LANES];
    for number in numbers {
        // The test of the bounding ball is cheap, so it comes first.
        if !bundle.reaches(&shadows.balls[*number as usize]) {
            continue;
        }
        shadows.solids[*number as usize].bar(ways, 1.0, &mut barred);
        let mut open = 0;
        for lane in 0..LANES {
            open |= interest[lane] & !barred[lane];
        }
        if open == 0 {
            break;
        }
    }
    bits(&barred.map(|barred| barred != 0))
}

/// Returns the position of a line between cells on a face, -1 to 1.
fn line(number: usize, side: usize) -> f64 {
    2.0 * number as f64 / side as f64 - 1.0
}

/// Returns a point on a face of the cube of half side one. Even faces are those of positive
/// coordinates.
fn on_face(face: usize, u: f64, v: f64) -> Vector3<f64> {
    let axis = face / 2;
    let mut point = Vector3::zeros();
    point[axis] = if face.is_multiple_of(2) { 1.0 } else { -1.0 };
    point[(axis + 1) % 3] = u;
    point[(axis + 2) % 3] = v;
    point
}

/// Returns the ends of the line between two rows of cells of a face.
fn row_ends(face: usize, v: f64) -> [Vector3<f64>; 2] {
    [on_face(face, -1.0, v), on_face(face, 1.0, v)]
}

/// Returns the ends of the line between two columns of cells of a face.
fn column_ends(face: usize, u: f64) -> [Vector3<f64>; 2] {
    [on_face(face, u, -1.0), on_face(face, u, 1.0)]
}

/// Returns the cell through which a ray passes.
fn cell(way: &Vector3<f64>, side: usize) -> i32 {
    let x = way.x.abs();
    let y = way.y.abs();
    let z = way.z.abs();
    let on_x = (x >= y) & (x >= z);
    let on_y = !on_x & (y >= z);
    // A face has the two axes that follow its own.
    let pick = |on: [f64; 3]| if on_x { on[0] } else { pick_other(on_y, on[1], on[2]) };
    let main = pick([way.x, way.y, way.z]);
    let u = pick([way.y, way.z, way.x]);
    let v = pick([way.z, way.x, way.y]);
    let axis = if on_x { 0 } else { 2 - i32::from(on_y) };
    let (side, half) = (side as i32, 0.5 * side as f64);
    let scale = half / main.abs();
    // A ray without length falls into some cell, which contains nothing for it.
    let along = |of: f64| ((of * scale + half) as i32).max(0).min(side.wrapping_sub(1));
    let face = axis.wrapping_mul(2).wrapping_add(i32::from(main < 0.0));
    face.wrapping_mul(side).wrapping_add(along(v)).wrapping_mul(side).wrapping_add(along(u))
}

#[inline(always)]
fn pick_other(first: bool, a: f64, b: f64) -> f64 {
    if first { a } else { b }
}

#[cfg(test)]
mod tests {
    use nalgebra::Rotation3;
    use proptest::prelude::*;

    use super::*;
    use crate::material::Material;
    use crate::shape::Form;

    fn solid((form, at, turn): (usize, [f64; 3], [f64; 3])) -> Shape {
        let form = match form {
            0 => Form::Ellipsoid(Vector3::new(0.3, 0.1, 0.5)),
            1 => Form::Block(Vector3::new(0.05, 0.6, 0.4)),
            _ => Form::Capsule { length: 0.9, first: 0.2, second: 0.08 },
        };
        let turn = Rotation3::from_euler_angles(turn[0], turn[1], turn[2]);
        Shape::new(form, Point3::from(at), turn, Material::plain([0.5; 3]))
    }

    fn solids() -> impl Strategy<Value = Vec<Shape>> {
        let at = prop::array::uniform3(-3.0..3.0f64);
        let turn = prop::array::uniform3(-3.0..3.0f64);
        prop::collection::vec((0..3usize, at, turn).prop_map(solid), 1..12)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn shadows_are_where_the_way_to_the_lamp_is_barred(
            solids in solids(),
            points in prop::collection::vec(prop::array::uniform3(-4.0..4.0f64), 192),
            side in 1..40usize, size_m in 0.0..0.5f64,
        ) {
            let lamp = Point3::new(0.3, -0.2, 0.5);
            let still = Shadows::still(side, lamp, solids.iter().map(|solid| (None, solid)));
            let moving = Shadows::moving(lamp, solids.chunks(3).map(|object| object.iter()));
            let ways: Vec<_> = points.into_iter().map(|point| Point3::from(point) - lamp).collect();
            let barred = |way: &Vector3<f64>| {
                solids.iter().any(|s| s.meet(&lamp, way).is_some_and(|t| t < 1.0))
            };
            for way in &ways {
                prop_assert_eq!([still.on(way), moving.on(way)], [barred(way); 2]);
            }
            // Ways in all directions, and to a patch like those behind a tile of an image.
            let size_m = size_m * size_m;
            let near = |way: &Vector3<f64>| ways[0] + size_m * way;
            let patch: Vec<_> = ways.iter().map(near).collect();
            let mut found = Vec::new();
            let both = [ways, patch];
            for (ways, shadows) in both.iter().flat_map(|ways| [(ways, &still), (ways, &moving)]) {
                let mut low = Vector3::repeat(f64::INFINITY);
                let mut high = -low;
                for way in ways {
                    low = low.inf(way);
                    high = high.sup(way);
                }
                shadows.find(&Bundle::new(low, high), &mut found);
                for ways in ways.chunks_exact(LANES) {
                    let mut side_by_side = Vectors::ZERO;
                    (0..).zip(ways).for_each(|(lane, way)| side_by_side.set(lane, way));
                    let expected: [bool; LANES] =
                        std::array::from_fn(|lane| lane % 5 != 4 && barred(&ways[lane]));
                    let interest = bits(&std::array::from_fn(|lane| lane % 5 != 4));
                    let met = shadows.bar(&found, &side_by_side, interest);
                    prop_assert_eq!(met, bits(&expected));
                }
            }
        }

        #[test]
        fn bounds_are_those_of_the_lanes_that_count(
            at in prop::collection::vec(prop::array::uniform3(-4.0..4.0f64), LANES),
            wanted in 1..1u32 << LANES,
        ) {
            let mut vectors = Vectors::ZERO;
            let mut low = Vector3::repeat(f64::INFINITY);
            let mut high = -low;
            for (lane, at) in at.into_iter().enumerate() {
                let at = Vector3::from(at);
                vectors.set(lane, &at);
                if wanted >> lane & 1 == 1 {
                    low = low.inf(&at);
                    high = high.sup(&at);
                }
            }
            prop_assert_eq!(bounds(&vectors, wanted), (low, high));
        }
    }

    #[test]
    fn a_patch_of_a_wall_looks_at_the_solids_before_it_alone() {
        let at = |y: f64| solid((0, [2.0, y, 0.0], [0.0; 3]));
        let solids = [at(-2.0), at(0.0), at(2.0), solid((0, [5.0, 0.0, 0.0], [0.0; 3]))];
        let lamp = Point3::origin();
        let shadows = Shadows::still(SIDE, lamp, solids.iter().map(|solid| (None, solid)));
        let patch = Bundle::new(Vector3::new(4.0, -0.1, -0.1), Vector3::new(4.0, 0.1, 0.1));
        let mut found = vec![7];
        shadows.find(&patch, &mut found);
        assert_eq!(found, [1], "what stands behind the patch does not count, either");
        let Index::Cells(cells) = &shadows.index else { panic!("what stands still has cells") };
        let through = cells.through(&patch);
        assert_eq!(through, Some((0, [15, 16], [15, 16])));
        let moving = Shadows::moving(lamp, solids.chunks(2).map(|object| object.iter()));
        moving.find(&patch, &mut found);
        assert_eq!(found, [1]);
    }
}
