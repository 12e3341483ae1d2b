//! `people-floor.csv`: people annotated in laser scans, in the frame of the laser. The first line
//! names the columns; scans are numbered from 0.

use super::{FormatError, Line, Table};
use crate::FloorPoint;

/// One annotated person in one scan.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Row {
    /// Number of the scan, from 0.
    pub scan: u32,
    /// ID and position of the person in the frame of the laser.
    pub person: FloorPoint,
    /// Position of the person in the robot frame, m; `None` if the pose of the laser on the robot
    /// is not known.
    pub robot_m: Option<[f64; 2]>,
    /// Position of the person in the odometry frame, m; `None` without odometry.
    pub odom_m: Option<[f64; 2]>,
    /// Neither a miss nor a false alarm.
    pub ignore: bool,
    /// True for a position that was annotated, false for one that is interpolated between two
    /// annotations.
    pub annotated: bool,
}

/// Reads `people-floor.csv`. Columns are found by name; unknown ones are ignored.
///
/// # Errors
///
/// When a column is missing, or a field is not a number.
pub fn parse(text: &str, file: &str) -> Result<Vec<Row>, FormatError> {
    let table = Table::new(text, file)?;
    let scan = table.column("scan")?;
    let id = table.column("id")?;
    let ignore = table.column("ignore")?;
    let source = table.column("source")?;
    let x = table.column("x_laser_m")?;
    let y = table.column("y_laser_m")?;
    let rows = table.rows.iter().map(|line| {
        let at_m = [line.number(x, "x_laser_m")?, line.number(y, "y_laser_m")?];
        Ok(Row {
            scan: line.frame(scan, 0)?,
            person: FloorPoint { id: line.whole(id, "id")?, at_m },
            robot_m: place(&table, line, ["x_robot_m", "y_robot_m"])?,
            odom_m: place(&table, line, ["x_odom_m", "y_odom_m"])?,
            ignore: line.number(ignore, "ignore")? != 0.0,
            annotated: line.text(source, "source")? == "annotated",
        })
    });
    rows.collect()
}

/// Returns the position in two columns; `None` if a column is missing or its field is empty.
fn place(
    table: &Table<'_>,
    line: &Line<'_>,
    names: [&str; 2],
) -> Result<Option<[f64; 2]>, FormatError> {
    let [x, y] = names.map(|name| {
        let at = table.find(name);
        let at = at.filter(|at| line.fields.get(*at).is_some_and(|text| !text.is_empty()));
        at.map(|at| line.number(at, name)).transpose()
    });
    Ok(x?.zip(y?).map(<[f64; 2]>::from))
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "stamp_s,scan,id,x_laser_m,y_laser_m,x_odom_m,y_odom_m,ignore,source";

    #[test]
    fn columns_are_found_by_name_and_odometry_may_be_empty() {
        let text = format!("{HEADER}\n1.5,3,1000,2.0,-1.0,,,1,gap\n1.6,4,2,1,2,3,4,0,annotated\n");
        let rows = parse(&text, "a.csv").unwrap();
        let person = FloorPoint { id: 1000, at_m: [2.0, -1.0] };
        let known =
            Row { robot_m: None, odom_m: None, ignore: true, annotated: false, scan: 3, person };
        assert_eq!(rows[0], known);
        assert_eq!((rows[1].odom_m, rows[1].ignore), (Some([3.0, 4.0]), false));
        assert!(rows[1].annotated);
    }

    #[test]
    fn the_place_in_the_robot_frame_is_read_where_it_is_there() {
        let header = HEADER.replace("x_odom_m", "x_robot_m").replace("y_odom_m", "y_robot_m");
        let rows = parse(&format!("{header}\n1.5,3,1,2,-1,5,6,0,annotated\n"), "a.csv").unwrap();
        assert_eq!((rows[0].robot_m, rows[0].odom_m), (Some([5.0, 6.0]), None));
    }

    #[test]
    fn errors_name_the_line_and_the_column() {
        let error = parse("scan,id,ignore,source\n", "a.csv").unwrap_err().to_string();
        assert!(error.contains("x_laser_m"), "{error}");
        let text = format!("{HEADER}\n1.5,3,1,near,0,,,0,annotated\n");
        let error = parse(&text, "a.csv").unwrap_err().to_string();
        assert!(error.contains("line 2") && error.contains("near"), "{error}");
    }
}
