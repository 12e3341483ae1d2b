//! Run-length and variable-length coding of integer depth.
//!
//! Source: A. D. Wilson, "Fast lossless depth image compression", ISS 2017: runs of zeros and of
//! readings alternate; readings are differences to the last one, zigzag coded; every number is a
//! sequence of nibbles with three bits each, the low ones first, and the fourth bit is set if more
//! follow. Eight nibbles make a 32-bit word, first nibble highest, words little endian.

/// Reader of numbers from a stream of nibbles.
struct Nibbles<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Nibbles<'_> {
    fn next(&mut self) -> Option<u32> {
        // Nibble i of a word lies in byte 3 - i/2, the even ones in its high half.
        let (word, i) = (self.at / 8, self.at % 8);
        let byte = self.bytes.get(4 * word + 3 - i / 2)?;
        self.at += 1;
        Some(u32::from(if i % 2 == 0 { byte >> 4 } else { byte & 15 }))
    }

    fn number(&mut self) -> Option<u32> {
        let mut value = 0;
        // Eleven nibbles hold 32 bits; a longer number is damage.
        for shift in (0..32).step_by(3) {
            let nibble = self.next()?;
            value |= (nibble & 7) << shift;
            if nibble & 8 == 0 {
                return Some(value);
            }
        }
        None
    }
}

/// Decodes the `count` values of a stream; `None` if it ends early or holds more.
pub(super) fn decode(bytes: &[u8], count: usize) -> Option<Vec<u16>> {
    let mut nibbles = Nibbles { bytes, at: 0 };
    let mut out: Vec<u16> = Vec::with_capacity(count);
    let mut last = 0_u16;
    while out.len() < count {
        let zeros = nibbles.number()? as usize;
        // Tested before the memory is taken: a damaged run may claim any length.
        if zeros > count - out.len() {
            return None;
        }
        out.resize(out.len() + zeros, 0);
        let readings = nibbles.number()? as usize;
        if readings > count - out.len() {
            return None;
        }
        for _ in 0..readings {
            let coded = nibbles.number()?;
            // Zigzag: the lowest bit is the sign.
            let step = (coded >> 1) as i32 ^ -((coded & 1) as i32);
            last = last.wrapping_add(step as u16);
            out.push(last);
        }
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
