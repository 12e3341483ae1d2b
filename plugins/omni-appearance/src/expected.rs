//! Image columns in which known people are expected: they separate two people that appear as one
//! run of columns.

use nalgebra::{Isometry2, Point3};
use tagalong_core::{Frame, Track};

use crate::PanoramaGeometry;
use crate::circular::Run;

/// Half the width of a person, arms included, m.
const HALF_WIDTH_M: f64 = 0.27;
/// Longest time since a track was seen for which it is expected in the image, s.
const FRESH_S: f64 = 1.5;
/// Least distance from the axis at which a person is expected, m.
const NEAREST_M: f64 = 0.4;
/// Least visible part of a person's width; with less the person is hidden and not measured.
const LEAST_VISIBLE: f64 = 0.4;

/// A track that was seen lately.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Known {
    position: Point3<f64>,
    velocity: nalgebra::Vector2<f64>,
}

impl Known {
    pub(crate) fn of(track: &Track) -> Option<Self> {
        let person = &track.estimate.person;
        let fresh = track.confirmed && track.unseen_s <= FRESH_S;
        fresh.then_some(Self { position: person.position, velocity: person.velocity })
    }

    /// Predicts over `dt_s` seconds, and into the frame of a robot that has moved:
    /// `before_from_now` is its motion.
    pub(crate) fn moved(&self, dt_s: f64, before_from_now: &Isometry2<f64>) -> Self {
        let back = before_from_now.inverse();
        let there = self.position.xy() + dt_s * self.velocity;
        let here = back * there;
        Self {
            position: Point3::new(here.x, here.y, self.position.z),
            velocity: back * self.velocity,
        }
    }
}

/// Expected columns of a person.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Expected {
    /// Middle column, from 0 up to the width.
    column: f64,
    /// Columns to each side.
    half: f64,
    range_m: f64,
}

/// Columns of a run that belong to one person, and the visible part of that person.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Part {
    pub(crate) run: Run,
    /// Visible part, from 0 to 1.
    pub(crate) visible: f64,
}

impl Expected {
    pub(crate) fn of(known: &Known, frame: &Frame, view: &PanoramaGeometry<'_>) -> Self {
        let head = frame.camera.robot_from_camera.inverse_transform_point(&known.position);
        let range_m = head.xy().coords.norm().max(NEAREST_M);
        let half = (HALF_WIDTH_M / range_m).atan() / std::f64::consts::TAU;
        let width = view.panorama.columns as f64;
        let column = view.panorama.pixel(&head).x.rem_euclid(width);
        Self { column, half: half * width, range_m }
    }

    /// Returns true if a column is within so many half widths of the middle.
    pub(crate) fn is_near(&self, column: usize, width: usize, halves: f64) -> bool {
        self.off(column, width).abs() <= halves
    }

    /// Returns the offset of a column from the middle, in half widths; right is positive.
    fn off(&self, column: usize, width: usize) -> f64 {
        let width = width as f64;
        let columns = (column as f64 - self.column + 0.5 * width).rem_euclid(width) - 0.5 * width;
        columns / self.half
    }
}

/// Divides a run into the parts of different people; returns the run itself if it is of one person.
pub(crate) fn divided(run: Run, width: usize, expected: &[Expected]) -> Vec<Part> {
    let inside = visible(run, width, expected);
    if inside.len() < 2 {
        return vec![Part { run, visible: 1.0 }];
    }
    let mut parts: Vec<(usize, Run)> = Vec::new();
    for (offset, column) in run.columns(width).enumerate() {
        let owner = owner(column, width, &inside);
        match parts.last_mut() {
            Some((last, part)) if *last == owner => part.length += 1,
            _ => parts.push((owner, Run { first: (run.first + offset) % width, length: 1 })),
        }
    }
    let mut divided = Vec::new();
    for (who, expected) in inside.iter().enumerate() {
        // A person that is seen on both sides of a nearer one is measured by the larger part.
        let own = parts.iter().filter(|(owner, _)| *owner == who).map(|(_, part)| *part);
        if let Some(run) = own.max_by_key(|part| part.length) {
            let visible = (run.length as f64 / (2.0 * expected.half).max(1.0)).min(1.0);
            if visible >= LEAST_VISIBLE {
                divided.push(Part { run, visible });
            }
        }
    }
    divided
}

