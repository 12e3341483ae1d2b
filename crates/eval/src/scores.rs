//! The figures of `eval` and `bench`, from counts that can be added over sequences.

use serde::{Deserialize, Serialize};

use crate::clear::Clear;
use crate::error::EvalError;
use crate::hota::{Hota, HotaLevel};
use crate::identity::Identity;
use crate::missrate::DetectionTally;
use crate::pairs::PairTable;
use crate::position::{PositionError, position_errors_m};
use crate::prepare::{Comparison, Prepared};
use crate::sets::{SetDistance, SetTally};
use crate::times::Times;
use crate::types::Sequence;
use crate::visibility::VisibilityTally;

/// All counts over one or several sequences, from which the figures are computed: counts can be
/// added, figures cannot.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Tally {
    /// CLEAR MOT.
    pub clear: Clear,
    /// Identity.
    pub identity: Identity,
    /// HOTA family.
    pub hota: Hota,
    /// OSPA and GOSPA.
    pub sets: SetTally,
    /// Single detections by score.
    pub detections: DetectionTally,
    /// Position errors of the matches, in metres.
    pub position_errors_m: Vec<f64>,
    /// Times.
    pub times: Times,
    /// Recall by the visible fraction of a person.
    #[serde(default)]
    pub visibility: VisibilityTally,
    /// Truths that count, over all frames.
    pub truths: u64,
    /// Reports that count, over all frames.
    pub reports: u64,
    /// Number of different people.
    pub truth_ids: u64,
    /// Number of different tracks.
    pub track_ids: u64,
}

impl Tally {
    /// Counts everything in one sequence.
    ///
    /// # Errors
    ///
    /// See [`Prepared::new`].
    pub fn measure(
        sequence: &Sequence,
        comparison: &Comparison,
        sets: &SetDistance,
    ) -> Result<Self, EvalError> {
        let prepared = Prepared::new(sequence, comparison)?;
        let table = PairTable::new(&prepared);
        let (clear, matches) = Clear::measure(&prepared);
        let similarity = comparison.similarity;
        Ok(Self {
            clear,
            identity: Identity::measure(&prepared, &table),
            hota: Hota::measure(&prepared, &table),
            sets: SetTally::measure(sequence, &prepared, similarity, sets),
            detections: DetectionTally::measure(sequence, similarity, 0.5),
            position_errors_m: position_errors_m(sequence, &prepared, &matches),
            times: Times::measure(&prepared, &matches),
            visibility: VisibilityTally::measure(sequence, &prepared, &matches),
            truths: prepared.truth_count(),
            reports: prepared.report_count(),
            truth_ids: prepared.truth_ids.len() as u64,
            track_ids: prepared.track_ids.len() as u64,
        })
    }

