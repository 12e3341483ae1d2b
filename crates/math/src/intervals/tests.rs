use super::*;
use crate::random::{RandomSource, SplitMix64};

/// Repetitions of a simulation: its shares are off by 1 % at most, most of the time.
const REPEATS: usize = 4000;

type Draw = fn(&mut SplitMix64) -> f64;

/// Distributions of differences with a mean of 0, and the least coverage that is promised for 3 to
/// 20 of them.
const DIFFERENCES: [(&str, Draw, f64); 5] = [
    ("normal", |random| random.normal(), 0.94),
    ("bounded, even", |random| random.positive_uniform() - random.positive_uniform(), 0.93),
    ("skewed, exponential", |random| -random.positive_uniform().ln() - 1.0, 0.86),
    (
        "bounded near one end, as rates near 1",
        |random| random.positive_uniform().powf(0.25) - 0.8,
        0.89,
    ),
    ("bounded, most of it at one end", |random| random.positive_uniform().powi(3) - 0.25, 0.82),
];

fn covers(interval: Option<Interval>, truth: f64) -> bool {
    interval.is_some_and(|of| of.ends().is_none_or(|[low, high]| low <= truth && truth <= high))
}

#[test]
fn intervals_of_a_mean_cover_it_as_often_as_promised() {
    for (name, draw, promised) in DIFFERENCES {
        for draws in [3, 4, 5, 6, 7, 10, 14, 20] {
            let mut random = SplitMix64::new(draws as u64);
            let mut covered = 0;
            for _ in 0..REPEATS {
                let values: Vec<f64> = (0..draws).map(|_| draw(&mut random)).collect();
                covered += usize::from(covers(mean_interval(&values), 0.0));
            }
            let share = covered as f64 / REPEATS as f64;
            assert!((promised..0.965).contains(&share), "{name}, {draws} draws: {share}");
        }
    }
}

/// Rides of which each has its own rate, about 80 % on the mean, and 1 to 12 trials.
fn rides(count: usize, random: &mut SplitMix64) -> Vec<[u64; 2]> {
    fn ride(random: &mut SplitMix64) -> [u64; 2] {
        let rate = random.positive_uniform().powf(0.25);
        let trials = 1 + random.next_u64() % 12;
        [(0..trials).filter(|_| random.positive_uniform() < rate).count() as u64, trials]
    }

    (0..count).map(|_| ride(random)).collect()
}

#[test]
fn intervals_of_clustered_counts_cover_where_wilson_does_not() {
    let mut wilson_at_20 = 0;
    for count in [3, 5, 8, 20] {
        let mut random = SplitMix64::new(count as u64);
        let mut held = 0;
        for _ in 0..REPEATS {
            let clusters = rides(count, &mut random);
            held += usize::from(covers(clustered_share(&clusters), 0.8));
            let [good, of] = [0, 1].map(|k| clusters.iter().map(|one| one[k]).sum());
            wilson_at_20 += usize::from(count == 20 && covers(wilson(good, of, CONFIDENCE), 0.8));
        }
        let share = held as f64 / REPEATS as f64;
        assert!((0.93..0.999).contains(&share), "{count} rides: {share}");
    }
    assert!(wilson_at_20 < 85 * REPEATS / 100, "as if independent: {wilson_at_20}");
}

#[test]
fn a_mean_has_the_interval_of_student() {
    // Student (1908), the differences of hours of sleep: mean 1.58, s 1.2300, t of 9
    // degrees of freedom 2.262.
    let sleep = [1.2, 2.4, 1.3, 1.3, 0.0, 1.0, 1.8, 0.8, 4.6, 1.4];
    let interval = mean_interval(&sleep).unwrap();
    let [lower, upper] = interval.ends().unwrap();
    assert!((interval.estimate - 1.58).abs() < 1e-12);
    assert!((lower - 0.7001).abs() < 1e-3 && (upper - 2.4599).abs() < 1e-3, "{lower} {upper}");
    let [lower, upper] = mean_interval(&[0.0, 1.0]).unwrap().ends().unwrap();
    assert!((lower + 5.8531).abs() < 1e-4 && (upper - 6.8531).abs() < 1e-4, "{lower} {upper}");
    for (freedom, quantile) in [(1, 12.7062), (2, 4.3027), (5, 2.5706), (19, 2.0930)] {
        assert!((student_quantile(freedom) - quantile).abs() < 1e-4, "{freedom}");
    }
}

#[test]
fn a_figure_of_all_draws_together_has_an_interval_too() {
    fn sum(of: &[f64], drawn: &[usize]) -> f64 {
        drawn.iter().map(|&i| of[i]).sum::<f64>()
    }

    // A ratio of sums: by the textbook (Cochran, 1977, section 6.3) its error is close
    // to the spread of the residuals over the mean of the denominators.
    let parts = [3.0, 6.0, 4.0, 9.0, 5.0];
    let wholes = [5.0, 9.0, 8.0, 12.0, 6.0];
    let interval = draws_interval(5, |drawn| sum(&parts, drawn) / sum(&wholes, drawn)).unwrap();
    assert_eq!(interval.estimate, 27.0 / 40.0);
    let error =
        ((0..5).map(|i| (parts[i] - 27.0 / 40.0 * wholes[i]).powi(2)).sum::<f64>() / 4.0 / 5.0)
            .sqrt()
            / 8.0;
    let half = 0.5 * (interval.upper - interval.lower) / student_quantile(4);
    assert!((half / error - 1.0).abs() < 0.1, "{half} {error}");
}

