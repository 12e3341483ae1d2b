//! Dual coordinate descent for a linear SVM (C.-J. Hsieh et al., *A dual coordinate descent method
//! for large-scale linear SVM*, ICML 2008, algorithm 1, with the squared hinge loss).

use crate::model::dot;

/// Slope of the objective below which a dual variable counts as converged.
const STILL: f32 = 1e-3;

/// Values of windows, one after the other, with their truth.
#[derive(Default)]
pub(crate) struct Windows {
    pub(crate) numbers: Vec<f32>,
    pub(crate) is_person: Vec<bool>,
    /// Numbers of their rooms; 0 for photographs.
    pub(crate) room: Vec<usize>,
}

impl Windows {
    pub(crate) fn add(&mut self, numbers: &[f32], is_person: bool, room: usize) {
        self.numbers.extend_from_slice(numbers);
        self.is_person.push(is_person);
        self.room.push(room);
    }

    pub(crate) fn len(&self) -> usize {
        self.is_person.len()
    }

    /// Returns the number of values of a window.
    pub(crate) fn width(&self) -> usize {
        self.numbers.len() / self.len().max(1)
    }
}

/// Returns the weights and the bias that separate the windows best; `penalty` is that of an error
/// with windows of others and with windows of people.
pub(crate) fn separate(
    windows: &Windows,
    penalty: [f64; 2],
    epochs: usize,
    seed: u64,
) -> (Vec<f32>, f32) {
    let width = windows.width();
    let mut weights = vec![0.0_f32; width];
    let mut bias = 0.0_f32;
    let mut alphas = vec![0.0_f32; windows.len()];
    let mut lengths = Vec::with_capacity(windows.len());
    for i in 0..windows.len() {
        let row = &windows.numbers[i * width..(i + 1) * width];
        // The bias is the weight of a constant value 1, which adds 1 to each squared length.
        lengths.push(dot(row, row) + 1.0);
    }
    let mut order: Vec<usize> = (0..windows.len()).collect();
    for epoch in 0..epochs {
        shuffle(&mut order, seed.wrapping_add(epoch as u64));
        let mut most = 0.0_f32;
        for &i in &order {
            let sign = if windows.is_person[i] { 1.0 } else { -1.0 };
            let softness = (0.5 / penalty[usize::from(windows.is_person[i])]) as f32;
            let row = &windows.numbers[i * width..(i + 1) * width];
            let sum = dot(&weights, row) + bias;
            let slope = sign * sum - 1.0 + softness * alphas[i];
            let wanted = (alphas[i] - slope / (lengths[i] + softness)).max(0.0);
            let step = (wanted - alphas[i]) * sign;
            if step == 0.0 {
                continue;
            }
            most = most.max(slope.abs());
            alphas[i] = wanted;
            weights.iter_mut().zip(row).for_each(|(w, v)| *w += step * v);
            bias += step;
        }
        if most < STILL {
            break;
        }
    }
    (weights, bias)
}

/// Shuffles by Fisher and Yates, with numbers of splitmix64.
fn shuffle(order: &mut [usize], seed: u64) {
    let mut state = seed;
    for i in (1..order.len()).rev() {
        state = tagalong_learn::mix(state.wrapping_add(i as u64));
        order.swap(i, (state % (i as u64 + 1)) as usize);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The primal: |w|²/2 + sum of penalties times squared hinges.
    fn primal(windows: &Windows, width: usize, penalty: [f64; 2], w: &[f32], bias: f32) -> f64 {
        let half = 0.5 * f64::from(dot(w, w) + bias * bias);
        half + (0..windows.len())
            .map(|i| {
                let sign = if windows.is_person[i] { 1.0 } else { -1.0 };
                let sum = dot(w, &windows.numbers[i * width..(i + 1) * width]) + bias;
                penalty[usize::from(windows.is_person[i])]
                    * f64::from((1.0 - sign * sum).max(0.0)).powi(2)
            })
            .sum::<f64>()
    }

    /// Draws a number between -0.5 and 0.5.
    fn next_number(state: &mut u64) -> f32 {
        *state = tagalong_learn::mix(state.wrapping_add(1));
        (*state >> 40) as f32 / (1_u64 << 24) as f32 - 0.5
    }

    #[test]
    fn no_small_step_makes_the_solution_better() {
        let mut windows = Windows::default();
        let mut state = 5_u64;
        for i in 0..200 {
            let shift = if i % 2 == 0 { 0.3 } else { -0.3 };
            let numbers: Vec<f32> = (0..6).map(|_| next_number(&mut state) + shift).collect();
            windows.add(&numbers, i % 2 == 0, 0);
        }
        let penalty = [0.5, 1.0];
        let (weights, bias) = separate(&windows, penalty, 2000, 1);
        let best = primal(&windows, 6, penalty, &weights, bias);
        for k in 0..6 {
            for step in [-0.01, 0.01] {
                let mut other = weights.clone();
                other[k] += step;
                assert!(primal(&windows, 6, penalty, &other, bias) >= best - 1e-5, "{k}");
            }
        }
        for step in [-0.01, 0.01] {
            assert!(primal(&windows, 6, penalty, &weights, bias + step) >= best - 1e-5);
        }
    }
}
