//! Gradients of a row of pixels.

/// Lengths and directions; keeps its memory from one row to the next.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Gradients {
    /// Length of each gradient, of centred differences that are not halved.
    pub(crate) length: Vec<f32>,
    /// Its direction, in half turns from 0 to 1; opposite ones are the same.
    pub(crate) turn: Vec<f32>,
}

impl Gradients {
    /// Those of the pixels of `row` but the first and the last.
    pub(crate) fn fill(&mut self, [above, row, below]: [&[f32]; 3]) {
        let inner = row.len().saturating_sub(2);
        self.length.resize(inner, 0.0);
        self.turn.resize(inner, 0.0);
        of_row(above, row, below, &mut self.length, &mut self.turn);
    }
}

#[multiversion::multiversion(targets("x86_64+avx2"))]
fn of_row(above: &[f32], row: &[f32], below: &[f32], length: &mut [f32], turn: &mut [f32]) {
    let inner = length.len();
    let (left, right) = (&row[..inner], &row[2..inner + 2]);
    let (above, below) = (&above[1..=inner], &below[1..=inner]);
    for i in 0..inner {
        let (x, y) = (right[i] - left[i], below[i] - above[i]);
        length[i] = (x * x + y * y).sqrt();
        turn[i] = half_turns(x, y);
    }
}

/// The angle of a line, in half turns, by a polynomial in the tangent: off by
/// less than 1e-5, and without branches.
#[inline(always)]
fn half_turns(x: f32, y: f32) -> f32 {
    const TERMS: [f32; 6] =
        [0.318_302_6, -0.105_877_35, 0.061_606_795, -0.037_061_73, 0.016_760_074, -0.003_730_975];
    let (across, down) = (x.abs(), y.abs());
    let (less, more) = (across.min(down), across.max(down));
    let t = less / (more + 1e-20);
    let s = t * t;
    let [a, b, c, d, e, f] = TERMS;
    let part = t * (a + s * (b + s * (c + s * (d + s * (e + s * f)))));
    let part = if down > across { 0.5 - part } else { part };
    if x * y < 0.0 { 1.0 - part } else { part }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn turns_are_those_of_the_arc_tangent(x in -20.0..20.0f32, y in -20.0..20.0f32) {
            let slow = y.atan2(x).rem_euclid(std::f32::consts::PI) / std::f32::consts::PI;
            let off = (half_turns(x, y) - slow).abs();
            prop_assert!(off.min(1.0 - off) < 2e-5, "{off}");
        }
    }

    #[test]
    fn no_gradient_has_no_length_and_any_direction() {
        let mut gradients = Gradients::default();
        gradients.fill([&[3.0; 5]; 3]);
        assert_eq!(gradients.length, [0.0; 3]);
        assert!(gradients.turn.iter().all(|turn| (0.0..=1.0).contains(turn)));
    }
}
