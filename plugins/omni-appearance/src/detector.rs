use nalgebra::{Matrix3, Point3, Vector3};
use tagalong_config::Context;
use tagalong_core::{
    Capabilities, Detection, Detector, Error, Frame, Funnel, Input, Inputs, Query, Result, Track,
};
use tagalong_geometry::{Camera, HALF_HEAD_M, ImageBox};

use crate::{Blob, Config, Distance, Eyes, Geometry, Model, NAME, PanoramaGeometry};

/// Model that is compiled into the program.
const BUILT_IN: &str = include_str!("../models/omni-distance.toml");
/// Score of a person of usual height.
const SURE: f64 = 3.0;
/// Usual height of a head above the floor and its standard deviation, m, by which the score falls.
const STATURE: [f64; 2] = [1.6, 0.2];
/// Visible part of a person below which the distance is computed from the feet alone.
const WHOLE: f64 = 0.8;
/// Standard deviation of the middle of a person that is wholly hidden, m.
const HIDDEN_M: f64 = 0.25;
/// Radius of a search near a track, in standard deviations of the track.
const NEAR_SIGMAS: f64 = 3.0;

/// Detector of people in a panorama by their difference from the background.
pub struct OmniAppearance {
    config: Config,
    model: Model,
    eyes: Eyes,
}

impl OmniAppearance {
    /// Creates a detector and reads its model.
    ///
    /// # Errors
    /// [`Error::Model`] for a file that cannot be read or is not a model, or for a person that is
    /// not in it; [`Error::Settings`] for settings outside their ranges.
    pub fn new(config: Config, context: &Context) -> Result<Self> {
        let model = context.model(&config.model, BUILT_IN, Model::from_text)?;
        let known = ["general", "nearest"].contains(&config.person.as_str())
            || model.people.iter().any(|person| person.name == config.person);
        if !known {
            let names: Vec<&str> = model.people.iter().map(|p| p.name.as_str()).collect();
            let why = format!("it does not know `{}`, only {names:?}", config.person);
            return Err(Error::Model { path: config.model, why });
        }
        Ok(Self { eyes: Eyes::new(config.clone())?, config, model })
    }

    /// Returns the model in use.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Returns the detection of a blob: its position by distance and bearing.
    fn placed(&self, blob: &Blob, camera: &Camera, view: &PanoramaGeometry<'_>) -> Detection {
        // Width and area of a visible part do not give the distance of the whole; the feet do.
        let how = if blob.visible < WHOLE { Distance::Analytic } else { self.config.distance };
        let head = self.model.head(&self.config.person, blob, view, how);
        let (distance, sigma) = head.distance(&blob.features, view, how);
        // The regressions may extrapolate far beyond the distances they were fitted to.
        let distance = distance.clamp(0.3, 30.0);
        let bearing = view.panorama.bearing(blob.column);
        let (sine, cosine) = bearing.sin_cos();
        let flat = Point3::new(distance * sine, -distance * cosine, 0.0);
        let mut position = camera.robot_from_camera * flat;
        let [low, high] = self.config.head_height_m;
        let top = view.top_m(&blob.features, distance);
        // Outside the accepted heights the exact value does not matter: the detection is
        // dropped.
        position.z = (top - HALF_HEAD_M).clamp(low - 0.5, high + 0.5);
        Detection::new(
            NAME,
            position,
            self.covariance(&position, camera, [distance, sigma], blob.visible),
            self.score(position.z),
        )
        .with_image(ImageBox::upper_body(camera.upper_body(&position)))
    }

    /// Returns the covariance in polar form: that of the distance along the ray; across it the sum
    /// of those of the bearing, of the body about its middle, and of its hidden part.
    fn covariance(
        &self,
        position: &Point3<f64>,
        camera: &Camera,
        [distance, sigma]: [f64; 2],
        visible: f64,
    ) -> Matrix3<f64> {
        let from = camera.robot_from_camera.translation.vector;
        let out = Vector3::new(position.x - from.x, position.y - from.y, 0.0);
        let out = out.try_normalize(1e-9).unwrap_or_else(Vector3::x);
        let aside = Vector3::new(-out.y, out.x, 0.0);
        let bearing = distance * self.config.sigma_bearing_deg.to_radians();
        let across = [bearing, self.config.sigma_aside_m, HIDDEN_M * (1.0 - visible)];
        let across = across.iter().map(|sigma| sigma * sigma).sum::<f64>().max(1e-6);
        out * out.transpose() * (sigma * sigma)
            + aside * aside.transpose() * across
            + Vector3::z() * Vector3::z().transpose() * self.config.sigma_height_m.powi(2)
    }

    fn score(&self, height_m: f64) -> f64 {
        let [usual, sigma] = STATURE;
        let off = (height_m - usual) / sigma;
        (SURE - 0.5 * off * off).max(-SURE)
    }

    fn check_camera(&self, view: &PanoramaGeometry<'_>) -> Result<()> {
        if self.model.geometry.is_like(&Geometry::of(view))
            || self.config.distance == Distance::Analytic
        {
            return Ok(());
        }
        let why = format!(
            "it was fitted for another camera ({:?}) than this one ({:?}); train one for this \
             camera, or set distance = \"analytic\"",
            self.model.geometry,
            Geometry::of(view)
        );
        Err(Error::Model { path: self.config.model.clone(), why })
    }
}

impl Detector for OmniAppearance {
    fn capabilities(&self) -> Capabilities {
        Capabilities::new(Inputs::NONE.require(Input::Colour)).discovering().tracking()
    }

