//! Differences between the events of two pipelines.

use std::collections::BTreeMap;

use crate::model::{Benchmark, EventRow, TaskResult};
use crate::view::OrderedBenchmark;

/// Maximum time between events of two pipelines that count as the same.
pub const SAME_EVENT_S: f64 = 0.5;

/// Event of only one of two pipelines.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Difference<'a> {
    /// Name of the log.
    pub log: &'a str,
    /// Seed of the task.
    pub seed: u64,
    /// Pipeline with the event.
    pub pipeline: &'a str,
    /// The event.
    pub event: &'a EventRow,
}

/// Lists the events that only one of the pipelines `a` and `b` has, by log and seed, then by time,
/// on the logs that both finished.
///
/// Two events are the same if they have the same kind and person and are at most half a second
/// apart. IDs of tracks are not comparable between pipelines and are ignored.
pub fn compare<'a>(benchmark: &'a Benchmark, a: &str, b: &str) -> Vec<Difference<'a>> {
    compare_in(&OrderedBenchmark::new(benchmark), a, b)
}

pub fn compare_in<'a>(view: &OrderedBenchmark<'a>, a: &str, b: &str) -> Vec<Difference<'a>> {
    let mut all = Vec::new();
    for of_a in view.done(a) {
        let of_b = view.done(b).find(|task| task.log == of_a.log && task.seed == of_a.seed);
        let Some(of_b) = of_b else { continue };
        let mut here = only_one(of_a, of_b);
        here.sort_by(|x, y| {
            // Events of equal time are sorted by pipeline, so that the order is always the same.
            x.event.t_s.total_cmp(&y.event.t_s).then_with(|| x.pipeline.cmp(y.pipeline))
        });
        all.extend(here);
    }
    all.sort_by(|x, y| (x.log, x.seed).cmp(&(y.log, y.seed)));
    all
}

/// Kind of an event and ID of the person.
type Key<'a> = (&'a str, Option<i64>);

fn only_one<'a>(a: &'a TaskResult, b: &'a TaskResult) -> Vec<Difference<'a>> {
    let in_a = by_key(a);
    let in_b = by_key(b);
    let keys: std::collections::BTreeSet<Key<'_>> =
        in_a.keys().chain(in_b.keys()).copied().collect();
    let mut out = Vec::new();
    for key in keys {
        let [of_a, of_b] = [&in_a, &in_b].map(|map| map.get(&key).cloned().unwrap_or_default());
        let (only_a, only_b) = unmatched(&of_a, &of_b);
        for (task, events) in [(a, only_a), (b, only_b)] {
            out.extend(events.into_iter().map(|event| Difference {
                log: &task.log,
                seed: task.seed,
                pipeline: &task.pipeline,
                event,
            }));
        }
    }
    out
}

/// Returns the events with a finite time by kind and person, in chronological order.
fn by_key(task: &TaskResult) -> BTreeMap<Key<'_>, Vec<&EventRow>> {
    let mut map: BTreeMap<Key<'_>, Vec<&EventRow>> = BTreeMap::new();
    for event in task.events.iter().filter(|e| e.t_s.is_finite()) {
        map.entry((&event.kind, event.person)).or_default().push(event);
    }
    map.values_mut().for_each(|events| events.sort_by(|a, b| a.t_s.total_cmp(&b.t_s)));
    map
}

/// Pairs two lists in chronological order and returns the events without a partner. Because the
/// allowed distance is the same for all, taking the earliest possible partner leaves the fewest
/// events unpaired.
fn unmatched<'a>(a: &[&'a EventRow], b: &[&'a EventRow]) -> (Vec<&'a EventRow>, Vec<&'a EventRow>) {
    let mut only_a = Vec::new();
    let mut only_b = Vec::new();
    let mut i = 0;
    let mut j = 0;
    while i < a.len() && j < b.len() {
        let apart_s = b[j].t_s - a[i].t_s;
        if apart_s.abs() <= SAME_EVENT_S {
            (i, j) = (i + 1, j + 1);
        } else if apart_s > 0.0 {
            only_a.push(a[i]);
            i += 1;
        } else {
            only_b.push(b[j]);
            j += 1;
        }
    }
    only_a.extend(&a[i..]);
    only_b.extend(&b[j..]);
    (only_a, only_b)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn at(t_s: f64) -> EventRow {
        EventRow { t_s, kind: "miss".into(), person: Some(1), ..EventRow::default() }
    }

    /// Returns the largest number of pairs of any pairing, by trying all.
    fn most_pairs(a: &[f64], b: &[f64]) -> usize {
        let Some((&first, rest)) = a.split_first() else { return 0 };
        let without = most_pairs(rest, b);
        let with = (0..b.len()).filter(|&j| (b[j] - first).abs() <= SAME_EVENT_S).map(|j| {
            let mut left = b.to_vec();
            left.remove(j);
            1 + most_pairs(rest, &left)
        });
        with.max().unwrap_or(0).max(without)
    }

    proptest! {
        #[test]
        fn as_few_events_as_possible_stay_alone(
            mut a in prop::collection::vec(0u8..20, 0..6),
            mut b in prop::collection::vec(0u8..20, 0..6),
        ) {
            a.sort_unstable();
            b.sort_unstable();
            let [a, b] =
                [a, b].map(|times| times.iter().map(|&t| f64::from(t) * 0.2).collect::<Vec<_>>());
            let [in_a, in_b] =
                [&a, &b].map(|times| times.iter().map(|&t| at(t)).collect::<Vec<_>>());
            let (only_a, only_b) =
                unmatched(&in_a.iter().collect::<Vec<_>>(), &in_b.iter().collect::<Vec<_>>());
            let pairs = most_pairs(&a, &b);
            prop_assert_eq!(only_a.len(), a.len() - pairs);
            prop_assert_eq!(only_b.len(), b.len() - pairs);
        }
    }

    #[test]
    fn differences_are_listed_in_time_and_name_the_pipeline() {
        fn task(pipeline: &str, events: Vec<EventRow>) -> TaskResult {
            TaskResult {
                pipeline: pipeline.into(),
                log: "log".into(),
                events,
                ..TaskResult::default()
            }
        }

        let stranger = EventRow { person: Some(2), ..at(1.0) };
        let tasks = vec![
            task("a", vec![at(1.0), at(9.0)]),
            task("b", vec![stranger, at(1.4), at(3.0)]),
            task("c", vec![]),
        ];
        let benchmark = Benchmark { tasks, ..Benchmark::default() };
        let told: Vec<_> = compare(&benchmark, "a", "b")
            .iter()
            .map(|d| (d.pipeline, d.event.t_s, d.event.person))
            .collect();
        assert_eq!(told, [("b", 1.0, Some(2)), ("b", 3.0, Some(1)), ("a", 9.0, Some(1))]);
        assert!(compare(&benchmark, "a", "unknown").is_empty());
    }
}
