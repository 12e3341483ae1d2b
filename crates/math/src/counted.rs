/// Returns a number with its noun: "1 frame", "2 frames". The plural of the noun ends in `s`.
pub fn counted(count: impl TryInto<u64>, noun: &str) -> String {
    // A number too large for u64 is not 1, so it takes the plural.
    let count = count.try_into().unwrap_or(u64::MAX);
    let ending = if count == 1 { "" } else { "s" };
    format!("{count} {noun}{ending}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_of_a_thing_is_told_in_the_singular() {
        let told = [0_usize, 1, 2].map(|count| counted(count, "frame"));
        assert_eq!(told, ["0 frames", "1 frame", "2 frames"]);
        assert_eq!(counted(1_u64, "task"), "1 task");
    }
}
