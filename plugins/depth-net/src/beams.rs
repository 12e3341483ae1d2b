//! Points of a lidar by their directions.

use std::f64::consts::{FRAC_PI_2, TAU};

use nalgebra::{Point3, Vector3};
use tagalong_core::PointCloud;

/// Cells of directions: columns of 1 degree around the lidar, rows of 2 degrees from straight down
/// to straight up.
const COLUMNS: usize = 360;
const ROWS: usize = 90;
const COLUMN_RAD: f64 = TAU / COLUMNS as f64;
const ROW_RAD: f64 = 2.0 * FRAC_PI_2 / ROWS as f64;

/// Beams of a lidar that were reflected.
pub struct Beams {
    scanner: Point3<f64>,
    /// Points in the robot frame, m, each with the area of the surface that it stands for, m².
    pub(crate) points: Vec<(Point3<f64>, f64)>,
    /// Range of the beam nearest to the middle of each cell, m; NaN without one.
    ranges_m: Vec<f32>,
}

/// Quarter turn to the left, from 0 to 3: a view of what is ahead, at the left, behind, at the right.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Quarter(pub(crate) u8);

impl Quarter {
    /// The view ahead.
    pub const AHEAD: Self = Self(0);

    /// All four views.
    pub const ALL: [Self; 4] = [Self(0), Self(1), Self(2), Self(3)];

    /// Returns a point of the robot frame in the frame of this view.
    pub(crate) fn view_of(self, point: Point3<f64>) -> Point3<f64> {
        match self.0 {
            0 => point,
            1 => Point3::new(point.y, -point.x, point.z),
            2 => Point3::new(-point.x, -point.y, point.z),
            _ => Point3::new(-point.y, point.x, point.z),
        }
    }

    /// Returns a point of the frame of this view in the robot frame.
    pub(crate) fn robot_of(self, point: Point3<f64>) -> Point3<f64> {
        Self((4 - self.0) % 4).view_of(point)
    }
}

impl Beams {
    /// Sorts the points of a lidar by their directions.
    pub fn new(cloud: &PointCloud) -> Self {
        let mut counts = vec![0_u32; COLUMNS * ROWS];
        let mut nearest = vec![(f64::INFINITY, f32::NAN); COLUMNS * ROWS];
        let mut seen = Vec::with_capacity(cloud.points.len());
        for point in cloud.points.iter() {
            let Some(direction) = Direction::of(point - cloud.scanner) else { continue };
            let cell = direction.cell();
            counts[cell] += 1;
            let off = direction.off_middle();
            if off < nearest[cell].0 {
                nearest[cell] = (off, direction.range_m as f32);
            }
            seen.push((*point, direction));
        }
        // A beam stands for the share of the directions around it that its neighbours leave to it,
        // whatever the pattern of the lidar.
        let points = seen.iter().map(|(point, direction)| {
            let [row, column] = direction.place();
            let beams: u32 = around(row, column).map(|cell| counts[cell]).sum();
            let share = 9.0 * COLUMN_RAD * ROW_RAD * direction.cosine / f64::from(beams);
            (*point, share * direction.range_m.powi(2))
        });
        Self {
            scanner: cloud.scanner,
            points: points.collect(),
            ranges_m: nearest.iter().map(|(_, range_m)| *range_m).collect(),
        }
    }

    /// Returns the place of the lidar, m.
    pub fn scanner(&self) -> Point3<f64> {
        self.scanner
    }

    /// Returns the range, m, of the beam in the direction of a place in the robot frame: that of the
    /// nearest cell with one, at most a cell aside. `None` outside of the view and where nothing was
    /// reflected.
    pub fn range_m(&self, place: &Point3<f64>) -> Option<f32> {
        let [row, column] = Direction::of(place - self.scanner)?.place();
        let [above, below] = [row + 1, row.wrapping_sub(1)];
        let [left, right] = [(column + 1) % COLUMNS, (column + COLUMNS - 1) % COLUMNS];
        let near = [[row, column], [row, left], [row, right], [above, column], [below, column]];
        let in_view = near.into_iter().filter(|[row, _]| *row < ROWS);
        let mut ranges = in_view.map(|[row, column]| self.ranges_m[row * COLUMNS + column]);
        ranges.find(|range_m| !range_m.is_nan())
    }
}

/// Direction of a beam, and its length.
struct Direction {
    /// Angles in cells, from behind to the left of it and from straight down.
    column: f64,
    row: f64,
    /// Cosine of the angle above the horizon.
    cosine: f64,
    range_m: f64,
}

impl Direction {
    /// Returns the direction of a vector; `None` for the zero vector and for one that is not finite.
    fn of(beam: Vector3<f64>) -> Option<Self> {
        let range_m = beam.norm();
        let is_beam = range_m.is_finite() && range_m > 1e-6;
        if !is_beam {
            return None;
        }
        let level_m = beam.xy().norm();
        Some(Self {
            column: (beam.y.atan2(beam.x) + 0.5 * TAU) / COLUMN_RAD,
            row: (beam.z.atan2(level_m) + FRAC_PI_2) / ROW_RAD,
            cosine: level_m / range_m,
            range_m,
        })
    }

