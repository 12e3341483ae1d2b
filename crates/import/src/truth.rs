//! Truth of a data set in the formats that `eval` reads.

use std::fmt::Write as _;

use tagalong_app::outcome::Failure;
use tagalong_eval::Region;
use tagalong_eval::formats::people::{self, Row};

/// Whole body of a person in an image.
#[derive(Clone, Debug, PartialEq)]
pub struct WholeBody {
    /// Number of the colour image, from 1.
    pub frame: u32,
    /// ID of the person.
    pub id: i64,
    /// Box, pixels.
    pub region: Region,
    /// Visible part of the body, 0 to 1.
    pub visible: f64,
    /// False for a person that counts neither as a miss nor as a false positive.
    pub counts: bool,
}

/// Returns whole bodies as MOTChallenge text, from which `eval` derives the upper bodies.
pub fn boxes_csv(bodies: &[WholeBody]) -> String {
    let mut out = String::new();
    for WholeBody { frame, id, region, visible, counts } in bodies {
        let Region { x, y, width, height } = region;
        let counts = u8::from(*counts);
        let _ = writeln!(out, "{frame},{id},{x},{y},{width},{height},{counts},1,{visible}");
    }
    out
}

/// Returns the text of `people.csv`.
///
/// # Errors
/// Rows that cannot be written.
pub fn people_csv(rows: &[Row]) -> Result<String, Failure> {
    let mut out = Vec::new();
    people::write(&mut out, rows).map_err(Failure::failed)?;
    String::from_utf8(out).map_err(Failure::failed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_bodies_are_text_that_the_reader_of_motchallenge_takes() {
        let region = Region { x: 1.5, y: 2.0, width: 30.0, height: 80.0 };
        let body = WholeBody { frame: 3, id: 7, region, visible: 0.5, counts: false };
        let text = boxes_csv(&[body]);
        assert_eq!(text, "3,7,1.5,2,30,80,0,1,0.5\n");
        let rules = tagalong_eval::formats::mot::Rules::Mot17;
        let rows = tagalong_eval::formats::mot::parse_truth(&text, "made", rules).unwrap();
        assert_eq!(rows[0].region, region);
    }
}
