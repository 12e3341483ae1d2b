use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::settings;
use tagalong_geometry::HEAD_RADIUS_M;

use crate::bank::Direction;

/// Comparison of a silhouette with the image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Cost {
    /// Any background farther than the person is accepted, errors are limited per run of pixels,
    /// and missing readings are masked. 0 to 1.
    Robust,
    /// Squared difference in inverse depth from one background value (the percentile of the frame),
    /// as a root mean square over the valid pixels, 1/m.
    Squared,
}

settings! {
    /// Settings of `depth-template`.
    pub struct DepthTemplateConfig {
        /// Nearest face, m of depth.
        pub min_depth_m: f64 = 0.5,
        /// Farthest face, m of depth.
        pub max_depth_m: f64 = 5.5,
        /// Lowest head centre above the floor, m: that of a standing adult is above 1.3, and a
        /// monitor on a desk reaches 1.15.
        pub min_head_height_m: f64 = 1.2,
        /// Highest head centre above the floor, m.
        pub max_head_height_m: f64 = 2.1,
        /// Least amount by which a boundary point is farther than the head, m; 1.0 loses people in
        /// front of walls.
        pub boundary_margin_m: f64 = 0.35,
        /// Distance of the boundary points left, right and above from the head
        /// centre, m.
        pub boundary_distance_m: f64 = 0.22,
        /// Least number of boundary points that must pass if one of them contradicts.
        pub boundary_min_passed: u32 = 2,
        /// Narrowest head, m; lamps and poles are narrower.
        pub min_head_width_m: f64 = 0.09,
        /// Widest head, m; walls and furniture are wider.
        pub max_head_width_m: f64 = 0.36,
        /// Least share of the probes below the head that show a body, 0 to 1.
        pub min_body: f64 = 0.7,
        /// Body directions for which there is a template: `along` (from the front or the back),
        /// `left`, `right`.
        pub directions: Vec<Direction> = Direction::ALL.to_vec(),
        /// Comparison of silhouettes with the image.
        pub cost: Cost = Cost::Robust,
        /// Weight of the person's pixels relative to those beside the person, 0 to 1.
        pub foreground_weight: f64 = 0.3,
        /// Depth error on the person up to which there is no cost, m.
        pub relief_free_m: f64 = 0.15,
        /// Depth error on the person from which the cost is full, m.
        pub relief_full_m: f64 = 0.30,
        /// Increase of both per square metre of depth, 1/m: the noise of stereo grows with the
        /// square of the depth, by `sigma_px / (f B)` for a standard deviation of its disparity.
        pub relief_per_m2: f64 = 0.0,
        /// Least share of the person's pixels that have a reading, 0 to 1.
        pub min_foreground_valid: f64 = 0.5,
        /// Cost of a pixel beside the person that has no reading or shows a nearer object, 0 to 1.
        /// Use less for a camera that does not measure far surfaces.
        pub unknown_cost: f64 = 0.2,
        /// Largest cost of a new person, and of a tentative track.
        pub discover_cost: f64 = 0.16,
        /// Largest cost of a person with a confirmed track.
        pub follow_cost: f64 = 0.30,
        /// Largest cost of a cell that is refined.
        pub refine_cost: f64 = 0.4,
        /// Cost at which person and no person are equally likely; the score is the difference from
        /// it times `score_per_cost`.
        pub even_cost: f64 = 0.22,
        /// Log-odds per unit of cost.
        pub score_per_cost: f64 = 20.0,
        /// Least distance between two people on the floor, m.
        pub min_separation_m: f64 = 0.3,
        /// Least number of qualifying cells of a head; a head with fewer is dropped.
        pub min_cells: u32 = 2,
        /// Radius around the prediction in which tracked people are searched for, m; three standard
        /// deviations if that is smaller.
        pub follow_radius_m: f64 = 0.6,
        /// Percentile of the depths of the frame that is its background, for the cost `squared`.
        pub background_percentile: f64 = 90.0,
        /// Log-likelihood of a fully visible person in an imagined scene that fits perfectly (role
        /// `weigh`), nats. Errors of neighbouring pixels are correlated, so this is far below the
        /// number of pixels.
        pub likelihood_nats: f64 = 12.0,
        /// Depth error in an imagined scene at which a pixel no longer supports the person, m;
        /// never less than three standard deviations of the depth.
        pub likelihood_tolerance_m: f64 = 0.3,
        /// Weight of pixels beside a person in an imagined scene that have the person's depth, if
        /// there are more on one side than on the other (a rucksack or an arm), 0 to 1. Those on
        /// both sides count fully.
        pub likelihood_one_sided: f64 = 0.3,
        /// Largest number of rows of a template that are evaluated.
        pub max_rows: usize = 28,
        /// Distance of the centre of a head behind its measured depth, m. With stereo it is less
        /// than the radius of the head: the contrast is at its outline, which lies behind the face.
        pub centre_behind_m: f64 = HEAD_RADIUS_M,
        /// Standard deviation of the head's position across the viewing ray, m.
        pub sigma_across_m: f64 = 0.03,
        /// Standard deviation of the head's depth at 0 m, m.
        pub sigma_depth_m: f64 = 0.03,
        /// Increase of that standard deviation per square metre of depth, 1/m.
        pub sigma_depth_per_m2: f64 = 0.003,
    }
}
