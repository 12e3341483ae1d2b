//! Trainer of a [`Model`], linear or of trees: with people in several small shifts and mirrored,
//! first with random windows without people, and then with the false alarms of the classifier in
//! pictures without people.
//!
//! A tenth of the groups is held out for the calibration and a fifth for the figures of the card;
//! the classifier is trained on neither.

mod boosted;
mod depth;
mod rooms;
mod svm;

use std::sync::Arc;

use boosted::boosted;
use depth::DepthWindows;
use rooms::Known;
use svm::{Windows, separate};
use tagalong_config::{AnnotatedPerson, Example, Fitted, Trainer};
use tagalong_core::{Detection, Error, Frame, GreyImage, Result};
use tagalong_geometry::Rect;
use tagalong_learn::{
    CALIBRATION, Line, Use, accepted, area, mirrored, mix, platt, shifted, use_of,
};

use crate::coverage::FILLED;
use crate::{
    Coverage, Kind, Layout, Machine, Model, Scanner, Training, Trees, merge, window_numbers,
    window_of,
};

/// Smallest upper-body square in the search for false alarms, pixels, and the ratio of the sizes.
const SMALLEST_PX: f64 = 32.0;
const SCALE_STEP: f64 = 1.15;
/// Largest overlap (IoU) of windows of one picture that are both mined.
const MINED_OVERLAP: f64 = 0.5;
/// Sum below which a window is not a near miss: it is neither mined nor used for the calibration. A
/// linear machine is trained to give people more than 1; sums of trees spread more.
const NEAR_MISS: [f32; 2] = [-1.0, -10.0];
/// Sum below which trees reject a window during the mining.
const HOPELESS: f32 = -14.0;
/// Reason for which a layout is refused.
const NO_WHOLE_BODY: &str =
    "machine `linear` has windows of upper bodies only: take `trees`, or coverage `upper-body`";
/// Part of the people with sufficient sums that the final trees may reject early.
const GIVEN_UP: f64 = 0.01;
/// Small shifts of a person, as fractions of the square, and its growth.
const SHIFTS: [(f64, f64, f64); 4] =
    [(0.0, 0.0, 1.0), (0.05, -0.04, 1.05), (-0.05, 0.03, 0.95), (0.02, 0.05, 1.02)];
/// Largest part of a person's window that may lie outside the picture: a portrait does not show the
/// surroundings that a window includes.
const OUTSIDE: f64 = 0.2;
/// Number of simulated rooms, and number that no room has.
const DRAWN: usize = 0;
const NO_ROOM: usize = usize::MAX;
/// Rates of false alarms per window at which the miss rate is reported.
const FALSE_ALARMS: [f64; 3] = [1e-3, 1e-4, 1e-5];

/// Picture in which false alarms are looked for.
struct Picture {
    use_: Use,
    grey: Arc<GreyImage>,
    /// People in it: a photograph has none.
    people: Vec<Known>,
    /// Number of its room; 0 for photographs.
    room: usize,
}

/// Trainer that collects windows and pictures, and fits models to them.
#[derive(Default)]
pub struct HogTrainer {
    layout: Layout,
    training: Training,
    seed: u64,
    windows: Windows,
    /// Held-out windows of people.
    people: Vec<(Use, Vec<f32>)>,
    pictures: Vec<Picture>,
    /// Windows for the depth channel.
    depth: DepthWindows,
    /// Names of the rooms, by their numbers from 1 on.
    rooms: Vec<String>,
    /// Number of people with too much of their window outside the picture.
    cut_off: usize,
}

impl HogTrainer {
    /// Creates a trainer without examples.
    ///
    /// # Errors
    /// [`Error::Settings`] for settings outside their ranges.
    pub fn new(layout: Layout, training: Training, seed: u64) -> Result<Self> {
        if layout == (Layout { kind: Kind::Linear, coverage: Coverage::WholeBody }) {
            return Err(Error::Other(NO_WHOLE_BODY.into()));
        }
        let penalties = [training.person_penalty, training.other_penalty];
        if !penalties.iter().all(|p| *p > 0.0 && p.is_finite())
            || training.epochs * training.trees == 0
        {
            return Err(Error::Other("penalties, `epochs` and `trees` must be positive".into()));
        }
        Ok(Self { layout, training, seed, ..Self::default() })
    }

