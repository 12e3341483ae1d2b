//! Checks of the likelihood of a detector, if it has one.

use nalgebra::{Point3, Vector2};
use tagalong_core::{Detector, Error, Frame, Likelihood, Person};

use crate::figure::Figure;
use crate::scenes::{bare_frame, drawn, level, odd_frames};
use crate::subject::{From, Subject};
use crate::verdict::{Check, Verdict, demand};

pub(crate) const CHECKS: &[Check] = &[
    ("likelihood: the true scene outweighs a shifted one", truth_outweighs),
    ("likelihood: the order of people does not matter", order_does_not_matter),
    ("likelihood: many scenes weigh what each weighs alone", batches_agree),
    ("likelihood: is finite on odd scenes", finite),
    ("likelihood: a missing image is named", missing_image_is_named),
];

/// Runs `check` on the detector's likelihood, if there is one.
fn with(subject: &Subject<'_>, check: impl Fn(&dyn Likelihood) -> Verdict) -> Verdict {
    let detector: Box<dyn Detector> = subject.detector(From::Nothing)?;
    detector.likelihood().map_or(Ok(()), check)
}

fn weigh(likelihood: &dyn Likelihood, frame: &Frame, scene: &[Person]) -> Result<f64, String> {
    likelihood.log_likelihood(frame, scene).map_err(|error| format!("it fails: {error}"))
}

fn standing(position: Point3<f64>) -> Person {
    Person { position, velocity: Vector2::zeros() }
}

fn truth_outweighs(subject: &Subject<'_>) -> Verdict {
    with(subject, |likelihood| {
        let figure = Figure::at(2.5, 0.0);
        let frame = drawn(1, &level(), &[figure]);
        let truth = weigh(likelihood, &frame, &[standing(figure.head)])?;
        for (dx, dy) in [(0.0, 0.5), (0.0, -0.5), (0.5, 0.0), (-0.5, 0.0)] {
            let aside = standing(figure.head + nalgebra::Vector3::new(dx, dy, 0.0));
            let shifted = weigh(likelihood, &frame, &[aside])?;
            demand(truth > shifted, || {
                format!("the true scene weighs {truth:.3}, shifted by ({dx}, {dy}) {shifted:.3}")
            })?;
        }
        let nobody = weigh(likelihood, &frame, &[])?;
        demand(nobody.abs() < 1e-9 && truth > nobody, || {
            format!("the empty scene weighs {nobody:.3} (must be 0), the true one {truth:.3}")
        })
    })
}

fn order_does_not_matter(subject: &Subject<'_>) -> Verdict {
    with(subject, |likelihood| {
        let near = Figure::at(2.0, 0.1);
        let far = Figure::at(3.0, -0.1);
        let frame = drawn(1, &level(), &[near, far]);
        let one = weigh(likelihood, &frame, &[standing(near.head), standing(far.head)])?;
        let other = weigh(likelihood, &frame, &[standing(far.head), standing(near.head)])?;
        demand((one - other).abs() <= 1e-9 * one.abs().max(1.0), || format!("{one} and {other}"))
    })
}

fn batches_agree(subject: &Subject<'_>) -> Verdict {
    with(subject, |likelihood| {
        let near = Figure::at(2.0, 0.1);
        let far = Figure::at(3.0, -0.1);
        let frame = drawn(1, &level(), &[near, far]);
        let mut people: Vec<Person> = Vec::new();
        for aside_m in [-0.4, 0.0, 0.4] {
            let aside = far.head + nalgebra::Vector3::new(0.0, aside_m, 0.0);
            people.extend([near.head, aside].map(standing));
        }
        let mut many = Vec::new();
        let asked = likelihood.log_likelihoods(&frame, &people, 2, &mut many);
        asked.map_err(|error| format!("it fails: {error}"))?;
        let one_by_one: Result<Vec<f64>, String> =
            people.chunks(2).map(|scene| weigh(likelihood, &frame, scene)).collect();
        let one_by_one = one_by_one?;
        let agree = many.len() == 3
            && many.iter().zip(&one_by_one).all(|(a, b)| (a - b).abs() <= 1e-9 * b.abs().max(1.0));
        demand(agree, || format!("together {many:?}, one by one {one_by_one:?}"))
    })
}

fn finite(subject: &Subject<'_>) -> Verdict {
    with(subject, |likelihood| {
        let places = [(2.0, 0.0), (-2.0, 0.0), (0.0, 0.0), (40.0, 0.0), (2.0, 30.0)];
        let mut frames = odd_frames();
        frames.push(("drawn", drawn(1, &level(), &[Figure::at(2.0, 0.0)])));
        for (name, frame) in &frames {
            for (x, y) in places {
                let weight = weigh(likelihood, frame, &[standing(Point3::new(x, y, 1.6))])?;
                demand(weight.is_finite(), || {
                    format!("{weight} on the {name} frame for a person at ({x}, {y})")
                })?;
            }
        }
        Ok(())
    })
}

fn missing_image_is_named(subject: &Subject<'_>) -> Verdict {
    with(subject, |likelihood| {
        let scene = [standing(Point3::new(2.0, 0.0, 1.6))];
        match likelihood.log_likelihood(&bare_frame(), &scene) {
            Err(Error::MissingImage { .. }) => Ok(()),
            Err(error) => Err(format!("the error does not name the image: {error}")),
            Ok(weight) => Err(format!("it weighs {weight} without any image")),
        }
    })
}
