//! Square parts of an image. Their pixels are sorted by the solids that their rays hit, because
//! surfaces are rendered for [`LANES`] pixels of one solid at a time, at any position in the tile.

use nalgebra::{Point3, Vector3};

use crate::hits::HitGroup;
use crate::lanes::{LANES, Lanes, Vectors, points};
use crate::seen::Met;
use crate::shadow::{bits, bounds};
use crate::sight::SightedSolid;
use crate::world::Shading;

/// A tile with buffers that are reused for the next one.
pub struct Tile {
    sorted: SortedTile,
    shading: Shading,
    group: HitGroup,
}

/// Parts of a tile while it is rendered.
pub struct TileParts<'a> {
    /// Pixels.
    pub tile: &'a SortedTile,
    /// Buffer for the solids that may shade it.
    pub shading: &'a mut Shading,
    /// Buffer for pixels of several rows.
    pub group: &'a mut HitGroup,
}

/// Pixels of a tile by the solids that they show.
#[derive(Default)]
pub struct SortedTile {
    /// The first `used` batches belong to this tile.
    batches: Vec<Batch>,
    used: usize,
    /// Entries of batches; those of the same solid follow each other.
    entries: Vec<Entry>,
    /// Rows in which not all pixels show the same solid, with the index of their batch.
    rows: Vec<(u8, u32)>,
    /// Those of these rows with pixels that show nothing.
    open_rows: Vec<u8>,
    /// Pixels of these rows, row by row, and sorted by solid.
    pixels: Vec<Pixel>,
    by_solid: Vec<Pixel>,
    /// Number of pixels of each solid, and then the position of its next one.
    places: Vec<u32>,
}

/// A batch with its solid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Entry {
    /// Index of the solid among those of the tile.
    pub solid: u32,
    batch: u32,
}

/// A pixel in a row that shows several solids.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
struct Pixel {
    solid: u32,
    /// Index of the row among those of its kind.
    row: u8,
    column: u8,
}

/// Rays that hit the same solid, or those of a row that hit different ones.
#[derive(Clone)]
pub struct Batch {
    /// Number of lanes in use, from the first on.
    pub count: usize,
    /// The rays.
    pub rays: Vectors,
    /// Points where they hit the solid.
    pub points: Vectors,
    /// Distances in ray lengths.
    pub t: Lanes,
    /// Row and column of each pixel in the tile.
    places: [[u8; 2]; LANES],
    row: Option<u8>,
}

impl Default for Tile {
    fn default() -> Self {
        let sorted = SortedTile::default();
        Self { sorted, shading: Shading::default(), group: HitGroup::NOTHING }
    }
}

impl Tile {
    /// Casts some columns and rows of rays towards the solids that they may hit; `rays` writes
    /// those of a row.
    pub fn look(
        &mut self,
        solids: &[&SightedSolid<'_>],
        eye: &Point3<f64>,
        [columns, rows]: [usize; 2],
        rays: impl Fn(usize, &mut Vectors),
    ) {
        let tile = &mut self.sorted;
        tile.used = 0;
        tile.entries.clear();
        tile.rows.clear();
        tile.open_rows.clear();
        tile.pixels.clear();
        for row in 0..rows {
            let batch = tile.next_batch();
            rays(row, &mut batch.rays);
            let (met, all_alike) = first(solids, &batch.rays);
            points(eye, &batch.rays, &met.t, &mut batch.points);
            batch.t = met.t;
            let solid = met.number[0];
            if columns == LANES && all_alike && solid != Met::NONE {
                batch.count = LANES;
                batch.row = Some(row as u8);
                tile.keep_batch(solid as u32);
            } else {
                tile.mix(row as u8, &met.number[..columns]);
            }
        }
        tile.sort();
    }

    /// Returns the rows with pixels that show nothing.
    pub fn open_rows(&self) -> impl Iterator<Item = usize> {
        self.sorted.open_rows.iter().map(|number| usize::from(*number))
    }

    /// Returns the parts of the tile that are used together.
    pub fn parts(&mut self) -> TileParts<'_> {
        let Self { sorted, shading, group } = self;
        TileParts { tile: sorted, shading, group }
    }
}

impl SortedTile {
    /// Returns the batches grouped by solid.
    pub fn solids(&self) -> impl Iterator<Item = &[Entry]> {
        self.entries.chunk_by(|one, next| one.solid == next.solid)
    }

    /// Returns a batch.
    pub fn batch(&self, entry: Entry) -> &Batch {
        &self.batches[entry.batch as usize]
    }

