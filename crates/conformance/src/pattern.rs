//! Patterns for test images, for detectors that compare the appearance of people.

use tagalong_geometry::Rect;

/// Returns the brightness of a reproducible pattern of blotches at a position, about 0 to 255;
/// `kind` is the number of the pattern.
pub fn blotches(u: f64, v: f64, kind: f64) -> f64 {
    let [first, second, third] =
        [[9.0, 2.0], [-4.0, 7.0 + kind], [15.0, -11.0]].map(|[a, b]| (a * u + b * v + kind).sin());
    127.0 + 60.0 * first + 40.0 * second + 25.0 * third
}

/// Returns the position of a pixel in a box, 0 to 1 along each side; `None` if it is outside.
pub fn part_of_box(region: &Rect, x: usize, y: usize) -> Option<(f64, f64)> {
    let u = (x as f64 + 0.5 - region.x) / region.width;
    let v = (y as f64 + 0.5 - region.y) / region.height;
    ((0.0..1.0).contains(&u) && (0.0..1.0).contains(&v)).then_some((u, v))
}
