//! `people.csv`: upper bodies and heads annotated in a recording. The first
//! line names the columns; frames are numbered from 1.

use std::io::{self, Write};

use super::{FormatError, Line, Table};
use crate::types::{Region, Role, Truth, View};

/// The columns, in the order in which they are written.
pub const HEADER: &str = "frame,id,ub_x,ub_y,ub_w,ub_h,vis_x,vis_y,vis_w,vis_h,\
head_x,head_y,head_z,visible,occluder,ignore,interpolated";

/// One annotated person in one frame.
#[derive(Clone, PartialEq, Debug)]
pub struct Row {
    /// Number of the colour image, from 1.
    pub frame: u32,
    /// Id of the person.
    pub id: i64,
    /// The upper-body square in pixels, clipped to the image.
    pub upper_body: Region,
    /// The visible part of the whole body in pixels.
    pub visible_body: Region,
    /// Surface of the head in metres, in the colour camera's optical frame:
    /// right, down, forward.
    pub head_in_camera_m: [f64; 3],
    /// Visible fraction of the upper body.
    pub visible: f64,
    /// Occluder: `0` nothing, a person's id, `border` or `static`.
    pub occluder: String,
    /// Neither a miss nor a false alarm.
    pub ignore: bool,
    /// 0 measured, 1 interpolated or set by eye, 2 depth from the torso.
    pub interpolated: u8,
}

impl Row {
    /// The row as truth, with the number of its frame. `floor_from_camera`
    /// takes the head's place in the camera to the floor frame that the tracks
    /// use, in metres; it gives nothing where that is not known.
    pub fn truth(&self, floor_from_camera: impl Fn([f64; 3]) -> Option<[f64; 2]>) -> (u32, Truth) {
        let truth = Truth {
            id: self.id,
            region: Some(self.upper_body),
            floor_m: floor_from_camera(self.head_in_camera_m),
            role: if self.ignore { Role::Ignored } else { Role::Counts },
            view: Some(View { visible: self.visible, distance_m: self.distance_m() }),
        };
        (self.frame, truth)
    }

    fn distance_m(&self) -> f64 {
        self.head_in_camera_m.iter().map(|v| v * v).sum::<f64>().sqrt()
    }
}

/// Reads `people.csv`; columns are found by name, unknown ones are passed over.
///
/// # Errors
///
/// A missing column, something that is no number, a negative size.
pub fn parse(text: &str, file: &str) -> Result<Vec<Row>, FormatError> {
    let table = Table::new(text, file)?;
    let columns = HEADER
        .split(',')
        .map(|name| Ok((name, table.column(name)?)))
        .collect::<Result<Vec<_>, FormatError>>()?;
    table.rows.iter().map(|line| Cells { line, columns: &columns }.row()).collect()
}

/// A line with its columns in the order of [`HEADER`].
struct Cells<'a> {
    line: &'a Line<'a>,
    columns: &'a [(&'static str, usize)],
}

impl Cells<'_> {
    fn number(&self, column: usize) -> Result<f64, FormatError> {
        let (name, at) = self.columns[column];
        self.line.number(at, name)
    }

    fn region(&self, first: usize) -> Result<Region, FormatError> {
        let region = Region {
            x: self.number(first)?,
            y: self.number(first + 1)?,
            width: self.number(first + 2)?,
            height: self.number(first + 3)?,
        };
        let wrong = || self.line.error("a box has a negative size");
        if region.width < 0.0 || region.height < 0.0 { Err(wrong()) } else { Ok(region) }
    }

    fn row(&self) -> Result<Row, FormatError> {
        let line = self.line;
        let (name, at) = self.columns[14];
        Ok(Row {
            frame: line.frame(self.columns[0].1, 1)?,
            id: line.whole(self.columns[1].1, "id")?,
            upper_body: self.region(2)?,
            visible_body: self.region(6)?,
            head_in_camera_m: [self.number(10)?, self.number(11)?, self.number(12)?],
            visible: self.number(13)?,
            occluder: line.text(at, name)?.to_owned(),
            ignore: self.number(15)? != 0.0,
            interpolated: self.number(16)?.clamp(0.0, 255.0) as u8,
        })
    }
}

/// Writes the header and all rows.
///
/// # Errors
///
/// Those of the writer.
pub fn write(out: &mut impl Write, rows: &[Row]) -> io::Result<()> {
    writeln!(out, "{HEADER}")?;
    for row in rows {
        write!(out, "{},{}", row.frame, row.id)?;
        for Region { x, y, width, height } in [row.upper_body, row.visible_body] {
            write!(out, ",{x},{y},{width},{height}")?;
        }
        let [x, y, z] = row.head_in_camera_m;
        let (ignore, interpolated) = (u8::from(row.ignore), row.interpolated);
        writeln!(out, ",{x},{y},{z},{},{},{ignore},{interpolated}", row.visible, row.occluder)?;
    }
    Ok(())
}
