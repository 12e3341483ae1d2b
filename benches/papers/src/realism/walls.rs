//! Depth of a flat wall: its scatter, its fill rate and its offset. For stereo and structured light
//! the scatter of depth grows with its square, `z² s / (f B)` for a scatter `s` of the disparity.
//! The wall is seen askew, so that it covers many steps of the disparity.

use nalgebra::{Matrix3, Vector3};
use tagalong_core::DepthImage;
use tagalong_stereo::StereoSettings;
use tagalong_trials::TrialError;

use super::{Check, depth, deviation, scene, simulated_with};
use crate::draws::mean;

/// Distances of the wall, m.
const RANGES_M: [f64; 6] = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
/// Angle of the camera to the wall's normal, degrees.
const ASKEW_DEG: f64 = 20.0;

/// Camera, and the limits of its check.
pub struct Rig {
    group: &'static str,
    /// `kind` of the camera in the scene.
    kind: &'static str,
    baseline_m: f64,
    /// Half of the part of the columns and of the rows that show only the wall.
    window: [f64; 2],
    /// Least and greatest scatter of the disparity, pixels.
    sigma_px: [f64; 2],
    /// Least part of the wall that has depth up to 4 m.
    fill: f64,
    /// True if a wall in one colour has little depth.
    needs_texture: bool,
}

/// Structured light.
pub const RGBD: Rig = Rig {
    group: "depth of a wall (RGB-D camera)",
    kind: "rgbd",
    baseline_m: 0.075,
    window: [0.25, 0.2],
    sigma_px: [0.03, 0.25],
    fill: 0.9,
    needs_texture: false,
};

/// Matched pair before a wall with texture.
pub const STEREO: Rig = Rig {
    group: "depth of a wall (stereo pair)",
    kind: "stereo",
    baseline_m: 0.12,
    window: [0.15, 0.09],
    sigma_px: [0.05, 0.25],
    fill: 0.8,
    needs_texture: true,
};

/// Measurements of a wall.
struct Wall {
    range_m: f64,
    /// Standard deviation from the best plane, m.
    residual_m: f64,
    /// Offset of the plane at the centre from the wall, m.
    bias_m: f64,
    /// Fraction of pixels with a reading.
    fill: f64,
    /// Scatter of the disparity that explains the residual, pixels.
    sigma_px: f64,
}

pub fn checks(rig: &Rig) -> Result<Vec<Check>, TrialError> {
    let group = rig.group;
    let walls: Vec<Wall> = RANGES_M.iter().filter_map(|range| measure(rig, *range, true)).collect();
    if walls.len() < RANGES_M.len() {
        return Ok(vec![Check::skipped(group, "a wall has no depth at all")]);
    }
    let mut checks: Vec<Check> = walls.iter().flat_map(|wall| of_wall(rig, wall)).collect();
    let inner = walls.iter().filter(|wall| (2.0..=5.0).contains(&wall.range_m));
    let sigmas: Vec<f64> = inner.map(|wall| wall.sigma_px).collect();
    let (least, most) = sigmas.iter().fold((f64::MAX, 0.0_f64), |(a, b), s| (a.min(*s), b.max(*s)));
    let what = "largest over smallest disparity scatter, 2 to 5 m";
    checks.push(Check::between(group, what, most / least, "", [1.0, 2.0]));
    if let Some(wall) = walls.iter().find(|wall| wall.range_m == 3.0) {
        let percent = 100.0 * wall.residual_m / 3.0;
        let what = "scatter of one pixel at 3 m, part of the range";
        checks.push(Check::between(group, what, percent, "%", [0.2, 2.0]));
        let what = "offset of the wall at 3 m, part of the range";
        let percent = 100.0 * wall.bias_m.abs() / 3.0;
        checks.push(Check::between(group, what, percent, "%", [f64::NEG_INFINITY, 1.0]));
    }
    if rig.needs_texture {
        let fill = measure(rig, 3.0, false).map_or(0.0, |wall| wall.fill);
        let what = "fill rate at 3 m without wallpaper";
        checks.push(Check::between(group, what, fill, "", [f64::NEG_INFINITY, 0.5]));
    }
    Ok(checks)
}

fn of_wall(rig: &Rig, wall: &Wall) -> [Check; 3] {
    let group = rig.group;
    let at = format!("at {} m", wall.range_m);
    // Holes are rare near by; far away light or texture is lost.
    let fill = if wall.range_m <= 4.0 { [rig.fill, 1.0] } else { [0.2, 1.0] };
    [
        Check::told(group, format!("plane residual {at}"), wall.residual_m, "m"),
        Check::between(group, format!("disparity scatter {at}"), wall.sigma_px, "px", rig.sigma_px),
        Check::between(group, format!("fill rate {at}"), wall.fill, "", fill),
    ]
}

