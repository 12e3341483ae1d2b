use nalgebra::{Matrix3, Point2, Vector2, Vector3};

use crate::{Beams, Segment};

/// Names of the features, in the order of a model file. All lengths are in metres, and none depends
/// on the number of rays but `points`, which counts few of them.
pub const FEATURES: [&str; 20] = [
    "width",
    "deviation",
    "deviation_from_median",
    "radius",
    "circularity",
    "linearity",
    "length",
    "regularity",
    "curvature",
    "depth",
    "aspect",
    "span",
    "smaller_jump",
    "larger_jump",
    "occluded_sides",
    "points",
    "neighbour",
    "second_neighbour",
    "neighbours",
    "wall",
];

/// Number of features of a segment.
pub const COUNT: usize = FEATURES.len();

/// Features of a segment, in the order of [`FEATURES`].
pub type Features = [f32; COUNT];

/// Radii above this are straight, m.
const STRAIGHT_M: f64 = 1.0;
/// Jumps above this are all alike: they say how far the wall behind is, m.
const FAR_M: f64 = 0.5;
/// Neighbours above this are no second leg, m.
const APART_M: f64 = 1.0;
/// Segments that are wider than this are no legs, m.
const WIDE_M: f64 = 0.4;
/// Curvatures above this are noise, 1/m.
const SHARP: f64 = 50.0;
/// Numbers of points above this are not told apart: they depend on the resolution.
const MANY_POINTS: usize = 6;
/// Rays without a reflection after which there is no neighbour.
const OPEN_RAYS: u32 = 3;

/// Computes the features of a segment among all `segments` of a scan.
pub fn features(beams: &Beams, segment: &Segment, segments: &[Segment]) -> Features {
    let points = &beams.points[segment.clone()];
    let middle = beams.middle(segment.clone());
    let range = middle.coords.norm();
    let spacing = (range * beams.step_rad).max(1e-3);
    let [deviation, linearity, aspect] = spread(points, &middle);
    let (radius, circularity) = circle(points, &middle);
    let [length, irregularity] = boundary(points);
    let jumps = [before(beams, segment), after(beams, segment)];
    let [first, second] = jumps.map(|jump| jump.map_or(FAR_M, |(apart, _)| apart.min(FAR_M)));
    let occluded = jumps.iter().flatten().filter(|(_, is_nearer)| *is_nearer).count();
    let [neighbour, second_neighbour, neighbours, wall] =
        surroundings(beams, segment, &middle, segments);
    let values = [
        beams.width(segment.clone()),
        deviation,
        median_deviation(points),
        radius,
        circularity,
        linearity,
        length,
        irregularity / spacing,
        curvature(points),
        depth(points, &middle),
        aspect,
        points.len() as f64 * spacing,
        first.min(second),
        first.max(second),
        occluded as f64,
        points.len().min(MANY_POINTS) as f64,
        neighbour,
        second_neighbour,
        neighbours,
        wall,
    ];
    values.map(|value| value as f32)
}

/// Returns the standard deviation of the points, that across their main direction, and the ratio of
/// both axes.
fn spread(points: &[Point2<f64>], middle: &Point2<f64>) -> [f64; 3] {
    let offsets = points.iter().map(|point| point - middle);
    let scatter: nalgebra::Matrix2<f64> = offsets.map(|q| q * q.transpose()).sum();
    let scatter = scatter / points.len() as f64;
    let half_trace = 0.5 * scatter.trace();
    let root = (half_trace.powi(2) - scatter.determinant()).max(0.0).sqrt();
    let [small, large] = [half_trace - root, half_trace + root].map(|v| v.max(0.0).sqrt());
    let total =
        (scatter.trace() * points.len() as f64 / (points.len() as f64 - 1.0).max(1.0)).sqrt();
    [total, small, small / large.max(1e-6)]
}

/// Returns the mean distance of the points from their median by coordinate, m.
fn median_deviation(points: &[Point2<f64>]) -> f64 {
    let median = Point2::from([0, 1].map(|axis| {
        let mut values: Vec<f64> = points.iter().map(|p| p[axis]).collect();
        values.sort_by(f64::total_cmp);
        0.5 * (values[(values.len() - 1) / 2] + values[values.len() / 2])
    }));
    points.iter().map(|p| (p - median).norm()).sum::<f64>() / points.len() as f64
}

