//! Frames with truth, from simulated rooms and from annotated logs.

use std::path::Path;

use nalgebra::Point2;
use tagalong_app::outcome::Failure;
use tagalong_app::scoring::{Shot as LogShot, Shots, TruthFile, TruthOptions};
use tagalong_core::{Detection, Frame, Funnel};
use tagalong_eval::{Role, Truth};
use tagalong_geometry::Rect;
use tagalong_log::{FrameSource, Input, InputSettings, Inputs, Limits};
use tagalong_sim::Scene;
use tagalong_stereo::{StereoDepth, StereoSettings};
use tagalong_trials::Draw;

/// Frame with the people in it.
pub struct AnnotatedFrame {
    /// The frame.
    pub frame: Frame,
    /// All people, including those that do not count.
    pub people: Vec<Known>,
}

/// True position of a person.
#[derive(Clone, Debug, PartialEq)]
pub struct Known {
    /// ID of the person.
    pub id: i64,
    /// Position below the head, on the floor of the robot frame, m.
    pub floor: Point2<f64>,
    /// Upper body in the image.
    pub region: Option<Rect>,
    /// True if the person counts neither as a miss nor as a false positive.
    pub ignore: bool,
}

/// Label of a candidate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Label {
    /// Head and shoulders of this person.
    Person(i64),
    /// Another part of a person: a backpack, an arm.
    Part,
    /// Too near to a person for a clear label.
    Unclear,
    /// There is no person.
    Nobody,
}

/// Distance on the floor within which a candidate is a person's head, m ...
const SAME_M: f64 = 0.4;
/// ... with at least this overlap of the squares.
const SAME_OVERLAP: f64 = 0.4;
/// Distance to the nearest person beyond which a candidate is a clear negative, m.
const NOBODY_M: f64 = 0.9;

/// Returns the label of a candidate, by the truth.
pub fn label(candidate: &Detection, people: &[Known]) -> Label {
    let at = candidate.position.xy();
    let off = people.iter().map(|known| (known, (known.floor - at).norm()));
    let Some((nearest, off_m)) = off.min_by(|a, b| a.1.total_cmp(&b.1)) else {
        return Label::Nobody;
    };
    let covers_nobody = people.iter().all(|known| overlap_with(known, candidate) < 0.2);
    match off_m {
        m if m <= NOBODY_M && nearest.ignore => Label::Unclear,
        m if m <= SAME_M && overlap_with(nearest, candidate) >= SAME_OVERLAP => {
            Label::Person(nearest.id)
        }
        m if m <= SAME_M => Label::Part,
        m if m > NOBODY_M && covers_nobody => Label::Nobody,
        _ => Label::Unclear,
    }
}

/// The overlap of a candidate with a known person, where both have a region.
fn overlap_with(known: &Known, candidate: &Detection) -> f64 {
    known.region.zip(candidate.rect()).map_or(0.0, |(known, seen)| known.iou(&seen))
}

/// Callback for each frame.
pub type See<'a> = &'a mut dyn FnMut(&AnnotatedFrame) -> Result<(), Failure>;

/// Passes the frames of a simulated scene to `see`. A stereo pair is matched as in a pipeline; a
/// panorama has no depth.
///
/// # Errors
/// Invalid settings, and errors of `see`.
pub fn in_scene(
    scene: &Scene,
    threads: usize,
    stereo: StereoSettings,
    see: See<'_>,
) -> Result<(), Failure> {
    let mut draw = Draw::new(scene, threads);
    let mut stereo = StereoDepth::new(stereo).map_err(Failure::failed)?;
    while let Some(simulated) = draw.next_frame() {
        let people = simulated.truth.iter().map(known).collect();
        let frame = match (simulated.frame.depth(), simulated.frame.right()) {
            (Ok(_), _) | (_, Err(_)) => simulated.frame,
            (Err(_), Ok(_)) => with_depth(simulated.frame, &mut stereo)?,
        };
        see(&AnnotatedFrame { frame, people })?;
    }
    Ok(())
}

fn with_depth(frame: Frame, stereo: &mut StereoDepth) -> Result<Frame, Failure> {
    let depth = stereo.depth(&frame, &mut Funnel::default()).map_err(Failure::failed)?;
    Ok(frame.with_depth(depth))
}

fn known(truth: &tagalong_sim::Truth) -> Known {
    Known {
        id: i64::from(truth.id),
        floor: truth.head_in_robot.xy(),
        region: truth.upper_body,
        ignore: truth.ignore || truth.upper_body.is_none(),
    }
}

/// Passes the frames of an annotated log to `see`.
///
/// # Errors
/// A log or a truth that cannot be used, and errors of `see`.
pub fn in_log(log: &Path, truth: &Path, see: See<'_>) -> Result<(), Failure> {
    let input = InputSettings::default();
    let limits = Limits::default();
    let inputs = Inputs::NONE.require(Input::Colour).require(Input::Depth);
    let truth = TruthFile::read(truth, TruthOptions::default())?;
    let shots = Shots::read(log, &input, &limits)?;
    let mut people = truth.frames(&shots);
    let mut source = FrameSource::open(log, &input, &limits, inputs)?;
    while let Some(item) = source.next_frame() {
        let (truths, _) = people.remove(&LogShot::of(&item).number).unwrap_or_default();
        let people = truths.iter().filter_map(annotated).collect();
        see(&AnnotatedFrame { frame: item.frame, people })?;
    }
    Ok(())
}

fn annotated(truth: &Truth) -> Option<Known> {
    Some(Known {
        id: truth.id,
        floor: truth.floor_m?.into(),
        region: truth.region.map(|r| Rect::new(r.x, r.y, r.width, r.height)),
        ignore: truth.role != Role::Counts,
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Point3};
    use tagalong_geometry::ImageBox;

    use super::*;

    fn known(x: f64, ignore: bool) -> Known {
        let region = Some(Rect::new(100.0, 50.0, 60.0, 60.0));
        Known { id: 7, floor: Point2::new(x, 0.0), region, ignore }
    }

    fn at(x: f64, left: f64) -> Detection {
        Detection::new("test", Point3::new(x, 0.0, 1.6), Matrix3::identity(), 0.0)
            .with_image(ImageBox::upper_body(Rect::new(left, 50.0, 60.0, 60.0)))
    }

    #[test]
    fn candidates_are_labelled_by_place_and_overlap() {
        let people = [known(3.0, false)];
        assert_eq!(label(&at(3.1, 105.0), &people), Label::Person(7));
        assert_eq!(label(&at(3.1, 145.0), &people), Label::Part);
        assert_eq!(label(&at(3.7, 300.0), &people), Label::Unclear);
        assert_eq!(label(&at(5.0, 300.0), &people), Label::Nobody);
        assert_eq!(label(&at(5.0, 110.0), &people), Label::Unclear);
        assert_eq!(label(&at(5.0, 110.0), &[]), Label::Nobody);
        assert_eq!(label(&at(3.1, 105.0), &[known(3.0, true)]), Label::Unclear);
    }
}
