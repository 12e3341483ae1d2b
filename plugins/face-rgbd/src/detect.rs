use nalgebra::Point2;
use tagalong_core::{
    Camera, Capabilities, Context, DepthImage, Detection, Detector, Frame, Funnel, HEAD_RADIUS_M,
    Input, Inputs, Rect, Result, Search,
};

use crate::{Cascade, Config, Group, Grouping, Hit, NAME, Proposals, Scanner, scales, whole};

/// The cascade that is part of the program.
const BUILT_IN: &str = include_str!("../../../configs/models/cascade.xml");

/// Finds faces, and says whose upper bodies they belong to.
pub struct FaceRgbd {
    config: Config,
    cascade: Cascade,
    /// Log-odds of a group as a line of the logarithm of its strength.
    line: (f64, f64),
    scanner: Scanner,
    proposals: Proposals,
    hits: Vec<Hit>,
    grouping: Grouping,
}

impl FaceRgbd {
    /// A detector; reads its cascade.
    ///
    /// # Errors
    /// [`tagalong_core::Error::Model`] for a file that cannot be read or is no cascade,
    /// [`tagalong_core::Error::Settings`] for numbers that cannot work.
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

    /// All windows that pass, of all sizes.
    fn search(&mut self, frame: &Frame, near: Option<Rect>, funnel: &mut Funnel) -> Result<()> {
        let Self { config, cascade, scanner, proposals, hits, .. } = self;
        let camera = &*frame.camera;
        let depth = frame.images().depth.as_deref().filter(|_| config.depth_proposals);
        let image = frame.grey()?;
        if let Some(depth) = depth {
            let [points, possible, searched] = proposals.sample(frame, depth, config);
            funnel.drop_many("point: depth and height", points - possible);
            funnel.drop_many("point: less like skin", possible - searched);
        }
        let most = config.max_side * image.width().min(image.height()) as f64;
        let (before, everywhere) = (scanner.looked_at(), [near.unwrap_or(whole(image))]);
        hits.clear();
        for scale in scales(cascade, config.min_side_px, most, config.scale_step) {
            if depth.is_some() {
                proposals.for_side(camera, scale * cascade.width as f64, config);
            }
            let propose = |window: &Rect| {
                near.is_none_or(|upper_body| upper_body.contains(window.centre()))
                    && (depth.is_none() || proposals.allows(window))
            };
            let areas = if depth.is_some() { proposals.areas() } else { &everywhere };
            scanner.scan_within(image, cascade, scale, areas, propose, hits);
        }
        let looked_at = scanner.looked_at() - before;
        funnel.drop_many("window: no face", looked_at - hits.len() as u64);
        Ok(())
    }

    /// The person whose face the windows show.
    fn detection(
        &self,
        camera: &Camera,
        depth: Option<&DepthImage>,
        group: &Group,
    ) -> Option<Detection> {
        let (config, side) = (&self.config, group.region.width);
        let by_size = camera.focal_px() * config.face_m / side;
        let (face_m, sigma_m) = match depth.and_then(|depth| depth.surface_m(&group.region)) {
            Some(metres) => (metres, config.sigma_depth_m),
            None => (by_size, by_size * config.sigma_distance),
        };
        let centre = group.region.centre();
        let head_px = Point2::new(centre.x, centre.y - config.head_above * side);
        let depth_m = face_m + HEAD_RADIUS_M;
        let position = camera.back_project(head_px, depth_m);
        let (slope, offset) = self.line;
        let detection = Detection {
            region: camera.upper_body(&position),
            position,
            covariance: camera.covariance(head_px, depth_m, config.sigma_place * side, sigma_m),
            score: (slope * group.strength.max(1e-3).ln() + offset).min(config.max_score),
            source: NAME,
        };
        detection.is_sane().then_some(detection)
    }
}

impl Detector for FaceRgbd {
    fn capabilities(&self) -> Capabilities {
        Capabilities {
            inputs: Inputs::NONE.require(Input::Colour).accept(Input::Depth),
            discovers: true,
            tracks: true,
            weighs: false,
        }
    }

    fn detect(
        &mut self,
        frame: &Frame,
        search: &Search<'_>,
        funnel: &mut Funnel,
    ) -> Result<Vec<Detection>> {
        let near = match search {
            Search::Near(track) => Some(track.estimate.region),
            Search::Everywhere { .. } => None,
        };
        self.search(frame, near, funnel)?;
        self.grouping.group(&self.hits, self.config.min_neighbours);
        let depth = frame.images().depth.as_deref();
        let of = |group| self.detection(&frame.camera, depth, group);
        let mut found: Vec<Detection> = self.grouping.kept().iter().filter_map(of).collect();
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
