use nalgebra::{Matrix5, Point2, Vector5};
use tagalong_core::TrackId;

use crate::config::{Config, Method};
use crate::particle::{Particle, Transition};
use crate::random::Random;
use crate::resampling::{normalise, systematic};

/// People that are weighed together, as joint particles: each row has one [`Particle`] per person.
#[derive(Clone, Debug)]
pub(crate) struct Group {
    /// Tracks in the order of the columns.
    pub(crate) ids: Vec<TrackId>,
    /// Particles, row after row.
    parts: Vec<Particle>,
    /// Weight of each row; they sum to 1.
    pub(crate) weights: Vec<f64>,
    /// Likelihood of each row in the last frame, relative to the best one.
    pub(crate) likelihoods: Vec<f64>,
    random: Random,
    /// One generator for each dimension, seeded by its index, for schemes that use them.
    dimensions: Vec<Random>,
}

/// Mean and covariance of a person over all particles.
#[derive(Clone, Debug)]
pub(crate) struct Moments {
    pub(crate) mean: Vector5<f64>,
    pub(crate) covariance: Matrix5<f64>,
}

impl Group {
    /// Creates a group of one new person, from the first detection.
    pub(crate) fn single(id: TrackId, first: &Particle, seed: u64, config: &Config) -> Self {
        let count = config.particles;
        let mut group = Self {
            ids: vec![id],
            parts: vec![first.clone(); count],
            weights: vec![1.0 / count as f64; count],
            likelihoods: vec![1.0; count],
            random: Random::new(seed, u64::from(id.0)),
            dimensions: dimensions(1),
        };
        if !config.marginalise {
            group.draw(0, &Point2::origin(), config);
        }
        group
    }

    /// Returns the number of people.
    pub(crate) fn people(&self) -> usize {
        self.ids.len()
    }

    /// Returns the number of particles.
    pub(crate) fn rows(&self) -> usize {
        self.weights.len()
    }

    /// Returns one joint particle: all people of a row.
    pub(crate) fn row(&self, row: usize) -> &[Particle] {
        &self.parts[row * self.people()..(row + 1) * self.people()]
    }

    /// Returns all particles of one person.
    pub(crate) fn column_mut(&mut self, person: usize) -> impl Iterator<Item = &mut Particle> {
        let people = self.people();
        self.parts.iter_mut().skip(person).step_by(people)
    }

    /// Predicts all particles.
    pub(crate) fn predict(&mut self, transition: &Transition) {
        self.parts.iter_mut().for_each(|particle| transition.apply(particle));
    }

    /// Samples from the particles of one person the numbers that they hold only as a variance.
    pub(crate) fn draw(&mut self, person: usize, eye: &Point2<f64>, config: &Config) {
        let people = self.people();
        let steps = config.sampling.steps();
        let Self { parts, random, dimensions, .. } = self;
        let column = parts.iter_mut().skip(person).step_by(people);
        for particle in column {
            if config.marginalise {
                particle.draw_across(eye, random);
            } else {
                particle.draw_all(&steps.noise(random, &mut dimensions[5 * person..]));
            }
        }
    }

    /// Moves all people of a row by the same noise.
    pub(crate) fn draw_shared(&mut self, config: &Config) {
        let people = self.people();
        let Self { parts, random, dimensions, .. } = self;
        for row in parts.chunks_mut(people) {
            let noise = config.sampling.steps().noise(random, dimensions);
            row.iter_mut().for_each(|particle| particle.draw_all(&noise));
        }
    }

    /// Moves part of one person's particles to a detection.
    pub(crate) fn restart(&mut self, person: usize, at: &Particle, part: f64) {
        if part <= 0.0 {
            return;
        }
        let position = at.person().position;
        let covariance = at.covariance.fixed_view::<3, 3>(0, 0).into_owned();
        // Every n-th row: after resampling, neighbouring rows are copies of the same particle.
        let every = (1.0 / part).round().max(1.0) as usize;
        for particle in self.column_mut(person).step_by(every) {
            particle.move_to(&position, &covariance);
        }
    }

    /// Keeps the given rows, with equal weights.
    pub(crate) fn keep(&mut self, rows: &[usize]) {
        let parts = rows.iter().flat_map(|row| self.row(*row)).cloned().collect();
        self.likelihoods = rows.iter().map(|row| self.likelihoods[*row]).collect();
        self.parts = parts;
        self.weights = vec![1.0; rows.len()];
        normalise(&mut self.weights);
    }

    /// Samples `count` rows by their weights, and returns their indices.
    pub(crate) fn resample(&mut self, count: usize, config: &Config) -> Vec<usize> {
        let rows = config.sampling.steps().resample(&self.weights, count, &mut self.random);
        self.keep(&rows);
        rows
    }

    /// Returns the number of cells of 10 cm, for all people jointly, that the rows occupy.
    pub(crate) fn occupied(&self) -> usize {
        fn cell(p: &Particle) -> [i64; 2] {
            [p.mean[0], p.mean[1]].map(|v| (v / CELL_M).floor() as i64)
        }

        // Rows of negligible weight would make the distribution look wider than it is.
        let heavy = 0.01 / self.rows() as f64;
        let rows = (0..self.rows()).filter(|row| self.weights[*row] > heavy);
        let cells = rows.map(|row| self.row(row).iter().map(cell).collect::<Vec<_>>());
        cells.collect::<std::collections::BTreeSet<_>>().len()
    }

