use nalgebra::{Point2, Point3, Vector2};
use tagalong_core::{DepthImage, GreyImage};
use tagalong_geometry::Camera;

/// Upright plane through a person's head, perpendicular to the line of sight, sampled from an
/// image. It shows the whole body from the floor up, always at the same scale.
///
/// The pixel of each cell follows from the camera's pose, so that the foot of a coat stand, the pot
/// of a plant and the legs of a person are in the same cells at any distance.
#[derive(Clone, Debug)]
pub struct Upright {
    /// Left and right end of each row.
    rows: [[End; 2]; Self::ROWS],
    /// True for a panorama, whose columns are counted modulo the width.
    is_around: bool,
}

/// End of a row: its pixel and its depth along the optical axis, m.
#[derive(Clone, Copy, Debug)]
struct End {
    pixel: Point2<f64>,
    ahead_m: f64,
}

/// Intensities on the plane.
#[non_exhaustive]
pub struct UprightGrey {
    /// Intensities, row by row from the top, from left to right. Cells outside the image repeat its
    /// border.
    pub grey: [f32; Upright::CELLS],
    /// True for each cell that lies inside the image.
    pub is_seen: [bool; Upright::CELLS],
}

impl Upright {
    /// Number of rows of cells, from [`Self::TOP_M`] down to the floor.
    pub const ROWS: usize = 80;
    /// Number of columns; the head is in the middle.
    pub const COLUMNS: usize = 36;
    /// Number of cells.
    pub const CELLS: usize = Self::ROWS * Self::COLUMNS;
    /// Distance between cells, m.
    pub const STEP_M: f64 = 0.025;
    /// Height of the first row above the floor, m.
    pub const TOP_M: f64 = 2.0;

    /// Creates the plane through a head in the robot frame; `None` if part of it is behind the
    /// camera.
    pub fn new(camera: &Camera, head: &Point3<f64>) -> Option<Self> {
        let eye = camera.robot_from_camera.translation.vector.xy();
        let ahead = (head.coords.xy() - eye).try_normalize(1e-9)?;
        let half_m = 0.5 * (Self::COLUMNS - 1) as f64 * Self::STEP_M;
        let right = Vector2::new(ahead.y, -ahead.x) * half_m;
        let nowhere = End { pixel: Point2::origin(), ahead_m: 0.0 };
        let mut rows = [[nowhere; 2]; Self::ROWS];
        for (row, ends) in rows.iter_mut().enumerate() {
            for (end, side) in ends.iter_mut().zip([-1.0, 1.0]) {
                let floor = head.coords.xy() + right * side;
                let place = Point3::new(floor.x, floor.y, Self::TOP_M - Self::STEP_M * row as f64);
                end.ahead_m = camera.robot_from_camera.inverse_transform_point(&place).z;
                end.pixel = camera.project(&place)?;
            }
            // In a panorama the seam may lie between the two ends.
            ends[1].pixel.x = camera.column_near(ends[1].pixel.x, ends[0].pixel.x);
        }
        Some(Self { rows, is_around: camera.panorama().is_some() })
    }

    /// Samples the intensities; `None` in an image without pixels.
    pub fn grey(&self, image: &GreyImage) -> Option<UprightGrey> {
        let width = image.width();
        let height = image.height();
        if width == 0 || height == 0 {
            return None;
        }
        let mut out = UprightGrey { grey: [0.0; Self::CELLS], is_seen: [false; Self::CELLS] };
        for (row, line) in self.lines().enumerate() {
            for column in 0..Self::COLUMNS {
                let pixel = line.at(column).pixel;
                let (x, has_column) = self.column(pixel.x, width);
                let (y, has_row) = nearest(pixel.y, height);
                let cell = row * Self::COLUMNS + column;
                out.grey[cell] = f32::from(image.row(y)[x]);
                out.is_seen[cell] = has_column && has_row;
            }
        }
        Some(out)
    }

