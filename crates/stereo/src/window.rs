//! Block matching: the cost of a disparity is summed up over a square window,
//! by running sums, so that the work does not depend on the window's size. The sum
//! of a column must fit in a byte: at most ten rows of 24 bits.

/// Writes the sums of windows of `2 * radius + 1` columns, shifted right by `shift` to fit in a
/// byte. Outside of the image its border is continued.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
pub fn slide_along<const D: usize>(
    columns: &[[u8; D]],
    radius: usize,
    shift: u32,
    sums: &mut [[u8; D]],
) {
    let last = columns.len() - 1;
    let mut window = [0_u16; D];
    for x in 0..=2 * radius {
        let column = &columns[x.saturating_sub(radius).min(last)];
        for d in 0..D {
            window[d] = window[d].wrapping_add(u16::from(column[d]));
        }
    }
    for (x, sums) in sums.iter_mut().enumerate() {
        let enters = &columns[(x + radius + 1).min(last)];
        let leaves = &columns[x.saturating_sub(radius)];
        for d in 0..D {
            sums[d] = (window[d] >> shift) as u8;
            window[d] =
                window[d].wrapping_add(u16::from(enters[d])).wrapping_sub(u16::from(leaves[d]));
        }
    }
}
