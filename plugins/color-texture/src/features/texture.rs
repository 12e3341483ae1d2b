use super::spread;
use super::window::{Grid, HEAD, SIDE, TORSO, Zone};

/// Bins of a histogram of patterns: as many brighter neighbours, 0 to 8, and
/// everything that is not uniform.
const PATTERNS: usize = 10;

/// Numbers of the texture.
pub const COUNT: usize = 2 * PATTERNS + 5;

/// A neighbour is brighter if it is by more than this, in grey values.
const NOISE: f32 = 2.0;

/// Neighbours of a cell in a circle: rows and columns away.
const CIRCLE: [(i32, i32); 8] =
    [(-1, -1), (-1, 0), (-1, 1), (0, 1), (1, 1), (1, 0), (1, -1), (0, -1)];

/// Uniform local binary patterns, whatever their rotation (Ojala, Pietikainen
/// and Maenpaa, PAMI 2002), of head and torso; contrast of both.
pub fn push(grey: &Grid<f32>, out: &mut Vec<f32>) {
    for zone in [HEAD, TORSO] {
        out.extend(patterns(grey, zone));
    }
    let [[head, head_spread], [torso, torso_spread]] =
        [HEAD, TORSO].map(|zone| spread(zone.cells().map(|cell| grey[cell])));
    let [_, all] = spread(grey.iter().copied());
    let unit = all + NOISE;
    out.extend([head_spread / unit, torso_spread / unit, (head - torso) / unit]);
    out.extend([all / 64.0, head_spread / (torso_spread + NOISE)]);
}

fn patterns(grey: &Grid<f32>, zone: Zone) -> [f32; PATTERNS] {
    fn inner(cell: &usize) -> bool {
        (1..SIDE - 1).contains(&(cell / SIDE)) && (1..SIDE - 1).contains(&(cell % SIDE))
    }

    let mut histogram = [0.0; PATTERNS];
    let mut count = 0.0f32;
    for cell in zone.cells().filter(inner) {
        histogram[pattern(grey, cell)] += 1.0;
        // The border has no full circle of neighbours.
        count += 1.0;
    }
    histogram.map(|n| n / count.max(1.0))
}

/// The pattern of a cell that has all its neighbours.
fn pattern(grey: &Grid<f32>, cell: usize) -> usize {
    let brighter = CIRCLE.map(|(down, right)| {
        let other = cell as i32 + down * SIDE as i32 + right;
        grey[other as usize] > grey[cell] + NOISE
    });
    let changes = (0..8).filter(|k| brighter[*k] != brighter[(k + 1) % 8]).count();
    // Patterns with more than two changes are noise or fine texture, and share one bin (Ojala et
    // al., PAMI 2002).
    if changes > 2 { PATTERNS - 1 } else { brighter.iter().filter(|b| **b).count() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flat_patches_dots_and_edges_have_their_patterns() {
        let middle = 16 * SIDE + 16;
        assert_eq!(pattern(&[50.0; SIDE * SIDE], middle), 0);
        let mut dot = [50.0; SIDE * SIDE];
        dot[middle] = 10.0;
        assert_eq!(pattern(&dot, middle), 8);
        let edge = std::array::from_fn(|c| if c % SIDE < 16 { 90.0 } else { 10.0 });
        assert_eq!(pattern(&edge, middle), 3);
        let checks = std::array::from_fn(|c| if c % 2 == 0 { 90.0 } else { 10.0 });
        assert_eq!(pattern(&checks, middle + 1), PATTERNS - 1);
    }

    #[test]
    fn a_blank_wall_has_finite_numbers() {
        let mut out = Vec::new();
        push(&[128.0; SIDE * SIDE], &mut out);
        assert_eq!(out.len(), COUNT);
        assert!(out.iter().all(|v| v.is_finite()), "{out:?}");
    }

    #[test]
    fn an_edge_has_its_pattern_whatever_its_direction() {
        let middle = 16 * SIDE + 16;
        let across = std::array::from_fn(|c| if c / SIDE < 16 { 90.0 } else { 10.0 });
        assert_eq!(pattern(&across, middle), 3);
        let patterns = patterns(&across, TORSO);
        assert!((patterns.iter().sum::<f32>() - 1.0).abs() < 1e-5 && patterns[0] > 0.9);
    }

    /// Stripes of 10 about their means: 150 in the head, 50 in the torso and elsewhere.
    #[test]
    fn contrasts_are_those_of_head_and_torso() {
        let mut grey = [50.0; SIDE * SIDE];
        for (zone, mean) in [(HEAD, 150.0), (TORSO, 50.0)] {
            zone.cells().for_each(|c| grey[c] = mean + if c % 2 == 0 { 10.0 } else { -10.0 });
        }
        let head = 110.0_f64;
        let torso = 300.0_f64;
        let count = (SIDE * SIDE) as f64;
        let mean = (150.0 * head + 50.0 * (count - head)) / count;
        let squares = head * (150.0 - mean).powi(2) + (count - head) * (50.0 - mean).powi(2);
        let all = ((squares + 100.0 * (head + torso)) / count).sqrt();
        let mut out = Vec::new();
        push(&grey, &mut out);
        let unit = all + 2.0;
        let expected = [10.0 / unit, 10.0 / unit, 100.0 / unit, all / 64.0, 10.0 / 12.0];
        for (found, expected) in out[2 * PATTERNS..].iter().zip(expected) {
            assert!((f64::from(*found) - expected).abs() < 1e-3, "{out:?} {expected}");
        }
    }
}
