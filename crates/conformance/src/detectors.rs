//! Checks of detectors.

use std::sync::Arc;

use nalgebra::Point3;
use tagalong_core::{
    Detection, Detector, Error, Frame, Funnel, Inputs, Query, TRACKER_TESTS, Usage,
};
use tagalong_geometry::Camera;

use crate::figure::Figure;
use crate::findings::{Findings, corners};
use crate::scenes::{bare_frame, drawn, level, mountings, odd_frames, required, restricted, track};
use crate::subject::{From, Subject};
use crate::verdict::{Check, Verdict, demand};

pub(crate) const CHECKS: &[Check] = &[
    ("never panics on odd frames", odd_frames_are_survived),
    ("a missing image is an error that names it", missing_image_is_named),
    ("images that it does not declare do not matter", undeclared_do_not_matter),
    ("it does without what it does not require", required_suffice),
    ("it has the roles that it declares and no others", roles_are_declared),
    ("same seed, same output", repeatable),
    ("who does not remember answers the question alone", question_alone),
    ("regions lie in the image", regions_are_in_the_image),
    ("covariance is symmetric and positive", covariance_is_positive),
    ("near results lie in the window", near_stays_near),
    ("an empty scene stays empty", empty_stays_empty),
    ("one person at 2 m is found", person_is_found),
    ("a person is found near their track", person_is_followed),
    ("people who left are forgotten", forgets),
    ("its tests have names of their own", tests_have_own_names),
];

const EVERYWHERE: Query<'_> = Query::Discover { occupied: &[] };

/// Result of a search, or the absence of an image that the simulation does not provide.
enum SearchOutcome {
    People(Vec<Detection>),
    Lacks,
}

fn look(
    detector: &mut dyn Detector,
    frame: &Frame,
    query: &Query<'_>,
) -> Result<SearchOutcome, String> {
    match detector.detect(frame, query, &mut Funnel::default()) {
        Ok(people) => Ok(SearchOutcome::People(people)),
        Err(Error::MissingImage { .. }) => Ok(SearchOutcome::Lacks),
        Err(error) => Err(format!("it fails on a simulated frame: {error}")),
    }
}

fn people(
    detector: &mut dyn Detector,
    frame: &Frame,
    query: &Query<'_>,
) -> Result<Vec<Detection>, String> {
    Ok(match look(detector, frame, query)? {
        SearchOutcome::People(people) => people,
        SearchOutcome::Lacks => Vec::new(),
    })
}

fn odd_frames_are_survived(subject: &Subject<'_>) -> Verdict {
    let mut detector = subject.detector(From::Nothing)?;
    let lost = track(1, Point3::new(2.0, 0.0, 1.6), 0.2, &level());
    for (name, frame) in odd_frames() {
        for query in [EVERYWHERE, Query::Track(&lost)] {
            let outcome = detector.detect(&frame, &query, &mut Funnel::default());
            demand(is_survived(&outcome, &frame), || match &outcome {
                Err(error) => format!("the {name} frame is an error: {error}"),
                Ok(_) => String::new(),
            })?;
            let sane = outcome.iter().flatten().all(Detection::is_sane);
            demand(sane, || format!("the {name} frame gives numbers that are not finite"))?;
        }
        let learned = detector.learn(&frame, std::slice::from_ref(&lost));
        learned.map_err(|error| format!("learning from the {name} frame is an error: {error}"))?;
    }
    Ok(())
}

/// Returns true for a result, and for the error that names an input that the frame does not have:
/// the simulation has no data for a detector of another sensor.
fn is_survived(outcome: &Result<Vec<Detection>, Error>, frame: &Frame) -> bool {
    match outcome {
        Ok(_) => true,
        Err(Error::MissingImage { input }) => !frame.holds(*input),
        Err(_) => false,
    }
}

fn missing_image_is_named(subject: &Subject<'_>) -> Verdict {
    let mut detector = subject.detector(From::Nothing)?;
    let lost = track(1, Point3::new(2.0, 0.0, 1.6), 0.2, &level());
    for query in [EVERYWHERE, Query::Track(&lost)] {
        match detector.detect(&bare_frame(), &query, &mut Funnel::default()) {
            Err(Error::MissingImage { .. }) => {}
            Ok(found) if found.is_empty() => {}
            Err(error) => return Err(format!("the error does not name the image: {error}")),
            Ok(_) => return Err("it finds people in a frame without images".into()),
        }
    }
    Ok(())
}

/// Simulates two people, one of them walking to the side, over four frames.
fn walk(camera: &Arc<Camera>) -> Vec<Frame> {
    let steps = 0..4u64;
    steps
        .map(|i| {
            let walker = Figure::at(3.0, -0.6 + 0.05 * i as f64);
            drawn(i + 1, camera, &[Figure::at(2.0, 0.4), walker])
        })
        .collect()
}

