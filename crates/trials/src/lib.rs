//! Trials of pipelines on simulated scenes, in memory: render once, run many.
//!
//! A published figure comes from a dozen recordings that are not available. A fair substitute is to
//! simulate the same layout repeatedly, with other people, other furniture and other random
//! numbers, until the interval around the figure is narrow enough. [`each`] does that: it renders
//! every scene of a list, runs all contenders on exactly the same frames, and passes each [`Trial`]
//! to a function that keeps only the parts that it needs, so that memory stays constant over
//! thousands of trials.
//!
//! [`Draw`] makes the frames that the log reader would make from the recorded scene: the camera as
//! the log describes it, not as it is mounted; the robot's motion from its odometry, not from the
//! truth; late images in order. Only the JPEG compression of colour images is left out.
//!
//! A trial is scored by [`Judge`] (the metrics of `tagalong-eval`, and position errors in two
//! frames), [`crossing`] (are all people tracked in all frames?) and [`occlusions`] (is a person
//! re-identified afterwards?).
//!
//! A [`Ride`] closes the loop: the contender steers the robot, and a [`RideJudge`] measures how
//! well it stayed with the person. If a person or a trolley moves towards the robot, an
//! [`ApproachJudge`] determines whether the robot was moving at the contact.
//!
//! A [`GivenSequence`] needs no scene: it contains the boxes of another detector on a recorded
//! sequence, for comparisons of association and filters alone.
//!
//! The result of a list of scenes depends only on the scenes and configs, not on the number of
//! threads.
//!
//! ```
//! use tagalong_sim::Scene;
//! use tagalong_trials::Draw;
//!
//! let scene = "duration_s = 1.0\n[camera]\nwidth = 32\nheight = 24\n\
//!              [robot]\npath = [[6.0, 4.0]]\n[[people]]\npath = [[4.0, 3.0], [4.0, 1.0]]\n";
//! let mut draw = Draw::new(&Scene::parse(scene)?, 1);
//! let first = draw.next_frame().ok_or("no frame")?;
//! assert_eq!((first.frame.index, first.truth.len()), (1, 1));
//! assert!(first.frame.depth().is_ok());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod contender;
mod crossing;
mod draw;
mod given;
mod judge;
mod occlusion;
mod parallel;
mod ride;
#[cfg(test)]
mod testing;
mod trial;

pub use contender::Contender;
pub use crossing::{Crossing, Failing, Span, crossing};
pub use draw::{Draw, ODOMETRY_SIGMA, SimulatedFrame};
pub use given::{GivenSequence, GivenTracks, for_given_boxes};
pub use judge::{Judge, Judged};
pub use occlusion::{Occlusion, Outcome, occlusions, outcome};
pub use parallel::{each, in_order};
pub use ride::{
    ApproachJudge, ApproachWatch, Approached, Contact, CrowdMeasures, Episode, ReasonShare, Ridden,
    Ride, RideJudge, Side, Tick, Touched, Witness,
};
pub use trial::{Moment, Run, Trial, TrialError};