/// Returns the people that are expected in a run and not hidden behind others, from near to far.
fn visible(run: Run, width: usize, expected: &[Expected]) -> Vec<Expected> {
    let mut inside: Vec<Expected> =
        expected.iter().filter(|e| shares(e, run, width)).copied().collect();
    inside.sort_by(|a, b| a.range_m.total_cmp(&b.range_m));
    let mut seen: Vec<Expected> = Vec::new();
    for person in inside {
        let columns = run.columns(width).filter(|column| {
            person.is_near(*column, width, 1.0)
                && !seen.iter().any(|nearer| nearer.is_near(*column, width, 1.0))
        });
        let columns = columns.count() as f64;
        if columns >= LEAST_VISIBLE * 2.0 * person.half {
            seen.push(person);
        }
    }
    seen
}

/// Returns true if the middle of the expected person is in the run.
fn shares(expected: &Expected, run: Run, width: usize) -> bool {
    let middle = expected.column.round() as usize % width.max(1);
    (middle + width - run.first) % width < run.length
}

/// Returns the person that a column belongs to: the nearest of those that cover it; otherwise the
/// one with the nearest edge. `inside` goes from near to far.
fn owner(column: usize, width: usize, inside: &[Expected]) -> usize {
    if let Some(covering) = inside.iter().position(|who| who.is_near(column, width, 1.0)) {
        return covering;
    }
    let off = inside.iter().map(|who| who.off(column, width).abs()).enumerate();
    off.min_by(|(_, a), (_, b)| a.total_cmp(b)).map_or(0, |(who, _)| who)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn expected(column: f64, half: f64, range_m: f64) -> Expected {
        Expected { column, half, range_m }
    }

    fn run(first: usize, length: usize) -> Run {
        Run { first, length }
    }

    #[test]
    fn a_run_of_one_person_stays_whole() {
        let alone = [expected(20.0, 8.0, 2.0), expected(200.0, 8.0, 2.0)];
        assert_eq!(divided(run(12, 17), 480, &alone), [Part { run: run(12, 17), visible: 1.0 }]);
        // A second track on the same person explains nothing more.
        let doubled = [expected(20.0, 8.0, 2.0), expected(21.0, 8.0, 2.2)];
        assert_eq!(divided(run(12, 17), 480, &doubled).len(), 1);
    }

    #[test]
    fn two_side_by_side_get_their_columns_across_the_seam() {
        let both = [expected(474.0, 8.0, 2.0), expected(8.0, 6.0, 3.0)];
        let parts = divided(run(466, 28), 480, &both);
        assert_eq!(parts.len(), 2);
        assert_eq!((parts[0].run, parts[1].run), (run(466, 17), run(3, 11)));
        assert!(parts[0].visible == 1.0 && parts[1].visible > 0.9);
    }

    #[test]
    fn of_somebody_behind_another_only_what_is_seen_counts() {
        let near = expected(100.0, 20.0, 1.0);
        let far = expected(122.0, 6.0, 3.0);
        let parts = divided(run(80, 49), 480, &[far, near]);
        assert_eq!(parts[0].run, run(80, 41));
        assert_eq!(parts[1].run, run(121, 8));
        assert!((parts[1].visible - 8.0 / 12.0).abs() < 1e-9);
        let hidden = divided(run(80, 41), 480, &[expected(118.0, 6.0, 3.0), near]);
        assert_eq!(hidden, [Part { run: run(80, 41), visible: 1.0 }]);
    }

    #[test]
    fn a_run_is_of_the_people_whose_middle_it_holds_also_across_the_seam() {
        fn holds(column: f64) -> bool {
            shares(&expected(column, 8.0, 2.0), run(470, 20), 480)
        }

        assert_eq!([469.0, 470.0, 479.0, 5.0, 9.0].map(holds), [false, true, true, true, true]);
        assert_eq!([10.0, 100.0].map(holds), [false, false]);
    }

    #[test]
    fn of_people_in_a_run_the_hidden_ones_are_not_expected() {
        let near = expected(100.0, 20.0, 1.0);
        let hidden = expected(118.0, 6.0, 3.0);
        let shown = expected(122.0, 6.0, 3.0);
        assert_eq!(visible(run(80, 41), 480, &[hidden, near]), [near]);
        assert_eq!(visible(run(80, 49), 480, &[shown, near]), [near, shown]);
    }

    /// The robot turns to the left by a right angle.
    #[test]
    fn a_known_person_walks_on_and_turns_with_the_frame() {
        let known = Known {
            position: Point3::new(2.0, 0.0, 1.6),
            velocity: nalgebra::Vector2::new(1.0, 0.0),
        };
        let turn = Isometry2::new(nalgebra::Vector2::zeros(), std::f64::consts::FRAC_PI_2);
        let moved = known.moved(0.5, &turn);
        assert!((moved.position - Point3::new(0.0, -2.5, 1.6)).norm() < 1e-12, "{moved:?}");
        assert!((moved.velocity - nalgebra::Vector2::new(0.0, -1.0)).norm() < 1e-12, "{moved:?}");
    }
}
