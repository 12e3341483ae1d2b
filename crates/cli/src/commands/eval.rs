use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use serde::Serialize;
use serde_json::Value;
use tagalong_app::config_file::{ConfigFile, OuterSettings};
use tagalong_app::format::Format;
use tagalong_app::outcome::{Ended, Failure, Outcome, print};
use tagalong_app::scoring::{
    Rate, RulesChoice, Shots, Tracks, TruthFile, TruthOptions, as_upper_bodies, assemble,
    comparable, comparison, log_beside, match_note, misread_notes, truth_notes,
    whole_bodies_in_truth, with_remedy,
};
use tagalong_app::serialize::to_json;
use tagalong_app::suggest::check_log_path;
use tagalong_eval::formats::mot::Rules;
use tagalong_eval::{EvalError, Repaired, Scores, Sequence, Similarity, repairs};

/// Arguments of `tagalong eval`.
#[derive(Args, Debug)]
pub struct EvalArgs {
    /// Ground truth: MOTChallenge text, people.csv, people-floor.csv, KITTI labels, a log with the
    /// channel /truth/people, or the messages of that channel, line by line (.jsonl).
    #[arg(long, value_name = "FILE")]
    pub truth: PathBuf,
    /// Reported tracks: MOTChallenge text, KITTI labels, tracks-metres.csv, or the folder of a run.
    #[arg(long, value_name = "FILE")]
    pub tracks: PathBuf,
    /// Similarity measure: boxes in the image, or positions on the floor.
    #[arg(long, value_enum, default_value_t)]
    pub similarity: SimilarityChoice,
    /// The log of the truth, for stamps and the camera's pose [default: the one that the run names, at
    /// its path or beside the truth, or the one after which the truth is named].
    #[arg(long, value_name = "LOG")]
    pub log: Option<PathBuf>,
    /// Read that log with the `[input]` and `[limits]` of this config.
    #[arg(long)]
    pub config: Option<PathBuf>,
    /// Rules by which MOTChallenge truth is read.
    #[arg(long, value_enum, default_value_t)]
    pub rules: RulesChoice,
    /// The truth has boxes of whole bodies; compare their upper bodies.
    #[arg(long)]
    pub upper_body: bool,
    /// Keep the first of several people with the same ID in a frame of the truth, and count the others.
    #[arg(long)]
    pub drop_doubled_ids: bool,
    /// Also print HOTA, MOTA and IDF1 if one kind of error were repaired: IDs, false positives,
    /// misses, and positions and sizes of boxes.
    #[arg(long)]
    pub repairs: bool,
    /// Frames per second, if no file states them [default: 30; KITTI 10].
    #[arg(long, value_name = "HZ")]
    pub rate: Option<f64>,
    /// Output format.
    #[arg(long, value_enum, default_value_t)]
    pub format: Format,
}

/// Similarity of a truth and a report.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum SimilarityChoice {
    /// Intersection over union of the boxes.
    #[default]
    Iou,
    /// Distance on the floor: 1 at the same position, 0 a metre away.
    Metres,
}

impl From<SimilarityChoice> for Similarity {
    fn from(choice: SimilarityChoice) -> Self {
        match choice {
            SimilarityChoice::Iou => Self::Iou,
            SimilarityChoice::Metres => Self::Metres,
        }
    }
}

/// Runs `tagalong eval`.
///
/// # Errors
/// Files that cannot be read or do not fit together.
pub fn eval(args: &EvalArgs) -> Outcome {
    let scored = scored(args)?;
    print(&match args.format {
        Format::Json => scored.json()?,
        Format::Text => as_text(&scored.said())?,
    })?;
    Ok(Ended::Well)
}

/// Returns what `tagalong eval --format json` prints.
///
/// # Errors
/// As for the command: files that cannot be read or do not fit together.
pub fn eval_json(args: &EvalArgs) -> Result<String, Failure> {
    scored(args)?.json()
}

/// Figures of a report, with the rules and the notes.
struct Scored {
    scores: Scores,
    repairs: Option<Vec<Repaired>>,
    rules: Option<&'static str>,
    notes: Vec<String>,
}

impl Scored {
    fn said(&self) -> Said<'_> {
        let repairs = self.repairs.as_deref();
        Said { scores: &self.scores, repairs, rules: self.rules, notes: &self.notes }
    }

    fn json(&self) -> Result<String, Failure> {
        to_json("the scores", &self.said())
    }
}

