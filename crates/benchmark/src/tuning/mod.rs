//! Leave one room out: settings are chosen by all rooms but one, and scored in that one.
//!
//! All rooms choose among the same [`candidates`], which no figure has a say in. So each
//! candidate runs once on each log, whatever room is left out, and [`leave_one_out`] is
//! arithmetic: the truth of a room cannot reach the choice made without it.

mod candidates;
mod choice;
mod rooms;

pub use candidates::{candidates, shown_value};
pub use choice::{Choice, Figures, Objective, leave_one_out, mean};
pub use rooms::Rooms;
