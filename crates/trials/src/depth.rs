//! How well the depth of a head is known, against its range (P4: about 1 % at 3 m).

use tagalong_core::{DepthImage, Frame, Funnel, HEAD_RADIUS_M};
use tagalong_sim::{Scene, Truth};
use tagalong_stereo::{StereoDepth, StereoSettings};

use crate::{Draw, Drawn, TrialError};

/// Half the side of the patch around the centre of a head, m.
const PATCH_M: f64 = 0.06;
/// Readings farther from the truth than this are of something else, m.
const HEAD_M: f64 = 0.5;
/// Seen fraction of the upper body from which on somebody counts.
const VISIBLE: f64 = 0.9;

/// A head, and the median of the depth around its centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeadDepth {
    /// True depth of the centre of the head, m along the optical axis.
    pub truth_m: f64,
    /// Measured depth of the face and the radius of a head, m; `None` if most of
    /// the patch has no reading near the head.
    pub measured_m: Option<f64>,
}

impl HeadDepth {
    /// Measured less true, m.
    pub fn error_m(&self) -> Option<f64> {
        self.measured_m.map(|measured| measured - self.truth_m)
    }
}

/// Everybody who is well visible in a scene with a depth camera or a stereo pair,
/// frame by frame; the depth of a pair is found by `settings`. `threads` draw.
///
/// # Errors
/// [`TrialError::Config`] if the settings are wrong, or no depth comes of a frame.
pub fn head_depths(
    scene: &Scene,
    settings: &StereoSettings,
    threads: usize,
) -> Result<Vec<HeadDepth>, TrialError> {
    let wrong = |error: tagalong_core::Error| TrialError::Config(error.to_string());
    let mut stereo = StereoDepth::new(settings.clone()).map_err(wrong)?;
    let mut draw = Draw::new(scene, threads);
    let mut all = Vec::new();
    while let Some(Drawn { frame, truth, .. }) = draw.next_frame() {
        let frame = match frame.depth() {
            Ok(_) => frame,
            Err(_) => {
                let depth = stereo.depth(&frame, &mut Funnel::default()).map_err(wrong)?;
                frame.with_depth(depth)
            }
        };
        let depth = frame.depth().map_err(wrong)?;
        all.extend(truth.iter().filter_map(|person| head_depth(&frame, depth, person)));
    }
    Ok(all)
}

fn head_depth(frame: &Frame, depth: &DepthImage, person: &Truth) -> Option<HeadDepth> {
    let camera = &frame.camera;
    let truth_m = camera.depth_of(&person.head_in_robot);
    let centre = camera.project(&person.head_in_robot)?;
    let half = PATCH_M * camera.focal_px() / (truth_m - HEAD_RADIUS_M).max(0.1);
    let inside = |at: f64, size: usize| at - half >= 0.0 && at + half <= (size - 1) as f64;
    let seen = person.visible_fraction >= VISIBLE
        && inside(centre.x, depth.width())
        && inside(centre.y, depth.height());
    let span = |at: f64| (at - half).round() as i64..=(at + half).round() as i64;
    seen.then(|| {
        let pixels: Vec<Option<f32>> =
            span(centre.y).flat_map(|y| span(centre.x).map(move |x| depth.get(x, y))).collect();
        HeadDepth { truth_m, measured_m: median_near(&pixels, truth_m) }
    })
}

/// The median of the readings near the head, as the depth of its centre.
fn median_near(pixels: &[Option<f32>], truth_m: f64) -> Option<f64> {
    let centre = |z: &f32| f64::from(*z) + HEAD_RADIUS_M;
    let mut near: Vec<f64> = pixels.iter().flatten().map(centre).collect();
    near.retain(|z| (z - truth_m).abs() < HEAD_M);
    near.sort_by(f64::total_cmp);
    (2 * near.len() > pixels.len()).then(|| near[near.len() / 2])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_is_of_the_head() {
        let behind = vec![Some(6.0); 4];
        let head = vec![Some(2.88), Some(2.9), Some(2.93), Some(2.9), Some(2.91)];
        let measured = median_near(&[head.clone(), behind.clone()].concat(), 3.0);
        assert!((measured.unwrap() - (2.9 + HEAD_RADIUS_M)).abs() < 1e-6);
        assert_eq!(median_near(&[head, behind, vec![None]].concat(), 3.0), None);
    }

    #[test]
    fn a_drawn_head_has_its_depth() {
        let scene = "duration_s = 0.3\n[room]\nwallpaper = true\n[camera]\nkind = \"stereo\"\n\
            [robot]\nstart = [1.0, 4.0]\n[[people]]\npath = [[3.5, 4.0]]\nheading_deg = 180\n";
        let scene = Scene::parse(scene).unwrap();
        let found = head_depths(&scene, &StereoSettings::default(), 1).unwrap();
        assert!(found.len() >= 2, "{found:?}");
        assert!(
            found.iter().all(|head| head.error_m().is_some_and(|e| e.abs() < 0.25)),
            "{found:?}"
        );
        let wrong = StereoSettings { window: 2, ..StereoSettings::default() };
        assert!(head_depths(&scene, &wrong, 1).unwrap_err().to_string().contains("window"));
    }
}