fn scored(args: &EvalArgs) -> Result<Scored, Failure> {
    let similarity = args.similarity.into();
    let Judged { mut sequence, mut truth, mut notes } = judged(args, args.upper_body)?;
    let mut kind = None;
    if similarity == Similarity::Iou {
        if let Some(note) = whole_bodies_in_truth(&sequence).filter(|_| !args.upper_body) {
            Judged { sequence, truth, notes } = judged(args, true)?;
            kind = Some(note);
        } else if let Some((cut, note)) = as_upper_bodies(&sequence) {
            sequence = cut;
            kind = Some(note);
        }
    }
    // Figures of other boxes than those of the files need their reason first.
    notes.splice(0..0, kind);
    let reported = reports_of(&sequence);
    let Some(sequence) = comparable(&sequence, similarity) else {
        return Err(no_place(args, &truth));
    };
    if reported > 0 && reports_of(&sequence) == 0 {
        return Err(no_place_reported(args));
    }
    let comparison = comparison(&truth, similarity);
    let scores = Scores::measure(&sequence, comparison).map_err(|error| refused(args, &error))?;
    let repairs = args.repairs.then(|| repairs(&sequence, &comparison));
    let repairs = repairs.transpose().map_err(|error| refused(args, &error))?;
    let mut misread = misread_notes(&sequence, &comparison);
    // Another reading is reason enough that little matches.
    if misread.is_empty() {
        misread.extend(match_note(&args.truth, scores.truths, scores.tp, scores.reports));
    }
    notes.extend(misread);
    if scores.has_constant_scores() {
        notes.push(format!("{}: {CONSTANT_SCORES}", args.tracks.display()));
    }
    Ok(Scored { rules: rules(&truth), scores, repairs, notes })
}

fn reports_of(sequence: &Sequence) -> usize {
    sequence.frames.iter().map(|frame| frame.reports.len()).sum()
}

/// Returns the failure of tracks of which none has what is compared.
fn no_place_reported(args: &EvalArgs) -> Failure {
    let shown = args.tracks.display();
    Failure::usage(match args.similarity {
        SimilarityChoice::Iou => format!(
            "{shown} has positions and no boxes; compare positions (--similarity metres), or give \
             the folder of the run"
        ),
        SimilarityChoice::Metres => format!(
            "{shown} has boxes and no positions; compare boxes (--similarity iou), or give the folder \
             of the run"
        ),
    })
}

fn refused(args: &EvalArgs, error: &EvalError) -> Failure {
    let file = match error {
        EvalError::DuplicateId { side: "truth", .. } => &args.truth,
        _ => &args.tracks,
    };
    Failure::failed(format!("{}: {}", file.display(), with_remedy(error)))
}

/// Frames per second where nothing states them.
const USUAL_HZ: f64 = 30.0;

/// Note on tracks for which LAMR and AP are meaningless.
const CONSTANT_SCORES: &str = "all reports have the same score; LAMR and AP mean nothing then: no \
                               threshold separates reliable reports from unreliable ones";

/// Printed result: the figures, the rules and the notes.
#[derive(Serialize)]
struct Said<'a> {
    #[serde(flatten)]
    scores: &'a Scores,
    /// Figures with one kind of error repaired, where they were asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    repairs: Option<&'a [Repaired]>,
    /// Name of the rules for reading the truth, where several are in use.
    rules: Option<&'static str>,
    notes: &'a [String],
}

fn rules(truth: &TruthFile) -> Option<&'static str> {
    if truth.is_kitti() { Some("KITTI") } else { truth.rules.map(Rules::name) }
}

/// Truth and tracks side by side.
struct Judged {
    sequence: Sequence,
    truth: TruthFile,
    /// Notes on lines that may have been read in another way than intended.
    notes: Vec<String>,
}

/// Reads truth and tracks; with `upper_body` the truth's boxes are whole bodies, and cut.
fn judged(args: &EvalArgs, upper_body: bool) -> Result<Judged, Failure> {
    let options = TruthOptions {
        rules: args.rules,
        takes_rules: true,
        upper_body,
        drops_doubled_ids: args.drop_doubled_ids,
    };
    let mut truth = TruthFile::read(&args.truth, options)?;
    let tracks = Tracks::read(&args.tracks, truth.info.as_ref().map(|info| info.length))?;
    let shots = shots(args, &truth, &tracks)?;
    // No camera pose relates the two frames, so a distance would mean nothing.
    if args.similarity == SimilarityChoice::Metres && truth.is_kitti() && tracks.in_robot_frame {
        return Err(Failure::usage(
            "KITTI gives positions in the camera's frame, the tracks in the robot's: compare boxes \
             (--similarity iou), or give tracks as KITTI labels",
        ));
    }
    let mut notes = std::mem::take(&mut truth.notes);
    notes.extend(truth_notes(&args.truth, &truth, tracks.log_name.as_deref(), &shots));
    notes.extend(longer(args, truth.last(&shots).max(shots.last()), &tracks));
    notes.extend(tracks.notes);
    notes.extend(assumed_rate(args, &truth, &shots));
    let rate = rate(args, &truth)?;
    let name = args.truth.display().to_string();
    let sequence = assemble(&name, &truth, &shots, tracks.reports, rate);
    Ok(Judged { sequence, truth, notes })
}

