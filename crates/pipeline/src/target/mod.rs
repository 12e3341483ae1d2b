//! The target lock: who is followed, and what if that person is lost.
//!
//! A track is not a person. Behind somebody else a track may change over to the
//! wrong one, and a person who comes back gets a new number. So the lock
//! remembers what the person looks like, holds that against whoever is followed,
//! and says for every frame how sure it is. It goes back to somebody only on
//! evidence in several frames in a row, and only if the person can have got there; never
//! to who was seen at the same time as the person, nor to what stands where one of those
//! stood.

mod lock;
mod looks;
mod memory;
mod search;
mod settings;

pub(crate) use lock::Lock;
pub use lock::{Likeness, LockReport, LockState};
pub use memory::Differences;
pub(crate) use search::Search;
pub use settings::{LooksSettings, SearchSettings, TargetSettings};
