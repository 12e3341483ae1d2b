/// Returns the probability that a person has a larger value than another candidate (area under the
/// ROC curve); 0.5 where one class is missing.
pub fn area(values: &[(f64, bool)]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut below = 0.0;
    let mut others = 0.0;
    let mut people = 0.0;
    for ties in sorted.chunk_by(|a, b| a.0 == b.0) {
        let here = ties.iter().filter(|(_, is_person)| *is_person).count() as f64;
        let not = ties.len() as f64 - here;
        // A tie counts as half.
        below += here * (others + 0.5 * not);
        people += here;
        others += not;
    }
    if people * others > 0.0 { below / (people * others) } else { 0.5 }
}

/// Returns the fraction of a class with a positive value.
pub fn accepted(values: &[(f64, bool)], people: bool) -> f64 {
    let of_class = values.iter().filter(|(_, is_person)| *is_person == people);
    let count = of_class.clone().count().max(1);
    of_class.filter(|(f, _)| *f > 0.0).count() as f64 / count as f64
}

#[cfg(test)]
mod tests {
    use linfa::dataset::Pr;
    use linfa::metrics::BinaryClassification as _;

    use super::*;

    /// The reference, which takes probabilities only, in single precision.
    #[test]
    fn the_area_is_that_of_linfa() {
        let values: Vec<(f64, bool)> = (0..300)
            .map(|k: u64| {
                let noise = (tagalong_math::mix(k) % 1000) as f64 / 1000.0;
                (if k.is_multiple_of(3) { noise.sqrt() } else { noise }, k.is_multiple_of(3))
            })
            .collect();
        let probabilities: Vec<Pr> = values.iter().map(|v| Pr::new(v.0 as f32)).collect();
        let truth: Vec<bool> = values.iter().map(|v| v.1).collect();
        let curve = probabilities.as_slice().roc(&truth).unwrap();
        let expected = f64::from(curve.area_under_curve());
        assert!((area(&values) - expected).abs() < 2e-3, "{} {expected}", area(&values));
        assert!(expected > 0.6, "{expected}");
    }

    #[test]
    fn the_area_counts_ordered_pairs() {
        let held_out = [(0.1, false), (0.2, true), (0.2, false), (0.9, true)];
        assert_eq!(area(&held_out), (1.5 + 2.0) / 4.0);
        assert_eq!((accepted(&held_out, true), accepted(&held_out, false)), (1.0, 1.0));
    }
}
