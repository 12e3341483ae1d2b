//! All people of a log, changes to them, and undo.

use std::collections::{BTreeMap, BTreeSet};

use serde::Deserialize;
use tagalong_eval::Region;

use crate::person::{Key, Person};

/// Largest number of steps that can be undone.
const STEPS: usize = 1000;

/// Largest ID of a person.
pub const MOST_ID: i64 = 999;

/// Frames of a change, relative to the one that is shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Scope {
    /// Only the frame.
    #[default]
    Frame,
    /// The frame and all later ones.
    After,
    /// The frame and all earlier ones.
    Before,
    /// The whole log.
    All,
}

impl Scope {
    fn frames(self, frame: u32) -> std::ops::RangeInclusive<u32> {
        match self {
            Self::Frame => frame..=frame,
            Self::After => frame..=u32::MAX,
            Self::Before => 0..=frame,
            Self::All => 0..=u32::MAX,
        }
    }
}

/// Change of one person in one frame, as the page requests it.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "op", rename_all = "lowercase", deny_unknown_fields)]
pub enum Change {
    /// Sets the box of a person; without an ID the person is new.
    Box { frame: u32, id: Option<i64>, region: [f64; 4] },
    /// Sets the box of a person whose head is at a pixel.
    Head { frame: u32, id: Option<i64>, at: [f64; 2] },
    /// Gives a person another ID.
    Number { frame: u32, id: i64, to: i64, scope: Scope },
    /// Removes a person from frames.
    Delete { frame: u32, id: i64, scope: Scope },
    /// Turns an interpolated box into a key.
    Pin { frame: u32, id: i64 },
    /// Removes a key.
    Unpin { frame: u32, id: i64 },
    /// Fills the gap around a frame.
    Fill { frame: u32, id: i64 },
    /// Marks all boxes of a frame as reviewed.
    Review { frame: u32 },
    /// Notes on the box of a person.
    Note { frame: u32, id: i64, ignore: Option<bool>, visible: Option<f64> },
    /// Undoes the last change.
    Undo,
    /// Redoes the last change that was undone.
    Redo,
}

/// People before a change; `None` for a person that did not exist.
type Step = BTreeMap<i64, Option<Person>>;

/// All people of a log, with the changes that can be undone.
#[derive(Debug, Default)]
pub struct Document {
    people: BTreeMap<i64, Person>,
    undo: Vec<Step>,
    redo: Vec<Step>,
}

impl Document {
    /// Returns a document with these people, and nothing to undo.
    pub fn of(people: BTreeMap<i64, Person>) -> Self {
        Self { people, ..Self::default() }
    }

    /// Returns the people by their IDs.
    pub fn people(&self) -> &BTreeMap<i64, Person> {
        &self.people
    }

    /// Returns the smallest free ID.
    pub fn free_id(&self) -> i64 {
        (1..).find(|id| !self.people.contains_key(id)).unwrap_or(MOST_ID)
    }

    /// Returns whether there is a change to undo, and one to redo.
    pub fn can(&self) -> (bool, bool) {
        (!self.undo.is_empty(), !self.redo.is_empty())
    }

    /// Makes a change; returns the IDs of the people that changed.
    ///
    /// # Errors
    /// A sentence for the user: a person that is not in the frame, an ID out of range.
    pub fn apply(&mut self, change: &Change) -> Result<BTreeSet<i64>, String> {
        match change {
            Change::Undo => Ok(Self::back(&mut self.people, &mut self.undo, &mut self.redo)),
            Change::Redo => Ok(Self::back(&mut self.people, &mut self.redo, &mut self.undo)),
            _ => self.edit(change),
        }
    }

    /// Reverts the last step of one list, and moves it to the other.
    fn back(
        people: &mut BTreeMap<i64, Person>,
        from: &mut Vec<Step>,
        to: &mut Vec<Step>,
    ) -> BTreeSet<i64> {
        let Some(step) = from.pop() else { return BTreeSet::new() };
        let mut opposite = Step::new();
        for (id, person) in step {
            let old = match person {
                Some(person) => people.insert(id, person),
                None => people.remove(&id),
            };
            opposite.insert(id, old);
        }
        let changed = opposite.keys().copied().collect();
        to.push(opposite);
        changed
    }

