//! Training of one stage: boosted trees over random features.

use tagalong_learn::boost::{self, Boosting, Levels, Question};
use tagalong_learn::mix;

use super::patch::Patch;
use crate::compiled::{corners, haar, rectangles};
use crate::{Cascade, Feature, Next, Node, Part, Split, Stage, Training, Tree};

/// Columns and rows of the kinds of features: pairs, triples, chequered.
const KINDS: [(usize, usize); 5] = [(2, 1), (1, 2), (3, 1), (1, 3), (2, 2)];
/// Least area of a block, pixels: smaller ones are noise.
const LEAST_BLOCK: usize = 4;

/// Training samples of a stage.
pub(super) struct Samples<'a> {
    pub(super) faces: &'a [Patch],
    pub(super) others: &'a [Patch],
}

impl<'a> Samples<'a> {
    fn all(&self) -> impl Iterator<Item = &'a Patch> + use<'a> {
        self.faces.iter().chain(self.others)
    }
}

/// Generates random features, and computes their values in all samples.
fn drawn_features(samples: &Samples<'_>, training: &Training, seed: u64) -> (Vec<Feature>, Levels) {
    let Training { side, features, .. } = *training;
    let drawn: Vec<Feature> = (0..features as u64).map(|i| drawn(side, mix(seed ^ i))).collect();
    let patches: Vec<&Patch> = samples.all().collect();
    let mut table = Levels::new(patches.len());
    for feature in &drawn {
        if let (Feature::Haar(parts), Some(any)) = (feature, patches.first()) {
            let parts = rectangles(parts, |part| corners(part, &any.level));
            table.push(patches.iter().map(|p| haar(&parts, p.level.sums()) * p.contrast));
        }
    }
    (drawn, table)
}

/// Generates a random feature.
fn drawn(side: usize, seed: u64) -> Feature {
    let mut state = seed;
    loop {
        let (columns, rows) = KINDS[next_below(&mut state, KINDS.len())];
        let width = 1 + next_below(&mut state, side / columns);
        let height = 1 + next_below(&mut state, side / rows);
        if width * height < LEAST_BLOCK {
            continue;
        }
        let x = next_below(&mut state, side - columns * width + 1);
        let y = next_below(&mut state, side - rows * height + 1);
        return haar_feature((columns, rows), Part { x, y, width, height });
    }
}

/// Draws a number below `n`.
fn next_below(state: &mut u64, n: usize) -> usize {
    *state = mix(*state);
    (*state % n as u64) as usize
}

/// Returns a feature with weight -1 for all blocks, and a positive weight for one block, or for two
/// of them crosswise, that balances it.
fn haar_feature((columns, rows): (usize, usize), first: Part) -> Feature {
    let [below, right, diagonal] = [(0, 1), (1, 0), (1, 1)].map(|(x, y)| Part {
        x: first.x + x * first.width,
        y: first.y + y * first.height,
        ..first
    });
    let whole = Part { width: columns * first.width, height: rows * first.height, ..first };
    let weight = (columns * rows) as f32;
    Feature::Haar(match (columns, rows) {
        (2, 2) => vec![(whole, -1.0), (first, 2.0), (diagonal, 2.0)],
        (1, _) => vec![(whole, -1.0), (below, weight)],
        _ => vec![(whole, -1.0), (right, weight)],
    })
}

/// Adds a stage to a cascade.
pub(super) fn stage(cascade: &mut Cascade, samples: &Samples<'_>, training: &Training, seed: u64) {
    let (features, table) = drawn_features(samples, training, seed);
    let faces = samples.faces.len();
    let mut boosting = Boosting::new(&table, (0..table.samples()).map(|i| i < faces));
    let all: Vec<usize> = (0..table.features()).collect();
    let mut built = Stage { threshold: 0.0, trees: Vec::new() };
    while built.trees.len() < training.max_trees {
        let tree = boosting.grow(&all, training.depth);
        built.trees.push(kept(&tree, &features, cascade));
        let (of_faces, of_others) = boosting.sums().split_at(faces);
        built.threshold = passed_by(of_faces, training.min_hit_rate);
        let passed = of_others.iter().filter(|sum| **sum >= built.threshold).count();
        if passed as f64 <= training.max_false_alarm * of_others.len() as f64 {
            break;
        }
    }
    cascade.stages.push(built);
}

