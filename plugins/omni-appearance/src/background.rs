use crate::Config;

/// What the empty room looks like: three colours a pixel, row by row.
///
/// The first images make mean and spread (P5, section 4.2: the mean of five).
/// Of five images no pixel's spread is known, so it is pooled along the rows.
#[derive(Clone, Debug)]
pub struct Background {
    width: usize,
    frames: u32,
    mean: Vec<f32>,
    squares: Vec<f32>,
    /// The mean, rounded.
    pub(crate) level: Vec<u8>,
    /// A colour that differs by more differs from the background.
    pub(crate) limit: Vec<u8>,
}

impl Background {
    /// Of an image with so many columns and rows; nothing is known of it yet.
    pub fn new(width: usize, height: usize) -> Self {
        let values = 3 * width * height;
        Self {
            width,
            frames: 0,
            mean: vec![0.0; values],
            squares: vec![0.0; values],
            level: vec![0; values],
            limit: vec![u8::MAX; values],
        }
    }

    /// Images that it is made of.
    pub fn frames(&self) -> u32 {
        self.frames
    }

    /// Colours of all pixels, as many as the image has.
    pub fn len(&self) -> usize {
        self.level.len()
    }

    /// True if the image has no pixels.
    pub fn is_empty(&self) -> bool {
        self.level.is_empty()
    }

    /// Takes in an image of the empty room.
    pub fn add(&mut self, colours: &[u8], config: &Config) {
        self.frames += 1;
        let part = 1.0 / self.frames as f32;
        let kept = self.mean.iter_mut().zip(&mut self.squares).zip(&mut self.level);
        for (((mean, squares), level), colour) in kept.zip(colours) {
            // Welford's update.
            let (value, before) = (f32::from(*colour), *mean);
            *mean += part * (value - before);
            *squares += (value - before) * (value - *mean);
            *level = mean.round() as u8;
        }
        self.set_limits(config);
    }

    fn set_limits(&mut self, config: &Config) {
        let count = (self.frames.max(2) - 1) as f32;
        let row = 3 * self.width.max(1);
        for (limits, squares) in self.limit.chunks_mut(row).zip(self.squares.chunks(row)) {
            let pooled = squares.iter().sum::<f32>() / (count * row as f32);
            for (limit, squares) in limits.iter_mut().zip(squares) {
                // A pixel's own spread says something after a dozen images.
                let own = if self.frames >= 12 { squares / count } else { 0.0 };
                let sigmas = config.threshold_sigmas as f32 * pooled.max(own).sqrt();
                *limit = (sigmas.ceil() as u8).max(config.threshold_floor);
            }
        }
    }

    /// Follows an image slowly: by `free` of the difference where `taken` is 0,
    /// by `taken_part` where it is not.
    pub(crate) fn follow(&mut self, colours: &[u8], taken: &[u8], free: f32, taken_part: f32) {
        let parts = [free, taken_part];
        let pixels = self.mean.chunks_exact_mut(3).zip(self.level.chunks_exact_mut(3));
        for (((mean, level), colour), taken) in
            pixels.zip(colours.chunks_exact(3)).zip(taken)
        {
            let part = parts[usize::from(*taken != 0)];
            for ((mean, level), colour) in mean.iter_mut().zip(level).zip(colour) {
                *mean += part * (f32::from(*colour) - *mean);
                *level = (*mean + 0.5) as u8;
            }
        }
    }

    /// Replaces the mean by what `read` finds in it, colour by colour.
    pub(crate) fn move_by(&mut self, read: impl FnOnce(&[f32], &mut [f32]), moved: &mut Vec<f32>) {
        moved.resize(self.mean.len(), 0.0);
        read(&self.mean, moved);
        std::mem::swap(&mut self.mean, moved);
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
        for _ in 0..200 {
            background.follow(&[120; 6], &[0, 1], 0.05, 0.0);
        }
        assert_eq!(background.level, [120, 120, 120, 100, 100, 100]);
    }
}
