//! Numbers of the pairs of a person and a track that the metrics count.

use crate::prepare::Prepared;
use tagalong_math::matching::Edge;

/// All pairs of a truth and a track that have some similarity in any frame. The pairs are numbered,
/// so that counts per pair are plain lists and the inner loops need no hashing.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct PairTable {
    /// Truth and track of each pair, in ascending order.
    pub pairs: Vec<(u32, u32)>,
    /// For each pair of each frame, one after the other, its index in `pairs`.
    pub pair_of: Vec<u32>,
}

impl PairTable {
    /// Numbers the pairs of a sequence.
    pub fn new(prepared: &Prepared) -> Self {
        let tracks = prepared.track_ids.len() as u64;
        let keys: Vec<u64> = prepared
            .frames
            .iter()
            .flat_map(|frame| {
                frame.pairs.iter().map(|pair| {
                    let truth = u64::from(frame.truths[pair.row as usize]);
                    // One number for both ids, so that pairs can be sorted at once.
                    truth * tracks + u64::from(frame.tracks[pair.col as usize])
                })
            })
            .collect();
        let mut unique = keys.clone();
        unique.sort_unstable();
        unique.dedup();
        let pair_of = keys.iter().map(|&key| unique.partition_point(|&k| k < key) as u32).collect();
        let pairs = unique.into_iter().map(|key| ((key / tracks) as u32, (key % tracks) as u32));
        Self { pairs: pairs.collect(), pair_of }
    }

    /// Returns the number of frames in which each pair passes the test.
    pub(crate) fn count(&self, prepared: &Prepared, test: impl Fn(&Edge) -> bool) -> Vec<u32> {
        let mut counts = vec![0; self.pairs.len()];
        let all = prepared.frames.iter().flat_map(|frame| &frame.pairs);
        for (pair, &index) in all.zip(&self.pair_of) {
            counts[index as usize] += u32::from(test(pair));
        }
        counts
    }

    /// Returns one edge for each pair, weighted by its index.
    pub(crate) fn edges(&self, weight: impl Fn(usize) -> f64) -> Vec<Edge> {
        let pairs = self.pairs.iter().enumerate();
        pairs.map(|(index, &(row, col))| Edge { row, col, weight: weight(index) }).collect()
    }
}
