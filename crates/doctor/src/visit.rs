//! One pass of a pipeline over a log, with all measurements.

use std::cell::OnceCell;
use std::collections::BTreeMap;
use std::path::Path;

use tagalong::logs::sources_of;
use tagalong_app::config_file::{ConfigFile, OuterSettings, refused_log};
use tagalong_app::input_args::InputArgs;
use tagalong_app::missed::{Cause, PersonAt, Rules};
use tagalong_app::outcome::Failure;
use tagalong_app::progress::Progress;
use tagalong_app::remedies::Remedies;
use tagalong_config::Registry;
use tagalong_log::{FrameSource, Input, Inspection, LogError, examine};
use tagalong_pipeline::{Pipeline, Tunable};

use super::coverage::{Coverage, unexplained};
use super::evidence::{Driven, Evidence, Reading, Samples};
use super::scenery::{Scenery, Views};
use super::trial::Trial;

/// A pipeline after its pass over a log.
pub struct Visit {
    /// The config.
    pub config: ConfigFile,
    /// The pipeline.
    pub pipeline: Pipeline,
    /// Tables of the config that the pipeline does not parse.
    pub outer: OuterSettings,
    /// Settings that the config offers for tuning.
    pub tunables: Vec<Tunable>,
    /// Everything that was measured.
    pub evidence: Evidence,
    /// Shapes that come and go.
    pub scenery: Scenery,
}

/// Log of a visit, and the extent of the visit.
#[derive(Clone, Copy)]
pub struct Scope<'a> {
    /// The log.
    pub log: &'a Path,
    /// Options for reading it.
    pub input: &'a InputArgs,
    /// Number of frames.
    pub frames: u64,
    /// True if pictures are requested.
    pub with_pictures: bool,
    /// True if the user named the config.
    pub is_named: bool,
    /// True if exposure, depth, floor and scans are measured for the checks.
    pub with_samples: bool,
}

impl Visit {
    /// Passes a log through the pipeline of a config, and measures both.
    ///
    /// # Errors
    /// A config or a log that cannot be read.
    pub fn make(config: ConfigFile, scope: Scope, registry: &Registry) -> Result<Self, Failure> {
        let (mut pipeline, settings) = config.pipeline(registry, None)?;
        let outer = scope.input.applied(config.outer_for(&pipeline)?);
        let inputs = pipeline.inputs();
        // Exposure and coverage are judged, and pictures are rendered, even if the pipeline does
        // not use colour or depth.
        let read = inputs.accept(Input::Colour).accept(Input::Depth);
        let mut found = examine(scope.log, &outer.input, &outer.limits, read)?;
        // A topic of a wrong kind is an error in the config, and is reported as such.
        let is_mistake = matches!(
            found.refusal,
            Some(LogError::WrongTopic { .. } | LogError::UnknownTopic { .. })
        );
        if let Some(error) = found.refusal.take_if(|_| is_mistake) {
            return Err(refused_log(error, pipeline.config()));
        }
        let expected = expected_frames(&found.inspection).min(scope.frames);
        let mut evidence = Evidence {
            config: config.stem(),
            samples: Samples::of(expected),
            depth: OnceCell::new(),
            losses: found.inspection.notes.clone(),
            frameless: Vec::new(),
            inspection: found.inspection,
            refusal: found.refusal,
            missing: None,
            is_named: scope.is_named,
            input: outer.input.clone(),
            suits: settings.suits,
            has_odometry: found.frames.as_ref().is_none_or(FrameSource::has_odometry),
            inputs,
            reading: Reading::default(),
            driven: Driven::default(),
            trial: Trial::default(),
            coverage: Coverage::default(),
            causes: Vec::new(),
            changed: None,
            fitting: Vec::new(),
            alternatives: Vec::new(),
            preparations: Vec::new(),
        };
        let mut views = Views::of(expected);
        if let Some(frames) = found.frames {
            evidence.missing = pipeline.check_sources(sources_of(&frames)).err();
            let progress = Progress::titled(&config.stem());
            look(frames, &mut pipeline, scope, &mut evidence, &mut views, &progress);
        }
        let scenery = views.judge();
        evidence.changed = scenery.changed;
        evidence.coverage = Coverage::of(&evidence.trial.course, &scenery);
        let remedies = Remedies::new(registry);
        let rules = Rules { remedies: &remedies, config: pipeline.config().values() };
        evidence.causes = causes(&evidence.trial, &scenery, rules);
        Ok(Self { config, pipeline, outer, tunables: settings.tune, evidence, scenery })
    }
}

/// Returns the reasons why shapes that come and go have no track, most frequent first.
fn causes(trial: &Trial, scenery: &Scenery, rules: Rules<'_>) -> Vec<(Cause, usize)> {
    let mut counts: BTreeMap<String, (Cause, usize)> = BTreeMap::new();
    for moment in &trial.course.moments {
        let Some(seen) = scenery.moment(moment.index) else { continue };
        for blob in unexplained(moment, seen) {
            let rect = seen.upper_body(blob);
            let floor_m = Some([blob.place.x, blob.place.y]);
            let place = PersonAt { rect: (rect.area() > 0.0).then_some(rect), floor_m };
            let cause = trial.witness.cause_at(moment.index, &place, rules);
            counts.entry(cause.why.clone()).or_insert((cause, 0)).1 += 1;
        }
    }
    let mut causes: Vec<(Cause, usize)> = counts.into_values().collect();
    causes.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    causes
}

/// Returns the number of images, or scans, on the topic that makes the frames.
fn expected_frames(inspection: &Inspection) -> u64 {
    let facts = &inspection.facts;
    let topics = [&facts.colour_topic, &facts.depth_topic, &facts.laser_topic];
    let first = topics.into_iter().flatten().next();
    first.and_then(|topic| inspection.topic(topic)).map_or(0, |topic| topic.count)
}

/// Makes one pass over the frames.
fn look(
    mut frames: FrameSource,
    pipeline: &mut Pipeline,
    scope: Scope,
    out: &mut Evidence,
    views: &mut Views,
    progress: &Progress,
) {
    // If the user limits the frames, images after the last frame are not lost.
    out.reading.wanted = expected_frames(&out.inspection);
    out.reading.in_log = out.reading.wanted;
    for number in 0..scope.frames {
        let Some(item) = frames.next_frame() else { break };
        out.reading.made += 1;
        if out.reading.made == scope.frames {
            out.reading.wanted = item.frame.index;
        }
        if scope.with_samples {
            out.samples.take(number, &item);
        }
        out.driven.take(&item.frame);
        views.take(number, &item);
        // Without its inputs the pipeline cannot run, but the images can still be measured.
        if out.refusal.is_none() {
            out.trial.step(pipeline, &item, scope.with_pictures);
        }
        progress.show(frames.progress(), number, out.trial.in_view());
    }
    out.trial.end();
    out.inspection.counters = frames.counters().clone();
    out.inspection.notes = frames.notes().to_vec();
    out.inspection.data_lost = frames.data_lost();
    out.losses = frames.losses().to_vec();
    out.frameless = frames.frameless().to_vec();
}
