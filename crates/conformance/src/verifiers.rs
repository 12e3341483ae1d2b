//! Checks of verifiers.

use tagalong_core::{Detection, Error, Frame, Verifier};
use tagalong_geometry::{ImageBox, Rect};
use tagalong_math::SplitMix64;

use crate::figure::Figure;
use crate::scenes::{bare_frame, drawn, level, odd_frames, required, restricted, sighting};
use crate::subject::{From, Subject};
use crate::verdict::{Check, Verdict, demand};

pub(crate) const CHECKS: &[Check] = &[
    ("never panics on odd frames", odd_frames_are_survived),
    ("a missing image is an error that names it", missing_image_is_named),
    ("images that it does not declare do not matter", undeclared_do_not_matter),
    ("it does without what it does not require", required_suffice),
    ("same seed, same output", repeatable),
    ("the same candidate gets the same margin", same_margin),
];

fn margin(
    verifier: &mut dyn Verifier,
    frame: &Frame,
    candidate: &Detection,
) -> Result<f64, String> {
    let outcome = verifier.log_odds(frame, candidate);
    let margin = outcome.map_err(|error| format!("it fails on {:?}: {error}", candidate.image))?;
    demand(margin.is_finite(), || format!("margin {margin} for {:?}", candidate.image))?;
    Ok(margin)
}

/// Returns candidates on, beside and away from the person, of odd sizes, and without a box.
fn candidates() -> Vec<Detection> {
    let figure = Figure::at(2.0, 0.1);
    let good = sighting(&figure.head, &level(), 0.02, &mut SplitMix64::new(1));
    let r = good.rect_in(&level());
    let regions = [
        r,
        Rect::new(r.x + 90.0, r.y, r.width, r.height),
        Rect::new(r.x, r.y, 0.0, 0.0),
        Rect::new(r.x + 0.3, r.y + 0.6, 0.5, 0.5),
        Rect::new(-500.0, -500.0, 20.0, 20.0),
        Rect::new(-1e6, -1e6, 2e6, 2e6),
        Rect::new(600.0, 440.0, 200.0, 200.0),
    ];
    let boxes = regions.into_iter().map(ImageBox::upper_body).map(Some).chain([None]);
    boxes.map(|image| good.clone().with_image(image)).collect()
}

fn odd_frames_are_survived(subject: &Subject<'_>) -> Verdict {
    let verifier = &mut *subject.verifier(From::Nothing)?;
    for (name, frame) in odd_frames() {
        for candidate in candidates() {
            margin(verifier, &frame, &candidate).map_err(|what| format!("{name} frame: {what}"))?;
        }
    }
    Ok(())
}

fn missing_image_is_named(subject: &Subject<'_>) -> Verdict {
    let verifier = &mut *subject.verifier(From::Nothing)?;
    match verifier.log_odds(&bare_frame(), &candidates()[0]) {
        Err(Error::MissingImage { .. }) => Ok(()),
        Err(error) => Err(format!("the error does not name the image: {error}")),
        Ok(margin) => {
            demand(margin.is_finite(), || format!("margin {margin} in a frame without images"))
        }
    }
}

fn margins(verifier: &mut dyn Verifier, frame: &Frame) -> Result<Vec<f64>, String> {
    candidates().iter().map(|candidate| margin(verifier, frame, candidate)).collect()
}

fn undeclared_do_not_matter(subject: &Subject<'_>) -> Verdict {
    fn frame() -> Frame {
        drawn(1, &level(), &[Figure::at(2.0, 0.1)])
    }

    let verifier = &mut *subject.verifier(From::Nothing)?;
    let declared = restricted(frame(), &verifier.inputs());
    let whole = margins(verifier, &frame())?;
    let declared = margins(verifier, &declared)?;
    demand(whole == declared, || {
        format!("{whole:?} with images that it does not declare, {declared:?} without")
    })
}

fn required_suffice(subject: &Subject<'_>) -> Verdict {
    let verifier = &mut *subject.verifier(From::Nothing)?;
    let inputs = required(&verifier.inputs());
    let frame = restricted(drawn(1, &level(), &[Figure::at(2.0, 0.1)]), &inputs);
    margins(verifier, &frame).map(drop)
}

fn repeatable(subject: &Subject<'_>) -> Verdict {
    let frame = drawn(1, &level(), &[Figure::at(2.0, 0.1)]);
    let defaults = subject.info.defaults();
    let first = margins(&mut *subject.verifier(From::Nothing)?, &frame)?;
    let second = margins(&mut *subject.verifier(From::Text(&defaults))?, &frame)?;
    demand(first == second, || format!("two runs differ: {first:?} and {second:?}"))
}

fn same_margin(subject: &Subject<'_>) -> Verdict {
    let verifier = &mut *subject.verifier(From::Nothing)?;
    let frame = drawn(1, &level(), &[Figure::at(2.0, 0.1)]);
    let first = margins(verifier, &frame)?;
    let again = margins(verifier, &frame)?;
    demand(first == again, || format!("asked twice, it says {first:?} and {again:?}"))
}
