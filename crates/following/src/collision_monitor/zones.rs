//! Stop and slowdown polygons around the robot, like those of Nav2's collision monitor.

use nalgebra::Point2;
use tagalong_core::Reason;

use super::CollisionMonitorSettings;
use super::footprint::Footprint;
use super::sweep::{Hazard, HazardKind};

/// Polygons of the settings, and the state of each in the last frame.
pub(super) struct Zones {
    stop: Zone,
    slowdown: Zone,
    min_points: u32,
}

/// Polygon in the robot frame.
struct Zone {
    outline: Footprint,
    points: u32,
    has_person: bool,
}

impl Zones {
    /// Creates the polygons of the settings, with nothing in them.
    pub(super) fn new(settings: &CollisionMonitorSettings) -> Self {
        Self {
            stop: Zone::new(&settings.stop),
            slowdown: Zone::new(&settings.slowdown),
            min_points: settings.min_points.max(1),
        }
    }

    /// Takes in all hazards of a frame.
    pub(super) fn update(&mut self, hazards: &[Hazard]) {
        self.stop.update(hazards);
        self.slowdown.update(hazards);
    }

    /// Returns the reason to stand, if enough readings are inside the stop polygon.
    pub(super) fn stop_reason(&self) -> Option<Reason> {
        let is_person = self.stop.content(self.min_points)?;
        Some(if is_person { Reason::TooClose } else { Reason::Blocked })
    }

    /// Returns the reason to drive slower, if enough readings are inside the slowdown polygon.
    pub(super) fn slowdown_reason(&self) -> Option<Reason> {
        let is_person = self.slowdown.content(self.min_points)?;
        Some(if is_person { Reason::Near } else { Reason::Obstacle })
    }

    /// Returns the places inside the polygon that a reason comes from, those of its kind of hazard;
    /// none if the reason does not come from a polygon.
    pub(super) fn places_inside(&self, reason: Reason, hazards: &[Hazard]) -> Vec<Point2<f64>> {
        let zone = if self.stop_reason() == Some(reason) {
            &self.stop
        } else if self.slowdown_reason() == Some(reason) {
            &self.slowdown
        } else {
            return Vec::new();
        };
        let is_person = matches!(reason, Reason::TooClose | Reason::Near);
        let own = hazards.iter().filter(|it| (it.kind != HazardKind::Still) == is_person);
        own.map(|hazard| hazard.at).filter(|at| zone.holds(at)).collect()
    }
}

impl Zone {
    fn new(corners: &[[f64; 2]]) -> Self {
        Self { outline: Footprint::new(corners), points: 0, has_person: false }
    }

    fn update(&mut self, hazards: &[Hazard]) {
        self.points = 0;
        self.has_person = false;
        if self.outline.corners().is_empty() {
            return;
        }
        for hazard in hazards {
            if self.holds(&hazard.at) {
                self.points = self.points.saturating_add(hazard.points);
                self.has_person |= hazard.kind != HazardKind::Still;
            }
        }
    }

    fn holds(&self, at: &Point2<f64>) -> bool {
        self.outline.distance_m(at) <= 0.0
    }

    /// Returns whether there is a person inside, or something that moves; `None` with too few
    /// readings inside.
    fn content(&self, min_points: u32) -> Option<bool> {
        (self.points >= min_points).then_some(self.has_person)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hazard(x: f64, points: u32, kind: HazardKind) -> Hazard {
        Hazard { at: Point2::new(x, 0.0), points, kind }
    }

    #[test]
    fn enough_readings_inside_a_polygon_count() {
        let settings = CollisionMonitorSettings {
            stop: vec![[0.6, 0.4], [0.6, -0.4], [-0.4, -0.4], [-0.4, 0.4]],
            slowdown: vec![[1.2, 0.4], [1.2, -0.4], [-0.4, -0.4], [-0.4, 0.4]],
            ..CollisionMonitorSettings::default()
        };
        let mut zones = Zones::new(&settings);
        zones.update(&[hazard(0.5, 5, HazardKind::Still), hazard(1.3, 9, HazardKind::Still)]);
        assert_eq!((zones.stop_reason(), zones.slowdown_reason()), (None, None), "a point is dust");
        zones.update(&[hazard(0.5, 5, HazardKind::Still), hazard(-0.3, 1, HazardKind::Still)]);
        assert_eq!(zones.stop_reason(), Some(Reason::Blocked));
        zones.update(&[hazard(0.9, 6, HazardKind::Followed(0.0))]);
        assert_eq!((zones.stop_reason(), zones.slowdown_reason()), (None, Some(Reason::Near)));
        zones.update(&[hazard(0.5, 6, HazardKind::Moves(0.3))]);
        assert_eq!(zones.stop_reason(), Some(Reason::TooClose));
        let both = [hazard(0.5, 6, HazardKind::Moves(0.3)), hazard(0.4, 1, HazardKind::Still)];
        assert_eq!(zones.places_inside(Reason::TooClose, &both), [both[0].at]);
        assert_eq!(zones.places_inside(Reason::Blocked, &both), []);
        let mut none = Zones::new(&CollisionMonitorSettings::default());
        none.update(&[hazard(0.3, 99, HazardKind::Still)]);
        assert_eq!((none.stop_reason(), none.slowdown_reason()), (None, None));
    }
}
