//! P4, Table II: time of a frame by stage.

use tagalong_eval::percentile;
use tagalong_pipeline::FrameReport;
use tagalong_report::{Cell, Row, Table};
use tagalong_trials::{Contender, Moment, Trial};
use toml::Value;

use super::STEREO;
use super::variants::replaced;
use crate::findings::Findings;
use crate::lab::{Lab, ReproduceError};

/// Rows of the paper's table, with the corresponding preprocessors and stages.
const GROUPS: [(&str, &[&str]); 4] = [
    ("stereo processing", &["stereo"]),
    (
        "person tracking",
        &["odometry", "predict", "track", "associate", "update", "manage", "learn"],
    ),
    ("person detection", &["discover"]),
    ("communication, display, saving", &["control"]),
];

/// Group of the search for new people.
const DETECTION: usize = 2;

/// Parts of the stage `preprocess`.
const PREPROCESSORS: [&str; 2] = ["stereo", "odometry"];

/// Published milliseconds of the rows.
const PUBLISHED_MS: [f64; 4] = [40.0, 20.0, 10.0, 20.0];
/// Published milliseconds per frame of P1.
const P1_MS: f64 = 70.0;

/// Measures the breakdown of P4.
///
/// # Errors
/// As [`Lab::contenders`], and a pipeline that fails.
pub fn of_p4(lab: &Lab) -> Result<Findings, ReproduceError> {
    let names = ["stereo-svm-ekf", "stereo-verified"];
    let published = PUBLISHED_MS.map(Some).to_vec();
    times(lab, &names, &published, PUBLISHED_MS.iter().sum(), "P4, Table II")
}

/// Measures the time of P1.
pub fn of_p1(lab: &Lab) -> Result<Findings, ReproduceError> {
    times(lab, &["stereo-ekf"], &[None; 4], P1_MS, "P1, section 4")
}

fn times(
    lab: &Lab,
    names: &[&str],
    published: &[Option<f64>],
    total_ms: f64,
    source: &str,
) -> Result<Findings, ReproduceError> {
    fn number(ms: Option<f64>) -> Cell {
        Cell::number(ms.unwrap_or(f64::NAN), 0)
    }

    let contenders = lab.contenders(names)?;
    let frames = frames(lab, &contenders)?;
    let all = published.iter().copied().chain([Some(total_ms)]);
    let mut rows = vec![Row::published("Core2Duo, 2.6 GHz", all.map(number).collect())];
    for (at, name) in names.iter().enumerate() {
        rows.push(Row::ours(format!("{name}, median"), cells(&frames[at], 0.5)));
        rows.push(Row::ours(format!("{name}, 95 % below"), cells(&frames[at], 0.95)));
    }
    let columns = GROUPS.iter().map(|(name, _)| format!("{name} ms"));
    let count = frames.first().map_or(0, Vec::len);
    Ok(Table {
        title: format!("Time of a frame at 512x384 with two people ({source})"),
        columns: columns.chain(["total ms".to_owned()]).collect(),
        rows,
        notes: vec![
            format!("{count} frames with two people in view, one at a time on this machine"),
            "Ours has no display to feed and no robot to talk to; 15 years lie between the \
             two processors."
                .into(),
        ],
    }
    .into())
}

