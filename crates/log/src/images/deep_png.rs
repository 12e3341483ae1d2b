//! Depth from PNGs of 16-bit grey, converted directly to metres.
//!
//! Encoders that minimise the file size filter most rows of depth with Paeth's predictor, in which
//! each pixel depends on the one to its left. Rows need not wait for the end of the previous one:
//! eight of them are decoded at once, each a pixel behind the one above, so that the neighbours of
//! all eight are available at each step.
//!
//! Portable Network Graphics (PNG) Specification, third edition, section 9.

use tagalong_core::DepthImage;

use super::check_size;
use super::raw::exact;
use crate::Limits;

const SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";
/// Rest of the header after the size: 16-bit grey, not interlaced.
const DEEP_GREY: [u8; 5] = [16, 0, 0, 0, 0];
/// Maximum distance at which deflate repeats bytes.
const HISTORY: usize = 32 * 1024;
/// Number of rows that are decoded at once, and of their bytes in one step.
const ROWS: usize = 8;
const LANES: usize = 2 * ROWS;
/// Last filter that can be undone row by row without long dependencies; the order is none, left,
/// up, mean, Paeth.
const LAST_SIMPLE: u8 = 2;

/// Converts each value of a PNG of 16-bit grey with `pixel`. `None` for any other file and for a
/// damaged one, which a complete decoder has to read or to reject.
pub(super) fn decode(
    data: &[u8],
    limits: &Limits,
    pixel: impl Fn(u16) -> f32,
) -> Option<DepthImage> {
    let (width, height, stream) = parts(data)?;
    check_size(width.into(), height.into(), 4, limits).ok()?;
    let width = width as usize;
    let height = height as usize;
    let row_bytes = 1 + 2 * width;
    let mut out = vec![0.0; width * height];
    let mut blocks = out.chunks_mut(width * ROWS);
    let mut above = Above::new(width);
    inflate(&stream, row_bytes * ROWS, |filtered| {
        let block = blocks.next()?;
        let rows = block.len() / width;
        (filtered.len() == rows * row_bytes).then(|| above.undo(filtered, block, &pixel))?
    })?;
    let is_whole = blocks.next().is_none();
    is_whole.then(|| exact(width, height, out))
}

/// Returns columns, rows and the deflated data of a PNG of 16-bit grey.
fn parts(data: &[u8]) -> Option<(u32, u32, Vec<u8>)> {
    let mut rest = data.strip_prefix(SIGNATURE)?;
    let mut size = None;
    let mut stream = Vec::new();
    loop {
        let (length, after) = rest.split_first_chunk::<4>()?;
        let length = u32::from_be_bytes(*length) as usize;
        let (chunk, after) = after.split_at_checked(length.checked_add(4)?)?;
        let (crc, after) = after.split_first_chunk::<4>()?;
        if crc32fast::hash(chunk) != u32::from_be_bytes(*crc) {
            return None;
        }
        match chunk.split_first_chunk::<4>()? {
            (b"IHDR", header) if size.is_none() => size = Some(size_of(header)?),
            (b"IDAT", part) => stream.extend_from_slice(part),
            (b"IEND", _) => break,
            // Chunks that a decoder may skip do not affect the values, except transparency.
            (kind, _) if kind[0].is_ascii_lowercase() && kind != b"tRNS" => {}
            _ => return None,
        }
        rest = after;
    }
    size.map(|(width, height)| (width, height, stream))
}

fn size_of(header: &[u8]) -> Option<(u32, u32)> {
    let (width, rest) = header.split_first_chunk()?;
    let (height, kind) = rest.split_first_chunk()?;
    (kind == DEEP_GREY).then(|| (u32::from_be_bytes(*width), u32::from_be_bytes(*height)))
}

/// Passes the inflated data to `take` in blocks of this size; the last one may be shorter.
fn inflate(
    mut stream: &[u8],
    block: usize,
    mut take: impl FnMut(&[u8]) -> Option<()>,
) -> Option<()> {
    let mut inflater = fdeflate::Decompressor::new();
    // The checksums of the chunks already show that they are intact.
    inflater.ignore_adler32();
    // Small enough to stay in the cache.
    let mut window = vec![0; 4 * HISTORY + block];
    let mut filled = 0;
    let mut taken = 0;
    loop {
        let (read, written) = inflater.read(stream, &mut window, filled, true).ok()?;
        stream = &stream[read..];
        filled += written;
        while filled - taken >= block {
            take(&window[taken..taken + block])?;
            taken += block;
        }
        if inflater.is_done() {
            return if taken == filled { Some(()) } else { take(&window[taken..filled]) };
        }
        if read + written == 0 {
            return None;
        }
        let out_of_reach = taken.min(filled.saturating_sub(HISTORY));
        window.copy_within(out_of_reach..filled, 0);
        (filled, taken) = (filled - out_of_reach, taken - out_of_reach);
    }
}

/// The last complete row, and a buffer for the next ones.
struct Above {
    /// Bytes of the row, followed by padding for the steps after the end of the first row.
    row: Vec<[u8; 2]>,
    /// Pixels of eight rows by step, each row one step behind the one above.
    steps: Vec<[u8; LANES]>,
    width: usize,
}

impl Above {
    fn new(width: usize) -> Self {
        let steps = width + ROWS - 1;
        Self { row: vec![[0; 2]; steps], steps: vec![[0; LANES]; steps], width }
    }

