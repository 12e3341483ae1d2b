use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::settings;
use tagalong_geometry::HEAD_RADIUS_M;

use crate::bank::Direction;

/// Comparison of a silhouette with the image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Cost {
    /// Any background that is farther than the person is fine, errors are
    /// limited per run, missing readings are masked. 0 to 1.
    Robust,
    /// Squared difference in inverse depth against one background value (the
    /// percentile of the frame), as a root mean square over the valid pixels, 1/m.
    Squared,
}

settings! {
    /// Settings of `depth-template`.
    pub struct DepthTemplateConfig {
        /// Nearest and farthest face, m of depth.
        pub min_depth_m: f64 = 0.5,
        /// Farthest face, m of depth.
        pub max_depth_m: f64 = 5.5,
        /// Lowest head centre above the floor, m: a standing adult's is above 1.3, a monitor on a
        /// desk reaches 1.15.
        pub min_head_height_m: f64 = 1.2,
        /// Highest head centre above the floor, m.
        pub max_head_height_m: f64 = 2.1,
        /// A boundary point passes if it is this much farther than the head, m;
        /// 1.0 loses people in front of walls.
        pub boundary_margin_m: f64 = 0.35,
        /// Distance of the boundary points left, right and above from the head
        /// centre, m.
        pub boundary_distance_m: f64 = 0.22,
        /// Boundary points that must pass when one of them contradicts.
        pub boundary_min_passed: u32 = 2,
        /// Narrowest head, m; narrower things are lamps and poles.
        pub min_head_width_m: f64 = 0.09,
        /// Widest head, m; wider things are walls and furniture.
        pub max_head_width_m: f64 = 0.36,
        /// Part of the probes below the head that must show a body, 0 to 1.
        pub min_body: f64 = 0.7,
        /// Body directions that have a template: `along` (from the front or the
        /// back), `left`, `right`.
        pub directions: Vec<Direction> = Direction::ALL.to_vec(),
        /// Comparison of silhouettes with the image.
        pub cost: Cost = Cost::Robust,
        /// Weight of the person's pixels against those beside the person, 0 to 1.
        pub foreground_weight: f64 = 0.3,
        /// Depth error of the person that costs nothing, m.
        pub relief_free_m: f64 = 0.15,
        /// Depth error of the person at which the cost is full, m.
        pub relief_full_m: f64 = 0.30,
        /// Increase of both per square metre of depth, 1/m: the noise of stereo, `sigma_px / (f B)`
        /// for a scatter of its disparity, grows with the square.
        pub relief_per_m2: f64 = 0.0,
        /// Part of the person's pixels that must have a reading, 0 to 1.
        pub min_foreground_valid: f64 = 0.5,
        /// Cost of a pixel beside the person that has no reading, or shows an object nearer, 0 to
        /// 1. Less where a camera does not measure far surfaces.
        pub unknown_cost: f64 = 0.2,
        /// Largest cost of a newcomer, and of a track that is not confirmed yet.
        pub discover_cost: f64 = 0.16,
        /// Largest cost of a person already tracked and confirmed.
        pub follow_cost: f64 = 0.30,
        /// Cells up to this cost are looked at more closely.
        pub refine_cost: f64 = 0.4,
        /// Cost at which person and no person are equally likely; the score is the
        /// distance to it times `score_per_cost`.
        pub even_cost: f64 = 0.22,
        /// Log-odds per unit of cost.
        pub score_per_cost: f64 = 20.0,
        /// Two people are at least this far apart on the floor, m.
        pub min_separation_m: f64 = 0.3,
        /// A head found by this few qualifying cells is dropped.
        pub min_cells: u32 = 2,
        /// Followed people are searched within this radius of the prediction, m,
        /// or three standard deviations, whichever is smaller.
        pub follow_radius_m: f64 = 0.6,
        /// Background of the frame as a percentile of its depths, for the cost `squared`.
        pub background_percentile: f64 = 90.0,
        /// Log-likelihood of a person in an imagined scene that fits perfectly and is wholly
        /// visible (role `weigh`), nats. Neighbouring pixels err alike, so that this is far below
        /// the number of pixels.
        pub likelihood_nats: f64 = 12.0,
        /// Depth error of a person in an imagined scene at which a pixel no longer
        /// speaks for the person, m; never less than three standard deviations of
        /// the depth.
        pub likelihood_tolerance_m: f64 = 0.3,
        /// Weight of pixels beside a person in an imagined scene, at the same depth, if there are
        /// more of them on one side than on the other, 0 to 1: a rucksack or an arm. Those on both
        /// sides count whole.
        pub likelihood_one_sided: f64 = 0.3,
        /// Rows of a template that are evaluated at most.
        pub max_rows: usize = 28,
        /// Distance of the centre of a head behind its measured depth, m. Stereo sees less than the
        /// radius of the head: the contrast is at its outline, which lies behind the face.
        pub centre_behind_m: f64 = HEAD_RADIUS_M,
        /// Standard deviation of the head's place across the viewing ray, m.
        pub sigma_across_m: f64 = 0.03,
        /// Standard deviation of the head's depth at 0 m ...
        pub sigma_depth_m: f64 = 0.03,
        /// ... and its increase per square metre of depth, 1/m.
        pub sigma_depth_per_m2: f64 = 0.003,
    }
}
