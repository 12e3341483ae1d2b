//! People without a track in a result, and the moments that show them.

use std::collections::{BTreeMap, BTreeSet};

use tagalong_app::missed::{Missed, sentences_of};
use tagalong_report::{MissedPerson, TaskResult};

/// Adds the people that count and have no track in a frame to a result, each with its cause.
pub fn add_missed(missed: Vec<Missed>, result: &mut TaskResult) {
    let (sentences, places) = sentences_of(&missed);
    result.causes = sentences;
    for (Missed { at, person, cause }, place) in missed.into_iter().zip(places) {
        result.reasons.insert(cause.name.clone(), cause.why);
        result.missed.push(MissedPerson {
            frame: at as u64 + 1,
            person,
            other_cause: cause.test.is_none().then_some(cause.name),
            test: cause.test,
            box_px: cause.box_px,
            cause: Some(place),
        });
    }
}

/// Maximum number of moments of one task that get an image.
const MOST_MOMENTS: usize = 3;

/// Returns the frames in the middle of the longest times in which a person is missed.
pub fn moments(missed: &[MissedPerson]) -> BTreeSet<u64> {
    let mut by_person: BTreeMap<i64, Vec<u64>> = BTreeMap::new();
    for one in missed {
        by_person.entry(one.person).or_default().push(one.frame);
    }
    let mut times: Vec<(usize, u64)> = Vec::new();
    for frames in by_person.values() {
        let runs = frames.chunk_by(|a, b| b - a == 1);
        times.extend(runs.map(|run| (run.len(), run[run.len() / 2])));
    }
    times.sort_by_key(|(length, frame)| (std::cmp::Reverse(*length), *frame));
    times.into_iter().take(MOST_MOMENTS).map(|(_, frame)| frame).collect()
}

#[cfg(test)]
mod tests {
    use tagalong_app::missed::Cause;

    use super::*;

    #[test]
    fn a_sentence_is_kept_once_and_a_cause_without_a_test_has_a_name() {
        fn cause(test: Option<&str>, name: &str, text: &str) -> Cause {
            Cause {
                test: test.map(str::to_owned),
                name: name.into(),
                why: format!("why {name}"),
                text: text.into(),
                ..Cause::default()
            }
        }

        let size = cause(Some("size"), "size", "No track began: size.");
        let far = cause(None, "too far", "No track began: too far.");
        let causes = [size.clone(), far, size].into_iter().enumerate();
        let causes = causes.map(|(at, cause)| Missed { at, person: 4, cause }).collect();
        let mut result = TaskResult::default();
        add_missed(causes, &mut result);
        assert_eq!(result.causes, ["No track began: size.", "No track began: too far."]);
        let told: Vec<_> = result.missed.iter().map(|m| (m.frame, m.cause, m.name())).collect();
        assert_eq!(
            told,
            [(1, Some(0), Some("size")), (2, Some(1), Some("too far")), (3, Some(0), Some("size"))]
        );
        assert_eq!(result.missed[1].test, None);
        assert_eq!(result.reasons["too far"], "why too far");
    }

    #[test]
    fn the_longest_misses_get_images() {
        let mut missed = Vec::new();
        for (person, frames) in [(1, 5..8), (1, 20..21), (2, 30..40), (2, 50..52), (3, 7..9)] {
            for frame in frames {
                missed.push(MissedPerson { frame, person, ..MissedPerson::default() });
            }
        }
        assert_eq!(moments(&missed).into_iter().collect::<Vec<_>>(), [6, 8, 35]);
        assert!(moments(&[]).is_empty());
    }
}