/// Returns all detections of a detector in the frames of the walk.
fn record(detector: &mut dyn Detector, frames: &[Frame]) -> Result<Vec<Detection>, String> {
    let followed = track(1, Figure::at(2.0, 0.4).head, 0.15, &frames[0].camera);
    let mut all = Vec::new();
    for frame in frames {
        all.extend(people(detector, frame, &Query::Track(&followed))?);
        all.extend(people(detector, frame, &EVERYWHERE)?);
        let learned = detector.learn(frame, std::slice::from_ref(&followed));
        learned.map_err(|error| format!("learning is an error: {error}"))?;
    }
    Ok(all)
}

fn declared(subject: &Subject<'_>) -> Result<Inputs, String> {
    Ok(subject.detector(From::Nothing)?.capabilities().inputs)
}

fn undeclared_do_not_matter(subject: &Subject<'_>) -> Verdict {
    let frames = walk(&level());
    let inputs = declared(subject)?;
    let whole = record(&mut *subject.detector(From::Nothing)?, &frames)?;
    let frames: Vec<Frame> = frames.into_iter().map(|frame| restricted(frame, &inputs)).collect();
    let declared = record(&mut *subject.detector(From::Nothing)?, &frames)?;
    demand(whole == declared, || {
        let with = whole.len();
        let without = declared.len();
        format!("{with} detections with images that it does not declare, {without} without")
    })
}

fn required_suffice(subject: &Subject<'_>) -> Verdict {
    let inputs = required(&declared(subject)?);
    let camera = level();
    let lost = track(1, Point3::new(2.0, 0.0, 1.6), 0.2, &camera);
    let detector = &mut *subject.detector(From::Nothing)?;
    for frame in walk(&camera).into_iter().map(|frame| restricted(frame, &inputs)) {
        if !inputs.of(Usage::Required).all(|input| frame.holds(input)) {
            return Ok(());
        }
        for query in [EVERYWHERE, Query::Track(&lost)] {
            if let Err(error) = detector.detect(&frame, &query, &mut Funnel::default()) {
                return Err(format!("with the inputs that it requires: {error}"));
            }
        }
    }
    Ok(())
}

fn roles_are_declared(subject: &Subject<'_>) -> Verdict {
    let detector = &mut *subject.detector(From::Nothing)?;
    let capabilities = detector.capabilities();
    let has_likelihood = detector.likelihood().is_some();
    demand(capabilities.weighs == has_likelihood, || {
        format!(
            "it declares `weighs: {}`, and its likelihood is there: {has_likelihood}",
            capabilities.weighs
        )
    })?;
    let camera = level();
    let followed = track(1, Figure::at(2.0, 0.4).head, 0.15, &camera);
    for frame in walk(&camera) {
        let everywhere = EVERYWHERE;
        let near = Query::Track(&followed);
        let roles = [
            ("discovers", capabilities.discovers, everywhere),
            ("tracks", capabilities.tracks, near),
        ];
        for (role, is_declared, query) in roles {
            let found = people(detector, &frame, &query)?;
            demand(is_declared || found.is_empty(), || {
                format!("it finds people and declares `{role}: false`")
            })?;
        }
        let learned = detector.learn(&frame, std::slice::from_ref(&followed));
        learned.map_err(|error| format!("learning is an error: {error}"))?;
    }
    Ok(())
}

fn repeatable(subject: &Subject<'_>) -> Verdict {
    let frames = walk(&level());
    let defaults = subject.info.defaults();
    let first = record(&mut *subject.detector(From::Nothing)?, &frames)?;
    let second = record(&mut *subject.detector(From::Text(&defaults))?, &frames)?;
    demand(first == second, || {
        format!("two runs differ: {} and {} detections", first.len(), second.len())
    })
}

/// Compares a detector that has processed the whole walk with a new one.
fn question_alone(subject: &Subject<'_>) -> Verdict {
    let mut seasoned = subject.detector(From::Nothing)?;
    if seasoned.remembers() {
        return Ok(());
    }
    let frames = walk(&level());
    record(&mut *seasoned, &frames)?;
    let followed = track(1, Figure::at(3.0, -0.6).head, 0.15, &level());
    for frame in frames.iter().rev() {
        for query in [EVERYWHERE, Query::Track(&followed)] {
            let mut fresh = subject.detector(From::Nothing)?;
            let [then, now] = [&mut *fresh, &mut *seasoned].map(|detector| {
                let mut funnel = Funnel::default();
                (detector.detect(frame, &query, &mut funnel).map_err(|e| e.to_string()), funnel)
            });
            demand(then == now, || {
                format!("frame {}: a fresh one says {then:?}, after the walk {now:?}", frame.index)
            })?;
        }
    }
    Ok(())
}

