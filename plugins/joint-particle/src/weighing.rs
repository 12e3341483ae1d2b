//! Likelihood of the particles of a group.

use std::collections::BTreeMap;

use nalgebra::{Point2, Vector2, Vector3, Vector5};
use tagalong_core::{Frame, Likelihood, Person, Result, TrackId};
use tagalong_vision::{ComparedPixels, Silhouette, Sketch, SketchMap, SketchPoint};

use crate::config::{Chosen, Config, Method};
use crate::group::Group;
use crate::maps::{Grid, LikelihoodMap, PositionPair};
use crate::particle::{Particle, across};
use crate::resampling::{effective_size, from_logs, heaviest, normalise};

/// Inputs for the weighing in one frame, and the scenes for the next query.
pub(crate) struct WeighingInput<'a> {
    pub(crate) frame: &'a Frame,
    pub(crate) likelihood: &'a dyn Likelihood,
    pub(crate) config: &'a Config,
    /// Directions in which bodies face, m/s.
    pub(crate) headings: &'a BTreeMap<TrackId, Vector2<f64>>,
    /// Detections by track.
    pub(crate) sightings: &'a BTreeMap<TrackId, Particle>,
    /// Camera position on the floor.
    pub(crate) eye: Point2<f64>,
    scenes: Vec<Person>,
}

impl<'a> WeighingInput<'a> {
    pub(crate) fn new(
        frame: &'a Frame,
        likelihood: &'a dyn Likelihood,
        config: &'a Config,
        headings: &'a BTreeMap<TrackId, Vector2<f64>>,
        sightings: &'a BTreeMap<TrackId, Particle>,
    ) -> Self {
        let eye = Point2::from(frame.camera.robot_from_camera.translation.vector.xy());
        Self { frame, likelihood, config, headings, sightings, eye, scenes: Vec::new() }
    }

    /// Returns a person for the likelihood: with the heading of the track, because the velocity of
    /// a single particle is too uncertain.
    fn person(&self, id: TrackId, particle: &Particle) -> Person {
        let velocity = self.headings.get(&id).copied().unwrap_or_default();
        Person { velocity, ..particle.person() }
    }

    /// Adds a person to the scenes that are being collected.
    fn add(&mut self, id: TrackId, particle: &Particle) {
        let person = self.person(id, particle);
        self.scenes.push(person);
    }

    /// Returns the log-likelihoods of the collected scenes, and clears them.
    fn ask(&mut self, people_per_scene: usize) -> Result<Vec<f64>> {
        let mut out = Vec::new();
        // The buffer is put back afterwards, so that its memory is reused in the next query.
        let scenes = std::mem::take(&mut self.scenes);
        self.likelihood.log_likelihoods(self.frame, &scenes, people_per_scene, &mut out)?;
        self.scenes = scenes;
        self.scenes.clear();
        Ok(out)
    }

    /// Returns the log-likelihoods of all particles, with some of their people only.
    fn rows(&mut self, group: &Group, people: &[usize]) -> Result<Vec<f64>> {
        for row in 0..group.rows() {
            let parts = group.row(row);
            people.iter().for_each(|p| self.add(group.ids[*p], &parts[*p]));
        }
        self.ask(people.len())
    }

    /// Returns the log-likelihoods of one particle with one person changed.
    fn variants(
        &mut self,
        group: &Group,
        row: usize,
        person: usize,
        changed: impl Iterator<Item = Person>,
    ) -> Result<Vec<f64>> {
        for variant in changed {
            for (i, part) in group.row(row).iter().enumerate() {
                self.scenes.push(if i == person {
                    variant
                } else {
                    self.person(group.ids[i], part)
                });
            }
        }
        self.ask(group.people())
    }

    /// Returns the people of a group from near to far.
    fn order(&self, group: &Group) -> Vec<usize> {
        let mut order = Vec::with_capacity(group.people());
        for person in 0..group.people() {
            let m = group.mean(person);
            let depth_m = self.frame.camera.depth_of(&nalgebra::Point3::new(m[0], m[1], m[2]));
            order.push((depth_m, person));
        }
        order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        order.into_iter().map(|(_, person)| person).collect()
    }

