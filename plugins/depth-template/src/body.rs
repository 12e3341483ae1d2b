use std::ops::Range;

use nalgebra::{Matrix3, Rotation3, Vector3};

/// An ellipsoid of the body, relative to the centre of the head: x forward,
/// y left, z up, metres.
#[derive(Clone, Copy, Debug)]
pub struct Part {
    /// Centre, m.
    pub centre: [f64; 3],
    /// Half axes along x, y, z, m.
    pub radii: [f64; 3],
}

const fn part(centre: [f64; 3], radii: [f64; 3]) -> Part {
    Part { centre, radii }
}

/// Head, neck, shoulders, chest, trunk and upper arms of an adult in everyday
/// clothes. Head: breadth 15 cm, length 19 cm, height 23 cm (adult means) plus
/// hair; shoulders 46 cm wide over the sleeves.
pub fn body_parts() -> [Part; 9] {
    [
        part([0.0, 0.0, -0.01], [0.10, 0.088, 0.125]),
        part([-0.02, 0.0, -0.15], [0.068, 0.068, 0.10]),
        part([-0.05, 0.0, -0.235], [0.08, 0.14, 0.075]),
        part([-0.04, 0.0, -0.35], [0.11, 0.18, 0.13]),
        part([-0.04, 0.0, -0.54], [0.12, 0.17, 0.32]),
        part([-0.05, 0.165, -0.29], [0.075, 0.08, 0.08]),
        part([-0.05, -0.165, -0.29], [0.075, 0.08, 0.08]),
        part([-0.05, 0.20, -0.44], [0.06, 0.055, 0.21]),
        part([-0.05, -0.20, -0.44], [0.06, 0.055, 0.21]),
    ]
}

/// Depth of each point of the body's image behind the plane through the centre of the head, m; NaN
/// beside the body. A square of [`Relief::SIZE`] cells, [`Relief::SIDE_M`] wide, the head centre in
/// the middle.
#[derive(Clone, Debug)]
pub struct Relief {
    cells: Vec<f64>,
    /// Cells of each line between which the body lies.
    extents: Vec<Range<usize>>,
}

/// Returns the place of a distance from the middle of a relief, in cells from its border.
#[inline]
fn cell_at(m: f64) -> f64 {
    (m / Relief::SIDE_M + 0.5) * Relief::SIZE as f64
}

impl Relief {
    /// Cells along each side.
    pub const SIZE: usize = 200;
    /// Width and height, m.
    pub const SIDE_M: f64 = 1.0;
    const CELL_M: f64 = Self::SIDE_M / Self::SIZE as f64;

    fn new(cells: Vec<f64>) -> Self {
        let extents = cells
            .chunks(Self::SIZE)
            .map(|line| {
                fn is_body(cell: &f64) -> bool {
                    !cell.is_nan()
                }
                let first = line.iter().position(is_body).unwrap_or(Self::SIZE);
                first..line.iter().rposition(is_body).map_or(0, |last| last + 1)
            })
            .collect();
        Self { cells, extents }
    }

    /// Returns a range right of the head centre, m, outside of which there is no body between two
    /// lines, m below it; it ends before it starts where there is none at all.
    pub fn extent(&self, from_m: f64, to_m: f64) -> (f64, f64) {
        let [from, to] = [from_m, to_m].map(|m| cell_at(m).max(0.0) as usize);
        // A cell more on each side, so that rounding cannot cut the border off.
        let from = from.saturating_sub(1).min(Self::SIZE);
        let lines = &self.extents[from..(to + 2).clamp(from, Self::SIZE)];
        let (first, last) = lines
            .iter()
            .fold((Self::SIZE, 0), |(first, last), e| (first.min(e.start), last.max(e.end)));
        (middle_m(first) - Self::CELL_M, middle_m(last) + Self::CELL_M)
    }

    /// The relief at `right`, `down` of the head centre, m; NaN beside the body.
    pub fn at(&self, right_m: f64, down_m: f64) -> f64 {
        // Within the relief no cell is negative, and the cast rounds as `floor` would, which is a
        // call on processors without an instruction for it.
        let x = cell_at(right_m);
        let y = cell_at(down_m);
        let size = Self::SIZE as f64;
        if 0.0 <= x && x < size && 0.0 <= y && y < size {
            self.cells[y as i32 as usize * Self::SIZE + x as i32 as usize]
        } else {
            f64::NAN
        }
    }
}

/// Looks at the body from far away: turned by `yaw_rad` (0 = its back to the
/// viewer, counter-clockwise from above), the viewer looking down by
/// `pitch_rad`.
pub fn render(yaw_rad: f64, pitch_rad: f64) -> Relief {
    let (sin, cos) = pitch_rad.sin_cos();
    let forward = Vector3::new(cos, 0.0, -sin);
    let [right, down] = [Vector3::new(0.0, -1.0, 0.0), Vector3::new(-sin, 0.0, -cos)];
    let turned = Rotation3::from_axis_angle(&Vector3::z_axis(), yaw_rad);
    let mut cells = vec![f64::NAN; Relief::SIZE * Relief::SIZE];
    for part in body_parts() {
        let ellipsoid = Ellipsoid::new(&part, &turned, &forward);
        let [columns, lines] = [right, down].map(|axis| ellipsoid.cells(&axis));
        for y in lines {
            for x in columns.clone() {
                let origin = right * middle_m(x) + down * middle_m(y);
                if let Some(hit) = ellipsoid.first_hit(&origin) {
                    let cell = &mut cells[y * Relief::SIZE + x];
                    *cell = cell.min(hit);
                }
            }
        }
    }
    Relief::new(cells)
}

