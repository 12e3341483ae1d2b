//! IDs of people across tracks.
//!
//! A track is not a person: a later track may be of the same person as one that ended, and when
//! people occlude each other a track may switch from one to the other. This stage remembers the
//! appearance of each person, and decides under which ID a track is reported. It changes nothing
//! else: detection, association and filter work on tracks.
//!
//! An ID is taken over only if the appearance is similar, every other remembered person is clearly
//! less similar, and the person can have moved there: a wrong ID is worse than a new one.

mod person;
mod settings;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Point2;
use tagalong_core::{Detection, EgoMotion, Frame, Result, Track, TrackId};
use tagalong_vision::{Appearance, Describer};

use person::{Identity, Person};
pub use settings::{AppearanceEvidence, ReidentificationSettings};

use crate::{Fate, IdentityCorrection, IdentityDoubt, TrackingReport};

/// Numbers of the people of one frame.
#[derive(Default)]
pub(crate) struct People {
    /// Numbers by track, where they are not the track's own.
    numbers: BTreeMap<TrackId, TrackId>,
    /// Numbers that were reported and belong to no person any more.
    given_up: Vec<TrackId>,
    /// Tracks that may have changed over with others.
    doubts: Vec<IdentityDoubt>,
    /// Numbers of earlier frames that were wrong.
    corrections: Vec<IdentityCorrection>,
}

impl People {
    /// Puts the numbers of the people in place of those of the tracks.
    pub(crate) fn renumber(self, report: &mut TrackingReport) {
        report.doubts = self.doubts;
        report.corrections = self.corrections;
        if self.numbers.is_empty() && self.given_up.is_empty() {
            return;
        }
        let tracks = report.tracks.iter_mut().map(|track| &mut track.id);
        let measured = report.nis.iter_mut().map(|(id, ..)| id);
        let fates =
            report.candidates.iter_mut().filter_map(|candidate| match &mut candidate.fate {
                Fate::Matched(id) | Fate::Started(id) => Some(id),
                _ => None,
            });
        for id in tracks.chain(measured).chain(fates) {
            *id = self.numbers.get(id).copied().unwrap_or(*id);
        }
        report.ended.extend(self.given_up);
    }
}

/// The stage.
pub(crate) struct Reidentifier {
    settings: ReidentificationSettings,
    describer: Describer,
    /// Identity of each track.
    tracks: BTreeMap<TrackId, Identity>,
    /// People without a track.
    absent: Vec<Person>,
}

impl Reidentifier {
    pub(crate) fn new(settings: ReidentificationSettings, describer: Describer) -> Self {
        Self { settings, describer, tracks: BTreeMap::new(), absent: Vec::new() }
    }

    /// Takes in a frame, and returns the numbers of the people.
    ///
    /// # Errors
    /// The network that describes people fails.
    pub(crate) fn update(
        &mut self,
        frame: &Frame,
        motion: &EgoMotion,
        tracks: &[Track],
    ) -> Result<People> {
        if self.settings.remember_s == 0.0 {
            return Ok(People::default());
        }
        self.predict(motion);
        self.release_ended(tracks);
        self.note_rivals(tracks, frame.index);
        self.add_appearances(frame, tracks)?;
        let mut people = People::default();
        self.tell_apart(tracks, &mut people);
        self.recognise(tracks, &mut people);
        self.note_reported(tracks);
        for (id, identity) in &self.tracks {
            if *id != identity.person.number {
                people.numbers.insert(*id, identity.person.number);
            }
        }
        people.doubts = self.doubts(tracks);
        Ok(people)
    }

    /// Returns the confirmed tracks that may have changed over with others, from near to far.
    fn doubts(&self, tracks: &[Track]) -> Vec<IdentityDoubt> {
        let mut doubts = Vec::new();
        for track in tracks.iter().filter(|track| track.confirmed) {
            let Some(identity) = self.tracks.get(&track.id) else { continue };
            // A new track has no number yet that could be another person's.
            if !identity.is_new && !identity.rivals.is_empty() {
                let track = identity.person.number;
                doubts.push(IdentityDoubt {
                    track,
                    others: identity.rivals.iter().copied().collect(),
                });
            }
        }
        doubts
    }

