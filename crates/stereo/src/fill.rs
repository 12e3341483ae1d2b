//! Closes small holes of a surface.

/// Fills holes of at most `most` pixels along a row whose both ends differ by at
/// most `step`, by a straight line between them; returns how many pixels that
/// were. What only one camera sees lies between a near and a far surface, and so
/// stays open.
pub fn holes(image: &mut [f32], width: usize, most: usize, step: f32) -> u64 {
    let rows = image.chunks_exact_mut(width.max(1));
    rows.map(|row| fill_row(row, most, step)).sum()
}

fn fill_row(row: &mut [f32], most: usize, step: f32) -> u64 {
    let (mut filled, mut last) = (0, None::<usize>);
    for x in 0..row.len() {
        if row[x].is_nan() {
            continue;
        }
        if let Some(from) = last {
            let hole = x - from - 1;
            if (1..=most).contains(&hole) && (row[x] - row[from]).abs() <= step {
                bridge(&mut row[from..=x]);
                filled += hole as u64;
            }
        }
        last = Some(x);
    }
    filled
}

fn bridge(row: &mut [f32]) {
    let end = row.len() - 1;
    let (first, slope) = (row[0], (row[end] - row[0]) / end as f32);
    for (i, value) in row.iter_mut().enumerate().take(end).skip(1) {
        *value = first + slope * i as f32;
    }
}