/// Fits a circle by least squares; returns its radius and the root mean square distance of the
/// points from it, m.
fn circle(points: &[Point2<f64>], middle: &Point2<f64>) -> (f64, f64) {
    if points.len() < 3 {
        return (STRAIGHT_M, 0.0);
    }
    let rows = points.iter().map(|point| {
        let q = point - middle;
        (Vector3::new(2.0 * q.x, 2.0 * q.y, 1.0), q.norm_squared())
    });
    let mut normal = Matrix3::zeros();
    let mut right = Vector3::zeros();
    for (row, value) in rows {
        normal += row * row.transpose();
        right += row * value;
    }
    // The addend keeps the matrix of points on a line from being singular. Their circle is the one of
    // the least numbers, a small one around the middle, although a large one would fit a line as
    // well; the shipped model was fitted to these numbers.
    let fitted = (normal + Matrix3::identity() * 1e-9).cholesky().map(|c| c.solve(&right));
    let Some(fitted) = fitted else { return (STRAIGHT_M, 0.0) };
    let at = fitted.xy();
    let radius = (fitted.z + at.norm_squared()).max(0.0).sqrt();
    let mean_square =
        points.iter().map(|point| ((point - middle - at).norm() - radius).powi(2)).sum::<f64>()
            / points.len() as f64;
    (radius.min(STRAIGHT_M), mean_square.sqrt().min(STRAIGHT_M))
}

/// Returns the length of the line through the points, and the standard deviation of its parts, m.
fn boundary(points: &[Point2<f64>]) -> [f64; 2] {
    let parts: Vec<f64> = points.windows(2).map(|pair| (pair[1] - pair[0]).norm()).collect();
    let count = parts.len().max(1) as f64;
    let length: f64 = parts.iter().sum();
    let variance = parts.iter().map(|part| (part - length / count).powi(2)).sum::<f64>() / count;
    [length, variance.sqrt()]
}

/// Returns the mean curvature of the circles through three neighbouring points, 1/m.
fn curvature(points: &[Point2<f64>]) -> f64 {
    fn of_three(three: &[Point2<f64>]) -> f64 {
        let ab = three[1] - three[0];
        let bc = three[2] - three[1];
        let ac = three[2] - three[0];
        let doubled_area = (ab.x * ac.y - ab.y * ac.x).abs();
        2.0 * doubled_area / (ab.norm() * bc.norm() * ac.norm()).max(1e-9)
    }

    let count = points.len().saturating_sub(2);
    let sum: f64 = points.windows(3).map(of_three).sum();
    (sum / count.max(1) as f64).min(SHARP)
}

/// Returns by how much the point in the middle is nearer to the scanner than the ends, m.
fn depth(points: &[Point2<f64>], middle: &Point2<f64>) -> f64 {
    let ahead: Vector2<f64> = middle.coords / middle.coords.norm().max(1e-9);
    let last = points.len() - 1;
    let [start, end, before, after] =
        [0, last, last / 2, last.div_ceil(2)].map(|index| points[index].coords.dot(&ahead));
    0.5 * (start + end) - 0.5 * (before + after)
}

/// Returns the distance to the reflection before a segment, and whether that is nearer.
fn before(beams: &Beams, segment: &Segment) -> Option<(f64, bool)> {
    jump(beams, segment.start, segment.start.checked_sub(1)?)
}

/// Returns the distance to the reflection after a segment, and whether that is nearer.
fn after(beams: &Beams, segment: &Segment) -> Option<(f64, bool)> {
    (segment.end < beams.points.len()).then(|| jump(beams, segment.end - 1, segment.end)).flatten()
}

fn jump(beams: &Beams, inside: usize, outside: usize) -> Option<(f64, bool)> {
    let gap = beams.rays[inside].abs_diff(beams.rays[outside]);
    let apart = (beams.points[inside] - beams.points[outside]).norm();
    (gap <= OPEN_RAYS).then_some((apart, beams.ranges[outside] < beams.ranges[inside]))
}

/// Returns the distances to the nearest two other small segments, one of which may be the other
/// leg, the number of small segments nearby, and the distance to the nearest wide one, m.
fn surroundings(
    beams: &Beams,
    own: &Segment,
    middle: &Point2<f64>,
    segments: &[Segment],
) -> [f64; 4] {
    let [mut first, mut second, mut count, mut wall] = [APART_M, APART_M, 0.0, APART_M];
    for other in segments.iter().filter(|other| *other != own) {
        if beams.width(other.clone()) > WIDE_M {
            let apart = beams.points[other.clone()].iter().map(|point| (point - middle).norm());
            wall = apart.fold(wall, f64::min);
            continue;
        }
        let apart = (beams.middle(other.clone()) - middle).norm();
        if apart < APART_M {
            count += 1.0;
        }
        if apart < first {
            (first, second) = (apart, first);
        } else {
            second = second.min(apart);
        }
    }
    [first, second, count, wall]
}
