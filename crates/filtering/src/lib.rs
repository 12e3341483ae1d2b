//! Shared parts of filters: a [`PersonFilter`] estimates the state of one person, [`PerPerson`] runs
//! it for all, also where an associator weighs alternatives, and [`match_moments`] merges those.

mod mixture;
mod person;

pub use mixture::match_moments;
pub use person::{PerPerson, PersonFilter};
