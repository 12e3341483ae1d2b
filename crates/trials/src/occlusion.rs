use tagalong_core::TrackId;
use tagalong_pipeline::FrameReport;
use tagalong_sim::Truth;

use crate::crossing::in_image;
use crate::{Run, Trial};

/// Visible fraction below which a person is hidden.
const HIDDEN: f64 = 0.2;
/// Visible fraction above which a person is in view again.
const VISIBLE: f64 = 0.5;
/// Maximum distance between a track and its person, m.
const NEAR_M: f64 = 0.5;
/// Maximum time before the occlusion in which the track of the person is looked for, and after it
/// until the person must be found again, s.
const PATIENCE_S: f64 = 1.5;

/// Time during which a person was hidden behind another one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Occlusion {
    /// Hidden person.
    pub person: u16,
    /// Occluding person.
    pub behind: u16,
    /// Index of the first hidden moment.
    pub first: usize,
    /// Index of the moment in which the person is in view again.
    pub again: usize,
    /// Time between the two, s.
    pub duration_s: f64,
    /// Distance between the two people in the middle of that time, m.
    pub gap_m: f64,
}

/// Result of a contender for an occlusion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Outcome {
    /// The same track continues.
    Kept,
    /// The person was found again with a new ID.
    Renamed,
    /// The person was found again with the ID of another person.
    Swapped,
    /// The person was not found again in time.
    Lost,
    /// The person had no track before, so the occlusion cannot be scored.
    Untracked,
}

/// Returns all occlusions of a scene that end within it, sorted by person and time.
pub fn occlusions(trial: &Trial) -> Vec<Occlusion> {
    let mut people: Vec<u16> =
        trial.moments.iter().flat_map(|m| &m.truth).map(|truth| truth.id).collect();
    people.sort_unstable();
    people.dedup();
    people.into_iter().flat_map(|person| of_person(trial, person)).collect()
}

fn of_person(trial: &Trial, person: u16) -> Vec<Occlusion> {
    let mut all = Vec::new();
    let mut since: Option<(usize, u16)> = None;
    for index in 0..trial.moments.len() {
        let Some(truth) = truth(trial, index, person) else { continue };
        if in_image(truth, &trial.camera) < VISIBLE {
            since = None;
            continue;
        }
        match (since, truth.occluder) {
            (None, Some(behind)) if truth.visible_fraction < HIDDEN => {
                since = Some((index, behind))
            }
            (Some((first, behind)), _) if truth.visible_fraction > VISIBLE => {
                all.extend(occlusion(trial, person, behind, first, index));
                since = None;
            }
            _ => {}
        }
    }
    all
}

fn occlusion(
    trial: &Trial,
    person: u16,
    behind: u16,
    first: usize,
    again: usize,
) -> Option<Occlusion> {
    let middle = (first + again) / 2;
    let a = truth(trial, middle, person)?;
    let b = truth(trial, middle, behind)?;
    Some(Occlusion {
        person,
        behind,
        first,
        again,
        duration_s: trial.moments[again].stamp.seconds_since(trial.moments[first].stamp),
        gap_m: (a.head_in_robot - b.head_in_robot).xy().norm(),
    })
}

/// Returns what happened to the person's track.
pub fn outcome(trial: &Trial, run: &Run, occlusion: &Occlusion) -> Outcome {
    let Occlusion { person, first, again, .. } = *occlusion;
    let mut earlier = (0..first).rev().take_while(|index| are_close(trial, first, *index));
    let before = earlier.find_map(|index| track_at(trial, &run.reports[index], index, person));
    let Some(before) = before else { return Outcome::Untracked };
    let mut later = (again..trial.moments.len()).take_while(|at| are_close(trial, again, *at));
    match later.find_map(|index| track_at(trial, &run.reports[index], index, person)) {
        None => Outcome::Lost,
        Some(after) if after == before => Outcome::Kept,
        Some(after) if existed(&run.reports[..first], after) => Outcome::Swapped,
        Some(_) => Outcome::Renamed,
    }
}

