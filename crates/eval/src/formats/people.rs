//! `people.csv`: upper bodies and heads annotated in a recording. The first line names the columns,
//! in any order; frames are numbered from 1. `frame`, `id` and either a box of the upper body or
//! the position of the head are required; everything else has a default.

use std::io::{self, Write};

use super::{FormatError, Line, Table};
use crate::types::{Region, Role, Truth, View};

/// The columns, in the order in which they are written.
pub const HEADER: &str = "frame,id,ub_x,ub_y,ub_w,ub_h,vis_x,vis_y,vis_w,vis_h,\
head_x,head_y,head_z,visible,occluder,ignore,interpolated,key,proposed";

const UPPER_BODY: [&str; 4] = ["ub_x", "ub_y", "ub_w", "ub_h"];
const VISIBLE_BODY: [&str; 4] = ["vis_x", "vis_y", "vis_w", "vis_h"];
const HEAD: [&str; 3] = ["head_x", "head_y", "head_z"];

/// One annotated person in one frame.
#[derive(Clone, PartialEq, Debug)]
pub struct Row {
    /// Number of the colour image, from 1.
    pub frame: u32,
    /// ID of the person.
    pub id: i64,
    /// The upper-body square in pixels, clipped to the image.
    pub upper_body: Option<Region>,
    /// The visible part of the whole body in pixels.
    pub visible_body: Option<Region>,
    /// Surface of the head in metres, in the colour camera's optical frame:
    /// right, down, forward.
    pub head_in_camera_m: Option<[f64; 3]>,
    /// Visible fraction of the upper body; 1 by default.
    pub visible: f64,
    /// Occluder: `0` for none, the ID of a person, `border` or `static`.
    pub occluder: String,
    /// Neither a miss nor a false alarm.
    pub ignore: bool,
    /// 0 measured, 1 interpolated or set by eye, 2 depth taken from the torso.
    pub interpolated: u8,
    /// True if the box was set by hand, false if it is interpolated between boxes that were; true
    /// by default.
    pub key: bool,
    /// Pipeline that proposed the box, if it is not reviewed yet; empty by default.
    pub proposed: String,
}

impl Row {
    /// Returns the row as truth, with the number of its frame. `floor_from_camera` converts the
    /// position of the head in the camera frame to the floor frame of the tracks, in metres; it
    /// returns `None` if that is not known.
    pub fn truth(&self, floor_from_camera: impl Fn([f64; 3]) -> Option<[f64; 2]>) -> (u32, Truth) {
        let truth = Truth {
            id: self.id,
            region: self.upper_body,
            floor_m: self.head_in_camera_m.and_then(floor_from_camera),
            role: if self.ignore { Role::Ignored } else { Role::Counts },
            view: self.distance_m().map(|distance_m| View { visible: self.visible, distance_m }),
        };
        (self.frame, truth)
    }

    fn distance_m(&self) -> Option<f64> {
        let head = self.head_in_camera_m?;
        Some(head.iter().map(|v| v * v).sum::<f64>().sqrt())
    }
}

/// Reads `people.csv`. Columns are found by name; unknown ones are ignored. Cells that are not
/// required may be empty, and their columns missing.
///
/// # Errors
///
/// When a column is missing, a row has neither box nor position, a field is not a number, or a size
/// is negative.
pub fn parse(text: &str, file: &str) -> Result<Vec<Row>, FormatError> {
    let table = Table::new(text, file)?;
    for required in ["frame", "id"] {
        table.column(required)?;
    }
    for group in [&UPPER_BODY[..], &VISIBLE_BODY, &HEAD] {
        // If only some columns of a group are there, one is misspelt.
        if group.iter().any(|name| table.find(name).is_some()) {
            group.iter().try_for_each(|name| table.column(name).map(|_| ()))?;
        }
    }
    if table.find(UPPER_BODY[0]).or(table.find(HEAD[0])).is_none() {
        let wanted = [UPPER_BODY.join(", "), HEAD.join(", ")].join(" or ");
        return Err(table.header.error(format!("has neither a box nor a place: add {wanted}")));
    }
    table.rows.iter().map(|line| Cells { line, table: &table }.row()).collect()
}

