use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::{Detection, Frame, Track};
use tagalong_geometry::{Camera, FaceDepth, ImageBox, PointEstimate, Rect, UPPER_BODY_SIDE_M};

use crate::measured_body::{CUT_OFF_PX, MeasuredBody};

/// Minimum distance of probabilities from 0 and 1.
const SURE: f64 = 1e-3;

/// Minimum distance of a face from the camera, m; lower values are errors.
const NEAREST_M: f64 = 0.05;

/// Width of a person with the arms, m.
const PERSON_WIDTH_M: f64 = 0.63;

/// Part of the body that a box encloses, and the box that is tracked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum BoxedBody {
    /// The whole person, from head to feet; its upper-body square is tracked.
    Full,
    /// The whole person, and the box is tracked as it is. Its position is computed as for `full`.
    /// For data sets whose ground truth has whole bodies.
    FullBox,
    /// Head and shoulders, as a square, which is tracked.
    Upper,
}

/// Settings for turning boxes of people in the image into detections with a position.
///
/// A detector includes them in its own settings with `#[serde(flatten)]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct BoxSettings {
    /// Part of the body that a box encloses: `full`, the whole person, of which the upper-body
    /// square is tracked; `full-box`, the whole person, and the box is tracked as it is; `upper`,
    /// head and shoulders, as a square.
    pub body: BoxedBody,
    /// Locate the upper body in the box of a whole person from the floor, if the depth image does
    /// not show the trunk: the lower edge of the box is at the feet, and a person whose feet are
    /// cut off by the border of the image is as wide as the box. For cameras of known height and
    /// direction, especially those that look down.
    pub floor: bool,
    /// Assumed height, m, of a person whose whole body is in a box, or whose head is above the
    /// image.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub height_m: f64,
    /// Standard deviation of the position of a box, pixels.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub sigma_px: f64,
    /// Standard deviation of the depth of a face read from the depth image, m.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub sigma_depth_m: f64,
    /// Standard deviation of a distance that is computed from the size of the box alone, as a
    /// fraction of the distance.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub sigma_distance: f64,
    /// A search near a track accepts boxes of uncertain distance whose overlap with the expected
    /// box is at least this (IoU), and ...
    #[schemars(range(min = 0.0, max = 1.0))]
    pub near_overlap: f64,
    /// ... positions within this distance on the floor, m.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub near_m: f64,
}

impl Default for BoxSettings {
    fn default() -> Self {
        Self {
            body: BoxedBody::Full,
            floor: false,
            height_m: 1.7,
            sigma_px: 4.0,
            sigma_depth_m: 0.1,
            sigma_distance: 0.2,
            near_overlap: 0.3,
            near_m: 0.8,
        }
    }
}

impl BoxSettings {
    /// Returns the detection of the person in a box, with this score; `None` for a box outside of
    /// the image or without a distance.
    pub fn detection(
        &self,
        frame: &Frame,
        region: &Rect,
        score: f64,
        source: &'static str,
    ) -> Option<Detection> {
        let (upper_body, face) = self.person_in(frame, region);
        let PointEstimate { position, covariance } = self.locate(frame, &upper_body, face)?;
        let image = match self.body {
            BoxedBody::FullBox => ImageBox::full_body(*region),
            BoxedBody::Full | BoxedBody::Upper => ImageBox::upper_body(upper_body),
        };
        let detection = Detection::new(source, position, covariance, score).with_image(image);
        is_shown(&frame.camera, &detection).then_some(detection)
    }

    /// Returns the upper body of the person in a box, and the depth of the face if it is measured.
    /// With a depth image it uses the readings that are as near as the trunk, otherwise the box
    /// alone.
    fn person_in(&self, frame: &Frame, region: &Rect) -> (Rect, Option<f64>) {
        let depth = frame.depth().ok();
        let whole = depth.filter(|_| self.body != BoxedBody::Upper);
        let measured = whole
            .and_then(|depth| MeasuredBody::in_box(&frame.camera, depth, region, self.height_m));
        if let Some(MeasuredBody { upper_body, face_m }) = measured {
            return (upper_body, Some(face_m));
        }
        let upper_body = self.upper_body(&frame.camera, region);
        (upper_body, depth.and_then(|depth| depth.face_m(&upper_body)))
    }

