use crate::{Example, logistic};

/// Log-odds as a linear function of the decision value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Log-odds per unit of the decision value.
    pub slope: f64,
    /// Log-odds of the decision value 0.
    pub offset: f64,
}

/// Fits Platt's logistic calibration with smoothed targets (Platt 1999). Both classes have equal
/// weight, so that the line gives the log-likelihood ratio without the prior; `linfa`'s Platt
/// scaling, which has no weights, gives the same line if both classes are equally frequent. The
/// values have to come from data to which the classifier was not fitted.
pub fn platt(values: &[(f64, bool)]) -> Line {
    let people = values.iter().filter(|(_, is_person)| *is_person).count() as f64;
    let others = values.len() as f64 - people;
    let examples: Vec<Example<2>> = values
        .iter()
        .map(|&(value, is_person)| {
            let count = if is_person { people } else { others };
            // Platt's smoothing: targets short of 0 and 1 keep the slope finite for separable
            // values.
            let sure = (count + 1.0) / (count + 2.0);
            let target = if is_person { sure } else { 1.0 - sure };
            Example { features: [value, 1.0], target, weight: 0.5 / count.max(1.0) }
        })
        .collect();
    let [slope, offset] = logistic(&examples, 1e-9);
    Line { slope, offset }
}

/// Fits a rising calibration of probabilities by isotonic regression (Zadrozny and Elkan 2002): the
/// probabilities are binned, adjacent bins with decreasing shares are merged, and each remaining
/// bin gives a pair of its mean probability and the share that is true.
///
/// ```
/// let stated = [(0.25, false), (0.25, false), (0.75, true), (0.75, false)];
/// assert_eq!(tagalong_learn::isotonic(&stated, 2), [[0.25, 0.0], [0.75, 0.5]]);
/// ```
pub fn isotonic(stated: &[(f64, bool)], steps: usize) -> Vec<[f64; 2]> {
    let mut counted = vec![Step::default(); steps.max(1)];
    let last = counted.len() - 1;
    for (probability, is_true) in stated {
        let at = ((probability * steps as f64) as usize).min(last);
        counted[at].add(Step {
            count: 1.0,
            sum: *probability,
            hits: f64::from(u8::from(*is_true)),
        });
    }
    let mut merged: Vec<Step> = Vec::new();
    for step in counted.into_iter().filter(|step| step.count > 0.0) {
        let mut step = step;
        // The pool-adjacent-violators algorithm: equal shares stay apart.
        while let Some(before) = merged.pop_if(|before| before.share() > step.share()) {
            step.add(before);
        }
        merged.push(step);
    }
    merged.iter().map(|step| [step.sum / step.count, step.share()]).collect()
}

/// Bin of the calibration.
#[derive(Clone, Copy, Debug, Default)]
struct Step {
    count: f64,
    sum: f64,
    hits: f64,
}

impl Step {
    fn add(&mut self, other: Self) {
        self.count += other.count;
        self.sum += other.sum;
        self.hits += other.hits;
    }

    /// Returns the share that is true.
    fn share(&self) -> f64 {
        self.hits / self.count
    }
}

#[cfg(test)]
mod tests {
    use linfa::ParamGuard as _;
    use linfa::composing::platt_scaling::{Platt, platt_newton_method};
    use ndarray::Array1;

    use super::*;

    #[test]
    fn the_line_finds_the_log_odds_that_the_values_were_drawn_from() {
        // Of 1,000 samples at each value, the number of people is that of log-odds 2 f - 1.
        let values: Vec<(f64, bool)> = (-20..=20)
            .flat_map(|k| {
                let f = f64::from(k) / 10.0;
                let people = (1000.0 / (1.0 + (1.0 - 2.0 * f).exp())).round() as usize;
                (0..1000).map(move |n| (f, n < people))
            })
            .collect();
        let line = platt(&values);
        let people = values.iter().filter(|v| v.1).count() as f64;
        let prior = (people / (values.len() as f64 - people)).ln();
        assert!((line.slope - 2.0).abs() < 0.02, "{line:?}");
        assert!((line.offset - (-1.0 - prior)).abs() < 0.05, "{line:?}");
    }

    /// The reference: `linfa`'s line is that of the probability of the negative class.
    #[test]
    fn of_balanced_classes_the_line_is_that_of_linfa() {
        let values: Vec<(f64, bool)> = (0..400)
            .map(|k: u64| {
                let noise = tagalong_math::mix(k) as f64 / u64::MAX as f64;
                (4.0 * noise - if k.is_multiple_of(2) { 1.0 } else { 3.0 }, k.is_multiple_of(2))
            })
            .collect();
        let params = Platt::<f64, ()>::params().check().unwrap();
        let decisions: Array1<f64> = values.iter().map(|v| v.0).collect();
        let truth: Array1<bool> = values.iter().map(|v| v.1).collect();
        let found = platt_newton_method(decisions.view(), truth.view(), &params).unwrap();
        let line = platt(&values);
        assert!((line.slope + found.0).abs() < 1e-3, "{line:?} {found:?}");
        assert!((line.offset + found.1).abs() < 1e-3, "{line:?} {found:?}");
        assert!(line.slope > 0.5, "{line:?}");
    }

    #[test]
    fn shares_that_fall_are_merged_with_their_neighbours() {
        fn all(probability: f64, trues: usize, count: usize) -> impl Iterator<Item = (f64, bool)> {
            (0..count).map(move |k| (probability, k < trues))
        }
        let stated: Vec<(f64, bool)> = all(0.1, 1, 10)
            .chain(all(0.4, 6, 10))
            .chain(all(0.6, 4, 10))
            .chain(all(1.0, 9, 10))
            .collect();
        let pairs = isotonic(&stated, 5);
        let wanted = [[0.1, 0.1], [0.5, 0.5], [1.0, 0.9]];
        assert_eq!(pairs.len(), 3, "{pairs:?}");
        for (pair, wanted) in pairs.iter().zip(wanted) {
            assert!((pair[0] - wanted[0]).abs() < 1e-9 && (pair[1] - wanted[1]).abs() < 1e-9);
        }
        assert_eq!(isotonic(&[], 5), Vec::<[f64; 2]>::new());
    }

    #[test]
    fn separable_values_do_not_give_certainty() {
        let values: Vec<(f64, bool)> =
            (0..50).map(|k| (if k % 2 == 0 { 1.0 } else { -1.0 }, k % 2 == 0)).collect();
        let line = platt(&values);
        assert!(line.slope.is_finite() && line.slope > 1.0 && line.slope < 5.0, "{line:?}");
    }

    #[test]
    fn values_that_say_nothing_give_no_evidence() {
        let values: Vec<(f64, bool)> = (0..60).map(|k| (0.3, k % 3 == 0)).collect();
        let line = platt(&values);
        assert!((line.slope * 0.3 + line.offset).abs() < 0.05, "{line:?}");
    }
}
