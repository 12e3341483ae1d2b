use std::ops::Range;

use nalgebra::Point2;
use tagalong_core::LaserScan;

use crate::Segmentation;

/// Reflections of a scan on the floor, in the order of the rays.
#[derive(Clone, Debug, PartialEq)]
pub struct Beams {
    /// Places of the reflections relative to the scanner, in the directions of the robot frame, m.
    pub points: Vec<Point2<f64>>,
    /// Distances from the scanner, m.
    pub ranges: Vec<f64>,
    /// Number of the ray of each reflection.
    pub rays: Vec<u32>,
    /// Angle from one ray to the next, rad.
    pub step_rad: f64,
}

/// Part of a scan: indices of its reflections.
pub type Segment = Range<usize>;

impl Beams {
    /// Returns the reflections of a scan, of every `every`-th ray only.
    pub fn new(scan: &LaserScan, every: u32) -> Self {
        let every = every.max(1);
        let scanner = scan.robot_from_scanner.translation.vector.xy();
        let mut points = Vec::new();
        let mut rays = Vec::new();
        for (point, ray) in scan.points.iter().zip(scan.rays.iter()) {
            if ray % every == 0 {
                points.push(point.xy() - scanner);
                rays.push(ray / every);
            }
        }
        let ranges = points.iter().map(|point| point.coords.norm()).collect();
        let step_rad = scan.increment_rad.abs() * f64::from(every);
        Self { points, ranges, rays, step_rad }
    }

    /// Returns the segments of the scan that are no single points of noise.
    pub fn segments(&self, settings: &Segmentation) -> Vec<Segment> {
        let mut segments = Vec::new();
        let mut start = 0;
        for end in 1..=self.points.len() {
            if end == self.points.len() || self.is_jump(end - 1, settings) {
                segments.push(start..end);
                start = end;
            }
        }
        segments.retain(|segment| segment.len() >= settings.min_points);
        segments
    }

    /// Returns true if a segment ends at a reflection.
    fn is_jump(&self, at: usize, settings: &Segmentation) -> bool {
        let next = at + 1;
        let apart = (self.points[next] - self.points[at]).norm();
        let range = self.ranges[at].min(self.ranges[next]);
        let gap = self.rays[next].saturating_sub(self.rays[at]);
        gap > 1 + settings.gap_rays
            || apart > settings.jump_m + settings.jump_rays * range * self.step_rad
    }

    /// Returns the distance of the first and the last reflection of a segment, m.
    pub fn width(&self, segment: Segment) -> f64 {
        (self.points[segment.end - 1] - self.points[segment.start]).norm()
    }

    /// Returns the mean of the reflections of a segment.
    pub fn middle(&self, segment: Segment) -> Point2<f64> {
        let count = segment.len().max(1) as f64;
        let sum: nalgebra::Vector2<f64> = self.points[segment].iter().map(|p| p.coords).sum();
        Point2::from(sum / count)
    }
}
