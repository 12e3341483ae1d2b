//! Convex obstacles, and the lines that separate the robot from them.
//!
//! The distance of two convex bodies is the largest gap over all directions from one to the other:
//! that between their supports. A direction and what spans it are the dual variables of RDA. An
//! obstacle is `A x <= b` (a polygon) or a circle, the robot `G x <= h` in its own axes; with `p` and
//! `R` for the pose of the robot the gap is `lambda' (A p - b) - mu' h`, where `mu' G + lambda' A R`,
//! the mismatch, has to be zero and `A' lambda` no longer than 1.

use nalgebra::{Point2, Rotation2, Vector2};

use super::program::{Program, Sum};

/// Penalty of the mismatch.
const MISMATCH: f64 = 1.0;
/// Weight of the gap alone. Of all lines that keep the wanted distance the one with the largest gap is
/// taken, which is none the paper names: without it any of them is as good.
const LARGEST: f64 = 1e-3;

/// A side of a polygon: points inside have at most `offset_m` along the normal.
#[derive(Clone, Copy, Debug)]
pub(super) struct Face {
    /// Outward, of length 1.
    pub(super) normal: Vector2<f64>,
    pub(super) offset_m: f64,
}

/// A convex obstacle.
#[derive(Clone, Debug)]
pub(super) enum Shape {
    Circle { centre: Point2<f64>, radius_m: f64 },
    Polygon(Vec<Face>),
}

/// The robot: a rectangle around its origin.
#[derive(Clone, Copy, Debug)]
pub(super) struct Body {
    pub(super) faces: [Face; 4],
}

/// Place, m, and heading, rad.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Pose {
    pub(super) place: Vector2<f64>,
    pub(super) heading: f64,
}

/// Multipliers of the two conditions that a line and a motion share.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Multiplier {
    /// Of the gap, at least the distance kept: never positive.
    pub(super) gap: f64,
    /// Of the mismatch, which is zero.
    pub(super) mismatch: Vector2<f64>,
}

/// A line between the robot and an obstacle.
#[derive(Clone, Debug)]
pub(super) struct Separator {
    /// Dual variables of the obstacle and of the robot.
    duals: Vec<f64>,
    /// Direction from the obstacle to the robot, at most of length 1.
    pub(super) normal: Vector2<f64>,
    /// Supports of the obstacle and of the robot together, m.
    pub(super) offset_m: f64,
    /// Direction of the robot's support, in its axes.
    pub(super) side: Vector2<f64>,
}

impl Shape {
    /// Returns the shape somewhere else.
    pub(super) fn moved(&self, way: &Vector2<f64>) -> Self {
        match self {
            Self::Circle { centre, radius_m } => {
                Self::Circle { centre: centre + way, radius_m: *radius_m }
            }
            Self::Polygon(faces) => {
                let moved = faces
                    .iter()
                    .map(|face| Face { offset_m: face.offset_m + face.normal.dot(way), ..*face });
                Self::Polygon(moved.collect())
            }
        }
    }

    fn duals(&self) -> usize {
        match self {
            Self::Circle { .. } => 3,
            Self::Polygon(faces) => faces.len(),
        }
    }

    /// Returns the direction and the support as sums of the dual variables, and demands what makes
    /// them so.
    fn spanned(&self, program: &mut Program) -> ([Sum; 2], Sum) {
        match self {
            Self::Circle { centre, radius_m } => {
                let normal = [0, 1].map(|axis| Sum::of([(axis, 1.0)]));
                let length = Sum::of([(2, 1.0)]);
                program.length(length.clone(), normal.clone());
                program.positive(Sum::constant(1.0).plus(-1.0, &length));
                (normal, Sum::of([(0, centre.x), (1, centre.y), (2, *radius_m)]))
            }
            Self::Polygon(faces) => {
                let normal = [0, 1].map(|axis| {
                    Sum::of(faces.iter().enumerate().map(|(at, face)| (at, face.normal[axis])))
                });
                for dual in 0..faces.len() {
                    program.positive(Sum::of([(dual, 1.0)]));
                }
                program.length(Sum::constant(1.0), normal.clone());
                let support = faces.iter().enumerate().map(|(at, face)| (at, face.offset_m));
                (normal, Sum::of(support))
            }
        }
    }
}

impl Body {
    pub(super) fn new(length_m: f64, width_m: f64) -> Self {
        let sides = [
            (Vector2::new(1.0, 0.0), length_m),
            (Vector2::new(-1.0, 0.0), length_m),
            (Vector2::new(0.0, 1.0), width_m),
            (Vector2::new(0.0, -1.0), width_m),
        ];
        Self { faces: sides.map(|(normal, across_m)| Face { normal, offset_m: 0.5 * across_m }) }
    }
}

