use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use nalgebra::{Point3, Vector2};
use tagalong_core::{
    Detection, EgoMotion, Estimate, Evidence, Filter, FilterRequirements, Input, Inputs, Person,
    Result, TrackId, Update, Visualisation,
};
use tagalong_geometry::Camera;
use tagalong_vision::Sketch;

use crate::config::{Config, Method};
use crate::group::Group;
use crate::identity::Wardrobe;
use crate::overlap::Overlaps;
use crate::particle::{Particle, Transition};
use crate::resampling::{effective_size, kld_size};
use crate::weighing::{WeighingInput, facing, sketch, support, weigh};

/// Particle filter of people, single or in groups.
#[derive(Default)]
pub struct JointParticle {
    config: Config,
    seed: u64,
    groups: Vec<Group>,
    overlaps: Overlaps,
    /// Direction in which each body faces, m/s; kept while the person stands.
    headings: BTreeMap<TrackId, Vector2<f64>>,
    wardrobe: Wardrobe,
    /// Time since a detector last found each person, s.
    unfound_s: BTreeMap<TrackId, f64>,
    /// Time by which the reported state is predicted, s.
    ahead_s: f64,
    dt_s: f64,
}

impl JointParticle {
    /// Creates a filter with random numbers from `seed`.
    ///
    /// # Errors
    /// [`tagalong_core::Error::Settings`] for settings outside their ranges.
    pub fn new(config: Config, seed: u64) -> Result<Self> {
        config.check()?;
        Ok(Self { config, seed, ..Self::default() })
    }

    /// Resamples groups in which few particles have most of the weight.
    fn renew(&mut self) {
        let config = &self.config;
        for group in &mut self.groups {
            let few = effective_size(&group.weights) < 0.5 * group.rows() as f64;
            if few || config.sampling.steps().resamples_always() {
                let count = match config.method {
                    Method::Partitioned => {
                        let wanted =
                            kld_size(group.occupied(), config.kld_error, config.kld_quantile);
                        wanted.min(config.max_particles).max(config.particles)
                    }
                    _ => group.rows(),
                };
                group.resample(count, config);
            }
        }
    }

    /// Forms groups of people with overlapping silhouettes, and splits the others.
    fn regroup(&mut self, camera: &Camera) {
        let wanted = self.overlaps.groups(&self.estimates(camera), &self.config);
        // Splitting and merging resamples, so unchanged groups are left alone.
        if self.groups.iter().map(ids).collect::<BTreeSet<_>>() == wanted.iter().cloned().collect()
        {
            return;
        }
        for group in std::mem::take(&mut self.groups) {
            self.split(group, &wanted);
        }
        for people in &wanted {
            self.join(people);
        }
        self.groups.sort_by(|a, b| a.ids.cmp(&b.ids));
    }

    /// Splits a group along the borders of the wanted ones.
    fn split(&mut self, mut group: Group, wanted: &[BTreeSet<TrackId>]) {
        let parts: Vec<Vec<usize>> = wanted
            .iter()
            .map(|people: &BTreeSet<TrackId>| -> Vec<usize> {
                (0..group.people()).filter(|i| people.contains(&group.ids[*i])).collect()
            })
            .filter(|part| !part.is_empty())
            .collect();
        if parts.len() < 2 {
            self.groups.push(group);
            return;
        }
        self.wardrobe.part(&group.ids);
        let parts = parts.iter().map(|part| group.part(part, self.seed, &self.config));
        self.groups.extend(parts.collect::<Vec<_>>());
    }

    /// Merges the groups that make up a wanted one.
    fn join(&mut self, people: &BTreeSet<TrackId>) {
        let parts: Vec<Group> = self
            .groups
            .extract_if(.., |group| group.ids.iter().any(|id| people.contains(id)))
            .collect();
        let joined = parts.into_iter().reduce(|a, b| a.merge(b, &self.config));
        self.groups.extend(joined);
    }

