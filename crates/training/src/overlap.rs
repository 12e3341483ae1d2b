//! Tests that held-out pictures do not resemble training pictures.

use std::path::Path;

use tagalong_app::outcome::Failure;
use tagalong_config::Example;
use tagalong_conformance::testdata::find;
use tagalong_core::{Detection, Frame, GreyImage};
use tagalong_learn::{CALIBRATION, Use, use_of};

use super::faces;
use super::photos::{Photo, Take, mean_cells, photos, to_unit_length};

/// Columns and rows of a small picture.
const SMALL: (usize, usize) = (10, 20);
/// Correlation above which two pictures show the same scene; different people on one meadow reach
/// 0.904.
const SAME: f32 = 0.92;

/// Returns a small picture of unit length and without its mean.
fn small(grey: &GreyImage) -> Vec<f32> {
    let mut small = mean_cells(grey, SMALL.0, SMALL.1);
    to_unit_length(&mut small);
    small
}

fn mirrored(small: &[f32]) -> Vec<f32> {
    small.chunks(SMALL.0).flat_map(|row| row.iter().rev()).copied().collect()
}

/// Returns the pictures that show people, with their use.
fn with_people(visit: impl FnOnce(Take<'_>) -> Result<(), Failure>) -> Vec<(Use, Vec<f32>)> {
    let mut shown = Vec::new();
    let taken = visit(&mut |frame: &Frame, _: &Detection, example: Example| {
        if example.is_person {
            let grey = frame.grey().map_err(Failure::failed)?;
            shown.push((use_of(example.group, &[CALIBRATION]), small(grey)));
        }
        Ok(())
    });
    taken.unwrap_or_else(|failure| panic!("{}", failure.message));
    shown
}

/// Returns the largest correlation of a picture that is not trained with to one that is, or to its
/// mirror image; asserts that there are enough of either kind.
fn most_alike(shown: &[(Use, Vec<f32>)]) -> f32 {
    fn product(a: &[f32], b: &[f32]) -> f32 {
        a.iter().zip(b).map(|(a, b)| a * b).sum::<f32>()
    }

    let (fitted, tested): (Vec<_>, Vec<_>) = shown.iter().partition(|(use_, _)| *use_ == Use::Fit);
    assert!(fitted.len() > 100 && tested.len() > 50, "{}", shown.len());
    let mut most = f32::MIN;
    for (_, tested) in tested {
        let mirrored = mirrored(tested);
        for (_, trained) in &fitted {
            most = most.max(product(tested, trained)).max(product(&mirrored, trained));
        }
    }
    most
}

/// Returns the same for photographs of some kind.
fn most_alike_photos(data: &Path, kind: impl Fn(&Photo) -> bool) -> f32 {
    most_alike(&with_people(|take: Take<'_>| {
        let all = [photos(data, false), photos(data, true)];
        let mut people = all.into_iter().flatten().filter(kind);
        people.try_for_each(|photo| photo.visit(0, take))
    }))
}

#[test]
fn tested_people_are_not_trained_with() {
    let Some(data) = find("") else { return };
    let most = most_alike_photos(&data, Photo::is_body);
    assert!(most < SAME, "{most}");
}

#[test]
fn tested_heads_and_shoulders_are_not_trained_with() {
    let Some(data) = find("") else { return };
    let most = most_alike_photos(&data, |photo| photo.is_person() && !photo.is_body());
    assert!(most < SAME, "{most}");
}

#[test]
fn tested_pictures_of_faces_are_not_trained_with() {
    let Some(data) = find("") else { return };
    let most = most_alike(&with_people(|take| faces::fddb(&data, 1, take).map(drop)));
    assert!(most < SAME, "{most}");
}
