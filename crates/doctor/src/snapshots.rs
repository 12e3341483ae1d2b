//! Pictures of selected frames with their tracks.

use std::collections::BTreeSet;
use std::path::Path;

use tagalong_app::outcome::{Failure, make_folder};
use tagalong_app::progress::Progress;
use tagalong_app::remedies::reach_m;
use tagalong_log::{FrameSource, Input};
use tagalong_render::{Overlay, OverlayData, OverlayStyle};

use super::visit::{Scope, Visit};

/// Number of frames that are spread over the log.
const SPREAD: usize = 6;

/// Number of frames with the most shapes without a track.
const WORST: usize = 6;

/// Writes pictures of selected frames, the worst and others, named by the index of the frame, as
/// `000015.png`.
///
/// # Errors
/// A folder or a picture that cannot be written.
pub fn write(visit: &Visit, scope: Scope, folder: &Path) -> Result<(), Failure> {
    make_folder(folder)?;
    let wanted = wanted(visit);
    let reports = &visit.evidence.trial.reports;
    let inputs = visit.pipeline.inputs().accept(Input::Colour).accept(Input::Depth);
    // Only a log without the inputs of the pipeline cannot be opened, and has no tracks to show.
    let input = &visit.outer.input;
    let limits = &visit.outer.limits;
    let Ok(mut frames) = FrameSource::open(scope.log, input, limits, inputs) else {
        return Ok(());
    };
    let reach_m = reach_m(visit.pipeline.config().values()).unwrap_or_default();
    let style = OverlayStyle::debug(visit.outer.output.boxes).reaching(reach_m);
    let mut overlay = Overlay::new(folder.to_owned(), style);
    let progress = Progress::titled("pictures");
    for report in reports {
        let Some(item) = frames.next_frame() else { break };
        progress.advance(frames.progress(), report.index);
        // A frame without an image has no picture.
        if !wanted.contains(&report.index) || item.frame.camera.is_blind() {
            continue;
        }
        let scene = OverlayData::of(&item.frame, item.odom_from_robot, report.clone());
        overlay.draw(&scene).map_err(Failure::failed)?;
    }
    Ok(())
}

/// Returns the indices of the selected frames.
fn wanted(visit: &Visit) -> BTreeSet<u64> {
    let reports = &visit.evidence.trial.reports;
    let every = (reports.len() / SPREAD).max(1);
    let spread = reports.iter().step_by(every).map(|report| report.index);
    let missed = visit.evidence.coverage.missed_frames.iter().take(WORST).copied();
    spread.chain(missed).collect()
}
