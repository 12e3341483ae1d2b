//! Noise in single pixels of an image of inverse depth.

/// Maximum difference of two readings of one surface, as a fraction of their mean: 1 / 8 ...
const SURFACE_BITS: u32 = 3;
/// ... or this, in the unit of the values: 0.03 1/m, because the noise of a sensor is the same at
/// all ranges, but the inverse depth is small far away.
const NOISE: u16 = (0.03 * crate::RowSums::UNITS) as u16;
/// An image is speckled if it has one odd reading in this number of pixels, ...
const FEW_ODD: usize = 100;
/// ... or one hole of a single pixel in this number. Sensors have fewer of both, at edges and at
/// the end of their range, and silhouettes allow for these.
const FEW_HOLES: usize = 20;
/// Minimum number of neighbours with a reading for a hole to be closed: at a straight edge there
/// are three.
const LEAST_READ: usize = 4;
/// Number of times that holes are closed, because their neighbours may be holes as well: if half of
/// the pixels are missing at random, one in a hundred is left.
const CLOSINGS: usize = 4;

/// Drops readings that are not near any of their eight neighbours, and closes holes that have
/// readings around them, in an image with many of either. Without isolated pixels nothing changes:
/// neither at the straight edge of a surface or a hole, nor in a line one pixel wide. 0 means no
/// reading.
pub(crate) fn despeckle(values: &mut [u16], width: usize) {
    let Speckles { odd, holes } = Speckles::count(values, width);
    if odd > values.len() / FEW_ODD || holes > values.len() / FEW_HOLES {
        clean(values, width);
    }
}

/// Numbers of pixels that differ from both of their neighbours in the row, which agree with each
/// other.
#[derive(Debug, PartialEq)]
struct Speckles {
    /// Readings of a different depth.
    odd: usize,
    /// Pixels without a reading.
    holes: usize,
}

impl Speckles {
    fn count(values: &[u16], width: usize) -> Self {
        let mut found = Self { odd: 0, holes: 0 };
        if width < 3 {
            return found;
        }
        for row in values.chunks_exact(width) {
            let blocks = row.chunks(BLOCK).zip(row[1..].chunks(BLOCK)).zip(row[2..].chunks(BLOCK));
            for ((left, middle), right) in blocks {
                let [odd, holes] = count(left, middle, right);
                found.odd += usize::from(odd);
                found.holes += usize::from(holes);
            }
        }
        found
    }
}

/// Number of pixels whose counts fit in 16 bits.
const BLOCK: usize = 1 << 14;

/// Returns the number of odd pixels and the number of holes in the middle row. Counts of the width
/// of the pixels, without a check for an overflow that no block can have, let the loop become
/// vector instructions.
fn count(left: &[u16], middle: &[u16], right: &[u16]) -> [u16; 2] {
    let [mut odd, mut holes] = [0u16; 2];
    for ((left, middle), right) in left.iter().zip(middle).zip(right) {
        let agree = (*left != 0) & is_near(*left, *right);
        holes = holes.wrapping_add(u16::from(agree & (*middle == 0)));
        let is_odd = agree & (*middle != 0) & !is_near(*left, *middle);
        odd = odd.wrapping_add(u16::from(is_odd));
    }
    [odd, holes]
}

fn clean(values: &mut [u16], width: usize) {
    let stride = width + 2;
    let mut from = with_margin(values, width);
    let mut to = vec![0; from.len()];
    pass(&from, &mut to, stride, kept);
    for _ in 0..CLOSINGS {
        std::mem::swap(&mut from, &mut to);
        pass(&from, &mut to, stride, closed);
    }
    for (row, clean) in values.chunks_exact_mut(width).zip(to.chunks_exact(stride).skip(1)) {
        row.copy_from_slice(&clean[1..=width]);
    }
}

/// Returns the image with a margin of one pixel without readings.
fn with_margin(values: &[u16], width: usize) -> Vec<u16> {
    let stride = width + 2;
    let mut framed = vec![0; stride * (values.len() / width + 2)];
    for (row, out) in values.chunks_exact(width).zip(framed.chunks_exact_mut(stride).skip(1)) {
        out[1..=width].copy_from_slice(row);
    }
    framed
}

/// Three by three pixels.
type Patch = [[u16; 3]; 3];