    fn add_person(&mut self, grey: &GreyImage, square: &Rect, use_: Use) {
        let window = window_of(square, self.layout.coverage);
        let seen = window.clipped(grey.width(), grey.height());
        if seen.area() < (1.0 - OUTSIDE) * window.area() {
            self.cut_off += 1;
            return;
        }
        if use_ != Use::Fit {
            self.people.push((use_, window_numbers(grey, square, self.layout)));
            return;
        }
        self.add_variants(grey, square, 0);
    }

    /// Adds a person of a room in small shifts and mirrored; 0 is for photographs.
    fn add_variants(&mut self, grey: &GreyImage, square: &Rect, room: usize) {
        let mirror = mirrored(grey);
        let flipped = Rect { x: grey.width() as f64 - square.right(), ..*square };
        for shift in SHIFTS {
            for (grey, square) in [(grey, square), (&mirror, &flipped)] {
                let numbers = window_numbers(grey, &shifted(square, shift), self.layout);
                self.windows.add(&numbers, true, room);
            }
        }
    }

    /// Adds random windows from the pictures without people.
    fn add_chance(&mut self) {
        for (index, Picture { use_, grey: picture, room, .. }) in self.pictures.iter().enumerate() {
            if *use_ != Use::Fit || *room != 0 {
                continue;
            }
            let small = FILLED * picture.width().min(picture.height()) as f64;
            // In a picture hardly larger than a window, all windows are nearly the same.
            let count = if small < 2.0 * SMALLEST_PX { 1 } else { self.training.random_windows };
            for window in 0..count {
                let [size, across, down] = [0, 1, 2].map(|k| {
                    let number = mix(self.seed ^ mix((index * 1000 + window) as u64 * 4 + k));
                    (number >> 11) as f64 / (1_u64 << 53) as f64
                });
                // The square favours small windows, which are also the most numerous in a search.
                let side = SMALLEST_PX + (small - SMALLEST_PX).max(0.0) * size.powi(2);
                let x = across * (picture.width() as f64 - side);
                let y = down * (picture.height() as f64 - side);
                let square = Rect::new(x, y, side, side);
                self.windows.add(&window_numbers(picture, &square, self.layout), false, 0);
            }
        }
    }

    /// Fits the machine of a round to the windows of some rooms; the last round is the best.
    fn machine(&self, round: usize, of_room: &dyn Fn(usize) -> bool) -> Model {
        let Training { person_penalty, other_penalty, epochs, trees, numbers, .. } = self.training;
        let rounds_left = self.training.mining_rounds.saturating_sub(round) as u32;
        let machine = match self.layout.kind {
            Kind::Linear => {
                let penalty = [other_penalty, person_penalty];
                let (weights, bias) = separate(&self.windows, penalty, epochs, self.seed);
                Machine::Linear { weights, bias }
            }
            Kind::Trees => {
                // The early machines only select false alarms, for which fewer trees are enough.
                let count = (trees >> (2 * rounds_left).min(31)).max(16);
                let trees = boosted(&self.windows, of_room, count, numbers, self.seed);
                Machine::Trees(Trees::new(trees, HOPELESS))
            }
        };
        Model { machine, coverage: self.layout.coverage, slope: 1.0, offset: 0.0, depth: None }
    }

