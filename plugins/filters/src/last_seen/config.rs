use tagalong_core::settings;

settings! {
    /// Settings of the filter `last-seen`.
    pub struct Config {
        /// Account for the robot's own motion: a person stays where last seen in
        /// the room. Otherwise at the same place before the robot, wherever that
        /// goes.
        pub ego_motion: bool = true,
        /// Random walk of an unobserved person: growth of the standard deviation, metres per square
        /// root of a second.
        #[schemars(range(min = 1e-6, max = 100.0))]
        pub wander: f64 = 0.5,
        /// The velocity that is reported, and used for nothing, is the way between
        /// the last sighting and the first one in this time before it, s.
        #[schemars(range(min = 1e-6, max = 100.0))]
        pub velocity_over_s: f64 = 1.0,
    }
}