    /// Returns the corners of a bounding box of the points of some batches.
    pub fn bounds_of(&self, entries: &[Entry]) -> [Vector3<f64>; 2] {
        let mut low = Vector3::repeat(f64::INFINITY);
        let mut high = -low;
        for entry in entries {
            let batch = self.batch(*entry);
            let (from, to) = bounds(&batch.points, bits(&batch.wanted()));
            low = low.inf(&from);
            high = high.sup(&to);
        }
        [low, high]
    }

    /// Returns the batch after those in use.
    fn next_batch(&mut self) -> &mut Batch {
        if self.used == self.batches.len() {
            self.batches.push(Batch::empty());
        }
        &mut self.batches[self.used]
    }

    fn keep_batch(&mut self, solid: u32) {
        self.entries.push(Entry { solid, batch: self.used as u32 });
        self.used += 1;
    }

    /// Stores the row of the next batch for later, because its pixels show several solids.
    fn mix(&mut self, row: u8, numbers: &[u64]) {
        let place = self.rows.len() as u8;
        self.rows.push((row, self.used as u32));
        self.used += 1;
        let pixels = self.pixels.len();
        for (column, number) in (0..).zip(numbers) {
            if *number != Met::NONE {
                self.pixels.push(Pixel { solid: *number as u32, row: place, column });
            }
        }
        if self.pixels.len() < pixels + LANES {
            self.open_rows.push(row);
        }
    }

    /// Makes batches of the pixels that were stored for later, and sorts all batches.
    fn sort(&mut self) {
        self.sort_pixels();
        let pixels = std::mem::take(&mut self.by_solid);
        for same in pixels.chunk_by(|one, next| one.solid == next.solid) {
            for part in same.chunks(LANES) {
                self.next_batch();
                // The rows that were stored for later are before it.
                let (before, next) = self.batches.split_at_mut(self.used);
                next[0].gather(part, &self.rows, before);
                self.keep_batch(part[0].solid);
            }
        }
        self.by_solid = pixels;
        self.entries.sort_unstable();
    }

    /// Sorts the pixels by solid: there are few solids, and the pixels of each are in order.
    fn sort_pixels(&mut self) {
        let Self { pixels, by_solid, places, .. } = self;
        let solids = pixels.iter().map(|pixel| pixel.solid as usize + 1).max().unwrap_or(0);
        places.clear();
        places.resize(solids, 0);
        pixels.iter().for_each(|pixel| places[pixel.solid as usize] += 1);
        let mut first = 0;
        for place in places.iter_mut() {
            first += std::mem::replace(place, first);
        }
        by_solid.resize(pixels.len(), Pixel::default());
        for pixel in pixels.iter() {
            let place = &mut places[pixel.solid as usize];
            by_solid[*place as usize] = *pixel;
            *place += 1;
        }
    }
}

impl Batch {
    fn empty() -> Self {
        Self {
            count: 0,
            rays: Vectors::ZERO,
            points: Vectors::ZERO,
            t: [0.0; LANES],
            places: [[0; 2]; LANES],
            row: None,
        }
    }

    /// Returns true for each lane in use.
    pub fn wanted(&self) -> [bool; LANES] {
        std::array::from_fn(|lane| lane < self.count)
    }

    /// Returns the row that the batch covers, from its first pixel to its last.
    pub fn whole_row(&self) -> Option<usize> {
        self.row.map(usize::from)
    }

    /// Returns row and column of each pixel of a batch that is not a whole row.
    pub fn places(&self) -> &[[u8; 2]] {
        &self.places[..self.count]
    }

    fn gather(&mut self, pixels: &[Pixel], rows: &[(u8, u32)], batches: &[Self]) {
        self.count = pixels.len();
        self.row = None;
        for (lane, pixel) in pixels.iter().enumerate() {
            let (number, batch) = &rows[usize::from(pixel.row)];
            let row = &batches[*batch as usize];
            let column = usize::from(pixel.column);
            self.places[lane] = [*number, pixel.column];
            self.rays.set(lane, &row.rays.at(column));
            self.points.set(lane, &row.points.at(column));
            self.t[lane] = row.t[column];
        }
    }
}

/// Returns the first solid that each ray of depth one hits, by its index among sorted solids; and
/// true if it is the same for all rays.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn first(sights: &[&SightedSolid<'_>], rays: &Vectors) -> (Met, bool) {
    let mut met = Met::NOTHING;
    for (number, sight) in (0..).zip(sights) {
        if !met.reaches(sight.nearest) {
            break;
        }
        sight.seen.shorten(rays, sight.nearest, number, &mut met);
    }
    let mut differing = 0;
    for lane in 0..LANES {
        differing |= met.number[lane] ^ met.number[0];
    }
    (met, differing == 0)
}