    fn draw(&self, group: &mut Group, person: usize) {
        if let Some(sighting) = self.sightings.get(&group.ids[person]) {
            group.restart(person, sighting, self.config.from_detection);
        }
        group.draw(person, &self.eye, self.config);
    }

    /// Holds depth and height (P3: during a short occlusion people move parallel to the image).
    fn hold_depth(&self, group: &mut Group) {
        let view = self.frame.camera.robot_from_camera * Vector3::z();
        let along = view.xy().try_normalize(1e-6).unwrap_or_else(Vector2::x);
        let dt_s = self.frame.motion.dt;
        let people = 0..group.people();
        people.for_each(|p| group.column_mut(p).for_each(|particle| particle.hold(&along, dt_s)));
    }

    fn draw_everybody(&self, group: &mut Group) {
        if self.config.sampling.steps().shares_noise() {
            group.draw_shared(self.config);
            return;
        }
        (0..group.people()).for_each(|person| self.draw(group, person));
    }
}

/// Samples and weighs the particles.
pub(crate) fn weigh(group: &mut Group, look: &mut WeighingInput<'_>) -> Result<()> {
    match look.config.method {
        Method::Partitioned => partitioned(group, look)?,
        Method::Table | Method::Kde | Method::Gp if group.people() == 2 => mapped(group, look)?,
        _ => all(group, look)?,
    }
    if look.config.marginalise {
        (look.order(group).into_iter()).try_for_each(|person| refine(group, look, person))?;
    }
    Ok(())
}

/// Compares the whole scene of each particle with the image.
fn all(group: &mut Group, look: &mut WeighingInput<'_>) -> Result<()> {
    look.draw_everybody(group);
    let everybody: Vec<usize> = (0..group.people()).collect();
    let logs = look.rows(group, &everybody)?;
    take_in(group, &logs);
    Ok(())
}

/// Weighs front to back: the nearest person without the others; each farther person is sampled for,
/// and hidden by, the nearer ones that survived.
fn partitioned(group: &mut Group, look: &mut WeighingInput<'_>) -> Result<()> {
    let order = look.order(group);
    let mut before = vec![0.0; group.rows()];
    for (k, person) in order.iter().enumerate() {
        look.draw(group, *person);
        let now = look.rows(group, &order[..=k])?;
        // The nearer people are counted in the weights already; only the gain of this person is
        // new.
        let gained: Vec<f64> = now.iter().zip(&before).map(|(n, b)| n - b).collect();
        take_in(group, &gained);
        before = now;
        let few = effective_size(&group.weights) < 0.5 * group.rows() as f64;
        // After the last person the weights are kept: the estimate is computed from them.
        if few && k + 1 < order.len() {
            let rows = group.resample(group.rows(), look.config);
            before = rows.into_iter().map(|row| before[row]).collect();
        }
    }
    Ok(())
}

/// Multiplies the weights by likelihoods that are given as logarithms.
fn take_in(group: &mut Group, logs: &[f64]) {
    let mut posterior: Vec<f64> =
        group.weights.iter().zip(logs).map(|(w, log)| w.ln() + log).collect();
    from_logs(&mut posterior);
    group.weights = posterior;
    group.likelihoods = relative(logs);
}

/// Returns the likelihoods relative to the largest one.
fn relative(logs: &[f64]) -> Vec<f64> {
    let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    logs.iter().map(|log| (log - most).exp()).collect()
}

/// Frame of the lateral positions of two people: P3 holds depth and height.
struct Lateral {
    near: usize,
    far: usize,
    /// Mean position of the near person: both lateral positions are measured from it.
    origin: Point2<f64>,
    across: Vector2<f64>,
    means: [Vector5<f64>; 2],
}

impl Lateral {
    fn new(group: &Group, look: &WeighingInput<'_>) -> Self {
        let order = look.order(group);
        let near = order[0];
        let far = order[1];
        let means = [near, far].map(|person| group.mean(person));
        let origin = Point2::new(means[0][0], means[0][1]);
        let across = look.config.sampling.steps().lateral_axis(&(origin - look.eye));
        Self { near, far, origin, across, means }
    }

