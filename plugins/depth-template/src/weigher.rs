use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use tagalong_core::{Frame, Likelihood, Person, Result, Visualisation};
use tagalong_geometry::{Camera, HEAD_RADIUS_M, Rect};
use tagalong_vision::ComparedPixels;

use crate::bank::{Bank, Direction, Pose, TemplateRow, with_reliefs};
use crate::config::DepthTemplateConfig;
use crate::extension::{FrameLikelihood, SceneLikelihood};
use crate::scores::{Levels, ONE, Scores};
use crate::view::{MetricImage, Working};

/// Weighs imagined scenes by their overlapping silhouettes (P3, section II-C): each person is
/// painted over those behind.
///
/// The weight is a log-likelihood ratio against a scene without people, so that pixels outside of
/// all windows cancel and hypotheses of any size compare. A person that fits perfectly and is
/// wholly visible weighs `likelihood_nats`, at any range; a hidden one weighs nothing.
pub struct Weigher {
    nats: f64,
    replaced: Option<Box<dyn SceneLikelihood>>,
    tools: Mutex<Tools>,
}

/// Memory that is reused from scene to scene and from frame to frame.
struct Tools {
    tolerance_m: f64,
    one_sided: f64,
    /// Windows beside the image count: a replaced likelihood may look between them.
    all_windows: bool,
    silhouettes: Silhouettes,
    view: Option<Arc<MetricImage>>,
    scores: Scores,
    cast: Vec<PlacedPerson>,
    alone: HashMap<Spot, SilhouetteFit>,
    masks: Vec<Span>,
}

/// A run of pixels of a row: from, to.
pub type Span = (i64, i64);

/// A silhouette at a place: all that matters for a person alone. Scenes that combine few people ask
/// for the same ones again and again.
type Spot = (usize, i64, i64, u64);

/// Every second row is looked at, and every fourth of people so near that many
/// rows are left. The lines are the same ones in every scene.
const ROW_STEPS: [i64; 2] = [2, 4];
/// So many rows are many: about 0.5 m at 80 pixels per metre.
const MANY_ROWS: usize = 50;

/// Templates with all their rows, by number.
struct Silhouettes {
    bank: Bank,
    kept: Vec<(Pose, Arc<Silhouette>)>,
}

/// A template with all its rows.
struct Silhouette {
    /// Which one it is.
    number: usize,
    pose: Pose,
    /// All rows without their reliefs.
    rows: Vec<TemplateRow>,
    half_width: i64,
    /// Distance of the rows that are looked at.
    step: i64,
    /// Every `step`-th row with its relief, from each of the first ones on, once asked for.
    thinned: Vec<OnceLock<Vec<TemplateRow>>>,
    /// Pixels of the person in the rows that are looked at.
    area: f64,
}

/// Person in a scene, with the silhouette at its place in the reduced image.
#[derive(Clone)]
pub struct PlacedPerson {
    silhouette: Arc<Silhouette>,
    /// Column of the head centre, reduced pixels.
    pub x: i64,
    y: i64,
    /// Depth of the face, m.
    pub depth_m: f64,
    /// Depth, m, up to which another person can cause the readings at this one's place.
    reach_m: f64,
    levels: Levels,
}

impl Weigher {
    /// A weigher.
    pub fn new(config: &DepthTemplateConfig) -> Self {
        let tools = Tools {
            tolerance_m: config.likelihood_tolerance_m,
            one_sided: config.likelihood_one_sided,
            all_windows: false,
            silhouettes: Silhouettes { bank: Bank::new(usize::MAX), kept: Vec::new() },
            view: None,
            scores: Scores::new(config),
            cast: Vec::new(),
            alone: HashMap::new(),
            masks: Vec::new(),
        };
        Self { nats: config.likelihood_nats, replaced: None, tools: Mutex::new(tools) }
    }

    /// Weighs scenes by another likelihood. It gets silhouettes beside the image, too.
    #[must_use]
    pub fn with_likelihood(self, likelihood: Box<dyn SceneLikelihood>) -> Self {
        self.tools().all_windows = true;
        Self { replaced: Some(likelihood), ..self }
    }

