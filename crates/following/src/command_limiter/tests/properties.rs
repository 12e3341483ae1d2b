//! Properties of the limiter under any wishes.

use proptest::prelude::*;

use super::*;

/// Any number, with NaN, infinite and tiny ones often.
fn any_number() -> impl Strategy<Value = f64> {
    prop_oneof![
        -3.0..3.0_f64,
        proptest::num::f64::ANY,
        Just(0.0),
        Just(f64::NAN),
        Just(f64::INFINITY),
        Just(f64::NEG_INFINITY),
        Just(f64::MIN_POSITIVE / 2.0),
        Just(f64::MAX),
    ]
}

/// Motions of the last commands, for checks of their changes by differences alone.
#[derive(Default)]
struct Tape {
    before: Twist,
    /// Accelerations of the step before; none after an emergency, which may have any.
    accels: Option<[f64; 2]>,
}

/// Allowed error of a change of the acceleration: a speed within 1e-6 of its target is set to it.
const ROUNDING: f64 = 4.0 * 1e-6 / (PERIOD_S * PERIOD_S);

impl Tape {
    /// Returns true if the motion changes no faster than it may, or if this is an emergency: then it
    /// may only end sooner.
    fn is_gentle(&mut self, command: &Command, ahead: Ahead, dt: f64) -> bool {
        let settings = CommandLimiterSettings::default();
        let before = std::mem::replace(&mut self.before, command.twist);
        let Twist { linear_mps, angular_rps, .. } = command.twist;
        let accel = (linear_mps - before.linear_mps) / dt;
        let turn = (angular_rps - before.angular_rps) / dt;
        let known = self.accels.replace([accel, turn]);
        let smooth = known
            .is_none_or(|[then, _]| (accel - then).abs() <= settings.max_jerk_mps3 * dt + ROUNDING);
        let smooth_turn = known.is_none_or(|[_, then]| {
            (turn - then).abs() <= settings.max_turn_jerk_radps3 * dt + ROUNDING
        });
        let gentle_turn = turn.abs() <= settings.max_turn_accel_radps2 + ROUNDING && smooth_turn;
        let gentle = accel <= settings.max_accel_mps2 + ROUNDING
            && -accel <= settings.max_decel_mps2 + ROUNDING
            && smooth;
        let emergencies =
            [Reason::Settling, Reason::Stalled, Reason::Blind, Reason::NotFinite, Reason::Fault];
        let is_stop = command.wheels == WheelSpeeds::STOP;
        match (command.reason, ahead) {
            (reason, _) if emergencies.contains(&reason) => {
                self.accels = None;
                is_stop
            }
            (Reason::Blocked, Ahead::Something(_)) => {
                self.accels = None;
                linear_mps.abs() < 1e-9 && gentle_turn
            }
            (Reason::Obstacle, Ahead::Something(at_m)) => {
                let braking = settings.braking(settings.reaction_s, 0.0);
                let most = braking.speed_within(at_m - STOP_M, settings.reaction_s);
                // No slower than the obstacle demands; an emergency also where it is gentle by chance.
                let is_emergency = accel < 0.0 && (linear_mps - most).abs() < 1e-6;
                if is_emergency {
                    self.accels = None;
                }
                let may_turn = gentle_turn || -accel > settings.max_decel_mps2;
                is_emergency && may_turn || gentle && gentle_turn
            }
            _ => gentle && gentle_turn,
        }
    }
}

/// Returns true if the robot comes to rest before an obstacle ahead, with its reaction.
fn stops_before(command: &Command, ahead: Ahead) -> bool {
    let speed = command.twist.linear_mps;
    match ahead {
        Ahead::Something(at_m) if speed > STILL_MPS => {
            // At once, as in an emergency.
            let limits = CommandLimiterSettings { margin_m: 0.0, ..abrupt() };
            limits.stopping_m(speed) + STOP_M <= at_m + 1e-9
        }
        _ => true,
    }
}

fn any_ahead() -> impl Strategy<Value = Ahead> {
    prop_oneof![Just(Ahead::Free), (0.0..3.0_f64).prop_map(Ahead::Something)]
}

