//! `depth-template-as-printed`: the silhouettes of P3, section II-C, and P4, section II, compared as
//! printed.
//!
//! P4 sums the squared differences of depth over the window against one background, so that a wall
//! behind a person costs more than the person fits. P3 divides the root of that sum by the size of
//! the window, so that a scene is less unlikely the more pixels its window has.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_config::{Registry, check_settings};
use tagalong_core::{Result, settings};
use tagalong_depth_template::{DepthTemplate, DepthTemplateConfig};

use super::dissimilarity::PrintedComparison;
use super::scene_likelihood::{PrintedLikelihood, Settings};

/// Weighing of imagined scenes (role `weigh`).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Weighing {
    /// Corrected: a log-likelihood ratio against a scene without people.
    Ratio,
    /// As P3 prints it: the size of the window stands outside of the root.
    Printed,
    /// With the size inside of the root: the error of a pixel, m.
    Rms,
}

settings! {
    /// Settings of the detector `depth-template-as-printed`, beside those of `depth-template`.
    pub struct Config {
        /// As P4 prints it: the plain sum of the squared differences of depth over the window,
        /// against the depth of the face and one background depth (`background_percentile` of the
        /// frame), m². `cost` is not asked then, and all costs are in m².
        pub dissimilarity: bool = false,
        /// Weighing of imagined scenes.
        pub weighing: Weighing = Weighing::Printed,
        /// Standard deviation of the dissimilarity of a scene that is as imagined, for the
        /// weighings `printed` and `rms`, m. P3 sets it "experientially".
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub likelihood_sigma: f64 = 0.005,
        /// For the weighings `printed` and `rms`: all scenes are compared in one window, the whole
        /// image, and not each in the window around its people. P3 does not say which window it
        /// takes.
        pub whole_image: bool = false,
        /// Settings of `depth-template`.
        #[serde(flatten)]
        pub base: DepthTemplateConfig,
    }
}

/// Builds the detector.
///
/// # Errors
/// Settings outside their ranges.
pub fn detector(config: Config) -> Result<DepthTemplate> {
    check_settings(&config)?;
    let Config { dissimilarity, weighing, likelihood_sigma, whole_image, base } = config;
    let background_percentile = base.background_percentile;
    let min_foreground_valid = base.min_foreground_valid;
    let mut detector = DepthTemplate::new(base)?;
    if dissimilarity {
        let comparison = PrintedComparison { background_percentile, min_foreground_valid };
        detector = detector.with_comparison(Box::new(comparison));
    }
    if weighing != Weighing::Ratio {
        let is_rms = weighing == Weighing::Rms;
        let sigma_m = likelihood_sigma;
        let settings = Settings { sigma_m, background_percentile, is_rms, whole_image };
        detector = detector.with_likelihood(Box::new(PrintedLikelihood::new(settings)));
    }
    Ok(detector)
}

/// Registers the detector.
pub fn register(registry: &mut Registry) {
    registry.detector(
        "depth-template-as-printed",
        "head-and-shoulder silhouettes in depth images, compared as P3 and P4 print it",
        |config: Config, _| detector(config),
    );
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::{Point2, Point3};
    use tagalong_core::{
        DepthImage, Detection, Detector as _, EgoMotion, Frame, Funnel, Images, Query, Stamp,
    };
    use tagalong_depth_template::render;
    use tagalong_geometry::{Camera, Pinhole};

    use super::*;

    const CAMERA_HEIGHT_M: f64 = 1.2;
    const HEAD: Point3<f64> = Point3::new(2.5, 0.0, 1.6);

    /// A person on a floor in front of a wall.
    fn frame() -> Frame {
        let f = 0.83 * 640.0;
        let camera = Arc::new(Camera::mounted(
            Pinhole::centred(f, 640, 480),
            640,
            480,
            CAMERA_HEIGHT_M,
            0.0,
            0.0,
        ));
        let body = render(std::f64::consts::PI, 0.0);
        let depth = DepthImage::from_fn(640, 480, |u, v| {
            let ray = camera.ray(Point2::new(u as f64, v as f64));
            let floor = if ray.y > 0.0 { CAMERA_HEIGHT_M / ray.y } else { f64::INFINITY };
            let right = ray.x * HEAD.x + HEAD.y;
            let down = ray.y * HEAD.x - (CAMERA_HEIGHT_M - HEAD.z);
            let behind = body.at(right, down.min(0.45));
            let person = if behind.is_finite() { HEAD.x + behind } else { f64::INFINITY };
            4.5_f64.min(floor).min(person) as f32
        });
        let images = Images { depth: Some(Arc::new(depth)), ..Images::default() };
        Frame::new(1, Stamp::from_nanos(1), camera, EgoMotion::at_rest(0.1), images)
    }

    fn discover(config: Config) -> (Vec<Detection>, Funnel) {
        let mut funnel = Funnel::default();
        let mut detector = detector(config).unwrap();
        let query = Query::Discover { occupied: &[] };
        let found = detector.detect(&frame(), &query, &mut funnel).unwrap();
        (found, funnel)
    }

    /// Thresholds in m².
    fn printed(background_percentile: f64) -> Config {
        let base = DepthTemplateConfig {
            background_percentile,
            discover_cost: 2000.0,
            even_cost: 2400.0,
            follow_cost: 3200.0,
            refine_cost: 4000.0,
            score_per_cost: 0.002,
            ..Default::default()
        };
        Config { dissimilarity: true, base, ..Config::default() }
    }

    #[test]
    fn it_finds_people_in_front_of_the_one_background_alone() {
        let (found, funnel) = discover(printed(90.0));
        assert_eq!(found.len(), 1, "{funnel:?}");
        assert!((found[0].position - HEAD).norm() < 0.12);
        let score = found[0].score;
        assert!(score > 0.8 && score <= 4.8, "0 m² is worth 0.002 * 2400: {score}");
        // The nearest depths of all, those of the floor, are nowhere behind the person.
        let (found, funnel) = discover(printed(2.0));
        let misfits = funnel.count("not refined") + funnel.count("template cost");
        assert!(found.is_empty() && misfits > 0, "{funnel:?}");
        let (found, _) = discover(Config { dissimilarity: false, ..Config::default() });
        assert_eq!(found.len(), 1, "by the corrected comparison");
    }

    #[test]
    fn its_settings_stand_beside_those_of_the_detector_and_others_are_refused() {
        let parse = toml::from_str::<Config>;
        let config = parse("weighing = 'rms'\nlikelihood_sigma = 0.3\nmin_cells = 3").unwrap();
        let base = DepthTemplateConfig { min_cells: 3, ..Default::default() };
        let weighing = Weighing::Rms;
        assert_eq!(config, Config { weighing, likelihood_sigma: 0.3, base, ..Config::default() });
        let error = parse("min_cell = 3").unwrap_err().to_string();
        assert!(error.contains("min_cell"), "{error}");
        assert!(detector(Config { likelihood_sigma: 0.0, ..Config::default() }).is_err());
    }
}