    /// Returns the log-likelihood ratios of the appearances of tracks and detections, for the
    /// associator; none if positions alone decide. Between one track and one detection there is a
    /// choice only `with_births`: the detection may be of a new person.
    ///
    /// # Errors
    /// The network that describes people fails.
    pub(crate) fn compare(
        &self,
        frame: &Frame,
        tracks: &[Track],
        detections: &[Detection],
        with_births: bool,
    ) -> Result<Vec<Vec<f64>>> {
        let weight = self.settings.association_weight;
        let evidence = self.settings.association_evidence;
        let is_choice = with_births || tracks.len().max(detections.len()) > 1;
        if weight == 0.0 || self.settings.remember_s == 0.0 || !is_choice {
            return Ok(Vec::new());
        }
        let seen = detections.iter().map(|detection| self.describe(frame, detection));
        let seen = seen.collect::<Result<Vec<Option<Appearance>>>>()?;
        let most = self.settings.max_difference;
        let mut ratios = Vec::new();
        for track in tracks {
            let known = self.tracks.get(&track.id);
            let of_track = seen.iter().map(|seen| {
                let difference = known?.difference(seen.as_ref()?)?;
                Some(weight * evidence.log_ratio(difference, most))
            });
            ratios.push(of_track.map(|ratio| ratio.unwrap_or(0.0)).collect());
        }
        Ok(ratios)
    }

    /// Returns the appearance of a detection; `None` without a box that shows one.
    fn describe(&self, frame: &Frame, detection: &Detection) -> Result<Option<Appearance>> {
        let Some(image) = &detection.image else { return Ok(None) };
        self.describer.at(&image.rect, &detection.position, frame).map(Some)
    }

    /// Takes in a jump of the clock, which ended all tracks.
    pub(crate) fn reset(&mut self, pause_s: f64) {
        self.release_ended(&[]);
        self.absent.iter_mut().for_each(|person| person.lose_place(pause_s));
    }

    /// Moves all memories into the robot's new frame, and forgets people long gone.
    fn predict(&mut self, motion: &EgoMotion) {
        for identity in self.tracks.values_mut() {
            identity.person.predict(motion);
            identity.start = motion.apply_to_point(identity.start);
            identity.age_s += motion.dt;
        }
        self.absent.iter_mut().for_each(|person| person.predict(motion));
        let settings = &self.settings;
        self.absent.retain(|person| !person.is_forgotten(settings));
    }

    /// Keeps the people whose tracks ended.
    fn release_ended(&mut self, tracks: &[Track]) {
        let alive: BTreeSet<TrackId> = tracks.iter().map(|track| track.id).collect();
        let ended: Vec<TrackId> =
            self.tracks.keys().copied().filter(|id| !alive.contains(id)).collect();
        for mut identity in ended.into_iter().filter_map(|id| self.tracks.remove(&id)) {
            // Appearances after a contact may be of another person.
            if identity.rivals.is_empty() {
                identity.settle();
            }
            if identity.reported && identity.person.is_known() {
                self.absent.push(identity.person);
            }
        }
    }

    /// Notes new tracks, and which tracks may change over.
    fn note_rivals(&mut self, tracks: &[Track], frame: u64) {
        for track in tracks {
            self.tracks
                .entry(track.id)
                .or_insert_with(|| Identity::new(track.id, place(track), frame));
        }
        for (index, a) in tracks.iter().enumerate() {
            for b in &tracks[index + 1..] {
                // Tentative tracks are left out: clutter beside a person is no rival.
                let are_near = (place(a) - place(b)).norm() < self.settings.alone_m;
                if are_near && a.confirmed && b.confirmed {
                    self.add_rivals(a.id, b.id, frame);
                }
            }
        }
    }

    fn add_rivals(&mut self, a: TrackId, b: TrackId, frame: u64) {
        let both = (self.tracks.get(&a), self.tracks.get(&b));
        let (Some(first), Some(second)) = both else { return };
        for (id, rival) in [(a, second.person.number), (b, first.person.number)] {
            if let Some(identity) = self.tracks.get_mut(&id) {
                // Both directions, because either track may have taken the other's detections.
                identity.rivals.insert(rival);
                // Appearances before this contact cannot tell which person left it.
                if !identity.is_new {
                    identity.unsure.clear();
                    identity.unsure_since = frame + 1;
                }
            }
        }
    }