/// Returns a note if tracks go on after the last known frame. Where no file states the length of a
/// sequence, it ends with the last frame in any file.
fn longer(args: &EvalArgs, known: u32, tracks: &Tracks) -> Option<String> {
    let (&last, _) = tracks.reports.last_key_value()?;
    let shown = args.tracks.display();
    (last > known).then(|| {
        format!(
            "{shown}: continues to frame {last}, but the last known frame is {known}; all of \
             them count"
        )
    })
}

/// Returns a note on a rate that no file and no option states. That of KITTI is always the same.
fn assumed_rate(args: &EvalArgs, truth: &TruthFile, shots: &Shots) -> Option<String> {
    let is_known =
        args.rate.is_some() || truth.info.is_some() || truth.is_kitti() || shots.first().is_some();
    (!is_known).then(|| {
        format!(
            "{USUAL_HZ} frames a second are assumed, as no log was found: give --rate HZ, --log LOG, or \
             the folder of the run as --tracks"
        )
    })
}

fn rate(args: &EvalArgs, truth: &TruthFile) -> Result<Rate, Failure> {
    let usual = if truth.is_kitti() { 10.0 } else { USUAL_HZ };
    let stated = truth.info.as_ref().map(|info| info.rate_hz);
    let rate = args.rate.or(stated).unwrap_or(usual);
    if rate > 0.0 && rate.is_finite() {
        return Ok(Rate(rate));
    }
    Err(Failure::usage(format!("--rate is {rate}; it must be above 0")))
}

/// Returns the frames of the log, if one is named, or found where it is needed.
fn shots(args: &EvalArgs, truth: &TruthFile, tracks: &Tracks) -> Result<Shots, Failure> {
    let found = args.log.clone().or_else(|| {
        if truth.is_in_log() {
            Some(args.truth.clone())
        } else if tracks.log_path.is_some() {
            tracks.log_path.clone()
        } else {
            beside(&args.truth, tracks.log_name.as_deref())
        }
    });
    let Some(log) = found else {
        let shown = args.truth.display();
        let text = format!(
            "{shown} gives stamps instead of frame numbers; name the log with --log LOG.mcap"
        );
        return if truth.needs_stamps() { Err(Failure::usage(text)) } else { Ok(Shots::default()) };
    };
    let outer = match &args.config {
        Some(config) => ConfigFile::read(config)?.outer()?,
        None => OuterSettings::default(),
    };
    check_log_path(&log)?;
    Shots::read(&log, &outer.input, &outer.limits)
}

/// Returns the log beside a truth: the one that the run names, or the one after which the truth is named.
fn beside(truth: &Path, log_name: Option<&str>) -> Option<PathBuf> {
    if let Some(name) = log_name {
        let path = truth.with_file_name(name);
        return path.is_file().then_some(path);
    }
    log_beside(truth)
}

fn no_place(args: &EvalArgs, truth: &TruthFile) -> Failure {
    let shown = args.truth.display();
    Failure::usage(match args.similarity {
        SimilarityChoice::Iou => {
            format!("{shown} has people without a box; compare positions (--similarity metres)")
        }
        SimilarityChoice::Metres if truth.needs_pose() => format!(
            "{shown} gives heads in the camera's frame, but the pose of the camera is not known; \
             name the log with --log LOG.mcap"
        ),
        SimilarityChoice::Metres => {
            format!("{shown} has people without a position; compare boxes (--similarity iou)")
        }
    })
}

