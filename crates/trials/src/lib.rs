//! Trials of pipelines on simulated scenes, in memory: render once, run many.
//!
//! A published figure comes from a dozen recordings that are not available. Its fair counterpart is
//! the same layout simulated again and again, with other people, other furniture and other luck,
//! until the interval around the figure is narrow enough to say something. [`each`] does that: it
//! renders every scene of a list, takes all contenders over the very same frames, and hands each
//! [`Trial`] to a function that keeps the parts that it needs, so that memory stays flat over
//! thousands of trials.
//!
//! [`Draw`] makes the frames that the log reader would make of the recorded scene: the camera as
//! the log describes it, not as it is mounted; the robot's motion from its odometry, not from the
//! truth; images that came late, in order. Only the JPEG compression of colour images is left out.
//!
//! A trial is judged by [`Judge`] (the metrics of `tagalong-eval`, and position errors in two
//! frames), [`crossing`] (are all people tracked in all frames?) and [`occlusions`] (is a person
//! re-identified after it?).
//!
//! A [`Ride`] closes the loop: the contender drives the robot, and a [`RideJudge`] measures how
//! well it stayed with the person. Where a person or a trolley comes at the robot, an
//! [`ApproachJudge`] says whether the robot moved when they touched.
//!
//! A [`GivenSequence`] needs no scene: the boxes of another detector on a recorded sequence, for
//! comparisons of associations and filters alone.
//!
//! The result of a list of scenes depends on the scenes and configs alone, not on the number of
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
