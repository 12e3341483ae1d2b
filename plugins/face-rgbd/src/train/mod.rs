//! Trainer of a [`Cascade`]: stage by stage with Gentle AdaBoost, each stage on the false alarms of
//! all stages before it (Viola and Jones 2001; J. Friedman, T. Hastie and R. Tibshirani, *Additive
//! logistic regression*, Annals of Statistics 28, 2000).
//!
//! By default, a tenth of the groups is held out for the calibration and a fifth for the figures of
//! the card; the stages are trained on neither.

mod boost;
mod figures;
mod patch;

use std::sync::Arc;

use boost::{Samples, stage};
use figures::{calibration, figures};
use patch::{Patch, window};
use tagalong_config::{Example, Fitted, Trainer};
use tagalong_core::{Detection, Error, Frame, GreyImage, Result};
use tagalong_geometry::Rect;
use tagalong_learn::{Use, mirrored, mix, shifted, use_of};

use crate::{Cascade, Config, Scanner, Training, scales, whole};

/// Variants of a face with surroundings: a small shift, as parts of its window, a growth, and a
/// turn, as a part of the largest tilt.
const VARIANTS: [((f64, f64, f64), f64); 4] = [
    ((0.0, 0.0, 1.0), 0.0),
    ((0.05, -0.04, 1.06), 1.0),
    ((-0.05, 0.04, 0.94), -1.0),
    ((0.02, 0.06, 1.1), 0.5),
];
/// Overlap (IoU) with a face below which a window is one of others.
const BESIDE: f64 = 0.3;
/// Ratio of the sizes in the search for others.
const SCALE_STEP: f64 = 1.25;
/// Number of pictures at least from which the others of a stage are taken.
const PICTURES: usize = 25;

/// A picture, and the windows of the faces in it.
struct Picture {
    use_: Use,
    grey: Arc<GreyImage>,
    faces: Vec<Rect>,
}

/// Trainer that collects windows and pictures, and trains cascades with them.
///
/// The region of a face's candidate is the window of the face. A picture without faces comes with
/// candidates somewhere in it.
pub struct CascadeTrainer {
    config: Config,
    seed: u64,
    /// Cascade to continue from.
    begun: Cascade,
    faces: Vec<Patch>,
    others: Vec<Patch>,
    pictures: Vec<Picture>,
}

impl CascadeTrainer {
    /// Creates a trainer without examples. It measures and calibrates with the detector's settings,
    /// and continues from a cascade, if there is one: surplus stages are removed, and a complete
    /// cascade is only calibrated and measured again.
    ///
    /// # Errors
    /// [`Error::Settings`] for settings outside their ranges, or a cascade with windows of another
    /// size.
    pub fn new(config: Config, begun: Option<Cascade>, seed: u64) -> Result<Self> {
        config.training.check()?;
        let side = config.training.side;
        let mut begun = begun.unwrap_or_else(|| Cascade::without_stages(side));
        begun.stages.truncate(config.training.stages);
        if (begun.width, begun.height) != (side, side) {
            return Err(Error::Other(format!("windows of the cascade are not {side} wide")));
        }
        let faces = Vec::new();
        let others = Vec::new();
        Ok(Self { config, seed, begun, faces, others, pictures: Vec::new() })
    }

    /// Adds a face, as it is and mirrored; in all variants if the picture shows its surroundings.
    fn add_face(&mut self, grey: &GreyImage, face: &Rect) {
        let Training { side, tilt, .. } = self.config.training;
        let variants = if is_inside(grey, &face.inflated(0.2)) { VARIANTS.len() } else { 1 };
        let mirror = mirrored(grey);
        let flipped = Rect { x: grey.width() as f64 - face.right(), ..*face };
        for (shift, turned) in &VARIANTS[..variants] {
            let both = [(grey, face), (&mirror, &flipped)];
            let cut = both
                .map(|(image, face)| window(image, &shifted(face, *shift), turned * tilt, side));
            self.faces.extend(cut.iter().filter_map(|pixels| Patch::new(pixels, side)));
        }
    }

