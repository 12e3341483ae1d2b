use tagalong_vision::RowSums;

use crate::config::DepthTemplateConfig;
use crate::view::Local;

/// Names under which the tests count the candidates that they drop.
pub mod tests_named {
    /// Outside of the heights and depths where heads are.
    pub const VOLUME: &str = "detection volume";
    /// The scene left, right and above is not farther away (P4).
    pub const BOUNDARY: &str = "boundary points";
    /// Wider or narrower than a head.
    pub const WIDTH: &str = "head width";
    /// Nothing like a body below.
    pub const BODY: &str = "body below";
    /// The silhouette fits too badly at a cell for a closer look.
    pub const REFINE: &str = "not refined";
    /// The silhouette does not fit where it fits best.
    pub const COST: &str = "template cost";
    /// Too few cells agree.
    pub const SIZE: &str = "component size";
    /// Place of a person that was already found in this frame.
    pub const OCCUPIED: &str = "occupied";
    /// Outside of the window around the prediction.
    pub const WINDOW: &str = "search window";
}

/// Returns true if the surface goes on above, straight or aslant, at the same depth: a shoulder has
/// the head aslant above it.
pub fn is_below_something(rows: &RowSums, local: &Local, config: &DepthTemplateConfig) -> bool {
    [-ASLANT_M, 0.0, ASLANT_M].into_iter().any(|right| {
        let (x, y) = local.offset(right, -config.boundary_distance_m);
        let behind = rows.depth_m(x, y).map(|z| z - local.depth_m);
        behind.is_some_and(|m| m.abs() <= config.boundary_margin_m)
    })
}

/// From the middle of a shoulder, seen from the side, the head lies this far
/// aside, m: more than half a head, less than half the shoulders.
const ASLANT_M: f64 = 0.12;

/// Tests P4's boundary points: left of, right of and above the head the scene must be farther away.
/// A point without a reading, or nearer than the head (an object in front), is no evidence; one at
/// the head's own depth contradicts. Another person may stand on one side; but a surface that goes
/// on above is no head.
pub fn boundary(rows: &RowSums, local: &Local, config: &DepthTemplateConfig) -> bool {
    let d = config.boundary_distance_m;
    let margin = config.boundary_margin_m;
    let points = [(-d, 0.0), (d, 0.0), (0.0, -d)].map(|(right, down)| {
        let (x, y) = local.offset(right, down);
        rows.depth_m(x, y).map(|z| z - local.depth_m)
    });
    let passed = points.iter().flatten().filter(|m| **m > margin).count();
    let contradicted = points.iter().flatten().filter(|m| m.abs() <= margin).count();
    !is_below_something(rows, local, config)
        && (passed >= config.boundary_min_passed as usize || contradicted == 0)
}

/// Depth steps smaller than this belong to the same head, m.
const SAME_HEAD_M: f64 = 0.20;
/// Distance within which the edge of a head is searched, m.
const EDGE_REACH_M: f64 = 0.30;

/// Returns the width of the object that the head belongs to, at the head's own height, m.
pub fn head_width_m(rows: &RowSums, local: &Local) -> f64 {
    (head_reach(rows, local, -1.0) + head_reach(rows, local, 1.0) + 1) as f64 / local.px_per_m
}

/// Returns how far a head reaches to the left (-1) or to the right (1), pixels.
fn head_reach(rows: &RowSums, local: &Local, side: f64) -> i64 {
    let steps = (EDGE_REACH_M * local.px_per_m) as i64 + 1;
    let allowed_holes = (0.03 * local.px_per_m).max(1.0) as i64;
    let mut last = 0;
    let mut holes = 0;
    for step in 1..=steps {
        let (x, y) = local.offset(side * step as f64 / local.px_per_m, 0.0);
        match rows.value(x, y) {
            None => return last.max((0.1 * local.px_per_m) as i64),
            Some(0) if holes < allowed_holes => holes += 1,
            Some(v)
                if v > 0 && (RowSums::UNITS / f64::from(v) - local.depth_m).abs() < SAME_HEAD_M =>
            {
                last = step;
            }
            Some(_) => break,
        }
    }
    last
}

