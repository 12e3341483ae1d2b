//! MOTChallenge text: one box per line,
//! `frame, id, x, y, width, height, confidence, class, visibility` for truth and
//! `..., score, -1, -1, -1` for tracks; frames are numbered from 1.

use std::io::{self, Write};

use super::{FormatError, Line, MOST_FRAMES, lines};
use crate::types::{Region, Report, Role, Truth};

/// One line of a MOTChallenge file.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Row {
    /// Line of the file, from 1.
    pub line: usize,
    /// Number of the frame, from 1.
    pub frame: u32,
    /// ID of the person or track; -1 for plain detections.
    pub id: i64,
    /// The box in pixels of the image.
    pub region: Region,
    /// Score of a report; for a truth, 0 marks a box that does not count.
    pub confidence: f64,
    /// Value of the class field, if the line has one: from MOT16 on the class of a truth (1 =
    /// pedestrian); in MOT15 -1, or a coordinate in metres.
    pub class: Option<f64>,
    /// Visible fraction of a truth, if the line has this field.
    pub visibility: Option<f64>,
}

/// Rules that decide which truths count.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
#[non_exhaustive]
pub enum Rules {
    /// MOT15: there are no classes; a truth with zero confidence does not count.
    Mot15,
    /// MOT16 and MOT17: only pedestrians count; reports matched with a person on a vehicle, a
    /// static person, a distractor or a reflection are left out.
    #[default]
    Mot17,
    /// MOT20: as MOT17, and vehicles without a motor excuse reports as well.
    Mot20,
}

/// Lines of MOT15 end with a position in metres, or with three times -1.
const MOT15_FIELDS: usize = 10;

impl Rules {
    /// Returns the rules for which a truth file is written: those of MOT17 if every line has a
    /// class of it, those of MOT15 if none has, or if lines end with positions.
    ///
    /// # Errors
    ///
    /// As [`parse`]; in a file that has lines with and without a class, the first one without.
    pub fn of_truth(text: &str, file: &str) -> Result<Self, FormatError> {
        let rows = parse(text, file)?;
        let has_places = lines(text, file).all(|line| line.fields.len() >= MOT15_FIELDS)
            && rows.iter().any(|row| row.class.is_some_and(|class| class.fract() != 0.0));
        let is_mixed = rows.iter().any(|row| row.known_class().is_some()) && !has_places;
        match rows.iter().find(|row| row.known_class().is_none()) {
            None if !rows.is_empty() => Ok(Self::Mot17),
            Some(row) if is_mixed => Err(row.error(
                file,
                format!(
                    "{}, and other lines have one; correct the line, or say whose rules the file \
                     follows: those of MOT15 know no classes",
                    row.class_fault()
                ),
            )),
            _ => Ok(Self::Mot15),
        }
    }

    /// Returns the name of the benchmark of these rules.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Mot15 => "MOT15",
            Self::Mot17 => "MOT17",
            Self::Mot20 => "MOT20",
        }
    }
}

const PEDESTRIAN: i64 = 1;
/// Person on vehicle, static person, distractor, reflection.
const DISTRACTORS: [i64; 4] = [2, 7, 8, 12];
const NON_MOTORISED_VEHICLE: i64 = 6;
/// Classes are numbered from 1 to 13.
const LAST_CLASS: i64 = 13;

