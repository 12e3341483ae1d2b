//! Text formats of truth and tracks, read from strings and written to strings.
//!
//! * [`mot`]: MOTChallenge `gt.txt`, `det.txt`, tracker output, `seqinfo.ini`.
//! * [`trackeval`]: the folder tree that TrackEval reads.
//! * [`kitti`]: KITTI tracking labels.
//! * [`people`]: `people.csv`, the upper-body annotation of recordings.
//! * [`floor`]: `people-floor.csv`, people annotated in laser scans.
//! * [`metres`]: `tracks-metres.csv`, the positions that a run writes.
//!
//! Readers keep every row unchanged; a second step turns rows into frames and decides which rows
//! count.

pub mod floor;
pub mod kitti;
pub mod metres;
pub mod mot;
pub mod people;
pub mod trackeval;

use std::collections::{BTreeMap, BTreeSet};

use crate::types::{Frame, Report, Sequence, Truth};

/// A line that cannot be read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{file}{}: {why}", place(*.line))]
pub struct FormatError {
    /// Name of the file for messages.
    pub file: String,
    /// 1-based line, 0 for the file as a whole.
    pub line: usize,
    /// The fault, and the expected text.
    pub why: String,
}

/// Lines of a file that were read, but probably do not mean what their writer intended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OddLines {
    /// Number of such lines.
    pub count: usize,
    /// The first of them, counted from 1.
    pub first: usize,
    /// Number of lines of the file that are not empty.
    pub of: usize,
}

impl OddLines {
    /// Returns the odd ones among all lines, given as their numbers with true for odd; `None` if
    /// there are none.
    pub fn among(lines: impl IntoIterator<Item = (usize, bool)>) -> Option<Self> {
        let mut odd = Vec::new();
        let mut of = 0;
        for (line, is_odd) in lines {
            of += 1;
            odd.extend(is_odd.then_some(line));
        }
        odd.first().map(|&first| Self { count: odd.len(), first, of })
    }
}

/// Keeps the first of the people with the same ID in one frame, and returns the number of those
/// that it removes.
pub fn keep_first_of_id<T>(people: &mut Vec<T>, frame_and_id: impl Fn(&T) -> (u64, i64)) -> usize {
    let mut seen = BTreeSet::new();
    let before = people.len();
    people.retain(|person| seen.insert(frame_and_id(person)));
    before - people.len()
}

fn place(line: usize) -> String {
    if line == 0 { String::new() } else { format!(", line {line}") }
}

fn check_length(
    frames: impl IntoIterator<Item = (usize, u32)>,
    file: &str,
    length: u32,
) -> Result<(), FormatError> {
    match frames.into_iter().find(|(_, frame)| *frame > length) {
        Some((line, frame)) => {
            let why = format!("frame {frame}; the sequence has {length} (seqLength)");
            Err(FormatError { file: file.to_owned(), line, why })
        }
        None => Ok(()),
    }
}

/// Frames by number, to be filled from rows in any order.
#[derive(Clone, Debug, Default)]
pub struct Timeline {
    frames: BTreeMap<u32, Frame>,
}

impl Timeline {
    /// Creates a timeline without frames.
    pub fn new() -> Self {
        Self::default()
    }

    /// Returns the frame with this number, and creates it if it is new.
    pub fn frame(&mut self, number: u32) -> &mut Frame {
        self.frames.entry(number).or_default()
    }

    /// Adds truths, each with the number of its frame.
    pub fn add_truths(&mut self, rows: impl IntoIterator<Item = (u32, Truth)>) {
        for (number, truth) in rows {
            self.frame(number).truths.push(truth);
        }
    }

    /// Adds reports, each with the number of its frame.
    pub fn add_reports(&mut self, rows: impl IntoIterator<Item = (u32, Report)>) {
        for (number, report) in rows {
            self.frame(number).reports.push(report);
        }
    }

    /// Returns the frames that exist, by number.
    pub fn into_frames(self) -> BTreeMap<u32, Frame> {
        self.frames
    }

    /// Returns the number of the last frame that contains people.
    pub fn last(&self) -> Option<u32> {
        self.frames.last_key_value().map(|(&number, _)| number)
    }

    /// Returns the frames `first..first + length` with evenly spaced stamps, including empty ones,
    /// and the number of frames outside of that range, which are left out.
    pub fn into_sequence(
        mut self,
        name: &str,
        first: u32,
        length: u32,
        rate_hz: f64,
    ) -> (Sequence, usize) {
        let frames: Vec<Frame> = (0..length)
            .map(|index| {
                let number = first.saturating_add(index);
                let frame = self.frames.remove(&number).unwrap_or_default();
                Frame { stamp_ns: (f64::from(index) / rate_hz * 1e9).round() as i64, ..frame }
            })
            .collect();
        (Sequence { name: name.to_owned(), frames }, self.frames.len())
    }
}

/// Last plausible frame number of any file; nine hours at 30 frames a second.
pub const MOST_FRAMES: u32 = 1_000_000;

/// Plausible number of frames per row of a file beyond [`MOST_FRAMES`], as in a day with few
/// people. Scoring needs memory for every frame, even for those without a row, and a stamp in place
/// of a frame number must not allocate gigabytes.
const FRAMES_OF_A_ROW: usize = 10;

/// Largest ID of a person or a track: as `f64`, all integers up to it are distinct.
pub const MOST_ID: i64 = 8_999_999_999_999_999;