    /// Returns the heaviest row.
    pub(crate) fn best(&self) -> usize {
        (1..self.rows())
            .fold(0, |a: usize, b: usize| if self.weights[b] > self.weights[a] { b } else { a })
    }

    /// Returns the weights of the particles of one person, and the particles.
    fn weighted(&self, person: usize) -> impl Iterator<Item = (f64, &Particle)> {
        let column = self.parts.iter().skip(person).step_by(self.people());
        self.weights.iter().copied().zip(column)
    }

    /// Returns the mean of one person.
    pub(crate) fn mean(&self, person: usize) -> Vector5<f64> {
        self.weighted(person).map(|(w, p)| p.mean * w).sum()
    }

    /// Returns mean and covariance of one person.
    pub(crate) fn moments(&self, person: usize) -> Moments {
        let mean = self.mean(person);
        let covariance: Matrix5<f64> = self
            .weighted(person)
            .map(|(w, p)| {
                let off = p.mean - mean;
                (p.covariance + off * off.transpose()) * w
            })
            .sum();
        Moments { mean, covariance: 0.5 * (covariance + covariance.transpose()) }
    }

    /// Merges two groups into one.
    pub(crate) fn merge(mut self, mut other: Self, config: &Config) -> Self {
        let pairs = match config.method {
            Method::Partitioned => self.paired(&mut other),
            _ => self.combined(&mut other, config),
        };
        let mut merged = Self {
            ids: self.ids.iter().chain(&other.ids).copied().collect(),
            parts: Vec::with_capacity(pairs.len() * (self.people() + other.people())),
            weights: Vec::with_capacity(pairs.len()),
            likelihoods: Vec::with_capacity(pairs.len()),
            random: self.random.clone(),
            dimensions: dimensions(self.people() + other.people()),
        };
        for (a, b, weight) in pairs {
            merged.parts.extend(self.row(a).iter().chain(other.row(b)).cloned());
            merged.weights.push(weight);
            merged.likelihoods.push(self.likelihoods[a] * other.likelihoods[b]);
        }
        normalise(&mut merged.weights);
        merged
    }

    /// Pairs each row of one group with a random row of the other.
    fn paired(&mut self, other: &mut Self) -> Vec<(usize, usize, f64)> {
        let count = self.rows().max(other.rows());
        let mine = systematic(&self.weights, count, &mut self.random);
        let mut theirs = systematic(&other.weights, count, &mut other.random);
        // Resampled rows are in the order of their indices, which would correlate the two
        // people.
        self.random.shuffle(&mut theirs);
        mine.into_iter().zip(theirs).map(|(a, b)| (a, b, 1.0)).collect()
    }

    /// Combines some rows of one group with some of the other, all with all (P3: 25 x 25).
    fn combined(&mut self, other: &mut Self, config: &Config) -> Vec<(usize, usize, f64)> {
        let steps = config.sampling.steps();
        let mine = steps.choose(&self.weights, config.joint_side, &mut self.random);
        let theirs = steps.choose(&other.weights, config.joint_side, &mut other.random);
        let mut pairs = Vec::with_capacity(mine.len() * theirs.len());
        for a in &mine {
            for b in &theirs {
                let weights = [self.weights[*a], other.weights[*b]];
                pairs.push((*a, *b, steps.joint_weight(weights)));
            }
        }
        pairs
    }

    /// Returns the people at `columns` as a group of their own.
    pub(crate) fn part(&mut self, columns: &[usize], seed: u64, config: &Config) -> Self {
        let count = if columns.len() == 1 { config.particles } else { self.rows() };
        let rows = config.sampling.steps().choose(&self.weights, count, &mut self.random);
        let ids: Vec<TrackId> = columns.iter().map(|column| self.ids[*column]).collect();
        let stream = u64::from(ids.first().map_or(0, |id| id.0));
        Self {
            parts: rows
                .iter()
                .flat_map(|row| columns.iter().map(|column| self.row(*row)[*column].clone()))
                .collect(),
            weights: vec![1.0 / rows.len() as f64; rows.len()],
            likelihoods: rows.iter().map(|row| self.likelihoods[*row]).collect(),
            dimensions: dimensions(ids.len()),
            // A number of the old generator in the seed keeps the parts of one group
            // independent.
            random: Random::new(seed ^ self.random.uniform().to_bits(), stream),
            ids,
        }
    }
}

/// Side of the cells by which the spread of particles is measured, m.
const CELL_M: f64 = 0.1;

