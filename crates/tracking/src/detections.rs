//! Detections of one frame, with the decisions that the tracker makes about them.

use nalgebra::Point2;
use tagalong_core::{Associations, Detection, Funnel, Matched, Track, TrackId};
use tagalong_geometry::Rect;

use crate::{Candidate, Fate, MergeSettings};

/// A detection with its decision, if any.
#[derive(Clone, Debug)]
pub(crate) struct PendingDetection {
    pub(crate) detection: Detection,
    /// Index of its detector.
    pub(crate) detector: usize,
    /// Its score before verification.
    pub(crate) detector_log_odds: f64,
    /// True if a search of the whole image found it.
    pub(crate) discovered: bool,
    /// Decision about the detection; `None` while it is open.
    pub(crate) fate: Option<Fate>,
}

impl PendingDetection {
    pub(crate) fn new(detection: Detection, detector: usize, discovered: bool) -> Self {
        let detector_log_odds = detection.score;
        Self { detection, detector, detector_log_odds, discovered, fate: None }
    }

    /// Returns the detection with its fate.
    pub(crate) fn with(self, fate: Fate) -> Self {
        Self { fate: Some(fate), ..self }
    }

    /// Returns the test that a score below `start_log_odds` fails.
    pub(crate) fn score_test(&self, start_log_odds: f64) -> &'static str {
        if self.detector_log_odds >= start_log_odds { "verifier" } else { "score" }
    }
}

/// All detections of one frame, and their associations with tracks.
#[derive(Default)]
pub(crate) struct DetectionSet {
    all: Vec<PendingDetection>,
    /// Track, index of the detection, weight.
    pairs: Vec<(TrackId, usize, f64)>,
    /// The places in `pairs` of each track, in the order of the tracks.
    places: Vec<(TrackId, usize)>,
}

impl DetectionSet {
    pub(crate) fn add(&mut self, pending: impl IntoIterator<Item = PendingDetection>) {
        self.all.extend(pending);
    }

