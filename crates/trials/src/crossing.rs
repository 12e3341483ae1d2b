use std::collections::BTreeSet;

use nalgebra::Vector2;
use tagalong_core::{Track, TrackId};
use tagalong_geometry::Camera;
use tagalong_sim::Truth;

use crate::{Run, Trial};

/// Conditions for the success of a crossing. P3, Table I, demands that both people are tracked in
/// all frames, without stating the maximum distance of a track. Here, one and the same track must
/// stay within half the shoulder width of each person.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// Time in view after which a newcomer must have a track, s.
    pub settle_s: f64,
    /// Maximum error of a head, m: half the shoulder width of a person 1.7 m tall (0.1295 of the
    /// height).
    pub max_error_m: f64,
    /// If true, only the error across the line of sight counts, as in the papers, whose errors are
    /// in pixels; otherwise the distance on the floor.
    pub across_only: bool,
    /// A person counts while this fraction of the upper body is in the image, whether hidden or
    /// not.
    pub min_in_image: f64,
    /// Frames in which less than this fraction of a person's upper body is visible do not count for
    /// that person; with 0 completely hidden people count as well, whose position can only be
    /// guessed.
    pub min_visible: f64,
}

impl Default for Crossing {
    fn default() -> Self {
        Self {
            settle_s: 1.0,
            max_error_m: 0.22,
            across_only: false,
            min_in_image: 0.75,
            min_visible: 0.0,
        }
    }
}

/// Result of a successful crossing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Span {
    /// Error of each head in each frame, m.
    pub errors_m: Vec<f64>,
}

/// Reason why a crossing failed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Failing {
    /// A person was in view for `settle_s` without a track.
    NotFound {
        /// The person.
        person: u16,
    },
    /// A person's track ended.
    Lost {
        /// The person.
        person: u16,
        /// Time of the loss, s since the start.
        at_s: f64,
    },
    /// A person's track was at another position, possibly on another person.
    Astray {
        /// The person.
        person: u16,
        /// Time of the error, s since the start.
        at_s: f64,
    },
    /// No person was ever in view.
    Nobody,
}

/// Evaluates a crossing: every person in view must keep one track in all frames. Predicted tracks
/// count, because a hidden person can only be predicted.
///
/// # Errors
/// The first failure, person by person.
pub fn crossing(trial: &Trial, run: &Run, rules: &Crossing) -> Result<Span, Failing> {
    let people: BTreeSet<u16> =
        trial.moments.iter().flat_map(|moment| &moment.truth).map(|truth| truth.id).collect();
    let mut span = Span::default();
    let mut taken = BTreeSet::new();
    for person in people {
        follow(trial, run, rules, person, &mut taken, &mut span)?;
    }
    if span.errors_m.is_empty() { Err(Failing::Nobody) } else { Ok(span) }
}

/// Follows one person through all frames.
fn follow(
    trial: &Trial,
    run: &Run,
    rules: &Crossing,
    person: u16,
    taken: &mut BTreeSet<TrackId>,
    span: &mut Span,
) -> Result<(), Failing> {
    let mut own = None;
    let mut in_view_since = None;
    for (moment, report) in trial.moments.iter().zip(&run.reports) {
        let truth = moment.truth.iter().find(|truth| truth.id == person);
        let Some(truth) = truth.filter(|t| {
            in_image(t, &trial.camera) >= rules.min_in_image
                && t.visible_fraction >= rules.min_visible
        }) else {
            continue;
        };
        // A frame that the pipeline skipped contains no information about the tracks.
        if !report.outcome.is_processed() {
            continue;
        }
        let at_s = moment.stamp.nanos() as f64 / 1e9;
        // The time to start a track counts from the first frame in view.
        let since = *in_view_since.get_or_insert(at_s);
        let mut confirmed = report.tracks.iter().filter(|track| track.confirmed);
        match own {
            None => {
                own = confirmed
                    // A track that belongs to another person cannot be the one that finds this
                    // person again.
                    .filter(|t| !taken.contains(&t.id))
                    .filter(|t| rules.error_m(truth, t, &trial.camera) <= rules.max_error_m)
                    .map(|t| (apart_m(truth, t), t.id))
                    .filter(|(apart_m, _)| *apart_m < SAME_M)
                    .min_by(|a, b| a.0.total_cmp(&b.0))
                    .map(|(_, id)| id);
                if own.is_none() && at_s - since > rules.settle_s {
                    return Err(Failing::NotFound { person });
                }
                taken.extend(own);
            }
            Some(id) => {
                let track = confirmed.find(|track| track.id == id);
                let track = track.ok_or(Failing::Lost { person, at_s })?;
                let error = rules.error_m(truth, track, &trial.camera);
                if error > rules.max_error_m {
                    return Err(Failing::Astray { person, at_s });
                }
                span.errors_m.push(error);
            }
        }
    }
    Ok(())
}

/// Distance from which on a person in the same direction must be another one, m.
const SAME_M: f64 = 1.0;

/// Returns the distance on the floor, m.
fn apart_m(truth: &Truth, track: &Track) -> f64 {
    (track.estimate.person.position - truth.head_in_robot).xy().norm()
}

