use nalgebra::{Matrix5, Point2, Vector5};
use tagalong_core::TrackId;

use crate::config::{Config, Method};
use crate::particle::{Particle, Transition};
use crate::random::Random;
use crate::resampling::{heaviest, normalise, systematic, without_offset};

/// People who are weighed together, as joint particles: rows of one
/// [`Particle`] for each of them.
#[derive(Clone, Debug)]
pub(crate) struct Group {
    /// The people, in the order of the columns.
    pub(crate) ids: Vec<TrackId>,
    /// Row after row.
    parts: Vec<Particle>,
    /// Of each row; they sum to 1.
    pub(crate) weights: Vec<f64>,
    /// How likely each row was in the last frame, relative to the best one.
    pub(crate) likelihoods: Vec<f64>,
    random: Random,
    /// ConDensation: one generator for each dimension, seeded by its number.
    dimensions: Vec<Random>,
}

/// Mean and covariance of a person over all particles.
#[derive(Clone, Debug)]
pub(crate) struct Moments {
    pub(crate) mean: Vector5<f64>,
    pub(crate) covariance: Matrix5<f64>,
}

impl Group {
    /// A newcomer, drawn from the first sighting.
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

    /// Number of people.
    pub(crate) fn people(&self) -> usize {
        self.ids.len()
    }

    /// Number of particles.
    pub(crate) fn rows(&self) -> usize {
        self.weights.len()
    }

    /// One particle: everybody in it.
    pub(crate) fn row(&self, row: usize) -> &[Particle] {
        &self.parts[row * self.people()..(row + 1) * self.people()]
    }

    /// All particles of one person.
    pub(crate) fn column_mut(&mut self, person: usize) -> impl Iterator<Item = &mut Particle> {
        let people = self.people();
        self.parts.iter_mut().skip(person).step_by(people)
    }

    /// Moves everybody.
    pub(crate) fn predict(&mut self, transition: &Transition) {
        self.parts.iter_mut().for_each(|particle| transition.apply(particle));
    }

    /// Draws what the particles of one person know only as a variance.
    pub(crate) fn draw(&mut self, person: usize, eye: &Point2<f64>, config: &Config) {
        let people = self.people();
        let Self { parts, random, dimensions, .. } = self;
        let column = parts.iter_mut().skip(person).step_by(people);
        for particle in column {
            if config.marginalise {
                particle.draw_across(eye, random);
            } else if config.compat_condensation {
                let of_person = &mut dimensions[5 * person..5 * person + 5];
                let noise = Vector5::from_fn(|i, _| of_person[i].flat());
                particle.draw_all(&noise);
            } else {
                particle.draw_all(&Vector5::from_fn(|_, _| random.normal()));
            }
        }
    }

    /// As printed in P3: everybody in a particle is moved by the same noise.
    pub(crate) fn draw_shared(&mut self) {
        let people = self.people();
        for row in self.parts.chunks_mut(people) {
            let noise = Vector5::from_fn(|_, _| self.random.normal());
            row.iter_mut().for_each(|particle| particle.draw_all(&noise));
        }
    }

    /// Moves part of one person's particles to a sighting.
    pub(crate) fn restart(&mut self, person: usize, at: &Particle, part: f64) {
        if part <= 0.0 {
            return;
        }
        let position = at.person().position;
        let covariance = at.covariance.fixed_view::<3, 3>(0, 0).into_owned();
        let every = (1.0 / part).round().max(1.0) as usize;
        for particle in self.column_mut(person).step_by(every) {
            particle.move_to(&position, &covariance);
        }
    }

    /// Keeps the given rows, equally heavy.
    pub(crate) fn keep(&mut self, rows: &[usize]) {
        let parts = rows.iter().flat_map(|row| self.row(*row)).cloned().collect();
        self.likelihoods = rows.iter().map(|row| self.likelihoods[*row]).collect();
        self.parts = parts;
        self.weights = vec![1.0; rows.len()];
        normalise(&mut self.weights);
    }

    /// Draws `count` rows by their weights, and says which.
    pub(crate) fn resample(&mut self, count: usize, config: &Config) -> Vec<usize> {
        let rows = match config.compat_condensation {
            true => without_offset(&self.weights),
            false => systematic(&self.weights, count, &mut self.random),
        };
        self.keep(&rows);
        rows
    }

    /// How many cells of 10 cm, for each person, the rows occupy.
    pub(crate) fn occupied(&self) -> usize {
        let cell = |p: &Particle| [p.mean[0], p.mean[1]].map(|v| (v / CELL_M).floor() as i64);
        let heavy = 0.01 / self.rows() as f64;
        let rows = (0..self.rows()).filter(|row| self.weights[*row] > heavy);
        let cells = rows.map(|row| self.row(row).iter().map(cell).collect::<Vec<_>>());
        cells.collect::<std::collections::BTreeSet<_>>().len()
    }

    /// The heaviest row.
    pub(crate) fn best(&self) -> usize {
        let heavier = |a: usize, b: usize| if self.weights[b] > self.weights[a] { b } else { a };
        (1..self.rows()).fold(0, heavier)
    }

    /// Mean and covariance of one person.
    pub(crate) fn moments(&self, person: usize) -> Moments {
        let column = || (0..self.rows()).map(|row| (self.weights[row], &self.row(row)[person]));
        let mean: Vector5<f64> = column().map(|(w, p)| p.mean * w).sum();
        let covariance: Matrix5<f64> = column()
            .map(|(w, p)| {
                let off = p.mean - mean;
                (p.covariance + off * off.transpose()) * w
            })
            .sum();
        Moments { mean, covariance: 0.5 * (covariance + covariance.transpose()) }
    }

    /// Two groups become one.
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

    /// Each of one group with one of the other, at random.
    fn paired(&mut self, other: &mut Self) -> Vec<(usize, usize, f64)> {
        let count = self.rows().max(other.rows());
        let mine = systematic(&self.weights, count, &mut self.random);
        let mut theirs = systematic(&other.weights, count, &mut other.random);
        self.random.shuffle(&mut theirs);
        mine.into_iter().zip(theirs).map(|(a, b)| (a, b, 1.0)).collect()
    }

    /// A few of one group, each with a few of the other (P3: 25 x 25).
    fn combined(&mut self, other: &mut Self, config: &Config) -> Vec<(usize, usize, f64)> {
        let few = |group: &mut Self| match config.compat_top {
            true => heaviest(&group.weights, config.joint_side),
            false => systematic(&group.weights, config.joint_side, &mut group.random),
        };
        let (mine, theirs) = (few(self), few(other));
        let weight = |a: usize, b: usize| match config.compat_top {
            true => self.weights[a] * other.weights[b],
            false => 1.0,
        };
        let pairs = mine.iter().flat_map(|a| theirs.iter().map(|b| (*a, *b, weight(*a, *b))));
        pairs.collect()
    }

    /// The people at `columns` as a group of their own.
    pub(crate) fn part(&mut self, columns: &[usize], seed: u64, config: &Config) -> Self {
        let count = if columns.len() == 1 { config.particles } else { self.rows() };
        let rows = match config.compat_top {
            true => heaviest(&self.weights, count),
            false => systematic(&self.weights, count, &mut self.random),
        };
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
            random: Random::new(seed ^ self.random.uniform().to_bits(), stream),
            ids,
        }
    }
}

/// Side of the cells by which the spread of particles is measured, m.
const CELL_M: f64 = 0.1;

/// One generator for each dimension, the same ones for everybody (OpenCV).
fn dimensions(people: usize) -> Vec<Random> {
    (0..5 * people as u64).map(|dimension| Random::new(dimension, 0)).collect()
}
