use crate::Config;
use crate::warp::{Sweep, Warp};

/// Number of parts in which the background is renewed while the robot stands.
pub(crate) const TURNS: usize = 4;
/// Mark of a taken pixel at which the background stays as it is, however long.
pub(crate) const HELD: u8 = 2;
/// Weight of a new image in the mean while the robot moves.
const MOVING_PART: f32 = 0.5;

/// Rate at which the background follows the image.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pace {
    /// Part of the difference that is taken over in one image.
    pub(crate) part: f32,
    /// Time after which a differing pixel becomes background, s.
    pub(crate) absorb_s: f32,
    /// Time since the previous image, s.
    pub(crate) dt_s: f32,
    /// One row in this many is renewed in each image.
    pub(crate) turns: usize,
}

/// Model of the empty scene: three colours per pixel, row by row.
///
/// The first images give mean and spread (P5, section 4.2: the mean of five). Few images do not
/// give the spread of a single pixel, so it is pooled along the rows.
#[derive(Clone, Debug)]
pub struct Background {
    width: usize,
    frames: u32,
    /// Number of these images that were taken while the robot stood.
    still: u32,
    mean: Vec<f32>,
    squares: Vec<f32>,
    /// Time for which each pixel has differed, s.
    taken_s: Vec<f32>,
    /// Rounded mean.
    pub(crate) level: Vec<u8>,
    /// Largest difference of a colour value from the background that is still background.
    pub(crate) limit: Vec<u8>,
}

impl Background {
    /// Creates a background for images of this size, without data.
    pub fn new(width: usize, height: usize) -> Self {
        let values = 3 * width * height;
        Self {
            width,
            frames: 0,
            still: 0,
            mean: vec![0.0; values],
            squares: vec![0.0; values],
            taken_s: vec![0.0; width * height],
            level: vec![0; values],
            limit: vec![u8::MAX; values],
        }
    }

    /// Returns the number of images it was made of.
    pub fn frames(&self) -> u32 {
        self.frames
    }

    /// Returns the number of colour values, three per pixel.
    pub fn len(&self) -> usize {
        self.level.len()
    }

    /// Returns true if the image has no pixels.
    pub fn is_empty(&self) -> bool {
        self.level.is_empty()
    }

    /// Adds an image of the empty scene.
    pub fn add(&mut self, colours: &[u8], config: &Config) {
        self.frames += 1;
        self.still += 1;
        let part = 1.0 / self.frames as f32;
        let kept = self.mean.iter_mut().zip(&mut self.squares).zip(&mut self.level);
        for (((mean, squares), level), colour) in kept.zip(colours) {
            // Welford's update.
            let value = f32::from(*colour);
            let before = *mean;
            *mean += part * (value - before);
            *squares += (value - before) * (value - *mean);
            *level = mean.round() as u8;
        }
        self.set_limits(config);
    }

    /// Adds an image of the empty scene while the robot moves: differences from the mean are then
    /// errors of the odometry, not noise, and do not enter the spread.
    pub(crate) fn add_moving(&mut self, colours: &[u8], config: &Config) {
        self.frames += 1;
        let part = if self.frames == 1 { 1.0 } else { MOVING_PART };
        for ((mean, level), colour) in self.mean.iter_mut().zip(&mut self.level).zip(colours) {
            *mean += part * (f32::from(*colour) - *mean);
            *level = (*mean + 0.5) as u8;
        }
        self.set_limits(config);
    }

    fn set_limits(&mut self, config: &Config) {
        let count = (self.still.max(2) - 1) as f32;
        let row = 3 * self.width.max(1);
        for (limits, squares) in self.limit.chunks_mut(row).zip(self.squares.chunks(row)) {
            let pooled = squares.iter().sum::<f32>() / (count * row as f32);
            for (limit, squares) in limits.iter_mut().zip(squares) {
                // The spread of a single pixel is reliable only after a dozen images.
                let own = if self.still >= 12 { squares / count } else { 0.0 };
                let sigmas = config.threshold_sigmas as f32 * pooled.max(own).sqrt();
                *limit = (sigmas.ceil() as u8).max(config.threshold_floor);
            }
        }
    }

