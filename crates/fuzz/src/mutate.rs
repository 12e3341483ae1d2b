//! Random mutations of a valid file.

use tagalong_math::{RandomSource, SplitMix64};

/// Numbers at which parsers go wrong, as little-endian lengths and counts.
const ODD: [u64; 10] = [
    0,
    1,
    0x7f,
    0xff,
    0xffff,
    0x7fff_ffff,
    0xffff_ffff,
    0x8000_0000,
    0x7fff_ffff_ffff_ffff,
    0xffff_ffff_ffff_ffff,
];
/// Words at which text formats go wrong.
const WORDS: [&str; 14] = [
    "nan",
    "inf",
    "-1",
    "1e999",
    "18446744073709551616",
    "9223372036854775807",
    "1700000000",
    "\"",
    "[[",
    "]",
    "=",
    ",",
    "\n",
    "\u{202e}",
];
/// Most mutations of one file.
const MOST: u64 = 6;

/// Source of mutated files.
pub struct Mutator {
    numbers: SplitMix64,
}

impl Mutator {
    /// Creates the source of a seed.
    pub fn new(seed: u64) -> Self {
        Self { numbers: SplitMix64::new(seed) }
    }

    fn below(&mut self, end: usize) -> usize {
        (self.numbers.next_u64() % end.max(1) as u64) as usize
    }

    /// Returns one of the files with a few mutations.
    pub fn mutated(&mut self, files: &[Vec<u8>]) -> Vec<u8> {
        let Some(file) = files.get(self.below(files.len())) else { return Vec::new() };
        let mut bytes = file.clone();
        for _ in 0..1 + self.numbers.next_u64() % MOST {
            self.mutate(&mut bytes, files);
        }
        bytes
    }

    fn mutate(&mut self, bytes: &mut Vec<u8>, files: &[Vec<u8>]) {
        let at = self.below(bytes.len());
        let end = (at + 1 + self.below(16)).min(bytes.len());
        match self.below(8) {
            0 if at < bytes.len() => bytes[at] ^= 1 << self.below(8),
            1 if at < bytes.len() => bytes[at] = self.numbers.next_u64() as u8,
            2 => {
                let odd = ODD[self.below(ODD.len())].to_le_bytes();
                let width = [1, 2, 4, 8][self.below(4)].min(bytes.len() - at);
                bytes[at..at + width].copy_from_slice(&odd[..width]);
            }
            3 => bytes.truncate(at),
            4 => drop(bytes.drain(at..end)),
            5 => {
                let part = bytes[at..end].to_vec();
                bytes.splice(at..at, part);
            }
            6 => {
                let word = WORDS[self.below(WORDS.len())];
                bytes.splice(at..end, word.bytes());
            }
            _ => {
                let other = &files[self.below(files.len())];
                let from = self.below(other.len());
                bytes.truncate(at);
                bytes.extend_from_slice(&other[from..]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mutations_are_many_and_the_same_for_a_seed() {
        let files = [b"0123456789".to_vec(), vec![7; 100]];
        let [drawn, same, other] = [3, 3, 4].map(|seed| {
            let mut mutator = Mutator::new(seed);
            (0..500).map(|_| mutator.mutated(&files)).collect::<Vec<_>>()
        });
        assert_eq!(drawn, same);
        assert_ne!(drawn, other);
        let unchanged = drawn.iter().filter(|bytes| files.contains(bytes)).count();
        assert!(unchanged < 50, "{unchanged}");
        let lengths: std::collections::BTreeSet<usize> = drawn.iter().map(Vec::len).collect();
        assert!(lengths.len() > 50, "{lengths:?}");
    }

    #[test]
    fn an_empty_file_can_be_mutated() {
        let mut mutator = Mutator::new(1);
        (0..200).for_each(|_| drop(mutator.mutated(&[Vec::new()])));
        assert!(mutator.mutated(&[]).is_empty());
    }
}