/// Replaces each pixel inside of the margin by a function of the patch around it.
fn pass(from: &[u16], to: &mut [u16], stride: usize, change: impl Fn(Patch) -> u16) {
    let width = stride - 2;
    let lines = from.len() / stride;
    for y in 1..lines.saturating_sub(1) {
        // Nine rows of equal length: the loop becomes vector instructions.
        let rows = [y - 1, y, y + 1].map(|y| {
            let row = &from[y * stride..(y + 1) * stride];
            [&row[..width], &row[1..=width], &row[2..]]
        });
        let out = &mut to[y * stride + 1..][..width];
        for (x, out) in out.iter_mut().enumerate() {
            *out = change(rows.map(|row| row.map(|shifted| shifted[x])));
        }
    }
}

/// Returns true if two readings may belong to one surface.
fn is_near(a: u16, b: u16) -> bool {
    a.abs_diff(b) <= (a.midpoint(b) >> SURFACE_BITS).max(NOISE)
}

/// Returns the pixel in the middle, or 0 if it is not near any neighbour.
fn kept(patch: Patch) -> u16 {
    let middle = patch[1][1];
    let near = beside(patch)
        .into_iter()
        .fold(false, |near, other| near | ((other != 0) & is_near(middle, other)));
    if near { middle } else { 0 }
}

/// Returns the pixel in the middle; for a hole the median of its neighbours, if enough have a
/// reading.
fn closed(patch: Patch) -> u16 {
    if patch[1][1] != 0 {
        return patch[1][1];
    }
    let mut around = beside(patch);
    around.sort_unstable();
    let holes = around.iter().take_while(|value| **value == 0).count();
    if around.len() - holes < LEAST_READ { 0 } else { around[usize::midpoint(holes, around.len())] }
}

