//! Truth of a data set in the forms that `eval` reads.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use tagalong_app::outcome::Failure;
use tagalong_core::Stamp;
use tagalong_eval::Region;
use tagalong_eval::formats::people::{self, Row};

use super::sequence::{Eye, Moment};

/// Whole body of a person in an image.
#[derive(Clone, Debug, PartialEq)]
pub struct WholeBody {
    /// Number of the colour image, from 1.
    pub frame: u32,
    /// Id of the person.
    pub id: i64,
    /// Box, pixels.
    pub region: Region,
    /// Visible part of the body, 0 to 1.
    pub visible: f64,
    /// False: neither a miss nor a false alarm.
    pub counts: bool,
}

/// Returns whole bodies as MOTChallenge text, in which `eval` finds the upper ones.
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

/// Numbers of the colour images of a sequence, from 1.
pub struct Frames {
    by_stem: BTreeMap<String, u32>,
    by_stamp: BTreeMap<Stamp, u32>,
}

impl Frames {
    /// Numbers the colour images, which are in the order of time.
    pub fn of(moments: &[Moment]) -> Self {
        let colour = || (1..).zip(moments.iter().filter(|moment| moment.eye == Eye::Left));
        Self {
            by_stem: colour().map(|(number, moment)| (stem(&moment.file), number)).collect(),
            by_stamp: colour().map(|(number, moment)| (moment.stamp, number)).collect(),
        }
    }

    /// Returns the number of the image with a file name, whatever its ending.
    pub fn named(&self, name: &str) -> Option<u32> {
        self.by_stem.get(&stem(Path::new(name))).copied()
    }

    /// Returns the number of the image of a time.
    pub fn at(&self, stamp: Stamp) -> Option<u32> {
        self.by_stamp.get(&stamp).copied()
    }
}

/// Returns the name of a file without its ending.
pub fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// Returns the note on annotated images that the folder does not have; nothing without any.
pub fn absent(count: usize, file: &Path) -> Option<String> {
    let shown = file.display();
    (count > 0).then(|| format!("{count} annotated images of {shown} are not there and left out"))
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

    #[test]
    fn only_colour_images_are_numbered() {
        let of = |stamp, eye, file: &str| Moment {
            stamp: Stamp::from_nanos(stamp),
            eye,
            file: file.into(),
        };
        let moments = [
            of(5, Eye::Left, "rgb/a.jpg"),
            of(5, Eye::Depth, "depth/a.pgm"),
            of(9, Eye::Left, "rgb/b.jpg"),
        ];
        let frames = Frames::of(&moments);
        assert_eq!((frames.named("b.pcd"), frames.named("c.jpg")), (Some(2), None));
        assert_eq!((frames.at(Stamp::from_nanos(9)), frames.at(Stamp::default())), (Some(2), None));
    }
}
