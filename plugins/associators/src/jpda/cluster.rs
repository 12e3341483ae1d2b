//! Tracks that share detections.

use std::collections::BTreeSet;

/// Tracks and detections that have to be judged together.
#[derive(Debug, PartialEq)]
pub(crate) struct Cluster {
    pub(crate) tracks: Vec<usize>,
    pub(crate) detections: Vec<usize>,
}

/// Returns the connected components of the pairs that `is_pair`; tracks without a detection
/// are in none.
pub(crate) fn clusters(
    tracks: usize,
    detections: usize,
    is_pair: impl Fn(usize, usize) -> bool,
) -> Vec<Cluster> {
    let mut open: BTreeSet<usize> = (0..tracks).collect();
    let mut found = Vec::new();
    while let Some(first) = open.pop_first() {
        let mut members = BTreeSet::from([first]);
        let mut shared = BTreeSet::new();
        let mut front = vec![first];
        while let Some(track) = front.pop() {
            for detection in (0..detections).filter(|detection| is_pair(track, *detection)) {
                if !shared.insert(detection) {
                    continue;
                }
                let joins: Vec<usize> =
                    open.iter().copied().filter(|other| is_pair(*other, detection)).collect();
                for other in joins {
                    open.remove(&other);
                    members.insert(other);
                    front.push(other);
                }
            }
        }
        if !shared.is_empty() {
            let tracks = members.into_iter().collect();
            found.push(Cluster { tracks, detections: shared.into_iter().collect() });
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tracks_that_share_detections_are_together() {
        let pairs = [(0, 0), (1, 1), (2, 0), (2, 2), (4, 1)];
        let found = clusters(5, 4, |track, detection| pairs.contains(&(track, detection)));
        let expected = [
            Cluster { tracks: vec![0, 2], detections: vec![0, 2] },
            Cluster { tracks: vec![1, 4], detections: vec![1] },
        ];
        assert_eq!(found, expected);
    }
}
