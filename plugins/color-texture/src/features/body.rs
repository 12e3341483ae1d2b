use tagalong_core::{Detection, GreyImage};
use tagalong_geometry::Camera;
use tagalong_vision::{Upright, UprightGrey};

use super::gradients::{Blocks, DIRECTIONS};

const COLUMNS: usize = Upright::COLUMNS;
/// Rows and columns of a block.
const BLOCK: [usize; 2] = [8, 6];
/// Blocks of the plane.
const BLOCKS: usize = (Upright::ROWS / BLOCK[0]) * (COLUMNS / BLOCK[1]);

/// Numbers of the body.
pub const COUNT: usize = BLOCKS * (DIRECTIONS + 2);

/// The whole of the candidate, always at the same scale and from the floor up, since its
/// place is known: coats hang from poles, plants grow out of pots, and people have legs.
/// Histograms of gradients block by block, then the logarithm of the strength of each
/// block, then its intensity beside the mean of all. Blocks whose middle is outside the
/// image are not known.
pub fn push(camera: &Camera, image: &GreyImage, candidate: &Detection, out: &mut Vec<f32>) {
    let start = out.len();
    let upright = Upright::new(camera, &candidate.position);
    let Some(plane) = upright.and_then(|plane| plane.grey(image)) else {
        // Without a plane in front of the camera all features are unknown.
        out.resize(start + COUNT, f32::NAN);
        return;
    };
    let strength = Blocks { grey: &plane.grey, columns: COLUMNS, block: BLOCK }.push(out);
    // Strengths span decades; their logarithms do not.
    out.extend(strength.iter().map(|sum| sum.ln_1p()));
    // Relative to the whole plane: absolute brightness is the exposure's.
    let mean = plane.grey.iter().sum::<f32>() / plane.grey.len() as f32;
    out.extend((0..BLOCKS).map(|block| mean_of(&plane, block) - mean));
    // Blocks outside of the image are unknown, not dark.
    for block in (0..BLOCKS).filter(|block| !plane.is_seen[middle(*block)]) {
        let histogram = start + block * DIRECTIONS;
        out[histogram..histogram + DIRECTIONS].fill(f32::NAN);
        let others = start + BLOCKS * DIRECTIONS + block;
        [out[others], out[others + BLOCKS]] = [f32::NAN; 2];
    }
}

/// The first cell of a block.
fn corner(block: usize) -> usize {
    let across = COLUMNS / BLOCK[1];
    block / across * BLOCK[0] * COLUMNS + block % across * BLOCK[1]
}

fn middle(block: usize) -> usize {
    corner(block) + BLOCK[0] / 2 * COLUMNS + BLOCK[1] / 2
}

fn mean_of(plane: &UprightGrey, block: usize) -> f32 {
    let rows = (0..BLOCK[0]).map(|row| corner(block) + row * COLUMNS);
    let sum: f32 = rows.flat_map(|first| &plane.grey[first..first + BLOCK[1]]).sum();
    sum / (BLOCK[0] * BLOCK[1]) as f32
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Point3};
    use tagalong_geometry::{Distortion, ImageBox, Pinhole, Rect};

    use super::*;

    /// Computes the features of a pattern on an upright plane so far ahead, m, for a camera 1.2 m
    /// above the floor; `paint` takes the offset to the left and the height above the floor, m.
    fn numbers(ahead_m: f64, paint: impl Fn(f64, f64) -> u8) -> Vec<f32> {
        let lens =
            Pinhole { fx: 300.0, fy: 300.0, cx: 160.0, cy: 160.0, distortion: Distortion::None };
        let camera = Camera::mounted(lens, 320, 320, 1.2, 0.0, 0.0);
        let image = GreyImage::from_fn(320, 320, |x, y| {
            let [left, up] = [x, y].map(|pixel| (160.0 - pixel as f64) / 300.0 * ahead_m);
            paint(left, 1.2 + up)
        });
        let candidate =
            Detection::new("test", Point3::new(ahead_m, 0.0, 1.6), Matrix3::identity(), 0.0)
                .with_image(ImageBox::upper_body(Rect::new(140.0, 60.0, 40.0, 40.0)));
        let mut out = Vec::new();
        push(&camera, &image, &candidate, &mut out);
        assert_eq!(out.len(), COUNT);
        out
    }

    #[test]
    fn somebody_looks_the_same_near_and_far() {
        fn legs(left: f64, up: f64) -> u8 {
            match (left.abs(), up) {
                (l, u) if u < 0.9 && (l - 0.12).abs() < 0.06 => 30,
                (l, u) if (0.9..1.5).contains(&u) && l < 0.2 => 90,
                _ => 200,
            }
        }

        let near = numbers(2.4, legs);
        let far = numbers(4.8, legs);
        let off: f32 = near.iter().zip(&far).map(|(a, b)| (a - b).abs()).sum();
        let pole = numbers(4.8, |left, up| if up < 0.9 && left.abs() < 0.02 { 30 } else { 200 });
        let other: f32 = pole.iter().zip(&far).map(|(a, b)| (a - b).abs()).sum();
        assert!(3.0 * off < other, "{off} {other}");
    }

    #[test]
    fn what_is_outside_the_image_is_not_known() {
        let near = numbers(1.0, |left, _| if left > 0.0 { 200 } else { 30 });
        let chest = 4 * 6 + 3;
        let feet = 9 * 6 + 3;
        let strength = &near[BLOCKS * DIRECTIONS..];
        for (block, is_known) in [(chest, true), (feet, false)] {
            let directions = &near[block * DIRECTIONS..(block + 1) * DIRECTIONS];
            for value in directions.iter().chain([&strength[block], &strength[BLOCKS + block]]) {
                assert_eq!(value.is_finite(), is_known);
                assert_eq!(value.is_nan(), !is_known);
            }
        }
    }

    #[test]
    fn each_block_has_the_intensity_of_its_part_of_the_plane() {
        let found = numbers(6.0, |left, _| if left > 0.0 { 180 } else { 40 });
        let intensity = &found[BLOCKS * (DIRECTIONS + 1)..];
        for (block, found) in intensity.iter().enumerate() {
            let expected = if block % (COLUMNS / BLOCK[1]) < 3 { 70.0 } else { -70.0 };
            // The middle lies between two pixels.
            assert!((found - expected).abs() < 6.0, "{block}: {found}");
        }
        let found = numbers(6.0, |_, up| if up > 1.0 { 180 } else { 40 });
        let intensity = &found[BLOCKS * (DIRECTIONS + 1)..];
        let [head, feet] = [0, BLOCKS - 1].map(|block| intensity[block]);
        assert!((head - feet - 140.0).abs() < 6.0, "{head} {feet}");
    }
}
