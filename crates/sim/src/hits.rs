//! Surfaces that the rays of an image hit. Neighbouring pixels of a row are stored together, so
//! that one instruction reads or writes several of them.

use crate::lanes::{LANES, Lanes};
use crate::world::Hit;

/// First surfaces of the pixels of an image, row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct HitImage {
    width: usize,
    height: usize,
    /// The last group of each row is padded with [`Hit::NOTHING`].
    groups: Vec<HitGroup>,
}

/// First surfaces of [`LANES`] neighbouring pixels of a row, with the fields of [`Hit`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HitGroup {
    /// Distances in multiples of the ray length.
    pub t: Lanes,
    /// Light in each colour channel.
    pub light: [Lanes; 3],
    /// Reflectances in the near infrared.
    pub infrared: Lanes,
    /// Cosines between the normals and the rays back.
    pub facing: Lanes,
    /// Indices of the people.
    pub person: [Option<u16>; LANES],
}

impl HitGroup {
    /// Rays that hit nothing.
    pub const NOTHING: Self = Self {
        t: [f64::INFINITY; LANES],
        light: [[0.0; LANES]; 3],
        infrared: [0.0; LANES],
        facing: [0.0; LANES],
        person: [None; LANES],
    };

    /// Returns the surface of one pixel.
    pub fn at(&self, lane: usize) -> Hit {
        Hit {
            t: self.t[lane],
            light: [self.light[0][lane], self.light[1][lane], self.light[2][lane]],
            infrared: self.infrared[lane],
            facing: self.facing[lane],
            person: self.person[lane],
        }
    }

    /// Sets the surface of one pixel.
    pub fn set(&mut self, lane: usize, hit: &Hit) {
        self.t[lane] = hit.t;
        for (light, channel) in self.light.iter_mut().zip(hit.light) {
            light[lane] = channel;
        }
        self.infrared[lane] = hit.infrared;
        self.facing[lane] = hit.facing;
        self.person[lane] = hit.person;
    }
}

impl HitImage {
    /// Creates an image in which no ray hits anything.
    pub fn nothing(width: usize, height: usize) -> Self {
        let groups = vec![HitGroup::NOTHING; width.div_ceil(LANES) * height];
        Self { width, height, groups }
    }

    /// Returns the number of columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Returns the number of rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Returns the number of groups in a row.
    pub fn row_groups(&self) -> usize {
        self.width.div_ceil(LANES)
    }

    /// Returns the groups of a row.
    pub fn row(&self, y: usize) -> &[HitGroup] {
        &self.groups[y * self.row_groups()..][..self.row_groups()]
    }

    /// Returns all groups, row by row.
    pub fn groups_mut(&mut self) -> &mut [HitGroup] {
        &mut self.groups
    }

    /// Returns the group of a pixel inside the image, and its lane there.
    pub fn group(&self, x: usize, y: usize) -> (&HitGroup, usize) {
        (&self.groups[y * self.row_groups() + x / LANES], x % LANES)
    }

    /// Returns the person in a pixel inside the image.
    pub fn person(&self, x: usize, y: usize) -> Option<u16> {
        let (group, lane) = self.group(x, y);
        group.person[lane]
    }

    /// Returns the surface of a pixel; `None` outside of the image.
    pub fn get(&self, x: i64, y: i64) -> Option<Hit> {
        let x = usize::try_from(x).ok().filter(|x| *x < self.width)?;
        let y = usize::try_from(y).ok().filter(|y| *y < self.height)?;
        let (group, lane) = self.group(x, y);
        Some(group.at(lane))
    }

    /// Creates an image from a function of column and row.
    #[cfg(test)]
    pub fn from_fn(width: usize, height: usize, hit: impl Fn(usize, usize) -> Hit) -> Self {
        let mut image = Self::nothing(width, height);
        let row_groups = image.row_groups();
        for y in 0..height {
            for x in 0..width {
                image.groups[y * row_groups + x / LANES].set(x % LANES, &hit(x, y));
            }
        }
        image
    }

    /// Returns the surfaces of all pixels in row order.
    #[cfg(test)]
    pub fn hits(&self) -> Vec<Hit> {
        let pixels = (0..self.height).flat_map(|y| (0..self.width).map(move |x| (x, y)));
        pixels.filter_map(|(x, y)| self.get(x as i64, y as i64)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_keep_their_surfaces_and_nothing_is_outside() {
        let seen = HitImage::from_fn(37, 5, |x, y| Hit {
            t: x as f64,
            light: [1.0, 2.0, x as f64],
            infrared: y as f64,
            facing: 0.5,
            person: Some((x + 100 * y) as u16),
        });
        assert_eq!((seen.row_groups(), seen.row(4).len(), seen.hits().len()), (3, 3, 37 * 5));
        let hit = seen.get(33, 4).unwrap();
        assert_eq!((hit.t, hit.light, hit.infrared), (33.0, [1.0, 2.0, 33.0], 4.0));
        assert_eq!((hit.facing, hit.person, seen.person(33, 4)), (0.5, Some(433), Some(433)));
        assert_eq!(seen.row(0)[2].at(5), Hit::NOTHING, "a row is padded");
        for (x, y) in [(-1, 0), (37, 0), (0, 5), (0, -1)] {
            assert!(seen.get(x, y).is_none());
        }
    }
}
