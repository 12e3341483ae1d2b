use tagalong_core::settings;

settings! {
    /// Settings of the filter `ekf`.
    pub struct Config {
        /// Spectral density of the person's white acceleration, m²/s³.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub acceleration_noise: f64 = 0.5,
        /// Random walk of the height of the head (sitting down, gait), m per square root of a
        /// second.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub height_noise: f64 = 0.07,
        /// Variance of each velocity component of a new track, m²/s².
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub initial_velocity_variance: f64 = 2.0,
        /// Standard deviation added to that of each detection, m, because detectors underestimate
        /// their errors.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub extra_sigma_m: f64 = 0.02,
        /// Degrees of freedom of the measurement noise (Student's t): with few of them, such as 4,
        /// a detection far from the prediction has less weight; 0: the noise is normal, and every
        /// detection has full weight.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub student_dof: f64 = 0.0,
        /// Time constant with which the velocity decays, s; 0: no decay. The prediction of a person
        /// who is hidden for much longer than this stops.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub velocity_decay_s: f64 = 0.0,
    }
}
