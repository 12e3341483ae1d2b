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
    /// Weighted centre, reduced pixels.
    pub x: f64,
    /// Its row.
    pub y: f64,
    /// Depth at the best cell, m.
    pub depth_m: f64,
    /// Cost of the best cell.
    pub cost: f64,
    /// Cells.
    pub cells: u32,
}

/// Only cells this near to the best one decide where the head is, m.
const SAME_HEAD_M: f64 = 0.07;

/// Groups cells into people: every minimum of the cost that is not nearer than
/// `separation_m` on the floor to a better one is a person, and each cell goes
/// to the nearest of them. The centre is weighted by `limit - cost`, so that a
/// component of two people who touch is split at its minima and neither centre
/// is drawn to the other.
pub fn group(cells: &mut [Cell], limit: f64, separation_m: f64) -> Vec<Group> {
    let order = |a: &Cell, b: &Cell| a.cost.total_cmp(&b.cost).then((a.y, a.x).cmp(&(b.y, b.x)));
    cells.sort_by(order);
    let mut seeds: Vec<(Cell, [f64; 3], u32)> = Vec::new();
    for cell in cells.iter() {
        let distance = |seed: &Cell| (seed.head.xy() - cell.head.xy()).norm();
        let nearest = seeds.iter_mut().min_by(|a, b| distance(&a.0).total_cmp(&distance(&b.0)));
        let weight = limit - cell.cost;
        match nearest {
            Some((seed, sums, count)) if distance(seed) < separation_m => {
                if (seed.head - cell.head).norm() < SAME_HEAD_M {
                    *sums = [
                        sums[0] + weight * cell.x as f64,
                        sums[1] + weight * cell.y as f64,
                        sums[2] + weight,
                    ];
                }
                *count += 1;
            }
            _ => {
                let sums = [weight * cell.x as f64, weight * cell.y as f64, weight];
                seeds.push((*cell, sums, 1));
            }
        }
    }
    let finish = |(cell, sums, cells): (Cell, [f64; 3], u32)| {
        let [x, y] = if sums[2] > 0.0 {
            [sums[0] / sums[2], sums[1] / sums[2]]
        } else {
            [cell.x as f64, cell.y as f64]
        };
        Group { x, y, depth_m: cell.depth_m, cost: cell.cost, cells }
    };
    seeds.into_iter().map(finish).collect()
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
        let mut found: Vec<f64> = group(&mut cells, 0.3, 0.3).iter().map(|g| g.x).collect();
        found.sort_by(f64::total_cmp);
        assert_eq!(found.len(), 2);
        assert!((found[0] - 8.0).abs() < 0.1 && (found[1] - 30.0).abs() < 0.1, "{found:?}");
    }

    #[test]
    fn the_order_of_cells_does_not_matter() {
        let mut a: Vec<Cell> = (0..20).map(|x| cell(x, 0.1 + 0.01 * (x % 7) as f64)).collect();
        let mut b: Vec<Cell> = a.iter().rev().copied().collect();
        let (a, b) = (group(&mut a, 0.3, 0.3), group(&mut b, 0.3, 0.3));
        assert_eq!(format!("{a:?}"), format!("{b:?}"));
    }
}
