use nalgebra::Point2;
use tagalong_core::Twist;

use super::lock::LastSeen;
use super::settings::SearchSettings;

/// Gain from bearing to turn rate, 1/s.
const TURN_GAIN: f64 = 1.5;
/// Bearing within which the robot drives ahead, rad.
const AHEAD_RAD: f64 = 0.35;
/// Time for which a lost person is assumed to keep their velocity, s.
const GOES_ON_S: f64 = 1.5;
/// Time without motion after which the way counts as blocked, s.
const BLOCKED_S: f64 = 1.0;

/// Search for a lost person: waits, drives to the last seen position, turns to where the person
/// went, and on round; turns towards a candidate; at last it gives up.
#[derive(Clone, Debug, Default)]
pub(crate) struct Search {
    arrived: bool,
    blocked_s: f64,
    /// Direction of the turn, 1 to the left.
    way: Option<f64>,
}

impl Search {
    /// Returns the velocity to wish for, `lost_s` after the person was lost.
    pub(crate) fn wish(
        &mut self,
        settings: &SearchSettings,
        last: &LastSeen,
        candidate: Option<Point2<f64>>,
        lost_s: f64,
    ) -> Option<Twist> {
        if !settings.enabled || lost_s < settings.wait_s || lost_s > settings.give_up_s {
            return None;
        }
        // A blocked way or a long drive counts as arrival, so that the search goes on by turning.
        self.arrived |= last.place.coords.norm() < settings.arrive_m
            || self.blocked_s > BLOCKED_S
            || lost_s > settings.wait_s + settings.drive_s;
        let (speed_mps, turn) = match candidate {
            Some(somebody) => (0.0, turn_to(settings, &somebody)),
            None if self.arrived => (0.0, self.look_round(settings, last)),
            None => drive_to(settings, &last.place),
        };
        Some(Twist::new(speed_mps, turn))
    }

    /// Records whether the command limiter blocked the wish.
    pub(crate) fn add_block(&mut self, blocked: bool, dt_s: f64) {
        self.blocked_s = if blocked { self.blocked_s + dt_s } else { 0.0 };
    }

    /// Turns to the side on which the person went, and on.
    fn look_round(&mut self, settings: &SearchSettings, last: &LastSeen) -> f64 {
        let went = last.place + GOES_ON_S * last.velocity;
        // The first choice is kept: a sign that flips would make the robot swing to and fro.
        let way = *self.way.get_or_insert_with(|| went.y.atan2(went.x).signum());
        way * settings.turn_radps
    }
}

/// Returns the forward speed, m/s, and turn rate, rad/s, towards a place.
fn drive_to(settings: &SearchSettings, place: &Point2<f64>) -> (f64, f64) {
    let ahead = place.y.atan2(place.x).abs() < AHEAD_RAD;
    (if ahead { settings.speed_mps } else { 0.0 }, turn_to(settings, place))
}

