//! `tagalong-papers realism`: checks that the simulated world is hard in the ways in which the
//! real one is. Each check is a figure, its limits, and whether it holds; one that does not is
//! reported as clearly as one that does.

mod edges;
mod failures;
mod gait;
mod patches;
mod walls;

use std::fmt::Write as _;

use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use tagalong_app::format::Format;
use tagalong_app::outcome::{Ended, Failure, Outcome, print};
use tagalong_app::serialize::to_json;
use tagalong_app::threads::threads;
use tagalong_config::Registry;
use tagalong_core::{DepthImage, Frame, Funnel};
use tagalong_sim::{CameraKind, Scene, Variant};
use tagalong_stereo::{StereoDepth, StereoSettings};
use tagalong_trials::{Draw, SimulatedFrame, TrialError};

/// Arguments of `tagalong-papers realism`.
#[derive(Args, Debug)]
pub struct RealismArgs {
    /// Random variants of each random scene of the checks.
    #[arg(long, value_name = "N", default_value_t = 8,
          value_parser = clap::value_parser!(u64).range(1..=1000))]
    pub seeds: u64,
    /// Output format.
    #[arg(long, value_enum, default_value_t)]
    pub format: Format,
}

/// Figure with its limits.
#[derive(Clone, Debug, Serialize)]
struct Check {
    /// Group of the check.
    pub group: &'static str,
    /// Description of the figure.
    pub what: String,
    /// The figure; absent where it could not be measured.
    pub value: Option<f64>,
    /// Unit of the figure.
    pub unit: &'static str,
    /// Limits, in words.
    pub wanted: String,
    /// True if the figure is within the limits; absent without limits or figure.
    pub holds: Option<bool>,
}

impl Check {
    /// Returns the check of a figure that should lie between two others.
    pub fn between(
        group: &'static str,
        what: impl Into<String>,
        value: f64,
        unit: &'static str,
        [low, high]: [f64; 2],
    ) -> Self {
        let wanted = match (low.is_finite(), high.is_finite()) {
            (true, true) => format!("{low} to {high}"),
            (true, false) => format!("at least {low}"),
            _ => format!("at most {high}"),
        };
        let holds = Some((low..=high).contains(&value));
        Self { group, what: what.into(), value: Some(value), unit, wanted, holds }
    }

    /// Returns a figure without limits, for information.
    pub fn told(
        group: &'static str,
        what: impl Into<String>,
        value: f64,
        unit: &'static str,
    ) -> Self {
        let what = what.into();
        let wanted = String::new();
        Self { group, what, value: Some(value), unit, wanted, holds: None }
    }

    /// Returns a check that could not be measured, with the reason.
    pub fn skipped(group: &'static str, why: impl Into<String>) -> Self {
        let what = why.into();
        let wanted = String::new();
        Self { group, what, value: None, unit: "", wanted, holds: None }
    }
}

/// Part of the checks; takes the number of seeds.
type Part = fn(&Registry, u64) -> Result<Vec<Check>, TrialError>;

/// All parts, by name.
const PARTS: [(&str, Part); 7] = [
    ("walls", |_, _| walls::checks(&walls::RGBD)),
    ("walls in stereo", |_, _| walls::checks(&walls::STEREO)),
    ("silhouettes", |_, seeds| edges::checks(&edges::RGBD, seeds)),
    ("silhouettes in stereo", |_, seeds| edges::checks(&edges::STEREO, seeds)),
    ("gait", |_, _| gait::checks()),
    ("failures", failures::checks),
    ("depth patches", |_, seeds| patches::checks(seeds)),
];

/// Runs all checks and prints them.
///
/// # Errors
/// A plugin that fails on a simulated frame.
pub fn realism(args: &RealismArgs, registry: &Registry) -> Outcome {
    let bar = ProgressBar::new(PARTS.len() as u64);
    if let Ok(style) = ProgressStyle::with_template("{wide_bar} {pos}/{len} checks {msg}") {
        bar.set_style(style);
    }
    let mut checks = Vec::new();
    for (name, part) in PARTS {
        bar.set_message(name);
        checks.extend(part(registry, args.seeds).map_err(Failure::failed)?);
        bar.inc(1);
    }
    bar.finish_and_clear();
    match args.format {
        Format::Text => print(&text(&checks))?,
        Format::Json => print(&to_json("the checks", &checks)?)?,
    }
    Ok(Ended::Well)
}

