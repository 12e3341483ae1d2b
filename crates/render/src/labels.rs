use nalgebra::Point2;
use tagalong_geometry::Rect;

use super::canvas::{Canvas, Ink, Lettering};

/// Gap between a label and its box, pixels.
const GAP_PX: f64 = 1.0;

/// Distance from its box beyond which a label gets a line to it, pixels.
const NEAR_PX: f64 = 6.0;

/// Label with its position.
#[derive(Clone, Debug)]
struct Placed {
    bar: Rect,
    of: Rect,
    text: String,
    lettering: Lettering,
    ink: Ink,
}

/// Labels of boxes, all inside an area and without overlap.
pub struct Labels {
    area: Rect,
    /// Boxes that labels avoid if they can.
    spared: Vec<Rect>,
    reserved: Vec<Rect>,
    placed: Vec<Placed>,
}

impl Labels {
    /// Creates an empty set of labels; labels only cover `spared` boxes if there is no other free
    /// position.
    pub fn within(area: Rect, spared: Vec<Rect>) -> Self {
        Self { area, spared, reserved: Vec::new(), placed: Vec::new() }
    }

    /// Keeps labels away from an area.
    pub fn reserve(&mut self, place: Rect) {
        self.reserved.push(place);
    }

    /// Adds the label of a box at the nearest free position; if there is none, the label is left
    /// out.
    pub fn add(&mut self, of: &Rect, text: String, lettering: Lettering, ink: Ink) {
        let size = lettering.size_px(&text);
        let bar = self.beside(of, size).or_else(|| self.anywhere(of, size));
        self.placed.extend(bar.map(|bar| Placed { bar, of: *of, text, lettering, ink }));
    }

    /// Adds the label of a box if there is a free position at the box.
    pub fn add_if_room(&mut self, of: &Rect, text: String, lettering: Lettering, ink: Ink) {
        let bar = self.beside(of, lettering.size_px(&text));
        self.placed.extend(bar.map(|bar| Placed { bar, of: *of, text, lettering, ink }));
    }

    /// Returns a free position at the box: above, below, inside, or at its sides.
    fn beside(&self, of: &Rect, size: [f64; 2]) -> Option<Rect> {
        let mut second_best = None;
        for place in places_at(of, size) {
            let place = self.shifted_inside(place);
            if distance_px(&place, of) > NEAR_PX || !self.is_free(&place) {
                continue;
            }
            if self.spared.iter().all(|spared| spared == of || !overlap(spared, &place)) {
                return Some(place);
            }
            second_best = second_best.or(Some(place));
        }
        second_best
    }

    /// Returns the free position nearest to the box, on a grid of half line heights.
    fn anywhere(&self, of: &Rect, [width, height]: [f64; 2]) -> Option<Rect> {
        let columns = steps(self.area.x, self.area.right() - width, 0.5 * height);
        let rows = steps(self.area.y, self.area.bottom() - height, 0.5 * height);
        let all = rows.flat_map(|y| columns.clone().map(move |x| Rect::new(x, y, width, height)));
        let free = all.filter(|place| self.is_free(place));
        free.min_by(|a, b| distance_px(a, of).total_cmp(&distance_px(b, of)))
    }

    fn shifted_inside(&self, place: Rect) -> Rect {
        let x = place.x.min(self.area.right() - place.width).max(self.area.x);
        let y = place.y.min(self.area.bottom() - place.height).max(self.area.y);
        Rect { x, y, ..place }
    }

    fn is_free(&self, place: &Rect) -> bool {
        let is_inside = place.x >= self.area.x
            && place.y >= self.area.y
            && place.right() <= self.area.right()
            && place.bottom() <= self.area.bottom();
        let mut taken = self.placed.iter().map(|placed| &placed.bar).chain(&self.reserved);
        is_inside && !taken.any(|taken| overlap(taken, place))
    }

    /// Returns the bars of all labels with their texts.
    #[cfg(test)]
    pub fn bars(&self) -> Vec<(Rect, &str)> {
        self.placed.iter().map(|placed| (placed.bar, placed.text.as_str())).collect()
    }

    /// Paints all labels, the distant ones with a line to their boxes.
    pub fn paint(&self, canvas: &mut Canvas) {
        for placed in &self.placed {
            if distance_px(&placed.bar, &placed.of) > NEAR_PX {
                canvas.line(
                    nearest(&placed.bar, &placed.of),
                    nearest(&placed.of, &placed.bar),
                    placed.ink,
                );
            }
        }
        for Placed { bar, text, lettering, ink, .. } in &self.placed {
            canvas.write(Point2::new(bar.x, bar.y), text, *lettering, *ink);
        }
    }
}