    /// Adds the false alarms of the machine in photographs or in rooms; returns their number.
    fn mine(&mut self, model: &Model, in_rooms: bool) -> usize {
        let Training { mined_per_picture, mined_per_round, .. } = self.training;
        let mut scanner = Scanner::new(model);
        let mut mined: Vec<(f32, usize, Rect)> = Vec::new();
        for (index, picture) in self.pictures.iter().enumerate() {
            if picture.use_ == Use::Fit && (picture.room != 0) == in_rooms {
                let mut windows = search(&mut scanner, &picture.grey, self.near_miss());
                windows.retain(|window| picture.is_false(&window.region));
                merge(&mut windows, Coverage::UpperBody, MINED_OVERLAP, 1.0);
                let worst = windows.iter().take(mined_per_picture);
                mined.extend(worst.map(|w| (w.sum, index, w.region)));
            }
        }
        mined.sort_by(|a, b| b.0.total_cmp(&a.0));
        mined.truncate(mined_per_round);
        for (_, index, square) in &mined {
            let Picture { grey, room, .. } = &self.pictures[*index];
            self.windows.add(&window_numbers(grey, square, self.layout), false, *room);
        }
        mined.len()
    }

    /// Returns the sums of the windows that are held out for one purpose: those of people and those
    /// of near misses, and the number of all other windows that were scanned.
    fn apart(&self, model: &Model, wanted: Use, merged: bool) -> (Vec<(f64, bool)>, u64) {
        let people = self.people.iter().filter(|(use_, _)| *use_ == wanted);
        let mut sums: Vec<(f64, bool)> =
            people.map(|(_, numbers)| (sum_of(model, numbers, self.near_miss()), true)).collect();
        let mut scanner = Scanner::new(model);
        for picture in self.pictures.iter().filter(|p| p.use_ == wanted && p.room == 0) {
            let mut windows = search(&mut scanner, &picture.grey, self.near_miss());
            if merged {
                merge(&mut windows, Coverage::UpperBody, MINED_OVERLAP, 1.0);
            }
            sums.extend(windows.iter().map(|w| (f64::from(w.sum), false)));
        }
        (sums, scanner.looked_at())
    }

    fn figures(&self, model: &Model, mined: &[usize]) -> toml::Table {
        let (sums, windows) = self.apart(model, Use::Figures, false);
        let people = sums.iter().filter(|(_, is_person)| *is_person).count();
        let log_odds: Vec<(f64, bool)> =
            sums.iter().map(|(sum, is)| (model.log_odds(*sum as f32), *is)).collect();
        fn integer(n: usize) -> toml::Value {
            toml::Value::Integer(n as i64)
        }
        let mut table = toml::Table::from_iter([
            ("windows_of_people".to_owned(), integer(self.count(true))),
            ("windows_of_others".to_owned(), integer(self.count(false))),
            ("pictures_without_people".to_owned(), integer(self.photographs())),
            ("mined".to_owned(), mined.iter().map(|n| *n as i64).collect::<Vec<_>>().into()),
            ("people_cut_off".to_owned(), integer(self.cut_off)),
            ("held_out_people".to_owned(), integer(people)),
            ("held_out_windows_of_others".to_owned(), integer(windows as usize)),
            ("held_out_people_accepted".to_owned(), rounded(accepted(&log_odds, true))),
            ("area_under_roc_of_near_misses".to_owned(), rounded(area(&log_odds))),
        ]);
        for rate in FALSE_ALARMS {
            let missed = miss_rate(&sums, windows, rate, self.near_miss());
            table.insert(format!("miss_rate_at_{rate:e}_false_alarms_a_window"), rounded(missed));
        }
        table
    }

    fn near_miss(&self) -> f32 {
        NEAR_MISS[usize::from(self.layout.kind == Kind::Trees)]
    }

    /// Lets trees reject windows as early as the held-out people allow that would be found (after
    /// C. Zhang and P. Viola, *Multiple-instance pruning for learning efficient cascade detectors*,
    /// NIPS 2007).
    fn hurry(&self, model: &mut Model) {
        let near_miss = self.near_miss();
        let Machine::Trees(trees) = &mut model.machine else { return };
        let apart = self.people.iter().filter(|(use_, _)| *use_ == Use::Calibration);
        let ways = apart.map(|(_, numbers)| trees.on_the_way(numbers).collect());
        let ways: Vec<Vec<f32>> = ways
            .filter(|way: &Vec<f32>| way.last().is_some_and(|last| *last >= near_miss))
            .collect();
        if !ways.is_empty() {
            trees.least = least_on_the_way(&ways);
        }
    }

