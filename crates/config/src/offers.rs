//! Offers of a plugin to the applications: advice on its tests, settings worth trying, settings for
//! recorded detections, and the training of its model.

/// Advice on a test of the funnel that drops candidates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Remedy {
    /// Name of the test; one that ends in `*` is a prefix.
    pub test: &'static str,
    /// Keys of the settings that decide it.
    pub settings: &'static [&'static str],
    /// Advice on the test.
    pub look: &'static str,
}

/// Values of a setting that are worth a trial on any log.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrialValues {
    /// Key of the setting.
    pub setting: &'static str,
    /// The values.
    pub values: &'static [f64],
}

/// Settings under which a detector takes the detections that come with the frames
/// ([`tagalong_core::Frame::recorded`]), as TOML.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RecordedOffer {
    /// For boxes of whole people, as tracking benchmarks give them.
    pub whole_people: &'static str,
    /// For positions of people in metres that are known, also outside of the image.
    pub known_positions: &'static str,
}

/// Examples from which a model is trained.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TrainingData {
    /// Candidates that detectors propose in simulated rooms, annotated logs and photographs.
    #[default]
    Candidates,
    /// Windows of labelled photographs.
    Windows,
    /// Faces, and photographs without any.
    Faces,
    /// Whole frames of simulated and real rooms.
    Frames,
    /// Panoramas of simulated rooms.
    Panoramas,
    /// Laser scans.
    LaserScans,
}

/// Training of the model of a plugin.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct TrainingOffer {
    /// Examples that the trainer learns from.
    pub data: TrainingData,
    /// Settings of a quick trial, as TOML: fewer combinations.
    pub quick_settings: &'static str,
}

impl TrainingOffer {
    /// Creates the offer: the examples that the trainer learns from, and the settings of a quick trial,
    /// as TOML.
    pub const fn new(data: TrainingData, quick_settings: &'static str) -> Self {
        Self { data, quick_settings }
    }
}
