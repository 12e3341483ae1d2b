//! Photographs without depth: crops of people, and pictures without people.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use nalgebra::{Matrix3, Point3};
use tagalong_app::outcome::Failure;
use tagalong_config::Example;
use tagalong_core::{Detection, EgoMotion, Frame, GreyImage, Images, Stamp};
use tagalong_geometry::{Camera, Distortion, ImageBox, Pinhole, Rect};

use tagalong_math::{RandomSource, SplitMix64};

/// Number of squares that are cut from a photograph without people.
const SQUARES: usize = 2;

/// Body in a crop of INRIA: 96 of 128 rows, from row 16 on.
const INRIA_BODY: Rect = Rect::new(0.0, 16.0, 64.0, 96.0);
/// Assumed height of a body, m.
const STANDING_M: f64 = 1.7;

/// Callback for the candidates of a photograph.
pub type Take<'a> = &'a mut dyn FnMut(&Frame, &Detection, Example) -> Result<(), Failure>;

/// Photograph, with or without a person.
pub struct Photo {
    path: PathBuf,
    kind: Kind,
    /// Group, which similar photographs have in common.
    pub group: u64,
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Body,
    Bust,
    Nobody,
}

/// Returns the photographs of a folder of data, in order, either the held-out ones or the others.
pub fn photos(data: &Path, held_out: bool) -> Vec<Photo> {
    let mut all = Vec::new();
    let folders = [
        ("people/inria-64x128/pos", Kind::Body),
        ("people/inria-64x128/neg", Kind::Nobody),
        ("negatives", Kind::Nobody),
    ];
    for (folder, kind) in folders {
        let files = pictures(&data.join(folder));
        let groups = match kind {
            Kind::Body => runs(&files),
            _ => files.iter().map(|path| fingerprint(&photograph(path))).collect(),
        };
        let each = files.into_iter().zip(groups);
        all.extend(each.map(|(path, group)| Photo { path, kind, group }));
    }
    all.extend(busts(&data.join("people/head-shoulder-50")));
    // Whole groups are held out, so that no person is in both parts.
    all.retain(|photo| (photo.group % 5 == 0) == held_out);
    all
}

fn pictures(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut files: Vec<PathBuf> = entries
        .map(|entry| entry.path())
        .filter(|path| {
            path.extension().and_then(|e| e.to_str()).is_some_and(|e| ["jpg", "png"].contains(&e))
        })
        .collect();
    files.sort();
    files
}

/// Returns the photograph of a crop: a crop has its name with a letter or a number appended.
fn photograph(path: &Path) -> String {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let name = match stem.rsplit_once('_') {
        Some((name, number)) if number.parse::<u32>().is_ok() => name,
        _ => stem.trim_end_matches(|c: char| c.is_ascii_lowercase()),
    };
    name.to_owned()
}

/// Returns the groups of crops: photographs with consecutive numbers are in the same group, because
/// they were taken one after another and often show the same people.
fn runs(crops: &[PathBuf]) -> Vec<u64> {
    fn numbered(path: &Path) -> (String, u64) {
        let name = photograph(path);
        let series = name.trim_end_matches(|c: char| c.is_ascii_digit()).to_owned();
        let number = name[series.len()..].parse().unwrap_or(0_u64);
        (series, number)
    }

    let taken: BTreeSet<(String, u64)> = crops.iter().map(|crop| numbered(crop)).collect();
    let runs = crops.iter().map(|crop| {
        let (series, number) = numbered(crop);
        let first = std::iter::successors(Some(number), |number: &u64| {
            let before = number.checked_sub(1)?;
            taken.contains(&(series.clone(), before)).then_some(before)
        })
        .last();
        fingerprint(&format!("{series}{}", first.unwrap_or(number)))
    });
    runs.collect()
}

/// Returns the hash of a name (FNV-1a).
pub fn fingerprint(name: &str) -> u64 {
    name.bytes().fold(0xCBF2_9CE4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01B3)
    })
}

/// Returns the crops of heads and shoulders; near-duplicates and mirror images share a group.
fn busts(folder: &Path) -> Vec<Photo> {
    let files: Vec<(PathBuf, GreyImage)> = pictures(folder)
        .into_iter()
        .filter_map(|path| Some((path.clone(), read(&path).ok()?)))
        .collect();
    let looks: Vec<PictureSignature> =
        files.iter().map(|(_, image)| PictureSignature::of(image)).collect();
    let mut group_of: Vec<usize> = (0..files.len()).collect();
    for i in 0..files.len() {
        for j in 0..i {
            if group_of[i] != group_of[j] && looks[i].is_like(&looks[j]) {
                // Whole groups are merged: likeness of pairs is not transitive, membership has to
                // be.
                let from = group_of[i];
                let to = group_of[j];
                group_of.iter_mut().filter(|g| **g == from).for_each(|g| *g = to);
            }
        }
    }
    let each = files.into_iter().zip(group_of);
    each.map(|((path, _), group)| Photo {
        path,
        kind: Kind::Bust,
        group: fingerprint(&format!("bust {group}")),
    })
    .collect()
}