#[test]
fn one_draw_and_draws_that_agree_tell_no_spread() {
    // Without one of them there is no figure: nothing tells its spread.
    fn ratio(drawn: &[usize]) -> f64 {
        if drawn.contains(&0) { 0.5 } else { f64::NAN }
    }

    assert_eq!(mean_interval(&[0.7]), Some(Interval::open(0.7)));
    assert_eq!(mean_interval(&[0.1; 7]).unwrap().ends(), None);
    assert_eq!(mean_interval(&[]), None);
    assert_eq!(mean_interval(&[0.1, f64::NAN]), None);
    assert_eq!(clustered_share(&[[7, 9]]), Some(Interval::open(7.0 / 9.0)));
    assert_eq!(clustered_share(&[[7, 9], [0, 0]]), Some(Interval::open(7.0 / 9.0)));
    assert_eq!(clustered_share(&[[0, 0]]), None);
    assert_eq!(Interval::open(0.5).within(0.0, 1.0).ends(), None);
    assert_eq!(
        draws_interval(1, |drawn| [0.3][drawn[0]]),
        Some(Interval::open(0.3)),
        "asked of no draws"
    );
    assert_eq!(draws_interval(2, ratio), Some(Interval::open(0.5)));
}

#[test]
fn one_trial_each_is_independent_and_two_are_not() {
    assert_eq!(clustered_share(&[[1, 1], [0, 1], [1, 1]]), wilson(2, 3, CONFIDENCE));
    assert_ne!(clustered_share(&[[1, 2], [0, 2], [1, 1]]), wilson(2, 5, CONFIDENCE));
}

#[test]
fn no_end_is_beyond_the_range_of_the_figure() {
    let wide = Interval { estimate: 0.5, lower: -0.2, upper: 1.3 };
    assert_eq!(wide.within(0.0, 1.0), Interval { estimate: 0.5, lower: 0.0, upper: 1.0 });
    assert_eq!(wide.within(-1.0, f64::INFINITY), wide);
    assert_eq!(wilson(5, 3, CONFIDENCE), wilson(3, 3, CONFIDENCE));
}

#[test]
fn clusters_that_all_succeed_count_once_each() {
    let all = clustered_share(&[[40, 40], [50, 50], [9, 9]]).unwrap();
    assert_eq!(Some(all), wilson(3, 3, CONFIDENCE));
    let none = clustered_share(&[[0, 40], [0, 50]]).unwrap();
    assert_eq!(Some(none), wilson(0, 2, CONFIDENCE));
}

#[test]
fn clusters_are_worth_as_many_trials_as_have_their_spread() {
    // Squares off half of 4: 1 and 1, doubled for the one degree of freedom: 4. Of 8 independent
    // trials they would be 2, so these 8 count as 4.
    let two = [[1, 4], [3, 4]];
    let few = 4.0 * (normal_quantile(CONFIDENCE) / student_quantile(1)).powi(2);
    assert!((independent_trials(&two, 0.5, 8.0) - few).abs() < 1e-12);
}

#[test]
fn clusters_that_differ_less_than_chance_gain_nothing() {
    let even = clustered_share(&[[5, 10]; 6]).unwrap();
    let worth = 60.0 * (normal_quantile(CONFIDENCE) / student_quantile(5)).powi(2);
    assert_eq!(even, score_interval(0.5, worth, CONFIDENCE));
    let free = wilson(30, 60, CONFIDENCE).unwrap();
    assert!(even.lower < free.lower && even.upper > free.upper);
}

#[test]
fn intervals_without_ends_survive_json() {
    for interval in [Interval::open(0.25), mean_interval(&[0.0, 1.0, 0.5]).unwrap()] {
        let text = serde_json::to_string(&interval).unwrap();
        assert_eq!(serde_json::from_str::<Interval>(&text).unwrap(), interval, "{text}");
    }
    assert!(serde_json::to_string(&Interval::open(1.0)).unwrap().contains("\"lower\":null"));
}

#[test]
fn wilson_agrees_with_its_published_example() {
    // Newcombe (1998), table I: 81 of 263 and 0 of 20.
    let rate = wilson(81, 263, 0.95).unwrap();
    assert!((rate.lower - 0.2553).abs() < 5e-5 && (rate.upper - 0.3662).abs() < 5e-5);
    let none = wilson(0, 20, 0.95).unwrap();
    assert!(none.lower == 0.0 && (none.upper - 0.1611).abs() < 5e-5);
    assert_eq!(wilson(0, 0, 0.95), None);
}

/// Returns the probability of at most `events` events in `trials` trials.
fn at_most(events: u64, trials: u64, rate: f64) -> f64 {
    (0..=events)
        .map(|count| {
            let choose = (1..=count).map(|k| ((trials - count + k) as f64 / k as f64).ln());
            let rest = (trials - count) as f64 * (-rate).ln_1p();
            (choose.sum::<f64>() + count as f64 * rate.ln() + rest).exp()
        })
        .sum()
}

#[test]
fn exact_bounds_are_those_of_tables_and_of_their_definition() {
    fn bound(events: u64, trials: u64) -> f64 {
        exact_upper_bound(events, trials, 0.95).unwrap()
    }

    // One event in ten, of the tables; none: 1 - 0.05^(1/n).
    assert!((bound(1, 10) - 0.394_16).abs() < 1e-4, "{}", bound(1, 10));
    for trials in [10, 1000, 10_000, 1_000_000] {
        let none = 1.0 - 0.05_f64.powf(1.0 / trials as f64);
        assert!((bound(0, trials) / none - 1.0).abs() < 1e-6, "{trials}");
    }
    for (events, trials) in [(1, 10), (3, 200), (17, 1000), (5, 10_000)] {
        let left = at_most(events, trials, bound(events, trials));
        assert!((left - 0.05).abs() < 1e-6, "{events} of {trials}: {left}");
    }
    assert_eq!((bound(7, 7), exact_upper_bound(0, 0, 0.95)), (1.0, None));
}