    fn places(&self, group: &Group) -> Vec<PositionPair> {
        (0..group.rows()).map(|row| self.place(group.row(row))).collect()
    }

    /// Computes the map of a method: at all places of a table, or at the chosen ones.
    fn map(
        &self,
        group: &Group,
        look: &mut WeighingInput<'_>,
        method: Method,
        chosen: &[PositionPair],
    ) -> Result<LikelihoodMap> {
        let grid = Grid::new(look.config);
        let places = if method == Method::Table { grid.places() } else { chosen.to_vec() };
        for place in &places {
            let scene = self.scene(place);
            [0, 1].into_iter().for_each(|i| look.add(group.ids[i], &scene[i]));
        }
        let known = relative(&look.ask(2)?);
        Ok(LikelihoodMap::new(method, places, known, look.config))
    }

    fn place(&self, row: &[Particle]) -> PositionPair {
        [self.near, self.far].map(|p| self.across.dot(&(row[p].floor() - self.origin)))
    }

    /// Returns the scene with the two people at a place, in the order of the columns.
    fn scene(&self, place: &PositionPair) -> [Particle; 2] {
        let [near, far] = [0, 1].map(|i| {
            let mut mean = self.means[i];
            let now = self.across.dot(&(Point2::new(mean[0], mean[1]) - self.origin));
            let shift = self.across * (place[i] - now);
            mean[0] += shift.x;
            mean[1] += shift.y;
            Particle { mean, covariance: nalgebra::Matrix5::zeros() }
        });
        if self.near == 0 { [near, far] } else { [far, near] }
    }
}

/// Weighs by a map of the likelihood over the lateral positions (P3, section III), which is made
/// from a table or from a few particles, and looked up by all.
fn mapped(group: &mut Group, look: &mut WeighingInput<'_>) -> Result<()> {
    let before = group.likelihoods.clone();
    if look.config.hold_depth {
        look.hold_depth(group);
    }
    look.draw_everybody(group);
    let lateral = Lateral::new(group, look);
    let all = lateral.places(group);
    let map = lateral.map(group, look, look.config.method, &chosen(&all, &before, look.config))?;
    group.likelihoods = map.at_all(&all);
    let weights = group.weights.iter().zip(&group.likelihoods);
    group.weights = weights.map(|(weight, likelihood)| weight * likelihood).collect();
    normalise(&mut group.weights);
    Ok(())
}

/// Returns the places that are compared with the image.
fn chosen(all: &[PositionPair], before: &[f64], config: &Config) -> Vec<PositionPair> {
    if config.chosen == Chosen::PreviousBest {
        return heaviest(before, config.points).into_iter().map(|row| all[row]).collect();
    }
    let coarse = [-1.0, 0.0, 1.0].map(|near| {
        [-1.0, 0.0, 1.0]
            .map(|far| [0.5 * near * config.reach_near_m, 0.5 * far * config.reach_far_m])
    });
    let coarse: Vec<PositionPair> = coarse.into_iter().flatten().take(config.points).collect();
    let rest = (config.points - coarse.len()).min(all.len());
    let spread = (0..rest).map(|i| all[i * all.len() / rest.max(1)]);
    coarse.iter().copied().chain(spread).collect()
}