/// Returns all detections of the walk under each mounting.
fn all_detections(subject: &Subject<'_>) -> Result<Vec<(Arc<Camera>, Detection)>, String> {
    let mut all = Vec::new();
    for (_, camera) in mountings() {
        let detector = &mut *subject.detector(From::Nothing)?;
        let found = record(detector, &walk(&camera))?;
        all.extend(found.into_iter().map(|detection| (Arc::clone(&camera), detection)));
    }
    Ok(all)
}

fn regions_are_in_the_image(subject: &Subject<'_>) -> Verdict {
    for (camera, detection) in all_detections(subject)? {
        // A detection without a box, such as that of a laser scan, gives no information about the
        // image.
        let Some(region) = detection.rect() else { continue };
        let inside = region.clipped(camera.width, camera.height).area();
        // Upper-body squares are amodal and may exceed the image, but not without limit.
        let amodal = 4.0 * (camera.width * camera.height) as f64;
        demand(region.is_sane() && inside > 0.0 && region.area() <= amodal, || {
            format!("{region:?} in an image of {}x{}", camera.width, camera.height)
        })?;
    }
    Ok(())
}

fn covariance_is_positive(subject: &Subject<'_>) -> Verdict {
    for (_, detection) in all_detections(subject)? {
        let covariance = detection.covariance;
        // Allows for the rounding of a rotation.
        let skew = (covariance - covariance.transpose()).abs().max();
        let positive = skew <= 1e-9 * covariance.norm() && covariance.cholesky().is_some();
        demand(positive, || format!("covariance {covariance:?}"))?;
        demand(detection.is_sane(), || format!("not finite: {detection:?}"))?;
    }
    Ok(())
}

/// Simulates two people 1.6 m apart: a search for one must not return the other.
fn near_stays_near(subject: &Subject<'_>) -> Verdict {
    let sigma_m = 0.15;
    let window_m = 0.8;
    for (name, camera) in mountings() {
        let detector = &mut *subject.detector(From::Nothing)?;
        let couple = [Figure::at(2.6, 0.8), Figure::at(2.6, -0.8)];
        let frame = drawn(1, &camera, &couple);
        for wanted in [couple[0].head, couple[1].head, Point3::new(1.8, 0.0, 1.6)] {
            let lost = track(1, wanted, sigma_m, &camera);
            for found in people(detector, &frame, &Query::Track(&lost))? {
                let away = (found.position.xy() - wanted.xy()).norm();
                demand(away <= window_m, || {
                    format!(
                        "camera {name}: {away:.2} m away from a track known to {sigma_m} m; \
                         `Query::Track` asks for this one person, and a detector that only \
                         discovers answers it with no detection"
                    )
                })?;
            }
        }
    }
    Ok(())
}

fn empty_stays_empty(subject: &Subject<'_>) -> Verdict {
    for (name, camera) in mountings() {
        let detector = &mut *subject.detector(From::Nothing)?;
        let lost = track(1, Figure::at(2.0, 0.0).head, 0.2, &camera);
        for index in 1..=3 {
            let frame = drawn(index, &camera, &[]);
            let mut found = people(detector, &frame, &EVERYWHERE)?;
            found.extend(people(detector, &frame, &Query::Track(&lost))?);
            believed_empty(&found, name)?;
        }
    }
    Ok(())
}

/// Checks that no detection is more likely a person than not.
fn believed_empty(found: &[Detection], scene: &str) -> Verdict {
    match found.iter().find(|d| d.score > 0.0) {
        Some(d) => Err(format!("{scene}: nobody is at {:.2}, score {:.2}", d.position, d.score)),
        None => Ok(()),
    }
}

fn person_is_found(subject: &Subject<'_>) -> Verdict {
    if !subject.must_discover {
        return Ok(());
    }
    for (name, camera) in mountings() {
        let detector = &mut *subject.detector(From::Nothing)?;
        for turned_rad in [0.0, std::f64::consts::FRAC_PI_2, std::f64::consts::PI] {
            let mut figure = Figure::at(2.0, 0.1);
            figure.heading_rad += turned_rad;
            let scene = format!("camera {name}, person turned by {turned_rad:.1} rad");
            let frame = drawn(1, &camera, &[figure]);
            let findings = Findings::ask(detector, &frame, &EVERYWHERE, figure)?;
            // Other candidates are allowed if they are not more likely people than not.
            let believed = findings.believed();
            demand(believed.len() == 1, || {
                format!("{scene}: {} found: {}", believed.len(), findings.words())
            })?;
            is_at(believed[0], &figure, &camera).map_err(|what| format!("{scene}: {what}"))?;
        }
    }
    Ok(())
}