    /// Adds windows that the cascade takes for faces, from pictures in random order, until there
    /// are enough.
    fn mine(&self, cascade: &Cascade, others: &mut Vec<Patch>, progress: &mut Mined) {
        let wanted = self.config.training.others;
        let mut order: Vec<usize> =
            (0..self.pictures.len()).filter(|i| self.pictures[*i].use_ == Use::Fit).collect();
        let salt = mix(self.seed ^ cascade.stages.len() as u64);
        order.sort_by_key(|index| mix(salt ^ *index as u64));
        let mut scanner = Scanner::default();
        for index in order {
            if others.len() >= wanted {
                break;
            }
            let most = (wanted - others.len()).min(wanted.div_ceil(PICTURES));
            let found = self.mistakes(&mut scanner, cascade, index, most, salt);
            progress.found += found.len();
            others.extend(found);
        }
        progress.looked_at += scanner.looked_at();
    }

    /// Returns up to `most` randomly chosen windows of one picture that the cascade takes for
    /// faces.
    fn mistakes(
        &self,
        scanner: &mut Scanner,
        cascade: &Cascade,
        index: usize,
        most: usize,
        salt: u64,
    ) -> Vec<Patch> {
        let Picture { grey, faces, .. } = &self.pictures[index];
        let side = self.config.training.side;
        let mut found = Vec::new();
        let mut seen = 0_u64;
        let longest = grey.width().min(grey.height()) as f64;
        for scale in scales(cascade, 0.0, longest, SCALE_STEP) {
            scanner.size(
                grey,
                cascade,
                scale,
                &whole(grey),
                &|x, y| {
                    let [x, y, side] = [x, y, side].map(|v| v as f64 * scale);
                    let window = Rect::new(x, y, side, side);
                    faces.iter().all(|face| face.iou(&window) < BESIDE)
                },
                &mut |window| {
                    // Reservoir sampling: all windows have the same chance, though their number is
                    // not known before.
                    seen += 1;
                    let place = mix(salt ^ mix(index as u64) ^ seen) % seen;
                    let place = if found.len() < most { found.len() } else { place as usize };
                    if place < most
                        && let Some(patch) = Patch::of(&window, side)
                    {
                        match found.get_mut(place) {
                            Some(old) => *old = patch,
                            None => found.push(patch),
                        }
                    }
                },
            );
        }
        found
    }

    fn train(&self, progress: &mut dyn FnMut(f64)) -> (Cascade, Vec<Mined>) {
        let Training { stages, others: wanted, fewest_others, .. } = self.config.training;
        let mut faces = self.faces.clone();
        let mut others = self.others.clone();
        others.truncate(wanted);
        let begun = self.begun.stages.len();
        // Further stages are trained without the patches that the existing ones reject.
        for stage in 1..=begun {
            let until =
                Cascade { stages: self.begun.stages[..stage].to_vec(), ..self.begun.clone() };
            faces.retain(|patch| patch.passes_last(&until));
            others.retain(|patch| patch.passes_last(&until));
        }
        let mut cascade = self.begun.clone();
        let mut log = Vec::new();
        for number in begun..stages {
            progress(number as f64 / (stages + 1) as f64);
            let mut mined = Mined::default();
            if number > 0 {
                self.mine(&cascade, &mut others, &mut mined);
            }
            if others.len() < fewest_others {
                break;
            }
            let samples = Samples { faces: &faces, others: &others };
            stage(&mut cascade, &samples, &self.config.training, mix(self.seed ^ number as u64));
            log.push(mined);
            faces.retain(|patch| patch.passes_last(&cascade));
            others.retain(|patch| patch.passes_last(&cascade));
        }
        (cascade, log)
    }
}