impl Crossing {
    fn error_m(&self, truth: &Truth, track: &Track, camera: &Camera) -> f64 {
        if !self.across_only {
            return apart_m(truth, track);
        }
        // Errors along the line of sight, which are those of the depth, do not count.
        let off = (track.estimate.person.position - truth.head_in_robot).xy();
        let eye = camera.robot_from_camera.translation.vector;
        let sight = (truth.head_in_robot.coords - eye).xy();
        let across = Vector2::new(-sight.y, sight.x).try_normalize(1e-6);
        across.map_or(off.norm(), |across| off.dot(&across).abs())
    }
}

/// Returns the fraction of the upper body that is in the image, whether hidden or not.
pub(crate) fn in_image(truth: &Truth, camera: &Camera) -> f64 {
    let whole = camera.upper_body(&truth.head_in_robot);
    let inside = whole.clipped(camera.width, camera.height);
    if whole.area() > 0.0 { inside.area() / whole.area() } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Path, trial};

    fn judged(tracks: &[Path<'_>]) -> Result<Span, Failing> {
        let people: [&[_]; 2] = [&[(3.0, 0.5, 1.0); 20], &[(4.0, -0.5, 1.0); 20]];
        let trial = trial(&people, tracks);
        crossing(&trial, &trial.runs[0], &Crossing::default())
    }

    #[test]
    fn good_tracks_are_a_success_with_their_errors() {
        let span = judged(&[(1, &[Some((3.0, 0.6)); 20]), (2, &[Some((4.0, -0.5)); 20])]).unwrap();
        assert_eq!(span.errors_m.len(), 2 * 19);
        assert!((span.errors_m[0] - 0.1).abs() < 1e-12 && span.errors_m[20] < 1e-12);
    }

    #[test]
    fn swaps_losses_and_misses_are_told_apart() {
        let mut first = [Some((3.0, 0.5)); 20];
        let mut second = [Some((4.0, -0.5)); 20];
        first[12..].fill(Some((4.0, -0.5)));
        second[12..].fill(Some((3.0, 0.5)));
        let swapped = judged(&[(1, &first), (2, &second)]);
        assert_eq!(swapped, Err(Failing::Astray { person: 1, at_s: 1.2 }));
        second[12..].fill(None);
        let lost = judged(&[(1, &[Some((3.0, 0.5)); 20]), (2, &second)]);
        assert_eq!(lost, Err(Failing::Lost { person: 2, at_s: 1.2 }));
        let missed = judged(&[(1, &[Some((3.0, 0.5)); 20])]);
        assert_eq!(missed, Err(Failing::NotFound { person: 2 }));
    }

    #[test]
    fn one_track_is_not_enough_for_two() {
        let people: [&[_]; 2] = [&[(3.0, 0.0, 1.0); 20], &[(3.1, 0.0, 1.0); 20]];
        let trial = trial(&people, &[(1, &[Some((3.0, 0.0)); 20])]);
        let judged = crossing(&trial, &trial.runs[0], &Crossing::default());
        assert_eq!(judged, Err(Failing::NotFound { person: 2 }));
    }

    #[test]
    fn along_the_view_papers_see_no_error() {
        let off = [Some((3.5, 0.0)); 20];
        let trial = trial(&[&[(3.0, 0.0, 1.0); 20]], &[(1, &off)]);
        let rules = Crossing { across_only: true, ..Crossing::default() };
        assert!(crossing(&trial, &trial.runs[0], &rules).is_ok());
        assert!(crossing(&trial, &trial.runs[0], &Crossing::default()).is_err());
    }

    #[test]
    fn somebody_farther_off_in_the_same_direction_is_another_one() {
        let tracks: [(u32, &[_]); 2] = [(1, &[Some((5.0, 0.0)); 20]), (2, &[Some((3.2, 0.3)); 20])];
        let near = [(3.0, 0.2, 1.0); 20];
        let trial = trial(&[&near], &tracks);
        let rules = Crossing { across_only: true, ..Crossing::default() };
        assert_eq!(
            crossing(&trial, &trial.runs[0], &rules).map(|span| span.errors_m.len()),
            Ok(19)
        );
        let trial = crate::testing::trial(&[&near], &tracks[..1]);
        let alone = crossing(&trial, &trial.runs[0], &rules);
        assert_eq!(alone, Err(Failing::NotFound { person: 1 }));
    }

    #[test]
    fn where_a_hidden_person_is_believed_to_be_need_not_count() {
        let mut places = [(3.0, 0.0, 1.0); 20];
        places[8..12].fill((3.0, 0.0, 0.1));
        let mut track = [Some((3.0, 0.0)); 20];
        track[8..12].fill(Some((3.0, 0.5)));
        let trial = trial(&[&places], &[(1, &track)]);
        let [all, seen] = [0.0, 0.3].map(|min_visible| {
            crossing(&trial, &trial.runs[0], &Crossing { min_visible, ..Crossing::default() })
        });
        assert_eq!(all, Err(Failing::Astray { person: 1, at_s: 0.8 }));
        assert_eq!(seen.map(|span| span.errors_m.len()), Ok(15));
    }

    #[test]
    fn who_leaves_the_image_need_not_be_tracked() {
        let mut places = [(3.0, 0.0, 1.0); 20];
        places[10..].fill((3.0, 9.0, 0.0));
        let mut track = [Some((3.0, 0.0)); 20];
        track[10..].fill(None);
        let trial = trial(&[&places], &[(1, &track)]);
        assert!(crossing(&trial, &trial.runs[0], &Crossing::default()).is_ok());
    }
}