/// One line split into fields, with its position for error messages.
struct Line<'a> {
    file: &'a str,
    number: usize,
    fields: Vec<&'a str>,
    /// Last plausible frame number in a file of this length.
    last_frame: u32,
}

impl<'a> Line<'a> {
    fn error(&self, why: impl Into<String>) -> FormatError {
        FormatError { file: self.file.to_owned(), line: self.number, why: why.into() }
    }

    fn text(&self, index: usize, name: &str) -> Result<&'a str, FormatError> {
        self.fields.get(index).copied().ok_or_else(|| {
            self.error(format!(
                "has {} fields, but `{name}` should be field {}; is the file cut off?",
                self.fields.len(),
                index + 1
            ))
        })
    }

    fn number(&self, index: usize, name: &str) -> Result<f64, FormatError> {
        let text = self.text(index, name)?;
        match plain(text).map_or_else(|| text.parse::<f64>(), Ok) {
            Ok(value) if value.is_finite() => Ok(value),
            _ => Err(self.error(format!("`{name}` is `{text}`, expected a finite number"))),
        }
    }

    /// Returns an integer field; some programs write it as `12.0`.
    fn whole(&self, index: usize, name: &str) -> Result<i64, FormatError> {
        let value = self.number(index, name)?;
        if value.fract() == 0.0 && value.abs() <= MOST_ID as f64 {
            return Ok(value as i64);
        }
        Err(self.error(format!("`{name}` is `{value}`, expected a whole number")))
    }

    fn frame(&self, index: usize, first: u32) -> Result<u32, FormatError> {
        let value = self.whole(index, "frame")?;
        match u32::try_from(value) {
            Ok(frame) if (first..=self.last_frame).contains(&frame) => Ok(frame),
            _ => Err(self.error(format!(
                "frame {value}; frames are numbered from {first}, and those of a file of this length \
                 are plausible up to {}",
                self.last_frame
            ))),
        }
    }
}

/// Returns the value of a few digits with a decimal point, the same as from the slower `parse`:
/// both integers are exact, so their quotient is rounded once.
fn plain(text: &str) -> Option<f64> {
    const TENS: [f64; 8] = [1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7];
    let (digits, negative) = match text.as_bytes() {
        [b'-', digits @ ..] => (digits, true),
        digits => (digits, false),
    };
    if digits.is_empty() || digits.len() > TENS.len() {
        return None;
    }
    let mut whole = 0_u32;
    let mut behind = None;
    for (at, byte) in digits.iter().enumerate() {
        match byte {
            b'0'..=b'9' => whole = 10 * whole + u32::from(byte - b'0'),
            b'.' if behind.is_none() && digits.len() > 1 => behind = Some(digits.len() - 1 - at),
            _ => return None,
        }
    }
    let value = f64::from(whole) / TENS[behind.unwrap_or(0)];
    Some(if negative { -value } else { value })
}

/// Returns the lines that are not empty, split at commas if there are any, otherwise at blanks.
fn lines<'a>(text: &'a str, file: &'a str) -> impl Iterator<Item = Line<'a>> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let last_frame = last_plausible_frame(text);
    text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()).map(
        move |(index, line)| {
            // Capacity for the fields of most formats, whose number is known only at the end of the
            // line.
            let mut fields = Vec::with_capacity(10);
            if line.contains(',') {
                fields.extend(line.split(',').map(str::trim))
            } else {
                fields.extend(line.split_whitespace())
            }
            Line { file, number: index + 1, fields, last_frame }
        },
    )
}

/// Returns the last plausible frame number in a text with this number of lines.
fn last_plausible_frame(text: &str) -> u32 {
    let rows = text.bytes().filter(|byte| *byte == b'\n').count() + 1;
    let by_rows = u32::try_from(rows.saturating_mul(FRAMES_OF_A_ROW)).unwrap_or(u32::MAX);
    by_rows.max(MOST_FRAMES)
}

/// A table with a header line, in which columns are found by name.
struct Table<'a> {
    header: Line<'a>,
    rows: Vec<Line<'a>>,
}

impl<'a> Table<'a> {
    fn new(text: &'a str, file: &'a str) -> Result<Self, FormatError> {
        let mut lines = lines(text, file);
        let header = lines.next().ok_or_else(|| FormatError {
            file: file.to_owned(),
            line: 0,
            why: "is empty, expected a header line".to_owned(),
        })?;
        Ok(Self { header, rows: lines.collect() })
    }

    fn find(&self, name: &str) -> Option<usize> {
        self.header.fields.iter().position(|&field| field == name)
    }

    fn column(&self, name: &str) -> Result<usize, FormatError> {
        self.find(name).ok_or_else(|| {
            let there = self.header.fields.join(", ");
            self.header.error(format!("no column `{name}`; there are: {there}"))
        })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::plain;

    proptest! {
        #[test]
        fn plain_numbers_are_those_of_parse(text in "-?[0-9.]{0,9}|[+-]?[0-9]{1,3}(e[0-9])?|nan|inf") {
            if let Some(value) = plain(&text) {
                prop_assert_eq!(text.parse::<f64>().map(f64::to_bits), Ok(value.to_bits()));
            }
        }

        #[test]
        fn numbers_of_few_digits_are_plain(whole in -9999..9999_i32, part in 0..999_u32) {
            for text in [whole.to_string(), format!("{whole}.{part}")] {
                prop_assert!(plain(&text).is_some());
            }
        }
    }
}
