use tagalong_eval::{Interval, draws_interval, percentile};
use tagalong_math::counted;
use tagalong_pipeline::Likeness;
use tagalong_report::{Cell, Row, Table};
use tagalong_sim::Seeds;
use tagalong_trials::{Ridden, RideJudge};

use super::{Followed, crowd_table};

/// Number of steps of the reliability curve.
const BINS: usize = 10;

/// Beginning of the titles of the tables that compare the probabilities of a target lock with the
/// truth.
pub const CALIBRATION: &str = "How far the lock of";

/// Columns of the scores. Those that distinguish controllers come first; nearly all rides are kept,
/// even with a controller that does not find people again.
const COLUMNS: [&str; 14] = [
    "rides",
    "in view %",
    "refound %",
    "after s",
    "distance %",
    "farther m",
    "kept %",
    "wrong %",
    "longest wrong s",
    "contacts",
    "to people m",
    "to things m",
    "jerk m/s3",
    "ms/frame",
];

/// Returns the scores of the rides, scene by scene and over all scenes, and the reliability of the
/// target lock's probabilities if there was a lock.
pub fn tables(results: &[Followed], seeds: Seeds) -> Vec<Table> {
    let judge = RideJudge::default();
    let pipelines = unique(results.iter().map(|result| result.pipeline.as_str()));
    let mut rows: Vec<Row> = Vec::new();
    let mut crowd_rows: Vec<Row> = Vec::new();
    for (name, group) in groups(results) {
        for pipeline in &pipelines {
            let chosen: Vec<&Followed> =
                group.iter().copied().filter(|result| result.pipeline == *pipeline).collect();
            let label = format!("{name}: {pipeline}");
            crowd_rows.extend(crowd_table::row(&label, &chosen));
            rows.push(Row::ours(label, cells(&chosen, &judge)));
        }
    }
    let following = Table {
        title: "Following the first person of each scene".into(),
        columns: COLUMNS.map(str::to_owned).to_vec(),
        rows,
        notes: notes(&judge, seeds).into_iter().chain(standing(results)).collect(),
    };
    std::iter::once(following)
        .chain(crowd_table::table(crowd_rows, seeds))
        .chain(pipelines.iter().flat_map(|pipeline| reliabilities(results, pipeline, seeds)))
        .collect()
}

/// Returns the rides of each scene, then those of each value of a sweep over all scenes, then all
/// rides.
fn groups(results: &[Followed]) -> Vec<(String, Vec<&Followed>)> {
    let suites = unique(results.iter().map(|result| result.suite.as_str()));
    let values = unique(results.iter().filter_map(|result| result.swept.as_deref()));
    let mut groups: Vec<(String, Vec<&Followed>)> = Vec::new();
    for suite in &suites {
        let rides = results.iter().filter(|ride| ride.suite == *suite).collect();
        groups.push((suite.to_string(), rides));
    }
    if suites.len() > values.len() {
        for value in &values {
            let rides = results.iter().filter(|ride| ride.swept.as_deref() == Some(value));
            groups.push((format!("all scenes {value}"), rides.collect()));
        }
    }
    if suites.len() > 1 {
        groups.push(("all scenes".into(), results.iter().collect()));
    }
    groups
}

/// Returns the notes, in the order of the columns.
fn notes(judge: &RideJudge, seeds: Seeds) -> Vec<String> {
    vec![
        format!("each scene with {seeds}"),
        "intervals: 95 %, over rides; Wilson for rides that were kept, and for what happens several \
         times in a ride with the spread between rides; Student for times"
            .into(),
        format!(
            "in view: share of the time in which at least {:.0} % of the upper body was in the image and not \
             hidden, up to {} m away; legs alone do not count",
            100.0 * judge.min_visible,
            judge.max_range_m
        ),
        format!(
            "refound: losses of the person that ended within {} s of the return into view (up to {} m \
             away)",
            judge.refind_s, judge.max_range_m
        ),
        "after: time from the return into view until the person is followed, where that happened".into(),
        format!(
            "distance: share of the time within {} m of the stand-off while the person walked below \
             {} m/s, and the mean excess of the distance",
            judge.off_m, judge.slow_mps
        ),
        format!(
            "kept: the person was found, no other person was followed for more than {} s at a time, \
             at the end the person was followed or out of view for {} s, and the robot moved if the \
             person was ever out of its reach",
            judge.most_wrong_s, judge.refind_s
        ),
        "wrong: share of the time of the lock in which it was on another person or a thing, also while \
         the robot stood; not while a frozen sensor makes the lock `not known`".into(),
        "contacts: rides in which the robot touched a person or a thing, and the least clearance".into(),
        "ms/frame: 95th percentile of the processor time of the pipeline's thread".into(),
    ]
}

