use std::cmp::Ordering;
use std::sync::Arc;

use tagalong_config::check_settings;
use tagalong_core::{
    Capabilities, DepthImage, Detection, Detector, Error, Frame, Funnel, Input, Inputs, Likelihood,
    Measured, Query, Result, Track,
};
use tagalong_geometry::{HEAD_RADIUS_M, ImageBox, Rect};
use tagalong_vision::RowSums;

use crate::NAME;
use crate::bank::{Bank, Pose};
use crate::candidates::{body_below, boundary, head_width_m, is_below_something, tests_named};
use crate::config::{Cost, DepthTemplateConfig};
use crate::drops::{Against, Drops, Failed};
use crate::extension::{FrameComparison, SceneLikelihood, SilhouetteComparison};
use crate::matching::{Match, Matcher};
use crate::people::{Cell, group, weighted_centre};
use crate::view::{Local, MetricImage, Working};
use crate::weigher::Weigher;

/// The detector: discovers people, and follows them near a prediction.
pub struct DepthTemplate {
    config: DepthTemplateConfig,
    bank: Bank,
    cells: Vec<Cell>,
    view: Option<Arc<MetricImage>>,
    weigher: Weigher,
    /// Comparison of silhouettes in place of that of the matcher.
    comparison: Option<Box<dyn SilhouetteComparison>>,
}

/// Where a silhouette fits best.
struct Fitted {
    /// Reduced pixel.
    x: f64,
    /// Its row.
    y: f64,
    /// Depth of the face, m.
    depth_m: f64,
    /// Cost of the best template.
    cost: f64,
}

/// A frame, ready for matching.
struct PreparedFrame<'a> {
    rows: &'a RowSums,
    view: Arc<MetricImage>,
    matcher: Matcher,
    /// Comparison in place of that of the matcher.
    replaced: Option<Box<dyn FrameComparison>>,
}

impl DepthTemplate {
    /// A detector.
    ///
    /// # Errors
    /// [`Error::Settings`] for ranges that hold nothing.
    pub fn new(config: DepthTemplateConfig) -> Result<Self> {
        check_settings(&config)?;
        let ordered = [
            ("min_depth_m", config.min_depth_m, "max_depth_m", config.max_depth_m),
            (
                "min_head_height_m",
                config.min_head_height_m,
                "max_head_height_m",
                config.max_head_height_m,
            ),
            ("relief_free_m", config.relief_free_m, "relief_full_m", config.relief_full_m),
        ];
        for (low, a, high, b) in ordered {
            if a.partial_cmp(&b) != Some(Ordering::Less) {
                return Err(Error::setting(low, format!("= {a} must be below `{high}` = {b}")));
            }
        }
        Ok(Self {
            bank: Bank::new(config.max_rows),
            weigher: Weigher::new(&config),
            comparison: None,
            config,
            cells: Vec::new(),
            view: None,
        })
    }

    /// Compares silhouettes with the image in another way.
    #[must_use]
    pub fn with_comparison(self, comparison: Box<dyn SilhouetteComparison>) -> Self {
        Self { comparison: Some(comparison), ..self }
    }

    /// Weighs imagined scenes in another way.
    #[must_use]
    pub fn with_likelihood(self, likelihood: Box<dyn SceneLikelihood>) -> Self {
        Self { weigher: self.weigher.with_likelihood(likelihood), ..self }
    }

