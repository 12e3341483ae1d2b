/// Number of axes of a point: columns, and rows.
const AXES: usize = 2;

/// Splits points of a grid into islands and passes each of them to `take`, sorted row by row. At
/// least `gap - 1` whole columns or rows without a point lie between two islands; within one island
/// no such gap is left.
///
/// Work around a few scattered points is then done island by island, not over the bounding
/// rectangle of all of them.
pub fn islands<T>(
    points: &mut [T],
    at: impl Fn(&T) -> [i64; AXES] + Copy,
    gap: i64,
    take: &mut impl FnMut(&[T]),
) {
    cut(points, at, gap, 1, 0, take);
}

/// Splits along one axis and then along the other, until both have `failed`.
fn cut<T>(
    points: &mut [T],
    at: impl Fn(&T) -> [i64; AXES] + Copy,
    gap: i64,
    axis: usize,
    failed: usize,
    take: &mut impl FnMut(&[T]),
) {
    if failed == AXES {
        points.sort_unstable_by_key(|point| (at(point)[1], at(point)[0]));
        return take(points);
    }
    points.sort_unstable_by_key(|point| at(point)[axis]);
    let count = points.len();
    for part in points.chunk_by_mut(|a, b| at(b)[axis] - at(a)[axis] < gap) {
        // A cut along one axis can open a gap along the other, so both are tried again.
        let failed = if part.len() == count { failed + 1 } else { 1 };
        cut(part, at, gap, 1 - axis, failed, take);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn of(points: &[[i64; 2]], gap: i64) -> Vec<Vec<[i64; 2]>> {
        let mut points = points.to_vec();
        let mut found = Vec::new();
        islands(&mut points, |point| *point, gap, &mut |island| found.push(island.to_vec()));
        found
    }

    fn bounds(points: &[[i64; 2]], axis: usize) -> (i64, i64) {
        let along = points.iter().map(|point| point[axis]);
        (along.clone().min().unwrap(), along.max().unwrap())
    }

    /// Returns true if an empty strip goes through all points, tested position by position.
    fn can_be_cut(points: &[[i64; 2]], gap: i64) -> bool {
        (0..2).any(|axis| {
            let (first, last) = bounds(points, axis);
            (first + 1..last - gap + 2).any(|start| {
                (start..start + gap - 1)
                    .all(|place| points.iter().all(|point| point[axis] != place))
            })
        })
    }

    proptest! {
        #[test]
        fn islands_hold_all_points_and_nothing_is_left_to_cut(
            points in prop::collection::vec(prop::array::uniform2(0..40i64), 0..40),
            gap in 2..9i64,
        ) {
            let found = of(&points, gap);
            let mut all = found.concat();
            let mut points = points;
            all.sort();
            points.sort();
            prop_assert_eq!(all, points);
            for (index, island) in found.iter().enumerate() {
                prop_assert!(island.is_sorted_by_key(|[x, y]| (*y, *x)));
                prop_assert!(!can_be_cut(island, gap));
                for other in &found[index + 1..] {
                    let is_apart = (0..2).any(|axis| {
                        let a = bounds(island, axis);
                        let b = bounds(other, axis);
                        b.0 - a.1 >= gap || a.0 - b.1 >= gap
                    });
                    prop_assert!(is_apart, "{island:?} {other:?}");
                }
            }
        }
    }

    #[test]
    fn two_people_beside_each_other_are_two_islands() {
        assert_eq!(of(&[[9, 0], [0, 0], [1, 5]], 4), [vec![[0, 0]], vec![[9, 0]], vec![[1, 5]]]);
        assert_eq!(of(&[], 4), Vec::<Vec<[i64; 2]>>::new());
    }
}