    /// Returns the headings of all bodies: by the image, otherwise by the velocity, otherwise as
    /// before.
    fn turn(&mut self, look: &mut WeighingInput<'_>) -> Result<BTreeMap<TrackId, Vector2<f64>>> {
        let mut headings = self.headings.clone();
        for group in &self.groups {
            for (person, id) in group.ids.iter().enumerate() {
                let mean = group.mean(person);
                let velocity = Vector2::new(mean[3], mean[4]);
                let walks = velocity.norm() > WALKING_MPS;
                let stands_alone = group.people() == 1 && !walks;
                let by_image = if self.config.facing_by_image || stands_alone {
                    facing(group, person, look)?
                } else {
                    None
                };
                headings.extend(by_image.or(walks.then_some(velocity)).map(|way| (*id, way)));
            }
        }
        Ok(headings)
    }

    /// Exchanges the particles of two people, after their colours have shown a swap.
    fn swap(&mut self, (a, b): (TrackId, TrackId)) {
        for id in self.groups.iter_mut().flat_map(|group| &mut group.ids) {
            if *id == a {
                *id = b;
            } else if *id == b {
                *id = a;
            }
        }
        let of_a = self.headings.remove(&a);
        let of_b = self.headings.remove(&b);
        self.headings.extend(of_a.map(|h| (b, h)).into_iter().chain(of_b.map(|h| (a, h))));
    }

    /// Returns the head positions of seen people outside of groups.
    fn alone(&self, seen: &BTreeMap<TrackId, Update>) -> BTreeMap<TrackId, Point3<f64>> {
        let single = self.groups.iter().filter(|g| g.people() == 1 && seen.contains_key(&g.ids[0]));
        single
            .map(|group| {
                let m = group.mean(0);
                (group.ids[0], Point3::new(m[0], m[1], m[2]))
            })
            .collect()
    }

    /// Returns true if a silhouette that explains this many nats is the person: a likelihood only
    /// compares, and without a person the best place is some furniture or the edge of the image.
    fn is_seen(&self, id: TrackId, nats: f64) -> bool {
        let unfound_s = self.unfound_s.get(&id).copied().unwrap_or_default();
        let config = &self.config;
        nats > match unfound_s {
            0.0 => config.min_support_found,
            s if s <= config.trust_s => config.min_support,
            _ => config.min_support_unfound,
        }
    }

    fn estimate(&self, group: &Group, person: usize, camera: &Camera) -> Estimate {
        let moments = group.moments(person);
        let m = moments.mean;
        let velocity = Vector2::new(m[3], m[4]);
        let floor = m.fixed_rows::<2>(0) + velocity * self.ahead_s;
        let position = Point3::new(floor.x, floor.y, m[2]);
        Estimate::new(
            Person { position, velocity },
            moments.covariance,
            camera.upper_body(&position),
        )
    }
}

/// Speed above which a person faces in the direction of the velocity, m/s.
const WALKING_MPS: f64 = 0.35;

fn ids(group: &Group) -> BTreeSet<TrackId> {
    group.ids.iter().copied().collect()
}

impl Filter for JointParticle {
    fn requirements(&self) -> FilterRequirements {
        let inputs = Inputs::NONE.accept(Input::Colour);
        FilterRequirements::new(inputs).with_likelihood().with_search()
    }

    fn start(&mut self, id: TrackId, detection: &Detection, _: &Camera) {
        let first = Particle::of(detection, &self.config);
        self.groups.push(Group::single(id, &first, self.seed, &self.config));
        self.unfound_s.insert(id, 0.0);
    }

    fn predict(&mut self, motion: &EgoMotion, _: &Camera) {
        let transition = Transition::new(motion, &self.config);
        self.groups.iter_mut().for_each(|group| group.predict(&transition));
        for heading in self.headings.values_mut() {
            *heading = motion.apply_to_velocity(*heading);
        }
        self.unfound_s.values_mut().for_each(|s| *s += motion.dt);
        self.ahead_s = 0.0;
        self.dt_s = motion.dt;
    }

