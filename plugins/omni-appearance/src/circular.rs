//! Columns of a panorama that wraps around.

/// A run of columns: the first, from 0 up to the width, and their number. It continues beyond the
/// last column at the first one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Run {
    /// First column.
    pub first: usize,
    /// Number of columns, at most the width.
    pub length: usize,
}

impl Run {
    /// Returns the columns, each below `width`.
    pub fn columns(&self, width: usize) -> impl Iterator<Item = usize> + use<> {
        let first = self.first;
        let length = self.length;
        (0..length).map(move |i| (first + i) % width)
    }
}

/// Returns the runs of columns that are `true`, in the order of their first columns; gaps of up to
/// `bridge` columns belong to the run around them.
///
/// ```
/// use tagalong_omni_appearance::circular::{Run, runs};
/// let on = [true, false, false, true, false, true, true];
/// assert_eq!(runs(&on, 1), [Run { first: 3, length: 5 }]);
/// ```
pub fn runs(on: &[bool], bridge: usize) -> Vec<Run> {
    let width = on.len();
    let mut found: Vec<Run> = Vec::new();
    for (column, _) in on.iter().enumerate().filter(|(_, on)| **on) {
        match found.last_mut() {
            Some(run) if column <= run.first + run.length + bridge => {
                run.length = column + 1 - run.first;
            }
            _ => found.push(Run { first: column, length: 1 }),
        }
    }
    join_across_the_seam(&mut found, width, bridge);
    found
}

fn join_across_the_seam(found: &mut Vec<Run>, width: usize, bridge: usize) {
    let (Some(first), Some(last)) = (found.first().copied(), found.last().copied()) else { return };
    let gap = width + first.first - last.first - last.length;
    if gap > bridge {
        return;
    }
    if found.len() == 1 {
        found[0] = Run { first: 0, length: width };
        return;
    }
    found.remove(0);
    if let Some(last) = found.last_mut() {
        last.length += gap + first.length;
    }
}

/// Returns the weighted mean column of a run, from 0 up to `width`; the middle of the run if there
/// is no weight.
pub fn mean(run: &Run, width: usize, weight: impl Fn(usize) -> f64) -> f64 {
    // Offsets from the start of the run do not jump at the seam, as column numbers do.
    let mut sum = 0.0;
    let mut total = 0.0;
    for (offset, column) in run.columns(width).enumerate() {
        sum += offset as f64 * weight(column);
        total += weight(column);
    }
    let offset = if total > 0.0 { sum / total } else { 0.5 * (run.length as f64 - 1.0) };
    (run.first as f64 + offset).rem_euclid(width as f64)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Marks the columns of all runs, gaps included, by trying every gap.
    fn covered(on: &[bool], bridge: usize) -> Vec<bool> {
        let width = on.len();
        let mut all = on.to_vec();
        for start in 0..width {
            for length in 1..=bridge.min(width) {
                let gap: Vec<usize> = (0..length).map(|i| (start + i) % width).collect();
                let before = on[(start + width - 1) % width];
                if before && on[(start + length) % width] {
                    gap.iter().for_each(|column| all[*column] = true);
                }
            }
        }
        all
    }

    proptest! {
        #[test]
        fn runs_cover_what_is_on_and_short_gaps(
            on in prop::collection::vec(prop::bool::weighted(0.4), 1..40), bridge in 0..5usize,
        ) {
            let width = on.len();
            let found = runs(&on, bridge);
            let mut seen = vec![0; width];
            for run in &found {
                prop_assert!(run.first < width && run.length <= width);
                run.columns(width).for_each(|column| seen[column] += 1);
            }
            let expected = covered(&on, bridge);
            for (column, count) in seen.iter().enumerate() {
                prop_assert_eq!(*count == 1, expected[column], "{:?}", found);
                prop_assert!(*count < 2);
            }
        }

        #[test]
        fn turning_the_image_turns_runs_and_means(
            on in prop::collection::vec(prop::bool::weighted(0.3), 12..40), turn in 0..40usize,
        ) {
            let width = on.len();
            let turned: Vec<bool> = (0..width).map(|c| on[(c + turn) % width]).collect();
            let before = runs(&on, 2);
            let after = runs(&turned, 2);
            prop_assert_eq!(before.len(), after.len());
            if before.len() == 1 && before[0].length < width {
                let a = mean(&before[0], width, |c: usize| if on[c] { 1.0 } else { 0.0 });
                let b = mean(&after[0], width, |c: usize| if turned[c] { 1.0 } else { 0.0 });
                let off = (a - b - turn as f64).rem_euclid(width as f64);
                prop_assert!(off < 1e-9 || width as f64 - off < 1e-9, "{a} {b} {turn}");
            }
        }
    }

    #[test]
    fn nothing_and_everything() {
        assert_eq!(runs(&[false; 5], 9), []);
        assert_eq!(runs(&[true; 5], 0), [Run { first: 0, length: 5 }]);
        assert_eq!(runs(&[], 3), []);
        assert_eq!(runs(&[false, true, false], 3), [Run { first: 0, length: 3 }]);
    }
}
