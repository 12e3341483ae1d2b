//! Accuracy of a cascade on pictures that were not used in its training.

use tagalong_geometry::Rect;
use tagalong_learn::{Line, platt};

use super::{Picture, Use};
use crate::{Cascade, Config, Scanner, grouped, scales};

/// Least overlap (IoU) of a window and the face that it shows.
const SAME: f64 = 0.5;
/// Least width of a face's window that counts, pixels: that of a face 40 pixels wide.
const LEAST_PX: f64 = 34.0;
/// Numbers of false alarms per picture at which the share of found faces is reported.
const FALSE_ALARMS: [f64; 3] = [1.0, 0.3, 0.1];

/// Groups found in the pictures for one purpose.
#[derive(Default)]
struct GroupCounts {
    /// Logarithm of the strength, and true for a face. Groups of small faces are left out.
    groups: Vec<(f64, bool)>,
    faces: usize,
    /// Number of pictures.
    pictures: usize,
}

impl GroupCounts {
    fn add(
        &mut self,
        scanner: &mut Scanner,
        cascade: &Cascade,
        config: &Config,
        picture: &Picture,
    ) {
        let grey = &*picture.grey;
        let most = grey.width().min(grey.height()) as f64;
        let mut hits = Vec::new();
        let sizes = scales(cascade, 0.0, most, config.scale_step);
        scanner.scan(grey, cascade, sizes, &mut hits);
        let mut groups = grouped(&hits, config.min_neighbours);
        groups.sort_by(|a, b| b.strength.total_cmp(&a.strength));
        let mut free: Vec<&Rect> = picture.faces.iter().collect();
        self.faces += free.iter().filter(|face| face.width >= LEAST_PX).count();
        self.pictures += 1;
        for group in groups {
            let overlaps = free.iter().map(|face| face.iou(&group.region)).enumerate();
            let best = overlaps.max_by(|(_, a), (_, b)| a.total_cmp(b));
            let face = best.filter(|(_, iou)| *iou >= SAME).map(|(i, _)| free.remove(i));
            if face.is_none_or(|face| face.width >= LEAST_PX) {
                // The logarithm needs a positive strength.
                self.groups.push((group.strength.max(1e-3).ln(), face.is_some()));
            }
        }
    }

    /// Returns the part of the faces that is found with this number of false alarms per picture.
    fn found_at(&self, false_alarms: f64) -> f64 {
        let allowed = (false_alarms * self.pictures as f64) as usize;
        let mut sorted = self.groups.clone();
        sorted.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut found = 0;
        let mut wrong = 0;
        for (_, is_face) in sorted {
            if is_face {
                found += 1;
            } else {
                wrong += 1;
            }
            if wrong > allowed {
                break;
            }
        }
        found as f64 / self.faces.max(1) as f64
    }
}

fn search(
    cascade: &Cascade,
    config: &Config,
    pictures: &[Picture],
    wanted: impl Fn(&Picture) -> bool,
) -> GroupCounts {
    let mut found = GroupCounts::default();
    let mut scanner = Scanner::default();
    let least = cascade.width.min(cascade.height);
    for picture in pictures.iter().filter(|p| wanted(p)) {
        if picture.grey.width() > least && picture.grey.height() > least {
            found.add(&mut scanner, cascade, config, picture);
        }
    }
    found
}

/// Fits slope and offset of the log-odds.
pub(super) fn calibration(cascade: &Cascade, config: &Config, pictures: &[Picture]) -> (f64, f64) {
    let found = search(cascade, config, pictures, |p| p.use_ == Use::Calibration);
    let Line { slope, offset } = platt(&found.groups);
    (slope.max(1e-3), offset)
}

/// Searches the pictures for one purpose, with faces or without.
fn found_in(
    cascade: &Cascade,
    config: &Config,
    pictures: &[Picture],
    use_: Use,
    with_faces: bool,
) -> GroupCounts {
    search(cascade, config, pictures, |p| p.use_ == use_ && p.faces.is_empty() != with_faces)
}

/// Computes the figures of the card: on held-out pictures, and on those of the calibration, which
/// may be used to choose settings. On the latter, also the share of faces that cascades of fewer
/// stages find, down to half of them.
pub(super) fn figures(cascade: &Cascade, config: &Config, pictures: &[Picture]) -> toml::Table {
    let empty = found_in(cascade, config, pictures, Use::Figures, false);
    fn integer(n: usize) -> toml::Value {
        toml::Value::Integer(n as i64)
    }
    let mut table = toml::Table::from_iter([
        ("held_out_pictures_without".to_owned(), integer(empty.pictures)),
        ("false_alarms_in_those".to_owned(), integer(empty.groups.len())),
        ("validation_found_by_stages".to_owned(), by_stages(cascade, config, pictures)),
    ]);
    for (name, use_) in [("held_out", Use::Figures), ("validation", Use::Calibration)] {
        let found = found_in(cascade, config, pictures, use_, true);
        table.insert(format!("{name}_pictures_with_faces"), integer(found.pictures));
        table.insert(format!("{name}_faces"), integer(found.faces));
        for rate in FALSE_ALARMS {
            let part = rounded(found.found_at(rate));
            table.insert(format!("{name}_found_at_{rate}_false_alarms_a_picture"), part);
        }
    }
    table
}

/// Returns the share of faces that the cascade finds at one false alarm per picture, after those
/// that fewer stages find.
fn by_stages(cascade: &Cascade, config: &Config, pictures: &[Picture]) -> toml::Value {
    let stages = cascade.stages.len();
    let found = (stages / 2 + 1..=stages).map(|count| {
        let stages = cascade.stages[..count].to_vec();
        let shorter = Cascade { stages, ..cascade.clone() };
        let found = found_in(&shorter, config, pictures, Use::Calibration, true);
        rounded(found.found_at(FALSE_ALARMS[0]))
    });
    found.collect::<Vec<_>>().into()
}

fn rounded(part: f64) -> toml::Value {
    toml::Value::Float((part * 1e4).round() / 1e4)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faces_are_counted_up_to_the_allowed_false_alarms() {
        let groups = vec![(3.0, true), (0.0, false), (1.0, true), (2.0, false), (-1.0, true)];
        let counts = GroupCounts { groups, faces: 4, pictures: 2 };
        // None, one and two false alarms in two pictures.
        let found = [0.3, 0.5, 1.0].map(|rate| counts.found_at(rate));
        assert_eq!(found, [0.25, 0.5, 0.75]);
        assert_eq!(GroupCounts::default().found_at(1.0), 0.0);
    }
}