/// Updates the depth and then the height of one person in all particles: the likelihood along a
/// line through the best particle, times the prior, has a mean and a variance, which are converted
/// to those of a measurement.
fn refine(group: &mut Group, look: &mut WeighingInput<'_>, person: usize) -> Result<()> {
    for line in [Line::Range, Line::Height] {
        let row = group.best();
        let best = group.row(row)[person].clone();
        let h = line.direction(&best, &look.eye);
        let variance = best.variance(&h);
        if variance.is_nan() || variance <= 1e-8 {
            continue;
        }
        let sigma = variance.sqrt();
        let id = group.ids[person];
        let mut variants = Vec::with_capacity(SAMPLES);
        for i in 0..SAMPLES {
            let mut moved = best.clone();
            moved.mean.fixed_rows_mut::<3>(0).axpy(offset(i, sigma), &h, 1.0);
            variants.push(look.person(id, &moved));
        }
        let logs = look.variants(group, row, person, variants.into_iter())?;
        let Some((shift, spread)) = measurement(&logs, sigma) else { continue };
        // A sampled likelihood may be sharper than the templates are accurate.
        let spread = spread.max(line.finest_m(&best, &look.eye).powi(2));
        let measured = line.value(&best, &look.eye) + shift;
        // All particles use the measurement from one line: a line for each would need as many
        // comparisons as there are particles.
        for particle in group.column_mut(person) {
            let h = line.direction(particle, &look.eye);
            let off = measured - line.value(particle, &look.eye);
            particle.correct(&h, off, spread);
        }
    }
    Ok(())
}

/// Lines along which the likelihood is sampled.
#[derive(Clone, Copy)]
enum Line {
    /// Along the viewing ray, on the floor.
    Range,
    /// Along the vertical.
    Height,
}

impl Line {
    fn direction(self, particle: &Particle, eye: &Point2<f64>) -> Vector3<f64> {
        match self {
            Self::Height => Vector3::z(),
            Self::Range => {
                let left = across(&(particle.floor() - eye));
                Vector3::new(left.y, -left.x, 0.0)
            }
        }
    }

    fn finest_m(self, particle: &Particle, eye: &Point2<f64>) -> f64 {
        match self {
            Self::Height => FINEST_M,
            Self::Range => FINEST_M.max(FINEST_PART * self.value(particle, eye)),
        }
    }

    fn value(self, particle: &Particle, eye: &Point2<f64>) -> f64 {
        match self {
            Self::Height => particle.mean[2],
            Self::Range => (particle.floor() - eye).norm(),
        }
    }
}

/// Number of samples along a line.
const SAMPLES: usize = 15;
/// Reach of the samples to both sides, in standard deviations.
const REACH: f64 = 3.5;
/// Least standard deviation of a measurement along a line, m ...
const FINEST_M: f64 = 0.02;
/// ... and along a viewing ray, as a part of the distance: likelihoods tell depths apart by a few
/// per cent.
const FINEST_PART: f64 = 0.015;

fn offset(i: usize, sigma: f64) -> f64 {
    REACH * sigma * (2.0 * i as f64 / (SAMPLES - 1) as f64 - 1.0)
}

/// Returns value and variance of the measurement that turns the prior N(0, sigma²) into the
/// posterior; `None` if the likelihood is flat.
fn measurement(logs: &[f64], sigma: f64) -> Option<(f64, f64)> {
    let mut weights: Vec<f64> = logs
        .iter()
        .enumerate()
        .map(|(i, log)| log - 0.5 * (offset(i, sigma) / sigma).powi(2))
        .collect();
    from_logs(&mut weights);
    let mean: f64 = weights.iter().enumerate().map(|(i, w)| w * offset(i, sigma)).sum();
    let squares = weights.iter().enumerate().map(|(i, w)| w * (offset(i, sigma) - mean).powi(2));
    let variance: f64 = squares.sum();
    // A posterior about as wide as the prior would mean a measurement of unbounded variance.
    if variance.is_nan() || variance >= 0.95 * sigma * sigma {
        return None;
    }
    let spread = 1.0 / (1.0 / variance.max(1e-9) - 1.0 / (sigma * sigma));
    Some((mean * (1.0 + spread / (sigma * sigma)), spread))
}

/// Returns the gain in log-likelihood of the best particle's scene by each person, nats.
pub(crate) fn support(group: &Group, look: &mut WeighingInput<'_>) -> Result<Vec<f64>> {
    let row = group.best();
    let everybody: Vec<usize> = (0..group.people()).collect();
    let whole = log_of_people(group, row, look, &everybody)?;
    let mut gains = Vec::with_capacity(everybody.len());
    for person in 0..group.people() {
        let others: Vec<usize> = everybody.iter().copied().filter(|p| *p != person).collect();
        gains.push(whole - log_of_people(group, row, look, &others)?);
    }
    Ok(gains)
}