    /// Returns the logarithms of a replaced likelihood; where a scene has one person, of the template
    /// that fits best.
    fn replaced_logs(
        &self,
        likelihood: &dyn FrameLikelihood,
        frame: &Frame,
        scenes: std::slice::Chunks<'_, Person>,
    ) -> Result<Vec<f64>> {
        let image = frame.derived::<Working>()?;
        let mut tools = self.tools();
        let view = tools.view_of(frame, &image);
        let mut logs = Vec::new();
        for scene in scenes {
            logs.push(match scene {
                [] => 0.0,
                [_] => {
                    let ways = Direction::ALL.map(|way| {
                        let cast = tools.placed_people(scene, Some(way), frame, &view);
                        likelihood.log_likelihood(&cast)
                    });
                    ways.into_iter().fold(f64::MIN, f64::max)
                }
                _ => likelihood.log_likelihood(&tools.placed_people(scene, None, frame, &view)),
            });
        }
        Ok(logs)
    }

    fn tools(&self) -> MutexGuard<'_, Tools> {
        self.tools.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Likelihood for Weigher {
    fn log_likelihood(&self, frame: &Frame, scene: &[Person]) -> Result<f64> {
        let mut out = Vec::new();
        self.log_likelihoods(frame, scene, scene.len(), &mut out)?;
        Ok(out.first().copied().unwrap_or_default())
    }

    fn log_likelihoods(
        &self,
        frame: &Frame,
        people: &[Person],
        people_per_scene: usize,
        out: &mut Vec<f64>,
    ) -> Result<()> {
        out.clear();
        if let Some(replaced) = &self.replaced {
            let scenes = people.chunks(people_per_scene.max(1));
            out.extend(self.replaced_logs(&*replaced.prepare(frame)?, frame, scenes)?);
            return Ok(());
        }
        let image = frame.derived::<Working>()?;
        let mut tools = self.tools();
        let tools = &mut *tools;
        let view = tools.view_of(frame, &image);
        let mut cast = std::mem::take(&mut tools.cast);
        let mut counts = Vec::with_capacity(people.len() / people_per_scene.max(1) + 1);
        cast.clear();
        for scene in people.chunks(people_per_scene.max(1)) {
            let before = cast.len();
            cast.extend(
                scene.iter().filter_map(|p| {
                    tools.place(p, direction(p, &frame.camera), &frame.camera, &view)
                }),
            );
            cast[before..].sort_by(|a, b| a.depth_m.total_cmp(&b.depth_m).then(a.x.cmp(&b.x)));
            counts.push(cast.len() - before);
        }
        let (from, to) = cast.iter().fold((i64::MAX, 0), |(from, to), p| {
            let half = p.silhouette.half_width;
            (from.min(p.x - half), to.max(p.x + half + 1))
        });
        tools.scores.prepare(&image, from, to);
        tools.alone.clear();
        let mut rest = &cast[..];
        for count in counts {
            let (scene, others) = rest.split_at(count);
            out.push(self.nats * tools.weigh(scene));
            rest = others;
        }
        tools.cast = cast;
        Ok(())
    }

    fn visualise(&self, frame: &Frame, scene: &[Person]) -> Result<Option<Visualisation>> {
        let image = frame.derived::<Working>()?;
        Ok(Some(Arc::new(ComparedPixels(self.tools().silhouettes(frame, &image, scene)))))
    }
}

impl Tools {
    /// Places the people of a scene, the nearest first; where no `way` is given, each faces where
    /// it moves.
    fn placed_people(
        &mut self,
        scene: &[Person],
        way: Option<Direction>,
        frame: &Frame,
        view: &MetricImage,
    ) -> Vec<PlacedPerson> {
        let mut cast = Vec::new();
        for person in scene {
            let way = way.unwrap_or_else(|| direction(person, &frame.camera));
            cast.extend(self.place(person, way, &frame.camera, view));
        }
        cast.sort_by(|a, b| a.depth_m.total_cmp(&b.depth_m).then(a.x.cmp(&b.x)));
        cast
    }

    /// Returns the visible bodies of a scene, without the parts that nearer ones hide, as runs in
    /// the image.
    fn silhouettes(&mut self, frame: &Frame, image: &Working, scene: &[Person]) -> Vec<Vec<Rect>> {
        let view = self.view_of(frame, image);
        let cast: Vec<Option<PlacedPerson>> = scene
            .iter()
            .map(|p| self.place(p, direction(p, &frame.camera), &frame.camera, &view))
            .collect();
        let mut visible = Vec::with_capacity(cast.len());
        for person in &cast {
            let mut runs = Vec::new();
            let Some(person) = person else {
                visible.push(runs);
                continue;
            };
            for (line, row) in person.rows(image.0.height() as i64) {
                let nearer = cast.iter().flatten().filter(|p| p.depth_m < person.depth_m);
                let bodies: Vec<Span> = nearer.filter_map(|p| p.body(line)).collect();
                let step = person.silhouette.step;
                let shown = outside(person.inside(row), bodies);
                runs.extend(shown.into_iter().map(|run| view.full_run(line, run, step)));
            }
            visible.push(runs);
        }
        visible
    }

