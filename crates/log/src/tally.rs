use std::collections::BTreeMap;

/// Names of the counters of what was read, of what a log does not have, and of frames that were made with a
/// part missing. All others count what was lost or left out.
const NO_LOSSES: &[&str] = &[
    "channels_without_schema",
    "chunks_verified",
    "chunks_without_crc",
    "depth_registered",
    "depth_unit_doubtful",
    "depth_without_colour",
    "detections_of_other_classes",
    "detections_without_frame",
    "disparity_pixels",
    "disparity_pixels_invalid",
    "frames",
    "frames_without_camera_pose",
    "frames_without_detections",
    "frames_without_laser",
    "frames_without_points",
    "logs_without_stamps",
    "messages",
    "messages_unpacked",
    "odometry_gap_frames",
    "odometry_jump_frames",
    "odometry_with_exchanged_frames",
    "right_without_left",
    "sources_without_messages",
    "time_jumps_back",
    "unknown_records_skipped",
];

/// Returns true if a counter of a log counts what was lost or left out, which may be the reason for missing
/// frames; false for what was read, and for what the log does not have.
///
/// ```
/// use tagalong_log::is_loss;
///
/// assert!(is_loss("crc_failed_chunks"));
/// assert!(!is_loss("chunks_without_crc"));
/// ```
pub fn is_loss(counter: &str) -> bool {
    !NO_LOSSES.contains(&counter)
}

/// Number and fraction of the frames without a partner that are normal: cameras skip an image from
/// time to time.
const USUAL_COUNT: u64 = 3;
const USUAL_SHARE: f64 = 0.1;

/// Returns true if more frames have no partner than cameras normally skip.
pub(crate) fn is_unusual(without: u64, frames: u64) -> bool {
    without > USUAL_COUNT && without as f64 > USUAL_SHARE * frames as f64
}

/// Losses, skipped data and remarks, counted by name and described in sentences.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tally {
    pub(crate) counters: BTreeMap<&'static str, u64>,
    pub(crate) notes: Vec<String>,
    pub(crate) lost: bool,
    /// Those of the sentences that describe losses.
    pub(crate) losses: Vec<String>,
    /// Those of the sentences that tell why images make no frame although nothing was lost.
    pub(crate) frameless: Vec<String>,
    /// Description of the first loss, from which later ones may follow.
    pub(crate) first_loss: Option<String>,
}

/// Maximum number of stored sentences; repeated ones are only counted.
const MAX_NOTES: usize = 40;

impl Tally {
    /// Counts an event that is not a loss.
    pub(crate) fn count(&mut self, name: &'static str) {
        self.add(name, 1);
    }

    /// Counts several events at once; does nothing if there are none.
    pub(crate) fn add(&mut self, name: &'static str, count: u64) {
        if count > 0 {
            *self.counters.entry(name).or_default() += count;
        }
    }

    /// Counts lost data, and describes it once per name.
    pub(crate) fn lose(&mut self, name: &'static str, what: impl FnOnce() -> String) {
        debug_assert!(is_loss(name), "`{name}` is in the list of counters that are no losses");
        self.lost = true;
        self.count(name);
        if self.counters.get(name) == Some(&1) {
            let what = what();
            self.first_loss.get_or_insert_with(|| what.clone());
            self.note_loss(what);
        }
    }

    /// Describes lost data that is already counted.
    pub(crate) fn lose_counted(&mut self, what: String) {
        self.lost = true;
        self.note_loss(what);
    }

    /// Tells why images make no frame although nothing was lost.
    pub(crate) fn tell_frameless(&mut self, what: String) {
        self.note(what.clone());
        self.frameless.push(what);
    }

    /// Adds a remark about lost data once.
    pub(crate) fn note_loss(&mut self, what: String) {
        if self.losses.len() < MAX_NOTES && !self.losses.contains(&what) {
            self.losses.push(what.clone());
        }
        self.note(what);
    }

    /// Counts an event that is not a loss, and describes it once per name.
    pub(crate) fn remark(&mut self, name: &'static str, what: impl FnOnce() -> String) {
        self.count(name);
        if self.counters.get(name) == Some(&1) {
            self.note(what());
        }
    }

    /// Adds a remark once.
    pub(crate) fn note(&mut self, text: impl Into<String>) {
        let text = text.into();
        if self.notes.len() < MAX_NOTES && !self.notes.contains(&text) {
            self.notes.push(text);
        }
    }
}