/// Returns the log-likelihood of some of the people of a particle, relative to the empty scene.
fn log_of_people(
    group: &Group,
    row: usize,
    look: &mut WeighingInput<'_>,
    people: &[usize],
) -> Result<f64> {
    if people.is_empty() {
        return Ok(0.0);
    }
    let parts = group.row(row);
    people.iter().for_each(|p| look.add(group.ids[*p], &parts[*p]));
    Ok(look.ask(people.len())?.first().copied().unwrap_or_default())
}

/// Adds a group to the sketch: its particles, the scene of the best one, and the likelihood over
/// the lateral positions of two people.
pub(crate) fn sketch(
    group: &Group,
    look: &mut WeighingInput<'_>,
    sketch: &mut Sketch,
) -> Result<()> {
    let best = group.best();
    let heaviest = group.weights[best].max(f64::MIN_POSITIVE);
    for (row, weight) in group.weights.iter().enumerate() {
        let points = group.row(row).iter().zip(&group.ids).filter_map(|(particle, id)| {
            let pixel = look.frame.camera.project(&particle.person().position)?;
            Some(SketchPoint { id: *id, pixel, weight: weight / heaviest })
        });
        sketch.points.extend(points);
    }
    let people = group.row(best).iter().zip(&group.ids);
    let scene: Vec<Person> = people.map(|(particle, id)| look.person(*id, particle)).collect();
    let shown = look.likelihood.visualise(look.frame, &scene)?;
    if let Some(ComparedPixels(bodies)) = shown.as_ref().and_then(|shown| shown.downcast_ref()) {
        let bodies = group.ids.iter().zip(bodies);
        let bodies = bodies.map(|(id, runs)| Silhouette { id: *id, runs: runs.clone() });
        sketch.silhouettes.extend(bodies);
    }
    if group.people() == 2 {
        sketch_maps(group, look, sketch)?;
    }
    Ok(())
}

/// Adds the maps of P3, Figure 7: the table (b), and its approximation from a few particles (d).
/// Their peaks are so sharp that fourth roots are shown.
fn sketch_maps(group: &Group, look: &mut WeighingInput<'_>, sketch: &mut Sketch) -> Result<()> {
    let lateral = Lateral::new(group, look);
    let grid = Grid::new(look.config);
    let chosen = chosen(&lateral.places(group), &group.likelihoods, look.config);
    let approximated = matches!(look.config.method, Method::Kde | Method::Gp);
    let kinds = [(Method::Table, "table"), (look.config.method, "approximated")];
    for (method, name) in kinds.into_iter().take(1 + usize::from(approximated)) {
        let map = lateral.map(group, look, method, &chosen)?;
        let values: Vec<f64> = grid.places().iter().map(|at| map.at(at)).collect();
        let most = values.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        sketch.maps.push(SketchMap {
            title: format!("{} before {}: {name}", group.ids[lateral.near], group.ids[lateral.far]),
            columns: grid.columns(),
            values: values.into_iter().map(|value| (value / most).powf(0.25)).collect(),
        });
    }
    Ok(())
}

/// Returns the direction in which a person faces: that of the best template of those seen along the
/// viewing ray, facing left and facing right. `None` if they fit alike, as for a hidden person.
pub(crate) fn facing(
    group: &Group,
    person: usize,
    look: &mut WeighingInput<'_>,
) -> Result<Option<Vector2<f64>>> {
    let row = group.best();
    let particle = &group.row(row)[person];
    let left = across(&(particle.floor() - look.eye));
    let ways = [Vector2::zeros(), left, -left];
    let variants = ways.map(|velocity| Person { velocity, ..particle.person() });
    let logs = look.variants(group, row, person, variants.into_iter())?;
    let order = heaviest(&logs, ways.len());
    let tells = logs[order[0]] - logs[order[2]] > TELLING_NATS;
    Ok(tells.then_some(ways[order[0]]))
}

