//! Target output of the network for a map.

use nalgebra::{Point2, Vector2};
use tagalong_config::AnnotatedPerson;
use tagalong_core::DepthImage;
use tagalong_geometry::Camera;

use crate::map::for_each_point;
use crate::{FloorMap, Pass};

/// Radius around a head of the cells that have to answer with the person, m; up to `UNCLEAR_M` any
/// answer is right.
const PERSON_M: f64 = 0.13;
const UNCLEAR_M: f64 = 0.36;
/// Radius around people that do not count within which any answer is right, m.
const IGNORED_M: f64 = 0.6;
/// Surface within `BODY_M` of a person's axis from which on the person has to be found, m².
const SURFACE_M2: f64 = 0.07;
const BODY_M: f64 = 0.3;
/// Height from which on surface is a person's and not the floor's, m.
const FEET_M: f64 = 0.25;
/// Weights of the place and of the height beside the log-odds, per metre.
const PLACE: f32 = 3.0;
const HEIGHT: f32 = 1.2;
/// Height of a head to which the answer is relative, m.
const HEAD_M: f64 = 1.5;
/// Weight of the log-odds.
const DOUBT: f32 = 3.0;

/// Expected answer of each coarse cell.
#[derive(Clone, Debug, PartialEq)]
pub struct Targets {
    cells: Vec<Target>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Target {
    /// No person is here.
    Empty,
    /// Anything is right.
    Any,
    /// Offset of a head from the centre of the cell, and its height above `HEAD_M`, m.
    Person([f32; 3]),
}

impl Targets {
    /// Computes the expected answers; people with too little visible surface need not be found.
    pub fn new(people: &[AnnotatedPerson], camera: &Camera, depth: &DepthImage) -> Self {
        let surfaces = surfaces_m2(people, camera, depth);
        let mut cells = vec![Target::Empty; FloorMap::CELLS * FloorMap::CELLS];
        // People to be found are written last, because they may stand beside ignored ones.
        let (found, ignored): (Vec<usize>, Vec<usize>) =
            (0..people.len()).partition(|k| people[*k].counts && surfaces[*k] > SURFACE_M2);
        for k in ignored {
            around(&people[k], &mut cells, |_, m| (m < IGNORED_M).then_some(Target::Any));
        }
        for limit_m in [UNCLEAR_M, PERSON_M] {
            for k in &found {
                let height = (people[*k].head.z - HEAD_M) as f32;
                around(&people[*k], &mut cells, |off, m| {
                    if m >= limit_m {
                        None
                    } else if limit_m == PERSON_M {
                        Some(Target::Person([off.x as f32, off.y as f32, height]))
                    } else {
                        Some(Target::Any)
                    }
                });
            }
        }
        Self { cells }
    }

    /// Returns row and column, as fractions, of the cells of people.
    #[cfg(test)]
    pub(super) fn places(&self) -> Vec<[f64; 2]> {
        let side = FloorMap::CELLS;
        let people = (0..side * side).filter(|k| matches!(self.cells[*k], Target::Person(_)));
        people.map(|k| [(k / side) as f64, (k % side) as f64]).collect()
    }

    /// Returns the answers with left and right exchanged.
    pub fn mirrored(&self) -> Self {
        let side = FloorMap::CELLS;
        Self {
            cells: (0..side * side)
                .map(|k| match self.cells[k / side * side + side - 1 - k % side] {
                    Target::Person([x, y, height]) => Target::Person([x, -y, height]),
                    other => other,
                })
                .collect(),
        }
    }