/// Measures what the boundary points save.
pub fn boundary_points(lab: &Lab) -> Result<Findings, ReproduceError> {
    let printed = lab.contender("stereo-svm-ekf-as-printed")?;
    let none_need_pass = [("detectors.0.config.boundary_min_passed", Value::from(0))];
    let everywhere = replaced(&printed, none_need_pass.into_iter())?;
    let forms = [("with three boundary points", printed), ("compared everywhere", everywhere)];
    let contenders: Vec<Contender> = forms.iter().map(|(_, form)| form.clone()).collect();
    let frames = frames(lab, &contenders)?;
    Ok(Table {
        title: "Time of person detection at 512x384, by where silhouettes are compared (P4, \
                section II-B)"
            .into(),
        columns: vec!["median ms".into(), "95 % below ms".into()],
        rows: (0..forms.len())
            .map(|at| {
                let times: Vec<f64> = frames[at].iter().map(|groups| groups[DETECTION]).collect();
                let cells = [0.5, 0.95]
                    .map(|part| Cell::number(percentile(&times, part).unwrap_or(f64::NAN), 1));
                Row::ours(forms[at].0, cells.into())
            })
            .collect(),
        notes: vec![
            format!(
                "{} frames with two people in view, one at a time on this machine; \
                 stereo-svm-ekf-as-printed",
                frames[0].len()
            ),
            "The paper says that the points reduce the cost of the search largely, and gives no \
             figure. Which heads the detection volume has room for is tested in both."
                .into(),
        ],
    }
    .into())
}

/// Returns for each contender the milliseconds of each group, frame by frame. One trial runs at a
/// time: others would compete for the processor.
fn frames(lab: &Lab, contenders: &[Contender]) -> Result<Vec<Vec<[f64; 4]>>, ReproduceError> {
    let scenes = lab.scenes("square-walk", &[STEREO], lab.seeds(4).min(4))?;
    let mut frames = vec![Vec::new(); contenders.len()];
    lab.progress.begin(scenes.len(), "walks against the clock");
    for scene in &scenes {
        let trial = Trial::new(scene, contenders, lab.registry, 1)?;
        for (run, out) in trial.runs.iter().zip(&mut frames) {
            let both = trial.moments.iter().zip(&run.reports);
            // The paper's times are those of two people.
            let of_two = both.filter(|(moment, _)| in_view(moment) == 2);
            out.extend(of_two.map(|(_, report)| groups(report)));
        }
        lab.progress.step();
    }
    Ok(frames)
}

fn in_view(moment: &Moment) -> usize {
    moment.truth.iter().filter(|truth| !truth.ignore && truth.upper_body.is_some()).count()
}

/// Sums the times of each group. The stage `preprocess` counts by its parts, because the paper
/// counts stereo and odometry separately.
fn groups(report: &FrameReport) -> [f64; 4] {
    let stages = report.timings.iter().map(|(name, ms)| (*name, *ms));
    let plugins = report.plugin_timings.iter().map(|(name, ms)| (name.as_str(), *ms));
    let preprocessors = plugins.filter(|(name, _)| PREPROCESSORS.contains(name));
    let parts: Vec<(&str, f64)> = stages.chain(preprocessors).collect();
    GROUPS.map(|(_, group)| {
        parts.iter().filter(|(name, _)| group.contains(name)).map(|(_, ms)| ms).sum()
    })
}

fn cells(frames: &[[f64; 4]], part: f64) -> Vec<Cell> {
    let groups = (0..GROUPS.len()).map(|at| frames.iter().map(|groups| groups[at]).collect());
    let total = frames.iter().map(|groups| groups.iter().sum()).collect();
    let columns = groups.chain([total]);
    columns.map(|of: Vec<_>| Cell::number(percentile(&of, part).unwrap_or(f64::NAN), 1)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The groups name the stages of a pipeline with stereo and odometry, each once.
    #[test]
    fn every_stage_is_in_one_group() {
        let stages = tagalong_tracking::STAGES.iter().filter(|stage| **stage != "preprocess");
        let mut reported: Vec<&str> =
            stages.copied().chain(PREPROCESSORS).chain(["control"]).collect();
        let mut grouped: Vec<&str> = GROUPS.iter().flat_map(|(_, group)| *group).copied().collect();
        reported.sort_unstable();
        grouped.sort_unstable();
        assert_eq!(grouped, reported);
    }

    #[test]
    fn the_total_is_that_of_frames() {
        let cells = cells(&[[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 3.0, 0.0]], 1.0);
        assert_eq!(cells[4].value, Some(3.0), "not 1 + 3");
    }
}