    fn edit(&mut self, change: &Change) -> Result<BTreeSet<i64>, String> {
        let touched = self.touched(change)?;
        let before: Step = touched.iter().map(|id| (*id, self.people.get(id).cloned())).collect();
        self.perform(change);
        self.people.retain(|_, person| !person.is_empty());
        let step: Step =
            before.into_iter().filter(|(id, old)| self.people.get(id) != old.as_ref()).collect();
        let changed: BTreeSet<i64> = step.keys().copied().collect();
        if !step.is_empty() {
            self.redo.clear();
            self.undo.push(step);
            if self.undo.len() > STEPS {
                self.undo.remove(0);
            }
        }
        Ok(changed)
    }

    /// Checks a change, and returns the IDs of the people that it may affect.
    fn touched(&self, change: &Change) -> Result<Vec<i64>, String> {
        match change {
            Change::Box { id, region, .. } => {
                check_region(region)?;
                Ok(vec![check_id(id.unwrap_or_else(|| self.free_id()))?])
            }
            Change::Head { .. } => Err("the position of a head needs an image".into()),
            Change::Number { id, to, .. } => {
                Ok([self.known_person(*id)?, vec![check_id(*to)?]].concat())
            }
            Change::Delete { id, .. } | Change::Fill { id, .. } => self.known_person(*id),
            Change::Pin { id, frame } | Change::Unpin { id, frame } => {
                self.person_in_frame(*id, *frame)
            }
            Change::Review { frame } => Ok(self.people_in_frame(*frame)),
            Change::Note { id, frame, visible, .. } => {
                if visible.is_some_and(|visible| !(0.0..=1.0).contains(&visible)) {
                    return Err("the visible part is a fraction, 0 to 1".into());
                }
                self.person_in_frame(*id, *frame)
            }
            Change::Undo | Change::Redo => Ok(Vec::new()),
        }
    }

    /// Returns only this person, if the document has it.
    fn known_person(&self, id: i64) -> Result<Vec<i64>, String> {
        if !self.people.contains_key(&id) {
            return Err(format!("there is no person {id}"));
        }
        Ok(vec![id])
    }

    /// Returns only this person, if it is in the frame.
    fn person_in_frame(&self, id: i64, frame: u32) -> Result<Vec<i64>, String> {
        match self.people.get(&id).map(|person| person.at(frame)) {
            Some(Some(_)) => Ok(vec![id]),
            _ => Err(format!("person {id} is not in frame {frame}")),
        }
    }

    /// Returns the people in a frame.
    fn people_in_frame(&self, frame: u32) -> Vec<i64> {
        let people = self.people.iter().filter(|(_, person)| person.at(frame).is_some());
        people.map(|(id, _)| *id).collect()
    }

    /// Makes a checked change.
    fn perform(&mut self, change: &Change) {
        match *change {
            Change::Box { frame, id, region: [x, y, width, height] } => {
                let id = id.unwrap_or_else(|| self.free_id());
                let person = self.people.entry(id).or_default();
                let region = Region { x, y, width, height };
                let mut key = person.at(frame).unwrap_or_else(|| Key::new(region));
                key.move_to(region);
                person.set(frame, key);
            }
            Change::Number { frame, id, to, scope } => self.renumber(id, to, scope, frame),
            Change::Delete { frame, id, scope } => {
                self.on(id, |person| person.remove(scope.frames(frame)));
            }
            Change::Pin { frame, id } => self.on(id, |person| person.review(frame)),
            Change::Review { frame } => {
                for id in self.people_in_frame(frame) {
                    self.on(id, |person| person.review(frame));
                }
            }
            Change::Unpin { frame, id } => self.on(id, |person| person.unpin(frame)),
            Change::Fill { frame, id } => self.on(id, |person| person.fill(frame)),
            Change::Note { frame, id, ignore, visible } => self.on(id, |person| {
                if let Some(mut key) = person.at(frame) {
                    key.ignore = ignore.unwrap_or(key.ignore);
                    key.visible = visible.unwrap_or(key.visible);
                    key.interpolated =
                        if person.key(frame).is_some() { key.interpolated } else { 0 };
                    key.proposed.clear();
                    person.set(frame, key);
                }
            }),
            Change::Head { .. } | Change::Undo | Change::Redo => {}
        }
    }

