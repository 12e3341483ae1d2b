use clap::ValueEnum;
use serde::{Deserialize, Serialize};
use tagalong_eval::Scores;

/// The figures of a pipeline on one log, or a mean of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Figures {
    /// HOTA.
    #[serde(rename = "HOTA")]
    pub hota: f64,
    /// AssA.
    #[serde(rename = "AssA")]
    pub ass_a: f64,
    /// IDF1.
    #[serde(rename = "IDF1")]
    pub idf1: f64,
    /// Number of IDs that another person had last; for a mean, the sum.
    #[serde(rename = "inherited_ids")]
    pub inherited: u64,
    /// MOTA.
    #[serde(rename = "MOTA")]
    pub mota: f64,
    /// False positives per frame.
    #[serde(rename = "FP_per_frame")]
    pub false_a_frame: f64,
    /// Fraction of the people that were found.
    pub recall: f64,
    /// The same for people within 5 m with at least 90 % visible, if that is annotated.
    pub recall_free: Option<f64>,
    /// The same for those with 60 to 90 % visible.
    pub recall_partly_hidden: Option<f64>,
    /// Mean distance between a track and its person, m, if positions are annotated.
    pub position_error_m: Option<f64>,
    /// Number of annotated people, each counted once per frame; for a mean, the sum.
    pub people: u64,
}

/// Weights of rooms in a mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Weights {
    /// All rooms have the same weight.
    Equal,
    /// By the number of annotated people, each counted once per frame.
    People,
}

/// Rules of a choice: which rooms take part in it, and with which weight.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Poll {
    /// Weights of the rooms.
    pub weights: Weights,
    /// For each room, true if it takes part.
    pub has_say: Vec<bool>,
}

/// Figure to maximise.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ValueEnum)]
pub enum Objective {
    /// Detection and association, with equal weight.
    #[serde(rename = "HOTA")]
    #[value(name = "HOTA")]
    Hota,
    /// The mean of HOTA and IDF1.
    #[serde(rename = "HOTA and IDF1")]
    #[value(name = "both")]
    HotaAndIdf1,
    /// Association.
    #[serde(rename = "IDF1")]
    #[value(name = "IDF1")]
    Idf1,
    /// Detection, with few false positives.
    #[serde(rename = "MOTA")]
    #[value(name = "MOTA")]
    Mota,
}

/// The best candidates, by their indices in the list.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Choice {
    /// For each room, the candidate that is best in the other rooms.
    pub without: Vec<usize>,
    /// The candidate that is best in all rooms.
    pub with_all: usize,
}

impl Figures {
    /// Reads the figures of a log; `None` if it has no people.
    pub fn of(scores: &Scores) -> Option<Self> {
        Some(Self {
            hota: scores.hota?,
            ass_a: scores.ass_a?,
            idf1: scores.idf1?,
            inherited: scores.inherited_ids,
            mota: scores.mota?,
            false_a_frame: scores.fp_per_frame?,
            recall: scores.recall?,
            recall_free: scores.recall_free,
            recall_partly_hidden: scores.recall_partly_hidden,
            position_error_m: scores.position_error_mean_m,
            people: scores.truths,
        })
    }
}

impl Weights {
    fn of(self, figures: &Figures) -> f64 {
        match self {
            Self::Equal => 1.0,
            Self::People => figures.people as f64,
        }
    }
}

impl Poll {
    /// Returns rules with which this number of rooms take part with the same weight.
    pub fn of_equals(rooms: usize) -> Self {
        Self { weights: Weights::Equal, has_say: vec![true; rooms] }
    }
}

impl Objective {
    fn of(self, figures: &Figures) -> f64 {
        match self {
            Self::Hota => figures.hota,
            Self::HotaAndIdf1 => 0.5 * (figures.hota + figures.idf1),
            Self::Idf1 => figures.idf1,
            Self::Mota => figures.mota,
        }
    }
}

/// Returns the mean of figures with equal weights; zeros without figures. A figure that some of
/// them lack is averaged over the others.
pub fn mean<'a>(figures: impl IntoIterator<Item = &'a Figures>) -> Figures {
    weighted_mean(figures, Weights::Equal)
}

