//! For any report of the pipeline the wheels get a sensible command.

use proptest::prelude::*;

use super::*;

/// States in a row for one controller.
const ROW: usize = 50;
/// A million states in release, a tenth of that in debug.
const ROWS: u32 = if cfg!(debug_assertions) { 2_000 } else { 20_000 };

/// Input of a controller in one frame.
#[derive(Clone, Debug)]
struct State {
    place: [f64; 2],
    velocity: [f64; 2],
    unseen_s: f64,
    motion: [f64; 3],
    is_there: bool,
}

fn number(usual: f64) -> impl Strategy<Value = f64> {
    prop_oneof![
        12 => -usual..usual,
        1 => prop::num::f64::ANY,
        1 => prop::sample::select(vec![
            0.0, -0.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MIN_POSITIVE, 5e-324,
            f64::MAX, f64::MIN, 1e-160, -1e-160, 1e160,
        ]),
    ]
}

fn state() -> impl Strategy<Value = State> {
    let place = [number(5.0), number(5.0)];
    let velocity = [number(2.0), number(2.0)];
    let motion = [number(0.1), number(0.1), number(0.2)];
    (place, velocity, number(2.0), motion, prop::bool::weighted(0.9)).prop_map(
        |(place, velocity, unseen_s, motion, is_there)| State {
            place,
            velocity,
            unseen_s,
            motion,
            is_there,
        },
    )
}

fn row() -> impl Strategy<Value = Vec<State>> {
    prop::collection::vec(state(), ROW)
}

fn config() -> impl Strategy<Value = Config> {
    let kinds = [Path::A, Path::B, Path::C];
    let kinds = prop::sample::select(kinds.to_vec());
    let trail_m = prop::sample::select(vec![0.0, 1.0]);
    (kinds, trail_m).prop_map(|(path, trail_m)| Config { path, trail_m, ..Config::default() })
}

impl State {
    fn target(&self) -> Option<Track> {
        let [x, y] = self.place;
        let person = target(x, y, Vector2::from(self.velocity));
        self.is_there.then_some(person.with_unseen_s(self.unseen_s))
    }

    fn motion(&self) -> EgoMotion {
        let [forward, turn, dt] = self.motion;
        EgoMotion { forward, turn, ..EgoMotion::at_rest(dt) }
    }

    fn mirrored(&self) -> Self {
        let [forward, turn, dt] = self.motion;
        Self {
            place: [self.place[0], -self.place[1]],
            velocity: [self.velocity[0], -self.velocity[1]],
            motion: [forward, -turn, dt],
            ..self.clone()
        }
    }
}

fn run(config: &Config, row: &[State]) -> Vec<WheelSpeeds> {
    let mut controller = ArcFollow::new(config.clone()).unwrap();
    row.iter().map(|s| command(&mut controller, s.motion(), s.target().as_ref())).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(ROWS))]

    #[test]
    fn commands_are_finite_and_limited_and_zero_without_a_target(config in config(), row in row()) {
        fn fits(speed: f64) -> bool {
            speed.is_finite() && speed.abs() <= MAX_MPS * (1.0 + 1e-9)
        }

        let wheels = run(&config, &row);
        let mut before = 0.0;
        for (state, wheels) in row.iter().zip(&wheels) {
            prop_assert!(fits(wheels.left) && fits(wheels.right), "{wheels:?}");
            prop_assert!(state.is_there || *wheels == WheelSpeeds::STOP);
            let nowhere = state.place.iter().any(|c| !c.is_finite());
            prop_assert!(!nowhere || *wheels == WheelSpeeds::STOP);
            prop_assert!(speed(*wheels) >= -1e-9, "backs up");
            let dt = if state.motion[2] > 0.0 { state.motion[2].min(0.5) } else { 0.0 };
            prop_assert!(speed(*wheels) <= before + config.max_acceleration * dt + 1e-9);
            let limited = turn_rate(*wheels).abs() <= config.max_turn_rate * (1.0 + 1e-9);
            prop_assert!(limited, "{wheels:?}");
            before = speed(*wheels);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(ROWS / 4))]

    #[test]
    fn mirrored_input_gives_mirrored_wheels(config in config(), mut row in row()) {
        // Straight behind, the way to turn is a matter of taste.
        row.iter_mut().for_each(|state| state.is_there &= state.place[1] != 0.0);
        let mirror: Vec<State> = row.iter().map(State::mirrored).collect();
        for (there, back) in run(&config, &row).iter().zip(run(&config, &mirror)) {
            prop_assert!((there.left - back.right).abs() < 1e-9, "{there:?} {back:?}");
            prop_assert!((there.right - back.left).abs() < 1e-9, "{there:?} {back:?}");
        }
    }
}

proptest! {
    #[test]
    fn a_small_step_of_the_target_is_a_small_step_of_the_wheels(
        x in -5.0..5.0f64, y in -5.0..5.0f64, vx in -1.0..1.0f64, vy in -1.0..1.0f64,
        path in prop::sample::select(vec![Path::A, Path::C]),
    ) {
        let config = Config { path, latency_s: 0.0, ..Config::default() };
        // Left and right of straight behind there are two ways to turn.
        prop_assume!(x > 0.0 || y.abs() > 1e-3);
        let velocity = Vector2::new(vx, vy);
        let [here, there] = [(x, y), (x + 1e-7, y - 1e-7)].map(|(x, y)| {
            let mut controller = ArcFollow::new(config.clone()).unwrap();
            command(&mut controller, EgoMotion::at_rest(0.1), Some(&target(x, y, velocity)))
        });
        // Where turning on the spot begins, the wanted speed jumps, and the acceleration limits the
        // result.
        let near = (y.atan2(x).abs().to_degrees() - 60.0).abs() < 1e-3;
        let bound = if near { 0.1 } else { 1e-4 };
        prop_assert!((here.left - there.left).abs() < bound, "{here:?} {there:?}");
        prop_assert!((here.right - there.right).abs() < bound, "{here:?} {there:?}");
    }
}