/// Converts a tree to one of the cascade, and adds its features.
fn kept(tree: &[Question], features: &[Feature], cascade: &mut Cascade) -> Tree {
    fn next(next: boost::Next) -> Next {
        match next {
            boost::Next::Question(to) => Next::Node(to),
            boost::Next::Leaf(value) => Next::Leaf(value),
        }
    }
    tree.iter()
        .map(|question| {
            cascade.features.push(features[question.feature].clone());
            let split = Split::Below(question.below);
            Node { feature: cascade.features.len() - 1, split, next: question.next.map(next) }
        })
        .collect()
}

/// Returns the largest threshold that this part of the sums reaches.
fn passed_by(sums: &[f32], part: f64) -> f32 {
    let mut sorted = sums.to_vec();
    sorted.sort_by(f32::total_cmp);
    let may_fail = ((1.0 - part) * sorted.len() as f64) as usize;
    // The scanner may add the values in another order, with other rounding errors.
    sorted[may_fail.min(sorted.len() - 1)] - 1e-4
}

#[cfg(test)]
mod tests {
    use super::*;

    fn part(x: usize, y: usize, width: usize, height: usize) -> Part {
        Part { x, y, width, height }
    }

    #[test]
    fn the_blocks_of_a_feature_lie_side_by_side_and_balance() {
        fn of(kind: (usize, usize)) -> Vec<(Part, f32)> {
            match haar_feature(kind, part(1, 2, 3, 4)) {
                Feature::Haar(parts) => parts,
                other => panic!("{other:?}"),
            }
        }

        assert_eq!(of((2, 1)), [(part(1, 2, 6, 4), -1.0), (part(4, 2, 3, 4), 2.0)]);
        assert_eq!(of((1, 2)), [(part(1, 2, 3, 8), -1.0), (part(1, 6, 3, 4), 2.0)]);
        assert_eq!(of((3, 1)), [(part(1, 2, 9, 4), -1.0), (part(4, 2, 3, 4), 3.0)]);
        assert_eq!(of((1, 3)), [(part(1, 2, 3, 12), -1.0), (part(1, 6, 3, 4), 3.0)]);
        let crosswise =
            [(part(1, 2, 6, 8), -1.0), (part(1, 2, 3, 4), 2.0), (part(4, 6, 3, 4), 2.0)];
        assert_eq!(of((2, 2)), crosswise);
    }

    #[test]
    fn drawn_features_are_everywhere_in_the_window_and_of_all_kinds() {
        let mut triples = 0;
        let mut crosswise = 0;
        let mut borders = [0; 4];
        for seed in 0..1000 {
            let Feature::Haar(parts) = drawn(20, mix(seed)) else { panic!() };
            let whole = parts[0].0;
            let block = parts[1].0;
            assert!(whole.x + whole.width <= 20 && whole.y + whole.height <= 20, "{whole:?}");
            assert!(block.width * block.height >= LEAST_BLOCK, "{block:?}");
            triples += usize::from(parts[1].1 == 3.0);
            crosswise += usize::from(parts.len() == 3);
            let at = [
                whole.x == 0,
                whole.y == 0,
                whole.x + whole.width == 20,
                whole.y + whole.height == 20,
            ];
            at.iter().zip(&mut borders).for_each(|(is, count)| *count += usize::from(*is));
        }
        // Two of the five kinds have three blocks, and one has four.
        assert!((300..500).contains(&triples) && (130..270).contains(&crosswise));
        assert!(borders.iter().all(|count| *count > 50), "{borders:?}");
    }

    #[test]
    fn a_threshold_lets_the_wanted_part_pass() {
        let sums = [5.0, 1.0, 3.0, 2.0];
        assert!((passed_by(&sums, 1.0) - 0.9999).abs() < 1e-6);
        assert!((passed_by(&sums, 0.75) - 1.9999).abs() < 1e-6);
        assert!((passed_by(&sums, 0.0) - 4.9999).abs() < 1e-6);
    }
}