    fn update(&mut self, evidence: &Evidence<'_>) -> Result<BTreeMap<TrackId, Update>> {
        let Some(likelihood) = evidence.likelihood else { return Ok(BTreeMap::new()) };
        self.renew();
        // Groups are formed before the weighing, because a scene needs all people that overlap
        // in it.
        self.regroup(&evidence.frame.camera);
        let sightings: BTreeMap<TrackId, Particle> = evidence
            .best_matches()
            .into_iter()
            .map(|(id, detection)| (id, Particle::of(detection, &self.config)))
            .collect();
        self.unfound_s.extend(sightings.keys().map(|id| (*id, 0.0)));
        let headings = self.headings.clone();
        let config = self.config.clone();
        let mut look =
            WeighingInput::new(evidence.frame, likelihood, &config, &headings, &sightings);
        let mut nats = BTreeMap::new();
        for group in &mut self.groups {
            weigh(group, &mut look)?;
            nats.extend(group.ids.iter().copied().zip(support(group, &mut look)?));
        }
        let seen = nats.into_iter().filter(|(id, nats)| self.is_seen(*id, *nats));
        let seen: BTreeMap<_, _> = seen.map(|(id, _)| (id, Update::default())).collect();
        self.headings = self.turn(&mut look)?;
        let alone = self.alone(&seen);
        for pair in self.wardrobe.look(evidence.frame, &alone, config.swap_margin) {
            self.swap(pair);
        }
        self.ahead_s = if config.sampling.steps().reports_prediction() { self.dt_s } else { 0.0 };
        Ok(seen)
    }

    fn visualise(&self, evidence: &Evidence<'_>) -> Result<Option<Visualisation>> {
        let mut shown = Sketch::default();
        let nobody = BTreeMap::new();
        let Some(likelihood) = evidence.likelihood else { return Ok(None) };
        let mut look =
            WeighingInput::new(evidence.frame, likelihood, &self.config, &self.headings, &nobody);
        self.groups.iter().try_for_each(|group| sketch(group, &mut look, &mut shown))?;
        Ok(Some(Arc::new(shown)))
    }

    fn estimates(&self, camera: &Camera) -> BTreeMap<TrackId, Estimate> {
        let people = self.groups.iter().flat_map(|g| g.ids.iter().enumerate().map(move |p| (g, p)));
        people.map(|(group, (i, id))| (*id, self.estimate(group, i, camera))).collect()
    }

    fn stop(&mut self, id: TrackId) {
        for group in std::mem::take(&mut self.groups) {
            let rest: BTreeSet<TrackId> = ids(&group).into_iter().filter(|i| *i != id).collect();
            if rest.len() == group.people() {
                self.groups.push(group);
            } else if !rest.is_empty() {
                self.keep_columns(group, &rest);
            }
        }
        self.headings.remove(&id);
        self.unfound_s.remove(&id);
        self.wardrobe.forget(id);
    }
}

