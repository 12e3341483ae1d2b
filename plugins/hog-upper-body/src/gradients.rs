//! Gradients of a row of pixels, and their votes for orientation bins.

/// Number of pixels that are processed at once.
pub(crate) const LANES: usize = 8;

/// Votes of these pixels for each direction.
pub(crate) type Votes<const BINS: usize> = [[f32; LANES]; BINS];

/// Lengths and directions of gradients; the memory is reused for the next row.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Gradients {
    length: Vec<f32>,
    turn: Vec<f32>,
}

impl Gradients {
    /// Computes the gradients of all pixels of a row but the first and the last, up to `lanes`
    /// times [`LANES`]; `before` gradients without length come first, and more of them at the end
    /// if the row is shorter.
    pub(crate) fn fill(&mut self, [above, row, below]: [&[f32]; 3], before: usize, lanes: usize) {
        let whole = lanes * LANES;
        self.length.resize(whole, 0.0);
        self.turn.resize(whole, 0.0);
        let end = whole.min(before + row.len().saturating_sub(2));
        self.length[..before].fill(0.0);
        self.length[end..].fill(0.0);
        let length = &mut self.length[before..end];
        let turn = &mut self.turn[before..end];
        of_row(above, row, below, length, turn);
    }

    /// Returns the length of each gradient, of centred differences that are not halved, and its
    /// direction, in half turns from 0 to 1; opposite directions are the same.
    pub(crate) fn lanes(&self) -> impl Iterator<Item = (&[f32; LANES], &[f32; LANES])> {
        self.length.as_chunks().0.iter().zip(self.turn.as_chunks().0)
    }
}

/// Divides the length of each gradient between the two nearest directions. The first direction is
/// at `first` of a bin's width.
#[inline(always)]
pub(crate) fn votes<const BINS: usize>(
    length: &[f32; LANES],
    turn: &[f32; LANES],
    first: f32,
) -> Votes<BINS> {
    let mut votes = [[0.0; LANES]; BINS];
    for lane in 0..LANES {
        let length = length[lane];
        // In widths of a bin, times the length.
        let mut away = length * (turn[lane] * BINS as f32 - first);
        // The directions close on themselves: after half a turn, the first follows the last.
        let last = (-away).max(0.0);
        for votes in &mut votes {
            votes[lane] = (length - away.abs()).max(0.0);
            away -= length;
        }
        votes[0][lane] += (away + length).max(0.0);
        votes[BINS - 1][lane] += last;
    }
    votes
}

#[multiversion::multiversion(targets("x86_64+avx2"))]
fn of_row(above: &[f32], row: &[f32], below: &[f32], length: &mut [f32], turn: &mut [f32]) {
    let inner = length.len();
    let left = &row[..inner];
    let right = &row[2..inner + 2];
    let above = &above[1..=inner];
    let below = &below[1..=inner];
    for i in 0..inner {
        let x = right[i] - left[i];
        let y = below[i] - above[i];
        length[i] = (x * x + y * y).sqrt();
        turn[i] = half_turns(x, y);
    }
}

/// Returns the angle of a line, in half turns, by a polynomial in the tangent: with an error of
/// less than 1e-5, and without branches.
#[inline(always)]
fn half_turns(x: f32, y: f32) -> f32 {
    const TERMS: [f32; 6] =
        [0.318_302_6, -0.105_877_35, 0.061_606_795, -0.037_061_73, 0.016_760_074, -0.003_730_975];
    let across = x.abs();
    let down = y.abs();
    let less = across.min(down);
    let more = across.max(down);
    // The small constant makes the angle of a zero gradient 0 instead of NaN.
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

        #[test]
        fn a_gradient_is_shared_by_the_two_directions_that_are_nearest(
            length in 0.0..30.0f32, turn in 0.0..=1.0f32, half: bool,
        ) {
            const BINS: usize = 9;
            let first = if half { 0.5 } else { 0.0 };
            let found: Votes<BINS> = votes(&[length; LANES], &[turn; LANES], first);
            for (bin, votes) in found.iter().enumerate() {
                let off = (turn * BINS as f32 - first - bin as f32).rem_euclid(BINS as f32);
                let share = (1.0 - off.min(BINS as f32 - off)).max(0.0);
                prop_assert!(votes.iter().all(|vote| (vote - length * share).abs() < 1e-4));
            }
        }
    }

    #[test]
    fn no_gradient_has_no_length_and_any_direction() {
        let mut gradients = Gradients::default();
        gradients.fill([&[3.0; 5]; 3], 2, 1);
        assert_eq!(gradients.length, [0.0; LANES]);
        assert!(gradients.turn.iter().all(|turn| (0.0..=1.0).contains(turn)));
    }
}
