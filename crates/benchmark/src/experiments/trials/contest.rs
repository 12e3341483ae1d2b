use tagalong_config::Registry;
use tagalong_eval::{Clear, Identity};
use tagalong_sim::Scene;
use tagalong_trials::{Contender, Crossing, Judge, Trial, TrialError, crossing, each};

/// Result of one contender on one random variant of a scene.
#[derive(Clone, Debug)]
pub struct Result {
    /// CLEAR MOT.
    pub clear: Clear,
    /// Identity measures.
    pub identity: Identity,
    /// Position errors in the robot frame, m.
    pub errors_m: Vec<f64>,
    /// True if every person was tracked in all frames, by one track each.
    pub success: bool,
}

/// Returns one result for each contender, for each random variant.
pub fn run(
    scenes: &[Scene],
    contenders: &[Contender],
    registry: &Registry,
    jobs: usize,
    done: impl Fn() + Sync,
) -> std::result::Result<Vec<Vec<Result>>, TrialError> {
    each(scenes, contenders, registry, jobs, results, |_| done())
}

fn results(trial: Trial) -> std::result::Result<Vec<Result>, TrialError> {
    let results = trial.runs.iter().map(|run| {
        let judged = Judge::default().judge(&trial, run)?;
        Ok(Result {
            clear: judged.tally.clear,
            identity: judged.tally.identity,
            errors_m: judged.errors_in_robot_m,
            success: crossing(&trial, run, &Crossing::default()).is_ok(),
        })
    });
    results.collect()
}
