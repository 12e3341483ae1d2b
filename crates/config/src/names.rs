/// Returns the name among `available` that is nearest to the mistyped `wanted`, if fewer than half
/// of its letters differ.
///
/// ```
/// use tagalong_config::nearest;
/// assert_eq!(nearest("kalmann", ["ekf", "kalman"]), Some("kalman"));
/// assert_eq!(nearest("zebra", ["ekf", "kalman"]), None);
/// ```
pub fn nearest<'a>(wanted: &str, available: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let wanted = wanted.to_lowercase();
    available
        .into_iter()
        .map(|name| (edit_distance(&wanted, &name.to_lowercase()), name))
        .filter(|(distance, name)| 2 * distance < name.chars().count().max(wanted.chars().count()))
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, name)| name)
}

/// Computes the Levenshtein distance, one row at a time.
fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, ca) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, cb) in b.iter().enumerate() {
            let substituted = diagonal + usize::from(ca != *cb);
            diagonal = row[j + 1];
            row[j + 1] = substituted.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_as_far_apart_as_letters_have_to_be_changed() {
        let apart = [("", "abc"), ("abc", "abc"), ("abc", ""), ("kitten", "sitting"), ("ab", "ba")];
        assert_eq!(apart.map(|(a, b)| edit_distance(a, b)), [3, 0, 3, 3, 2]);
    }

    #[test]
    fn a_name_of_which_half_is_wrong_was_not_meant() {
        assert_eq!(nearest("abxx", ["abcd"]), None);
        assert_eq!(nearest("abxxe", ["abcde"]), Some("abcde"));
        assert_eq!(nearest("EKF", ["ekf"]), Some("ekf"), "however it is written");
    }
}
