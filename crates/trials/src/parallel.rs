use std::sync::atomic::{AtomicUsize, Ordering};

use tagalong_config::Registry;
use tagalong_sim::Scene;

use crate::{Contender, Trial, TrialError};

/// Renders all scenes, runs all contenders on each, and returns the results of `keep` for the
/// trials, in the order of the scenes. `threads` trials run at a time; `done` is called after each
/// with the number of finished ones.
///
/// # Errors
/// The error of the first scene in the list that has one.
pub fn each<T: Send>(
    scenes: &[Scene],
    contenders: &[Contender],
    registry: &Registry,
    threads: usize,
    keep: impl Fn(Trial) -> Result<T, TrialError> + Sync,
    done: impl Fn(usize) + Sync,
) -> Result<Vec<T>, TrialError> {
    in_order(
        scenes,
        threads,
        |scene| Trial::new(scene, contenders, registry, 1).and_then(&keep),
        done,
    )
}

/// Returns the results of `work` for each item, in the order of the items, `threads` at a time;
/// `done` is called after each with the number of finished ones.
///
/// # Errors
/// The error of the first item in the list that has one.
pub fn in_order<S: Sync, T: Send>(
    things: &[S],
    threads: usize,
    work: impl Fn(&S) -> Result<T, TrialError> + Sync,
    done: impl Fn(usize) + Sync,
) -> Result<Vec<T>, TrialError> {
    let next = AtomicUsize::new(0);
    let through = AtomicUsize::new(0);
    let mut all = std::thread::scope(|scope| {
        let mut others = Vec::new();
        for _ in 1..threads {
            let start = std::thread::Builder::new();
            // If a thread cannot be started, the running ones do its work.
            others.extend(
                start
                    .spawn_scoped(scope, || work_off(things, [&next, &through], &work, &done))
                    .ok(),
            );
        }
        let mut all = work_off(things, [&next, &through], &work, &done);
        for other in others {
            all.extend(other.join().map_err(|_| TrialError::Panicked)?);
        }
        Ok::<_, TrialError>(all)
    })?;
    all.sort_by_key(|(at, _)| *at);
    all.into_iter().map(|(_, result)| result).collect()
}

/// Processes items until none is left, and returns the results with the indices of the items.
fn work_off<S, T>(
    things: &[S],
    [next, through]: [&AtomicUsize; 2],
    work: &impl Fn(&S) -> Result<T, TrialError>,
    done: &impl Fn(usize),
) -> Vec<(usize, Result<T, TrialError>)> {
    let mut kept = Vec::new();
    while let Some((at, thing)) = take(things, next) {
        let result = work(thing);
        let failed = result.is_err();
        kept.push((at, result));
        done(through.fetch_add(1, Ordering::Relaxed) + 1);
        if failed {
            // The other threads need not continue.
            next.store(things.len(), Ordering::Relaxed);
        }
    }
    kept
}

fn take<'a, S>(things: &'a [S], next: &AtomicUsize) -> Option<(usize, &'a S)> {
    let at = next.fetch_add(1, Ordering::Relaxed);
    things.get(at).map(|thing| (at, thing))
}
