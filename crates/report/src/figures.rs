//! Figures of merit: their names, units and directions.

use tagalong_eval::Scores;

use crate::model::TaskResult;

/// Space in which tracks and truth were compared.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ComparisonSpace {
    Image,
    Floor,
}

impl ComparisonSpace {
    pub const ALL: [Self; 2] = [Self::Image, Self::Floor];

    /// Returns the prefix of the keys of its figures.
    pub const fn key(self) -> &'static str {
        match self {
            Self::Image => "image",
            Self::Floor => "metres",
        }
    }

    pub const fn scores(self, task: &TaskResult) -> Option<&Scores> {
        match self {
            Self::Image => task.image.as_ref(),
            Self::Floor => task.metres.as_ref(),
        }
    }
}

/// Figure of a task.
pub struct Figure {
    /// Name as in [`Scores`].
    pub name: &'static str,
    /// Unit: `s` or `m`; empty for rates and counts.
    pub unit: &'static str,
    pub decimals: usize,
    pub higher_is_better: bool,
    /// Range of its values.
    pub range: [f64; 2],
    /// Meaning, in one line.
    pub meaning: &'static str,
    /// Spaces in which the figure is shown.
    pub places: &'static [ComparisonSpace],
    /// True if pairs of pipelines are compared by it.
    pub compared: bool,
    of: fn(&Scores) -> Option<f64>,
}

impl Figure {
    /// Returns the value of the figure for a task, if it is finite; `None` for single frames if the
    /// figure needs several.
    pub fn of(&self, place: ComparisonSpace, task: &TaskResult) -> Option<f64> {
        if task.single_frames && OVER_TIME.contains(&self.name) {
            return None;
        }
        place.scores(task).and_then(self.of).filter(|v| v.is_finite())
    }

    /// Returns the key in `report.json`.
    pub fn key(&self, place: ComparisonSpace) -> String {
        format!("{}.{}", place.key(), self.name)
    }

    /// Returns true if `a` is better than `b`.
    pub fn better(&self, a: f64, b: f64) -> bool {
        if self.higher_is_better { a > b } else { a < b }
    }

    /// Returns true if `a` is better than `b` even after rounding to the decimals that a page
    /// prints.
    pub fn better_as_printed(&self, a: f64, b: f64) -> bool {
        let parts = 10_f64.powi(self.decimals as i32);
        self.better((a * parts).round(), (b * parts).round())
    }

    /// Returns the figures of a space.
    pub fn at(place: ComparisonSpace) -> impl Iterator<Item = &'static Self> {
        FIGURES.iter().filter(move |f| f.places.contains(&place))
    }
}

/// Number of distinct scores from which the plot of miss rate against false positives is a curve
/// rather than a few points.
pub const FEW_SCORES: u64 = 10;

/// Returns true if the reports have so few distinct scores that figures over scores have little
/// meaning.
pub fn has_few_scores(scores: &Scores) -> bool {
    // Results of earlier versions did not count them.
    (1..FEW_SCORES).contains(&scores.distinct_scores)
}

/// Returns the log-average miss rate, unless the reports have too few distinct scores for it.
pub fn lamr_of_enough_scores(scores: &Scores) -> Option<f64> {
    scores.lamr.filter(|_| !has_few_scores(scores))
}

/// Figures of events over several frames.
const OVER_TIME: [&str; 8] = [
    "HOTA",
    "AssA",
    "MOTA",
    "IDF1",
    "IDSW",
    "inherited_ids",
    "wrong_person_s",
    "time_to_confirm_mean_s",
];

/// Figure that ranks the pipelines.
pub const MAIN: &Figure = &FIGURES[0];

const BOTH: &[ComparisonSpace] = &ComparisonSpace::ALL;

/// Range of times, distances and counts.
const POSITIVE: [f64; 2] = [0.0, f64::INFINITY];

const RATE: Figure = Figure {
    name: "",
    unit: "",
    decimals: 3,
    higher_is_better: true,
    range: [0.0, 1.0],
    meaning: "",
    places: BOTH,
    compared: false,
    of: |_| None,
};

const FIGURES: &[Figure] = &[
    Figure {
        name: "HOTA",
        meaning: "Detection and association together. 1 is perfect.",
        compared: true,
        of: |s| s.hota,
        ..RATE
    },
    Figure { name: "DetA", meaning: "The detection part of HOTA.", of: |s| s.det_a, ..RATE },
    Figure {
        name: "AssA",
        meaning: "The association part of HOTA: how well each person keeps one ID.",
        of: |s| s.ass_a,
        ..RATE
    },
    Figure {
        name: "MOTA",
        range: [f64::NEG_INFINITY, 1.0],
        meaning: "1 minus misses, false positives and ID switches per annotated person and frame; \
                  may be negative.",
        compared: true,
        of: |s| s.mota,
        ..RATE
    },
    Figure {
        name: "IDF1",
        meaning: "Share of the time in which each person has one and the same ID.",
        compared: true,
        of: |s| s.idf1,
        ..RATE
    },
    Figure {
        name: "LAMR",
        higher_is_better: false,
        meaning: "Log-average miss rate, from one false positive in 100 images to one per image.",
        places: &[ComparisonSpace::Image],
        compared: true,
        of: lamr_of_enough_scores,
        ..RATE
    },
    Figure {
        name: "IDSW",
        range: POSITIVE,
        decimals: 1,
        higher_is_better: false,
        meaning: "How often the ID of a person changes, per log.",
        of: |s| Some(s.idsw as f64),
        ..RATE
    },
    Figure {
        name: "inherited_ids",
        range: POSITIVE,
        decimals: 1,
        higher_is_better: false,
        meaning: "How often a person gets the ID that another one had last, per log.",
        of: |s| Some(s.inherited_ids as f64),
        ..RATE
    },
    Figure {
        name: "fp_per_frame",
        range: POSITIVE,
        decimals: 2,
        higher_is_better: false,
        meaning: "False positives per frame. Counts on empty logs, too.",
        compared: true,
        of: |s| s.fp_per_frame,
        ..RATE
    },
    Figure {
        name: "time_to_confirm_mean_s",
        range: POSITIVE,
        unit: "s",
        decimals: 2,
        higher_is_better: false,
        meaning: "Time from coming into view to the first match, without people who are never found.",
        places: &[ComparisonSpace::Image],
        of: |s| s.time_to_confirm_mean_s,
        ..RATE
    },
    Figure {
        name: "wrong_person_s",
        range: POSITIVE,
        unit: "s",
        decimals: 2,
        higher_is_better: false,
        meaning: "Time in which tracks are on another person than the one they began with, per log.",
        of: |s| Some(s.wrong_person_s),
        ..RATE
    },
    Figure {
        name: "position_error_mean_m",
        range: POSITIVE,
        unit: "m",
        decimals: 3,
        higher_is_better: false,
        meaning: "Distance between a track and its person on the floor.",
        places: &[ComparisonSpace::Floor],
        compared: true,
        of: |s| s.position_error_mean_m,
    },
    Figure {
        name: "OSPA",
        range: POSITIVE,
        higher_is_better: false,
        meaning: "One distance for wrong positions and a wrong number of people.",
        of: |s| s.ospa,
        ..RATE
    },
];