    /// Follows an image: by a part where `taken` is 0; not at all where it is [`HELD`]; elsewhere
    /// completely once it has not been 0 for longer than [`Pace::absorb_s`]. One row in
    /// [`Pace::turns`] is renewed.
    pub(crate) fn follow(&mut self, colours: &[u8], taken: &[u8], pace: &Pace, phase: usize) {
        let turns = pace.turns.max(1);
        // One row's turn makes up for the images in which other rows had theirs.
        let part = 1.0 - (1.0 - pace.part.clamp(0.0, 1.0)).powi(turns as i32);
        let passed_s = turns as f32 * pace.dt_s;
        let width = self.width.max(1);
        let known = self
            .mean
            .chunks_exact_mut(3 * width)
            .zip(self.level.chunks_exact_mut(3 * width))
            .zip(self.taken_s.chunks_exact_mut(width));
        let seen = colours.chunks_exact(3 * width).zip(taken.chunks_exact(width));
        for (((mean, level), taken_s), (colours, taken)) in
            known.zip(seen).skip(phase % turns).step_by(turns)
        {
            let pixels = mean.chunks_exact_mut(3).zip(level.chunks_exact_mut(3));
            let seen = colours.chunks_exact(3).zip(taken.iter().zip(taken_s));
            let changing = pixels.zip(seen).filter(|(_, (_, (taken, _)))| **taken != HELD);
            for ((mean, level), (colour, (taken, taken_s))) in changing {
                *taken_s = if *taken == 0 { 0.0 } else { *taken_s + passed_s };
                let part =
                    if *taken == 0 { part } else { f32::from(u8::from(*taken_s > pace.absorb_s)) };
                for i in 0..3 {
                    mean[i] += part * (f32::from(colour[i]) - mean[i]);
                    level[i] = (mean[i] + 0.5) as u8;
                }
            }
        }
    }

    /// Moves mean and time of each pixel with the robot's motion, as `sweep` estimates it.
    pub(crate) fn move_by(&mut self, sweep: &mut Sweep, warps: &[Warp], colours: &[u8]) {
        sweep.apply(warps, colours, &mut self.mean, &mut self.taken_s);
        for (level, mean) in self.level.iter_mut().zip(&self.mean) {
            *level = (*mean + 0.5) as u8;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn config() -> Config {
        Config { threshold_sigmas: 4.0, threshold_floor: 6, ..Config::default() }
    }

    #[test]
    fn the_mean_is_the_mean_and_the_limit_follows_the_noise() {
        let mut background = Background::new(4, 2);
        for step in 0..20u8 {
            let noise = if step % 2 == 0 { 90 } else { 110 };
            let quiet = [[100; 12], [noise; 12]].concat();
            background.add(&quiet, &config());
        }
        assert!(background.level.iter().all(|level| *level == 100));
        assert_eq!(background.limit[..12], [6; 12]);
        // Standard deviation of +-10 from 20 values: 10.26; four of them.
        assert_eq!(background.limit[12..], [42; 12]);
    }

    #[test]
    fn it_follows_the_light_but_not_the_people() {
        let mut background = Background::new(2, 1);
        background.add(&[100; 6], &config());
        let pace = Pace { part: 0.05, absorb_s: 30.0, dt_s: 0.1, turns: TURNS };
        for phase in 0..280 {
            background.follow(&[120; 6], &[0, 1], &pace, phase);
        }
        assert_eq!(background.level, [120, 120, 120, 100, 100, 100]);
        for phase in 280..320 {
            background.follow(&[120; 6], &[0, 1], &pace, phase);
        }
        assert_eq!(background.level, [120; 6], "what stands there for half a minute is furniture");
        for phase in 320..720 {
            background.follow(&[90; 6], &[0, HELD], &pace, phase);
        }
        assert_eq!(background.level, [90, 90, 90, 120, 120, 120], "it is held under a person");
    }

    #[test]
    fn while_the_robot_moves_the_first_image_counts_fully_and_others_in_part() {
        let mut background = Background::new(2, 1);
        background.add_moving(&[100; 6], &config());
        assert_eq!(background.level, [100; 6]);
        background.add_moving(&[200; 6], &config());
        assert_eq!(background.level, [(100.0 + 100.0 * MOVING_PART).round() as u8; 6]);
    }
}