    /// The view of this frame's camera; it seldom changes.
    fn view_of(&mut self, frame: &Frame, image: &Working) -> Arc<MetricImage> {
        match &self.view {
            Some(view) if view.is_of(&frame.camera, &image.0) => Arc::clone(view),
            _ => Arc::clone(self.view.insert(Arc::new(MetricImage::new(&frame.camera, &image.0)))),
        }
    }

    /// Returns the place of a person's silhouette in the image; `None` behind the camera, or so far
    /// aside that nothing can be seen or hidden.
    fn place(
        &mut self,
        person: &Person,
        direction: Direction,
        camera: &Camera,
        view: &MetricImage,
    ) -> Option<PlacedPerson> {
        let depth_m = camera.depth_of(&person.position) - HEAD_RADIUS_M;
        if !(MIN_DEPTH_M..MAX_DEPTH_M).contains(&depth_m) {
            return None;
        }
        let pixel = view.reduced_pixel(&person.position)?;
        if !(pixel.x.abs() < MAX_PIXEL && pixel.y.abs() < MAX_PIXEL) {
            return None;
        }
        let x = pixel.x.round() as i64;
        let y = pixel.y.round() as i64;
        let (inside_x, inside_y) = view.nearest_inside(x, y);
        let local = view.local(inside_x, inside_y, depth_m);
        let pose = Pose::nearest(direction, local.pitch_rad, local.roll_rad, local.px_per_m);
        let reach = pose.reach();
        if !self.all_windows && !(-reach..view.width() + reach).contains(&x) {
            return None;
        }
        let silhouette = self.silhouettes.of(pose);
        let reach_m = depth_m + self.tolerance_m;
        Some(PlacedPerson { silhouette, x, y, depth_m, reach_m, levels: Levels::of_face(depth_m) })
    }

    /// The weight of a scene, near to far, in units of one person.
    fn weigh(&mut self, scene: &[PlacedPerson]) -> f64 {
        (0..scene.len()).map(|k| self.weigh_one(scene, k)).sum()
    }

    /// Returns the weight that person `k` of the scene explains, as a part of the whole person.
    fn weigh_one(&mut self, scene: &[PlacedPerson], k: usize) -> f64 {
        let alone = self.alone(&scene[k]);
        let taken = self.taken(scene, k);
        alone.without(taken).weight(self.one_sided) / (f64::from(ONE) * scene[k].silhouette.area)
    }

    /// Returns the fit of a person in a scene of their own.
    fn alone(&mut self, person: &PlacedPerson) -> SilhouetteFit {
        let Self { scores, alone, .. } = self;
        *alone.entry(person.spot()).or_insert_with(|| {
            let mut found = SilhouetteFit::default();
            for (line, row) in person.rows(scores.height()) {
                let pixels = scores.row(line as usize, person.levels.behind(row.relief_m));
                let [left, right] = person.beside(row);
                let covered = pixels.of(person.inside(row)).covered;
                found.add(covered, pixels.of(left).beside, pixels.of(right).beside);
            }
            found
        })
    }

    /// Returns the part of that fit which the others take: the body where nearer ones hide it, and
    /// the pixels beside it where they are theirs. A person that is clearly farther away cannot
    /// cause the readings at this person's depth.
    fn taken(&mut self, scene: &[PlacedPerson], k: usize) -> SilhouetteFit {
        if scene.len() <= 2 {
            let other = rivals(scene, k).next();
            return other.map_or_else(SilhouetteFit::default, |other| {
                self.taken_by_one(&scene[k], other, k == 1)
            });
        }
        let Self { scores, masks, .. } = self;
        let person = &scene[k];
        let mut taken = SilhouetteFit::default();
        for (line, row) in person.rows(scores.height()) {
            union_of(masks, rivals(scene, k).filter_map(|p| p.body(line)));
            if masks.is_empty() {
                continue;
            }
            let pixels = scores.row(line as usize, person.levels.behind(row.relief_m));
            let [left, right] =
                person.beside(row).map(|side| masked(masks, side, |part| pixels.of(part).beside));
            union_of(masks, scene[..k].iter().filter_map(|p| p.body(line)));
            let covered = masked(masks, person.inside(row), |part| pixels.of(part).covered);
            taken.add(covered, left, right);
        }
        taken
    }

