//! The page on which runs are seen: time line, images with boxes and trails, plan from above, target
//! and command, the funnel of each frame, events, and the answer to why a person was missed.
//!
//! [`html`] makes it as one file of recorded runs, or as the frame of a page that asks for what
//! happens now. The script shows the data as it is: nothing is computed a second time in the browser
//! but the answer to a click.

pub mod data;
pub mod events;
pub mod frame;
pub mod html;
pub mod moment;
pub mod robot;
