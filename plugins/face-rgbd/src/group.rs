//! Grouping of the windows of one face (OpenCV's `groupRectangles`).

use tagalong_geometry::Rect;

/// Part of their size by which the edges of similar windows may differ.
const ALIKE: f64 = 0.2;
/// Number of windows below which a group inside another one is removed.
const FEW: usize = 3;

/// A window that passed all stages.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// The window, in whole pixels of the image.
    pub region: Rect,
    /// Excess of the sum of the last stage over its threshold.
    pub margin: f32,
}

/// A group of similar windows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Group {
    /// Mean of the windows, rounded to whole pixels.
    pub region: Rect,
    /// Number of windows.
    pub count: usize,
    /// Sum of their margins.
    pub strength: f64,
}

/// Grouping of windows; the memory is reused for the next image.
#[derive(Clone, Debug, Default)]
pub struct Grouping {
    /// Index of the group of each window.
    labels: Vec<usize>,
    /// Windows of the current group with neighbours still to be searched.
    open: Vec<usize>,
    groups: Vec<Group>,
    kept: Vec<Group>,
}

/// Label of a window without a group.
const FREE: usize = usize::MAX;

impl Grouping {
    /// Groups similar windows, and those similar to them. Groups of `fewest` windows or less are
    /// removed, and those inside of stronger ones. Groups are in the order of their first windows.
    pub fn group(&mut self, hits: &[Hit], fewest: usize) {
        self.label(hits);
        self.sum_up(hits);
        self.groups.retain(|group| group.count > fewest);
        let Self { groups, kept, .. } = self;
        kept.clear();
        kept.extend(groups.iter().filter(|group| !groups.iter().any(|o| outvotes(o, group))));
    }

    /// Returns the groups that were not removed.
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
            // As in OpenCV: in 32 bits, by the reciprocal, and halves to the even number.
            let part = 1.0 / *count as f32;
            let [x, y, width, height] = [region.x, region.y, region.width, region.height]
                .map(|sum| f64::from((sum as f32 * part).round_ties_even()));
            *region = Rect::new(x, y, width, height);
        }
    }
}

/// Groups windows as [`Grouping::group`], once.
pub fn grouped(hits: &[Hit], fewest: usize) -> Vec<Group> {
    let mut grouping = Grouping::default();
    grouping.group(hits, fewest);
    grouping.kept
}

/// Returns true if a group lies inside of a stronger one.
fn outvotes(outer: &Group, inner: &Group) -> bool {
    let r = &inner.region;
    let o = &outer.region;
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
