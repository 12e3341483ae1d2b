//! Edges of people in depth against their true places. Structured light frays them, stereo matching
//! with windows fattens them.

use tagalong_core::DepthImage;
use tagalong_geometry::Rect;
use tagalong_trials::{SimulatedFrame, TrialError};

use super::{Check, depth, deviation, scene, simulated};
use crate::draws::mean;

/// Camera, and the limits of its check.
pub struct Rig {
    group: &'static str,
    /// `[camera]` of the scene.
    camera: &'static str,
    /// Least and greatest mean displacement, outwards positive, pixels.
    mean_px: [f64; 2],
}

/// Structured light.
pub const RGBD: Rig = Rig {
    group: "silhouettes in depth (RGB-D camera)",
    camera: "kind = \"rgbd\"",
    mean_px: [-2.0, 2.0],
};

/// Matched pair: near objects grow by half of the matcher's window.
pub const STEREO: Rig = Rig {
    group: "silhouettes in depth (stereo pair)",
    camera: "kind = \"stereo\"",
    mean_px: [0.0, 5.0],
};

/// Distance from the trunk within which depth is the person's, m.
const BODY_M: f32 = 0.4;
/// Largest distance outside of the true edge at which the measured one is searched for, pixels.
const REACH_PX: i64 = 12;
/// Last bin of the histogram of displacements, which runs from its negative, pixels.
const BINS: i64 = 3;

pub fn checks(rig: &Rig, seeds: u64) -> Result<Vec<Check>, TrialError> {
    let Rig { group, camera, mean_px } = *rig;
    let mut offsets = Vec::new();
    // A few seeds at least: one standing person has only three edges per image.
    for seed in 1..=seeds.max(4) {
        let standing = format!(
            "seed = {seed}\nduration_s = 0.25\n[room]\nsize_m = [9.0, 6.0]\n\
             [faults]\ndropped = 0.0\nlate = 0.0\n[camera]\n{camera}\nmount_error_deg = 0.0\n\
             [[people]]\npath = [[{}, 3.0]]\nheading_deg = {}\n",
            3.3 + 0.2 * (seed % 9) as f64,
            40 * seed % 360
        );
        simulated(&scene(&standing))
            .for_each(|simulated| offsets.extend(displacements(&simulated)));
    }
    let mut checks = Vec::new();
    for bin in -BINS..=BINS {
        let there = offsets.iter().filter(|o| (o.round() as i64).clamp(-BINS, BINS) == bin).count();
        let percent = 100.0 * there as f64 / offsets.len().max(1) as f64;
        checks.push(Check::told(group, format!("edges displaced by {}", name(bin)), percent, "%"));
    }
    let centre = mean(&offsets);
    checks.push(Check::between(group, "mean, outwards positive", centre, "px", mean_px));
    let spread = deviation(&offsets);
    checks.push(Check::between(group, "standard deviation", spread, "px", [0.3, 4.0]));
    Ok(checks)
}

fn name(bin: i64) -> String {
    match bin.abs() {
        BINS if bin < 0 => format!("{bin:+} px or further in"),
        BINS => format!("{bin:+} px or further out"),
        _ => format!("{bin:+} px"),
    }
}

/// Returns the displacements of the left, right and upper edge of every wholly visible person.
fn displacements(simulated: &SimulatedFrame) -> Vec<f64> {
    let Some(depth) = depth(&simulated.frame) else { return Vec::new() };
    let displacements = simulated.truth.iter().filter_map(|person| {
        let whole = person.upper_body?;
        let seen = person.visible?;
        let trunk = simulated.frame.camera.depth_of(&person.torso_in_robot) as f32;
        let measured = extent(depth, &seen, trunk)?;
        // An edge of the square is no edge of the person.
        let free = [
            (seen.x > whole.x + 1.0).then_some(seen.x - measured.x),
            (seen.right() < whole.right() - 1.0).then_some(measured.right() - seen.right()),
            (seen.y > whole.y + 1.0).then_some(seen.y - measured.y),
        ];
        (person.visible_fraction > 0.95).then_some(free)
    });
    displacements.flatten().flatten().collect()
}

/// Returns the bounds of the pixels that are as far away as the trunk.
fn extent(depth: &DepthImage, seen: &Rect, trunk_m: f32) -> Option<Rect> {
    let left = seen.x as i64 - REACH_PX;
    let right = seen.right() as i64 + REACH_PX;
    let top = seen.y as i64 - REACH_PX;
    let bottom = seen.bottom() as i64;
    let body = (top..bottom).flat_map(|y| (left..right).map(move |x| (x, y)));
    let body: Vec<(i64, i64)> = body
        .filter(|(x, y)| depth.get(*x, *y).is_some_and(|z| (z - trunk_m).abs() < BODY_M))
        .collect();
    let x = body.iter().map(|(x, _)| *x).min()? as f64;
    let last = body.iter().map(|(x, _)| *x).max()? as f64;
    let y = body.iter().map(|(_, y)| *y).min()? as f64;
    Some(Rect::new(x, y, last + 1.0 - x, bottom as f64 - y))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_extent_is_that_of_the_body() {
        let depth =
            DepthImage::from_fn(
                60,
                60,
                |x, y| {
                    if (20..30).contains(&x) && y >= 25 { 3.1 } else { 6.0 }
                },
            );
        let extent = extent(&depth, &Rect::new(21.0, 24.0, 10.0, 20.0), 3.0).unwrap();
        assert_eq!((extent.x, extent.right(), extent.y), (20.0, 30.0, 25.0));
    }
}