    fn on(&mut self, id: i64, edit: impl FnOnce(&mut Person)) {
        if let Some(person) = self.people.get_mut(&id) {
            edit(person);
        }
    }

    /// Gives the boxes of one person in a scope the ID of another. If both are in the same frames,
    /// they swap IDs; otherwise they are merged.
    fn renumber(&mut self, id: i64, to: i64, scope: Scope, frame: u32) {
        if id == to {
            return;
        }
        let [one, other] = [self.take_part(id, scope, frame), self.take_part(to, scope, frame)];
        if one.meets(&other) {
            self.put(id, other);
        } else {
            self.put(to, other);
        }
        self.put(to, one);
    }

    /// Removes the part of a person in a scope from the document, and returns it.
    fn take_part(&mut self, id: i64, scope: Scope, frame: u32) -> Person {
        let mut whole = self.people.remove(&id).unwrap_or_default();
        let range = scope.frames(frame);
        let mut part = whole.split_off(*range.start());
        if let Some(next) = range.end().checked_add(1) {
            let late = part.split_off(next);
            whole.join(late);
        }
        self.people.insert(id, whole);
        part
    }

    fn put(&mut self, id: i64, part: Person) {
        self.people.entry(id).or_default().join(part);
    }
}

fn check_id(id: i64) -> Result<i64, String> {
    let is_known = (1..=MOST_ID).contains(&id);
    if is_known { Ok(id) } else { Err(format!("{id} is not a valid ID: 1 to {MOST_ID}")) }
}

/// Largest coordinate of a box, pixels.
const MOST_PX: f64 = 1e5;