impl Row {
    /// Returns the role of the row as truth.
    pub fn role(&self, rules: Rules) -> Role {
        // The confidence of a truth is a flag, read as an integer.
        let counts = self.confidence.trunc() != 0.0;
        let class = self.known_class().unwrap_or(PEDESTRIAN);
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

    /// Returns the row as truth, with the number of its frame.
    pub fn truth(&self, rules: Rules) -> (u32, Truth) {
        let region = Some(self.region);
        (self.frame, Truth { id: self.id, region, role: self.role(rules), ..Truth::default() })
    }

    /// Returns the row as a report, with the number of its frame.
    pub fn report(&self) -> (u32, Report) {
        let region = Some(self.region);
        (self.frame, Report { id: self.id, region, floor_m: None, score: self.confidence })
    }

    fn known_class(&self) -> Option<i64> {
        let class = self.class.filter(|class| class.fract() == 0.0)?;
        Some(class as i64).filter(|class| (1..=LAST_CLASS).contains(class))
    }

    fn class_fault(&self) -> String {
        match self.class {
            Some(class) => format!("class {class}; the classes are 1 to {LAST_CLASS}"),
            None => "has no class (field 8)".to_owned(),
        }
    }

    fn error(&self, file: &str, why: impl Into<String>) -> FormatError {
        FormatError { file: file.to_owned(), line: self.line, why: why.into() }
    }
}

/// Reads truth, tracks or detections; `file` names the text in errors. Boxes without an area are
/// kept, as in TrackEval; they match no other box.
///
/// # Errors
///
/// When a line has fewer than six fields, a field is not a number, or a frame is below 1.
pub fn parse(text: &str, file: &str) -> Result<Vec<Row>, FormatError> {
    if let Some(first) = lines(text, file).next().filter(is_header) {
        return Err(
            first.error("is a header: remove it, MOTChallenge text begins with the first box")
        );
    }
    lines(text, file).map(|line| row(&line)).collect()
}

/// Returns true for a line of column names: no field of a box is a word.
fn is_header(line: &Line<'_>) -> bool {
    line.fields.len() > 1
        && line.fields.iter().take(6).all(|field| {
            field.starts_with(|first: char| first.is_alphabetic() || "\"#'".contains(first))
        })
}

/// Reads truth as [`parse`] does, but rejects the rows that TrackEval rejects.
///
/// # Errors
///
/// As [`parse`]; an ID below 0; no class, or one outside 1 to 13, under rules with classes.
pub fn parse_truth(text: &str, file: &str, rules: Rules) -> Result<Vec<Row>, FormatError> {
    let rows = parse(text, file)?;
    for row in &rows {
        row.check_id(file)?;
        if rules != Rules::Mot15 && row.known_class().is_none() {
            return Err(row.error(file, row.class_fault()));
        }
    }
    Ok(rows)
}

/// Reads tracks as [`parse`] does, but rejects the rows that TrackEval rejects.
///
/// # Errors
///
/// As [`parse`]; an ID below 0, a class other than that of people.
pub fn parse_tracks(text: &str, file: &str) -> Result<Vec<Row>, FormatError> {
    let rows = parse(text, file)?;
    for row in &rows {
        row.check_id(file)?;
        if let Some(class) = row.class.filter(|class| class.trunc() > PEDESTRIAN as f64) {
            let why = format!("class {class}; only people (1, or -1 for none) can be scored");
            return Err(row.error(file, why));
        }
    }
    Ok(rows)
}

/// Rejects frames beyond the end of a sequence.
///
/// # Errors
///
/// The first row whose frame is above `length`.
pub fn check_length(rows: &[Row], file: &str, length: u32) -> Result<(), FormatError> {
    super::check_length(rows.iter().map(|row| (row.line, row.frame)), file, length)
}

impl Row {
    /// Rejects rows without an ID: a single ID for all of them would be one person in many places.
    fn check_id(&self, file: &str) -> Result<(), FormatError> {
        if self.id >= 0 {
            return Ok(());
        }
        let why = format!("id {}; rows with an identity have an id from 0 on", self.id);
        Err(self.error(file, why))
    }
}

fn row(line: &Line<'_>) -> Result<Row, FormatError> {
    let region = Region {
        x: line.number(2, "x")?,
        y: line.number(3, "y")?,
        width: line.number(4, "width")?,
        height: line.number(5, "height")?,
    };
    let fields = line.fields.len();
    Ok(Row {
        line: line.number,
        frame: line.frame(0, 1)?,
        id: line.whole(1, "id")?,
        region,
        confidence: if fields > 6 { line.number(6, "confidence")? } else { 1.0 },
        class: if fields > 7 { Some(line.number(7, "class")?) } else { None },
        visibility: if fields > 8 { Some(line.number(8, "visibility")?) } else { None },
    })
}

/// Writes a truth line with nine fields.
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

/// Writes a track line with ten fields.
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
/// When the name, rate or length is missing or not a number, or the length is beyond a million
/// frames.
pub fn parse_info(text: &str, file: &str) -> Result<SequenceInfo, FormatError> {
    info_of(text).map_err(|why| FormatError { file: file.to_owned(), line: 0, why })
}

fn info_of(text: &str) -> Result<SequenceInfo, String> {
    let rate_hz = info_number(text, "frameRate")?;
    if rate_hz == 0.0 {
        return Err("`frameRate` is 0, expected frames per second".to_owned());
    }
    let length = info_number(text, "seqLength")?;
    if length > f64::from(MOST_FRAMES) {
        return Err(format!("`seqLength` is {length}, more than {MOST_FRAMES} frames"));
    }
    Ok(SequenceInfo {
        name: info_value(text, "name")?.to_owned(),
        rate_hz,
        length: length as u32,
        width: info_number(text, "imWidth").unwrap_or(0.0) as u32,
        height: info_number(text, "imHeight").unwrap_or(0.0) as u32,
    })
}

fn info_value<'a>(text: &'a str, key: &str) -> Result<&'a str, String> {
    text.lines()
        .filter_map(|line| line.split_once('='))
        .find(|(name, _)| name.trim().eq_ignore_ascii_case(key))
        .map(|(_, value)| value.trim())
        .ok_or_else(|| format!("has no `{key}=`"))
}

fn info_number(text: &str, key: &str) -> Result<f64, String> {
    let value = info_value(text, key)?;
    match value.parse::<f64>() {
        Ok(number) if number.is_finite() && number >= 0.0 => Ok(number),
        _ => Err(format!("`{key}` is `{value}`, expected a number")),
    }
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
