use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::thread::available_parallelism;

use tagalong_core::{Error, Result};

/// Runs `work` on each item in a thread of its own, as many at once as there are cores; `progress`
/// receives the fraction that is done. The results are in the order of the items.
///
/// # Errors
/// The first one of `work`, and [`Error::Other`] if it panics.
pub fn side_by_side<S: Sync, T: Send>(
    things: &[S],
    work: impl Fn(&S) -> Result<T> + Sync,
    progress: &mut dyn FnMut(f64),
) -> Result<Vec<T>> {
    let mut all = Vec::with_capacity(things.len());
    for few in things.chunks(available_parallelism().map_or(1, usize::from)) {
        all.extend(at_once(few, &work)?);
        progress(all.len() as f64 / things.len() as f64);
    }
    Ok(all)
}

fn at_once<S: Sync, T: Send>(
    things: &[S],
    work: &(impl Fn(&S) -> Result<T> + Sync),
) -> Result<Vec<T>> {
    // All threads are joined before the first failure counts: a thread that panics and is not
    // joined makes the scope panic.
    let results: Vec<Result<T>> = std::thread::scope(|scope| {
        let running: Vec<_> = things
            .iter()
            .map(|thing| {
                let thread = std::thread::Builder::new();
                thread.spawn_scoped(scope, move || work_guarded(thing, work)).ok()
            })
            .collect();
        let results = running.into_iter().zip(things).map(|(thread, thing)| match thread {
            Some(thread) => thread.join().unwrap_or_else(error_of_panic),
            // No thread could be started for it.
            None => work_guarded(thing, work),
        });
        results.collect()
    });
    results.into_iter().collect()
}

/// Works on one item; a panic is an error.
fn work_guarded<S, T>(thing: &S, work: &impl Fn(&S) -> Result<T>) -> Result<T> {
    catch_unwind(AssertUnwindSafe(|| work(thing))).unwrap_or_else(error_of_panic)
}

/// Returns the error of work that panicked.
fn error_of_panic<T>(_: Box<dyn Any + Send>) -> Result<T> {
    Err(Error::Other("the solver panicked".into()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_are_in_order_and_the_first_failure_counts() {
        fn fails(n: &u64) -> Result<()> {
            match n {
                3 | 4 => Err(Error::Other(format!("{n}"))),
                _ => Ok(()),
            }
        }

        let mut parts = Vec::new();
        let things: Vec<u64> = (0..40).collect();
        let squares = side_by_side(&things, |n| Ok(n * n), &mut |part| parts.push(part)).unwrap();
        assert_eq!(squares, things.iter().map(|n| n * n).collect::<Vec<_>>());
        assert!(parts.is_sorted() && parts.last() == Some(&1.0), "{parts:?}");
        let failure = side_by_side(&things, fails, &mut |_| {}).unwrap_err();
        assert_eq!(failure.to_string(), "3");
        let panics = side_by_side(&things, |_| -> Result<()> { panic!("on purpose") }, &mut |_| {});
        assert!(panics.unwrap_err().to_string().contains("panicked"));
    }
}