    /// As [`Self::taken`] with one other person, which needs no union. Most rows of most pairs do
    /// not meet, and are left before their sums are asked for.
    fn taken_by_one(
        &mut self,
        person: &PlacedPerson,
        other: &PlacedPerson,
        is_nearer: bool,
    ) -> SilhouetteFit {
        let half = person.silhouette.half_width;
        let window = (person.x - half, person.x + half + 1);
        let mut taken = SilhouetteFit::default();
        for (line, row) in person.rows(self.scores.height()) {
            let Some(body) = other.body(line).map(|body| common(body, window)) else { continue };
            if body.0 >= body.1 {
                continue;
            }
            let pixels = self.scores.row(line as usize, person.levels.behind(row.relief_m));
            let [left, right] = person.beside(row).map(|side| pixels.of(common(side, body)).beside);
            let covered =
                if is_nearer { pixels.of(common(person.inside(row), body)).covered } else { 0 };
            taken.add(covered, left, right);
        }
        taken
    }
}

/// Fit of a silhouette in the image, in units of 1 / [`ONE`] pixels.
#[derive(Clone, Copy, Debug, Default)]
struct SilhouetteFit {
    /// Pixels of the body that speak for the person, less those against.
    covered: i64,
    /// Pixels left of the body at the person's depth.
    left: i64,
    /// The same on the right.
    right: i64,
}

impl SilhouetteFit {
    fn add(&mut self, covered: i32, left: i32, right: i32) {
        self.covered += i64::from(covered);
        self.left += i64::from(left);
        self.right += i64::from(right);
    }

    fn without(self, taken: Self) -> Self {
        Self {
            covered: self.covered - taken.covered,
            left: self.left - taken.left,
            right: self.right - taken.right,
        }
    }

    /// Returns the weight. A surface that goes on at the same depth on both sides is no person but
    /// furniture or a wall; on one side it may be a rucksack or an arm, and counts as the part
    /// `one_sided`.
    fn weight(self, one_sided: f64) -> f64 {
        let Self { covered, left, right } = self;
        let both = 2 * left.min(right);
        let rest = left.abs_diff(right);
        (covered - both) as f64 - one_sided * rest as f64
    }
}

/// Returns the intersection of two spans; it ends before it starts where that is empty.
fn common(a: Span, b: Span) -> Span {
    (a.0.max(b.0), a.1.min(b.1))
}

/// A face that is nearer than this has no silhouette, m.
const MIN_DEPTH_M: f64 = 0.3;
/// Depth from which on a person is a dot, m.
const MAX_DEPTH_M: f64 = 20.0;
/// Largest distance outside of the image at which people are considered.
const MAX_PIXEL: f64 = 4000.0;

/// Returns the people of the scene that can cause the readings at the place of person `k`.
fn rivals(scene: &[PlacedPerson], k: usize) -> impl Iterator<Item = &PlacedPerson> {
    let reach_m = scene[k].reach_m;
    scene[..k].iter().chain(scene[k + 1..].iter().take_while(move |p| p.depth_m < reach_m))
}

impl PlacedPerson {
    /// The rows of the silhouette that are looked at, with their lines.
    fn rows(&self, height: i64) -> impl Iterator<Item = (i64, &TemplateRow)> {
        let Silhouette { rows, step, .. } = &*self.silhouette;
        let first = self.y + rows.first().map_or(0, |row| row.dy);
        let phase = (-first).rem_euclid(*step);
        let above = (-first - phase).max(0) / step;
        let rows =
            self.silhouette.thinned(phase as usize).get(above as usize..).unwrap_or_default();
        let lines = (first + phase + above * step..height).step_by(*step as usize);
        lines.zip(rows)
    }

    fn spot(&self) -> Spot {
        (self.silhouette.number, self.x, self.y, self.depth_m.to_bits())
    }

    /// Returns the columns of the window.
    pub fn columns(&self) -> Span {
        let half = self.silhouette.half_width;
        (self.x - half, self.x + half + 1)
    }

    /// Returns the lines of the window.
    pub fn lines(&self) -> Span {
        let rows = &self.silhouette.rows;
        let [first, last] =
            [rows.first(), rows.last()].map(|row| self.y + row.map_or(0, |row| row.dy));
        (first, last + 1)
    }

    /// The row of the silhouette in a line of the image; `None` outside of the window.
    pub fn row(&self, line: i64) -> Option<&TemplateRow> {
        let index = line - self.lines().0;
        self.silhouette.rows.get(usize::try_from(index).ok()?)
    }

