use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_config::check_settings;
use tagalong_core::{Error, Result, settings};

use crate::Blob;

/// Method by which the distance is computed from the features.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum Distance {
    /// A network of three features and four hidden units.
    Network,
    /// The same network, trained by gradient descent: back-propagation at a rate of 0.3.
    Gradient,
    /// A network with all measured features as inputs.
    Rich,
    /// Ridge regression on the lower edge, its square, its inverse, width and area.
    Ridge,
    /// The range at which the ray of the lower edge meets the floor.
    Analytic,
}

/// Step after the measurement of a person.
#[derive(Clone, Copy, Debug)]
pub struct AfterMeasuring {
    /// Its name, by which steps are told apart.
    pub name: &'static str,
    /// Changes what was measured, by the number of pixels in each column.
    pub correct: fn(&mut Blob, &[u16]),
}

impl PartialEq for AfterMeasuring {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

settings! {
    /// Settings of `omni-appearance`.
    pub struct Config {
        /// Model file, relative to the config; empty: the built-in model.
        pub model: String,
        /// Method for the distance: `network`, `gradient`, `rich`, `ridge` or `analytic`.
        pub distance: Distance = Distance::Network,
        /// Name of the person in the model with the fit to use; `general` for the fit to
        /// all people, `nearest` for the person with the closest appearance.
        pub person: String = "general".into(),
        /// Number of images of the empty scene from which the background is computed; there are no
        /// detections before.
        #[schemars(range(min = 1, max = 10000))]
        pub background_frames: u32 = 24,
        /// Number of standard deviations by which a pixel must differ from the background.
        #[schemars(range(min = 0.0, max = 100.0))]
        pub threshold_sigmas: f64 = 4.0,
        /// Number of grey levels by which it must differ as well.
        pub threshold_floor: u8 = 6,
        /// Time constant with which the background adapts to a change, s; 0: it never adapts.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub adapt_s: f64 = 20.0,
        /// Time after which a pixel that differs without interruption becomes background, s; 0:
        /// never.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub absorb_s: f64 = 60.0,
        /// Least fraction of the background's colours, on average, at which a darker pixel may be
        /// shadow; 1: no shadows are found.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub shadow_min: f64 = 0.6,
        /// Largest fraction of the background's colours at which a pixel may be shadow.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub shadow_max: f64 = 0.97,
        /// Largest difference between these fractions of the three colours in a shadow.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub shadow_tint: f64 = 0.05,
        /// Least number of pixels in a column of a person; more if columns of the empty scene had
        /// more.
        #[schemars(range(min = 1, max = 1000))]
        pub column_pixels: u16 = 4,
        /// Widest gap, in columns, that does not divide a person.
        #[schemars(range(max = 100))]
        pub bridge_columns: usize = 4,
        /// Least number of pixels of a person.
        pub min_pixels: u32 = 60,
        /// A run is divided where its columns fall below this fraction of the lower of the two
        /// neighbouring peaks; 0: never.
        #[schemars(range(min = 0.0, max = 0.999))]
        pub valley: f64 = 0.5,
        /// Largest number of people in an image; the largest ones are kept.
        #[schemars(range(min = 1, max = 100))]
        pub max_people: usize = 8,
        /// Lowest and highest head that is accepted, m.
        #[schemars(inner(range(min = -0.999, max = 3.999)))]
        pub head_height_m: [f64; 2] = [0.9, 2.2],
        /// Standard deviation of the bearing, degrees.
        #[schemars(range(min = 0.01, max = 90.0))]
        pub sigma_bearing_deg: f64 = 0.4,
        /// Standard deviation of the visible body about its centre, m: arms and legs swing.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub sigma_aside_m: f64 = 0.035,
        /// Standard deviation of the height of the head, m.
        #[schemars(range(min = 0.001, max = 10.0))]
        pub sigma_height_m: f64 = 0.12,
        /// Distances of walls and furniture, m: when the background is moved with the robot, the
        /// distance that fits best is assumed.
        #[schemars(length(min = 1, max = 16), inner(range(min = 0.5, max = 1000.0)))]
        pub walls_m: Vec<f64> = vec![1.2, 2.0, 3.5, 6.0],
        /// Uncertainty of the background after the robot has moved, columns and rows.
        #[schemars(inner(range(max = 20)))]
        pub slack_px: [usize; 2] = [3, 2],
        /// Least share of a person's pixels that differ from the previous image once the robot has
        /// moved; that image is moved like the background and at least 0.2 s old. 0: not required.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub changed_part: f64 = 0.3,
        /// Step after the measurement of a person: of a program, not of a file.
        #[serde(skip)]
        pub after_measuring: Option<AfterMeasuring>,
    }
}

impl Config {
    /// Refuses settings outside their ranges.
    pub(crate) fn check(&self) -> Result<()> {
        check_settings(self)?;
        let [low, high] = self.head_height_m;
        if low >= high {
            return Err(Error::setting("head_height_m", format!("must rise, not {low} to {high}")));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_setting_has_its_bounds() {
        fn checked(line: &str) -> Result<()> {
            toml::from_str::<Config>(line).unwrap().check()
        }

        let good = [
            "background_frames = 10000",
            "threshold_sigmas = 100.0",
            "adapt_s = 1000000.0",
            "absorb_s = 0.0",
            "shadow_min = 1.0",
            "shadow_tint = 1.0",
            "column_pixels = 1000",
            "bridge_columns = 100",
            "valley = 0.0",
            "max_people = 100",
            "head_height_m = [-0.9, 3.9]",
            "sigma_bearing_deg = 90.0",
            "sigma_aside_m = 0.0",
            "sigma_height_m = 10.0",
            "walls_m = [0.5, 1000.0]",
            "slack_px = [20, 0]",
            "changed_part = 1.0",
        ];
        for line in good {
            assert!(checked(line).is_ok(), "{line}");
        }
        let wrong = [
            "background_frames = 0",
            "background_frames = 10001",
            "threshold_sigmas = 100.1",
            "adapt_s = -0.1",
            "absorb_s = -1.0",
            "shadow_min = 1.1",
            "shadow_max = -0.1",
            "shadow_tint = 1.1",
            "column_pixels = 0",
            "bridge_columns = 101",
            "valley = 1.0",
            "max_people = 0",
            "max_people = 101",
            "head_height_m = [-1.0, 2.0]",
            "head_height_m = [1.0, 1.0]",
            "head_height_m = [1.0, 4.0]",
            "sigma_bearing_deg = 0.001",
            "sigma_aside_m = 1.1",
            "sigma_height_m = 0.0",
            "walls_m = []",
            "walls_m = [0.4, 2.0]",
            "slack_px = [0, 21]",
            "changed_part = 1.1",
        ];
        for line in wrong {
            let key = line.split(' ').next().unwrap();
            let told = checked(line).map_err(|error| error.to_string());
            assert!(told.as_ref().is_err_and(|why| why.contains(key)), "{line}: {told:?}");
        }
    }
}