    /// Adds the appearances of this frame of all tracks that are seen, and near to no other.
    fn add_appearances(&mut self, frame: &Frame, tracks: &[Track]) -> Result<()> {
        for track in tracks.iter().filter(|track| track.seen && !track.occluded) {
            let covered = tracks.iter().any(|other| other.seen && covers(other, track));
            let Some(identity) = self.tracks.get_mut(&track.id) else { continue };
            // The position counts also where the appearance does not: it bounds how far a person can walk.
            identity.person.see(place(track), track.velocity);
            let mut others = tracks.iter().filter(|other| other.id != track.id);
            if covered || others.any(|it| (place(it) - place(track)).norm() < self.settings.alone_m)
            {
                continue;
            }
            let appearance = self.describer.of(&track.estimate, frame)?;
            // An appearance without pixels differs from nothing, so that any person would fit it.
            if appearance.difference(&appearance).mean().is_some() {
                identity.add(appearance);
            }
        }
        Ok(())
    }

    /// Decides who is who among tracks that were near to each other.
    fn tell_apart(&mut self, tracks: &[Track], people: &mut People) {
        for track in tracks {
            let Some(identity) = self.tracks.get(&track.id) else { continue };
            let enough = identity.unsure.len() >= self.settings.appearances as usize;
            if identity.is_new || identity.rivals.is_empty() || !enough {
                continue;
            }
            match self.better_rival(identity) {
                Some(number) => {
                    let since = identity.unsure_since;
                    let ids = [identity.person.number, number];
                    people.corrections.push(IdentityCorrection { since, ids });
                    self.change_over(track.id, number);
                }
                None => self.settle(track.id),
            }
        }
    }

    fn settle(&mut self, id: TrackId) {
        if let Some(identity) = self.tracks.get_mut(&id) {
            identity.settle();
        }
    }

    /// Returns the number of the rival to whom the appearances after a contact belong.
    fn better_rival(&self, identity: &Identity) -> Option<TrackId> {
        let ReidentificationSettings { max_difference, margin, .. } = self.settings;
        let unsure = &identity.unsure;
        let own = identity.person.difference(unsure)?;
        let rivals = identity.rivals.iter().filter_map(|number| self.person(*number));
        let differences = rivals.filter_map(|person| Some((person, person.difference(unsure)?)));
        let (best, difference) = differences.min_by(|a, b| a.1.total_cmp(&b.1))?;
        // All three tests, because a wrong number costs more than a new one.
        let fits = difference <= max_difference
            && difference + margin < own
            && best.fits_height(unsure, &self.settings);
        (fits && self.agrees(identity, best, own - difference)).then_some(best.number)
    }

    /// Returns true unless the rival's track, seen after the contact, speaks against the change by
    /// more than the gain of this one.
    fn agrees(&self, identity: &Identity, rival: &Person, gain: f64) -> bool {
        let holder = self.tracks.values().find(|other| other.person.number == rival.number);
        let Some(holder) = holder.filter(|holder| !holder.unsure.is_empty()) else { return true };
        // The exchange must be right for both tracks taken together.
        let stays = rival.difference(&holder.unsure);
        let changes = identity.person.difference(&holder.unsure);
        stays.zip(changes).is_none_or(|(stays, changes)| stays + gain > changes)
    }

    /// Returns the person with a number, with a track or without.
    fn person(&self, number: TrackId) -> Option<&Person> {
        // People with a track first: they are few, and the common case.
        let present = self.tracks.values().map(|identity| &identity.person);
        present.chain(&self.absent).find(|person| person.number == number)
    }

