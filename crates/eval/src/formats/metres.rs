//! `tracks-metres.csv`: the positions of tracks as a run writes them. The first line names the
//! columns; frames are numbered from 1.

use super::{FormatError, Line, Table};
use crate::types::Report;

/// One track in one frame.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Row {
    /// Line of the file, from 1.
    pub line: usize,
    /// Time, in nanoseconds.
    pub stamp_ns: i64,
    /// Number of the colour image, from 1.
    pub frame: u32,
    /// ID of the track.
    pub id: i64,
    /// Centre of the head in the robot frame: forward, left, up, in metres.
    pub head_in_robot_m: [f64; 3],
    /// The same in the odometry frame; NaN where the run could not use the odometry.
    pub head_in_odom_m: [f64; 3],
    /// True if the track has a detection in this frame.
    pub seen: bool,
}

/// Frame in which positions on the floor are given.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Floor {
    /// The robot frame of each moment.
    #[default]
    Robot,
    /// The odometry frame, which is fixed.
    Odometry,
}

impl Row {
    /// Returns the row as a report, with the number of its frame; the score is 1.
    pub fn report(&self, floor: Floor) -> (u32, Report) {
        let [x, y, _] = match floor {
            Floor::Robot => self.head_in_robot_m,
            Floor::Odometry => self.head_in_odom_m,
        };
        let floor_m = Some([x, y]).filter(|place| place.iter().all(|value| value.is_finite()));
        (self.frame, Report { id: self.id, region: None, floor_m, score: 1.0 })
    }
}

/// Reads `tracks-metres.csv`; columns are found by name.
///
/// # Errors
///
/// When a column is missing, or a field is not a number.
pub fn parse(text: &str, file: &str) -> Result<Vec<Row>, FormatError> {
    let table = Table::new(text, file)?;
    let stamp = table.column("stamp_ns")?;
    let frame = table.column("frame")?;
    let id = table.column("id")?;
    let robot =
        [table.column("x_robot_m")?, table.column("y_robot_m")?, table.column("z_robot_m")?];
    let odom = [table.column("x_odom_m")?, table.column("y_odom_m")?, table.column("z_odom_m")?];
    let seen = table.column("seen")?;
    let mut rows = Vec::new();
    for line in &table.rows {
        let stamp = line.text(stamp, "stamp_ns")?;
        rows.push(Row {
            line: line.number,
            stamp_ns: stamp.parse().map_err(|_| {
                line.error(format!("`stamp_ns` is `{stamp}`, expected whole nanoseconds"))
            })?,
            frame: line.frame(frame, 1)?,
            id: line.whole(id, "id")?,
            head_in_robot_m: point(line, robot)?,
            head_in_odom_m: match line.text(odom[0], "x")? {
                "NaN" => [f64::NAN; 3],
                _ => point(line, odom)?,
            },
            seen: line.number(seen, "seen")? != 0.0,
        });
    }
    Ok(rows)
}

fn point(line: &Line<'_>, [x, y, z]: [usize; 3]) -> Result<[f64; 3], FormatError> {
    Ok([line.number(x, "x")?, line.number(y, "y")?, line.number(z, "z")?])
}

/// Rejects frames beyond the end of a sequence.
///
/// # Errors
///
/// The first row whose frame is above `length`.
pub fn check_length(rows: &[Row], file: &str, length: u32) -> Result<(), FormatError> {
    super::check_length(rows.iter().map(|row| (row.line, row.frame)), file, length)
}