    /// Combines the tallies of several sequences as TrackEval does.
    pub fn combine<'a>(all: impl IntoIterator<Item = &'a Self>) -> Self {
        let all: Vec<&Self> = all.into_iter().collect();
        Self {
            clear: Clear::combine(all.iter().map(|t| &t.clear)),
            identity: Identity::combine(all.iter().map(|t| &t.identity)),
            hota: Hota::combine(all.iter().map(|t| &t.hota)),
            sets: SetTally::combine(all.iter().map(|t| &t.sets)),
            detections: DetectionTally::combine(all.iter().map(|t| &t.detections)),
            position_errors_m: all.iter().flat_map(|t| &t.position_errors_m).copied().collect(),
            times: Times::combine(all.iter().map(|t| &t.times)),
            visibility: VisibilityTally::combine(all.iter().map(|t| &t.visibility)),
            truths: all.iter().map(|t| t.truths).sum(),
            reports: all.iter().map(|t| t.reports).sum(),
            truth_ids: all.iter().map(|t| t.truth_ids).sum(),
            track_ids: all.iter().map(|t| t.track_ids).sum(),
        }
    }

    /// Returns the figures.
    pub fn scores(&self) -> Scores {
        let mut scores = self.counts();
        self.add_rates(&mut scores);
        self.add_places(&mut scores);
        self.add_times(&mut scores);
        scores
    }

    fn counts(&self) -> Scores {
        Scores {
            frames: self.clear.frames,
            truths: self.truths,
            reports: self.reports,
            truth_ids: self.truth_ids,
            track_ids: self.track_ids,
            tp: self.clear.tp,
            fp: self.clear.fp,
            fn_: self.clear.fn_,
            idsw: self.clear.id_switches,
            inherited_ids: self.clear.inherited_ids,
            frag: self.clear.fragmentations,
            mt: self.clear.mostly_tracked,
            pt: self.clear.partly_tracked,
            ml: self.clear.mostly_lost,
            idtp: self.identity.tp,
            idfp: self.identity.fp,
            idfn: self.identity.fn_,
            distinct_scores: self.detections.distinct_scores() as u64,
            ..Scores::default()
        }
    }

    fn add_rates(&self, scores: &mut Scores) {
        let any = self.truths > 0;
        scores.hota = any.then(|| self.hota.mean(HotaLevel::hota));
        scores.det_a = any.then(|| self.hota.mean(HotaLevel::det_a));
        scores.ass_a = any.then(|| self.hota.mean(HotaLevel::ass_a));
        scores.loc_a = any.then(|| self.hota.mean(HotaLevel::loc_a));
        scores.det_re = any.then(|| self.hota.mean(HotaLevel::det_re));
        scores.det_pr = any.then(|| self.hota.mean(HotaLevel::det_pr));
        scores.ass_re = any.then(|| self.hota.mean(HotaLevel::ass_re));
        scores.ass_pr = any.then(|| self.hota.mean(HotaLevel::ass_pr));
        scores.mota = any.then(|| self.clear.mota());
        scores.motp = (self.clear.tp > 0).then(|| self.clear.motp());
        scores.idf1 = any.then(|| self.identity.idf1());
        scores.idp = any.then(|| self.identity.idp());
        scores.idr = any.then(|| self.identity.idr());
        scores.recall = any.then(|| self.clear.recall());
        scores.recall_free = self.visibility.free.recall();
        scores.recall_partly_hidden = self.visibility.partly_hidden.recall();
        scores.precision = (self.reports > 0).then(|| self.clear.precision());
        scores.fp_per_frame = (self.clear.frames > 0).then(|| self.clear.fp_per_frame());
        scores.lamr = self.detections.log_average_miss_rate();
        scores.average_precision = self.detections.average_precision();
    }

    fn add_places(&self, scores: &mut Scores) {
        scores.ospa = self.sets.ospa();
        scores.gospa = self.sets.gospa();
        if let Some(error) = PositionError::of(&self.position_errors_m) {
            scores.position_error_mean_m = Some(error.mean_m);
            scores.position_error_rms_m = Some(error.rms_m);
            scores.position_error_p95_m = Some(error.p95_m);
            scores.position_error_max_m = Some(error.max_m);
        }
    }

    fn add_times(&self, scores: &mut Scores) {
        scores.time_to_confirm_mean_s = tagalong_math::mean(&self.times.confirm_s);
        scores.never_confirmed = self.times.never_confirmed;
        scores.time_to_reacquire_mean_s = tagalong_math::mean(&self.times.reacquire_s);
        scores.never_reacquired = self.times.never_reacquired;
        scores.wrong_person_s = self.times.wrong_person_s;
    }
}