    /// The body without its edges.
    fn inside(&self, row: &TemplateRow) -> Span {
        (self.x + row.from, self.x + row.to)
    }

    /// Returns the run in which the body, edges included, hides the scene behind. Below the window
    /// the trunk goes on.
    fn body(&self, line: i64) -> Option<Span> {
        let rows = &self.silhouette.rows;
        let index = line - self.y - rows.first()?.dy;
        let row = &rows[usize::try_from(index).ok()?.min(rows.len() - 1)];
        let span = (self.x + row.guard_from, self.x + row.guard_to);
        (span.0 < span.1).then_some(span)
    }

    /// Returns the runs beside the body within the window.
    fn beside(&self, row: &TemplateRow) -> [Span; 2] {
        let half = self.silhouette.half_width;
        [(self.x - half, self.x + row.guard_from), (self.x + row.guard_to, self.x + half + 1)]
    }
}

impl Silhouettes {
    fn of(&mut self, pose: Pose) -> Arc<Silhouette> {
        let found = self.kept.binary_search_by(|(kept, _)| kept.cmp(&pose));
        let at = found.unwrap_or_else(|at| {
            let number = self.kept.len();
            let silhouette = Arc::new(Silhouette::new(self.bank.outline(pose), pose, number));
            self.kept.insert(at, (pose, silhouette));
            at
        });
        Arc::clone(&self.kept[at].1)
    }
}

impl Silhouette {
    fn new(rows: Vec<TemplateRow>, pose: Pose, number: usize) -> Self {
        let pixels: i64 = rows.iter().map(|row| (row.to - row.from).max(0)).sum();
        let step = ROW_STEPS[usize::from(rows.len() >= MANY_ROWS)];
        let thinned = vec![OnceLock::new(); step as usize];
        let area = (pixels as f64 / step as f64).max(1.0);
        Self { number, pose, half_width: pose.half_width(), step, thinned, area, rows }
    }

    /// Returns every `step`-th row from the one number `phase` on.
    fn thinned(&self, phase: usize) -> &[TemplateRow] {
        self.thinned[phase].get_or_init(|| {
            with_reliefs(self.pose, self.rows.iter().skip(phase).step_by(self.step as usize))
        })
    }
}

/// Replaces `masks` by the union of `spans`, sorted and disjoint.
fn union_of(masks: &mut Vec<Span>, spans: impl Iterator<Item = Span>) {
    masks.clear();
    masks.extend(spans);
    if masks.len() < 2 {
        return;
    }
    masks.sort_unstable();
    masks.dedup_by(|next, kept| {
        let touches = next.0 <= kept.1;
        if touches {
            kept.1 = kept.1.max(next.1);
        }
        touches
    });
}

/// Returns the parts of a span that no mask covers.
pub fn outside(span: Span, mut masks: Vec<Span>) -> Vec<Span> {
    masks.sort_unstable();
    let mut left = Vec::new();
    let mut from = span.0;
    for (start, end) in masks {
        left.push((from, start.min(span.1)));
        from = from.max(end);
    }
    left.push((from, span.1));
    left.retain(|(from, to)| from < to);
    left
}

/// Sum over the masked parts of a span.
fn masked(masks: &[Span], span: Span, sum: impl Fn(Span) -> i32) -> i32 {
    let parts = masks.iter().map(|mask| common(*mask, span));
    parts.filter(|(from, to)| from < to).map(sum).sum()
}

/// The template that a person shows: P3 chooses it by the direction of motion,
/// which counts relative to the viewing ray.
fn direction(person: &Person, camera: &Camera) -> Direction {
    let ray = (person.position - camera.robot_from_camera.translation.vector).coords.xy();
    let speed = person.velocity.norm();
    let range = ray.norm();
    if !(speed >= SLOW_MPS && range > 0.0) {
        return Direction::Along;
    }
    let along = person.velocity.dot(&ray) / (speed * range);
    if along.abs() > TURNED_COSINE {
        Direction::Along
    } else if ray.x * person.velocity.y > ray.y * person.velocity.x {
        Direction::Left
    } else {
        Direction::Right
    }
}

/// Speed below which a person may face anywhere, m/s.
const SLOW_MPS: f64 = 0.3;
/// Cosine of the angle to the viewing ray from which on a body is seen from the side.
const TURNED_COSINE: f64 = 0.7;

#[cfg(test)]
mod tests;
