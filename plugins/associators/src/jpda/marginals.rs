//! Marginal probabilities of all joint events.

/// Returns for each track the probabilities of its detections, from `likelihoods[track][detection]`
/// relative to a miss of that track, which counts 1. A joint event gives each track at most one
/// detection and each detection to at most one track; its weight is the product of its parts.
pub(crate) fn marginals(likelihoods: &[Vec<f64>], detections: usize) -> Vec<Vec<f64>> {
    let ahead = sums(likelihoods.iter(), detections);
    let mut behind = sums(likelihoods.iter().rev(), detections);
    behind.reverse();
    let full = (1_usize << detections) - 1;
    let total: f64 = ahead[likelihoods.len()].iter().sum();
    let mut weights = vec![vec![0.0; detections]; likelihoods.len()];
    for (track, row) in weights.iter_mut().enumerate() {
        let used = &ahead[track];
        for (detection, weight) in row.iter_mut().enumerate() {
            let bit = 1 << detection;
            let events = (0..=full)
                .filter(|set| set & bit == 0)
                .map(|set| used[set] * sum_of_subsets(&behind[track + 1], full & !(set | bit)));
            *weight = likelihoods[track][detection] * events.sum::<f64>() / total;
        }
    }
    weights
}

/// Returns, for 0, 1, ... tracks in this order, the sum of the weights of all events of these
/// tracks, by the set of detections that they use.
fn sums<'a>(rows: impl Iterator<Item = &'a Vec<f64>>, detections: usize) -> Vec<Vec<f64>> {
    let mut first = vec![0.0; 1 << detections];
    first[0] = 1.0;
    let mut all = vec![first];
    for row in rows {
        let before = &all[all.len() - 1];
        let mut after = before.clone();
        for (set, weight) in before.iter().enumerate().filter(|(_, weight)| **weight > 0.0) {
            for (detection, likelihood) in row.iter().enumerate() {
                if set & (1 << detection) == 0 {
                    after[set | (1 << detection)] += weight * likelihood;
                }
            }
        }
        all.push(after);
    }
    all
}

/// Returns the sum over all subsets of `set`.
fn sum_of_subsets(values: &[f64], set: usize) -> f64 {
    let mut sum = values[0];
    let mut subset = set;
    while subset != 0 {
        sum += values[subset];
        subset = (subset - 1) & set;
    }
    sum
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// All joint events, one after the other.
    fn by_enumeration(likelihoods: &[Vec<f64>], detections: usize) -> Vec<Vec<f64>> {
        let mut sums = vec![vec![0.0; detections]; likelihoods.len()];
        let mut total = 0.0;
        let mut event = vec![None; likelihoods.len()];
        enumerate(likelihoods, detections, 0, &mut event, &mut |event, weight| {
            total += weight;
            for (track, detection) in event.iter().enumerate() {
                if let Some(detection) = detection {
                    sums[track][*detection] += weight;
                }
            }
        });
        sums.iter_mut().flatten().for_each(|sum| *sum /= total);
        sums
    }

    fn enumerate(
        likelihoods: &[Vec<f64>],
        detections: usize,
        track: usize,
        event: &mut Vec<Option<usize>>,
        visit: &mut impl FnMut(&[Option<usize>], f64),
    ) {
        if track == likelihoods.len() {
            let parts = event.iter().enumerate();
            let weight = parts.map(|(t, d)| d.map_or(1.0, |d| likelihoods[t][d])).product();
            return visit(event, weight);
        }
        event[track] = None;
        enumerate(likelihoods, detections, track + 1, event, visit);
        for detection in 0..detections {
            if !event[..track].contains(&Some(detection)) {
                event[track] = Some(detection);
                enumerate(likelihoods, detections, track + 1, event, visit);
            }
        }
        event[track] = None;
    }

    proptest! {
        #[test]
        fn the_sums_over_subsets_are_those_over_all_events(
            rows in prop::collection::vec(prop::collection::vec(0.0..9.0f64, 4), 1..5),
        ) {
            let fast = marginals(&rows, 4);
            let slow = by_enumeration(&rows, 4);
            for (a, b) in fast.iter().flatten().zip(slow.iter().flatten()) {
                prop_assert!((a - b).abs() < 1e-12, "{fast:?} {slow:?}");
            }
        }
    }

    #[test]
    fn one_track_and_one_detection_weigh_likelihood_against_miss() {
        assert_eq!(marginals(&[vec![3.0]], 1), [[0.75]]);
    }
}