/// Returns a note for each pipeline whose robot never moved in some rides, with the reason.
fn standing(results: &[Followed]) -> Vec<String> {
    let mut all = Vec::new();
    for pipeline in unique(results.iter().map(|result| result.pipeline.as_str())) {
        let rides: Vec<&Followed> = results.iter().filter(|r| r.pipeline == pipeline).collect();
        let reasons: Vec<&str> = rides.iter().filter_map(|ride| ride.ridden.never_moved).collect();
        if !reasons.is_empty() {
            all.push(format!(
                "{pipeline} never moved in {} of {}; reason of its commands: {}",
                reasons.len(),
                counted(rides.len(), "ride"),
                unique(reasons.into_iter()).join(", ")
            ));
        }
    }
    all
}

fn cells(results: &[&Followed], judge: &RideJudge) -> Vec<Cell> {
    let rides: Vec<&Ridden> = results.iter().map(|result| &result.ridden).collect();
    let count = rides.len() as u64;
    let after = ratio_of_sums(&rides, |r| found_after(r).sum(), |r| found_after(r).count() as f64);
    let refound: Vec<[u64; 2]> = rides
        .iter()
        // Resampling whole rides accounts for the dependence between the seconds of one ride.
        .map(|ride| {
            let all = ride.episodes.iter().filter_map(|e| judge.refound(e, ride.time_s));
            all.fold([0, 0], |[good, of], one| [good + u64::from(one), of + 1])
        })
        .collect();
    let touches = rides.iter().filter(|ride| {
        [ride.clearance_people_m, ride.clearance_things_m].into_iter().flatten().any(|m| m < 0.0)
    });
    let farther: Vec<f64> = rides.iter().filter_map(|ride| ride.farther_m).collect();
    let jerks: Vec<f64> = rides.iter().map(|ride| ride.jerk_mps3).collect();
    let took: Vec<f64> = results.iter().flat_map(|result| &result.took_ms).copied().collect();
    let kept = rides.iter().filter(|ride| ride.kept).count() as u64;
    vec![
        Cell::number(count as f64, 0),
        share_cell(&rides, |r| r.in_view_s, |r| r.time_s, 3),
        Cell::clustered(&refound, 1),
        Cell::estimate(after.map(|time| time.within(0.0, f64::INFINITY)), 1),
        share_cell(&rides, |r| r.distance_kept_s, |r| r.slow_s, 3),
        Cell::mean(&farther, 2),
        Cell::share(kept, count, 1),
        share_cell(&rides, |r| r.wrong_s, |r| r.right_s + r.wrong_s, 4),
        Cell::number(rides.iter().map(|ride| ride.longest_wrong_s).fold(0.0, f64::max), 1),
        Cell::number(touches.count() as f64, 0),
        least_cell(&rides, |ride| ride.clearance_people_m),
        least_cell(&rides, |ride| ride.clearance_things_m),
        Cell::mean(&jerks, 1),
        percentile(&took, 0.95).map_or_else(Cell::default, |ms| Cell::number(ms, 1)),
    ]
}

/// Returns the sum of one measure divided by that of another, over the rides that have any of the
/// other.
fn ratio_of_sums(
    rides: &[&Ridden],
    part: fn(&Ridden) -> f64,
    whole: fn(&Ridden) -> f64,
) -> Option<Interval> {
    // Rides without any of that time would cause a division by zero.
    let of: Vec<&Ridden> = rides.iter().copied().filter(|ride| whole(ride) > 0.0).collect();
    draws_interval(of.len(), |drawn| {
        let part_sum = drawn.iter().map(|&i| part(of[i])).sum::<f64>();
        let whole_sum = drawn.iter().map(|&i| whole(of[i])).sum::<f64>();
        part_sum / whole_sum
    })
}

/// Returns one measure as a fraction of another, in per cent.
fn share_cell(
    rides: &[&Ridden],
    part: fn(&Ridden) -> f64,
    whole: fn(&Ridden) -> f64,
    digits: usize,
) -> Cell {
    let share = ratio_of_sums(rides, part, whole).map(|share| share.within(0.0, 1.0));
    Cell::estimate(share, digits).percent()
}

/// Returns the minimum of a measure over the rides that have it.
fn least_cell(rides: &[&Ridden], measure: fn(&Ridden) -> Option<f64>) -> Cell {
    let least = rides.iter().filter_map(|ride| measure(ride)).min_by(f64::total_cmp);
    least.map_or_else(Cell::default, |least| Cell::number(least, 2))
}

/// Returns the times from coming back into view until being followed, s.
fn found_after(ride: &Ridden) -> impl Iterator<Item = f64> {
    ride.episodes.iter().filter_map(|episode| Some(episode.found_s? - episode.in_view_s?))
}

