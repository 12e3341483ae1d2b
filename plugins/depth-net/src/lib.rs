//! `depth-net`: people in a plan view of the depth image, by a small convolutional network.
//!
//! The points of the depth image are collected in a map of the floor ([`FloorMap`]): the surface in
//! each slab of height, the greatest height, and the voxels that are seen to be empty or cannot be
//! seen, because they are behind others or outside of the image. A person therefore has the same
//! size and shape at every distance and camera height, and the map shows that a head above the
//! image is unknown. A fully convolutional network ([`Net`]) turns the map into log-odds, and the
//! position and height of a head, for each cell; [`Peak`]s of the log-odds are people.
//!
//! The points of a 3-D lidar fill the same map, for each quarter around the robot.
//!
//! The detector `depth-net` discovers people and finds tracked ones again. The verifier
//! `depth-net-verifier` returns the log-odds of the same map at a candidate's position.
//!
//! `tagalong model --export depth-net FILE.onnx` writes the network as an ONNX file.
//!
//! With the feature `train` the plugin also offers a trainer ([`train`]).
//!
//! ```
//! use tagalong_conformance::context;
//! use tagalong_conformance::figure::{Figure, World};
//! use tagalong_core::{Detector, EgoMotion, Frame, Funnel, Query, Stamp};
//! use tagalong_depth_net::{Config, DepthNet};
//! use tagalong_geometry::{Camera, Pinhole};
//!
//! # fn frame(people: &[Figure]) -> Frame {
//! #     let lens = Pinhole::centred(262.0, 320, 240);
//! #     let camera = Camera::mounted(lens, 320, 240, 1.2, 0.0, 0.0);
//! #     let images = World::with(people).draw(&camera);
//! #     Frame::new(1, Stamp::default(), camera.into(), EgoMotion::at_rest(0.1), images)
//! # }
//! let mut detector = DepthNet::new(Config::default(), &context())?;
//! let all = Query::Discover { occupied: &[] };
//! let found = detector.detect(&frame(&[Figure::at(2.5, 0.4)]), &all, &mut Funnel::default())?;
//! assert_eq!(found.len(), 1);
//! assert!((found[0].position.x - 2.5).abs() < 0.2, "{}", found[0].position);
//! # Ok::<(), tagalong_core::Error>(())
//! ```

mod beams;
mod config;
mod detect;
mod export;
mod lanes;
mod map;
mod model;
mod net;
mod peaks;
mod surface;
#[cfg(test)]
mod tests;
#[cfg(feature = "train")]
pub mod train;
mod verify;

pub use beams::{Beams, Quarter};
pub use config::{Config, Source, Training, VerifierConfig};
pub use detect::DepthNet;
pub use map::{FloorMap, reduced};
pub use model::Model;
pub use net::{Net, Pass};
pub use peaks::{Peak, peaks};
use tagalong_config::Registry;
pub use verify::DepthNetVerifier;

/// Name of the detector in configs.
pub const NAME: &str = "depth-net";

/// Name of the verifier in configs.
pub const VERIFIER: &str = "depth-net-verifier";

/// The model that is built in.
pub(crate) const BUILT_IN: &str = include_str!("../models/depth-net.toml");

/// Registers the detector, the verifier, and the trainer if that is compiled in.
pub fn register(registry: &mut Registry) {
    registry.detector(NAME, "people in a plan view of depth, by a small network", DepthNet::new);
    registry.verifier(
        VERIFIER,
        "log-odds of depth-net at the place of a candidate",
        DepthNetVerifier::new,
    );
    registry.exporter(NAME, export::export);
    #[cfg(feature = "train")]
    registry.training(
        NAME,
        tagalong_config::TrainingOffer::new(
            tagalong_config::TrainingData::Frames,
            "[training]\nsteps = 40\nreal_steps = 10",
        ),
    );
    #[cfg(feature = "train")]
    registry.trainer(NAME, |config: Config, context| {
        train::DepthNetTrainer::new(config.training, context.seed)
    });
}
