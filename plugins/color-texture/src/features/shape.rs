use nalgebra::{Matrix3, Vector3};

use super::spread;
use super::window::{HEAD, ROWS, SIDE, Surface, TORSO, Zone};

/// Rows are taken in pairs.
const PAIRS: usize = ROWS / 2;
/// Cells along a side of one number of the map.
const COARSE: usize = 4;
/// Numbers of the map.
const MAP: usize = (SIDE / COARSE) * (ROWS / COARSE);

/// Numbers of the shape.
pub const COUNT: usize = 3 * PAIRS + MAP + 11;

/// Farther or nearer than this is as good as this, m.
const FAR_M: f32 = 0.6;

/// Widths and depths of the run of cells about the middle column, row by row;
/// how flat, round and rough head and torso are; a coarse map of the depth.
pub fn push(surface: &Surface, out: &mut Vec<f32>) {
    for pair in 0..PAIRS {
        out.extend(profile(surface, pair));
    }
    for block in 0..MAP {
        out.push(block_depth(surface, block));
    }
    let everything = Zone { rows: [0, SIDE], columns: [0, SIDE] };
    out.extend([HEAD, TORSO, everything].map(|zone| unevenness(surface, zone)));
    out.extend([HEAD, TORSO].map(|zone| roundness(surface, zone)));
    out.extend([HEAD, TORSO].map(|zone| roughness(surface, zone)));
    out.extend(shares(surface));
    out.push(changes(surface));
}

/// The run of cells on the candidate about the middle column.
fn run(surface: &Surface, row: usize) -> (usize, usize) {
    let middle = SIDE / 2;
    let cells = row * SIDE;
    let right = (middle..SIDE).take_while(|column| surface.is_on(cells + column)).count();
    let left = (0..middle).rev().take_while(|column| surface.is_on(cells + column)).count();
    if right == 0 { (middle, middle) } else { (middle - left, middle + right) }
}

/// Width, asymmetry, and mean depth of two rows.
fn profile(surface: &Surface, pair: usize) -> [f32; 3] {
    let runs = [2 * pair, 2 * pair + 1].map(|row| (row, run(surface, row)));
    let readings = runs.iter().map(|(row, _)| &surface.0[row * SIDE..(row + 1) * SIDE]);
    // No reading in two rows is unknown; readings off the candidate are a width of 0.
    if readings.flatten().all(|d| d.is_nan()) {
        return [f32::NAN; 3];
    }
    let width: usize = runs.iter().map(|(_, (left, right))| right - left).sum();
    let ends: usize = runs.iter().map(|(_, (left, right))| left + right).sum();
    let depths = runs.iter().flat_map(|&(row, (l, r))| &surface.0[row * SIDE + l..row * SIDE + r]);
    let unit = 2.0 * SIDE as f32;
    [width as f32 / unit, (ends as f32 / unit - 1.0).abs(), spread(depths.copied())[0]]
}

/// Mean depth of a block of the map.
fn block_depth(surface: &Surface, block: usize) -> f32 {
    let across = SIDE / COARSE;
    let top = block / across * COARSE;
    let left = block % across * COARSE;
    let zone = Zone { rows: [top, top + COARSE], columns: [left, left + COARSE] };
    let depths = zone.cells().map(|cell| surface.0[cell]).filter(|d| !d.is_nan());
    // Far background counts as far, not as how far.
    spread(depths.map(|d| d.clamp(-FAR_M, FAR_M)))[0]
}

/// Computes the distance of the candidate's surface from the plane that fits it best, m (root mean
/// square): zero for posters and cardboard.
fn unevenness(surface: &Surface, zone: Zone) -> f32 {
    // A plane has three parameters; fewer points than 8 fit it by chance.
    if points_on(surface, zone).count() < 8 {
        return f32::NAN;
    }
    let mut squares = Matrix3::zeros();
    let mut sums = Vector3::zeros();
    for (place, depth) in points_on(surface, zone) {
        squares += place * place.transpose();
        sums += place * depth;
    }
    let Some(inverse) = squares.try_inverse() else { return f32::NAN };
    let plane = inverse * sums;
    let off = points_on(surface, zone).map(|(place, depth)| depth - plane.dot(&place));
    let [mean, deviation] = spread(off);
    mean.hypot(deviation)
}

/// Returns the places in the window and the depths of the cells on the candidate.
fn points_on(surface: &Surface, zone: Zone) -> impl Iterator<Item = (Vector3<f32>, f32)> {
    zone.cells().filter(|cell| surface.is_on(*cell)).map(|cell| {
        let place = Vector3::new((cell % SIDE) as f32 - 15.5, (cell / SIDE) as f32 - 15.5, 1.0);
        (place / 16.0, surface.0[cell])
    })
}