/// Returns the turn rate, rad/s, towards a place.
fn turn_to(settings: &SearchSettings, place: &Point2<f64>) -> f64 {
    let turn = TURN_GAIN * place.y.atan2(place.x);
    turn.clamp(-settings.turn_radps, settings.turn_radps)
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector2;

    use super::*;

    fn settings() -> SearchSettings {
        SearchSettings { enabled: true, ..SearchSettings::default() }
    }

    fn last(x: f64, y: f64) -> LastSeen {
        LastSeen { place: Point2::new(x, y), velocity: Vector2::new(0.0, -0.8), ago_s: 1.0 }
    }

    fn wish(last: &LastSeen, lost_s: f64) -> Option<Twist> {
        Search::default().wish(&settings(), last, None, lost_s)
    }

    #[test]
    fn it_waits_drives_looks_round_and_gives_up() {
        assert_eq!(wish(&last(3.0, 0.0), 0.5), None);
        let ahead = wish(&last(3.0, 0.0), 1.5).unwrap();
        assert!(ahead.linear_mps > 0.3 && ahead.angular_rps == 0.0, "{ahead:?}");
        let aside = wish(&last(0.0, 3.0), 1.5).unwrap();
        assert!(aside.linear_mps == 0.0 && aside.angular_rps > 0.0, "turns first: {aside:?}");
        let there = wish(&last(0.3, 0.0), 1.5).unwrap();
        assert!(there.linear_mps == 0.0 && there.angular_rps < 0.0, "to the right: {there:?}");
        assert_eq!(wish(&last(3.0, 0.0), 20.5), None);
    }

    #[test]
    fn something_in_the_way_makes_it_look_round_instead() {
        let mut search = Search::default();
        (0..12).for_each(|_| search.add_block(true, 0.1));
        let there = search.wish(&settings(), &last(3.0, 0.0), None, 3.0).unwrap();
        assert_eq!(there.linear_mps, 0.0);
    }

    #[test]
    fn whoever_may_be_the_person_is_looked_at() {
        let mut search = Search::default();
        let left = Some(Point2::new(1.0, 2.0));
        let turns = search.wish(&settings(), &last(3.0, 0.0), left, 3.0).unwrap();
        assert!(turns.angular_rps > 0.0 && turns.linear_mps == 0.0, "{turns:?}");
    }

    #[test]
    fn only_where_it_is_allowed() {
        let settings = SearchSettings::default();
        assert_eq!(Search::default().wish(&settings, &last(3.0, 0.0), None, 1.5), None);
    }

    fn wished(x: f64, y: f64, lost_s: f64) -> (f64, f64) {
        fn rounded(number: f64) -> f64 {
            (number * 1e6).round() / 1e6
        }

        let twist = wish(&last(x, y), lost_s).unwrap();
        (rounded(twist.linear_mps), rounded(twist.angular_rps))
    }

    #[test]
    fn it_drives_at_the_speed_of_the_settings_and_turns_by_the_bearing() {
        fn bearing(rad: f64) -> f64 {
            wished(3.0 * rad.cos(), 3.0 * rad.sin(), 1.5).0
        }

        assert_eq!(wished(3.0, 0.0, 1.5), (0.4, 0.0));
        let (speed, turn) = wished(3.0, 0.6, 1.5);
        assert!(speed == 0.4 && (turn - 1.5 * 0.2_f64.atan()).abs() < 1e-5, "{speed} {turn}");
        assert_eq!(wished(3.0, -3.0, 1.5), (0.0, -0.5), "turns first, no faster than it may");
        assert_eq!((bearing(0.34), bearing(-0.36)), (0.4, 0.0));
    }

    #[test]
    fn it_waits_first_and_is_there_when_near_or_after_a_while() {
        fn looks_round(x: f64, lost_s: f64) -> bool {
            wished(x, 0.0, lost_s) == (0.0, -0.5)
        }

        assert_eq!(
            (wish(&last(3.0, 0.0), 0.99), wish(&last(3.0, 0.0), 1.0).is_some()),
            (None, true)
        );
        assert!(wish(&last(3.0, 0.0), 20.0).is_some());
        assert!(looks_round(0.59, 1.5) && !looks_round(0.61, 1.5), "as near as 0.6 m");
        assert!(looks_round(3.0, 9.1) && !looks_round(3.0, 8.9), "a second and eight");
    }

    #[test]
    fn it_looks_round_to_where_the_person_went() {
        fn way(y: f64, velocity_y: f64) -> f64 {
            let velocity = Vector2::new(0.0, velocity_y);
            let last = LastSeen { place: Point2::new(0.5, y), velocity, ago_s: 1.0 };
            Search::default().wish(&settings(), &last, None, 1.5).unwrap().angular_rps
        }

        assert!(way(0.0, 0.5) > 0.0 && way(0.0, -0.5) < 0.0);
        // In the second and a half for which the person is assumed to go on, they cross the middle.
        assert!(way(0.2, -0.1) > 0.0 && way(0.2, -0.2) < 0.0);
    }

    #[test]
    fn it_goes_on_round_the_way_it_began() {
        let mut search = Search::default();
        for y in [0.1, -0.1] {
            let last = LastSeen { velocity: Vector2::zeros(), ..last(0.3, y) };
            assert!(search.wish(&settings(), &last, None, 1.5).unwrap().angular_rps > 0.0);
        }
    }

    #[test]
    fn a_way_that_is_free_again_is_not_blocked() {
        fn drives(blocked: &[bool]) -> bool {
            let mut search = Search::default();
            blocked.iter().for_each(|now| search.add_block(*now, 0.4));
            search.wish(&settings(), &last(3.0, 0.0), None, 3.0).unwrap().linear_mps > 0.0
        }

        assert!(drives(&[true, true]) && !drives(&[true, true, true]));
        assert!(drives(&[true, true, false, true, true]));
    }
}
