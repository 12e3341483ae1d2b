use tagalong_core::settings;

settings! {
    /// Settings of the filter `last-seen`.
    pub struct Config {
        /// Compensates the robot's own motion: a person stays where they were last seen in the
        /// room. If false, they stay at the same place relative to the robot.
        pub ego_motion: bool = true,
        /// Growth of the standard deviation of an unobserved person's position (random walk), m per
        /// square root of a second.
        #[schemars(range(min = 1e-6, max = 100.0))]
        pub wander: f64 = 0.5,
        /// Time up to the last detection over which the reported velocity is measured, s. Nothing else
        /// uses this velocity.
        #[schemars(range(min = 1e-6, max = 100.0))]
        pub velocity_over_s: f64 = 1.0,
    }
}