/// Part of the probes on the chest and belly that show a body under the head;
/// 1 where too few of them are visible to tell.
pub fn body_below(rows: &RowSums, local: &Local) -> f64 {
    let (sin, cos) = local.pitch_rad.sin_cos();
    let mut shown = 0u32;
    let mut asked = 0u32;
    for drop in (0..8).map(|i| 0.30 + 0.06 * f64::from(i)) {
        let expected_m = local.depth_m + drop * sin;
        let shrink = local.depth_m / expected_m;
        for right in [-0.08, 0.0, 0.08] {
            let (x, y) = local.offset(right * shrink, drop * cos * shrink);
            let behind = match rows.value(x, y) {
                None => continue,
                Some(0) => f64::INFINITY,
                Some(v) => RowSums::UNITS / f64::from(v) - expected_m,
            };
            let hidden = behind < -0.4;
            asked += u32::from(!hidden);
            shown += u32::from(!hidden && behind < 0.30);
        }
    }
    if asked < 4 { 1.0 } else { f64::from(shown) / f64::from(asked) }
}

#[cfg(test)]
mod tests {
    use tagalong_core::DepthImage;

    use super::*;

    /// Renders a person from the side, 100 pixels a metre: a head 3 m away, and the nearer
    /// shoulder.
    fn from_the_side() -> RowSums {
        let depth = DepthImage::from_fn(100, 100, |x, y| {
            let dx = x as f32 - 50.0;
            let dy = y as f32 - 40.0;
            let is_shoulder = (56..74).contains(&x) && y >= 60;
            match (is_shoulder, dx.hypot(dy) < 9.0) {
                (true, _) => 2.85,
                (_, true) => 3.0,
                _ => 6.0,
            }
        });
        RowSums::new(&depth, 1)
    }

    /// A head 3 m away in front of a wall, and things a few pixels wide.
    fn with_things(things: &[(i64, i64, f32)]) -> RowSums {
        let depth = DepthImage::from_fn(100, 100, |x, y| {
            let x = x as i64;
            let y = y as i64;
            let thing =
                things.iter().find(|(at, row, _)| (x - at).abs() < 2 && (y - row).abs() < 2);
            match (thing, (x - 50).pow(2) + (y - 40).pow(2) < 81) {
                (Some((.., depth_m)), _) => *depth_m,
                (None, true) => 3.0,
                _ => 6.0,
            }
        });
        RowSums::new(&depth, 1)
    }

    fn passes(things: &[(i64, i64, f32)], boundary_min_passed: u32) -> bool {
        let config = DepthTemplateConfig { boundary_min_passed, ..Default::default() };
        boundary(&with_things(things), &Local::upright(50, 40, 3.0, 100.0), &config)
    }

    /// A row 3 m away from column 40 to 60, 100 pixels a metre, with a gap without readings.
    fn width_with_gap(gap: std::ops::Range<usize>) -> f64 {
        let depth = DepthImage::from_fn(100, 100, |x, _| {
            if gap.contains(&x) {
                0.0
            } else if (40..=60).contains(&x) {
                3.0
            } else {
                6.0
            }
        });
        head_width_m(&RowSums::new(&depth, 1), &Local::upright(50, 40, 3.0, 100.0))
    }

    #[test]
    fn a_head_goes_on_behind_a_gap_of_three_pixels() {
        assert!((width_with_gap(0..0) - 0.21).abs() < 1e-9);
        assert!((width_with_gap(54..57) - 0.21).abs() < 1e-9);
        assert!((width_with_gap(54..58) - 0.14).abs() < 1e-9, "four are its edge");
    }

    #[test]
    fn boundary_points_lie_left_right_and_above_at_their_distance() {
        fn at((x, y): (i64, i64), depth_m: f32) -> (i64, i64, f32) {
            (x, y, depth_m)
        }

        let [left, right, above] = [(28, 40), (72, 40), (50, 18)];
        assert!(passes(&[], 3));
        for side in [left, right] {
            assert!(!passes(&[at(side, 3.0)], 3), "{side:?} contradicts");
            assert!(passes(&[at(side, 3.0)], 2), "somebody may stand on one side");
            for beside in [(side.0 - 4, 40), (side.0 + 4, 40), (side.0, 36), (side.0, 44)] {
                assert!(passes(&[at(beside, 3.0)], 3), "{beside:?} is not asked");
            }
        }
        assert!(!passes(&[at(left, 3.0), at(right, 3.0)], 2));
        assert!(!passes(&[at(above, 3.0)], 2), "what goes on above is no head");
        let aslant = [(38, 18), (62, 18)];
        assert!(aslant.iter().all(|point| !passes(&[at(*point, 3.0)], 2)));
    }