    /// Undoes the filters of at most [`ROWS`] rows; `None` if a filter is unknown.
    fn undo(
        &mut self,
        filtered: &[u8],
        out: &mut [f32],
        pixel: &impl Fn(u16) -> f32,
    ) -> Option<()> {
        let rows = filtered.chunks_exact(1 + 2 * self.width);
        let is_simple = rows.clone().all(|row| row[0] <= LAST_SIMPLE);
        if !is_simple {
            self.undo_aslant(rows.clone())?;
        }
        for ((r, filtered), out) in rows.enumerate().zip(out.chunks_exact_mut(self.width)) {
            let row = &mut self.row[..self.width];
            if is_simple {
                undo_simple(filtered[0], filtered[1..].as_chunks().0, row);
            } else {
                for (value, step) in row.iter_mut().zip(&self.steps[r..]) {
                    *value = [step[2 * r], step[2 * r + 1]];
                }
            }
            for (out, value) in out.iter_mut().zip(row) {
                *out = pixel(u16::from_be_bytes(*value));
            }
        }
        Some(())
    }

    /// Undoes the filters of rows in the lanes of the steps.
    fn undo_aslant<'a>(&mut self, rows: impl Iterator<Item = &'a [u8]>) -> Option<()> {
        let mut filters = Filters::default();
        for (r, row) in rows.enumerate() {
            filters.set(r, row[0])?;
            for (step, value) in self.steps[r..].iter_mut().zip(row[1..].as_chunks().0) {
                [step[2 * r], step[2 * r + 1]] = *value;
            }
        }
        undo_steps(&mut self.steps, &self.row, &filters);
        Some(())
    }
}

/// Undoes a filter up to [`LAST_SIMPLE`]; the result replaces the row above.
fn undo_simple(filter: u8, filtered: &[[u8; 2]], row: &mut [[u8; 2]]) {
    let both = row.iter_mut().zip(filtered);
    match filter {
        0 => both.for_each(|(value, filtered)| *value = *filtered),
        1 => {
            let mut high = 0_u8;
            let mut low = 0_u8;
            both.for_each(|(value, filtered)| {
                high = high.wrapping_add(filtered[0]);
                low = low.wrapping_add(filtered[1]);
                (value[0], value[1]) = (high, low);
            });
        }
        _ => both.for_each(|([high, low], filtered)| {
            *high = high.wrapping_add(filtered[0]);
            *low = low.wrapping_add(filtered[1]);
        }),
    }
}

/// Masks of the lanes of rows with each filter.
#[derive(Default)]
struct Filters {
    left: [u8; LANES],
    up: [u8; LANES],
    mean: [u8; LANES],
    paeth: [u8; LANES],
}

impl Filters {
    fn set(&mut self, row: usize, filter: u8) -> Option<()> {
        let masks = [&mut self.left, &mut self.up, &mut self.mean, &mut self.paeth];
        if usize::from(filter) > masks.len() {
            return None;
        }
        for (number, mask) in (1..).zip(masks) {
            mask[2 * row..2 * row + 2].fill(u8::from(filter == number).wrapping_neg());
        }
        Some(())
    }
}

/// Undoes the filters of eight rows. To the left of a row its lanes are 0, as the predictions there
/// have to be.
fn undo_steps(steps: &mut [[u8; LANES]], above: &[[u8; 2]], filters: &Filters) {
    let mut a = [0; LANES];
    let mut b = [0; LANES];
    for (step, top) in steps.iter_mut().zip(above) {
        let c = b;
        // The pixel above is that of the previous step, one row further up.
        b[..2].copy_from_slice(top);
        b[2..].copy_from_slice(&a[..LANES - 2]);
        for i in 0..LANES {
            let guess = paeth(a[i], b[i], c[i]) & filters.paeth[i]
                | a[i] & filters.left[i]
                | b[i] & filters.up[i]
                | mean(a[i], b[i]) & filters.mean[i];
            step[i] = step[i].wrapping_add(guess);
        }
        a = *step;
    }
}

/// Returns the mean, rounded down, without a wider integer type.
#[inline(always)]
fn mean(a: u8, b: u8) -> u8 {
    (a & b).wrapping_add((a ^ b) >> 1)
}

/// Returns the absolute difference; `abs_diff` would compile to wider integers.
#[inline(always)]
fn distance(a: u8, b: u8) -> u8 {
    a.max(b).wrapping_sub(a.min(b))
}

/// Returns the one of the left, the upper and the upper left byte that is nearest to `a + b - c`,
/// and of equal ones the first. It uses no branches and only bytes, of which vector instructions
/// process the most.
#[inline(always)]
fn paeth(a: u8, b: u8, c: u8) -> u8 {
    let to_a = distance(b, c);
    let to_b = distance(a, c);
    // Elsewhere it is farther from c than from both others.
    let is_between = (a < c) == (c < b);
    let to_c = if is_between { distance(to_a, to_b) } else { u8::MAX };
    let other = if to_b <= to_c { b } else { c };
    if to_a <= to_b.min(to_c) { a } else { other }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The predictor by its definition in the specification.
    fn slow_paeth(a: u8, b: u8, c: u8) -> u8 {
        let [a, b, c] = [a, b, c].map(i32::from);
        let p = a + b - c;
        let [to_a, to_b, to_c] = [a, b, c].map(|v| (p - v).abs());
        let nearest = if to_a <= to_b && to_a <= to_c {
            a
        } else if to_b <= to_c {
            b
        } else {
            c
        };
        nearest as u8
    }

    #[test]
    fn the_predictor_is_that_of_the_specification() {
        for bytes in 0..1_u32 << 24 {
            let [a, b, c, _] = bytes.to_le_bytes();
            assert_eq!(paeth(a, b, c), slow_paeth(a, b, c), "{a} {b} {c}");
        }
    }
}