fn check_region(region: &[f64; 4]) -> Result<(), String> {
    let [_, _, width, height] = *region;
    // NaN fails the comparisons, too.
    let is_sane = region.iter().all(|v| v.abs() <= MOST_PX) && width >= 2.0 && height >= 2.0;
    if is_sane { Ok(()) } else { Err("a box is at least 2 pixels wide and high".into()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(document: &mut Document, frame: u32, id: i64, x: f64) {
        let region = [x, 10.0, 50.0, 50.0];
        document.apply(&Change::Box { frame, id: Some(id), region }).unwrap();
    }

    fn column(document: &Document, frame: u32, id: i64) -> Option<f64> {
        Some(document.people().get(&id)?.at(frame)?.region.x)
    }

    fn two_people() -> Document {
        let mut document = Document::default();
        for (frame, x) in [(1, 0.0), (9, 80.0)] {
            set(&mut document, frame, 1, x);
            set(&mut document, frame, 2, 300.0 + x);
        }
        document
    }

    #[test]
    fn every_change_can_be_undone_and_made_again() {
        let mut document = two_people();
        let all = [
            Change::Box { frame: 5, id: Some(1), region: [9.0, 9.0, 30.0, 30.0] },
            Change::Box { frame: 5, id: None, region: [99.0, 9.0, 30.0, 30.0] },
            Change::Number { frame: 4, id: 1, to: 2, scope: Scope::After },
            Change::Number { frame: 4, id: 2, to: 7, scope: Scope::All },
            Change::Delete { frame: 3, id: 7, scope: Scope::Frame },
            Change::Fill { frame: 3, id: 7 },
            Change::Pin { frame: 7, id: 7 },
            Change::Note { frame: 6, id: 7, ignore: Some(true), visible: Some(0.25) },
            Change::Review { frame: 5 },
            Change::Unpin { frame: 6, id: 7 },
            Change::Delete { frame: 3, id: 7, scope: Scope::All },
        ];
        let mut states = vec![document.people().clone()];
        for change in &all {
            assert!(!document.apply(change).unwrap().is_empty(), "{change:?} changes nothing");
            states.push(document.people().clone());
        }
        for state in states.iter().rev().skip(1) {
            document.apply(&Change::Undo).unwrap();
            assert_eq!(document.people(), state);
        }
        for state in states.iter().skip(1) {
            document.apply(&Change::Redo).unwrap();
            assert_eq!(document.people(), state);
        }
        assert_eq!(document.can(), (true, false));
        assert!(document.apply(&Change::Redo).unwrap().is_empty());
        // A new change clears the changes to redo.
        document.apply(&Change::Undo).unwrap();
        set(&mut document, 1, 5, 0.0);
        assert_eq!(document.can(), (true, false));
    }

    #[test]
    fn a_change_that_changes_nothing_is_no_step() {
        let mut document = two_people();
        let steps = document.undo.len();
        document.apply(&Change::Fill { frame: 5, id: 1 }).unwrap();
        document.apply(&Change::Pin { frame: 1, id: 1 }).unwrap();
        document.apply(&Change::Number { frame: 1, id: 1, to: 1, scope: Scope::All }).unwrap();
        assert_eq!(document.undo.len(), steps);
    }

    #[test]
    fn people_whose_numbers_were_swapped_change_them_back() {
        let mut document = two_people();
        document.apply(&Change::Number { frame: 4, id: 1, to: 2, scope: Scope::After }).unwrap();
        assert_eq!(column(&document, 3, 1), Some(20.0));
        assert_eq!(column(&document, 4, 1), Some(330.0));
        assert_eq!(column(&document, 4, 2), Some(30.0));
        assert_eq!(column(&document, 9, 2), Some(80.0));
    }

    #[test]
    fn two_parts_of_one_person_become_one() {
        let mut document = two_people();
        document.apply(&Change::Delete { frame: 5, id: 1, scope: Scope::After }).unwrap();
        set(&mut document, 7, 3, 60.0);
        document.apply(&Change::Number { frame: 7, id: 3, to: 1, scope: Scope::All }).unwrap();
        assert_eq!(column(&document, 4, 1), Some(30.0));
        assert_eq!(column(&document, 7, 1), Some(60.0));
        assert_eq!(column(&document, 6, 1), None, "the pause stays");
        assert!(!document.people().contains_key(&3));
        assert_eq!(document.free_id(), 3);
    }

    #[test]
    fn one_frame_alone_gets_another_number() {
        let mut document = two_people();
        document.apply(&Change::Number { frame: 5, id: 1, to: 4, scope: Scope::Frame }).unwrap();
        assert_eq!(column(&document, 5, 4), Some(40.0));
        let others: Vec<_> = (1..=9).map(|frame| column(&document, frame, 1)).collect();
        assert_eq!(others[3..6], [Some(30.0), None, Some(50.0)]);
    }

    #[test]
    fn changes_that_make_no_sense_are_refused() {
        let mut document = two_people();
        let region = [0.0, 0.0, 50.0, 50.0];
        for wrong in [
            Change::Box { frame: 1, id: Some(0), region },
            Change::Box { frame: 1, id: Some(1000), region },
            Change::Box { frame: 1, id: None, region: [0.0, 0.0, f64::NAN, 9.0] },
            Change::Box { frame: 1, id: None, region: [0.0, 0.0, 1.0, 9.0] },
            Change::Box { frame: 1, id: None, region: [1e9, 0.0, 9.0, 9.0] },
            Change::Delete { frame: 1, id: 9, scope: Scope::All },
            Change::Pin { frame: 99, id: 1 },
            Change::Number { frame: 1, id: 1, to: -4, scope: Scope::All },
            Change::Note { frame: 1, id: 1, ignore: None, visible: Some(1.5) },
        ] {
            assert!(document.apply(&wrong).is_err(), "{wrong:?}");
        }
        assert_eq!(document.people(), two_people().people());
    }
}