    /// Gives a track to another person, and that person's track, if any, to the first one.
    fn change_over(&mut self, id: TrackId, number: TrackId) {
        let holder = self.tracks.iter().find(|(_, identity)| identity.person.number == number);
        let holder = holder.map(|(holder, _)| *holder);
        let Some(mut identity) = self.tracks.remove(&id) else { return };
        if let Some(other) = holder.and_then(|holder| self.tracks.get_mut(&holder)) {
            // A swap, so that no number is given twice.
            std::mem::swap(&mut identity.person, &mut other.person);
            other.settle();
        } else if let Some(index) = self.absent.iter().position(|person| person.number == number) {
            std::mem::swap(&mut identity.person, &mut self.absent[index]);
        }
        identity.settle();
        self.tracks.insert(id, identity);
    }

    /// Recognises people that came back, and notes the numbers that are given up for that.
    fn recognise(&mut self, tracks: &[Track], people: &mut People) {
        for track in tracks.iter().filter(|track| track.confirmed) {
            let Some(identity) = self.tracks.get(&track.id) else { continue };
            if !identity.is_new {
                continue;
            }
            let reported = identity.reported;
            let too_late = identity.age_s > self.settings.decide_s;
            let returned = self.returned(identity, &self.lost_newcomers(tracks, track.id));
            let returned = returned.map(|index| self.absent.remove(index));
            let Some(identity) = self.tracks.get_mut(&track.id) else { continue };
            match returned {
                Some(person) => {
                    if reported {
                        let given_up = identity.person.number;
                        let ids = [given_up, person.number];
                        let since = identity.unsure_since;
                        people.given_up.push(given_up);
                        people.corrections.push(IdentityCorrection { since, ids });
                    }
                    identity.person = person;
                    identity.person.see(place(track), track.velocity);
                    identity.settle();
                }
                None if too_late => identity.settle(),
                None => {}
            }
        }
    }

    /// Returns the people of other lost tracks that have not been decided about: each may be anywhere, as
    /// those without a track.
    fn lost_newcomers(&self, tracks: &[Track], id: TrackId) -> Vec<Person> {
        let mut people = Vec::new();
        let lost = tracks.iter().filter(|track| track.confirmed && !track.seen);
        for track in lost.filter(|track| track.id != id) {
            let Some(identity) = self.tracks.get(&track.id) else { continue };
            if identity.is_new && identity.rivals.is_empty() {
                let mut identity = identity.clone();
                identity.settle();
                people.push(identity.person);
            }
        }
        people
    }

    /// Returns the index of the absent person whose track this is; `lost` are people of lost tracks.
    fn returned(&self, identity: &Identity, lost: &[Person]) -> Option<usize> {
        let ReidentificationSettings { max_difference, margin, .. } = self.settings;
        let seen = &identity.unsure;
        let differences = self.absent.iter().enumerate().filter(|(_, person)| {
            person.fits_height(seen, &self.settings)
                && person.reaches(identity.start, identity.age_s, &self.settings)
        });
        let differences = differences.filter_map(|(i, p)| Some((i, p.difference(seen)?)));
        let (best, difference) = differences.min_by(|a, b| a.1.total_cmp(&b.1))?;
        let present = self.tracks.values().filter(|other| !other.is_new).map(|other| &other.person);
        let absent = self.absent.iter().enumerate().filter(|(i, _)| *i != best);
        let mut others = present.chain(absent.map(|(_, person)| person)).chain(lost);
        let is_clear = others
            .all(|person| person.difference(seen).is_none_or(|other| other >= difference + margin));
        (difference <= max_difference && is_clear).then_some(best)
    }

    fn note_reported(&mut self, tracks: &[Track]) {
        for track in tracks.iter().filter(|track| track.confirmed) {
            if let Some(identity) = self.tracks.get_mut(&track.id) {
                identity.reported = true;
            }
        }
    }
}

fn place(track: &Track) -> Point2<f64> {
    track.estimate.person.position.xy()
}

/// Returns true if a nearer person hides part of another one in the image.
fn covers(near: &Track, far: &Track) -> bool {
    fn range(track: &Track) -> f64 {
        place(track).coords.norm()
    }

    let overlap = near.estimate.region.iou(&far.estimate.region);
    near.id != far.id && range(near) < range(far) && overlap > COVERED
}

/// Overlap in the image from which on the pixels of a person may be another one's.
const COVERED: f64 = 0.1;
