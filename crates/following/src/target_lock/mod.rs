//! Target lock: the choice of the person to follow, and their recovery after a loss.
//!
//! A track is not a person. When people occlude each other a track may switch to the wrong one, and
//! a returning person gets a new ID. The lock therefore remembers the appearance of the person,
//! compares it with the followed track, and reports its confidence in every frame. It returns to a
//! track only on evidence in several consecutive frames, and only if the person can have moved
//! there. It never returns to a track that was seen at the same time as the person, nor to one at
//! the position of such a track.

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