    /// Returns row and column of its cell.
    fn place(&self) -> [usize; 2] {
        [(self.row as usize).min(ROWS - 1), self.column as usize % COLUMNS]
    }

    fn cell(&self) -> usize {
        let [row, column] = self.place();
        row * COLUMNS + column
    }

    /// Returns the square of the distance from the middle of the cell, in cells.
    fn off_middle(&self) -> f64 {
        (self.column.fract() - 0.5).powi(2) + (self.row.fract() - 0.5).powi(2)
    }
}

/// Yields a cell and those beside, above and below it.
fn around(row: usize, column: usize) -> impl Iterator<Item = usize> {
    let rows = row.saturating_sub(1)..(row + 2).min(ROWS);
    rows.flat_map(move |row| {
        (0..3).map(move |k| row * COLUMNS + (column + COLUMNS - 1 + k) % COLUMNS)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sphere of 4 m around a lidar, by 32 rings of 900 beams.
    fn sphere() -> PointCloud {
        let scanner = Point3::new(0.3, -0.2, 0.9);
        let mut points = Vec::new();
        for ring in 0..32 {
            let above = (f64::from(ring) - 15.5) * 2.0_f64.to_radians();
            for beam in 0..900 {
                let (sine, cosine) = (f64::from(beam) * TAU / 900.0).sin_cos();
                let ray = Vector3::new(cosine * above.cos(), sine * above.cos(), above.sin());
                points.push(scanner + ray * 4.0);
            }
        }
        PointCloud::new(scanner, points)
    }

    #[test]
    fn the_areas_of_the_points_add_up_to_the_surface() {
        let beams = Beams::new(&sphere());
        let sum: f64 = beams.points.iter().map(|(_, area_m2)| area_m2).sum();
        // A zone of a sphere; the outermost rings have cells without beams beside them.
        let zone_m2 = TAU * 2.0 * 32.0_f64.to_radians().sin() * 16.0;
        assert!((sum / zone_m2 - 1.0).abs() < 0.05, "{sum} {zone_m2}");
        // Half of the beams stand for the same surface.
        let half: Vec<Point3<f64>> = sphere().points.iter().copied().step_by(2).collect();
        let half = Beams::new(&PointCloud::new(sphere().scanner, half));
        let sum: f64 = half.points.iter().map(|(_, area_m2)| area_m2).sum();
        assert!((sum / zone_m2 - 1.0).abs() < 0.05, "{sum} {zone_m2}");
    }

    #[test]
    fn a_range_is_that_of_the_beam_in_this_direction() {
        let mut cloud = sphere();
        cloud.points = cloud
            .points
            .iter()
            .map(|point| {
                let ray = point - cloud.scanner;
                if ray.y > 0.0 { cloud.scanner + 0.5 * ray } else { *point }
            })
            .collect();
        let beams = Beams::new(&cloud);
        for (x, y, expected) in [(1.3, 1.0, 2.0), (1.3, -1.4, 4.0)] {
            let range_m = beams.range_m(&Point3::new(x, y, 1.0)).unwrap();
            assert!((range_m - expected).abs() < 1e-6, "{range_m}");
        }
        assert_eq!(beams.range_m(&Point3::new(0.4, -0.2, 3.0)), None, "above the view");
        assert_eq!(beams.range_m(&Point3::new(0.3, -0.2, 0.9)), None, "the lidar itself");
    }

    /// The cells of 2 degrees above the horizon and of 1 degree to the left of ahead.
    #[test]
    fn of_the_beams_in_one_direction_that_in_its_middle_counts() {
        fn beam([left_deg, above_deg, range_m]: [f64; 3]) -> Point3<f64> {
            let (left_sine, left_cosine) = left_deg.to_radians().sin_cos();
            let (above_sine, above_cosine) = above_deg.to_radians().sin_cos();
            let level_m = range_m * above_cosine;
            Point3::new(level_m * left_cosine, level_m * left_sine, range_m * above_sine)
        }

        for off_deg in [[0.1, 1.0], [0.9, 1.0], [0.5, 0.2], [0.5, 1.8]] {
            let [left_deg, above_deg] = off_deg;
            let both = [[left_deg, above_deg, 2.0], [0.45, 1.1, 3.0]];
            for points in [both, [both[1], both[0]]] {
                let points = points.map(beam).to_vec();
                let beams = Beams::new(&PointCloud::new(Point3::origin(), points));
                let range_m = beams.range_m(&beam([0.6, 0.7, 9.0])).unwrap();
                assert!((range_m - 3.0).abs() < 1e-6, "{off_deg:?}: {range_m}");
            }
        }
    }

    #[test]
    fn a_quarter_and_back_is_where_it_was() {
        let point = Point3::new(2.0, 0.5, 1.0);
        for quarter in Quarter::ALL {
            let seen = quarter.view_of(point);
            let bearing = seen.y.atan2(seen.x) + f64::from(quarter.0) * FRAC_PI_2;
            assert!(((bearing - 0.5_f64.atan2(2.0)) / TAU).fract().abs() < 1e-9, "{quarter:?}");
            assert_eq!(quarter.robot_of(seen), point);
        }
    }
}