/// All figures of a run under the names that are usual in the field, as one flat object.
///
/// Rates lie between 0 and 1 (MOTA may be negative). A figure that has no meaning for the input,
/// such as an accuracy without people, is absent.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Scores {
    /// Higher order tracking accuracy, mean over the thresholds.
    #[serde(rename = "HOTA")]
    pub hota: Option<f64>,
    /// Detection accuracy.
    #[serde(rename = "DetA")]
    pub det_a: Option<f64>,
    /// Association accuracy.
    #[serde(rename = "AssA")]
    pub ass_a: Option<f64>,
    /// Localisation accuracy.
    #[serde(rename = "LocA")]
    pub loc_a: Option<f64>,
    /// Detection recall.
    #[serde(rename = "DetRe")]
    pub det_re: Option<f64>,
    /// Detection precision.
    #[serde(rename = "DetPr")]
    pub det_pr: Option<f64>,
    /// Association recall.
    #[serde(rename = "AssRe")]
    pub ass_re: Option<f64>,
    /// Association precision.
    #[serde(rename = "AssPr")]
    pub ass_pr: Option<f64>,
    /// Multiple object tracking accuracy.
    #[serde(rename = "MOTA")]
    pub mota: Option<f64>,
    /// Mean similarity of the matches.
    #[serde(rename = "MOTP")]
    pub motp: Option<f64>,
    /// Harmonic mean of identity precision and recall.
    #[serde(rename = "IDF1")]
    pub idf1: Option<f64>,
    /// Identity precision.
    #[serde(rename = "IDP")]
    pub idp: Option<f64>,
    /// Identity recall.
    #[serde(rename = "IDR")]
    pub idr: Option<f64>,
    /// Identity true positives.
    #[serde(rename = "IDTP")]
    pub idtp: u64,
    /// Identity false positives.
    #[serde(rename = "IDFP")]
    pub idfp: u64,
    /// Identity false negatives.
    #[serde(rename = "IDFN")]
    pub idfn: u64,
    /// Identity switches.
    #[serde(rename = "IDSW")]
    pub idsw: u64,
    /// Matches of a person with the ID that another person had last.
    #[serde(default)]
    pub inherited_ids: u64,
    /// Reports without a truth.
    #[serde(rename = "FP")]
    pub fp: u64,
    /// Truths without a report.
    #[serde(rename = "FN")]
    pub fn_: u64,
    /// Matched truths.
    #[serde(rename = "TP")]
    pub tp: u64,
    /// Fragmentations.
    #[serde(rename = "Frag")]
    pub frag: u64,
    /// Mostly tracked people.
    #[serde(rename = "MT")]
    pub mt: u64,
    /// Partly tracked people.
    #[serde(rename = "PT")]
    pub pt: u64,
    /// Mostly lost people.
    #[serde(rename = "ML")]
    pub ml: u64,
    /// Fraction of the truths that were matched.
    pub recall: Option<f64>,
    /// The same for people within 5 m of the camera with at least 90 % visible; absent if the truth
    /// does not contain this.
    #[serde(default)]
    pub recall_free: Option<f64>,
    /// The same for those with 60 to 90 % visible.
    #[serde(default)]
    pub recall_partly_hidden: Option<f64>,
    /// Fraction of the reports that were matched.
    pub precision: Option<f64>,
    /// False positives per frame.
    pub fp_per_frame: Option<f64>,
    /// Log-average miss rate, lower is better.
    #[serde(rename = "LAMR")]
    pub lamr: Option<f64>,
    /// Area under the precision-recall curve of single reports.
    #[serde(rename = "AP")]
    pub average_precision: Option<f64>,
    /// Mean optimal sub-pattern assignment distance, lower is better: metres,
    /// or `1 - IoU` in the image.
    #[serde(rename = "OSPA")]
    pub ospa: Option<f64>,
    /// Mean generalised OSPA distance, in the same unit.
    #[serde(rename = "GOSPA")]
    pub gospa: Option<f64>,
    /// Position error of the matches on the floor, mean, in metres.
    pub position_error_mean_m: Option<f64>,
    /// Root of its mean square.
    pub position_error_rms_m: Option<f64>,
    /// Its 95th percentile.
    pub position_error_p95_m: Option<f64>,
    /// Its maximum.
    pub position_error_max_m: Option<f64>,
    /// Mean time from coming into view to the first match, in seconds.
    pub time_to_confirm_mean_s: Option<f64>,
    /// People that were never matched.
    pub never_confirmed: u64,
    /// Mean time from a loss to the next match, in seconds.
    pub time_to_reacquire_mean_s: Option<f64>,
    /// Losses that did not end.
    pub never_reacquired: u64,
    /// Time that tracks spent on another person than their first one, in seconds.
    pub wrong_person_s: f64,
    /// Number of frames.
    pub frames: u64,
    /// Truths that count, over all frames.
    pub truths: u64,
    /// Reports that count, over all frames.
    pub reports: u64,
    /// Number of different people.
    pub truth_ids: u64,
    /// Number of different tracks.
    pub track_ids: u64,
    /// Number of distinct scores among single reports; 0 without any, or if it was not counted.
    #[serde(default)]
    pub distinct_scores: u64,
}

impl Scores {
    /// Returns true if all reports have the same score: LAMR and AP then have no meaning, because
    /// they depend on the order of the scores.
    pub fn has_constant_scores(&self) -> bool {
        self.distinct_scores == 1 && self.reports > 1
    }

    /// Scores one sequence with the usual settings.
    ///
    /// # Errors
    ///
    /// See [`Prepared::new`].
    pub fn measure(
        sequence: &Sequence,
        comparison: impl Into<Comparison>,
    ) -> Result<Self, EvalError> {
        Ok(Tally::measure(sequence, &comparison.into(), &SetDistance::default())?.scores())
    }
}
