use super::args::TrainArgs;
use super::rooms::ImageTiming;

/// Amount of simulated data.
pub struct Plan {
    /// Scenes of the first round and of each further one.
    pub scenes: [u64; 2],
    /// Further rounds.
    pub rounds: usize,
    /// Scenes of the held-out rooms.
    pub test_scenes: u64,
    /// Few images per second: distant moments are more informative than neighbouring ones.
    pub look: ImageTiming,
    /// Rate and duration for tests; tracks need more images.
    pub test_look: ImageTiming,
}

impl Plan {
    /// Returns the amount that the arguments ask for.
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
                // Given scenes last as long as they say, mostly longer than these rooms.
                test_scenes: if args.world.is_empty() { 36 } else { 8 },
                look,
                test_look,
            }
        }
    }

    /// Returns the numbers of the scenes of a round; no number is repeated.
    pub fn numbers(&self, round: usize, seed: u64) -> std::ops::Range<u64> {
        let [first, further] = self.scenes;
        let before = if round == 0 { 0 } else { first + (round as u64 - 1) * further };
        let count = if round == 0 { first } else { further };
        let start = seed.wrapping_mul(1000) % 1_000_000 + before;
        start..start + count
    }
}