/// Returns the middle of a cell along one side of the relief, m.
fn middle_m(cell: usize) -> f64 {
    (cell as f64 + 0.5) * (Relief::SIDE_M / Relief::SIZE as f64) - 0.5 * Relief::SIDE_M
}

/// Part of the body, `(x - centre)ᵀ S (x - centre) = 1`, before parallel rays.
struct Ellipsoid {
    centre: Vector3<f64>,
    shape: Matrix3<f64>,
    /// The inverse of `shape`.
    spread: Matrix3<f64>,
    /// `S d` of the direction `d` of the rays.
    shape_along: Vector3<f64>,
    /// `dᵀ S d`.
    along: f64,
}

impl Ellipsoid {
    fn new(part: &Part, turned: &Rotation3<f64>, direction: &Vector3<f64>) -> Self {
        let squared = Vector3::from(part.radii).map(|r| r * r);
        let [shape, spread] = [squared.map(|r| 1.0 / r), squared].map(|diagonal| {
            turned.matrix() * Matrix3::from_diagonal(&diagonal) * turned.matrix().transpose()
        });
        let shape_along = shape * direction;
        Self {
            centre: turned * Vector3::from(part.centre),
            shape,
            spread,
            shape_along,
            along: direction.dot(&shape_along),
        }
    }

    /// Returns the cells along an axis of the image in which the ellipsoid can lie.
    fn cells(&self, axis: &Vector3<f64>) -> Range<usize> {
        // A cell more on each side, so that rounding cannot cut the border off.
        let middle = axis.dot(&self.centre);
        let reach = axis.dot(&(self.spread * axis)).sqrt();
        let from = (cell_at(middle - reach).floor() - 1.0).max(0.0) as usize;
        let to = (cell_at(middle + reach).ceil() + 1.0).max(0.0) as usize;
        from..to.min(Relief::SIZE)
    }

    /// Returns the distance to where the ray from `origin` first meets the ellipsoid.
    fn first_hit(&self, origin: &Vector3<f64>) -> Option<f64> {
        let origin = origin - self.centre;
        let a = self.along;
        let b = origin.dot(&self.shape_along);
        let c = origin.dot(&(self.shape * origin)) - 1.0;
        let discriminant = b * b - a * c;
        (discriminant >= 0.0).then(|| (-b - discriminant.sqrt()) / a)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Meets every cell with every part, straight from the definition.
    fn slow(yaw_rad: f64, pitch_rad: f64) -> Vec<f64> {
        let (sin, cos) = pitch_rad.sin_cos();
        let forward = Vector3::new(cos, 0.0, -sin);
        let turned = Rotation3::from_axis_angle(&Vector3::z_axis(), yaw_rad);
        (0..Relief::SIZE * Relief::SIZE)
            .map(|i| {
                let x = middle_m(i % Relief::SIZE);
                let y = middle_m(i / Relief::SIZE);
                let origin = Vector3::new(0.0, -1.0, 0.0) * x + Vector3::new(-sin, 0.0, -cos) * y;
                let hits = body_parts().into_iter().filter_map(|part| {
                    let inverse = Vector3::from(part.radii).map(|r| 1.0 / (r * r));
                    let diagonal = Matrix3::from_diagonal(&inverse);
                    let shape = turned.matrix() * diagonal * turned.matrix().transpose();
                    let origin = origin - turned * Vector3::from(part.centre);
                    let a = forward.dot(&(shape * forward));
                    let b = origin.dot(&(shape * forward));
                    let c = origin.dot(&(shape * origin)) - 1.0;
                    let discriminant = b * b - a * c;
                    (discriminant >= 0.0).then(|| (-b - discriminant.sqrt()) / a)
                });
                hits.fold(f64::NAN, f64::min)
            })
            .collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(6))]

        #[test]
        fn a_relief_is_that_of_all_parts_in_all_cells(yaw in -4.0..4.0f64, pitch in -0.3..1.1f64) {
            fn bits(cells: &[f64]) -> Vec<u64> {
                cells.iter().map(|cell| cell.to_bits()).collect::<Vec<_>>()
            }

            prop_assert_eq!(bits(&render(yaw, pitch).cells), bits(&slow(yaw, pitch)));
        }
    }

    #[test]
    fn a_point_is_found_without_rounding_towards_minus_infinity() {
        let relief = render(0.0, 0.0);
        let size = Relief::SIZE as f64;
        for i in -130..130 {
            for j in -130..130 {
                let x = f64::from(i) * 0.004_99;
                let y = f64::from(j) * 0.005;
                let [column, row] = [x, y].map(|m| ((m / Relief::SIDE_M + 0.5) * size).floor());
                let is_inside = (0.0..size).contains(&column) && (0.0..size).contains(&row);
                let slow = if is_inside {
                    relief.cells[row as usize * Relief::SIZE + column as usize]
                } else {
                    f64::NAN
                };
                assert_eq!(relief.at(x, y).to_bits(), slow.to_bits(), "{x} {y}");
            }
        }
    }
}
