//! MOTChallenge text: one box a line,
//! `frame, id, x, y, width, height, confidence, class, visibility` for truth
//! and `..., score, -1, -1, -1` for tracks; frames are numbered from 1.

use std::io::{self, Write};

use super::{FormatError, Line, lines};
use crate::types::{Region, Report, Role, Truth};

/// One line of a MOTChallenge file.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Row {
    /// Number of the frame, from 1.
    pub frame: u32,
    /// The person or track; -1 for plain detections.
    pub id: i64,
    /// The box in pixels of the image.
    pub region: Region,
    /// Score of a report; in truth 0 marks a box that does not count.
    pub confidence: f64,
    /// Class number of a truth (1 = pedestrian), if the line is long enough.
    pub class: Option<i64>,
    /// Visible fraction of a truth, if the line is long enough.
    pub visibility: Option<f64>,
}

/// Whose rules say what a truth means.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Rules {
    /// MOT15: there are no classes, a zero confidence takes a truth out.
    Mot15,
    /// MOT16 and MOT17: only pedestrians count; whoever is matched with a
    /// person on a vehicle, a static person, a distractor or a reflection is
    /// left out.
    #[default]
    Mot17,
    /// MOT20: as MOT17, and vehicles that are not motorised excuse as well.
    Mot20,
}

const PEDESTRIAN: i64 = 1;
/// Person on vehicle, static person, distractor, reflection.
const DISTRACTORS: [i64; 4] = [2, 7, 8, 12];
const NON_MOTORISED_VEHICLE: i64 = 6;
/// Classes are numbered from 1 to 13.
const LAST_CLASS: i64 = 13;

impl Row {
    /// What the row means as truth.
    pub fn role(&self, rules: Rules) -> Role {
        // The confidence of truth is a flag, read as a whole number.
        let counts = self.confidence.trunc() != 0.0;
        let class = self.class.unwrap_or(PEDESTRIAN);
        let excuses = DISTRACTORS.contains(&class)
            || (rules == Rules::Mot20 && class == NON_MOTORISED_VEHICLE);
        match rules {
            Rules::Mot15 if counts => Role::Counts,
            Rules::Mot15 => Role::Bystander,
            _ if excuses => Role::Ignored,
            _ if class == PEDESTRIAN && counts => Role::Counts,
            _ => Role::Bystander,
        }
    }

    /// The row as truth, with the number of its frame.
    pub fn truth(&self, rules: Rules) -> (u32, Truth) {
        let region = Some(self.region);
        (self.frame, Truth { id: self.id, region, floor_m: None, role: self.role(rules) })
    }

    /// The row as a report, with the number of its frame.
    pub fn report(&self) -> (u32, Report) {
        let region = Some(self.region);
        (self.frame, Report { id: self.id, region, floor_m: None, score: self.confidence })
    }
}

/// Reads truth, tracks or detections; `file` names the text in errors.
///
/// # Errors
///
/// A line with fewer than six fields, something that is no number, a frame
/// below 1, a negative size.
pub fn parse(text: &str, file: &str) -> Result<Vec<Row>, FormatError> {
    lines(text, file).map(|line| row(&line)).collect()
}

/// Reads truth; as [`parse`], but a class that the rules do not know is an error.
///
/// # Errors
///
/// As [`parse`]; a class outside 1 to 13 under rules with classes.
pub fn parse_truth(text: &str, file: &str, rules: Rules) -> Result<Vec<(u32, Truth)>, FormatError> {
    let read = |line: Line<'_>| {
        let row = row(&line)?;
        match row.class {
            Some(class) if rules != Rules::Mot15 && !(1..=LAST_CLASS).contains(&class) => {
                Err(line.error(format!("class {class}; the classes are 1 to {LAST_CLASS}")))
            }
            _ => Ok(row.truth(rules)),
        }
    };
    lines(text, file).map(read).collect()
}