/// A line together with the columns of its table.
struct Cells<'a> {
    line: &'a Line<'a>,
    table: &'a Table<'a>,
}

impl Cells<'_> {
    /// Returns the index of a column, if the table has it and its cell is not empty.
    fn filled(&self, name: &str) -> Result<Option<usize>, FormatError> {
        let Some(at) = self.table.find(name) else { return Ok(None) };
        Ok(if self.line.text(at, name)?.is_empty() { None } else { Some(at) })
    }

    fn number_or(&self, name: &str, default: f64) -> Result<f64, FormatError> {
        self.filled(name)?.map_or(Ok(default), |at| self.line.number(at, name))
    }

    /// Returns the numbers in a group of columns, which must all be filled or all be empty.
    fn group<const N: usize>(&self, names: [&str; N]) -> Result<Option<[f64; N]>, FormatError> {
        let mut values = [0.0; N];
        let mut empty = 0;
        for (value, name) in values.iter_mut().zip(names) {
            match self.filled(name)? {
                Some(at) => *value = self.line.number(at, name)?,
                None => empty += 1,
            }
        }
        match empty {
            0 => Ok(Some(values)),
            _ if empty == N => Ok(None),
            _ => Err(self.line.error(format!("fill all of {}, or none", names.join(", ")))),
        }
    }

    fn region(&self, names: [&str; 4]) -> Result<Option<Region>, FormatError> {
        let Some([x, y, width, height]) = self.group(names)? else { return Ok(None) };
        if width < 0.0 || height < 0.0 {
            return Err(self.line.error("a box has a negative size"));
        }
        Ok(Some(Region { x, y, width, height }))
    }

    fn row(&self) -> Result<Row, FormatError> {
        let line = self.line;
        let occluder = match self.filled("occluder")? {
            Some(at) => line.text(at, "occluder")?,
            None => "0",
        };
        let row = Row {
            frame: line.frame(self.table.column("frame")?, 1)?,
            id: line.whole(self.table.column("id")?, "id")?,
            upper_body: self.region(UPPER_BODY)?,
            visible_body: self.region(VISIBLE_BODY)?,
            head_in_camera_m: self.group(HEAD)?,
            visible: self.number_or("visible", 1.0)?,
            occluder: occluder.to_owned(),
            ignore: self.number_or("ignore", 0.0)? != 0.0,
            interpolated: self.number_or("interpolated", 0.0)?.clamp(0.0, 255.0) as u8,
            key: self.number_or("key", 1.0)? != 0.0,
            proposed: match self.filled("proposed")? {
                Some(at) => line.text(at, "proposed")?.to_owned(),
                None => String::new(),
            },
        };
        if row.upper_body.is_none() && row.head_in_camera_m.is_none() {
            return Err(line.error("has neither a box (ub_*) nor a place (head_*)"));
        }
        Ok(row)
    }
}

/// Writes the header and all rows; cells without a value are empty.
///
/// # Errors
///
/// Those of the writer.
pub fn write(out: &mut impl Write, rows: &[Row]) -> io::Result<()> {
    writeln!(out, "{HEADER}")?;
    for row in rows {
        write!(out, "{},{}", row.frame, row.id)?;
        for region in [row.upper_body, row.visible_body] {
            write_cells(out, region.map(|r| [r.x, r.y, r.width, r.height]))?;
        }
        write_cells(out, row.head_in_camera_m)?;
        let ignore = u8::from(row.ignore);
        let key = u8::from(row.key);
        let visible = row.visible;
        let occluder = &row.occluder;
        let proposed = &row.proposed;
        writeln!(out, ",{visible},{occluder},{ignore},{},{key},{proposed}", row.interpolated)?;
    }
    Ok(())
}

fn write_cells<const N: usize>(out: &mut impl Write, values: Option<[f64; N]>) -> io::Result<()> {
    match values {
        Some(values) => values.iter().try_for_each(|value| write!(out, ",{value}")),
        None => (0..N).try_for_each(|_| write!(out, ",")),
    }
}