/// Returns the weighted mean of figures, otherwise as [`mean`].
pub fn weighted_mean<'a>(
    figures: impl IntoIterator<Item = &'a Figures>,
    weights: Weights,
) -> Figures {
    let all: Vec<&Figures> = figures.into_iter().collect();
    Figures {
        hota: mean_of(&all, weights, |f| Some(f.hota)).unwrap_or(0.0),
        ass_a: mean_of(&all, weights, |f| Some(f.ass_a)).unwrap_or(0.0),
        idf1: mean_of(&all, weights, |f| Some(f.idf1)).unwrap_or(0.0),
        mota: mean_of(&all, weights, |f| Some(f.mota)).unwrap_or(0.0),
        false_a_frame: mean_of(&all, weights, |f| Some(f.false_a_frame)).unwrap_or(0.0),
        recall: mean_of(&all, weights, |f| Some(f.recall)).unwrap_or(0.0),
        recall_free: mean_of(&all, weights, |f| f.recall_free),
        recall_partly_hidden: mean_of(&all, weights, |f| f.recall_partly_hidden),
        position_error_m: mean_of(&all, weights, |f| f.position_error_m),
        people: all.iter().map(|figures| figures.people).sum(),
        inherited: all.iter().map(|figures| figures.inherited).sum(),
    }
}

/// Returns the weighted mean of one figure; `None` if all lack it.
fn mean_of(all: &[&Figures], weights: Weights, figure: fn(&Figures) -> Option<f64>) -> Option<f64> {
    let mut sum = 0.0;
    let mut weight = 0.0;
    for figures in all {
        if let Some(value) = figure(figures) {
            sum += weights.of(figures) * value;
            weight += weights.of(figures);
        }
    }
    (weight > 0.0).then(|| sum / weight)
}

/// Returns the choice without each room, and the one with all. `figures` has the figures of each
/// candidate in each room; at least two rooms take part. Of equally good candidates the first is
/// taken.
pub fn leave_one_out(figures: &[Vec<Figures>], objective: Objective, poll: &Poll) -> Choice {
    let rooms = figures.first().map_or(0, Vec::len);
    Choice {
        without: (0..rooms).map(|room| best(figures, objective, poll, Some(room))).collect(),
        with_all: best(figures, objective, poll, None),
    }
}

