//! Frames of real rooms: people in addition to those of photographs, false alarms from the
//! viewpoint of a robot, and models that were not trained on a room.

use tagalong_config::AnnotatedPerson;
use tagalong_core::Frame;
use tagalong_geometry::Rect;

use super::{HogTrainer, MINED_OVERLAP, Picture, search};
use crate::{Coverage, Model, Scanner, merge};

/// Part of a person's square that has to be in the image, and least visible part of the person.
const INSIDE: f64 = 0.75;
const VISIBLE: f64 = 0.5;
/// Overlap (IoU) of a window with a person from which on it is no false alarm, and in which it is
/// the person.
const BESIDE: f64 = 0.2;
const SAME: f64 = 0.5;
/// Part of a window's square on a person that does not count from which on it is no false alarm.
const COVERED: f64 = 0.4;
/// False alarms in a frame at which the miss rate in a room is reported.
const FALSE_PER_FRAME: [f64; 2] = [0.1, 1.0];

/// Square of a person in a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Known {
    pub(super) square: Rect,
    /// False if it is neither an error to find this person nor one not to.
    pub(super) counts: bool,
}

impl Known {
    /// Returns true if a window shows this person, or may.
    pub(super) fn is_shown(&self, window: &Rect) -> bool {
        let covered = window.intersection(&self.square).area() > COVERED * window.area();
        window.iou(&self.square) > BESIDE || (!self.counts && covered)
    }
}

/// Returns the people in a frame, with those that do not show enough as ones that do not count.
pub(super) fn known(frame: &Frame, people: &[AnnotatedPerson]) -> Vec<Known> {
    let camera = &frame.camera;
    let in_front = people.iter().filter(|person| camera.depth_of(&person.head) > 0.0);
    let known = in_front.map(|person| {
        let square = camera.upper_body(&person.head);
        let inside = square.clipped(camera.width, camera.height).area();
        let is_clear = person.visible >= VISIBLE && inside >= INSIDE * square.area();
        Known { square, counts: person.counts && is_clear }
    });
    known.filter(|known| known.square.is_sane()).collect()
}

impl HogTrainer {
    /// Returns the number of a room, from 1 on; 0 is for photographs.
    pub(super) fn number_of(&mut self, room: &str) -> usize {
        let known = self.rooms.iter().position(|name| name == room);
        1 + known.unwrap_or_else(|| {
            self.rooms.push(room.to_owned());
            self.rooms.len() - 1
        })
    }

    /// Adds the people of the rooms to the windows. Legs are seldom in view there, so whole bodies
    /// are learned from photographs alone.
    pub(super) fn add_room_people(&mut self) {
        if self.layout.coverage == Coverage::WholeBody {
            return;
        }
        let pictures = std::mem::take(&mut self.pictures);
        for Picture { grey, people, room, .. } in &pictures {
            for known in people.iter().filter(|known| known.counts) {
                self.add_variants(grey, &known.square, *room);
            }
        }
        self.pictures = pictures;
    }

    /// Fits a model to photographs and to all rooms but one, whose number may be that of none.
    /// Unless rooms are asked for, they teach depth alone.
    pub(super) fn without(&self, room: usize, of_photographs: &Model) -> Model {
        let mut model = of_photographs.clone();
        if self.training.rooms {
            model = self.machine(self.training.mining_rounds, &|other| other != room);
            self.finish(&mut model);
        }
        model.depth = self.depth_without(room);
        model
    }

    /// Returns the miss rate of a model in a room at some rates of false alarms in a frame.
    pub(super) fn missed_in(&self, model: &Model, room: usize) -> Vec<f64> {
        let mut scanner = Scanner::new(model);
        let mut verdicts = Vec::new();
        let mut count = 0;
        let frames = self.pictures.iter().filter(|picture| picture.room == room);
        let frames: Vec<&Picture> = frames.collect();
        for Picture { grey, people, .. } in &frames {
            let mut windows = search(&mut scanner, grey, self.near_miss());
            merge(&mut windows, Coverage::UpperBody, MINED_OVERLAP, 1.0);
            let mut free: Vec<&Known> = people.iter().filter(|known| known.counts).collect();
            count += free.len();
            for window in &windows {
                let hit = free.iter().position(|known| known.square.iou(&window.region) >= SAME);
                if let Some(at) = hit {
                    free.swap_remove(at);
                    verdicts.push((window.sum, true));
                } else if !people.iter().any(|known| known.is_shown(&window.region)) {
                    verdicts.push((window.sum, false));
                }
            }
        }
        let rates = FALSE_PER_FRAME.map(|rate| (rate * frames.len() as f64) as usize);
        rates.map(|allowed| missed_at(&mut verdicts, count, allowed)).to_vec()
    }
}

/// Returns the part of `people` that is not found above the sum with so many false alarms.
fn missed_at(verdicts: &mut [(f32, bool)], people: usize, allowed: usize) -> f64 {
    verdicts.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut wrong = 0;
    let accepted = verdicts.iter().take_while(|(_, is_person)| {
        wrong += usize::from(!is_person);
        wrong <= allowed
    });
    let found = accepted.filter(|(_, is_person)| *is_person).count();
    1.0 - found as f64 / people.max(1) as f64
}

/// Returns the figures of a model in a room: the miss rate by the rate of false alarms.
pub(super) fn figures(missed: &[f64]) -> toml::Value {
    let named = FALSE_PER_FRAME.iter().zip(missed);
    let table = named.map(|(rate, missed)| {
        (format!("miss_rate_at_{rate}_false_alarms_a_frame"), super::rounded(*missed))
    });
    toml::Value::Table(table.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn people_below_the_last_allowed_false_alarm_are_missed() {
        let mut verdicts =
            [(1.0, true), (9.0, true), (8.0, false), (7.0, true), (6.0, false), (5.0, true)];
        for (allowed, expected) in [(0, 1.0), (1, 2.0), (2, 4.0)] {
            let found = ((1.0 - missed_at(&mut verdicts, 5, allowed)) * 5.0).round();
            assert_eq!(found, expected, "{allowed}");
        }
    }

    #[test]
    fn a_window_on_a_person_who_does_not_count_is_no_false_alarm() {
        let square = Rect::new(10.0, 10.0, 40.0, 40.0);
        let inside = Rect::new(20.0, 20.0, 10.0, 10.0);
        let aside = Rect::new(80.0, 10.0, 40.0, 40.0);
        for (counts, window, expected) in [
            (true, square, true),
            (true, inside, false),
            (false, inside, true),
            (false, aside, false),
        ] {
            assert_eq!(Known { square, counts }.is_shown(&window), expected, "{counts} {window:?}");
        }
    }
}