    /// Lets trees reject windows early, and calibrates the log-odds.
    fn finish(&self, model: &mut Model) {
        self.hurry(model);
        let (sums, _) = self.apart(model, Use::Calibration, true);
        let Line { slope, offset } = platt(&sums);
        // A slope of 0 or less would be refused when the model is read.
        (model.slope, model.offset) = (slope.max(1e-3), offset);
    }

    /// Returns the number of pictures that are photographs.
    fn photographs(&self) -> usize {
        self.pictures.iter().filter(|picture| picture.room == 0).count()
    }

    fn count(&self, people: bool) -> usize {
        self.windows.is_person.iter().filter(|is| **is == people).count()
    }
}

impl Picture {
    /// Returns true if no person of the picture is in a window.
    fn is_false(&self, window: &Rect) -> bool {
        !self.people.iter().any(|known| known.is_shown(window))
    }
}

impl Trainer for HogTrainer {
    fn add(&mut self, frame: &Frame, candidate: &Detection, example: Example) -> Result<()> {
        let grey = frame.grey()?;
        let use_ = use_of(example.group, &[CALIBRATION]);
        if example.is_person {
            self.add_person(grey, &candidate.rect_in(&frame.camera), use_);
            return Ok(());
        }
        // A picture comes once for each of its candidates, and is stored once.
        let is_known = self.pictures.last().is_some_and(|last| *last.grey == *grey);
        if !is_known {
            let grey = Arc::new(grey.clone());
            self.pictures.push(Picture { use_, grey, people: Vec::new(), room: 0 });
        }
        Ok(())
    }

    // P2's machine stays that of photographs.
    fn learns_from_rooms(&self) -> bool {
        self.layout.kind == Kind::Trees
    }

    fn add_frame(
        &mut self,
        frame: &Frame,
        people: &[AnnotatedPerson],
        room: Option<&str>,
        group: u64,
    ) -> Result<()> {
        let people = rooms::known(frame, people);
        let room = self.number_or_drawn(room);
        self.depth.add(frame, &people, room, group);
        // Simulated rooms teach depth alone: their textures are not those of real ones.
        if room != DRAWN {
            let grey = Arc::new(frame.grey()?.clone());
            self.pictures.push(Picture { use_: Use::Fit, grey, people, room });
        }
        Ok(())
    }

    fn fit(&mut self, progress: &mut dyn FnMut(f64)) -> Result<Fitted> {
        self.add_chance();
        if self.count(true) == 0 || self.count(false) == 0 {
            return Err(Error::Other("people and pictures without people: both are needed".into()));
        }
        let rounds = self.training.mining_rounds;
        let mut model = self.machine(0, &|_| true);
        let mut mined = Vec::new();
        for round in 0..rounds {
            progress((round + 1) as f64 / (rounds + 2) as f64);
            mined.push(self.mine(&model, false));
            model = self.machine(round + 1, &|_| true);
        }
        self.finish(&mut model);
        let mut without = Vec::new();
        let mut in_rooms = toml::Table::new();
        if !self.rooms.is_empty() {
            let of_photographs = model;
            if self.training.rooms {
                self.add_room_people();
                mined.push(self.mine(&of_photographs, true));
            }
            for room in 1..=self.rooms.len() {
                let name = self.rooms[room - 1].clone();
                let left_out = self.without(room, &of_photographs);
                let rows = [("photographs only", &of_photographs), ("left out", &left_out)];
                in_rooms.extend(rows.map(|(row, model)| {
                    (format!("{name}: {row}"), rooms::figures(&self.missed_in(model, room)))
                }));
                without.push((name, left_out.to_text().map_err(Error::Other)?));
            }
            model = self.without(NO_ROOM, &of_photographs);
        }
        progress(1.0);
        let mut figures = self.figures(&model, &mined);
        if !in_rooms.is_empty() {
            figures.insert("rooms".into(), in_rooms.into());
        }
        let text = model.to_text().map_err(Error::Other)?;
        Ok(Fitted::new(text, figures).with_rooms_left_out(without))
    }
}

