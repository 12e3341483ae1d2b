/// Decay rates per step of the means of the gradient and of its squares.
const FADE: [f32; 2] = [0.9, 0.999];
/// Largest norm of the gradient; a longer one is scaled down.
const LONGEST: f32 = 1.0;
/// Fraction of the training in which the learning rate rises.
const WARM: f64 = 0.1;

/// The optimiser Adam (Kingma and Ba, ICLR 2015), with decoupled weight decay (Loshchilov and
/// Hutter, ICLR 2019).
#[derive(Clone, Debug, Default)]
pub struct Adam {
    steps: i32,
    mean: Vec<f32>,
    squares: Vec<f32>,
}

impl Adam {
    /// Takes a step of the weights against the gradient; both are given in the same parts, of any
    /// size.
    pub fn step<'a>(
        &mut self,
        weights: impl IntoIterator<Item = &'a mut [f32]>,
        gradient: &[&[f32]],
        rate: f32,
        decay: f32,
    ) {
        self.steps += 1;
        let slopes = gradient.iter().copied().flatten();
        let length = slopes.clone().map(|g| g * g).sum::<f32>().sqrt();
        let scale = LONGEST / length.max(LONGEST);
        let whole = FADE.map(|fade| 1.0 - fade.powi(self.steps));
        let count = slopes.clone().count();
        self.mean.resize(count, 0.0);
        self.squares.resize(count, 0.0);
        let moments = self.mean.iter_mut().zip(&mut self.squares);
        let weights = weights.into_iter().flatten();
        for ((value, slope), (mean, square)) in weights.zip(slopes).zip(moments) {
            let slope = slope * scale;
            *mean = FADE[0] * *mean + (1.0 - FADE[0]) * slope;
            *square = FADE[1] * *square + (1.0 - FADE[1]) * slope * slope;
            let step = (*mean / whole[0]) / ((*square / whole[1]).sqrt() + 1e-8);
            *value -= rate * (step + decay * *value);
        }
    }
}

/// Returns the factor of the learning rate after this fraction of a training: it rises linearly,
/// and then falls to zero as a cosine (Loshchilov and Hutter, ICLR 2017).
pub fn pace(part: f64) -> f64 {
    if part < WARM {
        part / WARM
    } else {
        0.5 + 0.5 * (std::f64::consts::PI * (part - WARM) / (1.0 - WARM)).cos()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_lead_to_the_minimum_of_a_bowl() {
        let mut weights = [3.0, -2.0, 0.5];
        let mut adam = Adam::default();
        for k in 0..400 {
            let gradient = [weights[0] - 1.0, 4.0 * (weights[1] - 2.0), weights[2]];
            let rate = 0.1 * pace(f64::from(k) / 400.0) as f32;
            let (first, second) = weights.split_at_mut(1);
            adam.step([first, second], &[&gradient[..2], &gradient[2..]], rate, 0.0);
        }
        for (weight, best) in weights.iter().zip([1.0, 2.0, 0.0]) {
            assert!((weight - best).abs() < 0.02, "{weights:?}");
        }
    }

    #[test]
    fn the_rate_rises_and_falls() {
        assert_eq!([pace(0.0), pace(0.05), pace(0.1)], [0.0, 0.5, 1.0]);
        assert!(pace(1.0) < 1e-12 && pace(0.5) < pace(0.3));
    }
}