    /// Yields the depth of the image minus that of the plane along the optical axis, m, at every
    /// n-th cell of every n-th row; `None` without a depth reading.
    pub fn behind_m<'a>(
        &'a self,
        depth: &'a DepthImage,
        every: usize,
    ) -> impl Iterator<Item = Option<f32>> + 'a {
        let columns = (0..Self::COLUMNS).step_by(every);
        self.lines().step_by(every).flat_map(move |line| {
            columns.clone().map(move |column| self.reading_behind(depth, line.at(column)))
        })
    }

    /// Returns the distance by which the reading at a cell lies behind the plane, m.
    #[inline]
    fn reading_behind(&self, depth: &DepthImage, End { pixel, ahead_m }: End) -> Option<f32> {
        let (x, has_column) = self.column(pixel.x, depth.width());
        let (y, has_row) = nearest(pixel.y, depth.height());
        let reading = if has_column && has_row { depth.row(y)[x] } else { f32::NAN };
        (reading.is_finite() && reading > 0.0).then_some(reading - ahead_m as f32)
    }

    /// Returns the column of a position, and true if it lies inside the image.
    fn column(&self, place: f64, width: usize) -> (usize, bool) {
        if self.is_around {
            nearest(place.rem_euclid(width as f64), width)
        } else {
            nearest(place, width)
        }
    }

    fn lines(&self) -> impl Iterator<Item = Line> {
        let cells = (Self::COLUMNS - 1) as f64;
        self.rows.iter().map(move |[from, to]| Line {
            from: *from,
            pixel_step: (to.pixel - from.pixel) / cells,
            ahead_step_m: (to.ahead_m - from.ahead_m) / cells,
        })
    }
}

/// Row of the plane. A straight line of the plane is one of the image, with nearly even spacing.
#[derive(Clone, Copy)]
struct Line {
    from: End,
    pixel_step: Vector2<f64>,
    ahead_step_m: f64,
}

impl Line {
    fn at(&self, column: usize) -> End {
        let steps = column as f64;
        // The plane is perpendicular to the line of sight, so that depth hardly varies along a row.
        End {
            pixel: self.from.pixel + self.pixel_step * steps,
            ahead_m: self.from.ahead_m + self.ahead_step_m * steps,
        }
    }
}

/// Returns the nearest of `size` pixels, and true if the position lies inside the image.
fn nearest(place: f64, size: usize) -> (usize, bool) {
    let is_inside = place >= -0.5 && place < size as f64 - 0.5;
    // The cast truncates, which rounds a positive number down.
    let number = ((place + 0.5) as i32).max(0) as usize;
    (number.min(size.saturating_sub(1)), is_inside)
}

#[cfg(test)]
mod tests {
    use tagalong_geometry::{ConicalMirror, Distortion, Lens, Panorama, Pinhole};

    use super::*;

    fn camera() -> Camera {
        let lens =
            Pinhole { fx: 300.0, fy: 300.0, cx: 160.0, cy: 160.0, distortion: Distortion::None };
        Camera::mounted(lens, 320, 320, 1.2, 0.0, 0.0)
    }

    /// A cell shows the intensity of its position on the plane, 3 m away.
    #[test]
    fn a_cell_has_the_intensity_of_its_place() {
        let image = GreyImage::from_fn(320, 320, |x, y| (x / 4 + y / 2) as u8);
        let plane = Upright::new(&camera(), &Point3::new(3.0, 0.0, 1.6)).unwrap();
        let shown = plane.grey(&image).unwrap();
        for row in (0..Upright::ROWS).step_by(7) {
            for column in (0..Upright::COLUMNS).step_by(5) {
                let left_m = (17.5 - column as f64) * Upright::STEP_M;
                let place = Point3::new(3.0, left_m, 2.0 - row as f64 * Upright::STEP_M);
                let pixel = camera().project(&place).unwrap();
                let x = pixel.x.round() as i64;
                let y = pixel.y.round() as i64;
                let cell = row * Upright::COLUMNS + column;
                let off = shown.grey[cell] - f32::from(image.get(x, y).unwrap());
                assert!(off.abs() <= 1.0, "{row} {column}: {off}");
                assert!(shown.is_seen[cell]);
            }
        }
    }