/// Returns the reliability of the target lock's probabilities and, if they are calibrated, that
/// before the calibration.
fn reliabilities(results: &[Followed], pipeline: &str, seeds: Seeds) -> Vec<Table> {
    let of: Vec<&Ridden> =
        results.iter().filter(|r| r.pipeline == pipeline).map(|r| &r.ridden).collect();
    let mut all = of.iter().flat_map(|ride| &ride.likeness).map(|(like, _)| like).peekable();
    if all.peek().is_none() {
        return Vec::new();
    }
    let title = format!("{CALIBRATION} {pipeline} can be believed");
    let mut tables = vec![reliability(title.clone(), &of, |like| like.probability, seeds)];
    if all.any(|like| (like.probability - uncalibrated(like)).abs() > 1e-9) {
        tables.push(reliability(
            format!("{title}: before the calibration"),
            &of,
            uncalibrated,
            seeds,
        ));
    }
    tables
}

/// Returns the probability before calibration, from the log-odds.
pub fn uncalibrated(like: &Likeness) -> f64 {
    1.0 / (1.0 + (-like.log_odds).exp())
}

/// Returns the fraction of true matches among the tracks with a certain probability of the lock.
fn reliability(
    title: String,
    of: &[&Ridden],
    probability: fn(&Likeness) -> f64,
    seeds: Seeds,
) -> Table {
    let rows = (0..BINS).map(|at| {
        let mut probabilities = Vec::new();
        let mut shares = Vec::new();
        for ride in of {
            let mut share = [0; 2];
            for (like, same) in &ride.likeness {
                let probability = probability(like);
                if ((probability * BINS as f64) as usize).min(BINS - 1) == at {
                    probabilities.push(probability);
                    share = [share[0] + u64::from(*same), share[1] + 1];
                }
            }
            shares.push(share);
        }
        let count = probabilities.len() as f64;
        let mean = probabilities.iter().sum::<f64>() / count;
        let low = at as f64 / BINS as f64;
        let cells = vec![
            Cell::number(count, 0),
            Cell::number(100.0 * mean, 1),
            Cell::clustered(&shares, 1),
        ];
        Row::ours(format!("{low:.1} to {:.1}", low + 1.0 / BINS as f64), cells)
    });
    let columns = ["sightings", "mean probability %", "were the person %"];
    Table {
        title,
        columns: columns.map(str::to_owned).to_vec(),
        rows: rows.collect(),
        notes: vec![
            format!("each scene with {seeds}"),
            "intervals: 95 %, with the spread between rides: sightings of one ride are not \
             independent"
                .into(),
        ],
    }
}

/// Returns each name once, in the order of first occurrence.
fn unique<'a>(names: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let mut all = Vec::new();
    for name in names {
        if !all.contains(&name) {
            all.push(name);
        }
    }
    all
}

