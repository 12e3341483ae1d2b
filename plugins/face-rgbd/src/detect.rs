use nalgebra::Point2;
use tagalong_config::Context;
use tagalong_core::{
    Capabilities, DepthImage, Detection, Detector, Frame, Funnel, Input, Inputs, Query, Result,
};
use tagalong_geometry::{Camera, FaceDepth, ImageBox, PointEstimate, Rect};

use crate::{Cascade, Config, Group, Grouping, Hit, NAME, Proposals, Scanner, scales, whole};

/// Cascade that is compiled into the program.
const BUILT_IN: &str = include_str!("../models/cascade.xml");

/// Detector of people by their faces.
pub struct FaceRgbd {
    config: Config,
    cascade: Cascade,
    /// Log-odds of a group as a straight line in the logarithm of its strength.
    line: (f64, f64),
    scanner: Scanner,
    proposals: Proposals,
    hits: Vec<Hit>,
    grouping: Grouping,
}

impl FaceRgbd {
    /// Creates a detector and reads its cascade.
    ///
    /// # Errors
    /// [`tagalong_core::Error::Model`] for a file that cannot be read or is not a cascade,
    /// [`tagalong_core::Error::Settings`] for settings outside their ranges.
    pub fn new(config: Config, context: &Context) -> Result<Self> {
        config.check()?;
        let cascade = context.model(&config.model, BUILT_IN, Cascade::from_xml)?;
        Ok(Self {
            config,
            line: cascade.calibration.unwrap_or((1.0, 0.0)),
            cascade,
            scanner: Scanner::default(),
            proposals: Proposals::default(),
            hits: Vec::new(),
            grouping: Grouping::default(),
        })
    }

    /// Collects the windows of all sizes that pass the cascade.
    fn search(&mut self, frame: &Frame, near: Option<Rect>, funnel: &mut Funnel) -> Result<()> {
        let Self { config, cascade, scanner, proposals, hits, .. } = self;
        let camera = &*frame.camera;
        let depth = frame.depth().ok().filter(|_| config.depth_proposals);
        let image = frame.grey()?;
        if let Some(depth) = depth {
            let [points, possible, searched] = proposals.sample(frame, depth, config);
            funnel.drop_many("point: depth and height", points - possible);
            funnel.drop_many("point: less like skin", possible - searched);
        }
        let most = config.max_side * image.width().min(image.height()) as f64;
        let before = scanner.looked_at();
        let everywhere = [near.unwrap_or(whole(image))];
        hits.clear();
        for scale in scales(cascade, config.min_side_px, most, config.scale_step) {
            if depth.is_some() {
                proposals.for_side(camera, scale * cascade.width as f64, config);
            }
            let areas = if depth.is_some() { proposals.areas() } else { &everywhere };
            scanner.scan_within(
                image,
                cascade,
                scale,
                areas,
                |window| {
                    near.is_none_or(|upper_body| upper_body.contains(window.centre()))
                        && (depth.is_none() || proposals.allows(window))
                },
                hits,
            );
        }
        let looked_at = scanner.looked_at() - before;
        funnel.drop_many("window: no face", looked_at - hits.len() as u64);
        Ok(())
    }

    /// Returns the detection of the person with the face that the windows show.
    fn detection(
        &self,
        camera: &Camera,
        depth: Option<&DepthImage>,
        group: &Group,
    ) -> Option<Detection> {
        let config = &self.config;
        let side = group.region.width;
        let measured = depth.and_then(|depth| depth.surface_m(&group.region));
        let face = FaceDepth::by_size(camera, config.face_m, side, config.sigma_distance)
            .or_measured(measured, config.sigma_depth_m);
        let centre = group.region.centre();
        let head_px = Point2::new(centre.x, centre.y - config.head_above * side);
        // The depth is that of the face's surface, and the position that of the head's centre.
        let PointEstimate { position, covariance } =
            camera.locate(head_px, face.head_m(), config.sigma_place * side, face.sigma_m);
        let (slope, offset) = self.line;
        // The logarithm needs a positive strength.
        let score = (slope * group.strength.max(1e-3).ln() + offset).min(config.max_score);
        let detection = Detection::new(NAME, position, covariance, score)
            .with_image(ImageBox::upper_body(camera.upper_body(&position)));
        detection.is_sane().then_some(detection)
    }
}

