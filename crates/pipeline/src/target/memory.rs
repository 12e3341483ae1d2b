use std::collections::VecDeque;

use super::looks::{Difference, Looks};
use super::settings::LooksSettings;

/// So many looks are remembered of the person, and as many of others.
const MOST: usize = 24;
/// The first ones are never forgotten: they are certain.
const KEPT: usize = 8;
/// Looks that differ less from what is known add nothing, on the mean.
const NEWS: f64 = 0.06;

/// What the person looks like, and what others look like.
#[derive(Clone, Debug, Default)]
pub(crate) struct Memory {
    own: VecDeque<Looks>,
    others: VecDeque<Looks>,
    /// Sum of the heights of the head, m, and their number.
    heights: (f64, f64),
}

impl Memory {
    /// The person was seen.
    pub(crate) fn learn(&mut self, looks: Looks) {
        self.heights = (self.heights.0 + looks.height_m, self.heights.1 + 1.0);
        remember(&mut self.own, looks, KEPT);
    }

    /// Somebody else was seen.
    pub(crate) fn learn_other(&mut self, looks: Looks) {
        remember(&mut self.others, looks, 0);
    }

    /// How these looks differ from the person's; `None` without a memory.
    pub(crate) fn differences(&self, looks: &Looks) -> Option<Differences> {
        let own = nearest(&self.own, looks)?;
        let other = nearest(&self.others, looks);
        let height_m = self.heights.0 / self.heights.1;
        Some(Differences {
            torso: own.torso,
            legs: own.legs,
            texture: own.texture,
            height_m: (looks.height_m - height_m).abs(),
            rivals: other.and_then(|other| Some(other.mean()? - own.mean()?)),
        })
    }
}

/// How somebody's looks differ from what is remembered of a person: Hellinger
/// distances, 0 to 1, of what the images show, and the height of the head.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Differences {
    /// Colours of the upper body.
    pub torso: Option<f64>,
    /// Colours of the legs.
    pub legs: Option<f64>,
    /// Directions of edges on the upper body.
    pub texture: Option<f64>,
    /// Height of the head, m.
    pub height_m: f64,
    /// How much farther the looks are from those of others than from the
    /// person's.
    pub rivals: Option<f64>,
}

impl Differences {
    /// Log-odds that it is the person; what is not known says nothing.
    pub(crate) fn log_odds(&self, settings: &LooksSettings) -> f64 {
        let say = |difference: Option<f64>, [even, weight]: [f64; 2]| {
            difference.map_or(0.0, |difference| weight * (even - difference))
        };
        say(self.torso, settings.torso)
            + say(self.legs, settings.legs)
            + say(self.texture, settings.texture)
            + say(Some(self.height_m), settings.height)
            + settings.rivals * self.rivals.unwrap_or(0.0)
    }
}

/// Adds looks that are new; the oldest that is not among the first `kept` goes.
fn remember(all: &mut VecDeque<Looks>, looks: Looks, kept: usize) {
    let differs = |known: &Looks| looks.difference(known).mean().is_some_and(|d| d > NEWS);
    if !all.is_empty() && !all.iter().all(differs) {
        return;
    }
    if all.len() == MOST {
        all.remove(kept);
    }
    all.push_back(looks);
}

/// The difference from the most like of several looks.
fn nearest(all: &VecDeque<Looks>, looks: &Looks) -> Option<Difference> {
    let differences = all.iter().map(|known| looks.difference(known));
    let mean = |d: &Difference| d.mean().unwrap_or(0.0);
    differences.min_by(|a, b| mean(a).total_cmp(&mean(b)))
}