/// Returns the neighbours of the pixel in the middle.
fn beside([above, row, below]: Patch) -> [u16; 8] {
    [above[0], above[1], above[2], row[0], row[2], below[0], below[1], below[2]]
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// A pixel of the image; 0 outside.
    fn at(values: &[u16], width: usize, x: i64, y: i64) -> u16 {
        let inside = (0..width as i64).contains(&x) && y >= 0;
        let index = y * width as i64 + x;
        if inside { values.get(index as usize).copied().unwrap_or(0) } else { 0 }
    }

    /// One step of the definition, pixel by pixel.
    fn slow(
        values: &[u16],
        width: usize,
        change: impl Fn(u16, &dyn Fn(i64, i64) -> u16) -> u16,
    ) -> Vec<u16> {
        let places = (0..values.len()).map(|i| ((i % width) as i64, (i / width) as i64));
        places
            .map(|(x, y)| {
                change(at(values, width, x, y), &|dx, dy| at(values, width, x + dx, y + dy))
            })
            .collect()
    }

    fn one_surface(a: u16, b: u16) -> bool {
        let a = f64::from(a);
        let b = f64::from(b);
        let most = ((0.5 * (a + b)).floor() / 8.0).floor().max(60.0);
        a > 0.0 && b > 0.0 && (a - b).abs() <= most
    }

    const HALF: [(i64, i64); 4] = [(-1, -1), (0, -1), (1, -1), (-1, 0)];

    fn slowly(values: &[u16], width: usize) -> Vec<u16> {
        fn is_alone(middle: u16, beside: &dyn Fn(i64, i64) -> u16) -> bool {
            HALF.iter().all(|(dx, dy)| {
                !one_surface(middle, beside(*dx, *dy)) && !one_surface(middle, beside(-dx, -dy))
            })
        }

        fn close(middle: u16, beside: &dyn Fn(i64, i64) -> u16) -> u16 {
            let around = HALF.iter().flat_map(|(dx, dy)| [beside(*dx, *dy), beside(-dx, -dy)]);
            let mut read: Vec<u16> = around.filter(|value| *value > 0).collect();
            read.sort_unstable();
            match (middle, read.len()) {
                (0, 4..) => read[read.len() / 2],
                _ => middle,
            }
        }

        let kept =
            slow(values, width, |middle, beside| if is_alone(middle, beside) { 0 } else { middle });
        (0..CLOSINGS).fold(kept, |values, _| slow(&values, width, close))
    }

    fn cleaned(mut values: Vec<u16>, width: usize) -> Vec<u16> {
        clean(&mut values, width);
        values
    }

    proptest! {
        #[test]
        fn speckles_are_counted_in_rows(
            width in 1usize..9,
            values in prop::collection::vec(prop_oneof![Just(0u16), 480u16..620, 950u16..1100], 0..72),
        ) {
            let values = &values[..values.len() / width * width];
            let triples = values.chunks(width).flat_map(|row| row.windows(3));
            let odd = triples.clone().filter(|row| {
                one_surface(row[0], row[2]) && row[1] > 0 && !one_surface(row[0], row[1])
            }).count();
            let holes = triples.filter(|row| one_surface(row[0], row[2]) && row[1] == 0).count();
            prop_assert_eq!(Speckles::count(values, width), Speckles { odd, holes });
        }

        #[test]
        fn the_passes_equal_their_definition(
            width in 1usize..9,
            values in prop::collection::vec(
                prop_oneof![Just(0u16), 480u16..560, 950u16..1100, 100u16..8000], 0..72
            ),
        ) {
            let values = values[..values.len() / width * width].to_vec();
            prop_assert_eq!(cleaned(values.clone(), width), slowly(&values, width));
            let mut left = values.clone();
            despeckle(&mut left, width);
            let Speckles { odd, holes } = Speckles::count(&values, width);
            let is_speckled = odd > values.len() / 100 || holes > values.len() / 20;
            prop_assert_eq!(left, if is_speckled { slowly(&values, width) } else { values });
        }
    }

    #[test]
    fn a_row_may_be_longer_than_what_is_counted_at_a_time() {
        let values: Vec<u16> = (0..3 * BLOCK + 5).map(|x| [500, 0, 500, 900][x % 4]).collect();
        let odd = values.windows(3).filter(|row| row[1] == 900).count();
        let holes = values.windows(3).filter(|row| row[1] == 0).count();
        assert_eq!(Speckles::count(&values, values.len()), Speckles { odd, holes });
    }

    /// A wall at 4 m with a post of two pixels at 2 m, and a shadow of three pixels beside it.
    fn scene() -> Vec<u16> {
        fn row(x: usize) -> u16 {
            match x {
                5 | 6 => 1000,
                7..=9 => 0,
                _ => 500,
            }
        }

        (0..12 * 16).map(|i| row(i % 16)).collect()
    }

    #[test]
    fn a_scene_without_single_pixels_stays_as_it_is() {
        assert_eq!(cleaned(scene(), 16), scene());
        let line: Vec<u16> =
            (0..12 * 16).map(|i| if i % 16 == i / 16 { 900 } else { 400 }).collect();
        assert_eq!(cleaned(line.clone(), 16), line, "a line of one pixel, aslant");
    }

    #[test]
    fn a_single_reading_and_a_single_hole_become_what_is_around_them() {
        for (at, odd) in [(3 * 16 + 2, 5000), (3 * 16 + 2, 0), (0, 5000), (8 * 16 + 12, 90)] {
            let mut values = scene();
            values[at] = odd;
            let expected = if at == 0 { 0 } else { 500 };
            assert_eq!(cleaned(values, 16)[at], expected, "{at}: {odd}");
        }
        let mut values = scene();
        values[5 * 16 + 8] = 500;
        assert_eq!(cleaned(values, 16)[5 * 16 + 8], 0, "a single reading in a shadow");
    }

    #[test]
    fn pixels_missing_at_random_come_back() {
        fn holes(values: &[u16]) -> usize {
            values.iter().filter(|value| **value == 0).count()
        }

        let mut random = 1u32;
        let mut values = vec![500; 100 * 100];
        for value in &mut values {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            if random >> 31 == 0 {
                *value = 0;
            }
        }
        assert!((4_500..5_500).contains(&holes(&values)), "{}", holes(&values));
        let clean = cleaned(values, 100);
        assert!(holes(&clean) < 100, "{}", holes(&clean));
    }

    #[test]
    fn an_image_too_small_for_neighbours_is_left_alone() {
        despeckle(&mut [], 0);
        despeckle(&mut [], 4);
        for width in [1, 2] {
            let mut values = [500, 900, 500, 0];
            despeckle(&mut values, width);
            assert_eq!(values, [500, 900, 500, 0], "{width}");
        }
    }
}