/// Creates one generator for each dimension, with the same seeds in every group.
fn dimensions(people: usize) -> Vec<Random> {
    (0..5 * people as u64).map(|dimension| Random::new(dimension, 0)).collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Point3};

    use super::*;

    /// A single person at places along Y with these weights.
    fn at_places(id: u32, places: &[f64], weights: &[f64]) -> Group {
        Group {
            ids: vec![TrackId(id)],
            parts: places
                .iter()
                .map(|y| Particle {
                    mean: Vector5::new(2.0, *y, 1.6, 0.0, 0.1),
                    covariance: Matrix5::identity() * 0.01,
                })
                .collect(),
            weights: weights.to_vec(),
            likelihoods: weights.to_vec(),
            random: Random::new(1, u64::from(id)),
            dimensions: dimensions(1),
        }
    }

    fn places(group: &Group, person: usize) -> Vec<f64> {
        (0..group.rows()).map(|row| group.row(row)[person].mean[1]).collect()
    }

    #[test]
    fn moments_are_those_of_the_mixture() {
        let group = at_places(1, &[0.0, 1.0], &[0.25, 0.75]);
        let moments = group.moments(0);
        assert_eq!(moments.mean, Vector5::new(2.0, 0.75, 1.6, 0.0, 0.1));
        assert!((moments.covariance[(1, 1)] - (0.01 + 0.1875)).abs() < 1e-12);
        assert!((moments.covariance[(0, 0)] - 0.01).abs() < 1e-12);
        assert_eq!(group.best(), 1);
        assert_eq!(at_places(1, &[0.0, 1.0, 2.0], &[0.5, 0.5, 0.0]).best(), 0);
    }

    #[test]
    fn rows_are_sampled_by_their_weights_when_groups_form() {
        let one = at_places(1, &[0.1, 0.2, 0.3], &[0.2, 0.5, 0.3]);
        let other = at_places(2, &[1.0, 2.0, 3.0], &[0.6, 0.1, 0.3]);
        let config = Config { method: Method::All, joint_side: 10, ..Config::default() };
        let merged = one.merge(other, &config);
        for (person, y, expected) in
            [(0, 0.1, 20), (0, 0.2, 50), (0, 0.3, 30), (1, 1.0, 60), (1, 2.0, 10), (1, 3.0, 30)]
        {
            let found = places(&merged, person).iter().filter(|at| **at == y).count();
            assert_eq!(found, expected, "{person} {y}");
        }
        assert!(merged.weights.iter().all(|weight| (weight - 0.01).abs() < 1e-12));
    }

    #[test]
    fn each_part_of_a_group_has_numbers_of_its_own() {
        let config = Config { particles: 2, ..Config::default() };
        let mut group = at_places(1, &[0.1, 0.2], &[0.5, 0.5]);
        let numbers = [0; 3].map(|column| group.part(&[column], 7, &config).random.uniform());
        assert!(numbers[0] != numbers[1] && numbers[1] != numbers[2] && numbers[0] != numbers[2]);
    }

    #[test]
    fn pairs_of_two_groups_are_at_random() {
        let evenly: Vec<f64> = (0..400).map(f64::from).collect();
        let one = at_places(1, &evenly, &[1.0 / 400.0; 400]);
        let merged =
            one.clone().merge(at_places(2, &evenly, &[1.0 / 400.0; 400]), &Config::default());
        let a = places(&merged, 0);
        let b = places(&merged, 1);
        let product: f64 = a.iter().zip(&b).map(|(a, b)| (a - 199.5) * (b - 199.5)).sum();
        let square: f64 = a.iter().map(|a| (a - 199.5).powi(2)).sum();
        assert!((product / square).abs() < 0.15 && merged.rows() == 400, "{}", product / square);
    }

    #[test]
    fn resampling_has_a_random_offset() {
        let weights = [0.1, 0.1, 0.4, 0.4];
        let mut group = at_places(1, &[0.0, 1.0, 2.0, 3.0], &weights);
        let config = Config::default();
        let drawn = (0..200).filter(|seed| {
            group.random = Random::new(*seed, 0);
            group.clone().resample(4, &config)[0] == 0
        });
        let drawn = drawn.count();
        assert!((50..110).contains(&drawn), "0.4 of 200: {drawn}");
    }

    #[test]
    fn who_starts_again_is_at_the_sighting_and_keeps_the_velocity() {
        let mut group = at_places(1, &[0.0; 10], &[0.1; 10]);
        let at = Particle {
            mean: Vector5::new(1.0, 3.0, 1.5, 9.0, 9.0),
            covariance: Matrix5::identity(),
        };
        group.restart(0, &at, 0.2);
        let moved: Vec<usize> = (0..10).filter(|row| group.row(*row)[0].mean[1] == 3.0).collect();
        assert_eq!(moved, [0, 5]);
        let first = &group.row(0)[0];
        assert_eq!(first.person().position, Point3::new(1.0, 3.0, 1.5));
        assert_eq!(first.mean[4], 0.1);
        assert_eq!(first.covariance.fixed_view::<3, 3>(0, 0), Matrix3::identity());
    }

    #[test]
    fn cells_are_counted_where_particles_have_weight() {
        let group = at_places(1, &[0.01, 0.09, 0.11, 0.5], &[0.4, 0.3, 0.3, 0.0]);
        assert_eq!(group.occupied(), 2);
    }
}