    /// Returns the detections with their tracks, for the filter.
    pub(crate) fn matched(&self) -> Vec<Matched<'_>> {
        self.pairs
            .iter()
            .map(|(id, index, weight)| Matched::weighted(*id, &self.all[*index].detection, *weight))
            .collect()
    }

    /// Returns the most probable detection of a track that the filter accepted.
    pub(crate) fn of_track(&self, id: TrackId) -> Option<&PendingDetection> {
        self.heaviest(id).map(|index| &self.all[index])
    }

    /// Returns the probability that a track was detected at all.
    pub(crate) fn weight_of_track(&self, id: TrackId) -> f64 {
        self.pairs_of(id).map(|(.., weight)| weight).sum()
    }

    fn heaviest(&self, id: TrackId) -> Option<usize> {
        let heaviest = self.pairs_of(id).max_by(|a, b| a.2.total_cmp(&b.2));
        heaviest.map(|(_, index, _)| *index)
    }

    /// Returns the pairs of a track. Each track asks for its own several times a frame, which was
    /// a look at all pairs of all tracks.
    fn pairs_of(&self, id: TrackId) -> impl Iterator<Item = &(TrackId, usize, f64)> {
        let from = self.places.partition_point(|(track, _)| *track < id);
        let own = self.places[from..].iter().take_while(move |(track, _)| *track == id);
        own.map(|(_, place)| &self.pairs[*place])
    }

    fn sort_places(&mut self) {
        let places = self.pairs.iter().enumerate().map(|(place, (id, ..))| (*id, place));
        self.places.clear();
        self.places.extend(places);
        self.places.sort_unstable();
    }

    /// Changes the detections of a track, and returns the most probable one afterwards.
    pub(crate) fn change_of_track(
        &mut self,
        id: TrackId,
        mut change: impl FnMut(&mut Detection),
    ) -> Option<&Detection> {
        let own: Vec<usize> = self.pairs_of(id).map(|(_, index, _)| *index).collect();
        own.into_iter().for_each(|index| change(&mut self.all[index].detection));
        self.heaviest(id).map(|index| &self.all[index].detection)
    }

    /// Returns the indices of the detections without a decision.
    pub(crate) fn undecided(&self) -> Vec<usize> {
        (0..self.all.len()).filter(|i| self.all[*i].fate.is_none()).collect()
    }

    /// Returns the detections without a decision.
    pub(crate) fn undecided_detections(&self) -> Vec<Detection> {
        self.undecided().into_iter().map(|i| self.all[i].detection.clone()).collect()
    }

    pub(crate) fn get(&self, index: usize) -> &PendingDetection {
        &self.all[index]
    }

    pub(crate) fn settle(&mut self, index: usize, fate: Fate) {
        self.all[index].fate = Some(fate);
    }

    /// Keeps one detection per person, the one with the best score: two detectors may have found
    /// the same person, and so may the searches near two tracks.
    pub(crate) fn merge(&mut self, settings: &MergeSettings) {
        let mut order = self.undecided();
        order.sort_by(|a, b| self.score(*b).total_cmp(&self.score(*a)));
        let mut kept: Vec<(usize, Outline)> = Vec::new();
        for index in order {
            let detection = &self.all[index].detection;
            let own = Outline::of(detection);
            let better = kept.iter().find(|(other, outline)| {
                own.is_at(outline, settings)
                    || own.overlaps(outline, settings)
                        && may_be_at_one_place(detection, &self.all[*other].detection)
            });
            match better.map(|(better, _)| *better) {
                Some(better) => {
                    self.all[better].discovered |= self.all[index].discovered;
                    self.settle(index, Fate::Dropped("same person"));
                }
                None => kept.push((index, own)),
            }
        }
    }

    /// Drops the detections with the lowest scores if there are too many.
    pub(crate) fn limit(&mut self, most: usize) {
        let mut open = self.undecided();
        let excess = self.all.len().saturating_sub(most).min(open.len());
        open.sort_by(|a, b| self.score(*a).total_cmp(&self.score(*b)));
        for index in open.into_iter().take(excess) {
            self.settle(index, Fate::Dropped("too many detections"));
        }
    }

    /// Applies the decisions of the associator about the detections at the indices `open`.
    pub(crate) fn take_over(&mut self, answer: &Associations, tracks: &[Track], open: &[usize]) {
        // A detection that several tracks share is reported with the most probable one.
        let mut most = vec![f64::NEG_INFINITY; open.len()];
        for pair in &answer.pairs {
            let id = tracks[pair.track].id;
            let index = open[pair.detection];
            self.pairs.push((id, index, pair.weight));
            if pair.weight >= most[pair.detection] {
                most[pair.detection] = pair.weight;
                self.all[index].fate = Some(Fate::Matched(id));
            }
        }
        self.sort_places();
        for spent in answer.spent.iter().filter_map(|at| open.get(*at)) {
            self.all[*spent].fate.get_or_insert(Fate::Dropped("associator"));
        }
    }

    /// Drops the detections of tracks that the filter does not support.
    pub(crate) fn reject(&mut self, is_supported: impl Fn(TrackId) -> bool, test: &'static str) {
        self.pairs.retain(|(id, ..)| is_supported(*id));
        self.sort_places();
        for pending in &mut self.all {
            if let Some(Fate::Matched(id)) = pending.fate
                && !is_supported(id)
            {
                pending.fate = Some(Fate::Dropped(test));
            }
        }
    }

    /// Returns the candidates of the report, and counts dropped ones.
    pub(crate) fn into_candidates(self, funnel: &mut Funnel) -> Vec<Candidate> {
        self.all
            .into_iter()
            .map(|pending| {
                let fate = pending.fate.unwrap_or(Fate::Dropped("score"));
                if let Fate::Dropped(test) = fate {
                    funnel.drop_detection(test, &pending.detection);
                }
                Candidate { detection: pending.detection, fate }
            })
            .collect()
    }

    fn score(&self, index: usize) -> f64 {
        self.all[index].detection.score
    }
}

/// Parts of a detection that decide about most pairs.
#[derive(Clone, Copy)]
struct Outline {
    floor: Point2<f64>,
    rect: Option<Rect>,
}

impl Outline {
    fn of(detection: &Detection) -> Self {
        Self { floor: detection.position.xy(), rect: detection.rect() }
    }

    fn is_at(&self, other: &Self, settings: &MergeSettings) -> bool {
        (self.floor - other.floor).norm() < settings.same_person_m
    }

    fn overlaps(&self, other: &Self, settings: &MergeSettings) -> bool {
        self.rect.zip(other.rect).is_some_and(|(a, b)| a.iou(&b) > settings.same_person_iou)
    }
}

/// Returns true if the positions differ by no more than their covariances allow: two people in one
/// line of sight overlap in the image as well.
fn may_be_at_one_place(a: &Detection, b: &Detection) -> bool {
    let apart = (a.position - b.position).xy();
    let spread = (a.covariance + b.covariance).fixed_view::<2, 2>(0, 0).into_owned();
    let distance = spread.cholesky().map(|s| apart.dot(&s.solve(&apart)));
    distance.is_some_and(|d| d.is_nan() || d <= CHI_SQUARED_2_99)
}

