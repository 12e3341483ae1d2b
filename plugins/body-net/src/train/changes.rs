//! Random changes of a candidate that keep it realistic (data augmentation).

use tagalong_learn::mix;

use crate::NetworkInput;

/// Contrast is changed by at most this part, ...
const CONTRAST: f32 = 0.2;
/// ... and each intensity by this.
const NOISE: f32 = 4.0;

/// Numbers that look random.
pub struct Draws(pub u64);

impl Draws {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(1);
        mix(self.0)
    }

    /// A number from -1 to 1.
    pub fn within(&mut self) -> f32 {
        (self.next() >> 40) as f32 / (1u64 << 23) as f32 - 1.0
    }
}

/// Perhaps mirrored, moved by two cells, of other contrast, noisier.
pub fn changed(view: &NetworkInput, draws: &mut Draws) -> NetworkInput {
    let chance = draws.next();
    let mirrored = chance & 1 == 1;
    let moved = [(chance >> 8) % 3, (chance >> 16) % 3].map(|third| third as i64 - 1);
    let contrast = 1.0 + CONTRAST * draws.within();
    let mut grey: Vec<u8> = cells(NetworkInput::GREY, moved.map(|by| 2 * by), mirrored)
        .map(|cell| view.grey[cell])
        .collect();
    for value in &mut grey {
        let around = f32::from(*value) - 128.0;
        // A float that is cast stays within 0 to 255.
        *value = (128.0 + contrast * around + NOISE * draws.within()).round() as u8;
    }
    let behind =
        cells(NetworkInput::DEPTH, moved, mirrored).map(|cell| view.behind[cell]).collect();
    NetworkInput { grey, behind }
}

/// Where the cells of a moved and mirrored image come from; the border is continued.
fn cells(
    [rows, columns]: [usize; 2],
    [down, right]: [i64; 2],
    mirrored: bool,
) -> impl Iterator<Item = usize> {
    fn from(at: usize, by: i64, size: usize) -> usize {
        (at as i64 - by).clamp(0, size as i64 - 1) as usize
    }

    (0..rows * columns).map(move |cell| {
        let row = from(cell / columns, down, rows);
        let column = from(cell % columns, right, columns);
        row * columns + if mirrored { columns - 1 - column } else { column }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_moved_and_mirrored_is_still_there() {
        let plain: Vec<usize> = cells([2, 3], [0, 0], false).collect();
        assert_eq!(plain, [0, 1, 2, 3, 4, 5]);
        assert_eq!(cells([2, 3], [0, 0], true).collect::<Vec<_>>(), [2, 1, 0, 5, 4, 3]);
        assert_eq!(cells([2, 3], [1, 0], false).collect::<Vec<_>>(), [0, 1, 2, 0, 1, 2]);
        assert_eq!(cells([2, 3], [0, -1], false).collect::<Vec<_>>(), [1, 2, 2, 4, 5, 5]);
    }

    #[test]
    fn intensity_and_depth_move_together() {
        let mut view = NetworkInput { grey: vec![0; 80 * 36], behind: vec![0; 40 * 18] };
        let row = 30;
        let column = 8;
        view.behind[row * 18 + column] = 90;
        view.grey[2 * row * 36 + 2 * column] = 255;
        for seed in 0..20 {
            let other = changed(&view, &mut Draws(seed));
            let depth = other.behind.iter().position(|v| *v == 90).unwrap();
            let grey = other.grey.iter().position(|v| *v > 150).unwrap();
            let rows = [grey / 36, 2 * (depth / 18)];
            let columns = [grey % 36, 2 * (depth % 18)];
            assert_eq!(rows[0], rows[1]);
            assert!(columns[0].abs_diff(columns[1]) <= 1, "{columns:?}");
        }
    }

    #[test]
    fn draws_fill_their_range() {
        let mut draws = Draws(3);
        let all: Vec<f32> = (0..1000).map(|_| draws.within()).collect();
        assert!(all.iter().all(|v| (-1.0..=1.0).contains(v)));
        assert!(all.iter().sum::<f32>().abs() < 60.0);
        assert!(all.iter().any(|v| *v < -0.95) && all.iter().any(|v| *v > 0.95));
    }

    #[test]
    fn half_are_mirrored_and_all_moves_are_made() {
        let mut view = NetworkInput { grey: vec![128; 80 * 36], behind: vec![0; 40 * 18] };
        view.behind[20 * 18 + 5] = 90;
        let mut mirrored = 0;
        let mut moves = std::collections::BTreeMap::new();
        for seed in 0..300 {
            let other = changed(&view, &mut Draws(1000 * seed));
            let at = other.behind.iter().position(|v| *v == 90).unwrap();
            let row = at / 18;
            let column = at % 18;
            let is_mirrored = column > 8;
            mirrored += usize::from(is_mirrored);
            let column = if is_mirrored { 17 - column } else { column };
            *moves.entry((row, column)).or_insert(0) += 1;
        }
        assert!((110..190).contains(&mirrored), "{mirrored}");
        let places =
            moves.keys().all(|(row, column)| row.abs_diff(20) <= 1 && column.abs_diff(5) <= 1);
        assert!(places && moves.len() == 9 && moves.values().all(|n| *n > 12), "{moves:?}");
    }

    /// At 128 the contrast changes nothing, so that all of the change is noise.
    #[test]
    fn noise_is_around_zero_and_bounded() {
        let view = NetworkInput { grey: vec![128; 80 * 36], behind: vec![0; 40 * 18] };
        let grey = changed(&view, &mut Draws(7)).grey;
        let mean = grey.iter().map(|v| f64::from(*v)).sum::<f64>() / grey.len() as f64;
        assert!((mean - 128.0).abs() < 0.3, "{mean}");
        assert_eq!((grey.iter().min(), grey.iter().max()), (Some(&124), Some(&132)));
    }
}