/// Groups of figures under the headings of docs/reference/figures.md, each in the order in which it is
/// printed.
const GROUPS: [(&str, &[&str]); 4] = [
    (
        "Tracking",
        &[
            "HOTA",
            "IDF1",
            "MOTA",
            "DetA",
            "AssA",
            "LocA",
            "DetRe",
            "DetPr",
            "AssRe",
            "AssPr",
            "MOTP",
            "TP",
            "FN",
            "FP",
            "IDSW",
            "inherited_ids",
            "Frag",
            "MT",
            "PT",
            "ML",
            "IDP",
            "IDR",
            "IDTP",
            "IDFN",
            "IDFP",
        ],
    ),
    (
        "Detection",
        &[
            "recall",
            "recall_free",
            "recall_partly_hidden",
            "precision",
            "fp_per_frame",
            "LAMR",
            "AP",
            "distinct_scores",
        ],
    ),
    (
        "Places and times",
        &[
            "OSPA",
            "GOSPA",
            "position_error_mean_m",
            "position_error_rms_m",
            "position_error_p95_m",
            "position_error_max_m",
            "time_to_confirm_mean_s",
            "never_confirmed",
            "time_to_reacquire_mean_s",
            "never_reacquired",
            "wrong_person_s",
        ],
    ),
    ("Counts", &["frames", "truths", "reports", "truth_ids", "track_ids"]),
];

/// Formats the notes, then the figures by groups, one per line.
fn as_text(said: &Said<'_>) -> Result<String, Failure> {
    let figures = serde_json::to_value(said.scores).map_err(Failure::failed)?;
    let mut out = String::new();
    for note in said.notes {
        let _ = writeln!(out, "note: {note}");
    }
    for (heading, names) in GROUPS {
        let gap = if out.is_empty() { "" } else { "\n" };
        let _ = writeln!(out, "{gap}{heading}");
        for name in names {
            let _ = writeln!(out, "{name:<24} {:>10}", shown_figure(&figures[*name]));
        }
    }
    if let Some(rules) = said.rules {
        let _ = writeln!(out, "{:<24} {rules:>10}", "rules");
    }
    if let Some(repairs) = said.repairs {
        add_repairs(&mut out, said.scores, repairs);
    }
    Ok(out)
}

/// Formats a figure: a count as it is, and "-" for one that makes no sense on the input.
fn shown_figure(value: &Value) -> String {
    match (value.as_u64(), value.as_f64()) {
        (Some(count), _) => count.to_string(),
        (None, Some(figure)) => format!("{figure:.4}"),
        (None, None) => "-".to_owned(),
    }
}

/// Adds a table of the figures as they are, and with one kind of error repaired.
fn add_repairs(out: &mut String, scores: &Scores, repairs: &[Repaired]) {
    let _ =
        writeln!(out, "\n{:<24} {:>10} {:>10} {:>10}", "repaired alone", "HOTA", "MOTA", "IDF1");
    let as_is = ("as it is", [scores.hota, scores.mota, scores.idf1]);
    let repaired = repairs.iter().map(|r| (r.repair.describe(), [r.hota, r.mota, r.idf1]));
    for (name, figures) in std::iter::once(as_is).chain(repaired) {
        let [hota, mota, idf1] =
            figures.map(|figure| figure.map_or_else(|| "-".to_owned(), |f| format!("{f:.4}")));
        let _ = writeln!(out, "{name:<24} {hota:>10} {mota:>10} {idf1:>10}");
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn each_figure_is_in_one_group_and_the_headings_are_those_of_the_reference() {
        let printed = serde_json::to_value(Scores::default()).expect("figures");
        let all: BTreeSet<&str> =
            printed.as_object().expect("an object").keys().map(String::as_str).collect();
        let grouped: Vec<&str> =
            GROUPS.iter().flat_map(|(_, names)| names.iter().copied()).collect();
        assert_eq!(grouped.len(), all.len(), "none twice");
        assert_eq!(grouped.into_iter().collect::<BTreeSet<_>>(), all);
        let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/reference/figures.md");
        let page = std::fs::read_to_string(page).expect("the page");
        for (heading, _) in GROUPS {
            assert!(page.contains(&format!("\n## {heading}\n")), "{heading}");
        }
    }

    #[test]
    fn notes_come_first_and_the_leading_figures_after_them() {
        let scores = Scores { hota: Some(0.25), frames: 7, ..Scores::default() };
        let notes = ["odd".to_owned()];
        let said = Said { scores: &scores, repairs: None, rules: None, notes: &notes };
        let text = as_text(&said).expect("a text");
        let mut lines: Vec<Vec<&str>> =
            text.lines().map(|line| line.split_whitespace().collect()).collect();
        assert!(lines.contains(&vec!["frames", "7"]), "{text}");
        lines.truncate(6);
        let [note, gap, heading, hota, idf1, mota] = &lines[..] else { panic!("{text}") };
        assert_eq!((&note[..], gap.len()), (&["note:", "odd"][..], 0));
        assert_eq!((&heading[..], &hota[..]), (&["Tracking"][..], &["HOTA", "0.2500"][..]));
        assert_eq!((&idf1[..], &mota[..]), (&["IDF1", "-"][..], &["MOTA", "-"][..]));
    }
}