    fn detect(
        &mut self,
        frame: &Frame,
        query: &Query<'_>,
        funnel: &mut Funnel,
    ) -> Result<Vec<Detection>> {
        let blobs = self.eyes.look(frame, funnel)?;
        let Some(view) = PanoramaGeometry::of(&frame.camera).filter(|_| !blobs.is_empty()) else {
            return Ok(Vec::new());
        };
        self.check_camera(&view)?;
        let [low, high] = self.config.head_height_m;
        let mut found = Vec::new();
        for blob in &blobs {
            let person = self.placed(blob, &frame.camera, &view);
            if !(low..=high).contains(&person.position.z) {
                funnel.drop_detection("head height", &person);
            } else if !fits(query, &person) {
                funnel.drop_detection("not near the track", &person);
            } else {
                found.push(person);
            }
        }
        Ok(found)
    }

    fn learn(&mut self, frame: &Frame, tracks: &[Track]) -> Result<()> {
        self.eyes.adapt(frame, tracks)
    }
}

/// Returns true if a detection lies within the region of a query.
fn fits(query: &Query<'_>, person: &Detection) -> bool {
    match query {
        Query::Discover { .. } => true,
        Query::Track(track) => {
            let off = (person.position - track.estimate.person.position).xy();
            let spread = track.estimate.covariance.fixed_view::<2, 2>(0, 0).trace();
            off.norm() <= NEAR_SIGMAS * (0.5 * spread).sqrt() + 0.3
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix2, SMatrix, Vector2};
    use tagalong_conformance::context;
    use tagalong_core::{Estimate, Person, TrackId};
    use tagalong_geometry::{ConicalMirror, Lens, Panorama, Rect};

    use super::*;

    fn detector() -> OmniAppearance {
        let config = Config {
            sigma_bearing_deg: 1.0,
            sigma_aside_m: 0.03,
            sigma_height_m: 0.2,
            ..Config::default()
        };
        OmniAppearance::new(config, &context()).unwrap()
    }

    /// A camera 0.3 m ahead of the middle of the robot.
    fn camera() -> Camera {
        let d =
            [67.5_f64.to_radians(), 0.05, 2.0_f64.to_radians().tan(), 53.0_f64.to_radians().tan()];
        let mirror = ConicalMirror::new(1.0, [0.0; 2], d).unwrap();
        let panorama = Panorama { mirror, columns: 480, rows: 120 };
        let mut robot_from_camera = ConicalMirror::upright(1.5);
        robot_from_camera.translation.vector.x = 0.3;
        let lens = Lens::Panorama(panorama);
        Camera { lens, width: 480, height: 120, robot_from_camera }
    }

    #[test]
    fn a_place_is_known_along_the_ray_by_the_distance_and_across_it_by_the_bearing() {
        fn spread(visible: f64) -> (f64, f64) {
            let at = Point3::new(0.3 + 1.8, -2.4, 1.6);
            let c = detector().covariance(&at, &camera(), [3.0, 0.25], visible);
            let out = Vector3::new(0.6, -0.8, 0.0);
            let aside = Vector3::new(0.8, 0.6, 0.0);
            assert!(out.dot(&(c * aside)).abs() < 1e-12);
            assert!((c[(2, 2)] - 0.04).abs() < 1e-12 && c[(0, 2)].abs() + c[(1, 2)].abs() < 1e-12);
            (out.dot(&(c * out)), aside.dot(&(c * aside)))
        }

        let bearing = 3.0 * 1.0_f64.to_radians();
        let across = bearing * bearing + 0.03 * 0.03;
        let (along, whole) = spread(1.0);
        assert!((along - 0.0625).abs() < 1e-12 && (whole - across).abs() < 1e-12);
        let hidden = across + 0.25_f64.powi(2) * 0.3 * 0.3;
        assert!((spread(0.7).1 - hidden).abs() < 1e-12);
    }

    #[test]
    fn an_ordinary_stature_is_surer_than_an_odd_one() {
        let detector = detector();
        assert_eq!(detector.score(1.6), 3.0);
        assert!((detector.score(1.8) - 2.5).abs() < 1e-9);
        assert!((detector.score(1.3) - (3.0 - 0.5 * 2.25)).abs() < 1e-9);
        assert_eq!(detector.score(9.0), -3.0);
    }

    #[test]
    fn a_search_near_a_track_ends_at_three_deviations_and_some() {
        let spread = Matrix2::new(0.05, 0.01, 0.01, 0.03);
        let mut covariance = SMatrix::<f64, 5, 5>::zeros();
        covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&spread);
        let person = Person { position: Point3::new(2.0, 1.0, 1.6), velocity: Vector2::zeros() };
        let track = Track::new(TrackId(1), Estimate::new(person, covariance, Rect::default()), 1.0)
            .with_age(3);
        let reach = 3.0 * 0.2 + 0.3;
        for way in [Vector2::new(0.6, 0.8), Vector2::new(-0.6, 0.8)] {
            for (off_m, is_near) in [(reach - 1e-6, true), (reach + 1e-6, false)] {
                let position = Point3::new(2.0 + off_m * way.x, 1.0 + off_m * way.y, 0.2);
                let person = Detection::new("test", position, Matrix3::identity(), 0.0)
                    .with_image(ImageBox::upper_body(Rect::default()));
                assert_eq!(fits(&Query::Track(&track), &person), is_near, "{off_m} {way}");
            }
        }
    }
}
