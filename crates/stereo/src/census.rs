//! Census transform: each pixel is described by a bit string that marks its darker neighbours. Two
//! views of the same point get nearly the same string, whatever their exposure and gain.
//!
//! R. Zabih and J. Woodfill, *Non-parametric local transforms for computing
//! visual correspondence*, ECCV 1994, section 3.

use crate::rows::{Rows, mirror};

/// Number of bytes in the string of a pixel.
pub const BYTES: usize = 3;

/// Neighbours that a pixel is compared with, as (column, row) offsets: a 5x5 window without its
/// centre.
pub const NEIGHBOURS: [(i32, i32); 8 * BYTES] = neighbours();

const fn neighbours() -> [(i32, i32); 8 * BYTES] {
    let mut all = [(0, 0); 8 * BYTES];
    let mut cell = 0;
    let mut n = 0;
    while cell < 25 {
        let offset = (cell % 5 - 2, cell / 5 - 2);
        if offset.0 != 0 || offset.1 != 0 {
            all[n] = offset;
            n += 1;
        }
        cell += 1;
    }
    all
}

/// Bit strings of one row, stored as one plane per byte.
#[derive(Clone, Debug, Default)]
pub struct CensusRow {
    /// Planes by byte of the string: one value per column, followed by the padding of a mirrored
    /// row.
    pub planes: [Vec<u8>; BYTES],
}

impl CensusRow {
    /// Computes a row. A neighbour counts as darker only if the difference is more than `noise`. A
    /// mirrored row is written from right to left, and followed by `mirrored` copies of the value
    /// of the first column.
    pub fn compute(&mut self, rows: &Rows, noise: u8, mirrored: Option<usize>) {
        let width = rows.width();
        for (byte, plane) in self.planes.iter_mut().enumerate() {
            plane.clear();
            plane.resize(width, 0);
            for (bit, (dx, dy)) in NEIGHBOURS[8 * byte..8 * byte + 8].iter().enumerate() {
                set_bits(plane, rows.from(*dx, *dy), rows.from(0, 0), noise, bit);
            }
            mirror(plane, mirrored);
        }
    }
}

/// Sets a bit where a neighbour is darker than the centre.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
fn set_bits(plane: &mut [u8], neighbour: &[u8], centre: &[u8], noise: u8, bit: usize) {
    for ((cell, n), c) in plane.iter_mut().zip(neighbour).zip(centre) {
        *cell |= u8::from(*n < c.saturating_sub(noise)) << bit;
    }
}
