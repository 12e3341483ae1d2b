//! Many windows of one face become one (OpenCV's `groupRectangles`).

use tagalong_core::Rect;

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

/// Puts windows into groups: like ones, and those like them, belong together.
/// Groups of `fewest` and less go, and those inside of stronger ones. Groups come
/// in the order of their first windows.
pub fn grouped(hits: &[Hit], fewest: usize) -> Vec<Group> {
    let groups: Vec<Group> =
        members(hits).iter().map(|m| mean(hits, m)).filter(|g| g.count > fewest).collect();
    let is_inside = |inner: &Group| {
        groups.iter().any(|outer| {
            let (r, o) = (&inner.region, &outer.region);
            let (dx, dy) = ((o.width * ALIKE).floor(), (o.height * ALIKE).floor());
            let fits = r.x >= o.x - dx
                && r.y >= o.y - dy
                && r.right() <= o.right() + dx
                && r.bottom() <= o.bottom() + dy;
            let is_other = !std::ptr::eq(inner, outer);
            is_other && fits && (outer.count > inner.count.max(FEW) || inner.count < FEW)
        })
    };
    groups.iter().filter(|group| !is_inside(group)).copied().collect()
}

/// The numbers of the windows of each group.
fn members(hits: &[Hit]) -> Vec<Vec<usize>> {
    let mut free: Vec<usize> = (0..hits.len()).collect();
    let mut groups = Vec::new();
    while !free.is_empty() {
        let mut group = vec![free.remove(0)];
        let mut at = 0;
        while at < group.len() {
            let region = hits[group[at]].region;
            let (like, unlike) = free.iter().partition(|i| alike(&region, &hits[**i].region));
            free = unlike;
            let like: Vec<usize> = like;
            group.extend(like);
            at += 1;
        }
        group.sort_unstable();
        groups.push(group);
    }
    groups
}

fn mean(hits: &[Hit], members: &[usize]) -> Group {
    let count = members.len();
    let of = |value: fn(&Rect) -> f64| {
        let sum: f64 = members.iter().map(|i| value(&hits[*i].region)).sum();
        (sum / count as f64).round()
    };
    let region = Rect::new(of(|r| r.x), of(|r| r.y), of(|r| r.width), of(|r| r.height));
    let strength = members.iter().map(|i| f64::from(hits[*i].margin)).sum();
    Group { region, count, strength }
}

fn alike(a: &Rect, b: &Rect) -> bool {
    let most = ALIKE * 0.5 * (a.width.min(b.width) + a.height.min(b.height));
    let edges = [a.x - b.x, a.y - b.y, a.right() - b.right(), a.bottom() - b.bottom()];
    edges.iter().all(|off| off.abs() <= most)
}