/// Signature of a picture from a small version of it, which tolerates a shift by a few pixels.
struct PictureSignature {
    middle: Patch,
    /// All patches of that size of the picture, and of its mirror image.
    all: Vec<Patch>,
}

/// Brightness of [`PictureSignature::PATCH`] columns and rows, of unit length and without its mean.
type Patch = [f32; PictureSignature::PATCH * PictureSignature::PATCH];

impl PictureSignature {
    /// Columns and rows of the small version ...
    const SMALL: usize = 16;
    /// ... and of its patches.
    const PATCH: usize = 12;
    /// Correlation above which patches show the same picture, or people so similar that it does no
    /// harm to keep them in one group. Chosen by eye.
    const ALIKE: f32 = 0.86;

    fn of(image: &GreyImage) -> Self {
        let small = mean_cells(image, Self::SMALL, Self::SMALL);
        let room = Self::SMALL - Self::PATCH;
        let mut all = Vec::new();
        for top in 0..=room {
            for left in 0..=room {
                all.extend([false, true].map(|turned| Self::patch_at(&small, left, top, turned)));
            }
        }
        Self { middle: Self::patch_at(&small, room / 2, room / 2, false), all }
    }

    /// A part of the small image, mirrored or not.
    fn patch_at(small: &[f32], left: usize, top: usize, is_mirrored: bool) -> Patch {
        patch(|x, y| {
            let across = if is_mirrored { Self::PATCH - 1 - x } else { x };
            small[(top + y) * Self::SMALL + left + across]
        })
    }

    fn is_like(&self, other: &Self) -> bool {
        fn product(a: &Patch, b: &Patch) -> f32 {
            a.iter().zip(b).map(|(a, b)| a * b).sum::<f32>()
        }

        self.all.iter().any(|patch| product(patch, &other.middle) >= Self::ALIKE)
            || other.all.iter().any(|patch| product(patch, &self.middle) >= Self::ALIKE)
    }
}

fn patch(brightness: impl Fn(usize, usize) -> f32) -> Patch {
    let mut patch = std::array::from_fn(|at| {
        brightness(at % PictureSignature::PATCH, at / PictureSignature::PATCH)
    });
    to_unit_length(&mut patch);
    patch
}

/// Subtracts the mean, and scales the rest to unit length.
pub fn to_unit_length(values: &mut [f32]) {
    let mean = values.iter().sum::<f32>() / values.len() as f32;
    values.iter_mut().for_each(|v| *v -= mean);
    // An even patch has no length to divide by.
    let length = values.iter().map(|v| v * v).sum::<f32>().sqrt().max(1e-6);
    values.iter_mut().for_each(|v| *v /= length);
}

/// Returns the mean brightness in each cell of a grid over an image, row by row.
pub fn mean_cells(image: &GreyImage, columns: usize, rows: usize) -> Vec<f32> {
    fn part(i: usize, of: usize, size: usize) -> std::ops::Range<usize> {
        let from = i * size / of;
        from..((i + 1) * size / of).max(from + 1)
    }
    let means = (0..columns * rows).map(|at| {
        let xs = part(at % columns, columns, image.width());
        let ys = part(at / columns, rows, image.height());
        let count = (xs.len() * ys.len()) as f32;
        ys.map(|y| image.row(y)[xs.clone()].iter().map(|v| f32::from(*v)).sum::<f32>()).sum::<f32>()
            / count
    });
    means.collect()
}

/// Reads a picture as grey values.
///
/// # Errors
/// A file that is not a picture.
pub fn read(path: &Path) -> Result<GreyImage, Failure> {
    let image = image::open(path)
        .map_err(|error| Failure::failed(format!("{}: {error}", path.display())))?
        .into_luma8();
    let width = image.width() as usize;
    let height = image.height() as usize;
    Ok(GreyImage::from_pixels(width, height, image.into_raw()).unwrap_or_default())
}

impl Photo {
    /// Returns true if it shows a person from head to feet.
    #[cfg(test)]
    pub fn is_body(&self) -> bool {
        self.kind == Kind::Body
    }

