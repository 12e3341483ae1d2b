//! The page that shows runs: time line, images with boxes and trails, a plan view, target and
//! command, the funnel of each frame, events, and why a person was missed.
//!
//! [`html`] creates it as one file of recorded runs, or as the skeleton of a live page that
//! requests its frames. The script shows the data unchanged: apart from the answers to clicks,
//! nothing is computed in the browser.

pub mod data;
pub mod events;
pub mod frame;
pub mod html;
pub mod moment;
pub mod robot;
