//! Many windows of one face become one (OpenCV's `groupRectangles`).

use tagalong_geometry::Rect;

/// Windows whose edges differ by less than this part of their size are alike.
const ALIKE: f64 = 0.2;
/// Fewer windows than this are outvoted by those around them.
const FEW: usize = 3;

/// A window that passed all stages.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// The window, whole pixels of the image.
    pub region: Rect,
    /// By how much the sum of the last stage exceeds what it has to reach.
    pub margin: f32,
}

/// Windows that are alike.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Group {
    /// Their mean, rounded to whole pixels.
    pub region: Rect,
    /// How many they are.
    pub count: usize,
    /// Sum of their margins.
    pub strength: f64,
}

/// Puts windows into groups; keeps its memory from one image to the next.
#[derive(Clone, Debug, Default)]
pub struct Grouping {
    /// The group of each window.
    labels: Vec<usize>,
    /// Windows whose like have still to be looked for.
    open: Vec<usize>,
    groups: Vec<Group>,
    kept: Vec<Group>,
}

/// Belongs to no group yet.
const FREE: usize = usize::MAX;

impl Grouping {
    /// Like windows, and those like them, belong together. Groups of `fewest` and less
    /// go, and those inside of stronger ones. Groups come in the order of their first
    /// windows.
    pub fn group(&mut self, hits: &[Hit], fewest: usize) {
        self.label(hits);
        self.sum_up(hits);
        self.groups.retain(|group| group.count > fewest);
        let Self { groups, kept, .. } = self;
        kept.clear();
        kept.extend(groups.iter().filter(|group| !groups.iter().any(|o| outvotes(o, group))));
    }

    /// The groups that were not outvoted.
    pub fn kept(&self) -> &[Group] {
        &self.kept
    }

    fn label(&mut self, hits: &[Hit]) {
        self.labels.clear();
        self.labels.resize(hits.len(), FREE);
        self.groups.clear();
        for first in 0..hits.len() {
            if self.labels[first] == FREE {
                self.take(first);
                while let Some(at) = self.open.pop() {
                    for other in 0..hits.len() {
                        let is_free = self.labels[other] == FREE;
                        if is_free && alike(&hits[at].region, &hits[other].region) {
                            self.take(other);
                        }
                    }
                }
                self.groups.push(Group { region: Rect::default(), count: 0, strength: 0.0 });
            }
        }
    }

    fn take(&mut self, window: usize) {
        self.labels[window] = self.groups.len();
        self.open.push(window);
    }

    fn sum_up(&mut self, hits: &[Hit]) {
        for (hit, label) in hits.iter().zip(&self.labels) {
            let Group { region: sum, count, strength } = &mut self.groups[*label];
            let Rect { x, y, width, height } = hit.region;
            *sum = Rect::new(sum.x + x, sum.y + y, sum.width + width, sum.height + height);
            *count += 1;
            *strength += f64::from(hit.margin);
        }
        for Group { region, count, .. } in &mut self.groups {
            // As OpenCV: in 32 bits, by the reciprocal, and halves to the even number.
            let part = 1.0 / *count as f32;
            let mean = |sum: f64| f64::from((sum as f32 * part).round_ties_even());
            let Rect { x, y, width, height } = *region;
            *region = Rect::new(mean(x), mean(y), mean(width), mean(height));
        }
    }
}

/// As [`Grouping::group`], once.
pub fn grouped(hits: &[Hit], fewest: usize) -> Vec<Group> {
    let mut grouping = Grouping::default();
    grouping.group(hits, fewest);
    grouping.kept
}

/// True if a group lies inside of a stronger one.
fn outvotes(outer: &Group, inner: &Group) -> bool {
    let (r, o) = (&inner.region, &outer.region);
    let [dx, dy] = [o.width, o.height].map(|size| (size * ALIKE).round_ties_even());
    let fits = r.x >= o.x - dx
        && r.y >= o.y - dy
        && r.right() <= o.right() + dx
        && r.bottom() <= o.bottom() + dy;
    let is_other = !std::ptr::eq(inner, outer);
    is_other && fits && (outer.count > inner.count.max(FEW) || inner.count < FEW)
}

fn alike(a: &Rect, b: &Rect) -> bool {
    let most = ALIKE * 0.5 * (a.width.min(b.width) + a.height.min(b.height));
    let edges = [a.x - b.x, a.y - b.y, a.right() - b.right(), a.bottom() - b.bottom()];
    edges.iter().all(|off| off.abs() <= most)
}
