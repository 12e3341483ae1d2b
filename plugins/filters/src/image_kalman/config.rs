use tagalong_core::settings;

settings! {
    /// Settings of `image-kalman`. Lengths in the image are in widths of the box, so that they hold
    /// at every distance; the box of an upper body is 0.57 m wide.
    pub struct Config {
        /// Spectral density of the white acceleration of the box, widths²/s³.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub acceleration_noise: f64 = 1.5,
        /// Factor by which `acceleration_noise` is larger in a manoeuvre; 0: no manoeuvres.
        /// Otherwise two filters run for each person, weighted by the likelihoods of the
        /// detections.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub manoeuvre_factor: f64 = 0.0,
        /// Rate at which manoeuvres begin and end, 1/s.
        #[schemars(range(min = 0.0, max = 1e3))]
        pub manoeuvre_rate_hz: f64 = 0.5,
        /// Random walk of the box in addition to its velocity, widths per square root of a second:
        /// the shaking of a camera whose motion is not known.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub position_noise: f64 = 0.0,
        /// Random walk of the width, as a fraction of it per square root of a second.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub scale_noise: f64 = 0.3,
        /// Spectral density of the white acceleration along the ray, m²/s³.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub range_noise: f64 = 0.5,
        /// Standard deviation of the velocity of the box of a new track, widths/s.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub initial_speed: f64 = 2.5,
        /// Standard deviation of the velocity of a new track along the ray, m/s.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub initial_range_speed_mps: f64 = 1.4,
        /// Standard deviation added to that of the centre of a box, widths: errors that detectors
        /// omit from their covariance.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub sigma_centre: f64 = 0.03,
        /// Standard deviation of a box's width, as a fraction of it.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub sigma_scale: f64 = 0.1,
        /// Standard deviation added to that of a range, m.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub sigma_range_m: f64 = 0.02,
        /// Weight of a detection in the shape of the box (its height over its width, and the
        /// position of the head in it), 0 to 1.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub shape_weight: f64 = 0.3,
        /// Time constant with which the velocity of the box decays, s; 0: no decay. The prediction
        /// of a person who is hidden for much longer than this stops.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub velocity_decay_s: f64 = 0.0,
        /// Filters a track that is observed again after frames without a detection anew over these
        /// frames, along the straight line between the two observations.
        pub reupdate: bool = false,
        /// Reports a track that has a detection with the box of the detection instead of the
        /// filtered one: for a detector whose boxes are better than their average over time.
        pub observed_boxes: bool = false,
    }
}
