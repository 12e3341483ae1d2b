//! The copy: a log with the topics that robots use.

use std::path::Path;

use nalgebra::Isometry2;
use tagalong_core::{Images, Stamp, spatial_pose};
use tagalong_geometry::{Camera, Lens};
use tagalong_log::msgs::{CameraInfo, Header, Image, Odometry, TFMessage};
use tagalong_log::write::{MessageLog, WriteError};
use tagalong_log::{COPY_OF, Limits, LogFacts, read_attachment};

const ROBOT_FRAME: &str = "base_link";
const CAMERA_FRAME: &str = "camera_optical_frame";
const COLOUR: &str = "/camera/color";
const DEPTH: &str = "/camera/aligned_depth_to_color";

/// A frame of the copy.
pub(super) struct Moment {
    /// Time of the images.
    pub(super) stamp: Stamp,
    /// The images.
    pub(super) images: Images,
    /// The camera, with its pose on the robot.
    pub(super) camera: Camera,
    /// Pose of the robot in the odometry frame.
    pub(super) odom_from_robot: Isometry2<f64>,
}

/// Writer of a copy.
pub(super) struct Recording {
    log: MessageLog,
    /// True if the log has odometry.
    moves: bool,
}

impl Recording {
    /// Starts a copy of a log.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub(super) fn create(path: &Path, facts: &LogFacts) -> Result<Self, WriteError> {
        let moves = facts.odometry_topic.is_some();
        let mut log = MessageLog::create(path)?;
        let limits = Limits::default();
        // A copy of a copy goes back to the same recording. A log that is no MCAP file has no attachment.
        let earlier = read_attachment(&facts.path, COPY_OF, &limits).ok().flatten();
        let earlier = earlier.and_then(|bytes| String::from_utf8(bytes).ok());
        log.attach(COPY_OF, "text/plain", &earlier.unwrap_or_else(|| facts.sha256.clone()))?;
        Ok(Self { log, moves })
    }

    /// Writes a frame.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub(super) fn frame(&mut self, moment: &Moment) -> Result<(), WriteError> {
        self.poses(moment)?;
        let Images { colour, grey, depth, .. } = &moment.images;
        if let Some(colour) = colour {
            let data = colour.pixels().as_flattened();
            self.image(COLOUR, moment, "rgb8", (colour.width(), colour.height()), data)?;
        } else if let Some(grey) = grey {
            self.image(COLOUR, moment, "mono8", (grey.width(), grey.height()), grey.pixels())?;
        }
        if let Some(depth) = depth {
            let data: Vec<u8> = depth.pixels().iter().flat_map(|m| m.to_le_bytes()).collect();
            self.image(DEPTH, moment, "32FC1", (depth.width(), depth.height()), &data)?;
        }
        Ok(())
    }

    /// Completes the file.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub(super) fn finish(self) -> Result<(), WriteError> {
        self.log.finish()
    }

    /// Writes the pose of the camera, and that of the robot, before the images that they are for.
    fn poses(&mut self, moment: &Moment) -> Result<(), WriteError> {
        let mount = &moment.camera.robot_from_camera;
        let tf = TFMessage::of_link(moment.stamp, ROBOT_FRAME, CAMERA_FRAME, mount);
        self.log.send("/tf", moment.stamp, &tf)?;
        if !self.moves {
            return Ok(());
        }
        let pose = spatial_pose(&moment.odom_from_robot);
        let odometry = Odometry::of_pose(moment.stamp, "odom", ROBOT_FRAME, &pose);
        self.log.send("/odom", moment.stamp, &odometry)
    }

    fn image(
        &mut self,
        camera: &str,
        moment: &Moment,
        encoding: &str,
        size: (usize, usize),
        data: &[u8],
    ) -> Result<(), WriteError> {
        let header = Header::new(moment.stamp, CAMERA_FRAME);
        if let Lens::Pinhole(lens) = &moment.camera.lens {
            let info = CameraInfo::of_lens(&header, lens, size, 0.0);
            self.log.send(&format!("{camera}/camera_info"), moment.stamp, &info)?;
        }
        let (columns, rows) = (size.0 as u32, size.1 as u32);
        let image = Image::packed(header, encoding, columns, rows, data);
        self.log.send(&format!("{camera}/image_raw"), moment.stamp, &image)
    }
}
