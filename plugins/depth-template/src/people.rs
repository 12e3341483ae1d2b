use nalgebra::Point3;

/// A place where a silhouette fits.
#[derive(Clone, Copy, Debug)]
pub struct Cell {
    /// Reduced pixel.
    pub x: i64,
    /// Its row.
    pub y: i64,
    /// Depth of the face, m.
    pub depth_m: f64,
    /// Cost of the best template.
    pub cost: f64,
    /// The head centre, robot frame.
    pub head: Point3<f64>,
}

/// Cells that belong to one person.
#[derive(Clone, Copy, Debug)]
pub struct Group {
    /// The cell where the silhouette fits best.
    pub best: Cell,
    /// Cells.
    pub cells: u32,
}

/// Groups cells into people: every minimum of the cost that is not nearer than `separation_m` on
/// the floor to a better one is a person, and each cell goes to the nearest of them, so that a
/// component of two people that touch is split at its minima.
pub fn group(cells: &mut [Cell], separation_m: f64) -> Vec<Group> {
    cells.sort_by(|a, b| a.cost.total_cmp(&b.cost).then((a.y, a.x).cmp(&(b.y, b.x))));
    let mut groups: Vec<Group> = Vec::new();
    for cell in cells.iter() {
        let apart_m = groups.iter_mut().map(|group| {
            let off = group.best.head.xy() - cell.head.xy();
            (off.norm(), group)
        });
        match apart_m.min_by(|(a, _), (b, _)| a.total_cmp(b)) {
            Some((apart_m, nearest)) if apart_m < separation_m => nearest.cells += 1,
            _ => groups.push(Group { best: *cell, cells: 1 }),
        }
    }
    groups
}

/// The centre of the places where a silhouette fits, each weighted by how much
/// better than `limit` it does; `None` if none does.
pub fn weighted_centre(
    fits: impl IntoIterator<Item = (i64, i64, f64)>,
    limit: f64,
) -> Option<(f64, f64)> {
    let mut x = 0.0;
    let mut y = 0.0;
    let mut sum = 0.0;
    for (at_x, at_y, cost) in fits {
        let weight = (limit - cost).max(0.0);
        x += weight * at_x as f64;
        y += weight * at_y as f64;
        sum += weight;
    }
    (sum > 0.0).then(|| (x / sum, y / sum))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cell(x: i64, cost: f64) -> Cell {
        let head = Point3::new(2.0, -0.02 * x as f64, 1.6);
        Cell { x, y: 0, depth_m: 2.0, cost, head }
    }

    #[test]
    fn two_people_who_touch_stay_two_with_their_own_centres() {
        let mut cells: Vec<Cell> = (0..40)
            .map(|x| cell(x, 0.1 + 0.01 * ((x - 8).abs().min((x - 30).abs())) as f64))
            .collect();
        let mut found: Vec<i64> = group(&mut cells, 0.3).iter().map(|g| g.best.x).collect();
        found.sort_unstable();
        assert_eq!(found, [8, 30]);
    }

    #[test]
    fn the_order_of_cells_does_not_matter() {
        let mut a: Vec<Cell> = (0..20).map(|x| cell(x, 0.1 + 0.01 * (x % 7) as f64)).collect();
        let mut b: Vec<Cell> = a.iter().rev().copied().collect();
        let a = group(&mut a, 0.3);
        let b = group(&mut b, 0.3);
        assert_eq!(format!("{a:?}"), format!("{b:?}"));
    }

    #[test]
    fn a_better_fit_draws_the_centre() {
        let fits = [(0, 0, 0.1), (1, 0, 0.2), (2, 0, 0.9)];
        let (x, y) = weighted_centre(fits, 0.3).unwrap();
        assert!((x - 1.0 / 3.0).abs() < 1e-12 && y == 0.0);
        assert_eq!(weighted_centre([(0, 0, 0.5)], 0.3), None);
    }
}