/// Returns the positions at a box, best first.
fn places_at(of: &Rect, [width, height]: [f64; 2]) -> [Rect; 8] {
    let left = of.x;
    let right = of.right() - width;
    let above = of.y - height - GAP_PX;
    let below = of.bottom() + GAP_PX;
    let inside = of.bottom() - height - GAP_PX;
    let corners = [
        (left, above),
        (right, above),
        (left, below),
        (right, below),
        (of.right() + GAP_PX, of.y),
        (left - width - GAP_PX, of.y),
        (left, inside),
        (left, of.y + GAP_PX),
    ];
    corners.map(|(x, y)| Rect::new(x.floor(), y.floor(), width, height))
}

/// Returns the values from `first` to `last` in steps; none if `last` is below `first`.
fn steps(first: f64, last: f64, step: f64) -> impl Iterator<Item = f64> + Clone {
    let count = ((last - first) / step).floor().max(-1.0) as i64;
    (0..=count).map(move |i| first + step * i as f64)
}

fn overlap(a: &Rect, b: &Rect) -> bool {
    a.x < b.right() && b.x < a.right() && a.y < b.bottom() && b.y < a.bottom()
}

/// Returns the gap between two rectangles, pixels; 0 where they touch.
fn distance_px(a: &Rect, b: &Rect) -> f64 {
    let dx = (a.x - b.right()).max(b.x - a.right()).max(0.0);
    let dy = (a.y - b.bottom()).max(b.y - a.bottom()).max(0.0);
    dx.hypot(dy)
}

/// Returns the point of `rect` nearest to the centre of `other`.
fn nearest(rect: &Rect, other: &Rect) -> Point2<f64> {
    let towards = other.centre();
    // Not `clamp`, which panics for a box of negative size.
    let x = towards.x.min(rect.right() - 1.0).max(rect.x);
    Point2::new(x, towards.y.min(rect.bottom() - 1.0).max(rect.y))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const WHITE: Ink = Ink::solid([255; 3]);

    fn area() -> Rect {
        Rect::new(0.0, 0.0, 640.0, 480.0)
    }

    #[test]
    fn a_label_stands_above_its_box() {
        let mut labels = Labels::within(area(), Vec::new());
        labels.add(&Rect::new(100.0, 100.0, 80.0, 80.0), "3 2.5 m".into(), Lettering::Bold, WHITE);
        let [(bar, _)] = labels.bars()[..] else { panic!("one label") };
        assert_eq!((bar.x, bar.bottom()), (100.0, 99.0));
    }

    #[test]
    fn a_label_leaves_the_box_of_another_person_free() {
        let other = Rect::new(90.0, 40.0, 120.0, 59.0);
        let mut labels = Labels::within(area(), vec![other]);
        labels.add(&Rect::new(100.0, 100.0, 80.0, 80.0), "3 2.5 m".into(), Lettering::Bold, WHITE);
        let [(bar, _)] = labels.bars()[..] else { panic!("one label") };
        assert!(!overlap(&bar, &other), "{bar:?}");
    }

    #[test]
    fn a_label_that_finds_no_place_at_its_box_goes_elsewhere_or_is_left_out() {
        let corner = Rect::new(2.0, 2.0, 30.0, 30.0);
        let mut labels = Labels::within(area(), Vec::new());
        labels.reserve(Rect::new(0.0, 0.0, 300.0, 200.0));
        labels.add_if_room(&corner, "a note".into(), Lettering::Small, WHITE);
        assert_eq!(labels.bars().len(), 0);
        labels.add(&corner, "3 2.5 m".into(), Lettering::Bold, WHITE);
        let [(bar, _)] = labels.bars()[..] else { panic!("one label") };
        assert!(bar.y >= 200.0 && bar.y < 210.0, "{bar:?}");
    }

    proptest! {
        #[test]
        fn no_label_is_over_another_or_leaves_the_image(
            boxes in prop::collection::vec((-100.0..700.0f64, -100.0..500.0f64, 1.0..200.0f64), 0..12)
        ) {
            let mut labels = Labels::within(area(), Vec::new());
            for (i, (x, y, side)) in boxes.iter().enumerate() {
                let text = format!("{i} predicted 3.0 m");
                labels.add(&Rect::new(*x, *y, *side, *side), text, Lettering::Large, WHITE);
            }
            let bars = labels.bars();
            prop_assert_eq!(bars.len(), boxes.len());
            for (i, (a, _)) in bars.iter().enumerate() {
                prop_assert!(a.x >= 0.0 && a.y >= 0.0 && a.right() <= 640.0 && a.bottom() <= 480.0);
                prop_assert!(bars[..i].iter().all(|(b, _)| !overlap(a, b)), "{:?}", bars);
            }
        }
    }
}