    /// Looks at the cells of a window and keeps those that `admit` lets through
    /// and where a silhouette fits well enough to look closer. `later` is the limit of the cost after
    /// that.
    fn scan(
        &mut self,
        scene: &PreparedFrame<'_>,
        window: &Rect,
        later: (&'static str, f64),
        funnel: &mut Funnel,
        admit: impl Fn(&Self, &Local) -> std::result::Result<(), Failed>,
    ) {
        let PreparedFrame { rows, view, .. } = scene;
        let inside = window.clipped(rows.width(), rows.height());
        let x0 = on_grid(inside.x);
        let y0 = on_grid(inside.y);
        let mut dropped = Drops::default();
        for y in (y0..inside.bottom().ceil() as i64).step_by(MetricImage::GRID as usize) {
            for x in (x0..inside.right().ceil() as i64).step_by(MetricImage::GRID as usize) {
                let Some(depth_m) = rows.depth_m(x, y) else { continue };
                let spacing = spacing(view.px_per_m(depth_m));
                // A power of two: no division for the many cells that are left here.
                if (x | y) & (spacing - 1) != 0 {
                    continue;
                }
                if !self.in_volume(depth_m, view.head_height_m(x, y, depth_m)) {
                    dropped.add(Failed::at(tests_named::VOLUME), view, (x, y), depth_m);
                    continue;
                }
                let local = view.local(x, y, depth_m);
                if let Err(failed) = admit(self, &local) {
                    dropped.add(failed, view, (x, y), depth_m);
                    continue;
                }
                let most = self.config.refine_cost;
                match self.best(scene, &local, most).filter(|fit| fit.cost < most) {
                    Some(fit) => {
                        let head = view.head(x as f64, y as f64, depth_m);
                        self.cells.push(Cell { x, y, depth_m, cost: fit.cost, head });
                    }
                    None => dropped.add(Failed::at(tests_named::REFINE), view, (x, y), depth_m),
                }
            }
        }
        // Few places, and none at a person that was found: the fit at a dropped cell stopped where it cost
        // too much.
        dropped.keep_apart(tests_named::REFINE, view, &self.cells);
        for place in dropped.places_of(tests_named::REFINE) {
            let local = view.local(place.x, place.y, place.depth_m);
            place.measured = self.unrefined(scene, &local, later);
        }
        dropped.report(view, funnel);
    }

    /// Returns what keeps a cell from being looked at more closely: the cost of its silhouette, with
    /// the limit that this cost would break after that, or the part of the silhouette with a reading.
    fn unrefined(
        &mut self,
        scene: &PreparedFrame<'_>,
        local: &Local,
        later: (&'static str, f64),
    ) -> Option<Measured> {
        if let Some(fit) = self.best(scene, local, f64::INFINITY) {
            let mut limits = vec![("refine_cost", self.config.refine_cost)];
            limits.extend((fit.cost > later.1).then_some(later));
            return Some(Measured { what: "cost", value: fit.cost, limits });
        }
        if scene.replaced.is_some() {
            return None;
        }
        let mut value: f64 = 0.0;
        for direction in &self.config.directions {
            let pose = Pose::nearest(*direction, local.pitch_rad, local.roll_rad, local.px_per_m);
            let template = self.bank.template(pose);
            value = value.max(scene.matcher.valid_part(scene.rows, template, (local.x, local.y)));
        }
        let setting = ("min_foreground_valid", self.config.min_foreground_valid);
        Some(Against { what: "part with depth", value, setting }.measured())
    }

    /// The view of this frame's camera; it seldom changes.
    fn view(&mut self, frame: &Frame, rows: &RowSums) -> Arc<MetricImage> {
        match &self.view {
            Some(view) if view.is_of(&frame.camera, rows) => Arc::clone(view),
            _ => Arc::clone(self.view.insert(Arc::new(MetricImage::new(&frame.camera, rows)))),
        }
    }

    fn in_volume(&self, depth_m: f64, height_m: f64) -> bool {
        let c = &self.config;
        (c.min_depth_m..=c.max_depth_m).contains(&depth_m)
            && (c.min_head_height_m..=c.max_head_height_m).contains(&height_m)
    }

    /// P4's tests of a newcomer, cheapest first.
    fn admit_newcomer(&self, rows: &RowSums, local: &Local) -> std::result::Result<(), Failed> {
        let c = &self.config;
        if !boundary(rows, local, c) {
            return Err(Failed::at(tests_named::BOUNDARY));
        }
        let width_m = head_width_m(rows, local);
        if !(c.min_head_width_m..=c.max_head_width_m).contains(&width_m) {
            let setting = if width_m < c.min_head_width_m {
                ("min_head_width_m", c.min_head_width_m)
            } else {
                ("max_head_width_m", c.max_head_width_m)
            };
            let against = Against { what: "width", value: width_m, setting };
            return Err(Failed { test: tests_named::WIDTH, against: Some(against) });
        }
        let body = body_below(rows, local);
        if body < c.min_body {
            let against = Against { what: "body", value: body, setting: ("min_body", c.min_body) };
            return Err(Failed { test: tests_named::BODY, against: Some(against) });
        }
        Ok(())
    }

    /// Walks from a cell to where the silhouette fits best: cells lie two and
    /// more pixels apart, and the edge of a silhouette is sharper than that.
    /// Returns the weighted centre of the fits around that place.
    fn refined(&mut self, scene: &PreparedFrame<'_>, cell: &Cell) -> Fitted {
        const AROUND: [(i64, i64); 8] =
            [(-1, 0), (1, 0), (0, -1), (0, 1), (-1, -1), (1, -1), (-1, 1), (1, 1)];
        let local = scene.view.local(cell.x, cell.y, cell.depth_m);
        let step = (spacing(local.px_per_m) / 2).max(1);
        let mut at = (cell.x, cell.y, cell.cost);
        for _ in 0..6 {
            let limit = 1.5 * at.2 + 0.02;
            let fits = AROUND.map(|(dx, dy)| {
                let beside = local.moved_to(at.0 + step * dx, at.1 + step * dy);
                let cost = self.best(scene, &beside, limit).map_or(f64::INFINITY, |fit| fit.cost);
                (beside.x, beside.y, cost)
            });
            let better = fits.into_iter().filter(|f| f.2 < at.2).min_by(|a, b| a.2.total_cmp(&b.2));
            let Some(better) = better else {
                let all = fits.into_iter().chain([at]);
                let (x, y) = weighted_centre(all, limit).unwrap_or((at.0 as f64, at.1 as f64));
                return Fitted { x, y, depth_m: cell.depth_m, cost: at.2 };
            };
            at = better;
        }
        Fitted { x: at.0 as f64, y: at.1 as f64, depth_m: cell.depth_m, cost: at.2 }
    }

    /// The best of the body directions; it need not be found where it costs more than
    /// `most`.
    fn best(&mut self, scene: &PreparedFrame<'_>, local: &Local, mut most: f64) -> Option<Match> {
        let Self { bank, config, .. } = self;
        let directions = config.directions.iter();
        directions
            .filter_map(|direction| {
                let pose =
                    Pose::nearest(*direction, local.pitch_rad, local.roll_rad, local.px_per_m);
                let template = bank.template(pose);
                let at = (local.x, local.y);
                let fit = match &scene.replaced {
                    Some(comparison) => comparison.fit(template, at, local.depth_m)?,
                    None => {
                        scene.matcher.fit_up_to(most, scene.rows, template, at, local.depth_m)?
                    }
                };
                most = most.min(fit.cost);
                Some(fit)
            })
            .min_by(|a, b| a.cost.total_cmp(&b.cost))
    }

    fn discover(
        &mut self,
        frame: &Frame,
        scene: &PreparedFrame<'_>,
        occupied: &Query<'_>,
        funnel: &mut Funnel,
    ) -> Result<Vec<Detection>> {
        self.cells.clear();
        let everywhere = Rect::new(0.0, 0.0, scene.rows.width() as f64, scene.rows.height() as f64);
        let limit = ("discover_cost", self.config.discover_cost);
        self.scan(scene, &everywhere, limit, funnel, |this, l| this.admit_newcomer(scene.rows, l));
        let mut found = Vec::new();
        for group in group(&mut self.cells, self.config.min_separation_m) {
            let person = self.refined(scene, &group.best);
            let at = scene.view.region(person.x, person.y, person.depth_m);
            if group.cells < self.config.min_cells {
                let value = f64::from(group.cells);
                let setting = ("min_cells", f64::from(self.config.min_cells));
                let against = Against { what: "cells", value, setting };
                funnel.drop_measured(tests_named::SIZE, at, against.measured());
                continue;
            }
            if person.cost > limit.1 {
                funnel.drop_measured(tests_named::COST, at, too_costly(&person, limit));
                continue;
            }
            let detection = self.detection(frame, scene, &person)?;
            if occupied.is_occupied(&detection.position, self.config.min_separation_m) {
                funnel.drop_at(tests_named::OCCUPIED, at);
            } else {
                found.push(detection);
            }
        }
        Ok(found)
    }

    fn follow(
        &mut self,
        frame: &Frame,
        scene: &PreparedFrame<'_>,
        track: &Track,
        funnel: &mut Funnel,
    ) -> Result<Vec<Detection>> {
        self.cells.clear();
        let estimate = &track.estimate;
        let expected = estimate.person.position;
        let sigma = estimate.covariance.fixed_view::<2, 2>(0, 0).trace().max(0.0).sqrt();
        let radius_m = (3.0 * sigma).clamp(0.15, self.config.follow_radius_m);
        let face_m = frame.camera.depth_of(&expected) - HEAD_RADIUS_M;
        let Some(centre) = scene.view.reduced_pixel(&expected).filter(|_| face_m > 0.1) else {
            return Ok(Vec::new());
        };
        let reach = radius_m * scene.view.px_per_m(face_m);
        let window = Rect::new(centre.x - reach, centre.y - reach, 2.0 * reach, 2.0 * reach);
        let c = &self.config;
        let limit = if track.confirmed {
            ("follow_cost", c.follow_cost)
        } else {
            ("discover_cost", c.discover_cost)
        };
        self.scan(scene, &window, limit, funnel, |this, local| {
            let head = scene.view.head(local.x as f64, local.y as f64, local.depth_m);
            if (head.xy() - expected.xy()).norm() > radius_m {
                return Err(Failed::at(tests_named::WINDOW));
            }
            let is_below = is_below_something(scene.rows, local, &this.config);
            if is_below { Err(Failed::at(tests_named::BOUNDARY)) } else { Ok(()) }
        });
        let Some(best) = group(&mut self.cells, 2.0 * radius_m).into_iter().next() else {
            return Ok(Vec::new());
        };
        let person = self.refined(scene, &best.best);
        if person.cost > limit.1 {
            let at = scene.view.region(person.x, person.y, person.depth_m);
            funnel.drop_measured(tests_named::COST, at, too_costly(&person, limit));
            return Ok(Vec::new());
        }
        Ok(vec![self.detection(frame, scene, &person)?])
    }

    fn detection(
        &self,
        frame: &Frame,
        scene: &PreparedFrame<'_>,
        person: &Fitted,
    ) -> Result<Detection> {
        let c = &self.config;
        let pixel = scene.view.full_pixel(person.x, person.y);
        let px_per_m = frame.camera.focal_px() / person.depth_m;
        let depth_m = head_depth_m(frame.depth()?, pixel.x, pixel.y, px_per_m, person.depth_m);
        // Not `Camera::locate_head`, which inverts an upper-body square: here the head itself was
        // fitted, its centre lies behind the surface by a setting, and the noise is the surface's.
        let position = frame.camera.back_project(pixel, depth_m + c.centre_behind_m);
        let sigma_depth_m = c.sigma_depth_m + c.sigma_depth_per_m2 * depth_m * depth_m;
        let sigma_px = c.sigma_across_m * px_per_m;
        Ok(Detection::new(
            NAME,
            position,
            frame.camera.covariance(pixel, depth_m, sigma_px, sigma_depth_m),
            c.score_per_cost * (c.even_cost - person.cost),
        )
        .with_image(ImageBox::upper_body(frame.camera.upper_body(&position))))
    }
}

impl Detector for DepthTemplate {
    fn capabilities(&self) -> Capabilities {
        Capabilities::new(Inputs::NONE.require(Input::Depth)).discovering().tracking().weighing()
    }

    fn detect(
        &mut self,
        frame: &Frame,
        query: &Query<'_>,
        funnel: &mut Funnel,
    ) -> Result<Vec<Detection>> {
        let depth = frame.depth()?;
        let working = frame.derived::<Working>()?;
        let rows = &working.0;
        let replaced = self.comparison.as_ref().map(|comparison| comparison.prepare(frame));
        let replaced = replaced.transpose()?;
        let background = match self.config.cost {
            Cost::Robust => 0.0,
            Cost::Squared => background(depth, self.config.background_percentile),
        };
        let view = self.view(frame, rows);
        let matcher = Matcher::new(&self.config, background);
        let scene = PreparedFrame { rows, view, matcher, replaced };
        match query {
            Query::Discover { .. } => self.discover(frame, &scene, query, funnel),
            Query::Track(track) => self.follow(frame, &scene, track, funnel),
        }
    }

    fn remembers(&self) -> bool {
        false
    }

    fn likelihood(&self) -> Option<&dyn Likelihood> {
        Some(&self.weigher)
    }
}

/// Returns the cost of a silhouette that is beyond a limit.
fn too_costly(person: &Fitted, setting: (&'static str, f64)) -> Measured {
    Against { what: "cost", value: person.cost, setting }.measured()
}

/// The last coordinate of the grid up to `at`.
fn on_grid(at: f64) -> i64 {
    at as i64 / MetricImage::GRID * MetricImage::GRID
}

/// Cells are 2, 4 or 8 pixels apart, always a power of two: about 3 cm at the person.
fn spacing(px_per_m: f64) -> i64 {
    match px_per_m * 0.03 {
        px if px >= 8.0 => 8,
        px if px >= 4.0 => 4,
        _ => 2,
    }
}

/// Returns the inverse depth of the background, in units of [`RowSums`]: a percentile of the valid
/// depths (P3, P4: the 90th).
pub fn background(depth: &DepthImage, percentile: f64) -> f64 {
    let mut valid: Vec<f32> = depth.pixels().iter().copied().filter(|z| z.is_finite()).collect();
    if valid.is_empty() {
        return 0.0;
    }
    let rank = ((percentile / 100.0).clamp(0.0, 1.0) * (valid.len() - 1) as f64).round() as usize;
    let (_, value, _) = valid.select_nth_unstable_by(rank, f32::total_cmp);
    RowSums::UNITS / f64::from(*value)
}

/// Median depth of a face (P4, section II-A): over a patch of 12 cm around the
/// head centre, readings within 0.25 m of `about_m`; `about_m` if there are none.
fn head_depth_m(depth: &DepthImage, x: f64, y: f64, px_per_m: f64, about_m: f64) -> f64 {
    let half = (0.06 * px_per_m).max(1.0);
    let step = (half / 4.0).max(1.0) as usize;
    let rows = ((y - half) as i64..=(y + half) as i64).step_by(step);
    let mut readings: Vec<f32> = rows
        .flat_map(|v| ((x - half) as i64..=(x + half) as i64).step_by(step).map(move |u| (u, v)))
        .filter_map(|(u, v)| depth.get(u, v))
        .filter(|z| (f64::from(*z) - about_m).abs() < 0.25)
        .collect();
    if readings.is_empty() {
        return about_m;
    }
    let middle = readings.len() / 2;
    let (_, median, _) = readings.select_nth_unstable_by(middle, f32::total_cmp);
    f64::from(*median)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_background_is_a_percentile_of_the_readings() {
        let depth = DepthImage::from_fn(20, 10, |x, y| match 20 * y + x {
            n if n < 101 => 1.0 + n as f32,
            _ => f32::NAN,
        });
        let usual = DepthTemplateConfig::default().background_percentile;
        for (percentile, expected_m) in [(usual, 91.0), (10.0, 11.0), (200.0, 101.0)] {
            let depth_m = RowSums::UNITS / background(&depth, percentile);
            assert!((depth_m - expected_m).abs() < 1e-6, "{percentile}: {depth_m}");
        }
        assert_eq!(background(&DepthImage::filled(4, 4, f32::NAN), 90.0), 0.0);
    }

    #[test]
    fn the_depth_of_a_head_is_the_median_of_the_readings_near_it() {
        fn of(image: &DepthImage) -> f64 {
            head_depth_m(image, 30.0, 30.0, 100.0, 2.0)
        }

        fn turned(x: usize) -> f32 {
            if x < 32 { 2.1 } else { 2.0 }
        }

        fn beside(x: usize) -> f32 {
            if x < 33 { 3.0 } else { 1.8 }
        }

        // 100 pixels a metre: a patch of 12 cm is 13 pixels wide.
        fn depth(face: &dyn Fn(usize) -> f32) -> DepthImage {
            DepthImage::from_fn(60, 60, |x, y| {
                let inside = (24..=36).contains(&x) && (24..=36).contains(&y);
                if inside { face(x) } else { 2.2 }
            })
        }
        assert!((of(&depth(&|_| 2.1)) - 2.1).abs() < 1e-6);
        assert!((of(&depth(&|x| if x == 30 { 1.9 } else { 2.0 })) - 2.0).abs() < 1e-6);
        assert!((of(&depth(&turned)) - 2.1).abs() < 1e-6, "eight of thirteen columns");
        assert!((of(&depth(&beside)) - 1.8).abs() < 1e-6, "what is 0.25 m off is no face");
        assert_eq!(of(&depth(&|_| f32::NAN)), 2.0);
    }

    #[test]
    fn cells_are_about_three_centimetres_apart() {
        let spacings = [20.0, 100.0, 133.0, 134.0, 266.0, 267.0, 900.0].map(spacing);
        assert_eq!(spacings, [2, 2, 2, 4, 4, 8, 8]);
        assert_eq!([0.0, 1.9, 2.0, 7.5].map(on_grid), [0, 0, 2, 6]);
    }
}