fn row(line: &Line<'_>) -> Result<Row, FormatError> {
    let number = |index, name| line.number(index, name);
    let region = Region {
        x: number(2, "x")?,
        y: number(3, "y")?,
        width: number(4, "width")?,
        height: number(5, "height")?,
    };
    if !region.is_sane() {
        return Err(line.error("the box has a negative size"));
    }
    let more = |index| line.fields.len() > index;
    Ok(Row {
        frame: line.frame(0, 1)?,
        id: line.whole(1, "id")?,
        region,
        confidence: if more(6) { number(6, "confidence")? } else { 1.0 },
        class: if more(7) { Some(number(7, "class")? as i64) } else { None },
        visibility: if more(8) { Some(number(8, "visibility")?) } else { None },
    })
}

/// Writes a truth line: nine fields.
///
/// # Errors
///
/// Those of the writer.
pub fn write_truth(out: &mut impl Write, frame: u32, truth: &Truth) -> io::Result<()> {
    let Some(region) = truth.region else { return Ok(()) };
    let (counts, class) = match truth.role {
        Role::Counts => (1, PEDESTRIAN),
        Role::Ignored => (0, 8),
        Role::Bystander => (0, 3),
    };
    write_box(out, frame, truth.id, &region)?;
    writeln!(out, ",{counts},{class},1")
}

/// Writes a track line: ten fields.
///
/// # Errors
///
/// Those of the writer.
pub fn write_report(out: &mut impl Write, frame: u32, report: &Report) -> io::Result<()> {
    let Some(region) = report.region else { return Ok(()) };
    write_box(out, frame, report.id, &region)?;
    writeln!(out, ",{},-1,-1,-1", report.score)
}

fn write_box(out: &mut impl Write, frame: u32, id: i64, region: &Region) -> io::Result<()> {
    let Region { x, y, width, height } = region;
    write!(out, "{frame},{id},{x},{y},{width},{height}")
}

/// The longest sequence that is believed; nine hours at 30 frames a second.
const MOST_FRAMES: f64 = 1e6;

/// The part of `seqinfo.ini` that scoring and exporting need.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct SequenceInfo {
    /// Name of the sequence.
    pub name: String,
    /// Frames per second.
    pub rate_hz: f64,
    /// Number of frames.
    pub length: u32,
    /// Width of the image in pixels, 0 if not given.
    pub width: u32,
    /// Height of the image in pixels, 0 if not given.
    pub height: u32,
}

/// Reads `seqinfo.ini`.
///
/// # Errors
///
/// A name, rate or length that is missing or no number, or a length beyond a
/// million frames.
pub fn parse_info(text: &str, file: &str) -> Result<SequenceInfo, FormatError> {
    let value = |key: &str| {
        text.lines()
            .filter_map(|line| line.split_once('='))
            .find(|(name, _)| name.trim().eq_ignore_ascii_case(key))
            .map(|(_, value)| value.trim())
    };
    let error = |why: String| FormatError { file: file.to_owned(), line: 0, why };
    let number = |key: &str| match value(key) {
        None => Err(error(format!("has no `{key}=`"))),
        Some(text) => match text.parse::<f64>() {
            Ok(value) if value.is_finite() && value >= 0.0 => Ok(value),
            _ => Err(error(format!("`{key}` is `{text}`, expected a number"))),
        },
    };
    let rate_hz = number("frameRate")?;
    if rate_hz == 0.0 {
        return Err(error("`frameRate` is 0, expected frames per second".to_owned()));
    }
    let length = number("seqLength")?;
    if length > MOST_FRAMES {
        return Err(error(format!("`seqLength` is {length}, more than {MOST_FRAMES} frames")));
    }
    Ok(SequenceInfo {
        name: value("name").ok_or_else(|| error("has no `name=`".to_owned()))?.to_owned(),
        rate_hz,
        length: length as u32,
        width: number("imWidth").unwrap_or(0.0) as u32,
        height: number("imHeight").unwrap_or(0.0) as u32,
    })
}

/// Writes `seqinfo.ini`.
///
/// # Errors
///
/// Those of the writer.
pub fn write_info(out: &mut impl Write, info: &SequenceInfo) -> io::Result<()> {
    let SequenceInfo { name, rate_hz, length, width, height } = info;
    writeln!(
        out,
        "[Sequence]\nname={name}\nimDir=img1\nframeRate={rate_hz}\nseqLength={length}\n\
         imWidth={width}\nimHeight={height}\nimExt=.jpg"
    )
}
