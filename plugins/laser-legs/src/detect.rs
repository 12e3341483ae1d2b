use nalgebra::{Matrix3, Point2, Point3, Vector3, center};
use tagalong_config::Context;
use tagalong_core::{
    Capabilities, Detection, Detector, Frame, Funnel, Input, Inputs, LaserScan, Query, Result,
};
use tagalong_geometry::Rect;

use crate::past::PastScans;
use crate::{Beams, Config, Model, NAME, features};

/// The model that is part of the program.
const BUILT_IN: &str = include_str!("../models/laser-legs.toml");

/// Variance of a height that is not known, m².
const UNKNOWN_HEIGHT: f64 = 1e3;

/// The detector.
pub struct LaserLegs {
    config: Config,
    model: Model,
    past: PastScans,
}

/// Segment that may be a leg.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Leg {
    /// Place relative to the scanner, in the directions of the robot frame, m.
    at: Point2<f64>,
    log_odds: f64,
}

impl LaserLegs {
    /// Creates the detector; reads its model.
    ///
    /// # Errors
    /// [`tagalong_core::Error::Model`] for a file that cannot be read or is no model,
    /// [`tagalong_core::Error::Settings`] for settings outside their ranges.
    pub fn new(config: Config, context: &Context) -> Result<Self> {
        config.check()?;
        let model = context.model(&config.model, BUILT_IN, Model::from_text)?;
        Ok(Self { config, model, past: PastScans::default() })
    }

    /// Returns the segments that may be legs.
    fn legs(&self, beams: &Beams, funnel: &mut Funnel) -> Vec<Leg> {
        let max_width_m = self.config.segments.max_width_m;
        let segments = beams.segments(&self.config.segments);
        let mut legs = Vec::new();
        for segment in segments.iter().filter(|s| beams.width((*s).clone()) <= max_width_m) {
            let log_odds = self.model.log_odds(&features(beams, segment, &segments));
            if log_odds >= self.config.min_leg_log_odds {
                legs.push(Leg { at: beams.middle(segment.clone()), log_odds });
            } else {
                funnel.drop_at("no leg", Rect::default());
            }
        }
        legs
    }

    /// Returns pairs of legs, the nearest ones first, and then the legs that remain.
    fn people(&self, legs: &[Leg]) -> Vec<Vec<Leg>> {
        let mut pairs = Vec::new();
        for (a, leg) in legs.iter().enumerate() {
            for (b, other) in legs.iter().enumerate().skip(a + 1) {
                let apart_m = (leg.at - other.at).norm();
                if apart_m <= self.config.max_stride_m {
                    pairs.push((apart_m, a, b));
                }
            }
        }
        pairs.sort_by(|(one_m, ..), (other_m, ..)| one_m.total_cmp(other_m));
        let mut is_free = vec![true; legs.len()];
        let mut people = Vec::new();
        for (_, a, b) in pairs {
            if is_free[a] && is_free[b] {
                (is_free[a], is_free[b]) = (false, false);
                people.push(vec![legs[a], legs[b]]);
            }
        }
        people
            .extend(legs.iter().zip(is_free).filter(|(_, free)| *free).map(|(leg, _)| vec![*leg]));
        people
    }

    /// Returns the detection of a person of whom one leg or both are seen.
    fn detection(&self, legs: &[Leg], scan: &LaserScan) -> Detection {
        let config = &self.config;
        let scanner = scan.robot_from_scanner.translation.vector.xy();
        let (at, log_odds, sigma_m) = match legs {
            [a, b, ..] => {
                let both = a.log_odds + b.log_odds + config.pair_log_odds;
                (center(&a.at, &b.at), both, config.pair_sigma_m)
            }
            [one] => (one.at, one.log_odds + config.single_log_odds, config.single_sigma_m),
            [] => (Point2::origin(), 0.0, config.single_sigma_m),
        };
        let at = at + scanner;
        let variance = sigma_m * sigma_m;
        Detection::new(
            NAME,
            Point3::new(at.x, at.y, config.head_height_m),
            Matrix3::from_diagonal(&Vector3::new(variance, variance, UNKNOWN_HEIGHT)),
            (log_odds + config.free_log_odds * self.past.was_free(&at))
                .clamp(-config.limit, config.limit),
        )
    }
}

impl Detector for LaserLegs {
    fn capabilities(&self) -> Capabilities {
        let inputs = Inputs::NONE.require(Input::Laser);
        Capabilities::new(inputs).discovering()
    }

    fn detect(
        &mut self,
        frame: &Frame,
        query: &Query<'_>,
        funnel: &mut Funnel,
    ) -> Result<Vec<Detection>> {
        // It only discovers: which of the people is tracked, it cannot tell.
        if matches!(query, Query::Track(_)) {
            return Ok(Vec::new());
        }
        let is_needed = self.config.free_log_odds > 0.0;
        if is_needed {
            self.past.predict(&frame.motion);
        }
        // Each scanner is judged alone, because neighbouring rays make a segment; detections of one
        // person by two scanners are merged like those of two detectors.
        let mut found = Vec::new();
        let mut seen = Vec::new();
        for scan in frame.scans() {
            let beams = Beams::new(scan, 1);
            let legs = self.legs(&beams, funnel);
            found.extend(self.people(&legs).iter().map(|legs| self.detection(legs, scan)));
            seen.push((beams, scan.robot_from_scanner.translation.vector.xy()));
        }
        if seen.is_empty() {
            frame.scan()?;
        }
        for (beams, scanner) in seen.iter().filter(|_| is_needed) {
            self.past.add(beams, *scanner);
        }
        Ok(found)
    }

    fn remembers(&self) -> bool {
        self.config.free_log_odds > 0.0
    }
}
