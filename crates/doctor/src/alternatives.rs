//! Other settings, tried on the same frames, and the change of the figures of a pipeline with each.

use tagalong_app::choice::fitting;
use tagalong_app::config_file::ConfigFile;
use tagalong_app::lacking::Lacking;
use tagalong_app::progress::Progress;
use tagalong_app::remedies::{Change, Remedies, is_present};
use tagalong_config::Registry;
use tagalong_core::Inputs;
use tagalong_log::{FrameSource, LogFrame};
use tagalong_pipeline::Pipeline;
use toml::Table;

use super::coverage::{Alternative, Course, Coverage};
use super::visit::{Scope, Visit};

/// Largest number of built-in configs that are tried in addition to that of the user.
const MOST_CONFIGS: usize = 4;

/// Pipeline with another setting, during the pass over the log.
struct Runner {
    change: String,
    pipeline: Pipeline,
    course: Course,
    lacking: Lacking,
}

/// Tries other settings on the frames of a visit.
pub fn tried(visit: &Visit, scope: Scope, registry: &Registry) -> Vec<Alternative> {
    let mut runners = runners(visit, scope, registry);
    let inputs =
        runners.iter().fold(Inputs::NONE, |all, runner| all.union(runner.pipeline.inputs()));
    let input = &visit.outer.input;
    let limits = &visit.outer.limits;
    let Ok(mut frames) = FrameSource::open(scope.log, input, limits, inputs) else {
        return Vec::new();
    };
    let progress = Progress::titled(&format!("{} other settings", runners.len()));
    for number in 0..scope.frames {
        let Some(item) = frames.next_frame() else { break };
        // A pipeline that fails on this log is not an alternative.
        runners.retain_mut(|runner| runner.step(&item));
        progress.advance(frames.progress(), number);
    }
    runners.retain(|runner| runner.lacking.failure().is_none());
    let judged = runners.into_iter().map(|runner| Alternative {
        change: runner.change,
        coverage: Coverage::of(&runner.course, &visit.scenery),
    });
    ranked(judged)
}

/// Returns the alternatives, the best first; equal ones keep their order.
pub fn ranked(alternatives: impl Iterator<Item = Alternative>) -> Vec<Alternative> {
    let mut ranked: Vec<Alternative> = alternatives.collect();
    ranked.sort_by(|a, b| b.coverage.worth().total_cmp(&a.coverage.worth()));
    ranked
}

impl Runner {
    fn new(change: String, mut pipeline: Pipeline) -> Self {
        pipeline.share_findings();
        Self { change, pipeline, course: Course::default(), lacking: Lacking::default() }
    }

    /// Passes a frame to the pipeline; returns false after an error. A frame that lacks an input is left
    /// out.
    fn step(&mut self, item: &LogFrame) -> bool {
        let Ok(report) = self.lacking.step(&mut self.pipeline, &item.frame) else { return false };
        if let Some(report) = report {
            self.course.take(&report, &item.odom_from_robot);
        }
        true
    }
}

/// Returns a pipeline for each change of the config, and for other configs.
fn runners(visit: &Visit, scope: Scope, registry: &Registry) -> Vec<Runner> {
    let config = visit.pipeline.config();
    let changes = changes(visit, config.values(), &Remedies::new(registry));
    let built = changes.into_iter().filter_map(|change| {
        let text = config.with_values(&[(&change.key, &change.value)]).ok()?;
        let changed = config.source().with_text(text);
        let pipeline = Pipeline::builder(registry).build(&changed).ok()?;
        Some(Runner::new(change.line, pipeline))
    });
    built.chain(others(&visit.config, scope, registry)).collect()
}

/// Returns the changes to try: the values of `[tune]` and those in the table of remedies that
/// differ from the present ones.
fn changes(visit: &Visit, resolved: &Table, remedies: &Remedies) -> Vec<Change> {
    let tuned = visit.tunables.iter().flat_map(|tunable| {
        let others = tunable.values.iter().filter(|value| !is_present(value, &tunable.now));
        others.map(|value| Change::of(resolved, &tunable.key, value))
    });
    let mut changes: Vec<Change> = Vec::new();
    for change in tuned.chain(remedies.offered(resolved)) {
        if !changes.iter().any(|other| other.line == change.line) {
            changes.push(change);
        }
    }
    changes
}

/// Returns the name of another config in the form of a change.
pub fn another(config: &str) -> String {
    format!("{config} (another config)")
}

/// Returns the built-in configs that fit the log.
fn others(config: &ConfigFile, scope: Scope, registry: &Registry) -> Vec<Runner> {
    let found = fitting(scope.log, registry, scope.input, MOST_CONFIGS).fitting;
    let others = found.into_iter().filter(|other| other.config.stem() != config.stem());
    others
        .filter_map(|other| {
            let (pipeline, _) = other.config.pipeline(registry, None).ok()?;
            Some(Runner::new(another(other.choice.config), pipeline))
        })
        .collect()
}
