use super::args::TrainArgs;
use super::rooms::ImageTiming;

/// Amount of simulated data.
pub struct Plan {
    /// Number of scenes of the first round, and of each further one.
    pub scenes: [u64; 2],
    /// Further rounds.
    pub rounds: usize,
    /// Number of scenes of held-out rooms.
    pub test_scenes: u64,
    /// A low rate of images: images that are farther apart in time are more informative.
    pub look: ImageTiming,
    /// Rate and duration of the scenes for tests; tracks need more images.
    pub test_look: ImageTiming,
}

impl Plan {
    /// Returns the amount for the arguments.
    pub fn new(args: &TrainArgs) -> Self {
        let scenes = args.scenes;
        let rounds = args.rounds.map(|rounds| rounds as usize);
        let look = ImageTiming { rate_hz: 1.0, duration_s: 7.0 };
        if args.quick {
            let test_look = ImageTiming { rate_hz: 4.0, duration_s: 2.0 };
            let rounds = rounds.unwrap_or(1);
            Self { scenes: [scenes.unwrap_or(6), 4], rounds, test_scenes: 4, look, test_look }
        } else {
            let test_look = ImageTiming { rate_hz: 5.0, duration_s: 4.0 };
            Self {
                scenes: [scenes.unwrap_or(256), 64],
                rounds: rounds.unwrap_or(2),
                // Given scenes have their own duration, which is mostly longer than that of these
                // rooms.
                test_scenes: if args.world.is_empty() { 36 } else { 8 },
                look,
                test_look,
            }
        }
    }

    /// Returns the numbers of the scenes of a round, which no other round has.
    pub fn numbers(&self, round: usize, seed: u64) -> std::ops::Range<u64> {
        let [first, further] = self.scenes;
        let before = if round == 0 { 0 } else { first + (round as u64 - 1) * further };
        let count = if round == 0 { first } else { further };
        let start = seed.wrapping_mul(1000) % 1_000_000 + before;
        start..start + count
    }
}
