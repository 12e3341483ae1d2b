//! Hash of a log, computed while it is read.

use std::io::Read;

use sha2::{Digest, Sha256};

/// Reader that passes bytes on and hashes them.
pub(crate) struct Hashing<R> {
    reader: R,
    hash: Sha256,
    bytes: u64,
}

impl<R: Read> Read for Hashing<R> {
    fn read(&mut self, out: &mut [u8]) -> std::io::Result<usize> {
        let count = self.reader.read(out)?;
        self.hash.update(&out[..count]);
        self.bytes += count as u64;
        Ok(count)
    }
}

impl<R: Read> Hashing<R> {
    /// Creates a reader that continues a hash.
    pub(crate) fn new(reader: R, hash: Sha256) -> Self {
        Self { reader, hash, bytes: 0 }
    }

    /// Reads the rest, and returns size and hash of everything.
    pub(crate) fn finish(mut self) -> (u64, Sha256) {
        let mut rest = vec![0; 1 << 16];
        // The hash covers the whole file, including the part behind the last record.
        while matches!(self.read(&mut rest), Ok(count) if count > 0) {}
        (self.bytes, self.hash)
    }
}