impl Separator {
    /// Returns the line for a robot that is to keep `distance_m`; `None` if the solver fails.
    ///
    /// This is the step of the dual variables, of which each obstacle and each time has its own.
    pub(super) fn between(
        shape: &Shape,
        body: &Body,
        pose: &Pose,
        distance_m: f64,
        multiplier: &Multiplier,
    ) -> Option<Self> {
        let first = shape.duals();
        let shortfall = first + body.faces.len();
        let mut program = Program::new(shortfall + 1);
        let (normal, support) = shape.spanned(&mut program);
        let mut side = [Sum::default(), Sum::default()];
        let mut offset = support;
        for (at, face) in body.faces.iter().enumerate() {
            let dual = Sum::of([(first + at, 1.0)]);
            side = [0, 1].map(|axis| side[axis].clone().plus(face.normal[axis], &dual));
            offset = offset.plus(face.offset_m, &dual);
            program.positive(dual);
        }
        let gap = along(&normal, &pose.place).plus(-1.0, &offset);
        for (axis, own) in side.iter().enumerate() {
            let turned = Rotation2::new(pose.heading) * Vector2::ith(axis, 1.0);
            let mismatch = along(&normal, &turned).plus(1.0, own);
            let penalised = mismatch.plus_constant(multiplier.mismatch[axis]);
            program.square(0.5 * MISMATCH, &penalised);
        }
        let short = Sum::of([(shortfall, 1.0)]);
        program.positive(short.clone());
        // The gap, its multiplier and what is missing make up the distance.
        let made_up = gap.clone().plus_constant(multiplier.gap - distance_m).plus(1.0, &short);
        program.positive(made_up);
        program.square(0.5, &short);
        program.cost(-LARGEST, &gap);
        let solution = program.solved()?;
        Some(Self {
            normal: normal.map(|sum| sum.value(&solution)).into(),
            offset_m: offset.value(&solution),
            side: side.map(|sum| sum.value(&solution)).into(),
            duals: solution[..shortfall].to_vec(),
        })
    }

    /// Returns the gap to the robot at a place, m.
    pub(super) fn gap_m(&self, place: &Vector2<f64>) -> f64 {
        self.normal.dot(place) - self.offset_m
    }

    /// Returns the mismatch of the two directions for a heading of the robot.
    pub(super) fn mismatch(&self, heading: f64) -> Vector2<f64> {
        self.side + Rotation2::new(-heading) * self.normal
    }

    /// Returns the change of the mismatch with the heading.
    pub(super) fn mismatch_by_turn(&self, heading: f64) -> Vector2<f64> {
        let turned = Rotation2::new(-heading) * self.normal;
        Vector2::new(turned.y, -turned.x)
    }

    /// Returns the sum of the squares of the changes of the dual variables.
    pub(super) fn change(&self, before: &Self) -> f64 {
        let pairs = self.duals.iter().zip(&before.duals);
        pairs.map(|(now, then)| (now - then).powi(2)).sum()
    }
}