    /// Returns true if it shows a person.
    pub fn is_person(&self) -> bool {
        self.kind != Kind::Nobody
    }

    /// Passes its candidates to `take`; those of pictures without people differ between rounds.
    ///
    /// # Errors
    /// A picture that cannot be read, and errors of `take`.
    pub fn visit(&self, round: u64, take: Take<'_>) -> Result<(), Failure> {
        let grey = read(&self.path)?;
        let example = Example { is_person: self.is_person(), group: self.group };
        let squares = self.squares(&grey, round);
        let frame = frame(grey);
        squares.into_iter().try_for_each(|region| take(&frame, &candidate(region), example))
    }

    fn squares(&self, grey: &GreyImage, round: u64) -> Vec<Rect> {
        let width = grey.width() as f64;
        let height = grey.height() as f64;
        match self.kind {
            Kind::Body => {
                let scale = height / 128.0;
                let aside = 0.5 * (width - 64.0 * scale);
                let r = INRIA_BODY;
                let body = Rect::new(aside, scale * r.y, scale * r.width, scale * r.height);
                vec![body.upper_body_of_standing(STANDING_M)]
            }
            Kind::Bust => vec![Rect::new(0.0, 0.0, width, height).inflated(-0.08)],
            Kind::Nobody => {
                // The squares differ between rounds, but not between runs.
                let mut chance = SplitMix64::new(self.group ^ round);
                let least = width.min(height).min(40.0);
                let most = (0.6 * width.min(height)).max(least);
                let count = if width < 200.0 { 1 } else { SQUARES };
                (0..count)
                    .map(|_| {
                        let side = chance.between(least, most);
                        let x = chance.between(0.0, width - side);
                        let y = chance.between(0.0, height - side);
                        Rect::new(x, y, side, side)
                    })
                    .collect()
            }
        }
    }
}

/// Returns a picture as a frame of a nominal camera.
pub fn frame(grey: GreyImage) -> Frame {
    let width = grey.width();
    let height = grey.height();
    let cx = 0.5 * width as f64;
    let cy = 0.5 * height as f64;
    let lens = Pinhole { fx: 500.0, fy: 500.0, cx, cy, distortion: Distortion::None };
    let camera = Arc::new(Camera::mounted(lens, width, height, 1.2, 0.0, 0.0));
    let images = Images { grey: Some(Arc::new(grey)), ..Images::default() };
    Frame::new(1, Stamp::default(), camera, EgoMotion::at_rest(0.0), images)
}

/// Returns a candidate for which only the region is known.
pub fn candidate(region: Rect) -> Detection {
    let position = Point3::new(2.0, 0.0, 1.6);
    let covariance = Matrix3::identity();
    Detection::new("photograph", position, covariance, 0.0).with_image(ImageBox::upper_body(region))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crops_of_one_photograph_are_one_group() {
        for (one, other, are_same) in [
            ("crop001248a.png", "crop001248c.png", true),
            ("125_8.jpg", "125_11.jpg", true),
            ("125_8.jpg", "126_8.jpg", false),
        ] {
            let [one, other] = [one, other].map(|name| photograph(Path::new(name)));
            assert_eq!(one == other, are_same, "{one} {other}");
        }
    }

    #[test]
    fn photographs_one_after_the_other_are_one_group() {
        let names = ["crop001248a", "crop001248c", "crop001249a", "crop001251a", "person_249b"];
        let groups = runs(&names.map(|name| PathBuf::from(name).with_extension("png")));
        assert_eq!([groups[0]; 3], groups[..3]);
        assert!(groups[3] != groups[0] && groups[4] != groups[0] && groups[4] != groups[3]);
    }

    #[test]
    fn mirror_images_and_other_cuts_look_alike() {
        fn wave(at: f64) -> f64 {
            60.0 * at.sin()
        }

        let image = GreyImage::from_fn(50, 50, |x, y| {
            let x = x as f64;
            let y = y as f64;
            (127.0 + wave(x / 7.0) + wave(y / 6.0 + x / 19.0)) as u8
        });
        let mirrored = GreyImage::from_fn(50, 50, |x, y| image.row(y)[49 - x]);
        let other = GreyImage::from_fn(50, 50, |x, y| ((x * 31 + y * y * 3) % 253) as u8);
        let aside = GreyImage::from_fn(46, 47, |x, y| mirrored.row(y + 3)[x + 4]);
        let looks = PictureSignature::of(&image);
        assert!(
            looks.is_like(&PictureSignature::of(&mirrored))
                && looks.is_like(&PictureSignature::of(&aside))
        );
        assert!(!looks.is_like(&PictureSignature::of(&other)));
    }
}
