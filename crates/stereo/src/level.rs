//! Brightness and its slope along a row, with their ranges within half a pixel, so that two cameras
//! that sample an edge at different positions still agree.
//!
//! S. Birchfield and C. Tomasi, *A pixel dissimilarity measure that is insensitive
//! to image sampling*, PAMI 1998, equations 1 to 3.

use crate::rows::{Rows, mirror};

/// Quantity along a row of an image.
#[derive(Clone, Debug, Default)]
pub struct Level {
    /// Value at each pixel ...
    pub own: Vec<u8>,
    /// ... and the minimum and the maximum up to half a pixel away.
    pub least: Vec<u8>,
    pub most: Vec<u8>,
    padded: Vec<u8>,
}

impl Level {
    /// Computes the brightness; `mirrored` as for the census.
    pub fn brightness(&mut self, rows: &Rows, mirrored: Option<usize>) {
        self.padded.clear();
        self.padded.extend_from_slice(&rows.from(-1, 0)[..rows.width() + 2]);
        self.finish(mirrored);
    }

    /// Computes half of Sobel's slope, 128 where it is flat.
    pub fn slope(&mut self, rows: &Rows, mirrored: Option<usize>) {
        let width = rows.width();
        self.padded.clear();
        self.padded.resize(width + 2, 0);
        let sides = [-1, 0, 1].map(|dy| (rows.from(-1, dy), rows.from(1, dy)));
        slopes(sides, &mut self.padded[1..=width]);
        self.padded[0] = self.padded[1];
        self.padded[width + 1] = self.padded[width];
        self.finish(mirrored);
    }

    fn finish(&mut self, mirrored: Option<usize>) {
        let width = self.padded.len() - 2;
        self.own.clear();
        self.own.extend_from_slice(&self.padded[1..=width]);
        for row in [&mut self.least, &mut self.most] {
            row.clear();
            row.resize(width, 0);
        }
        extremes(&self.padded, &mut self.least, &mut self.most);
        for row in [&mut self.own, &mut self.least, &mut self.most] {
            mirror(row, mirrored);
        }
    }
}

#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
fn slopes(sides: [(&[u8], &[u8]); 3], slopes: &mut [u8]) {
    fn rise(left: u8, right: u8) -> i16 {
        i16::from(right).wrapping_sub(i16::from(left))
    }

    let width = slopes.len();
    let [(a, b), (c, d), (e, f)] = sides.map(|(left, right)| (&left[..width], &right[..width]));
    for x in 0..width {
        let sum = rise(a[x], b[x]).wrapping_add(rise(e[x], f[x]));
        let sum = sum.wrapping_add(rise(c[x], d[x]).wrapping_mul(2));
        slopes[x] = (128 + (sum >> 1)).clamp(0, 255) as u8;
    }
}

/// Computes the minimum and the maximum of each value and its means with both neighbours; `padded`
/// has one more value on both sides.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
fn extremes(padded: &[u8], least: &mut [u8], most: &mut [u8]) {
    let width = least.len();
    let left = &padded[..width];
    let own = &padded[1..=width];
    let right = &padded[2..width + 2];
    for x in 0..width {
        let l = own[x].midpoint(left[x]);
        let r = own[x].midpoint(right[x]);
        least[x] = own[x].min(l).min(r);
        most[x] = own[x].max(l).max(r);
    }
}