    fn upper_body(&self, camera: &Camera, region: &Rect) -> Rect {
        match self.body {
            BoxedBody::Upper => *region,
            BoxedBody::Full | BoxedBody::FullBox if self.floor => self.above_floor(camera, region),
            BoxedBody::Full | BoxedBody::FullBox => region.upper_body_of_standing(self.height_m),
        }
    }

    /// Returns the upper body in the box of a whole person whose feet are on the floor.
    fn above_floor(&self, camera: &Camera, region: &Rect) -> Rect {
        if let Some(head) = camera.head_above_floor(region) {
            return camera.upper_body(&head);
        }
        let standing = region.upper_body_of_standing(self.height_m);
        if region.bottom() < camera.height as f64 - CUT_OFF_PX {
            return standing;
        }
        // The height of the box is that of a part of the person, so the scale follows from the
        // width.
        let by_width = region.width * self.height_m / PERSON_WIDTH_M;
        let whole = Rect { height: region.height.max(by_width), ..*region };
        whole.upper_body_of_standing(self.height_m)
    }

    /// Returns the head position for an upper-body square, from the measured depth of the face or
    /// otherwise from the size of the square.
    fn locate(
        &self,
        frame: &Frame,
        upper_body: &Rect,
        measured: Option<f64>,
    ) -> Option<PointEstimate> {
        let camera = &*frame.camera;
        let side_px = upper_body.width;
        let face = FaceDepth::by_size(camera, UPPER_BODY_SIDE_M, side_px, self.sigma_distance)
            .or_measured(measured, self.sigma_depth_m);
        let sane = face.depth_m.is_finite() && face.depth_m > NEAREST_M;
        sane.then(|| camera.locate_head(upper_body, face, self.sigma_px))
    }

    /// Returns the detections that may belong to a track, the best fit first, because a search near
    /// a track looks for one person.
    pub fn near(&self, track: &Track, found: Vec<Detection>) -> Vec<Detection> {
        let fits = found.into_iter().filter_map(|detection| {
            let fit = self.fit(track, &detection)?;
            Some((fit, detection))
        });
        let mut near: Vec<(f64, Detection)> = fits.collect();
        near.sort_by(|a, b| b.0.total_cmp(&a.0));
        near.into_iter().map(|(_, detection)| detection).collect()
    }

    /// Returns a score of the fit of a detection to a track; `None` if it is not near.
    fn fit(&self, track: &Track, detection: &Detection) -> Option<f64> {
        let overlap = detection.rect().map_or(0.0, |rect| track.estimate.region.iou(&rect));
        let away_m = (track.estimate.person.position.xy() - detection.position.xy()).norm();
        // A distance from size alone may be far off on the floor, so for such a box overlap is
        // enough.
        let guessed = detection.covariance.diagonal().xy().max() > 0.25 * self.near_m;
        let near = away_m <= self.near_m || guessed && overlap >= self.near_overlap;
        near.then_some(overlap - away_m)
    }
}

/// Returns true if part of the detection's box is in the image, and all its numbers are finite.
pub fn is_shown(camera: &Camera, detection: &Detection) -> bool {
    detection.rect().is_some_and(|rect| rect.clipped(camera.width, camera.height).area() > 0.0)
        && detection.is_sane()
}