/// Statistics of the search for the others of a stage.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Mined {
    found: usize,
    looked_at: u64,
}

impl Trainer for CascadeTrainer {
    fn add(&mut self, frame: &Frame, candidate: &Detection, example: Example) -> Result<()> {
        let grey = frame.grey()?;
        let use_ = use_of(example.group, &self.config.training.calibration);
        if self.pictures.last().is_none_or(|last| *last.grey != *grey) {
            let faces = Vec::new();
            self.pictures.push(Picture { use_, grey: Arc::new(grey.clone()), faces });
        }
        if example.is_person {
            self.pictures
                .last_mut()
                .into_iter()
                .for_each(|p| p.faces.push(candidate.rect_in(&frame.camera)));
        }
        if use_ != Use::Fit {
            return Ok(());
        }
        if example.is_person {
            self.add_face(grey, &candidate.rect_in(&frame.camera));
        } else {
            let pixels =
                window(grey, &candidate.rect_in(&frame.camera), 0.0, self.config.training.side);
            self.others.extend(Patch::new(&pixels, self.config.training.side));
        }
        Ok(())
    }

    fn fit(&mut self, progress: &mut dyn FnMut(f64)) -> Result<Fitted> {
        if self.faces.is_empty() || self.others.is_empty() {
            return Err(Error::Other("faces and windows of others: both are needed".into()));
        }
        let (mut cascade, log) = self.train(progress);
        if cascade.stages.is_empty() {
            return Err(Error::Other("there are too few windows of others".into()));
        }
        cascade.calibration = Some(calibration(&cascade, &self.config, &self.pictures));
        let mut table = figures(&cascade, &self.config, &self.pictures);
        table.insert("windows_of_faces".into(), (self.faces.len() as i64).into());
        let trees = cascade.stages.iter().map(|stage| stage.trees.len() as i64);
        table.insert("trees".into(), trees.collect::<Vec<i64>>().into());
        let mined = log.iter().map(|mined| mined.found as i64);
        table.insert("mined".into(), mined.collect::<Vec<i64>>().into());
        let searched = log.iter().map(|mined| mined.looked_at as i64);
        table.insert("searched".into(), searched.collect::<Vec<i64>>().into());
        progress(1.0);
        Ok(Fitted::new(cascade.to_xml(), table))
    }
}

/// Returns true if a region lies in a picture.
fn is_inside(grey: &GreyImage, region: &Rect) -> bool {
    let width = grey.width() as f64;
    let height = grey.height() as f64;
    region.x >= 0.0 && region.y >= 0.0 && region.right() <= width && region.bottom() <= height
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn a_face_with_surroundings_is_shown_in_all_variants_and_another_as_it_is(
            x in 5.0..40.0f64, y in 5.0..40.0f64, side in 20.0..44.0f64, left in -20.0..0.0f64,
        ) {
            let picture = GreyImage::from_fn(90, 90, |x, y| (x * 37 + y * 91) as u8);
            let mut trainer = CascadeTrainer::new(Config::default(), None, 1).unwrap();
            trainer.add_face(&picture, &Rect::new(x, y, side, side));
            prop_assert_eq!(trainer.faces.len(), 2 * VARIANTS.len());
            trainer.add_face(&picture, &Rect::new(left, y, side, side));
            prop_assert_eq!(trainer.faces.len(), 2 * VARIANTS.len() + 2);
        }
    }

    #[test]
    fn a_region_is_inside_up_to_the_border() {
        let picture = GreyImage::filled(40, 30, 0);
        for (x, y, expected) in [
            (0.0, 0.0, true),
            (-0.1, 0.0, false),
            (0.0, -0.1, false),
            (0.1, 0.0, false),
            (0.0, 0.1, false),
        ] {
            assert_eq!(is_inside(&picture, &Rect::new(x, y, 40.0, 30.0)), expected, "{x} {y}");
        }
    }
}
