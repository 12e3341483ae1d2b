use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_config::check_settings;
use tagalong_core::{Result, settings};

use crate::sampling::Sampling;

/// Method by which particles of people with overlapping silhouettes are weighted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// One person after the other, from front to back, each with the nearer ones fixed (MacCormick
    /// and Blake 1999). For any number of people.
    Partitioned,
    /// The scene of each particle is compared with the image.
    All,
    /// The likelihoods over the lateral positions of two people are computed as a full table, and
    /// each particle looks up its own.
    Table,
    /// Some particles are compared with the image; the likelihood of all is the sum of kernels at
    /// these.
    Kde,
    /// Some particles are compared with the image; the likelihood of all is interpolated by a
    /// Gaussian process with the same kernels.
    Gp,
}

/// Choice of the particles that `kde` and `gp` compare with the image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Chosen {
    /// The most likely ones of the previous frame.
    PreviousBest,
    /// Predicted ones at regular intervals, and a coarse grid of 3 x 3 positions.
    Spread,
}

settings! {
    /// Settings of the filter `joint-particle`.
    pub struct Config {
        /// Method for people with overlapping silhouettes.
        pub method: Method = Method::Partitioned,
        /// Number of particles of a single person.
        #[schemars(range(min = 1, max = 100000))]
        pub particles: usize = 100,
        /// For `all`, `table`, `kde`, `gp`: number of particles of each of two people, which are
        /// combined in all pairs: 25 make 625.
        #[schemars(range(min = 1, max = 300))]
        pub joint_side: usize = 25,
        /// For `partitioned`: largest number of particles of a group; the actual number depends on
        /// their spread (KLD sampling).
        #[schemars(range(min = 1, max = 100000))]
        pub max_particles: usize = 400,
        /// Bound on the error of the particles' distribution in KLD sampling, nats.
        #[schemars(range(min = 1e-6, max = 10.0))]
        pub kld_error: f64 = 0.05,
        /// Normal quantile of the probability with which `kld_error` holds (2.33 is 99 %).
        #[schemars(range(min = -10.0, max = 10.0))]
        pub kld_quantile: f64 = 2.33,
        /// Samples only the position across the viewing ray; depth, height and velocity are small
        /// Kalman filters in each particle. If false, all are sampled.
        pub marginalise: bool = true,
        /// Spectral density of a person's white acceleration, m²/s³.
        #[schemars(range(min = 0.0, max = 1e3))]
        pub acceleration_noise: f64 = 0.25,
        /// Standard deviation of the position on the floor, in addition to the motion by velocity,
        /// m per square root of a second.
        #[schemars(range(min = 0.0, max = 1e3))]
        pub position_noise: f64 = 0.05,
        /// Standard deviation of the height, m per square root of a second.
        #[schemars(range(min = 0.0, max = 1e3))]
        pub height_noise: f64 = 0.04,
        /// Standard deviation of the velocity, in addition to the acceleration, m/s per square root
        /// of a second.
        #[schemars(range(min = 0.0, max = 1e3))]
        pub velocity_noise: f64 = 0.0,
        /// Variance of each velocity component of a new track, m²/s².
        #[schemars(range(min = 0.0, max = 1e3))]
        pub initial_velocity_variance: f64 = 1.0,
        /// For `table`, `kde`, `gp` with `marginalise = false`: two people that are weighted
        /// together keep their depth and height, as if they moved across the view. The map contains
        /// no information on these.
        pub hold_depth: bool = false,
        /// Takes the facing direction of a person from the best of three templates. If false, or if
        /// all fit equally well, it is the direction of the track's velocity; a standing person
        /// outside of groups faces by the image in both cases.
        pub facing_by_image: bool = true,
        /// Share of the particles that are moved to the detection, 0 to 1.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub from_detection: f64 = 0.1,
        /// Least gain in log-likelihood of the scene with the person over that without, at which
        /// the person counts as seen, nats.
        #[schemars(range(min = -1e6, max = 1e6))]
        pub min_support: f64 = 2.0,
        /// The same if a detector found the person in this frame, nats.
        #[schemars(range(min = -1e6, max = 1e6))]
        pub min_support_found: f64 = 0.0,
        /// The same if no detector found the person for longer than `trust_s`, nats: furniture
        /// explains a little of the image, a person most of it.
        #[schemars(range(min = -1e6, max = 1e6))]
        pub min_support_unfound: f64 = 6.0,
        /// Time for which a silhouette without detections is trusted, s.
        #[schemars(range(min = 0.0, max = 1e9))]
        pub trust_s: f64 = 1.0,
        /// Fraction of their size by which upper-body squares are enlarged before they are tested
        /// for overlap.
        #[schemars(range(min = 0.0, max = 10.0))]
        pub inflate: f64 = 0.1,
        /// Distance on the floor beyond which people leave their group, m; `split_frames` must hold
        /// as well.
        #[schemars(range(min = 0.0, max = 100.0))]
        pub split_m: f64 = 0.6,
        /// Number of consecutive frames without overlapping squares after which people leave their
        /// group.
        pub split_frames: u32 = 3,
        /// For `kde`, `gp`: number of particles that are compared with the image.
        #[schemars(range(min = 1, max = 1000))]
        pub points: usize = 50,
        /// For `kde`, `gp`: choice of these particles.
        pub chosen: Chosen = Chosen::Spread,
        /// Width of the kernel along the lateral position of the near person, m.
        #[schemars(range(min = 1e-4, max = 10.0))]
        pub kernel_near_m: f64 = 0.04,
        /// Width of the kernel along the lateral position of the far person, m.
        #[schemars(range(min = 1e-4, max = 10.0))]
        pub kernel_far_m: f64 = 0.1,
        /// For `gp`: variance of the likelihood that the kernels do not explain.
        #[schemars(range(min = 1e-9, max = 10.0))]
        pub nugget: f64 = 0.03,
        /// For `table`: largest lateral position of the near person, m.
        #[schemars(range(min = 0.0, max = 10.0))]
        pub reach_near_m: f64 = 0.3,
        /// For `table`: largest lateral position of the far person, m.
        #[schemars(range(min = 0.0, max = 10.0))]
        pub reach_far_m: f64 = 0.9,
        /// For `table`: spacing of the positions, m.
        #[schemars(range(min = 5e-3, max = 10.0))]
        pub step_m: f64 = 0.03,
        /// Lead in Bhattacharyya coefficients at which people exchange their tracks: after they
        /// leave a group, their colours are compared with those before. 2: never.
        #[schemars(range(min = 0.0, max = 10.0))]
        pub swap_margin: f64 = 0.3,
        /// Scheme of sampling: of a program, not of a file.
        #[serde(skip)]
        pub sampling: Sampling,
    }
}

impl Config {
    /// Refuses settings outside their ranges.
    pub(crate) fn check(&self) -> Result<()> {
        check_settings(self)
    }
}
