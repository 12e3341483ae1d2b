//! P4, section II-A: the depth of a head, by stereo, against its range.

use tagalong_sim::Scene;
use tagalong_stereo::{Method, StereoSettings};
use tagalong_trials::{HeadDepth, head_depths};

use crate::{Cell, Findings, Lab, ReproduceError, Row, Table};

/// Ranges of the head from the camera, m.
const RANGES_M: [f64; 6] = [1.0, 1.5, 2.0, 3.0, 4.0, 5.0];
/// Where the robot stands, and the person in front of it, m.
const ROBOT_X_M: f64 = 1.0;

/// Both methods of matching, on a person who turns on the spot.
pub fn experiment(lab: &Lab) -> Result<Findings, ReproduceError> {
    let methods = [("semi-global", Method::SemiGlobal), ("block", Method::Block)];
    lab.progress.begin(methods.len() * RANGES_M.len(), "depth of heads");
    let mut rows = vec![Row::published(
        "about 1 % at 3 m",
        vec![Cell::number(3.0, 1), Cell::default(), Cell::number(1.0, 1), Cell::default()],
    )];
    for (name, method) in methods {
        let settings = StereoSettings { method, ..StereoSettings::default() };
        for range_m in RANGES_M {
            rows.push(row(name, &heads(lab, range_m, &settings)?));
            lab.progress.step();
        }
    }
    let columns = ["range, m", "error, m", "scatter, % of range", "with depth, %"];
    let table = Table {
        title: "Depth of a head by stereo (P4, section II-A)".into(),
        columns: columns.map(str::to_owned).to_vec(),
        rows,
        notes: vec![
            "A drawn person turns on the spot; walls with and without texture, five lights.".into(),
            "Median depth of a patch of 12 cm against the face, without a detector; errors of \
             0.5 m and more count as without depth."
                .into(),
        ],
    };
    Ok(table.into())
}

fn heads(
    lab: &Lab,
    range_m: f64,
    settings: &StereoSettings,
) -> Result<Vec<HeadDepth>, ReproduceError> {
    let at = (ROBOT_X_M + range_m).to_string();
    let set = [("camera.kind", "stereo"), ("people.0.path.0.0", at.as_str()), ("duration_s", "2.0")];
    let of_scene = |scene: &Scene| head_depths(scene, settings, lab.jobs);
    let scenes = lab.scenes("turntable", &set, lab.seeds(36))?;
    let all: Result<Vec<_>, _> = scenes.iter().map(of_scene).collect();
    Ok(all?.concat())
}

fn row(name: &str, heads: &[HeadDepth]) -> Row {
    let errors: Vec<f64> = heads.iter().filter_map(HeadDepth::error_m).collect();
    let ranges: Vec<f64> = heads.iter().map(|head| head.truth_m).collect();
    let range = Cell { deviation: None, ..Cell::mean(&ranges, 2) };
    let error = Cell::mean(&errors, 3);
    let scatter = error.deviation.zip(range.value).map_or(f64::NAN, |(s, range)| 100.0 * s / range);
    let known = 100.0 * errors.len() as f64 / heads.len().max(1) as f64;
    Row::ours(name, vec![range, error, Cell::number(scatter, 1), Cell::number(known, 1)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scatter_is_a_part_of_the_range() {
        let head = |error: Option<f64>| HeadDepth { truth_m: 2.0, measured_m: error.map(|e| 2.0 + e) };
        let cells = row("x", &[head(Some(0.04)), head(Some(0.0)), head(None), head(None)]).cells;
        let values: Vec<f64> = cells.iter().map(|cell| cell.value.unwrap()).collect();
        for (value, wanted) in values.iter().zip([2.0, 0.02, 1.0, 50.0]) {
            assert!((value - wanted).abs() < 1e-9, "{values:?}");
        }
        assert!(row("x", &[]).cells.iter().skip(1).take(2).all(|cell| cell.value.is_none()));
    }
}