impl Detector for FaceRgbd {
    fn capabilities(&self) -> Capabilities {
        Capabilities::new(Inputs::NONE.require(Input::Colour).accept(Input::Depth))
            .discovering()
            .tracking()
    }

    fn detect(
        &mut self,
        frame: &Frame,
        query: &Query<'_>,
        funnel: &mut Funnel,
    ) -> Result<Vec<Detection>> {
        let near = match query {
            Query::Track(track) => Some(track.estimate.region),
            Query::Discover { .. } => None,
        };
        self.search(frame, near, funnel)?;
        self.grouping.group(&self.hits, self.config.min_neighbours);
        let depth = frame.depth().ok();
        let mut found: Vec<Detection> = self
            .grouping
            .kept()
            .iter()
            .filter_map(|group| self.detection(&frame.camera, depth, group))
            .collect();
        let all = found.len();
        found.retain(|detection| detection.score >= self.config.min_score);
        funnel.drop_many("face: log-odds", (all - found.len()) as u64);
        found.sort_by(|a, b| b.score.total_cmp(&a.score));
        if near.is_some() {
            found.truncate(1);
        }
        Ok(found)
    }

    fn remembers(&self) -> bool {
        false
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::{Point3, SMatrix, Vector2};
    use tagalong_core::{EgoMotion, Estimate, Images, Person, Stamp, Track, TrackId};
    use tagalong_geometry::{HEAD_RADIUS_M, Pinhole};

    use super::*;
    use crate::tests::{noise, small};

    const FOCAL_PX: f64 = 262.0;

    fn camera() -> Camera {
        Camera::mounted(Pinhole::centred(FOCAL_PX, 160, 120), 160, 120, 1.5, 0.0, 0.0)
    }

    /// A detector with a cascade that passes some of the noise.
    fn detector(config: Config) -> FaceRgbd {
        let cascade = small();
        FaceRgbd {
            config,
            line: cascade.calibration.unwrap(),
            cascade,
            scanner: Scanner::default(),
            proposals: Proposals::default(),
            hits: Vec::new(),
            grouping: Grouping::default(),
        }
    }

    fn frame(depth_m: Option<f32>) -> Frame {
        let images = Images {
            grey: Some(Arc::new(noise(160, 120, 5))),
            depth: depth_m.map(|metres| Arc::new(DepthImage::filled(160, 120, metres))),
            ..Images::default()
        };
        Frame::new(1, Stamp::default(), Arc::new(camera()), EgoMotion::at_rest(0.1), images)
    }

    fn track(region: Rect) -> Track {
        let person = Person { position: Point3::new(2.0, 0.0, 1.5), velocity: Vector2::zeros() };
        Track::new(TrackId(1), Estimate::new(person, SMatrix::identity(), region), 1.0).with_age(9)
    }

    /// Thresholds that are low enough for noise.
    fn eager() -> Config {
        Config { min_score: -99.0, min_side_px: 12.0, max_side: 0.3, ..Config::default() }
    }

    fn detect(
        detector: &mut FaceRgbd,
        frame: &Frame,
        query: &Query<'_>,
    ) -> (Vec<Detection>, Funnel) {
        let mut funnel = Funnel::default();
        (detector.detect(frame, query, &mut funnel).unwrap(), funnel)
    }

    const EVERYWHERE: Query<'_> = Query::Discover { occupied: &[] };

    #[test]
    fn a_face_is_as_far_away_as_depth_says_else_as_its_size_does() {
        let detector = detector(Config::default());
        let config = &detector.config;
        let group = Group { region: Rect::new(69.5, 51.5, 20.0, 20.0), count: 5, strength: 3.0 };
        let camera = camera();
        let depth = DepthImage::filled(160, 120, 1.5);
        let by_depth = detector.detection(&camera, Some(&depth), &group).unwrap();
        let by_size = detector.detection(&camera, None, &group).unwrap();
        let size_m = FOCAL_PX * config.face_m / 20.0;
        for (found, face_m, sigma_m) in [
            (&by_depth, 1.5, config.sigma_depth_m),
            (&by_size, size_m, config.sigma_distance * size_m),
        ] {
            assert!((camera.depth_of(&found.position) - face_m - HEAD_RADIUS_M).abs() < 1e-9);
            let pixel = camera.project(&found.position).unwrap();
            assert!((pixel.x - 79.5).abs() < 1e-6);
            assert!((pixel.y - (61.5 - 20.0 * config.head_above)).abs() < 1e-6, "{pixel}");
            assert!((found.covariance[(0, 0)].sqrt() / sigma_m - 1.0).abs() < 0.05);
            let aside = config.sigma_place * 20.0 / FOCAL_PX * (face_m + HEAD_RADIUS_M);
            assert!((found.covariance[(2, 2)].sqrt() / aside - 1.0).abs() < 0.05);
            assert_eq!(found.rect().unwrap(), camera.upper_body(&found.position));
            assert!((found.score - (1.5 * 3.0_f64.ln() - 2.0)).abs() < 1e-9);
        }
        let sure = Group { strength: 1e9, ..group };
        let found = detector.detection(&camera, None, &sure).unwrap();
        assert_eq!(found.score, config.max_score);
        let doubtful = Group { strength: 0.0, ..sure };
        let found = detector.detection(&camera, None, &doubtful).unwrap();
        assert!((found.score - (1.5 * 1e-3_f64.ln() - 2.0)).abs() < 1e-9);
    }

    #[test]
    fn the_surest_face_comes_first_and_doubtful_ones_are_counted() {
        let (found, funnel) = detect(&mut detector(eager()), &frame(None), &EVERYWHERE);
        assert!(found.len() > 3, "{}", found.len());
        assert!(found.windows(2).all(|pair| pair[0].score >= pair[1].score));
        assert!(funnel.count("window: no face") > 100);
        assert_eq!(funnel.count("face: log-odds"), 0);
        let least = found[2].score;
        let strict = Config { min_score: least, ..eager() };
        let (kept, funnel) = detect(&mut detector(strict), &frame(None), &EVERYWHERE);
        let expected = found.iter().filter(|face| face.score >= least).count();
        assert_eq!(kept.len(), expected);
        assert_eq!(funnel.count("face: log-odds"), (found.len() - expected) as u64);
    }

    #[test]
    fn a_search_near_a_track_finds_one_face_within_its_box() {
        fn looked_at(funnel: &Funnel) -> u64 {
            funnel.count("window: no face")
        }

        let (all, whole) = detect(&mut detector(eager()), &frame(None), &EVERYWHERE);
        let upper_body = Rect::new(40.0, 30.0, 60.0, 60.0);
        let (found, part) =
            detect(&mut detector(eager()), &frame(None), &Query::Track(&track(upper_body)));
        assert_eq!(found.len(), 1);
        assert!(all.len() > 1);
        let face = camera().project(&found[0].position).unwrap();
        assert!(upper_body.inflated(0.1).contains(face), "{face}");
        assert!(looked_at(&part) > 0 && 3 * looked_at(&part) < looked_at(&whole));
    }

    #[test]
    fn depth_says_where_faces_are_looked_for_unless_it_is_told_not_to() {
        fn looked_at(config: Config, depth_m: Option<f32>) -> (u64, u64) {
            let (_, funnel) = detect(&mut detector(config), &frame(depth_m), &EVERYWHERE);
            let points = funnel.count("point: depth and height");
            (funnel.count("window: no face"), points)
        }

        let (everywhere, no_points) = looked_at(eager(), None);
        let (here, points) = looked_at(eager(), Some(2.0));
        let (nowhere, all_points) = looked_at(eager(), Some(9.0));
        assert_eq!((no_points, points), (0, 0));
        assert!(0 < here && here < everywhere, "{here} of {everywhere}");
        assert_eq!((nowhere, all_points), (0, 300));
        let off = Config { depth_proposals: false, ..eager() };
        assert_eq!(looked_at(off, Some(9.0)), (everywhere, 0));
    }
}