/// Returns true if two moments are so close that a track at one of them counts at the other.
fn are_close(trial: &Trial, from: usize, index: usize) -> bool {
    let a = trial.moments[from].stamp;
    let b = trial.moments[index].stamp;
    b.seconds_since(a).abs() <= PATIENCE_S
}

fn existed(reports: &[FrameReport], id: TrackId) -> bool {
    reports.iter().flat_map(|report| &report.tracks).any(|track| track.confirmed && track.id == id)
}

/// Returns the confirmed track, observed in this frame, that is nearest to a person, if it is near
/// enough and not nearer to another person.
fn track_at(trial: &Trial, report: &FrameReport, index: usize, person: u16) -> Option<TrackId> {
    fn distance(truth: &Truth, track: &tagalong_core::Track) -> f64 {
        (track.estimate.person.position - truth.head_in_robot).xy().norm()
    }

    let moment = &trial.moments[index];
    let own = truth(trial, index, person)?;
    report
        .tracks
        .iter()
        .filter(|track| track.confirmed && track.seen && distance(own, track) <= NEAR_M)
        .filter(|track| {
            moment.truth.iter().all(|other| distance(own, track) <= distance(other, track))
        })
        .min_by(|a, b| distance(own, a).total_cmp(&distance(own, b)))
        .map(|track| track.id)
}

fn truth(trial: &Trial, index: usize, person: u16) -> Option<&Truth> {
    trial.moments[index].truth.iter().find(|truth| truth.id == person)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{FloorPosition, Path, trial};

    /// Person 2 walks behind person 1 and is hidden from frame 10 to 19.
    fn after(places: Option<(f64, f64)>, id: u32) -> Outcome {
        let mut behind = [(4.0, 0.2, 1.0); 40];
        behind[10..20].fill((4.0, 0.0, 0.0));
        let mut before = [Some((4.0, 0.2)); 40];
        before[10..].fill(None);
        let mut later = [None; 40];
        later[22..].fill(places);
        let mut one: Vec<FloorPosition> = vec![Some((3.0, 0.0)); 40];
        let mut tracks: Vec<(u32, Vec<FloorPosition>)> = vec![(2, before.to_vec())];
        match id {
            1 => one[22..].fill(places),
            2 => tracks[0].1[22..].copy_from_slice(&later[22..]),
            _ => tracks.push((id, later.to_vec())),
        }
        tracks.push((1, one));
        let tracks: Vec<Path<'_>> =
            tracks.iter().map(|(id, places)| (*id, places.as_slice())).collect();
        let trial = trial(&[&[(3.0, 0.0, 1.0); 40], &behind], &tracks);
        let all = occlusions(&trial);
        assert_eq!(all.len(), 1);
        assert_eq!((all[0].person, all[0].behind, all[0].first, all[0].again), (2, 1, 10, 20));
        assert!((all[0].duration_s - 1.0).abs() < 1e-9 && (all[0].gap_m - 1.0).abs() < 1e-9);
        outcome(&trial, &trial.runs[0], &all[0])
    }

    #[test]
    fn all_ends_of_an_occlusion_are_told_apart() {
        let there = Some((4.0, 0.2));
        assert_eq!(after(there, 2), Outcome::Kept);
        assert_eq!(after(there, 7), Outcome::Renamed);
        assert_eq!(after(there, 1), Outcome::Swapped);
        assert_eq!(after(None, 2), Outcome::Lost);
        assert_eq!(after(Some((4.0, 2.0)), 2), Outcome::Lost);
    }

    #[test]
    fn who_leaves_the_image_hidden_was_not_occluded() {
        let mut places = [(4.0, 0.0, 0.1); 10];
        places[0] = (4.0, 0.0, 1.0);
        places[9] = (4.0, 9.0, 0.0);
        assert!(occlusions(&trial(&[&[(3.0, 0.0, 1.0); 10], &places], &[])).is_empty());
    }
}
