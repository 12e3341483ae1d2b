//! Training of the depth channel: windows that depth and geometry allow, in simulated rooms with
//! cameras at any height and in real ones.

use tagalong_core::{DepthImage, Frame};
use tagalong_learn::{Line, platt};

use super::boosted::boosted;
use super::rooms::Known;
use super::svm::Windows;
use super::{DRAWN, HogTrainer};
use crate::depth_channel::depth_numbers;
use crate::detect::{Proposer, sides};
use crate::lattice::Lattice;
use crate::{Config, Coverage, DepthTrees, Grid, Kind};

/// Overlap (IoU) from which on a window is one of a person.
const PERSON: f64 = 0.6;
/// Most windows of others in a frame: neighbours say the same.
const OTHERS: usize = 40;
/// Number of trees, and of values that each is chosen from.
const TREES: usize = 96;
const NUMBERS: usize = 32;
/// Part of the simulated scenes, one in so many, that calibrates.
const HELD_OUT: u64 = 5;

/// Windows for the depth channel; those of calibrating scenes are apart.
#[derive(Default)]
pub(super) struct DepthWindows {
    fit: Windows,
    held_out: Windows,
}

impl DepthWindows {
    /// Adds the windows of a frame that depth allows.
    pub(super) fn add(&mut self, frame: &Frame, people: &[Known], room: usize, group: u64) {
        let Ok(depth) = frame.depth() else { return };
        let is_held_out = room == 0 && group.is_multiple_of(HELD_OUT);
        let windows = if is_held_out { &mut self.held_out } else { &mut self.fit };
        let mut others = Vec::new();
        for (square, surface_m) in proposals(frame, depth) {
            let overlap = people.iter().filter(|known| known.counts).map(|k| k.square.iou(&square));
            if overlap.fold(0.0, f64::max) >= PERSON {
                windows.add(&depth_numbers(depth, &square, surface_m), true, room);
            } else if !people.iter().any(|known| known.is_shown(&square)) {
                others.push((square, surface_m));
            }
        }
        // They are in the order of size and place, so that a stride keeps some of each.
        for (square, surface_m) in others.iter().step_by(others.len().div_ceil(OTHERS).max(1)) {
            windows.add(&depth_numbers(depth, square, *surface_m), false, room);
        }
    }

    /// Fits trees to the windows of some rooms; `None` if these lack people or others.
    fn fit(&self, of_room: &dyn Fn(usize) -> bool, seed: u64) -> Option<DepthTrees> {
        let mut has = [false; 2];
        for (is_person, room) in self.fit.is_person.iter().zip(&self.fit.room) {
            has[usize::from(*is_person)] |= of_room(*room);
        }
        if has != [true; 2] {
            return None;
        }
        let mut depth = DepthTrees::new(boosted(&self.fit, of_room, TREES, NUMBERS, seed));
        let width = self.held_out.width().max(1);
        let numbers = self.held_out.numbers.chunks_exact(width);
        let sums = numbers.map(|numbers| f64::from(depth.trees.sum_of(numbers)));
        let sums: Vec<(f64, bool)> = sums.zip(self.held_out.is_person.iter().copied()).collect();
        let Line { slope, offset } = platt(&sums);
        (depth.slope, depth.offset) = (slope.max(1e-3), offset);
        Some(depth)
    }
}

/// Returns the squares that depth and geometry allow in a frame, with the distances of their
/// objects.
fn proposals(frame: &Frame, depth: &DepthImage) -> Vec<(tagalong_geometry::Rect, f64)> {
    let config = Config::default();
    let mut lattice = Lattice::default();
    let camera = &*frame.camera;
    let mut proposer = Proposer::new(&config, camera, Some(depth), &mut lattice, None);
    let mut wanted = Vec::new();
    let mut found = Vec::new();
    for side in sides(&config, camera, None) {
        let grid = Grid::new((camera.width, camera.height), side);
        wanted.clear();
        proposer.propose(&grid, &mut wanted);
        found.extend(wanted.iter().filter_map(|w| Some((grid.square(w.x, w.y), w.depth_m?))));
    }
    found
}

impl HogTrainer {
    /// Fits a depth channel to simulated frames and to all rooms but one.
    pub(super) fn depth_without(&self, room: usize) -> Option<DepthTrees> {
        let of_upper_bodies = self.layout.coverage == Coverage::UpperBody;
        let has_channel = self.layout.kind == Kind::Trees && of_upper_bodies;
        has_channel.then(|| self.depth.fit(&|other| other != room, self.seed)).flatten()
    }

    /// Returns the number of a room; simulated ones have that of photographs.
    pub(super) fn number_or_drawn(&mut self, room: Option<&str>) -> usize {
        room.map_or(DRAWN, |room| self.number_of(room))
    }
}