/// Computes the depth of the ends of the runs behind their middles, m: heads are round.
fn roundness(surface: &Surface, zone: Zone) -> f32 {
    let rows = (zone.rows[0]..zone.rows[1]).filter_map(|row| {
        let (left, right) = run(surface, row);
        let part = (right - left) / 4;
        (part > 0).then(|| {
            let ends = [(left, left + part), (right - part, right), (left + part, right - part)];
            let [left, right, middle] =
                ends.map(|(from, to)| spread((from..to).map(|c| surface.0[row * SIDE + c]))[0]);
            (0.5 * (left + right)) - middle
        })
    });
    spread(rows)[0]
}

/// Mean bend between neighbours on the candidate, m: leaves are rough.
fn roughness(surface: &Surface, zone: Zone) -> f32 {
    let inner = Zone { columns: [zone.columns[0] + 1, zone.columns[1] - 1], ..zone };
    // A bend over an edge of the candidate is that of the background.
    let on = inner.cells().filter(|cell| (cell - 1..=cell + 1).all(|cell| surface.is_on(cell)));
    let bends = on.map(|cell| {
        let [left, here, right] = [cell - 1, cell, cell + 1].map(|cell| surface.0[cell]);
        (left - 2.0 * here + right).abs()
    });
    spread(bends)[0]
}

/// Parts of the window without a reading, on the candidate, nearer.
fn shares(surface: &Surface) -> [f32; 3] {
    let window = &surface.0[..SIDE * SIDE];
    [
        window.iter().filter(|d| d.is_nan()).count(),
        (0..window.len()).filter(|cell| surface.is_on(*cell)).count(),
        window.iter().filter(|d| **d < -FAR_M).count(),
    ]
    .map(|count| count as f32 / window.len() as f32)
}

/// Returns the average number of times that a row goes onto the candidate or off it.
fn changes(surface: &Surface) -> f32 {
    let count = (0..SIDE * SIDE)
        .filter(|cell| cell % SIDE > 0 && surface.is_on(*cell) != surface.is_on(cell - 1))
        .count();
    count as f32 / SIDE as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn surface(depth: impl Fn(f32, f32) -> f32) -> Surface {
        Surface(std::array::from_fn(|cell| depth((cell % SIDE) as f32, (cell / SIDE) as f32)))
    }

    #[test]
    fn a_poster_is_flat_however_it_hangs_and_a_ball_is_round() {
        let poster = surface(|x, y| 0.01 * (x - 16.0) - 0.004 * (y - 8.0));
        assert!(unevenness(&poster, HEAD) < 1e-4 && roundness(&poster, HEAD).abs() < 1e-4);
        let ball = surface(|x, y| {
            let square = (x - 15.5).powi(2) + (y - 8.0).powi(2);
            if square < 30.0 { 0.1 - 0.018 * (30.0 - square).sqrt() } else { 2.0 }
        });
        assert!(unevenness(&ball, HEAD) > 0.01, "{}", unevenness(&ball, HEAD));
        assert!(roundness(&ball, HEAD) > 0.01, "{}", roundness(&ball, HEAD));
    }

    #[test]
    fn leaves_are_rough() {
        let leaves = surface(|x, y| if (x + y) % 2.0 == 0.0 { 0.05 } else { -0.05 });
        assert!(roughness(&leaves, TORSO) > 0.1);
        assert!(roughness(&surface(|x, _| 0.01 * x), TORSO) < 1e-4);
    }

    #[test]
    fn a_pole_below_is_thin() {
        let stand = surface(|x, y| if y < 24.0 || (x - 15.5).abs() < 2.0 { 0.0 } else { 3.0 });
        let [wide, ..] = profile(&stand, 8);
        let [thin, aside, _] = profile(&stand, 20);
        assert_eq!((wide, thin, aside), (1.0, 4.0 / 32.0, 0.0));
    }

    #[test]
    fn there_are_as_many_numbers_as_it_says() {
        let mut out = Vec::new();
        push(&surface(|x, _| if x > 3.0 { 0.0 } else { f32::NAN }), &mut out);
        assert_eq!(out.len(), COUNT);
    }

    #[test]
    fn bends_shares_and_changes_are_counted() {
        let curved = surface(|x, _| 0.0005 * (x - 15.5).powi(2));
        assert!((roughness(&curved, TORSO) - 0.001).abs() < 1e-6);
        // Quarters of the window: no reading, on the candidate, nearer, farther.
        let quarters = surface(|x, _| match x as usize / 8 {
            0 => f32::NAN,
            1 => 0.1,
            2 => -3.0,
            _ => 3.0,
        });
        assert_eq!(shares(&quarters), [0.25; 3]);
        // Onto the candidate and off it.
        assert_eq!(changes(&quarters), 2.0);
        assert_eq!(changes(&surface(|_, _| 0.0)), 0.0);
    }
}