impl JointParticle {
    /// Keeps these people of a group and forgets the others.
    fn keep_columns(&mut self, mut group: Group, people: &BTreeSet<TrackId>) {
        let columns: Vec<usize> =
            (0..group.people()).filter(|i| people.contains(&group.ids[*i])).collect();
        let rest = group.part(&columns, self.seed, &self.config);
        self.groups.push(rest);
        self.groups.sort_by(|a, b| a.ids.cmp(&b.ids));
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::Matrix3;
    use tagalong_core::{Frame, Images, Likelihood, Matched, Stamp};
    use tagalong_geometry::{ImageBox, Pinhole, Rect};

    use super::*;

    /// A likelihood that is the same at all places: each person explains this many nats, as a
    /// cupboard that looks like a person may.
    struct Flattering(f64);

    impl Likelihood for Flattering {
        fn log_likelihood(&self, _frame: &Frame, scene: &[Person]) -> Result<f64> {
            Ok(self.0 * scene.len() as f64)
        }
    }

    fn frame() -> Frame {
        let camera =
            Arc::new(Camera::mounted(Pinhole::centred(80.0, 100, 80), 100, 80, 1.5, 0.0, 0.0));
        Frame::new(1, Stamp::default(), camera, EgoMotion::at_rest(0.1), Images::default())
    }

    fn detection() -> Detection {
        let position = Point3::new(2.0, 0.0, 1.6);
        let region = Rect::new(40.0, 30.0, 20.0, 20.0);
        let covariance = Matrix3::identity() * 0.01;
        Detection::new("drawn", position, covariance, 3.0).with_image(ImageBox::upper_body(region))
    }

    /// Returns for twelve frames without a detection if a person that explains this many nats is
    /// seen, and then for one more frame with a detection.
    fn seen(nats: f64) -> (Vec<bool>, bool) {
        let mut filter = JointParticle::new(Config::default(), 1).unwrap();
        let id = TrackId(1);
        let frame = frame();
        let detection = detection();
        let flattering = Flattering(nats);
        filter.start(id, &detection, &frame.camera);
        let matched = [Matched::certain(id, &detection)];
        let mut seen = Vec::new();
        for look in 0..=12 {
            filter.predict(&frame.motion, &frame.camera);
            let likelihood: Option<&dyn Likelihood> = Some(&flattering);
            let matched = if look == 12 { &matched[..] } else { &[] };
            let evidence = Evidence::new(&frame, matched).with_likelihood(likelihood);
            seen.push(filter.update(&evidence).unwrap().contains_key(&id));
        }
        let again = seen.pop() == Some(true);
        (seen, again)
    }

    #[test]
    fn a_picture_shows_every_particle_and_a_map_of_two_people_who_overlap() {
        let config = Config { method: Method::Kde, ..Config::default() };
        let mut filter = JointParticle::new(config.clone(), 1).unwrap();
        let frame = frame();
        let farther = detection().with_position(Point3::new(3.0, 0.1, 1.6));
        filter.start(TrackId(1), &detection(), &frame.camera);
        filter.start(TrackId(2), &farther, &frame.camera);
        filter.predict(&frame.motion, &frame.camera);
        let likelihood: Option<&dyn Likelihood> = Some(&Flattering(3.0));
        let evidence = Evidence::new(&frame, &[]).with_likelihood(likelihood);
        filter.update(&evidence).unwrap();
        let before = filter.estimates(&frame.camera);
        let shown = filter.visualise(&evidence).unwrap().unwrap();
        let sketch: &Sketch = shown.downcast_ref().unwrap();
        assert_eq!(filter.estimates(&frame.camera), before, "looking changes nothing");
        let rows = config.joint_side * config.joint_side;
        for id in [1, 2] {
            let points = sketch.points.iter().filter(|point| point.id == TrackId(id));
            assert_eq!(points.count(), rows, "{id}");
        }
        let titles: Vec<&str> = sketch.maps.iter().map(|map| map.title.as_str()).collect();
        assert_eq!(titles, ["1 before 2: table", "1 before 2: approximated"]);
        assert!(sketch.maps.iter().all(|map| (map.columns, map.values.len()) == (61, 1281)));
    }

    #[test]
    fn a_silhouette_that_no_detector_finds_is_not_believed_for_long() {
        let (seen, again) = seen(5.0);
        assert!(seen[..9].iter().all(|seen| *seen) && !seen[10] && !seen[11], "{seen:?}");
        assert!(again, "found again");
    }

    #[test]
    fn who_explains_most_of_the_image_is_believed_without_a_detector() {
        assert_eq!(seen(7.0), (vec![true; 12], true));
    }

    #[test]
    fn a_sighting_and_a_silhouette_that_hardly_fits_are_enough_together() {
        let (unfound, found) = seen(1.0);
        assert!(found && !unfound[1], "{unfound:?}");
    }
}
