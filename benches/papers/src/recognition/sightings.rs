//! Annotated people of a log, with their appearances.

use std::path::Path;

use tagalong_log::{FrameSource, Input, InputSettings, Inputs, Limits};
use tagalong_vision::{Appearance, Describer};

use crate::lab::ReproduceError;
use crate::real;

/// A person in one image.
#[derive(Clone, Debug)]
pub(super) struct Sighting {
    /// Number of the image.
    pub(super) frame: u64,
    /// Time of the image, s.
    pub(super) at_s: f64,
    /// Number of the person.
    pub(super) person: i64,
    /// Appearance in the image.
    pub(super) looks: Appearance,
}

/// Returns the sightings of the people of a log that count and show some clothes, by the annotated
/// places of their heads; `None` without the log.
pub(super) fn read(folder: &Path, log: &str) -> Result<Option<Vec<Sighting>>, ReproduceError> {
    let Some(people) = real::people(folder, log)? else { return Ok(None) };
    let path = folder.join(log).with_extension("mcap");
    let inputs = Inputs::NONE.require(Input::Colour).require(Input::Depth);
    let source = FrameSource::open(&path, &InputSettings::default(), &Limits::default(), inputs);
    let mut source = source.map_err(|error| ReproduceError::of(log, error))?;
    let describer = Describer::default();
    let mut all = Vec::new();
    while let Some(item) = source.next_frame() {
        let frame = &item.frame;
        for row in people.get(&frame.index).into_iter().flatten() {
            let truth = real::annotated(row, &frame.camera.robot_from_camera);
            let Some(truth) = truth.filter(|truth| !truth.ignore) else { continue };
            let head = truth.head_in_robot;
            // The annotated box is cut at the border of the image.
            let looks = describer.at(&frame.camera.upper_body(&head), &head, frame);
            let looks = looks.map_err(|error| ReproduceError::of(log, error))?;
            if looks.difference(&looks).mean().is_some() {
                let at_s = frame.stamp.nanos() as f64 * 1e-9;
                all.push(Sighting { frame: frame.index, at_s, person: row.id, looks });
            }
        }
    }
    Ok(Some(all))
}
