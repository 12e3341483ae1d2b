//! Order of the corners of boxes in a list: x before y, or y before x as in some exports of SSD.
//! Shapes and ranges are the same in both orders; the proportions of standing and walking people
//! decide.

use crate::ScoredBox;

/// Number of boxes from which their proportions decide the order.
const LEAST_BOXES: u32 = 30;
/// Number of boxes after which the check ends: the order of a network does not change, and people
/// may lie down.
const MOST_BOXES: u32 = 300;
/// Fraction of the boxes that are wide if x and y are exchanged.
const NEARLY_ALL: f64 = 0.95;
/// Ratio of width to height from which on a box is wide.
const WIDE: f64 = 1.5;

/// Proportions of the boxes of people that a network has found so far.
#[derive(Debug, Default)]
pub(crate) struct Shapes {
    boxes: u32,
    wide: u32,
}

impl Shapes {
    /// Adds the confident boxes of an image.
    ///
    /// # Errors
    /// If nearly all boxes of people are wide: a sentence with the settings, one of which is right.
    pub(crate) fn take(&mut self, people: &[ScoredBox], min_score: f64) -> Result<(), String> {
        if self.boxes > MOST_BOXES {
            return Ok(());
        }
        for person in people.iter().filter(|person| f64::from(person.score) >= min_score) {
            self.boxes += 1;
            self.wide += u32::from(person.rect.width > WIDE * person.rect.height);
        }
        let are_nearly_all = f64::from(self.wide) >= NEARLY_ALL * f64::from(self.boxes);
        if self.boxes < LEAST_BOXES || !are_nearly_all {
            return Ok(());
        }
        Err(format!(
            "{} of the first {} boxes of people that it found are wider than high by more than a half, \
             as of corners with y before x: set `box_order = \"yxyx\"`, or `box_order = \"xyxy\"` if \
             the people lie",
            self.wide, self.boxes
        ))
    }
}

#[cfg(test)]
mod tests {
    use tagalong_geometry::Rect;

    use super::*;

    fn people(width: f64, height: f64, score: f32) -> Vec<ScoredBox> {
        vec![ScoredBox { rect: Rect::new(5.0, 5.0, width, height), score, joints: None }]
    }

    /// Returns the first call of so many that is refused.
    fn refused(shapes: &mut Shapes, calls: usize, people: &[ScoredBox]) -> Option<usize> {
        (0..calls).find(|_| shapes.take(people, 0.5).is_err())
    }

    #[test]
    fn boxes_that_are_nearly_all_wide_are_refused() {
        let mut shapes = Shapes::default();
        assert_eq!(refused(&mut shapes, 40, &people(30.0, 10.0, 0.9)), Some(29));
        let why = shapes.take(&[], 0.5).unwrap_err();
        assert!(why.contains("30 of the first 30") && why.contains("\"yxyx\""), "{why}");
    }

    #[test]
    fn people_of_other_shapes_and_weak_boxes_tell_nothing() {
        for (width, height, score) in [(10.0, 30.0, 0.9), (14.0, 10.0, 0.9), (30.0, 10.0, 0.3)] {
            let mut shapes = Shapes::default();
            assert_eq!(refused(&mut shapes, 400, &people(width, height, score)), None);
        }
        // Two of thirty people stand.
        let mut shapes = Shapes::default();
        assert_eq!(refused(&mut shapes, 2, &people(10.0, 30.0, 0.9)), None);
        assert_eq!(refused(&mut shapes, 28, &people(30.0, 10.0, 0.9)), None);
    }

    #[test]
    fn people_may_lie_down_later() {
        let mut shapes = Shapes::default();
        assert_eq!(refused(&mut shapes, 30, &people(10.0, 30.0, 0.9)), None);
        assert_eq!(refused(&mut shapes, 5000, &people(30.0, 10.0, 0.9)), None);
    }
}