fn best(
    figures: &[Vec<Figures>],
    objective: Objective,
    poll: &Poll,
    left_out: Option<usize>,
) -> usize {
    let mut best = (0, f64::NEG_INFINITY);
    for (at, rooms) in figures.iter().enumerate() {
        let counting = rooms
            .iter()
            .zip(&poll.has_say)
            .enumerate()
            .filter(|(room, (_, has_say))| **has_say && left_out != Some(*room))
            .map(|(_, (figures, _))| figures);
        let worth = objective.of(&weighted_mean(counting, poll.weights));
        if worth > best.1 {
            best = (at, worth);
        }
    }
    best.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(hota: f64) -> Figures {
        Figures {
            hota,
            idf1: 1.0 - hota,
            mota: -hota,
            false_a_frame: hota,
            recall: 0.5,
            ..Figures::default()
        }
    }

    fn all(figures: &Figures) -> [f64; 5] {
        let Figures { hota, idf1, mota, false_a_frame, recall, .. } = *figures;
        [hota, idf1, mota, false_a_frame, recall]
    }

    fn alike() -> Poll {
        Poll::of_equals(3)
    }

    fn table(rows: &[[f64; 3]]) -> Vec<Vec<Figures>> {
        rows.iter().map(|row| row.iter().copied().map(of).collect()).collect()
    }

    #[test]
    fn a_room_has_no_say_in_what_is_chosen_without_it() {
        let figures = [[0.5, 0.5, 0.5], [0.9, 0.4, 0.4], [0.2, 0.6, 0.6]];
        let choice = leave_one_out(&table(&figures), Objective::Hota, &alike());
        assert_eq!(choice, Choice { without: vec![2, 1, 1], with_all: 1 });
        for value in [0.0, 0.3, 1.0] {
            let other = figures.map(|[_, b, c]| [value * b, b, c]);
            assert_eq!(leave_one_out(&table(&other), Objective::Hota, &alike()).without[0], 2);
        }
    }

    /// The second candidate gains little in two rooms and loses much in the third.
    #[test]
    fn a_room_without_a_say_chooses_nothing() {
        let figures = table(&[[0.5, 0.5, 0.9], [0.6, 0.6, 0.1]]);
        let choice = leave_one_out(&figures, Objective::Hota, &alike());
        assert_eq!(choice, Choice { without: vec![0, 0, 1], with_all: 0 });
        let poll = Poll { has_say: vec![true, true, false], ..alike() };
        let choice = leave_one_out(&figures, Objective::Hota, &poll);
        assert_eq!(choice, Choice { without: vec![1, 1, 1], with_all: 1 });
    }

    /// The second candidate gains in the room with nine people of ten.
    #[test]
    fn rooms_weigh_by_their_people() {
        let mut figures = table(&[[0.5, 0.9, 0.5], [0.6, 0.1, 0.5]]);
        for rooms in &mut figures {
            [rooms[0].people, rooms[1].people, rooms[2].people] = [90, 5, 5];
        }
        let by_people = Poll { weights: Weights::People, ..alike() };
        assert_eq!(leave_one_out(&figures, Objective::Hota, &by_people).with_all, 1);
        assert_eq!(leave_one_out(&figures, Objective::Hota, &alike()).with_all, 0);
        let mean = weighted_mean(&figures[0], Weights::People);
        assert!((mean.hota - 0.52).abs() < 1e-12, "{mean:?}");
        assert_eq!(mean.people, 100);
    }

    #[test]
    fn inherited_ids_add_up_and_do_not_weigh() {
        let few = Figures { ass_a: 0.2, inherited: 2, people: 1, ..of(0.2) };
        let many = Figures { ass_a: 0.6, inherited: 5, people: 3, ..of(0.6) };
        let mean = weighted_mean([&few, &many], Weights::People);
        assert_eq!(mean.inherited, 7);
        assert!((mean.ass_a - 0.5).abs() < 1e-12, "{mean:?}");
    }

    #[test]
    fn a_figure_that_some_lack_weighs_nothing() {
        let few = Figures { recall_free: Some(0.2), people: 1, ..of(0.2) };
        let many = Figures { recall_free: Some(0.6), people: 3, ..of(0.6) };
        let without = Figures { people: 96, ..of(0.4) };
        let mean = weighted_mean([&few, &many, &without], Weights::People);
        assert!((mean.recall_free.unwrap() - 0.5).abs() < 1e-12, "{mean:?}");
        assert!((mean.hota - 0.404).abs() < 1e-12, "{mean:?}");
    }

    #[test]
    fn a_figure_that_some_lack_is_the_mean_of_the_others() {
        let some = Figures { recall_free: Some(0.5), position_error_m: Some(0.1), ..of(0.2) };
        let other = Figures { recall_free: Some(1.0), ..of(0.4) };
        let mean = mean([&some, &other, &of(0.6)]);
        assert!((mean.hota - 0.4).abs() < 1e-12);
        assert_eq!((mean.recall_free, mean.position_error_m), (Some(0.75), Some(0.1)));
        assert_eq!(mean.recall_partly_hidden, None);
    }

    #[test]
    fn the_objective_says_what_is_better() {
        let figures = table(&[[0.5, 0.5, 0.5], [0.9, 0.9, 0.9]]);
        assert_eq!(leave_one_out(&figures, Objective::Hota, &alike()).with_all, 1);
        assert_eq!(leave_one_out(&figures, Objective::Idf1, &alike()).with_all, 0);
        assert_eq!(leave_one_out(&figures, Objective::Mota, &alike()).with_all, 0);
    }

    #[test]
    fn of_equals_the_first_is_chosen() {
        let figures = table(&[[0.5, 0.6, 0.7], [0.7, 0.6, 0.5], [0.5, 0.6, 0.7]]);
        assert_eq!(leave_one_out(&figures, Objective::Hota, &alike()).with_all, 0);
    }

    #[test]
    fn means_weigh_equally() {
        let m = mean(&[of(0.2), of(0.4)]);
        let expected = [0.3, 0.7, -0.3, 0.3, 0.5];
        assert!(all(&m).iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{m:?}");
        assert_eq!(mean(&[]), Figures::default());
    }

    #[test]
    fn a_log_without_people_has_no_figures() {
        let scores = Scores {
            hota: Some(0.1),
            ass_a: Some(0.6),
            inherited_ids: 3,
            idf1: Some(0.2),
            mota: Some(0.3),
            fp_per_frame: Some(0.4),
            recall: Some(0.5),
            truths: 7,
            ..Scores::default()
        };
        let figures = Figures::of(&scores).unwrap();
        assert_eq!((all(&figures), figures.people), ([0.1, 0.2, 0.3, 0.4, 0.5], 7));
        assert_eq!((figures.ass_a, figures.inherited), (0.6, 3));
        assert_eq!(Figures::of(&Scores { hota: None, ..scores }), None);
    }
}
