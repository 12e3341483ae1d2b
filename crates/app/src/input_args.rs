//! Arguments that change how a log is read.

use clap::{Args, ValueEnum};
use tagalong_log::{CameraSettings, StampSource};

use crate::config_file::OuterSettings;

/// Arguments of the commands that read a log; they replace what the config says.
#[derive(Args, Clone, Debug, Default)]
pub struct InputArgs {
    /// Camera whose images are used, if there are several: the common folder of its topics, such as
    /// /front_camera.
    #[arg(long, value_name = "NAME")]
    pub camera: Option<String>,
    /// Times of the messages: their stamps, or the times at which they were recorded, if stamps are not
    /// set or come from another clock.
    #[arg(long, value_enum)]
    pub stamps: Option<StampArg>,
}

/// Source of the times of messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum StampArg {
    /// Their stamps, unless these are never set.
    Auto,
    /// Their stamps.
    Header,
    /// The times of recording.
    Recording,
}

impl InputArgs {
    /// Returns the settings of a config with those of these arguments replaced.
    pub fn applied(&self, mut outer: OuterSettings) -> OuterSettings {
        if let Some(stamps) = self.stamps {
            outer.input.stamps = match stamps {
                StampArg::Auto => StampSource::Auto,
                StampArg::Header => StampSource::Header,
                StampArg::Recording => StampSource::Recording,
            };
        }
        if let Some(name) = &self.camera {
            outer.input.camera = Some(match outer.input.camera {
                // The pose in the config is kept.
                Some(CameraSettings::Mounted(mount)) => {
                    CameraSettings::Mounted(mount.with_name(name))
                }
                _ => CameraSettings::Named(name.clone()),
            });
        }
        outer
    }
}
