//! Contact sheets of the candidates that each test dropped.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use nalgebra::Point2;
use tagalong_render::canvas::{Canvas, Ink, LINE_PX};
use tagalong_render::write_png;

use super::trial::{Example, Trial};

/// Number of pictures in a row.
const COLUMNS: usize = 4;

/// Gap between pictures, pixels.
const GAP_PX: usize = 4;

/// Writes a sheet for each test that has pictures; returns the paths, by test.
///
/// # Errors
/// A sentence that names the file.
pub fn write(trial: &Trial, folder: &Path) -> Result<BTreeMap<&'static str, PathBuf>, String> {
    let mut written = BTreeMap::new();
    for (test, examples) in &trial.examples {
        if examples.kept().is_empty() {
            continue;
        }
        let path = folder.join(format!("{}.png", file_name(test)));
        let title = format!("{test}: {} dropped", trial.funnel.count(test));
        write_png(&path, &sheet(&title, examples.kept()).into_image())
            .map_err(|error| format!("cannot write {}: {error}", path.display()))?;
        written.insert(*test, path);
    }
    Ok(written)
}

/// Returns the name of the test with only letters, digits and dashes.
fn file_name(test: &str) -> String {
    let words = test.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty());
    words.collect::<Vec<_>>().join("-")
}

fn sheet(title: &str, examples: &[Example]) -> Canvas {
    let side = examples.iter().map(|example| example.picture.width()).max().unwrap_or(0);
    let cell = side + GAP_PX;
    let title_px = LINE_PX as usize + GAP_PX;
    let rows = examples.len().div_ceil(COLUMNS);
    // At least two pictures wide, which leaves room for the title.
    let width = COLUMNS.min(examples.len().max(2)) * cell + GAP_PX;
    let mut canvas = Canvas::new(width, rows * cell + title_px + GAP_PX, [24, 24, 28]);
    let ink = Ink::solid([255, 255, 255]);
    canvas.text(Point2::new(GAP_PX as f64, GAP_PX as f64), title, ink);
    for (number, example) in examples.iter().enumerate() {
        let left = GAP_PX + number % COLUMNS * cell;
        let top = GAP_PX + title_px + number / COLUMNS * cell;
        canvas.paste(&example.picture, left, top);
        let below = (top + side) as f64 - LINE_PX;
        canvas.text(Point2::new(left as f64, below), &format!("frame {}", example.frame), ink);
    }
    canvas
}

#[cfg(test)]
mod tests {
    use tagalong_core::RgbImage;

    use super::*;

    #[test]
    fn pictures_stand_in_rows() {
        let picture = RgbImage::filled(60, 60, [200, 0, 0]);
        let examples: Vec<Example> =
            (1..6).map(|frame| Example { frame, picture: picture.clone() }).collect();
        let sheet = sheet("a test", &examples).into_image();
        assert_eq!((sheet.width(), sheet.height()), (4 * 64 + 4, 2 * 64 + 22 + 4));
        let red = sheet.pixels().iter().filter(|pixel| **pixel == [200, 0, 0]).count();
        // The number of the frame covers a strip of each picture.
        assert!(red > 5 * 2400, "{red}");
    }

    #[test]
    fn names_of_tests_become_names_of_files() {
        assert_eq!(file_name("track: not confirmed"), "track-not-confirmed");
    }
}