/// Least difference between the best and the worst template that tells the direction, nats.
const TELLING_NATS: f64 = 0.5;

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::tests::rig::{Formula, frame, sighting};

    proptest! {
        /// A Gaussian likelihood along the line is the measurement itself.
        #[test]
        fn a_gaussian_likelihood_is_measured_as_it_is(
            value in -0.1..0.1f64, sigma in 0.1..0.3f64, part in 0.6..1.5f64,
        ) {
            let spread = (part * sigma).powi(2);
            let logs: Vec<f64> = (0..SAMPLES).map(|i| -0.5 * (offset(i, sigma) - value).powi(2) / spread).collect();
            let (found, variance) = measurement(&logs, sigma).unwrap();
            prop_assert!((found - value).abs() < 0.03 * sigma + 0.1 * value.abs());
            prop_assert!((variance / spread - 1.0).abs() < 0.15, "{} {}", variance, spread);
        }
    }

    #[test]
    fn likelihoods_multiply_what_was_believed_before() {
        fn off((a, b): (&f64, &f64)) -> f64 {
            (a - b).abs()
        }

        let detection = sighting(nalgebra::Point3::new(2.0, 0.0, 1.6), [0.1; 3]);
        let config = Config { particles: 3, ..Config::default() };
        let first = Particle::of(&detection, &config);
        let mut group = Group::single(TrackId(1), &first, 1, &config);
        group.weights = vec![0.6, 0.3, 0.1];
        take_in(&mut group, &[0.0, 4f64.ln(), 2f64.ln()]);
        let expected = [0.3, 0.6, 0.1];
        assert!(group.weights.iter().zip(&expected).map(off).all(|off| off < 1e-12));
        assert!(group.likelihoods.iter().zip(&[0.25, 1.0, 0.5]).map(off).all(|off| off < 1e-12));
    }

    /// Runs `work` on two people one behind the other, with a likelihood.
    fn looking<T>(
        config: &Config,
        likelihood: &Formula,
        work: impl FnOnce(&mut Group, &mut WeighingInput<'_>) -> T,
    ) -> T {
        let [one, other] = [(1, 2.0), (2, 3.0)].map(|(id, x)| {
            let detection = sighting(nalgebra::Point3::new(x, 0.0, 1.6), [0.01; 3]);
            Group::single(TrackId(id), &Particle::of(&detection, config), 1, config)
        });
        let mut group = one.merge(other, config);
        let frame = frame(tagalong_core::EgoMotion::at_rest(0.1), None);
        let headings = BTreeMap::new();
        let sightings = BTreeMap::new();
        let mut look = WeighingInput::new(&frame, likelihood, config, &headings, &sightings);
        work(&mut group, &mut look)
    }

    #[test]
    fn a_map_that_says_nothing_leaves_the_weights_as_they_were() {
        for method in [Method::Table, Method::All, Method::Partitioned] {
            let config = Config { method, joint_side: 2, particles: 4, ..Config::default() };
            let weights = looking(&config, &Formula::flat(3.0), |group, look| {
                group.weights = vec![0.4, 0.3, 0.2, 0.1];
                weigh(group, look).unwrap();
                group.weights.clone()
            });
            let off = weights.iter().zip([0.4, 0.3, 0.2, 0.1]).map(|(a, b)| (a - b).abs());
            assert!(off.into_iter().all(|off| off < 1e-9), "{method:?}: {weights:?}");
        }
    }

    #[test]
    fn a_body_faces_where_a_template_fits_unless_all_fit_alike() {
        fn way(likelihood: &Formula) -> Option<Vector2<f64>> {
            looking(&Config::default(), likelihood, |group, look| facing(group, 0, look).unwrap())
        }

        fn of(fits: fn(f64) -> bool) -> Option<f64> {
            let likelihood = Formula::new(move |scene: &[Person]| {
                scene.iter().map(|p| if fits(p.velocity.y) { 5.0 } else { 0.0 }).sum()
            });
            way(&likelihood).map(|way| way.y.round())
        }

        assert_eq!(way(&Formula::flat(3.0)), None);
        assert_eq!(of(|vy| vy > 0.3), Some(1.0));
        assert_eq!(of(|vy| vy < -0.3), Some(-1.0));
        assert_eq!(of(|vy| vy > -0.3), Some(0.0), "one of the three does not fit");
    }

    #[test]
    fn no_look_tells_depth_or_height_better_than_it_can() {
        fn sharp(p: &Person) -> f64 {
            let off = [p.position.x - 2.0, p.position.z - 1.6].map(|off| (off / 0.004).powi(2));
            -0.5 * (off[0] + off[1])
        }

        let mut rig = crate::tests::rig::Rig::new(Config::default(), 1);
        rig.start(1, [2.0, 0.0, 1.6], [0.2, 1e-6, 0.2]);
        rig.look(&Formula::new(move |scene| scene.iter().map(sharp).sum()));
        let covariance = rig.estimate(1).covariance;
        let [along, up] = [0, 2].map(|i| covariance[(i, i)].sqrt());
        assert!((along - 0.03).abs() < 0.002, "1.5 % of 2 m: {along}");
        assert!((up - 0.02).abs() < 0.002, "{up}");
    }

    #[test]
    fn the_heaviest_particle_is_drawn_darkest() {
        let shown = looking(
            &Config { particles: 4, ..Config::default() },
            &Formula::flat(3.0),
            |group, look| {
                group.weights = vec![0.125, 0.5, 0.25, 0.375];
                let mut shown = Sketch::default();
                sketch(group, look, &mut shown).unwrap();
                shown.points.iter().map(|point| point.weight).collect::<Vec<_>>()
            },
        );
        assert_eq!(shown, [0.25, 0.25, 1.0, 1.0, 0.5, 0.5, 0.75, 0.75]);
    }

    #[test]
    fn the_likeliest_places_are_compared_or_places_all_over() {
        let all: Vec<PositionPair> =
            (0..100).map(|i| [0.01 * f64::from(i), -0.01 * f64::from(i)]).collect();
        let before: Vec<f64> = (0..100).map(|i| f64::from((i * 37) % 100)).collect();
        let [best, spread, few] =
            [(Chosen::PreviousBest, 3), (Chosen::Spread, 29), (Chosen::Spread, 4)].map(
                |(chosen, points)| {
                    let config = Config { chosen, points, ..Config::default() };
                    super::chosen(&all, &before, &config)
                },
            );
        // 37 times 27, 54 and 81 leave 99, 98 and 97.
        assert_eq!(best, [all[27], all[54], all[81]]);
        let coarse: Vec<PositionPair> = [-0.15, 0.0, 0.15]
            .into_iter()
            .flat_map(|near| [-0.45, 0.0, 0.45].map(|far| [near, far]))
            .collect();
        assert_eq!(spread[..9], coarse[..]);
        let fifth: Vec<PositionPair> = all.iter().copied().step_by(5).collect();
        assert_eq!(spread[9..], fifth[..]);
        assert_eq!(few, coarse[..4]);
    }

    #[test]
    fn a_flat_likelihood_measures_nothing() {
        assert_eq!(measurement(&[-3.0; SAMPLES], 0.2), None);
    }

    /// The farther person is sampled for the places of the nearer one that fit, so that no particle
    /// is spent on the others.
    #[test]
    fn places_of_the_nearer_person_that_do_not_fit_are_left_before_the_next() {
        fn fits(scene: &[Person]) -> f64 {
            let near = scene.iter().find(|person| person.position.x < 2.5);
            near.map_or(0.0, |near| -0.5 * (near.position.y / 0.001).powi(2))
        }

        let config = Config { method: Method::Partitioned, ..Config::default() };
        let (effective, rows) = looking(&config, &Formula::new(fits), |group, look| {
            partitioned(group, look).unwrap();
            (effective_size(&group.weights), group.rows() as f64)
        });
        assert!(effective > 0.9 * rows, "{effective} of {rows}");
    }
}
