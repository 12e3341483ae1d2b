//! `tagalong train`: trains the model file of a plugin on simulated rooms, annotated logs and
//! photographs, and writes a card with its origin and its scores.
//!
//! A verifier is trained on the proposals of the detector, because these are its later inputs. The
//! first model is then applied to new rooms, and candidates that it judges wrongly or with a small
//! margin are added before the next fit.
//!
//! ```
//! use clap::Parser as _;
//! use tagalong_config::Registry;
//! use tagalong_training::{train, TrainArgs};
//!
//! #[derive(clap::Parser)]
//! struct Cli {
//!     #[command(flatten)]
//!     args: TrainArgs,
//! }
//!
//! let cli = Cli::parse_from(["train", "svm-patch", "--quick"]);
//! // A program registers its trainers; this one has none.
//! let failure = train(&cli.args, &Registry::default()).unwrap_err();
//! assert_eq!(failure.code, 2);
//! assert!(failure.message.contains("--features train"), "{}", failure.message);
//! ```

mod args;
mod card;
mod faces;
mod frames;
mod held_out;
mod in_use;
mod leg_scenes;
mod legs;
#[cfg(test)]
mod overlap;
mod panorama;
mod photos;
mod plan;
mod rooms;
mod seen;
mod session;
mod wide_rooms;
mod windows;

pub use args::TrainArgs;
use tagalong_app::outcome::{Ended, Failure, Outcome, print, say, write_file};
use tagalong_config::{Registry, TrainingData};
use tagalong_core::Verifier;

use self::card::Card;
use self::session::Session;

/// Runs `tagalong train`.
///
/// # Errors
/// Exit code 2 for a program without trainers, a plugin that cannot be trained and wrong settings;
/// 1 for files that cannot be read or written.
pub fn train(args: &TrainArgs, registry: &Registry) -> Outcome {
    if !registry.has_trainers() {
        return Err(Failure::usage(format!(
            "this program was built without trainers, which the first build leaves out; \
             `cargo run --release --features train -- train {}` builds them",
            args.plugin
        )));
    }
    let session = Session::new(args, registry)?;
    // Its samples come from the truth and not from proposals, so it skips the rounds below.
    let data = registry.training_offer(&args.plugin).data;
    if data == TrainingData::Panoramas {
        return panorama::train(&session, args);
    }
    let mut trainer = session.trainer()?;
    match data {
        TrainingData::LaserScans => return legs::train(&session, trainer.as_mut()),
        TrainingData::Frames => return frames::train(&session, trainer.as_mut()),
        TrainingData::Windows | TrainingData::Faces => {
            return windows::train(&session, trainer.as_mut(), data);
        }
        TrainingData::Candidates | TrainingData::Panoramas => {}
    }
    let mut card = Card::new(args, session.plan.scenes[0], session.sources());
    let mut doubter: Option<Box<dyn Verifier>> = None;
    for round in 0..=session.plan.rounds {
        let counts = session.collect_hard_negatives(round, trainer.as_mut(), doubter)?;
        session.tell(round, "fitting");
        session.bar.set_length(1000);
        let fitted = trainer
            .fit(&mut |part| session.bar.set_position((1000.0 * part) as u64))
            .map_err(Failure::failed)?;
        // Written first: the verifier loads the model from its file.
        write_file(&session.model, &fitted.model)?;
        doubter = Some(session.verifier()?);
        card.rounds.push(counts);
        card.fit = fitted.figures;
    }
    card.held_out_rooms = session.try_rooms()?;
    card.held_out_logs = session.try_logs()?;
    session.bar.finish_and_clear();
    let path = session.model.with_extension("card.toml");
    write_file(&path, &card.to_text()?)?;
    print(&card.summary())?;
    say(&format!("{} and {}", session.model.display(), path.display()));
    Ok(Ended::Well)
}