fn measure(rig: &Rig, range_m: f64, wallpaper: bool) -> Option<Wall> {
    // The robot stands 1 m from the wall behind it.
    let length_m = range_m + 1.0;
    let room = format!("[room]\nsize_m = [{length_m}, 14.0]\nwallpaper = {wallpaper}\n");
    let Rig { kind, baseline_m, .. } = *rig;
    let camera = format!("kind = \"{kind}\"\nbaseline_m = {baseline_m}\nmount_error_deg = 0.0\n");
    let text = format!(
        "duration_s = 0.35\n{room}[camera]\n{camera}[robot]\nstart = [1.0, 7.0]\n\
         heading_deg = {ASKEW_DEG:.1}\n\
         [faults]\ndropped = 0.0\nlate = 0.0\n"
    );
    let mut fits = Vec::new();
    let mut focal_px = 0.0;
    // The pipelines' texture threshold rejects the faint wallpaper; here the matcher itself is
    // under test.
    let settings = StereoSettings { texture: 0, ..StereoSettings::default() };
    for simulated in simulated_with(&scene(&text), settings) {
        focal_px = simulated.frame.camera.focal_px();
        fits.extend(fit(depth(&simulated.frame)?, rig.window));
    }
    if fits.is_empty() {
        return None;
    }
    let picks: [fn(&Fit) -> f64; 3] = [|fit| fit.residual_m, |fit| fit.centre_m, |fit| fit.fill];
    let [residual_m, middle_m, fill] =
        picks.map(|pick| mean(&fits.iter().map(pick).collect::<Vec<f64>>()));
    // The askew optical axis meets the wall farther away.
    let centre_m = range_m / ASKEW_DEG.to_radians().cos();
    Some(Wall {
        range_m,
        residual_m,
        bias_m: middle_m - centre_m,
        fill,
        sigma_px: residual_m * focal_px * baseline_m / centre_m.powi(2),
    })
}

struct Fit {
    residual_m: f64,
    centre_m: f64,
    fill: f64,
}

/// Fits the best plane through the middle of the image: `1 / z = a + b u + c v`.
fn fit(depth: &DepthImage, window: [f64; 2]) -> Option<Fit> {
    let w = depth.width();
    let h = depth.height();
    let [us, vs] = [(w, window[0]), (h, window[1])].map(|(side, half)| {
        let [from, to] = [0.5 - half, 0.5 + half].map(|part| (part * side as f64).round() as usize);
        from..to
    });
    let all = us.len() * vs.len();
    let mut points: Vec<(Vector3<f64>, f64)> = Vec::new();
    for (v, u) in vs.flat_map(|v| us.clone().map(move |u| (v, u))) {
        let z = depth.get(u as i64, v as i64).map_or(f64::NAN, f64::from);
        if z.is_finite() && z > 0.0 {
            let place = Vector3::new(1.0, u as f64 / w as f64 - 0.5, v as f64 / h as f64 - 0.5);
            points.push((place, z));
        }
    }
    // A plane is linear in the inverse depth, so the fit is a linear least-squares problem.
    let normal: Matrix3<f64> = points.iter().map(|(p, _)| p * p.transpose()).sum();
    let right: Vector3<f64> = points.iter().map(|(p, z)| p / *z).sum();
    let plane = normal.cholesky()?.solve(&right);
    let residuals: Vec<f64> = points.iter().map(|(p, z)| z - 1.0 / plane.dot(p)).collect();
    let fill = points.len() as f64 / all as f64;
    Some(Fit { residual_m: deviation(&residuals), centre_m: 1.0 / plane.x, fill })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tilted_plane_has_no_residual_and_holes_do_not_matter() {
        let depth = DepthImage::from_fn(40, 40, |x, y| match (x + y) % 4 {
            0 => f32::NAN,
            _ => 1.0 / (0.3 + 0.001 * (x as f32 - 20.0) - 0.002 * (y as f32 - 20.0)),
        });
        let fit = fit(&depth, [0.25, 0.2]).unwrap();
        assert!(fit.residual_m < 1e-5 && (fit.centre_m - 1.0 / 0.3).abs() < 1e-5);
        assert!((fit.fill - 0.75).abs() < 0.01);
        assert!(super::fit(&DepthImage::filled(40, 40, f32::NAN), [0.25, 0.2]).is_none());
    }
}
