//! CLEAR MOT: matches in each frame, false positives, misses and ID switches.

use serde::{Deserialize, Serialize};

use crate::prepare::{Prepared, PreparedFrame};
use crate::ratio;
use tagalong_math::matching::{Edge, Matcher};

/// Minimum similarity of a match in CLEAR MOT and Identity.
pub const MATCH_SIMILARITY: f64 = 0.5;

/// Weight of continuing with the track of the previous frame; larger than any similarity.
const CONTINUATION: f64 = 1000.0;

/// A truth and the report that is matched with it in one frame.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Match {
    /// Index in [`PreparedFrame::truths`].
    pub row: u32,
    /// Index in [`PreparedFrame::tracks`].
    pub col: u32,
    /// Similarity of the two.
    pub similarity: f64,
}

/// The CLEAR MOT counts (Bernardin and Stiefelhagen, EURASIP JIVP 2008) with the conventions of
/// TrackEval: a match of the previous frame is kept before similarities are compared, and an ID
/// switch is counted against the last track that a truth ever had.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Clear {
    /// Matched truths.
    pub tp: u64,
    /// Truths without a report.
    #[serde(rename = "fn")]
    pub fn_: u64,
    /// Reports without a truth.
    pub fp: u64,
    /// Changes of the track that is matched with a truth.
    pub id_switches: u64,
    /// Matches of a truth with a track whose last match was another truth: the truth has inherited
    /// an ID. Two truths that swap their tracks count as two switches and two inherited IDs; a new
    /// person with the ID of a person that left counts as one inherited ID and no switch. TrackEval
    /// has no such figure.
    #[serde(default)]
    pub inherited_ids: u64,
    /// Interruptions: the number of times that a truth was matched again after a pause. As in
    /// TrackEval, a person that left the view and came back counts as well.
    pub fragmentations: u64,
    /// Truths matched in more than 80 % of their frames.
    pub mostly_tracked: u64,
    /// Truths that are neither mostly tracked nor mostly lost.
    pub partly_tracked: u64,
    /// Truths matched in less than 20 % of their frames.
    pub mostly_lost: u64,
    /// Sum of the similarities of all matches.
    pub similarity_sum: f64,
    /// Number of frames.
    pub frames: u64,
}

impl Clear {
    /// Scores one sequence; also returns the matches of each frame.
    pub fn measure(prepared: &Prepared) -> (Self, Vec<Vec<Match>>) {
        let mut run = Run::new(prepared);
        let matches: Vec<Vec<Match>> =
            prepared.frames.iter().map(|frame| run.step(frame)).collect();
        (run.finish(prepared), matches)
    }

    /// Combines the counts of several sequences.
    pub fn combine<'a>(all: impl IntoIterator<Item = &'a Self>) -> Self {
        all.into_iter().fold(Self::default(), |a, b| Self {
            tp: a.tp + b.tp,
            fn_: a.fn_ + b.fn_,
            fp: a.fp + b.fp,
            id_switches: a.id_switches + b.id_switches,
            inherited_ids: a.inherited_ids + b.inherited_ids,
            fragmentations: a.fragmentations + b.fragmentations,
            mostly_tracked: a.mostly_tracked + b.mostly_tracked,
            partly_tracked: a.partly_tracked + b.partly_tracked,
            mostly_lost: a.mostly_lost + b.mostly_lost,
            similarity_sum: a.similarity_sum + b.similarity_sum,
            frames: a.frames + b.frames,
        })
    }

    /// Returns the accuracy `(TP - FP - IDSW) / truths`: at most 1, without lower bound. Without
    /// truths the denominator is 1, as in TrackEval's combined figure (its figure for such a
    /// sequence alone is 0).
    pub fn mota(&self) -> f64 {
        ratio(self.tp as f64 - self.fp as f64 - self.id_switches as f64, self.truths())
    }

    /// Returns the precision: the mean similarity of the matches, 0 to 1.
    pub fn motp(&self) -> f64 {
        ratio(self.similarity_sum, self.tp as f64)
    }

    /// Returns the fraction of the truths that were matched.
    pub fn recall(&self) -> f64 {
        ratio(self.tp as f64, self.truths())
    }

    /// Returns the fraction of the reports that were matched.
    pub fn precision(&self) -> f64 {
        ratio(self.tp as f64, (self.tp + self.fp) as f64)
    }

    /// Returns the number of false positives per frame.
    pub fn fp_per_frame(&self) -> f64 {
        ratio(self.fp as f64, self.frames as f64)
    }

    fn truths(&self) -> f64 {
        (self.tp + self.fn_) as f64
    }
}

