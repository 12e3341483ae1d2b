//! The naive Bayes classifier (P2, eqs 4 to 6).

/// Distributions of the features of boxes on a person, and of boxes beside them.
#[derive(Clone, Debug, PartialEq)]
pub struct Appearance {
    person: Normals,
    other: Normals,
    /// Made from the two, for speed.
    terms: Vec<Term>,
}

/// A normal distribution for each number.
#[derive(Clone, Debug, PartialEq)]
struct Normals {
    mean: Vec<f32>,
    sigma: Vec<f32>,
}

/// log N(v; m1, s1) - log N(v; m0, s0) = c + (v - m0)² / 2 s0² - (v - m1)² / 2 s1².
#[derive(Clone, Copy, Debug, PartialEq, Default)]
struct Term {
    constant: f32,
    mean: [f32; 2],
    precision: [f32; 2],
}

/// Sums over samples.
#[derive(Clone, Debug, Default)]
pub struct Samples {
    count: usize,
    sum: Vec<f64>,
    squares: Vec<f64>,
}

impl Samples {
    /// Forgets all samples of boxes with `numbers` numbers.
    pub fn clear(&mut self, numbers: usize) {
        self.count = 0;
        for sums in [&mut self.sum, &mut self.squares] {
            sums.clear();
            sums.resize(numbers, 0.0);
        }
    }

    /// Takes in a sample.
    pub fn add(&mut self, numbers: &[f32]) {
        self.count += 1;
        for ((sum, square), v) in self.sum.iter_mut().zip(&mut self.squares).zip(numbers) {
            *sum += f64::from(*v);
            *square += f64::from(*v) * f64::from(*v);
        }
    }

    /// Returns the number of features.
    pub fn len(&self) -> usize {
        self.count
    }

    /// Mean and standard deviation of each number.
    fn moments(&self) -> impl Iterator<Item = (f32, f32)> + '_ {
        let n = self.count.max(1) as f64;
        self.sum.iter().zip(&self.squares).map(move |(sum, squares)| {
            let mean = sum / n;
            (mean as f32, (squares / n - mean * mean).max(0.0).sqrt() as f32)
        })
    }
}

impl Normals {
    fn blank(numbers: usize) -> Self {
        Self { mean: vec![0.0; numbers], sigma: vec![1.0; numbers] }
    }

    /// Eq. 6; the deviation is updated with the mean before this update.
    fn update(&mut self, samples: &Samples, memory: f32) {
        let old = memory;
        let new = 1.0 - memory;
        for ((mean, sigma), (m, s)) in
            self.mean.iter_mut().zip(&mut self.sigma).zip(samples.moments())
        {
            let apart = *mean - m;
            *sigma = (old * *sigma * *sigma + new * s * s + old * new * apart * apart).sqrt();
            *mean = old * *mean + new * m;
        }
    }
}

impl Appearance {
    /// Knows nothing: all means are 0, all deviations 1.
    pub fn blank(numbers: usize) -> Self {
        Self {
            person: Normals::blank(numbers),
            other: Normals::blank(numbers),
            terms: vec![Term::default(); numbers],
        }
    }

    /// Learns from samples of both kinds; `memory` is the weight of the past
    /// (the paper's lambda), `min_sigma` the least deviation that is believed.
    pub fn learn(&mut self, person: &Samples, other: &Samples, memory: f64, min_sigma: f64) {
        self.person.update(person, memory as f32);
        self.other.update(other, memory as f32);
        let floor = min_sigma as f32;
        for (index, term) in self.terms.iter_mut().enumerate() {
            let [(m1, s1), (m0, s0)] = [&self.person, &self.other]
                .map(|normals| (normals.mean[index], normals.sigma[index].max(floor)));
            *term = Term {
                constant: (s0 / s1).ln(),
                mean: [m0, m1],
                precision: [0.5 / (s0 * s0), 0.5 / (s1 * s1)],
            };
        }
    }

    /// H / n: the mean log-ratio of a number, above 0 for the person.
    pub fn confidence(&self, numbers: &[f32]) -> f32 {
        let ratios = self.terms.iter().zip(numbers).map(|(term, v)| {
            let away = v - term.mean[0];
            let here = v - term.mean[1];
            term.constant + away * away * term.precision[0] - here * here * term.precision[1]
        });
        ratios.sum::<f32>() / self.terms.len().max(1) as f32
    }

    /// Mean and standard deviation of a number on the person.
    pub fn person(&self, number: usize) -> Option<(f32, f32)> {
        Some((*self.person.mean.get(number)?, *self.person.sigma.get(number)?))
    }
}