fn text(checks: &[Check]) -> String {
    let width = checks.iter().map(|check| check.what.chars().count()).max().unwrap_or(0);
    let mut out = String::new();
    let mut group = "";
    for check in checks {
        if check.group != group {
            group = check.group;
            let _ = writeln!(out, "{group}");
        }
        let value = check.value.map_or(String::new(), |value| format!("{value:.3}"));
        let verdict = match check.holds {
            None => "",
            Some(true) => "holds",
            Some(false) => "DOES NOT HOLD",
        };
        let line = format!(
            "  {:<width$}  {value:>8} {:<6}  {:<22}  {verdict}",
            check.what, check.unit, check.wanted
        );
        let _ = writeln!(out, "{}", line.trim_end());
    }
    let judged = checks.iter().filter_map(|check| check.holds);
    let held = judged.clone().filter(|holds| *holds).count();
    let all = judged.count();
    let _ = writeln!(out, "{held} of {all} checks hold");
    out
}

/// Scenes of checks are written by this file's own modules, and are right.
#[expect(clippy::expect_used, reason = "the scenes are part of the program, and tests read them")]
fn scene_with(text: &str, variant: &Variant) -> Scene {
    Scene::parse_with(text, variant).expect("the built-in scene is right")
}

fn scene(text: &str) -> Scene {
    scene_with(text, &Variant::default())
}

/// Returns the same scene with as many seeds: other noise, and new values of everything that
/// varies.
fn scenes(text: &str, seeds: u64) -> Vec<Scene> {
    fn variant(seed: u64) -> Variant {
        Variant { seed: Some(seed), ..Variant::default() }
    }

    (0..seeds).map(|seed| scene_with(text, &variant(seed))).collect()
}

/// Returns all frames of a scene; those of a stereo pair with the depth that the stage of the
/// pipelines computes.
fn simulated(scene: &Scene) -> impl Iterator<Item = SimulatedFrame> + use<> {
    simulated_with(scene, StereoSettings::default())
}

/// Returns the same with depth by other settings of the stage.
fn simulated_with(
    scene: &Scene,
    settings: StereoSettings,
) -> impl Iterator<Item = SimulatedFrame> + use<> {
    let mut draw = Draw::new(scene, threads(None));
    let is_pair = scene.camera.kind == CameraKind::Stereo;
    let mut stereo = StereoDepth::new(settings).ok().filter(|_| is_pair);
    std::iter::from_fn(move || {
        let simulated = draw.next_frame()?;
        let depth = stereo.as_mut().map(|s| s.depth(&simulated.frame, &mut Funnel::default()));
        let Some(Ok(depth)) = depth else { return Some(simulated) };
        Some(SimulatedFrame { frame: simulated.frame.with_depth(depth), ..simulated })
    })
}

/// Returns the depth that a pipeline would receive.
fn depth(frame: &Frame) -> Option<&DepthImage> {
    frame.depth().ok()
}

fn deviation(values: &[f64]) -> f64 {
    tagalong_math::mean_and_deviation(values).map_or(0.0, |(_, deviation)| deviation)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_check_says_what_is_wanted_and_whether_it_holds() {
        let checks = [
            Check::between("a", "x", 1.0, "m", [0.0, 2.0]),
            Check::between("a", "y", 3.0, "m", [f64::NEG_INFINITY, 2.0]),
            Check::told("b", "z", 5.0, ""),
        ];
        let text = text(&checks);
        assert!(text.contains("0 to 2") && text.contains("at most 2"), "{text}");
        assert!(text.contains("DOES NOT HOLD") && text.ends_with("1 of 2 checks hold\n"), "{text}");
    }

    #[test]
    fn the_deviation_of_no_values_is_zero() {
        assert_eq!((deviation(&[1.0, 3.0]), deviation(&[])), (1.0, 0.0));
    }
}