    /// In a panorama the columns go on beyond the seam, on both sides of a person there.
    #[test]
    fn a_plane_across_the_seam_of_a_panorama_is_whole() {
        let d = [67.5_f64.to_radians(), 0.05, 8.0, 230.0];
        let mirror = ConicalMirror::new(175.0, [240.0; 2], d).unwrap();
        let camera = Camera {
            lens: Lens::Panorama(Panorama { mirror, columns: 480, rows: 120 }),
            width: 480,
            height: 120,
            robot_from_camera: ConicalMirror::upright(1.5),
        };
        let image = GreyImage::from_fn(480, 120, |x, _| (x as i64 - 240).unsigned_abs() as u8);
        let mut across = 0;
        for bearing in (0..36).map(|step| f64::from(10 * step).to_radians()) {
            let head = Point3::new(2.0 * bearing.cos(), 2.0 * bearing.sin(), 1.6);
            let shown = Upright::new(&camera, &head).unwrap().grey(&image).unwrap();
            let aside = Vector2::new(bearing.sin(), -bearing.cos());
            let columns: [f64; 36] = std::array::from_fn(|cell| {
                let m = (cell as f64 - 17.5) * Upright::STEP_M;
                let place = Point3::new(head.x + m * aside.x, head.y + m * aside.y, 1.0);
                camera.project(&place).unwrap().x.rem_euclid(480.0)
            });
            across += usize::from((columns[0] - columns[35]).abs() > 240.0);
            for cell in (0..36).step_by(5) {
                let wanted = (columns[cell] - 240.0).abs();
                let off = f64::from(shown.grey[40 * Upright::COLUMNS + cell]) - wanted;
                assert!(off.abs() <= 1.5, "{bearing} {cell}: {off}");
                assert!(shown.is_seen[40 * Upright::COLUMNS + cell]);
            }
        }
        assert!(across > 0, "none of the planes lies across the seam");
    }

    #[test]
    fn places_have_the_nearest_pixel_and_those_outside_that_of_the_border() {
        let places = [-7.0, -0.51, -0.49, 0.49, 0.51, 3.49, 3.51, 9.0];
        let found = places.map(|place| nearest(place, 4));
        assert_eq!(found.map(|(pixel, _)| pixel), [0, 0, 0, 0, 1, 3, 3, 3]);
        let inside = [false, false, true, true, true, true, false, false];
        assert_eq!(found.map(|(_, is_inside)| is_inside), inside);
    }

    #[test]
    fn there_is_no_plane_behind_the_camera_or_without_an_image() {
        let behind = Point3::new(-1.0, 0.0, 1.6);
        assert!(Upright::new(&camera(), &behind).is_none());
        let plane = Upright::new(&camera(), &Point3::new(3.0, 0.0, 1.6)).unwrap();
        assert!(plane.grey(&GreyImage::from_fn(0, 0, |_, _| 0)).is_none());
        let nothing = DepthImage::from_fn(0, 0, |_, _| 0.0);
        assert!(plane.behind_m(&nothing, 1).all(|behind_m| behind_m.is_none()));
    }

    #[test]
    fn a_wall_is_behind_the_plane_and_what_is_not_measured_is_nowhere() {
        fn wall(x: usize) -> f32 {
            if x < 160 { 3.5 } else { f32::NAN }
        }

        let depth = DepthImage::from_fn(320, 320, |x, _| wall(x));
        for (x, row, column, behind_m, why) in [
            (3.0, 40, 4, Some(0.5), "the wall"),
            (3.0, 40, 30, None, "nothing was measured"),
            (1.0, 78, 4, None, "feet are below the image"),
        ] {
            let plane = Upright::new(&camera(), &Point3::new(x, 0.0, 1.6)).unwrap();
            let half = plane.behind_m(&depth, 2).nth(row / 2 * 18 + column / 2);
            let cell = plane.behind_m(&depth, 1).nth(row * 36 + column);
            assert_eq!(half, cell, "every second cell of every second row");
            let found = half.flatten();
            assert_eq!(found.is_some(), behind_m.is_some(), "{why}");
            let off = found.zip(behind_m).map_or(0.0, |(found, wanted): (f32, f32)| found - wanted);
            assert!(off.abs() < 1e-6, "{off}");
        }
    }
}