/// State that is carried from frame to frame.
struct Run {
    clear: Clear,
    matcher: Matcher,
    scored: Vec<Edge>,
    chosen: Vec<u32>,
    /// Last track that each truth ever had.
    last: Vec<Option<u32>>,
    /// Last truth that each track ever had.
    last_of_track: Vec<Option<u32>>,
    /// Track that each truth had in the previous frame that has any truths and reports.
    previous: Vec<Option<u32>>,
    /// The truths that have a track in `previous`.
    held: Vec<u32>,
    matched: Vec<u32>,
    starts: Vec<u32>,
}

impl Run {
    fn new(prepared: &Prepared) -> Self {
        let truths = prepared.truth_ids.len();
        Self {
            clear: Clear { frames: prepared.frames.len() as u64, ..Clear::default() },
            matcher: Matcher::new(),
            scored: Vec::new(),
            chosen: Vec::new(),
            last: vec![None; truths],
            last_of_track: vec![None; prepared.track_ids.len()],
            previous: vec![None; truths],
            held: Vec::new(),
            matched: vec![0; truths],
            starts: vec![0; truths],
        }
    }

    fn step(&mut self, frame: &PreparedFrame) -> Vec<Match> {
        let truths = frame.truths.len();
        let tracks = frame.tracks.len();
        if truths == 0 || tracks == 0 {
            // A frame without truths or without reports does not interrupt anything.
            self.clear.fp += tracks as u64;
            self.clear.fn_ += truths as u64;
            return Vec::new();
        }
        self.score_pairs(frame);
        self.matcher.best(truths, tracks, &self.scored, &mut self.chosen);
        let matches: Vec<Match> = self.chosen.iter().map(|&e| self.plain(e)).collect();
        self.count_wrong_ids(frame, &matches);
        self.remember(frame, &matches);
        self.clear.tp += matches.len() as u64;
        self.clear.fn_ += (truths - matches.len()) as u64;
        self.clear.fp += (tracks - matches.len()) as u64;
        self.clear.similarity_sum += matches.iter().map(|m| m.similarity).sum::<f64>();
        matches
    }

    fn score_pairs(&mut self, frame: &PreparedFrame) {
        // TrackEval's tolerance: a similarity of exactly one half is a match in spite of rounding.
        let enough = MATCH_SIMILARITY - f64::EPSILON;
        self.scored.clear();
        for pair in frame.pairs.iter().filter(|pair| pair.weight >= enough) {
            let truth = frame.truths[pair.row as usize] as usize;
            let goes_on = self.previous[truth] == Some(frame.tracks[pair.col as usize]);
            // A continued pair outweighs any set of new ones, as CLEAR MOT demands.
            let bonus = if goes_on { CONTINUATION } else { 0.0 };
            self.scored.push(Edge { weight: pair.weight + bonus, ..*pair });
        }
    }

    fn plain(&self, edge: u32) -> Match {
        let Edge { row, col, weight } = self.scored[edge as usize];
        let similarity = if weight > CONTINUATION { weight - CONTINUATION } else { weight };
        Match { row, col, similarity }
    }

    fn count_wrong_ids(&mut self, frame: &PreparedFrame, matches: &[Match]) {
        for m in matches {
            let truth = frame.truths[m.row as usize];
            let track = frame.tracks[m.col as usize];
            let before = self.last[truth as usize];
            self.clear.id_switches += u64::from(before.is_some_and(|t| t != track));
            let before = self.last_of_track[track as usize];
            self.clear.inherited_ids += u64::from(before.is_some_and(|t| t != truth));
        }
    }

    fn remember(&mut self, frame: &PreparedFrame, matches: &[Match]) {
        for m in matches {
            let truth = frame.truths[m.row as usize] as usize;
            self.starts[truth] += u32::from(self.previous[truth].is_none());
            self.matched[truth] += 1;
        }
        // Only a match in the previous frame continues. Older matches count for switches only.
        for truth in self.held.drain(..) {
            self.previous[truth as usize] = None;
        }
        for m in matches {
            let truth = frame.truths[m.row as usize];
            let track = frame.tracks[m.col as usize];
            self.last[truth as usize] = Some(track);
            self.last_of_track[track as usize] = Some(truth);
            self.previous[truth as usize] = Some(track);
            self.held.push(truth);
        }
    }

    fn finish(mut self, prepared: &Prepared) -> Clear {
        for (&matched, &frames) in self.matched.iter().zip(&prepared.truth_frames) {
            let fraction = f64::from(matched) / f64::from(frames);
            let clear = &mut self.clear;
            match fraction {
                // The bounds of TrackEval: above 80 % is mostly tracked, below 20 % mostly lost.
                f if f > 0.8 => clear.mostly_tracked += 1,
                f if f >= 0.2 => clear.partly_tracked += 1,
                _ => clear.mostly_lost += 1,
            }
        }
        self.clear.fragmentations =
            // The first start is no interruption.
            self.starts.iter().map(|&n| u64::from(n.saturating_sub(1))).sum();
        self.clear
    }
}
