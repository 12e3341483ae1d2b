//! An associator: the nearest pair first, then the nearest of the remaining ones.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::{Associations, Associator, Detection, Gate, Track};

/// Settings of `own-nearest`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Largest distance of a pair on the floor, m.
    pub gate_m: f64,
}

impl Default for Config {
    fn default() -> Self {
        Self { gate_m: 0.7 }
    }
}

/// Associator by distance.
pub struct OwnNearest(pub Config);

fn distance(track: &Track, detection: &Detection) -> f64 {
    (track.estimate.person.position - detection.position).xy().norm()
}

impl Associator for OwnNearest {
    fn fits(&self, track: &Track, detection: &Detection, _: &Gate) -> bool {
        distance(track, detection) <= self.0.gate_m
    }

    fn associate(&mut self, tracks: &[Track], found: &[Detection], gate: &Gate) -> Associations {
        let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
        for (row, track) in tracks.iter().enumerate() {
            let near = found.iter().enumerate().filter(|(_, d)| gate.admits(track, d));
            let near = near.filter(|(_, d)| self.fits(track, d, gate));
            pairs.extend(near.map(|(column, d)| (distance(track, d), row, column)));
        }
        // Ties are broken by index: the same input has to give the same answer.
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)).then(a.2.cmp(&b.2)));
        let mut given = vec![None; tracks.len()];
        for (_, row, column) in pairs {
            if given[row].is_none() && !given.contains(&Some(column)) {
                given[row] = Some(column);
            }
        }
        Associations::one_to_one(given)
    }
}
