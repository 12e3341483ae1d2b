//! Run-length and variable-length coding of integer depth.
//!
//! Source: A. D. Wilson, "Fast lossless depth image compression", ISS 2017: runs of zeros and of
//! readings alternate; readings are differences to the last one, zigzag coded; every number is a
//! sequence of nibbles with three bits each, the low ones first, and the fourth bit is set if more
//! follow. Eight nibbles make a 32-bit word, first nibble highest, words little endian.

/// Bits that say that another nibble follows.
const MORE: u64 = 0x8888_8888_8888_8888;
/// Number of nibbles of numbers that are read at once.
const SHORT: u32 = 5;

/// Reader of numbers from a stream of nibbles.
struct Nibbles<'a> {
    words: std::slice::Iter<'a, [u8; 4]>,
    /// Next nibbles to be read, the first in the highest bits; zeros follow the last one.
    next: u64,
    /// Number of nibbles in `next`.
    count: u32,
}

impl<'a> Nibbles<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        Self { words: bytes.as_chunks().0.iter(), next: 0, count: 0 }
    }

    fn refill(&mut self) {
        if self.count <= 8
            && let Some(word) = self.words.next()
        {
            self.next |= u64::from(u32::from_le_bytes(*word)) << (32 - 4 * self.count);
            self.count += 8;
        }
    }

    fn drop_first(&mut self, count: u32) {
        self.next <<= 4 * count;
        self.count -= count;
    }

    #[inline]
    fn number(&mut self) -> Option<u32> {
        self.refill();
        let length = (!self.next & MORE).leading_zeros() / 4 + 1;
        if length > SHORT.min(self.count) {
            return self.long_number();
        }
        // Without branches on the length, which is practically random.
        let digits = (0..SHORT)
            .fold(0, |value, i| value | ((self.next >> (60 - 4 * i)) as u32 & 7) << (3 * i));
        self.drop_first(length);
        Some(digits & ((1 << (3 * length)) - 1))
    }

    fn long_number(&mut self) -> Option<u32> {
        let mut value = 0;
        // Eleven nibbles hold 32 bits, so a longer number means damage.
        for shift in (0..32).step_by(3) {
            self.refill();
            if self.count == 0 {
                return None;
            }
            let nibble = (self.next >> 60) as u32;
            self.drop_first(1);
            value |= (nibble & 7) << shift;
            if nibble & 8 == 0 {
                return Some(value);
            }
        }
        None
    }
}

/// Decodes the `count` values of a stream and converts each with `pixel`; `None` if the stream ends
/// early or contains more.
pub(super) fn decode<P: Copy>(
    bytes: &[u8],
    count: usize,
    pixel: impl Fn(u16) -> P,
) -> Option<Vec<P>> {
    let mut nibbles = Nibbles::new(bytes);
    let mut out = vec![pixel(0); count];
    let mut at = 0_usize;
    let mut last = 0_u16;
    while at < count {
        // A damaged run may claim any length; the bounds check on `out` catches it.
        at = at.saturating_add(nibbles.number()? as usize);
        let readings = nibbles.number()? as usize;
        for value in out.get_mut(at..)?.get_mut(..readings)? {
            let coded = nibbles.number()?;
            // Zigzag: the lowest bit is the sign.
            let step = (coded >> 1) as i32 ^ -((coded & 1) as i32);
            last = last.wrapping_add(step as u16);
            *value = pixel(last);
        }
        at += readings;
    }
    Some(out)
}

/// Writer of numbers to a stream of nibbles.
#[derive(Default)]
struct Packer {
    bytes: Vec<u8>,
    word: u32,
    nibbles: u32,
}

impl Packer {
    fn number(&mut self, mut value: u32) {
        loop {
            let more = value > 7;
            self.word = self.word << 4 | value & 7 | u32::from(more) << 3;
            self.nibbles += 1;
            if self.nibbles == 8 {
                self.bytes.extend_from_slice(&self.word.to_le_bytes());
                (self.word, self.nibbles) = (0, 0);
            }
            value >>= 3;
            if !more {
                return;
            }
        }
    }

    fn finish(mut self) -> Vec<u8> {
        if self.nibbles > 0 {
            self.word <<= 4 * (8 - self.nibbles);
            self.bytes.extend_from_slice(&self.word.to_le_bytes());
        }
        self.bytes
    }
}

/// Encodes values; [`decode`] reads them back.
pub(super) fn encode(values: &[u16]) -> Vec<u8> {
    let mut packer = Packer::default();
    let mut rest = values;
    let mut last = 0_i32;
    while !rest.is_empty() {
        let zeros = rest.iter().take_while(|v| **v == 0).count();
        let readings = rest[zeros..].iter().take_while(|v| **v != 0).count();
        packer.number(zeros as u32);
        packer.number(readings as u32);
        for value in &rest[zeros..zeros + readings] {
            let step = i32::from(*value) - last;
            packer.number((step << 1 ^ step >> 31) as u32);
            last = i32::from(*value);
        }
        rest = &rest[zeros + readings..];
    }
    packer.finish()
}
