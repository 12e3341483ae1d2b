//! Target lock: the choice of the person to follow, and their recovery after a loss.
//!
//! A track is not a person. Behind another person a track may change over to the wrong one, and a
//! returning person gets a new number. So the lock remembers the appearance of the person, compares
//! it with the followed track, and reports its confidence for every frame. It returns to a track
//! only on evidence in several frames in a row, and only if the person can have got there; never to
//! one that was seen at the same time as the person, nor to one that stands where such a one stood.

mod chooser;
mod lock;
mod memory;
mod search;
mod settings;

pub use chooser::ChoiceRule;
pub(crate) use chooser::{bearing_deg, distance_m, nearest_in_front};
pub(crate) use lock::TargetLock;
pub use lock::{Likeness, LockReport, LockState};
pub use memory::{AppearanceMemory, Differences};
pub(crate) use search::Search;
pub use settings::{LooksSettings, SearchSettings, TargetSettings};
