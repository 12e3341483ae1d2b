//! Printed results, and the table of positions.

use std::fmt::Write as _;

use crate::triangulate::{Calibrated, Cameras, Fix, Known};
use serde::Serialize;
use tagalong_app::format::Format;
use tagalong_app::outcome::Failure;
use tagalong_app::serialize::to_json;
use tagalong_core::Stamp;

/// Camera as it was calibrated.
#[derive(Serialize)]
struct CameraFound {
    at_m: [f64; 2],
    heading_deg: f64,
    pitch_down_deg: f64,
    focal_px: f64,
    /// Number of known places that it saw.
    places: usize,
    /// Root mean square of the misfits of its bearings.
    misfit_deg: f64,
}

/// Distances of measured places from known ones.
#[derive(Serialize)]
struct Distance {
    mean_cm: f64,
    max_cm: f64,
    places: usize,
}

/// Result of `tagalong-papers triangulate`.
#[derive(Serialize)]
pub(super) struct TriangulationResult {
    cameras: Vec<CameraFound>,
    as_guessed: Distance,
    calibrated: Distance,
    held_out: Distance,
    /// Number of moments with a measured place.
    measured: usize,
    /// Number of the robot's images with written truth.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) truth_frames: Option<usize>,
}

impl TriangulationResult {
    /// Compares the cameras as guessed and as calibrated, at the places used for that and at those
    /// held out.
    pub(super) fn new(
        calibrated: &Calibrated,
        [guess, cameras]: [&Cameras; 2],
        [used, held]: [&[Known]; 2],
        measured: usize,
    ) -> Self {
        let rows = calibrated.stations.iter().zip(&calibrated.places).zip(&calibrated.misfit_rad);
        let found = rows.map(|((station, places), misfit)| CameraFound {
            at_m: station.at.coords.into(),
            heading_deg: station.heading_rad.to_degrees(),
            pitch_down_deg: station.pitch_down_rad.to_degrees(),
            focal_px: station.focal_px,
            places: *places,
            misfit_deg: misfit.to_degrees(),
        });
        Self {
            cameras: found.collect(),
            as_guessed: Distance::of(guess, used),
            calibrated: Distance::of(cameras, used),
            held_out: Distance::of(cameras, held),
            measured,
            truth_frames: None,
        }
    }

    /// Formats the result.
    pub(super) fn show(&self, format: Format) -> Result<String, Failure> {
        Ok(match format {
            Format::Text => self.text(),
            Format::Json => to_json("the positions", self)?,
        })
    }

    fn text(&self) -> String {
        let mut out =
            String::from("camera      x m      y m  heading  pitch  focal px  places  misfit\n");
        for (number, c) in self.cameras.iter().enumerate() {
            let _ = writeln!(
                out,
                "{:>6} {:>8.3} {:>8.3} {:>8.2} {:>6.2} {:>9.1} {:>7} {:>6.2}\u{b0}",
                number + 1,
                c.at_m[0],
                c.at_m[1],
                c.heading_deg,
                c.pitch_down_deg,
                c.focal_px,
                c.places,
                c.misfit_deg,
            );
        }
        let rows = [
            ("mean distance from known places, as guessed", &self.as_guessed),
            ("  calibrated with them", &self.calibrated),
            ("  held out", &self.held_out),
        ];
        for (what, d) in rows {
            let _ = writeln!(
                out,
                "{what}: {:.1} cm at {} places, at most {:.1} cm",
                d.mean_cm, d.places, d.max_cm
            );
        }
        let _ = writeln!(out, "places measured: {}", self.measured);
        if let Some(frames) = self.truth_frames {
            let _ = writeln!(out, "images of the robot whose truth is known: {frames}");
        }
        out
    }
}

impl Distance {
    fn of(cameras: &Cameras, known: &[Known]) -> Self {
        let cm: Vec<f64> = cameras.distances_m(known).iter().map(|m| 100.0 * m).collect();
        Self {
            mean_cm: cm.iter().sum::<f64>() / cm.len().max(1) as f64,
            max_cm: cm.iter().copied().fold(0.0, f64::max),
            places: cm.len(),
        }
    }
}

/// Returns all places, as CSV.
pub(super) fn csv(fixes: &[(Stamp, Fix)]) -> String {
    let mut out = String::from("stamp_ns,x_m,y_m,sigma_m,cameras,misfit_deg\n");
    for (stamp, fix) in fixes {
        let _ = writeln!(
            out,
            "{},{:.4},{:.4},{:.4},{},{:.3}",
            stamp.nanos(),
            fix.place.x,
            fix.place.y,
            fix.sigma_m(),
            fix.cameras,
            fix.misfit_rad.to_degrees(),
        );
    }
    out
}