fn any_wish() -> impl Strategy<Value = (Wish, Ahead)> {
    let aims = vec![Aim::Person, Aim::Perhaps, Aim::Search, Aim::Nobody];
    let flags = (
        any::<bool>(),
        prop::sample::select(aims),
        prop::bool::weighted(0.9),
        prop::bool::weighted(0.9),
    );
    (any_number(), any_number(), flags, any_number(), any_ahead()).prop_map(
        |(left, right, flags, pause, ahead)| {
            let (short, aim, settled, sighted) = flags;
            let stop = (!sighted).then_some(Reason::Blind);
            let pause_s = if short { PERIOD_S } else { pause };
            (Wish { aim, settled, stop, pause_s, ..wish(0, left, right) }, ahead)
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 20_000, ..ProptestConfig::default() })]

    /// With fifty wishes per case this is a million states.
    #[test]
    fn commands_are_finite_limited_and_gentle_but_for_emergencies(
        wishes in prop::collection::vec(any_wish(), 50)
    ) {
        let mut limiter = limiter_of(CommandLimiterSettings::default());
        let mut tape = Tape::default();
        for (frame, (wish, ahead)) in wishes.into_iter().enumerate() {
            let stamp = Stamp::from_nanos((frame as u64 + 1) * 100_000_000);
            let wish = Wish { stamp, ..wish };
            let command = limiter.limit(&wish, look(ahead));
            let WheelSpeeds { left, right } = command.wheels;
            prop_assert!(left.abs() <= MAX_MPS && right.abs() <= MAX_MPS, "{command:?}");
            if !command.reason.moves() && command.reason != Reason::Blocked {
                prop_assert_eq!(command.wheels, WheelSpeeds::STOP);
            }
            let before = tape.before;
            let accels = tape.accels;
            if wish.aim == Aim::Nobody {
                // An acceleration fades first.
                let fades = accels.is_none_or(|[accel, _]| accel > 0.0);
                let slower = command.twist.linear_mps.abs() <= before.linear_mps.abs() + 1e-9;
                prop_assert!(slower || fades, "{before:?} {command:?}");
            }
            let dt = if frame == 0 { LONGEST_STEP_S } else { PERIOD_S };
            prop_assert!(tape.is_gentle(&command, ahead, dt), "{before:?} {accels:?} {command:?}");
            prop_assert!(stops_before(&command, ahead), "{command:?} {ahead:?}");
        }
    }

    #[test]
    fn a_mirrored_wish_gives_mirrored_wheels(wishes in prop::collection::vec((any_number(), any_number()), 20)) {
        let mut one = limiter_of(CommandLimiterSettings::default());
        let mut other = limiter_of(CommandLimiterSettings::default());
        for (frame, (left, right)) in wishes.into_iter().enumerate() {
            let a = one.limit(&wish(frame as u64, left, right), free).wheels;
            let b = other.limit(&wish(frame as u64, right, left), free).wheels;
            prop_assert_eq!(a.left, b.right);
            prop_assert_eq!(a.right, b.left);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2_000, ..ProptestConfig::default() })]

    /// The limits of each base, for any wish.
    #[test]
    fn each_base_is_driven_within_its_geometry(
        wishes in prop::collection::vec(any_wish(), 50)
    ) {
        for base in [Base::Holonomic, Base::Ackermann] {
            let mut limiter = limiter_on(base);
            for (frame, (wish, ahead)) in wishes.iter().enumerate() {
                let stamp = Stamp::from_nanos((frame as u64 + 1) * 100_000_000);
                let command = limiter.limit(&Wish { stamp, ..wish.clone() }, look(*ahead));
                let Twist { linear_mps, angular_rps, .. } = command.twist;
                prop_assert!(linear_mps.abs() <= MAX_MPS + 1e-9, "{command:?}");
                prop_assert!(angular_rps.abs() <= 1.5 + 1e-9, "{command:?}");
                prop_assert!(stops_before(&command, *ahead), "{command:?} {ahead:?}");
                if base == Base::Ackermann {
                    prop_assert!(angular_rps.abs() <= linear_mps.abs() / 0.8 + 1e-9, "{command:?}");
                }
            }
        }
    }

    /// From every state the robot is at rest within the stated distance, by the time that it takes
    /// to answer and the deceleration that it may have.
    #[test]
    fn rest_is_reached_within_the_stated_distance(
        wishes in prop::collection::vec(any_wish(), 20)
    ) {
        let mut limiter = limiter_of(CommandLimiterSettings::default());
        let mut frame = 0;
        let mut last = None;
        for (wish, ahead) in wishes {
            frame += 1;
            let stamp = Stamp::from_nanos(frame * 100_000_000);
            last = Some(limiter.limit(&Wish { stamp, ..wish }, look(ahead)));
        }
        let mut speed = last.map_or(0.0, |command| command.twist.linear_mps.abs());
        let stated_m = limiter.settings.stopping_m(speed) - limiter.settings.margin_m;
        let mut driven_m = 0.0;
        for _ in 0..20 {
            // The speed of a frame lasts until the next one.
            driven_m += speed * PERIOD_S;
            frame += 1;
            let nobody = Wish { aim: Aim::Nobody, ..wish(frame, 0.0, 0.0) };
            speed = limiter.limit(&nobody, free).twist.linear_mps.abs();
        }
        prop_assert_eq!(speed, 0.0);
        prop_assert!(driven_m <= stated_m + 1e-9, "{driven_m} {stated_m}");
    }
}