/// Returns the lock's probability of each detection, its truth, and the differences behind it; an
/// unknown difference is an empty field.
pub fn likeness_csv(results: &[Followed]) -> String {
    let mut out =
        "suite,pipeline,seed,same,probability,torso,legs,texture,height_m,rivals\n".to_owned();
    for Followed { suite, pipeline, ridden, .. } in results {
        for (like, same) in &ridden.likeness {
            let d = &like.differences;
            let numbers = [d.torso, d.legs, d.texture, Some(d.height_m), d.rivals]
                .map(|value| value.map_or(String::new(), |value| format!("{value:.4}")))
                .join(",");
            let seed = ridden.seed;
            let p = like.probability;
            out += &format!("{suite},{pipeline},{seed},{},{p:.4},{numbers}\n", u8::from(*same));
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use tagalong_core::TrackId;
    use tagalong_pipeline::Differences;
    use tagalong_sim::Split;
    use tagalong_trials::Episode;

    use super::*;

    #[test]
    fn people_who_come_back_are_found_after_the_mean_time() {
        let episodes =
            [(Some(2.0), Some(3.0)), (Some(5.0), Some(7.0)), (Some(8.0), None), (None, None)];
        let episodes = episodes
            .map(|(in_view_s, found_s)| Episode { lost_s: 1.0, in_view_s, found_s })
            .to_vec();
        let ridden = Ridden { episodes, ..Ridden::default() };
        let ride = Followed { ridden, ..Followed::default() };
        let table = &tables(&[ride], Split::Test.seeds(0, 1).unwrap())[0];
        let at = table.columns.iter().position(|column| column == "after s").unwrap();
        assert_eq!(table.rows[0].cells[at].value, Some(1.5));
    }

    /// A ride of 100 s in which each figure is another one.
    #[test]
    fn figures_that_tell_controllers_apart_come_first() {
        let ridden = Ridden {
            kept: true,
            time_s: 100.0,
            in_view_s: 90.0,
            slow_s: 50.0,
            distance_kept_s: 40.0,
            farther_m: Some(0.7),
            right_s: 60.0,
            wrong_s: 20.0,
            longest_wrong_s: 1.5,
            ..Ridden::default()
        };
        let ride = Followed { ridden, ..Followed::default() };
        let table = &tables(&[ride], Split::Test.seeds(0, 1).unwrap())[0];
        let first = ["rides", "in view %", "refound %", "after s", "distance %", "farther m"];
        assert_eq!(table.columns[..6], first);
        assert_eq!(table.columns[6], "kept %");
        let values: Vec<Option<f64>> = table.rows[0].cells.iter().map(|cell| cell.value).collect();
        assert_eq!(values.len(), table.columns.len());
        let expected = [1.0, 90.0, 80.0, 0.7, 100.0, 25.0, 1.5];
        let shown = [0, 1, 4, 5, 6, 7, 8].map(|at: usize| values[at].unwrap());
        let off = shown.iter().zip(expected).map(|(a, b)| (a - b).abs());
        assert!(off.fold(0.0, f64::max) < 1e-9, "{shown:?}");
    }

    #[test]
    fn a_robot_that_never_moves_is_named_below_the_table() {
        let moved = Followed { pipeline: "blind".into(), ..Followed::default() };
        let mut stood = moved.clone();
        stood.ridden.never_moved = Some("silent");
        let seeds = Split::Test.seeds(0, 2).unwrap();
        let both = tables(&[stood, moved.clone()], seeds);
        assert_eq!(
            both[0].notes.last().expect("a note"),
            "blind never moved in 1 of 2 rides; reason of its commands: silent"
        );
        let one = tables(&[moved], seeds);
        assert!(!one[0].notes.last().expect("a note").contains("never moved"));
    }

    /// One sighting of the person with this probability by the log-odds, calibrated or not.
    fn seen(stated: f64, calibrated: f64) -> Followed {
        let differences = Differences {
            torso: None,
            legs: None,
            texture: None,
            vector: None,
            height_m: 0.0,
            rivals: None,
        };
        let log_odds = (stated / (1.0 - stated)).ln();
        let like = Likeness { track: TrackId(1), probability: calibrated, log_odds, differences };
        let ridden = Ridden { likeness: vec![(like, true)], ..Ridden::default() };
        Followed { ridden, ..Followed::default() }
    }

    #[test]
    fn calibrated_probabilities_are_shown_beside_those_before() {
        fn count(table: &Table, row: usize) -> Option<f64> {
            table.rows[row].cells[0].value
        }

        let seeds = Split::Test.seeds(0, 1).unwrap();
        let both = tables(&[seen(0.75, 0.45)], seeds);
        assert_eq!([count(&both[1], 4), count(&both[1], 7)], [Some(1.0), Some(0.0)]);
        assert_eq!([count(&both[2], 4), count(&both[2], 7)], [Some(0.0), Some(1.0)]);
        assert!(both[2].title.ends_with("before the calibration"));
        assert_eq!(tables(&[seen(0.75, 0.75)], seeds).len(), 2, "without a calibration");
    }

    fn rides(of: &[(&str, Option<&str>)]) -> Vec<Followed> {
        let rides = of.iter().map(|(suite, swept)| Followed {
            suite: (*suite).into(),
            swept: swept.map(str::to_owned),
            ..Followed::default()
        });
        rides.collect()
    }

    /// Names of the groups, with the number of rides of each.
    fn named(of: &[(&str, Option<&str>)]) -> Vec<(String, usize)> {
        groups(&rides(of)).into_iter().map(|(name, group)| (name, group.len())).collect()
    }

    #[test]
    fn each_value_of_a_sweep_over_scenes_has_a_row_for_all_of_them() {
        fn group(name: &str, rides: usize) -> (String, usize) {
            (name.to_owned(), rides)
        }

        assert_eq!(named(&[("a", None), ("a", None)]), [group("a", 2)]);
        let two = [("a", None), ("b", None)];
        assert_eq!(named(&two), [group("a", 1), group("b", 1), group("all scenes", 2)]);
        let one_scene = [("a 1", Some("1")), ("a 2", Some("2"))];
        assert_eq!(
            named(&one_scene),
            [group("a 1", 1), group("a 2", 1), group("all scenes", 2)],
            "a value's only scene is its total"
        );
        let both = [one_scene[0], one_scene[1], ("b 1", Some("1")), ("b 2", Some("2"))];
        let totals = [group("all scenes 1", 2), group("all scenes 2", 2), group("all scenes", 4)];
        assert_eq!(named(&both)[4..], totals);
    }
}