/// Returns all windows of a picture above `least`.
fn search(scanner: &mut Scanner, picture: &GreyImage, least: f32) -> Vec<crate::Window> {
    let most = picture.width().min(picture.height()) as f64;
    let sides = std::iter::successors(Some(SMALLEST_PX), |side| Some(side * SCALE_STEP));
    let sides = sides.take_while(|side| *side <= most);
    let mut found = Vec::new();
    scanner.scan(
        picture,
        sides,
        least,
        |grid, wanted| wanted.extend(grid.windows(|_| Some(None))),
        &mut found,
    );
    found
}

/// Returns the share of people with sums not above the one that this rate of the `windows` of
/// others exceeds.
fn miss_rate(sums: &[(f64, bool)], windows: u64, false_alarms: f64, near_miss: f32) -> f64 {
    let mut others: Vec<f64> = sums.iter().filter(|(_, is)| !is).map(|(sum, _)| *sum).collect();
    others.sort_by(|a, b| b.total_cmp(a));
    let allowed = (false_alarms * windows as f64) as usize;
    let limit = others.get(allowed).copied().unwrap_or(f64::from(near_miss));
    let people: Vec<f64> = sums.iter().filter(|(_, is)| *is).map(|(sum, _)| *sum).collect();
    let missed = people.iter().filter(|sum| **sum <= limit).count();
    missed as f64 / people.len().max(1) as f64
}

/// Returns for each round a sum below which a person like those with the given sums after each
/// round does not fall: the least of these, minus the margin by which one person may be behind all
/// others. At most 0.
fn least_on_the_way(ways: &[Vec<f32>]) -> Vec<f32> {
    let rounds = ways.first().map_or(0, Vec::len);
    let mut least_two = vec![[0.0_f32; 2]; rounds];
    for way in ways {
        for ([least, next], sum) in least_two.iter_mut().zip(way) {
            (*least, *next) = (least.min(*sum), next.min(sum.max(*least)));
        }
    }
    // For the person with the lowest sum, the lowest sum of the others is the second one.
    let mut behind = Vec::with_capacity(ways.len());
    for way in ways {
        let of_way = way.iter().zip(&least_two).map(|(sum, [_, next])| next - sum);
        behind.push(of_way.fold(0.0, f32::max));
    }
    behind.sort_by(|a, b| b.total_cmp(a));
    let margin = behind.get((GIVEN_UP * behind.len() as f64) as usize).copied().unwrap_or(0.0);
    least_two.iter().map(|[least, _]| least - margin).collect()
}

/// Returns the sum of a person's window; one below `least` counts as missed, and is raised to it.
fn sum_of(model: &Model, numbers: &[f32], least: f32) -> f64 {
    f64::from(model.sum_of(numbers).max(least))
}

