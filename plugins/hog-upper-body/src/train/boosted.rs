//! Training of boosted trees on the values of windows.

use tagalong_learn::boost::{Boosting, Levels, Next, Question};
use tagalong_learn::mix;

use super::svm::Windows;
use crate::Tree;

/// Fits `count` trees to the windows of some rooms, each of two questions about some of `numbers`
/// randomly sampled values.
pub(crate) fn boosted(
    windows: &Windows,
    of_room: &dyn Fn(usize) -> bool,
    count: usize,
    numbers: usize,
    seed: u64,
) -> Vec<Tree> {
    let width = windows.width();
    let chosen: Vec<usize> = (0..windows.len()).filter(|i| of_room(windows.room[*i])).collect();
    let mut table = Levels::new(chosen.len());
    for number in 0..width {
        table.push(chosen.iter().map(|i| windows.numbers[i * width + number]));
    }
    let mut boosting = Boosting::new(&table, chosen.iter().map(|i| windows.is_person[*i]));
    let mut trees = Vec::with_capacity(count);
    for tree in 0..count {
        let seed = mix(seed ^ tree as u64);
        let drawn: Vec<usize> =
            (0..numbers).map(|k| (mix(seed ^ k as u64) % width as u64) as usize).collect();
        trees.push(flat(&boosting.grow(&drawn, 2)));
    }
    trees
}

/// Converts a tree to the form that is run; a leaf in place of a question becomes a question with
/// the same value for both answers.
fn flat(questions: &[Question]) -> Tree {
    fn leaf(next: &Next) -> f32 {
        if let Next::Leaf(value) = next { *value } else { 0.0 }
    }

    fn put_question(tree: &mut Tree, at: usize, question: &Question) {
        (tree.numbers[at], tree.below[at]) = (question.feature as u16, question.below);
    }

    let mut tree = Tree::default();
    put_question(&mut tree, 0, &questions[0]);
    for (side, next) in questions[0].next.iter().enumerate() {
        let pair = match next {
            Next::Question(to) => {
                put_question(&mut tree, 1 + side, &questions[*to]);
                questions[*to].next.map(|next| leaf(&next))
            }
            end => [leaf(end); 2],
        };
        tree.values[2 * side..2 * side + 2].copy_from_slice(&pair);
    }
    tree
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_leaf_in_place_of_a_question_answers_both_ways_alike() {
        let second = Question { feature: 5, below: 0.1, next: [Next::Leaf(-1.0), Next::Leaf(2.0)] };
        for (next, numbers, below, values) in [
            (
                [Next::Question(1), Next::Leaf(0.75)],
                [3, 5, 0],
                [0.5, 0.1, 0.0],
                [-1.0, 2.0, 0.75, 0.75],
            ),
            (
                [Next::Leaf(0.75), Next::Question(1)],
                [3, 0, 5],
                [0.5, 0.0, 0.1],
                [0.75, 0.75, -1.0, 2.0],
            ),
        ] {
            let tree = flat(&[Question { feature: 3, below: 0.5, next }, second]);
            assert_eq!((tree.numbers, tree.below, tree.values), (numbers, below, values));
        }
    }
}
