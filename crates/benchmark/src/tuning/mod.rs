//! Leave one room out: settings are chosen on all rooms but one, and scored in that one.
//!
//! All rooms choose among the same [`candidates`], which do not depend on any figure: the settings
//! of the config, which all rooms may have chosen, are among them only by chance. So each candidate
//! runs once on each log, whatever room is left out, and [`leave_one_out`] only computes: the truth
//! of a room cannot affect the choice made without it.

mod candidates;
mod choice;
mod rooms;

pub use candidates::{Search, candidates, shipped, shown_value};
pub use choice::{Choice, Figures, Objective, Poll, Weights, leave_one_out, mean, weighted_mean};
pub use rooms::{Room, RoomFile, Rooms};