/// Returns the log-odds of a probability; they are finite for 0 and 1 as well.
///
/// ```
/// use tagalong_vision::log_odds_of;
/// assert_eq!(log_odds_of(0.5), 0.0);
/// assert!(log_odds_of(1.0) > 6.9 && log_odds_of(0.0) < -6.9);
/// ```
pub fn log_odds_of(probability: f64) -> f64 {
    let sure = probability.clamp(SURE, 1.0 - SURE);
    (sure / (1.0 - sure)).ln()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::{Matrix3, Matrix5, Point3, Vector2};
    use tagalong_core::{DepthImage, EgoMotion, Estimate, Images, Person, Stamp, TrackId};
    use tagalong_geometry::{Distortion, Extent, HEAD_RADIUS_M, Pinhole};

    use super::*;

    fn camera() -> Camera {
        let lens =
            Pinhole { fx: 520.0, fy: 520.0, cx: 319.5, cy: 239.5, distortion: Distortion::None };
        Camera::mounted(lens, 640, 480, 1.4, 0.0, 0.0)
    }

    fn frame(depth_m: Option<f32>) -> Frame {
        let depth = depth_m.map(|metres| Arc::new(DepthImage::filled(640, 480, metres)));
        let images = Images { depth, ..Images::default() };
        Frame::new(1, Stamp::default(), Arc::new(camera()), EgoMotion::at_rest(0.1), images)
    }

    fn boxed(settings: &BoxSettings, region: &Rect, depth_m: Option<f32>) -> Option<Detection> {
        settings.detection(&frame(depth_m), region, 1.5, "test")
    }

    fn of_body(body: BoxedBody) -> BoxSettings {
        BoxSettings { body, ..BoxSettings::default() }
    }

    #[test]
    fn the_distance_is_that_of_the_face_otherwise_that_of_the_size() {
        let settings = of_body(BoxedBody::Upper);
        let square = camera().upper_body(&Point3::new(3.0, 0.4, 1.585));
        let face_m = 520.0 * UPPER_BODY_SIDE_M / square.width;
        for (depth_m, expected_m, sigma_m) in [
            (Some(2.0), 2.0, settings.sigma_depth_m),
            (None, face_m, settings.sigma_distance * face_m),
            (Some(f32::NAN), face_m, settings.sigma_distance * face_m),
        ] {
            let found = boxed(&settings, &square, depth_m).unwrap();
            let ahead_m = camera().depth_of(&found.position) - HEAD_RADIUS_M;
            assert!((ahead_m - expected_m).abs() < 1e-6, "{depth_m:?}: {ahead_m}");
            let sigma = found.covariance[(0, 0)].sqrt();
            assert!((sigma / sigma_m - 1.0).abs() < 0.02, "{depth_m:?}: {sigma}");
            let aside = settings.sigma_px / 520.0 * (expected_m + HEAD_RADIUS_M);
            let sigma = found.covariance[(2, 2)].sqrt();
            assert!((sigma / aside - 1.0).abs() < 0.05, "{depth_m:?}: {sigma}");
            assert_eq!((found.rect(), found.score, found.source), (Some(square), 1.5, "test"));
        }
        assert_eq!(boxed(&settings, &square, Some(0.04)), None, "before the lens");
        assert!(boxed(&settings, &square, Some(0.06)).is_some());
    }

    #[test]
    fn the_box_that_is_tracked_depends_on_the_part_of_the_body() {
        let region = Rect::new(300.0, 100.0, 60.0, 200.0);
        let upper = region.upper_body_of_standing(1.7);
        let [full, whole, half] = [BoxedBody::Full, BoxedBody::FullBox, BoxedBody::Upper]
            .map(|body| boxed(&of_body(body), &region, None).unwrap());
        assert_eq!(full.image, Some(ImageBox::upper_body(upper)));
        let image = whole.image.unwrap();
        assert_eq!((image.rect, image.extent), (region, Extent::FullBody));
        assert_eq!((full.position, full.covariance), (whole.position, whole.covariance));
        assert_eq!(half.rect(), Some(region));
        let child = BoxSettings { height_m: 1.1, ..BoxSettings::default() };
        let nearer = boxed(&child, &region, None).unwrap();
        assert!(nearer.position.x < 0.7 * full.position.x, "{}", nearer.position);
    }

    /// A camera that looks down shows people shorter, and people near it without feet.
    #[test]
    fn the_floor_tells_where_the_upper_body_is() {
        let lens =
            Pinhole { fx: 520.0, fy: 520.0, cx: 319.5, cy: 239.5, distortion: Distortion::None };
        let camera = Camera::mounted(lens, 640, 480, 2.3, 0.5, 0.0);
        let settings = BoxSettings { floor: true, ..BoxSettings::default() };
        let head = Point3::new(3.5, 0.2, 1.6);
        let square = camera.upper_body(&head);
        let whole = camera.whole_body(&square, &head);
        assert!(whole.bottom() < 470.0, "{whole:?}");
        let by_floor = settings.upper_body(&camera, &whole);
        let by_height = BoxSettings::default().upper_body(&camera, &whole);
        assert!(by_floor.iou(&square) > 0.85, "{by_floor:?} {square:?}");
        assert!(by_height.iou(&square) < by_floor.iou(&square), "{by_height:?}");
        let near = Point3::new(1.6, 0.0, 1.6);
        let square = camera.upper_body(&near);
        let whole = camera.whole_body(&camera.upper_body(&near), &near);
        let cut = whole.clipped(640, 480);
        assert!(whole.bottom() > 480.0, "{whole:?}");
        let by_width = settings.upper_body(&camera, &cut);
        assert!((by_width.width / square.width - 1.0).abs() < 0.1, "{by_width:?} {square:?}");
    }

    #[test]
    fn a_box_beside_the_image_is_not_shown() {
        let settings = BoxSettings::default();
        assert_eq!(boxed(&settings, &Rect::new(-60.0, 100.0, 50.0, 170.0), None), None);
        assert!(boxed(&settings, &Rect::new(-20.0, 100.0, 50.0, 170.0), None).is_some());
        assert_eq!(boxed(&settings, &Rect::new(f64::NAN, 100.0, 50.0, 170.0), None), None);
        let scanned = boxed(&settings, &Rect::new(300.0, 100.0, 50.0, 170.0), None).unwrap();
        let odd = scanned.with_score(f64::NAN);
        assert!(!is_shown(&camera(), &odd), "a number that is none");
    }

    fn at(x: f64, y: f64, sigma_m: f64) -> Detection {
        let position = Point3::new(x, y, 1.5);
        Detection::new("test", position, Matrix3::identity() * sigma_m * sigma_m, 1.0)
            .with_image(ImageBox::upper_body(camera().upper_body(&position)))
    }

    #[test]
    fn near_a_track_the_best_fit_comes_first() {
        let position = Point3::new(3.0, 0.0, 1.6);
        let estimate = Estimate::new(
            Person { position, velocity: Vector2::zeros() },
            Matrix5::identity() * 0.01,
            camera().upper_body(&Point3::new(3.0, 0.0, 1.5)),
        );
        let track = Track::new(TrackId(1), estimate, 2.0).with_age(3);
        for (found, near) in [
            // 0.8 m on the floor, whatever the height.
            ([at(3.79, 0.0, 0.1), at(3.81, 0.0, 0.1), at(3.6, 0.6, 0.1)], vec![3.79]),
            ([at(3.5, 0.0, 0.1), at(3.1, 0.0, 0.1), at(3.3, 0.0, 0.1)], vec![3.1, 3.3, 3.5]),
            // A variance above a quarter of 0.8 is that of a guess, for which the box is enough.
            ([at(4.0, 0.0, 0.44), at(4.0, 0.0, 0.45), at(4.0, 1.0, 0.45)], vec![4.0]),
        ] {
            let found = BoxSettings::default().near(&track, found.to_vec());
            let found: Vec<f64> = found.iter().map(|detection| detection.position.x).collect();
            assert_eq!(found, near);
        }
    }

    #[test]
    fn log_odds_are_finite() {
        assert!((log_odds_of(0.8) - 4.0_f64.ln()).abs() < 1e-12);
        assert!((log_odds_of(1.0) - 999.0_f64.ln()).abs() < 1e-9);
        assert_eq!(log_odds_of(7.0), log_odds_of(1.0));
    }
}