/// Returns the product of a vector of sums and a vector.
fn along(vector: &[Sum; 2], axis: &Vector2<f64>) -> Sum {
    Sum::default().plus(axis.x, &vector[0]).plus(axis.y, &vector[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square as people are in Follow-Bench, askew.
    fn square(centre: Point2<f64>, half_m: f64, angle: f64) -> Shape {
        let faces = [0.0, 0.5, 1.0, 1.5].map(|quarter| {
            let normal = Rotation2::new(angle + quarter * std::f64::consts::PI) * Vector2::x();
            Face { normal, offset_m: normal.dot(&centre.coords) + half_m }
        });
        Shape::Polygon(faces.to_vec())
    }

    /// The corners of a rectangle of these halves, m.
    fn corners(pose: &Pose, half_m: [f64; 2]) -> Vec<Vector2<f64>> {
        let signs = [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]];
        let turn = Rotation2::new(pose.heading);
        signs.map(|[x, y]| pose.place + turn * Vector2::new(x * half_m[0], y * half_m[1])).to_vec()
    }

    fn to_edge_m(point: &Vector2<f64>, from: &Vector2<f64>, to: &Vector2<f64>) -> f64 {
        let way = to - from;
        let part = ((point - from).dot(&way) / way.norm_squared()).clamp(0.0, 1.0);
        (from + way * part - point).norm()
    }

    /// The distance of two polygons that are apart: of a corner of one from an edge of the other.
    fn apart_m(one: &[Vector2<f64>], other: &[Vector2<f64>]) -> f64 {
        let mut least_m = f64::INFINITY;
        for (points, polygon) in [(one, other), (other, one)] {
            for point in points {
                for (at, from) in polygon.iter().enumerate() {
                    let to = polygon[(at + 1) % polygon.len()];
                    least_m = least_m.min(to_edge_m(point, from, &to));
                }
            }
        }
        least_m
    }

    /// The line after as many agreements with a robot that stands there.
    fn agreed(shape: &Shape, body: &Body, pose: &Pose, distance_m: f64, times: usize) -> Separator {
        let mut multiplier = Multiplier::default();
        let mut line =
            Separator::between(shape, body, pose, distance_m, &multiplier).expect("line");
        for _ in 0..times {
            multiplier.mismatch += line.mismatch(pose.heading);
            line = Separator::between(shape, body, pose, distance_m, &multiplier).expect("line");
        }
        line
    }

    const HALF_M: [f64; 2] = [0.35, 0.275];

    #[test]
    fn the_gap_to_a_circle_is_its_distance_from_the_robot() {
        let body = Body::new(2.0 * HALF_M[0], 2.0 * HALF_M[1]);
        for (x, y, heading) in
            [(1.2, 0.0, 0.0), (0.9, 0.8, 0.0), (-1.0, 0.4, 1.0), (0.4, -1.1, 2.5)]
        {
            let pose = Pose { place: Vector2::new(0.1, -0.2), heading };
            let centre = Point2::new(x, y);
            let robot = corners(&pose, HALF_M);
            let exact_m =
                apart_m(&robot, &[centre.coords, centre.coords + Vector2::x() * 1e-9]) - 0.3;
            let shape = Shape::Circle { centre, radius_m: 0.3 };
            let line = agreed(&shape, &body, &pose, 1.0, 60);
            assert!((line.gap_m(&pose.place) - exact_m).abs() < 2e-3, "{line:?}, {exact_m}");
            assert!(line.mismatch(heading).norm() < 2e-3, "{line:?}");
            assert!(line.normal.norm() <= 1.0 + 1e-6, "{line:?}");
        }
    }

    #[test]
    fn the_gap_to_a_polygon_is_its_distance_from_the_robot() {
        let body = Body::new(2.0 * HALF_M[0], 2.0 * HALF_M[1]);
        let places = [(1.5, 0.0, 0.0, 0.0), (1.0, 0.9, 0.3, 0.4), (-1.1, 0.3, 1.0, 2.0)];
        for (x, y, angle, heading) in places {
            let pose = Pose { place: Vector2::new(-0.1, 0.1), heading };
            let centre = Point2::new(x, y);
            let other = corners(&Pose { place: centre.coords, heading: angle }, [0.3; 2]);
            let exact_m = apart_m(&corners(&pose, HALF_M), &other);
            let line = agreed(&square(centre, 0.3, angle), &body, &pose, 1.0, 60);
            assert!((line.gap_m(&pose.place) - exact_m).abs() < 2e-3, "{line:?}, {exact_m}");
            assert!(line.mismatch(heading).norm() < 2e-3, "{line:?}");
        }
    }

    #[test]
    fn a_line_that_keeps_the_distance_has_the_largest_gap_at_once() {
        let body = Body::new(2.0 * HALF_M[0], 2.0 * HALF_M[1]);
        let shape = Shape::Circle { centre: Point2::new(2.0, 0.0), radius_m: 0.3 };
        let line = agreed(&shape, &body, &Pose::default(), 0.1, 0);
        assert!((line.gap_m(&Vector2::zeros()) - 1.35).abs() < 2e-3, "{line:?}");
    }

    #[test]
    fn a_shape_moves_with_all_of_its_sides() {
        let body = Body::new(2.0 * HALF_M[0], 2.0 * HALF_M[1]);
        let way = Vector2::new(0.5, 0.2);
        let there = square(Point2::new(1.0, 0.3), 0.3, 0.2).moved(&way);
        let same = square(Point2::new(1.5, 0.5), 0.3, 0.2);
        let gaps = [there, same]
            .map(|shape| agreed(&shape, &body, &Pose::default(), 1.0, 0).gap_m(&Vector2::zeros()));
        assert!((gaps[0] - gaps[1]).abs() < 1e-6, "{gaps:?}");
    }

    #[test]
    fn the_mismatch_turns_with_the_robot() {
        let body = Body::new(2.0 * HALF_M[0], 2.0 * HALF_M[1]);
        let shape = Shape::Circle { centre: Point2::new(1.0, 0.6), radius_m: 0.3 };
        let line = agreed(&shape, &body, &Pose::default(), 1.0, 0);
        let step = 1e-6;
        let by_turn = (line.mismatch(0.4 + step) - line.mismatch(0.4 - step)) / (2.0 * step);
        assert!((by_turn - line.mismatch_by_turn(0.4)).norm() < 1e-6, "{by_turn}");
    }
}