/// Checks that a detection matches the person in position and region.
fn is_at(found: &Detection, figure: &Figure, camera: &Camera) -> Verdict {
    let error = found.position - figure.head;
    demand(error.xy().norm() < 0.3 && error.z.abs() < 0.2, || {
        format!("the head is at {:.2}, found at {:.2}", figure.head, found.position)
    })?;
    let truth = camera.upper_body(&figure.head).clipped(camera.width, camera.height);
    let iou = found.rect_in(camera).clipped(camera.width, camera.height).iou(&truth);
    demand(iou >= 0.5, || {
        let [is, should] = [found.rect_in(camera), truth].map(|region| corners(&region));
        format!(
            "the region is {is}; that of the upper body is {should}, overlap {iou:.2} of at least 0.5"
        )
    })
}

fn person_is_followed(subject: &Subject<'_>) -> Verdict {
    if !subject.must_follow {
        return Ok(());
    }
    for (name, camera) in mountings() {
        let detector = &mut *subject.detector(From::Nothing)?;
        let figure = Figure::at(2.0, 0.1);
        let mut followed = track(1, figure.head, 0.15, &camera);
        // Appearance models need a frame to learn from.
        let learned =
            detector.learn(&drawn(1, &camera, &[figure]), std::slice::from_ref(&followed));
        learned.map_err(|error| format!("learning is an error: {error}"))?;
        // The predicted position is wrong by 10 cm, so that the detector has to search.
        followed.estimate.person.position.y -= 0.1;
        followed.estimate.region = camera.upper_body(&followed.estimate.person.position);
        let frame = drawn(2, &camera, &[figure]);
        let findings = Findings::ask(detector, &frame, &Query::Track(&followed), figure)?;
        let best = findings.found.first();
        let best = best.ok_or_else(|| format!("camera {name}: 0 found: {}", findings.words()))?;
        is_at(best, &figure, &camera).map_err(|what| format!("camera {name}: {what}"))?;
    }
    Ok(())
}

/// Simulates a person that is tracked for three frames and then leaves; then the track ends.
fn forgets(subject: &Subject<'_>) -> Verdict {
    let camera = level();
    let detector = &mut *subject.detector(From::Nothing)?;
    let figure = Figure::at(2.0, 0.2);
    let tracked = track(1, figure.head, 0.1, &camera);
    for index in 1..=4 {
        let (people, tracks) = if index <= 3 {
            (&[figure][..], std::slice::from_ref(&tracked))
        } else {
            (&[][..], &[][..])
        };
        let learned = detector.learn(&drawn(index, &camera, people), tracks);
        learned.map_err(|error| format!("learning is an error: {error}"))?;
    }
    let frame = drawn(5, &camera, &[]);
    let mut found = people(detector, &frame, &EVERYWHERE)?;
    found.extend(people(detector, &frame, &Query::Track(&tracked))?);
    believed_empty(&found, "after the person has left")
}

/// Checks the names of the tests that drop candidates, and those in the advice: otherwise `doctor`
/// would explain a test of the detector with the settings of the tracker.
fn tests_have_own_names(subject: &Subject<'_>) -> Verdict {
    let all = subject.registry.all_remedies();
    let own = all.filter(|(plugin, _)| *plugin == subject.info.name);
    let mut names: Vec<&str> = own.map(|(_, remedy)| remedy.test).collect();
    let camera = level();
    let lost = track(1, Figure::at(2.0, 0.4).head, 0.15, &camera);
    let detector = &mut *subject.detector(From::Nothing)?;
    for frame in walk(&camera) {
        for query in [EVERYWHERE, Query::Track(&lost)] {
            let mut funnel = Funnel::default();
            // Errors are found by other checks.
            let _ = detector.detect(&frame, &query, &mut funnel);
            names.extend(funnel.entries().iter().map(|entry| entry.test));
        }
    }
    match names.into_iter().find(|name| TRACKER_TESTS.contains(name)) {
        Some(name) => Err(format!(
            "`{name}` is the name of a test of the tracker: call it `{}: {name}`",
            subject.info.name
        )),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use tagalong_core::Input;

    use super::*;

    #[test]
    fn only_an_input_that_the_frame_lacks_may_be_asked_for() {
        fn missing(input: Input) -> Result<Vec<Detection>, Error> {
            Err(Error::MissingImage { input })
        }

        let frame = drawn(1, &level(), &[]);
        assert!(is_survived(&Ok(Vec::new()), &frame));
        assert!(is_survived(&missing(Input::Named("radar")), &frame));
        assert!(frame.holds(Input::Depth) && !is_survived(&missing(Input::Depth), &frame));
    }
}