/// 99 % point of chi-squared with two degrees of freedom.
const CHI_SQUARED_2_99: f64 = 9.21;

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Point3};
    use tagalong_core::Association;
    use tagalong_geometry::{Camera, ImageBox, Pinhole};

    use super::*;

    fn is_same_person(a: &Detection, b: &Detection, settings: &MergeSettings) -> bool {
        let both = [a, b].map(|detection| PendingDetection::new(detection.clone(), 0, true));
        let mut set = DetectionSet::default();
        set.add(both);
        set.merge(settings);
        set.undecided().len() == 1
    }

    fn person(x: f64, y: f64) -> Detection {
        let position = Point3::new(x, y, 1.6);
        Detection::new("test", position, Matrix3::identity() * 0.01, 1.0).with_image(
            ImageBox::upper_body(
                Camera::mounted(Pinhole::centred(500.0, 640, 480), 640, 480, 1.2, 0.0, 0.0)
                    .upper_body(&position),
            ),
        )
    }

    #[test]
    fn two_people_one_behind_the_other_are_two_unless_their_range_is_unknown() {
        fn vague(d: Detection) -> Detection {
            d.with_covariance(Matrix3::identity() * 4.0)
        }

        let settings = MergeSettings::default();
        let near = person(3.0, 0.0);
        let far = person(3.6, 0.0);
        assert!(near.rect().unwrap().iou(&far.rect().unwrap()) > settings.same_person_iou);
        assert!(!is_same_person(&near, &far, &settings));
        assert!(is_same_person(&vague(near), &vague(far), &settings));
    }

    #[test]
    fn detections_at_one_place_are_of_one_person_whatever_the_image_says() {
        fn at(x: f64, y: f64, region_x: f64) -> Detection {
            let region = Rect::new(region_x, 0.0, 100.0, 100.0);
            person(x, y)
                .with_image(ImageBox::upper_body(region))
                .with_covariance(Matrix3::identity() * 0.02)
        }

        let settings = MergeSettings::default();
        let first = at(3.0, 0.0, 0.0);
        assert!(is_same_person(&first, &at(3.0, 0.24, 500.0), &settings));
        assert!(!is_same_person(&first, &at(3.0, 0.26, 500.0), &settings));
        // 0.6 m are three standard deviations of the difference: squared 9, of 9.21.
        assert!(is_same_person(&first, &at(3.0, 0.6, 30.0), &settings));
        assert!(!is_same_person(&first, &at(3.0, 0.61, 30.0), &settings));
        assert!(!is_same_person(&first, &at(3.0, 0.6, 34.0), &settings), "they overlap by less");
    }

    fn tracks(ids: &[u32]) -> Vec<Track> {
        let person = tagalong_core::Person {
            position: Point3::new(3.0, 0.0, 1.6),
            velocity: nalgebra::Vector2::zeros(),
        };
        let estimate =
            tagalong_core::Estimate::new(person, nalgebra::SMatrix::identity(), Rect::default());
        ids.iter()
            .map(|id| Track::new(TrackId(*id), estimate.clone(), 1.0).with_seen(false))
            .collect()
    }

    #[test]
    fn the_least_likely_of_too_many_detections_are_dropped() {
        let mut set = DetectionSet::default();
        let scored = [2.0, 0.5, 3.0].map(|score| person(2.0 + score, 0.0).with_score(score));
        set.add(scored.map(|detection| PendingDetection::new(detection, 0, true)));
        set.limit(2);
        let kept: Vec<f64> = set.undecided().into_iter().map(|index| set.score(index)).collect();
        assert_eq!(kept, [2.0, 3.0]);
    }

    /// Track 7 has two alternatives; track 9 shares the second one, and the third is spent.
    #[test]
    fn a_detection_goes_to_the_track_that_it_is_most_probably_of() {
        fn pair(track: usize, detection: usize, weight: f64) -> Association {
            Association::new(track, detection, weight)
        }

        let mut set = DetectionSet::default();
        let detections = [person(2.0, 0.0), person(3.0, 0.0), person(4.0, 0.0), person(5.0, 0.0)];
        set.add(detections.map(|detection| PendingDetection::new(detection, 0, true)));
        let pairs = vec![pair(0, 0, 0.6), pair(0, 1, 0.3), pair(1, 1, 0.5)];
        let answer = Associations::new(pairs).with_spent(vec![2]);
        set.take_over(&answer, &tracks(&[7, 9]), &[0, 1, 2, 3]);
        let fates: Vec<_> = (0..4).map(|i| set.get(i).fate).collect();
        let first = Fate::Matched(TrackId(7));
        let second = Fate::Matched(TrackId(9));
        assert_eq!(fates, [Some(first), Some(second), Some(Fate::Dropped("associator")), None]);
        assert_eq!(set.of_track(TrackId(7)).unwrap().detection.position.x, 2.0);
        assert_eq!(set.matched().len(), 3);
        set.reject(|id| id == TrackId(7), "filter");
        assert_eq!((set.matched().len(), set.get(1).fate), (2, Some(Fate::Dropped("filter"))));
    }
}
