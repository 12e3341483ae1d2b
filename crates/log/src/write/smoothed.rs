//! `tracks-smoothed.csv`: the boxes of a run with IDs corrected by later frames.

use std::io::{self, BufRead, Write};
use std::ops::Range;

/// Two IDs that are exchanged in some frames.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Correction {
    /// Frames in which they are exchanged.
    pub(super) frames: Range<u64>,
    /// The two IDs.
    pub(super) ids: [u32; 2],
}

impl Correction {
    /// Returns the corrected ID for one of a frame.
    fn applied(&self, frame: u64, id: u32) -> u32 {
        let [first, second] = self.ids;
        if !self.frames.contains(&frame) {
            id
        } else if id == first {
            second
        } else if id == second {
            first
        } else {
            id
        }
    }
}

/// Copies the rows of `tracks.csv` and applies the corrections one after the other.
///
/// # Errors
/// Reading or writing fails, or a row does not begin with a frame and an ID.
pub(super) fn write(
    rows: impl BufRead,
    corrections: &[Correction],
    out: &mut impl Write,
) -> io::Result<()> {
    for row in rows.lines() {
        let row = row?;
        let mut cells = row.splitn(3, ',');
        let frame = cells.next().and_then(|cell| cell.parse::<u64>().ok());
        let id = cells.next().and_then(|cell| cell.parse::<u32>().ok());
        let (Some(frame), Some(id), Some(rest)) = (frame, id, cells.next()) else {
            return Err(io::Error::new(io::ErrorKind::InvalidData, format!("a row `{row}`")));
        };
        // In the order in which they were noticed, because a later one refers to the IDs after the
        // earlier ones.
        let id = corrections.iter().fold(id, |id, correction| correction.applied(frame, id));
        writeln!(out, "{frame},{id},{rest}")?;
    }
    out.flush()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn smoothed(rows: &str, corrections: &[Correction]) -> io::Result<String> {
        let mut out = Vec::new();
        write(rows.as_bytes(), corrections, &mut out)?;
        Ok(String::from_utf8(out).unwrap())
    }

    #[test]
    fn ids_are_exchanged_in_the_frames_of_the_correction_alone() {
        let rows = "1,4,0.00,-1\n2,4,1.00,-1\n2,5,2.00,-1\n2,6,3.00,-1\n3,5,4.00,-1\n";
        let correction = Correction { frames: 2..3, ids: [4, 5] };
        let expected = "1,4,0.00,-1\n2,5,1.00,-1\n2,4,2.00,-1\n2,6,3.00,-1\n3,5,4.00,-1\n";
        assert_eq!(smoothed(rows, &[correction]).unwrap(), expected);
        assert_eq!(smoothed(rows, &[]).unwrap(), rows);
    }

    #[test]
    fn later_corrections_mean_the_ids_that_earlier_ones_left() {
        let corrections =
            [Correction { frames: 1..3, ids: [1, 2] }, Correction { frames: 1..4, ids: [2, 3] }];
        assert_eq!(smoothed("1,1,0\n3,2,0\n", &corrections).unwrap(), "1,3,0\n3,3,0\n");
    }

    #[test]
    fn a_row_without_an_id_is_an_error() {
        for row in ["", "1,2", "1,x,0", "x,1,0"] {
            let error = smoothed(&format!("{row}\n"), &[]).unwrap_err();
            assert!(error.to_string().contains(row), "{error}");
        }
    }
}
