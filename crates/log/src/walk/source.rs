//! File that is read from front to back, with its position and running checksum.

use std::io::{BufReader, Read};

/// Step in which memory is allocated, so that a wrong length costs no more than the bytes that
/// exist.
const STEP: usize = 1 << 20;

pub(crate) struct Source<R> {
    reader: BufReader<R>,
    position: u64,
    crc: crc32fast::Hasher,
    scratch: Vec<u8>,
}

impl<R: Read> Source<R> {
    pub(crate) fn new(reader: R) -> Self {
        Self {
            reader: BufReader::with_capacity(1 << 16, reader),
            position: 0,
            crc: crc32fast::Hasher::new(),
            scratch: Vec::new(),
        }
    }

    pub(crate) fn position(&self) -> u64 {
        self.position
    }

    pub(crate) fn crc(&self) -> u32 {
        self.crc.clone().finalize()
    }

    pub(crate) fn into_inner(self) -> R {
        self.reader.into_inner()
    }

    /// Fills `out` up to the end of the file; returns the number of bytes.
    pub(crate) fn fill(&mut self, out: &mut [u8]) -> usize {
        let mut got = 0;
        while got < out.len() {
            match self.read(&mut out[got..]) {
                Ok(0) | Err(_) => break,
                Ok(count) => got += count,
            }
        }
        got
    }

    /// Replaces the contents of `out` with the next `length` bytes, or with fewer at the end of the
    /// file.
    pub(crate) fn read_into(&mut self, out: &mut Vec<u8>, length: u64) -> u64 {
        out.clear();
        while (out.len() as u64) < length {
            let from = out.len();
            // Steps that double the length: few for a long record, and none far beyond the data.
            let step = STEP.max(from).min((length - from as u64).min(usize::MAX as u64) as usize);
            out.resize(from + step, 0);
            let got = self.fill(&mut out[from..]);
            out.truncate(from + got);
            if got < step {
                break;
            }
        }
        out.len() as u64
    }

    /// Skips `length` bytes; returns the number of bytes that existed.
    pub(crate) fn skip(&mut self, length: u64) -> u64 {
        // Read instead of seeking, because the checksum covers skipped records as well.
        let mut scratch = std::mem::take(&mut self.scratch);
        scratch.resize(1 << 16, 0);
        let mut done = 0;
        while done < length {
            let step = (length - done).min(scratch.len() as u64) as usize;
            let got = self.fill(&mut scratch[..step]);
            done += got as u64;
            if got < step {
                break;
            }
        }
        self.scratch = scratch;
        done
    }
}

impl<R: Read> Read for Source<R> {
    /// Reads bytes. An interrupted read is repeated; another error ends the file as its end would,
    /// and the caller detects the missing bytes.
    fn read(&mut self, out: &mut [u8]) -> std::io::Result<usize> {
        let count = loop {
            match self.reader.read(out) {
                Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
                other => break other?,
            }
        };
        self.crc.update(&out[..count]);
        self.position += count as u64;
        Ok(count)
    }
}