fn rounded(value: f64) -> toml::Value {
    toml::Value::Float((value * 1e4).round() / 1e4)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ROUND;
    use crate::trees::channel_numbers;

    #[test]
    fn whoever_is_found_may_be_as_far_behind_as_one_was_behind_the_others() {
        let ways = [vec![-1.0, 2.0, 5.0], vec![-3.0, -4.0, 9.0], vec![0.5, -2.0, 1.0]];
        // The second is 2 behind the next one after two rounds, and no other is farther behind.
        assert_eq!(least_on_the_way(&ways), [-5.0, -6.0, -2.0]);
        assert!(least_on_the_way(&[]).is_empty());
    }

    /// With the near miss at -1.0, and a thousand windows.
    #[test]
    fn the_miss_rate_is_that_at_the_allowed_number_of_false_alarms() {
        let people = [6.0, 4.0, 2.0, 0.0].map(|sum| (sum, true));
        let sums = [&people[..], &[5.0, 3.0, 1.0].map(|sum| (sum, false))].concat();
        // The second, the first and none of the others is the limit.
        for (rate, expected) in [(1e-3, 0.5), (1e-5, 0.75), (1e-2, 0.0)] {
            assert_eq!(miss_rate(&sums, 1000, rate, -1.0), expected, "{rate}");
        }
        assert_eq!(miss_rate(&[], 1000, 1e-3, -1.0), 0.0);
    }

    /// Two rounds of trees: the first gives -1 or, for a first number below a half, -3, and the
    /// second one gives -1 to all.
    fn trees() -> Model {
        fn tree(yes: f32) -> crate::Tree {
            crate::Tree { numbers: [0; 3], below: [0.5; 3], values: [yes, yes, -0.125, -0.125] }
        }
        let rounds = [[tree(-0.375); ROUND], [tree(-0.125); ROUND]].concat();
        of_trees(Trees::new(rounds, HOPELESS))
    }

    fn of_trees(trees: Trees) -> Model {
        let machine = Machine::Trees(trees);
        Model { machine, coverage: Coverage::UpperBody, slope: 1.0, offset: 0.0, depth: None }
    }

    fn numbers(first: f32) -> Vec<f32> {
        let mut numbers = vec![0.0; channel_numbers(Coverage::UpperBody)];
        numbers[0] = first;
        numbers
    }

    #[test]
    fn trees_reject_as_early_as_the_people_of_the_calibration_allow() {
        fn least(people: Vec<(Use, Vec<f32>)>) -> Vec<f32> {
            let mut trainer = HogTrainer::new(Kind::Trees.into(), Training::default(), 1).unwrap();
            trainer.people = people;
            let mut model = trees();
            trainer.hurry(&mut model);
            let Machine::Trees(trees) = model.machine else { return Vec::new() };
            trees.least
        }

        let good = (Use::Calibration, numbers(1.0));
        let late = (Use::Calibration, numbers(0.0));
        assert_eq!(least(vec![]), [HOPELESS; 2], "nothing is known");
        assert_eq!(least(vec![good.clone(); 3]), [-1.0, -2.0]);
        // One of them is 2 behind the others after each round, and another may be, too.
        assert_eq!(least(vec![good.clone(), good.clone(), late]), [-5.0, -6.0]);
        let other = (Use::Figures, numbers(0.0));
        assert_eq!(least(vec![good.clone(), good, other]), [-1.0, -2.0]);
        let mut model =
            Model { machine: Machine::Linear { weights: vec![], bias: 0.0 }, ..trees() };
        let before = model.clone();
        let trainer = HogTrainer::new(Kind::Linear.into(), Training::default(), 1).unwrap();
        trainer.hurry(&mut model);
        assert_eq!(model, before, "a weighted sum has no rounds");
    }

    /// One round that ends far below a near miss for some: they are not found anyway.
    #[test]
    fn people_that_are_missed_anyway_do_not_hold_the_trees_up() {
        fn person(first: f32) -> (Use, Vec<f32>) {
            (Use::Calibration, numbers(first))
        }

        let tree =
            crate::Tree { numbers: [0; 3], below: [0.5; 3], values: [-2.0, -2.0, -0.125, -0.125] };
        let mut model = of_trees(Trees::new(vec![tree; ROUND], HOPELESS));
        let mut trainer = HogTrainer::new(Kind::Trees.into(), Training::default(), 1).unwrap();
        trainer.people = vec![person(1.0), person(1.0), person(0.0)];
        assert!(-16.0 < trainer.near_miss(), "the sum of the last one");
        trainer.hurry(&mut model);
        let Machine::Trees(trees) = model.machine else { panic!("trees stay trees") };
        assert_eq!(trees.least, [-1.0]);
    }
}