    /// Writes the gradient of the loss by the answer, and returns the number of cells of people.
    /// The loss is the cross-entropy, with a smaller weight where the answer is right already
    /// (Lin, Goyal, Girshick, He and Dollar, ICCV 2017), and the distance from the place and height.
    pub fn slopes(&self, pass: &Pass, of: &mut Pass) -> f32 {
        let mut people = 0.0;
        let answers = pass.answer.values.as_chunks::<4>().0;
        let slopes = of.answer.values.as_chunks_mut::<4>().0;
        for ((target, answer), slope) in self.cells.iter().zip(answers).zip(slopes) {
            // A cell out of view says nothing.
            if *answer == [0.0; 4] {
                continue;
            }
            match target {
                Target::Any => {}
                Target::Empty => slope[0] = -DOUBT * focal(-answer[0]),
                Target::Person(right) => {
                    people += 1.0;
                    slope[0] = DOUBT * focal(answer[0]);
                    for (k, weight) in [PLACE, PLACE, HEIGHT].into_iter().enumerate() {
                        slope[k + 1] = weight * (answer[k + 1] - right[k]).signum();
                    }
                }
            }
        }
        people
    }
}

/// Derivative of `-(1 - p) ln p` by the log-odds of `p`.
fn focal(log_odds: f32) -> f32 {
    let p = 1.0 / (1.0 + (-log_odds).exp());
    let q = 1.0 / (1.0 + log_odds.exp());
    // ln p without overflow of the exponential.
    let ln_p = if log_odds > -30.0 { p.ln() } else { log_odds };
    p * q * ln_p - q * q
}

fn around(
    person: &AnnotatedPerson,
    cells: &mut [Target],
    target: impl Fn(Vector2<f64>, f64) -> Option<Target>,
) {
    for (k, cell) in cells.iter_mut().enumerate() {
        let centre = FloorMap::centre(k / FloorMap::CELLS, k % FloorMap::CELLS);
        let off = person.head.xy() - centre;
        if let Some(target) = target(off, off.norm()) {
            *cell = target;
        }
    }
}

/// Returns how much surface of each person the camera sees, m².
pub fn surfaces_m2(people: &[AnnotatedPerson], camera: &Camera, depth: &DepthImage) -> Vec<f64> {
    let mut surfaces = vec![0.0; people.len()];
    if people.is_empty() {
        return surfaces;
    }
    let axes: Vec<Point2<f64>> = people.iter().map(|person| person.head.xy()).collect();
    for_each_point(camera, depth, |point, area_m2| {
        for ((person, axis), surface) in people.iter().zip(&axes).zip(&mut surfaces) {
            let is_body = point.z > FEET_M && point.z < person.head.z + 0.15;
            if is_body && (point.xy() - axis).norm_squared() < BODY_M * BODY_M {
                *surface += area_m2;
            }
        }
    });
    surfaces
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_slope_of_the_loss_is_that_of_small_steps() {
        fn loss(log_odds: f64) -> f64 {
            let p = 1.0 / (1.0 + (-log_odds).exp());
            -(1.0 - p) * p.ln()
        }

        for log_odds in [-6.0, -1.0, 0.0, 0.7, 5.0] {
            let slope = (loss(log_odds + 1e-5) - loss(log_odds - 1e-5)) / 2e-5;
            assert!((slope - f64::from(focal(log_odds as f32))).abs() < 1e-4, "{log_odds}");
        }
        assert!(focal(-200.0).is_finite() && focal(200.0).is_finite());
    }

    #[test]
    fn mirrored_twice_is_as_before() {
        let mut cells = vec![Target::Empty; 64 * 64];
        cells[130] = Target::Person([0.01, 0.02, 0.3]);
        let targets = Targets { cells };
        let mirrored = targets.mirrored();
        assert_eq!(mirrored.cells[128 + 61], Target::Person([0.01, -0.02, 0.3]));
        assert_eq!(mirrored.mirrored(), targets);
    }

    /// An empty cell, one of a person, one that may answer anything, and cells out of view.
    #[test]
    fn each_cell_is_drawn_to_its_target() {
        let mut cells = vec![Target::Empty; 64 * 64];
        (cells[1], cells[2]) = (Target::Person([0.1, -0.2, 0.3]), Target::Any);
        let mut pass = Pass::default();
        let mut of = Pass::default();
        let answers = [[1.0, 0.5, 0.5, 0.5], [0.7, 0.2, -0.3, 0.4], [1.0; 4]];
        pass.answer.values[..12].copy_from_slice(&answers.concat());
        assert_eq!(Targets { cells }.slopes(&pass, &mut of), 1.0, "one cell of a person");
        let slopes = of.answer.values.as_chunks::<4>().0;
        assert_eq!(slopes[0], [-DOUBT * focal(-1.0), 0.0, 0.0, 0.0]);
        assert_eq!(slopes[1], [DOUBT * focal(0.7), PLACE, -PLACE, HEIGHT]);
        assert!(slopes[2..].iter().all(|slope| *slope == [0.0; 4]));
    }

    /// A wall through the axes of two people: 0.6 m of it are theirs, from the feet to above the head.
    #[test]
    fn the_surface_of_a_person_is_what_the_camera_sees_of_it() {
        fn person(x: f64, y: f64) -> AnnotatedPerson {
            AnnotatedPerson::new(nalgebra::Point3::new(x, y, 1.6))
        }

        let camera = Camera::mounted(
            tagalong_geometry::Pinhole::centred(120.0, 320, 240),
            320,
            240,
            1.1,
            0.0,
            0.0,
        );
        let people = [person(3.0, 0.0), person(3.0, 1.5), person(5.0, 0.0)];
        let found = surfaces_m2(&people, &camera, &DepthImage::filled(320, 240, 3.0));
        assert!((found[0] - 0.9).abs() < 0.1 && (found[1] - 0.9).abs() < 0.1, "{found:?}");
        assert_eq!(found[2], 0.0, "hidden");
    }
}
