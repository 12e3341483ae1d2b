//! Training of window detectors on photographs of people; the trainers search pictures without
//! people for false positives of their model.

use std::path::Path;

use super::card::WindowCard;
use super::photos::{Take, photos};
use super::session::Session;
use super::{faces, frames};
use tagalong_app::outcome::{Ended, Failure, Outcome, print, say, write_file};
use tagalong_config::{Example, Trainer, TrainingData};
use tagalong_core::{Detection, Frame};

/// Folders of the data.
const FOLDERS: [&str; 3] = ["people/inria-64x128", "people/head-shoulder-50", "negatives"];

/// Default number of simulated rooms, and the number in a quick training.
const SCENES: [u64; 2] = [150, 12];

/// Passes all photographs to the trainer, which itself holds out some of them.
pub(super) fn train(
    session: &Session<'_>,
    trainer: &mut dyn Trainer,
    examples: TrainingData,
) -> Outcome {
    let Some(data) = &session.args.data else {
        let why = "is trained on photographs: name their folder with --data";
        return Err(Failure::usage(format!("`{}` {why}", session.args.plugin)));
    };
    let share = if session.args.quick { 8 } else { 1 };
    session.bar.set_message("reading photographs");
    let mut show = |frame: &Frame, candidate: &Detection, example: Example| {
        trainer.add(frame, candidate, example).map_err(Failure::failed)
    };
    let (folders, shown): (&[&str], usize) = match examples {
        TrainingData::Faces => (&faces::FOLDERS[..], faces::visit(data, share, &mut show)?),
        _ => (&FOLDERS[..], visit(data, share, &mut show)?),
    };
    let mut sources: Vec<String> = folders.iter().map(ToString::to_string).collect();
    if trainer.learns_from_rooms() {
        let scenes = session.args.scenes.unwrap_or(SCENES[usize::from(session.args.quick)]);
        frames::show_scenes(session, scenes, trainer)?;
        sources.push(format!("{scenes} simulated rooms"));
        session.bar.set_message("reading logs");
        frames::show_rooms(data, trainer)?;
        sources.extend(frames::room_logs());
    }
    session.bar.set_message("fitting");
    session.bar.set_position(0);
    session.bar.set_length(1000);
    let fitted = trainer.fit(&mut |part| session.bar.set_position((1000.0 * part) as u64));
    let fitted = fitted.map_err(Failure::failed)?;
    session.bar.finish_and_clear();
    write_file(&session.model, &fitted.model)?;
    frames::write_left_out(session, &fitted.without)?;
    let path = session.model.with_extension("card.toml");
    let card = WindowCard::new(session.args, sources, shown, fitted.figures);
    let text = card.to_text()?;
    write_file(&path, &text)?;
    print(&text)?;
    say(&format!("{} and {}", session.model.display(), path.display()));
    Ok(Ended::Well)
}

/// Passes all photographs with and without people, or one in `share`.
fn visit(data: &Path, share: u64, take: Take<'_>) -> Result<usize, Failure> {
    let mut all = photos(data, false);
    all.extend(photos(data, true));
    all.retain(|photo| photo.group / 5 % share == 0);
    all.iter().try_for_each(|photo| photo.visit(0, take))?;
    Ok(all.len())
}