    #[test]
    fn a_boundary_point_in_front_or_without_a_reading_says_nothing() {
        let [left, right] = [(28, 40), (72, 40)];
        for depth_m in [1.5, f32::NAN] {
            assert!(passes(&[(left.0, left.1, depth_m), (right.0, right.1, depth_m)], 2));
            assert!(!passes(&[(left.0, left.1, depth_m), (right.0, right.1, 3.0)], 2));
        }
        // The margin is 0.35 m, both ways.
        for (depth_m, contradicts) in [(3.3, true), (3.4, false), (2.7, true), (2.6, false)] {
            let things = [(left.0, left.1, depth_m), (right.0, right.1, depth_m)];
            assert_eq!(!passes(&things, 2), contradicts, "{depth_m} m");
        }
    }

    #[test]
    fn a_head_is_as_wide_as_what_goes_on_at_its_depth() {
        fn width(things: &[(i64, i64, f32)]) -> f64 {
            head_width_m(&with_things(things), &Local::upright(50, 40, 3.0, 100.0))
        }

        // 17 pixels of 1 cm.
        assert!((width(&[]) - 0.17).abs() < 1e-9, "{}", width(&[]));
        // A piece beside it at its depth, behind a gap that shows the wall, is apart;
        assert!((width(&[(62, 40, 3.0)]) - 0.17).abs() < 1e-9);
        // one that touches is not, unless it is much nearer or farther.
        assert!((width(&[(60, 40, 3.1)]) - 0.20).abs() < 1e-9, "{}", width(&[(60, 40, 3.1)]));
        assert!((width(&[(40, 40, 2.9)]) - 0.20).abs() < 1e-9);
        assert!((width(&[(60, 40, 2.7)]) - 0.17).abs() < 1e-9);
        // A hole of 3 pixels is passed over.
        assert!((width(&[(55, 40, f32::NAN)]) - 0.17).abs() < 1e-9);
        let edge = Local::upright(99, 40, 6.0, 100.0);
        assert!((head_width_m(&with_things(&[]), &edge) - (0.31 + 0.1 + 0.01)).abs() < 1e-9);
    }

    #[test]
    fn a_body_is_what_most_probes_below_a_head_meet() {
        fn below(legs_m: f32, from: usize) -> f64 {
            let depth = DepthImage::from_fn(100, 140, |x, y| {
                let is_body = (35..65).contains(&x) && y >= from;
                if is_body { legs_m } else { 6.0 }
            });
            body_below(&RowSums::new(&depth, 1), &Local::upright(50, 40, 3.0, 100.0))
        }

        assert_eq!(below(3.0, 50), 1.0);
        assert_eq!(below(3.2, 50), 1.0, "a body is deep");
        assert_eq!(below(3.4, 50), 0.0, "a wall behind");
        assert_eq!(below(2.5, 50), 1.0, "hidden: nothing to tell");
        // Probes lie 30 to 72 cm below, 6 cm apart: rows 70 to 112.
        assert!((below(3.0, 89) - 4.0 / 8.0).abs() < 1e-9, "{}", below(3.0, 89));
        let dark = DepthImage::filled(100, 140, f32::NAN);
        assert_eq!(body_below(&RowSums::new(&dark, 1), &Local::upright(50, 40, 3.0, 100.0)), 0.0);
        let low = Local::upright(50, 120, 3.0, 100.0);
        assert_eq!(body_below(&RowSums::new(&dark, 1), &low), 1.0, "out of the image");
    }

    #[test]
    fn a_shoulder_has_the_head_aslant_above_it_and_a_head_has_nothing() {
        fn at(x: i64, y: i64, depth_m: f64) -> Local {
            Local::upright(x, y, depth_m, 100.0)
        }

        let rows = from_the_side();
        let config = DepthTemplateConfig::default();
        assert!(is_below_something(&rows, &at(65, 65, 2.85), &config));
        assert!(!is_below_something(&rows, &at(50, 40, 3.0), &config));
        assert!(!boundary(&rows, &at(65, 65, 2.85), &config));
    }
}
