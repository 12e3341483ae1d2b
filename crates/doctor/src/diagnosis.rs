//! Result of the doctor for printing.

use std::path::{Path, PathBuf};

use serde::Serialize;
use tagalong_app::choice::Choice;
use tagalong_app::outcome::{Failure, make_folder};
use tagalong_app::remedies::Remedies;
use tagalong_config::path_text;
use tagalong_log::InputAccount;

use super::args::DoctorArgs;
use super::coverage::{Alternative, Coverage};
use super::evidence::Evidence;
use super::finding::Finding;
use super::visit::Visit;
use super::{alternatives, checks, present, sheets};

/// Complete result of the doctor.
#[derive(Debug, Default, Serialize)]
pub struct Diagnosis {
    /// The config, or its name.
    #[serde(serialize_with = "path_text::serialize")]
    pub config: PathBuf,
    /// The log.
    #[serde(serialize_with = "path_text::serialize")]
    pub log: PathBuf,
    /// Number of examined frames.
    pub frames: u64,
    /// Median time from one frame of the log to the next, ms.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub period_ms: Option<f64>,
    /// All pipelines that fit the log, if no config was given.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub pipelines: Vec<Row>,
    /// Inputs that the log has, in words.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub contents: String,
    /// Better pipeline that an unused topic would make possible, with the remedy.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub better: Option<String>,
    /// Reason for comparing no pipeline with a neural network, with the remedy.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub network: Option<String>,
    /// Use of each image, scan, detection and odometry topic, with the reasons for those not used.
    pub inputs: InputAccount,
    /// Results of the checks.
    pub findings: Vec<Finding>,
    /// Figures of the pipeline.
    pub coverage: Coverage,
    /// Other settings that were tried on the log.
    pub alternatives: Vec<Alternative>,
    /// Folder with the pictures of frames, or with a folder for each pipeline.
    #[serde(serialize_with = "path_text::optional::serialize")]
    pub pictures: Option<PathBuf>,
    /// Tests of the rejection funnel.
    pub funnel: Vec<Drop>,
}

/// Entry of the rejection funnel.
#[derive(Debug, Serialize)]
pub struct Drop {
    /// Name of the test.
    pub test: &'static str,
    /// Number of candidates that it dropped.
    pub count: u64,
    /// Advice on the test.
    pub look: Option<String>,
    /// Settings that belong to it, with their present values.
    pub settings: Vec<String>,
    /// Sentence with the meaning of the test and at most two settings.
    pub why: String,
    /// Pictures of the dropped candidates.
    pub pictures: Option<PathBuf>,
}

/// Pipeline in the comparison.
#[derive(Debug, Serialize)]
pub struct Row {
    /// Name of the built-in config, or of the installed network.
    pub config: String,
    /// True for the pipeline that `tagalong run` selects.
    pub taken: bool,
    /// Reason for the choice of such a pipeline.
    pub reason: &'static str,
    /// Figures on the log.
    pub coverage: Coverage,
    /// Mean time per frame, ms.
    pub frame_ms: f64,
    /// Error of a plugin that ended the run.
    pub failure: Option<String>,
}

impl Row {
    /// Returns the row of a pipeline after its visit.
    pub fn of(config: String, choice: Choice, evidence: &Evidence, taken: bool) -> Self {
        Self {
            config,
            taken,
            reason: choice.reason,
            coverage: evidence.coverage.clone(),
            frame_ms: evidence.coverage.frame_ms,
            failure: evidence.trial.failure.clone(),
        }
    }

    /// Returns the pipeline as an alternative to the selected one.
    pub fn alternative(&self) -> Alternative {
        Alternative { change: alternatives::another(&self.config), coverage: self.coverage.clone() }
    }
}

impl Diagnosis {
    /// Runs the checks on the measurements of a visit, and writes pictures into a folder.
    ///
    /// # Errors
    /// A folder or a picture that cannot be written.
    pub fn of(
        visit: &Visit,
        config: PathBuf,
        args: &DoctorArgs,
        folder: Option<&Path>,
        remedies: &Remedies,
    ) -> Result<Self, Failure> {
        let evidence = &visit.evidence;
        let resolved = visit.outer.resolved_with(visit.pipeline.config())?;
        let resolved = resolved.values();
        let findings = checks::findings(evidence).into_iter().map(|finding| Finding {
            remedy: finding.remedy.as_deref().and_then(|text| present::differing(text, resolved)),
            ..finding
        });
        Ok(Self {
            config,
            log: args.log.clone(),
            frames: evidence.trial.frames,
            period_ms: evidence.period_ms(),
            inputs: evidence.inspection.inputs.clone(),
            findings: findings.collect(),
            coverage: evidence.coverage.clone(),
            alternatives: evidence.alternatives.clone(),
            funnel: funnel(visit, resolved, folder, remedies)?,
            ..Self::default()
        })
    }
}

/// Returns the tests in descending order of dropped candidates, with the remedies.
fn funnel(
    visit: &Visit,
    resolved: &toml::Table,
    folder: Option<&Path>,
    remedies: &Remedies,
) -> Result<Vec<Drop>, Failure> {
    let trial = &visit.evidence.trial;
    let mut pictures = match folder {
        None => Default::default(),
        Some(folder) => {
            make_folder(folder)?;
            sheets::write(trial, folder).map_err(Failure::failed)?
        }
    };
    let entries = trial.funnel.entries().iter();
    let mut drops: Vec<Drop> = entries
        .map(|entry| {
            let remedy = remedies.of_config(entry.test, resolved);
            Drop {
                test: entry.test,
                count: entry.count,
                settings: remedy.as_ref().map_or_else(Vec::new, |remedy| remedy.lines(resolved)),
                look: remedy.map(|remedy| remedy.look.clone()),
                why: remedies.sentence(entry.test, resolved),
                pictures: pictures.remove(entry.test),
            }
        })
        .collect();
    drops.sort_by_key(|drop| std::cmp::Reverse(drop.count));
    Ok(drops)
}
