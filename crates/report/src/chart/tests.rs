use proptest::prelude::*;
use tagalong_eval::CurvePoint;

use super::*;
use crate::model::Trajectory;

/// Generates any number, ordinary ones more often.
fn any_number() -> impl Strategy<Value = f64> {
    prop_oneof![4 => -1e3..1e3, 1 => any::<f64>(), 1 => Just(f64::NAN), 1 => Just(f64::INFINITY), 1 => Just(0.0)]
}

/// Returns the values of an attribute in all elements.
fn attributes<'a>(svg: &'a str, name: &str) -> Vec<&'a str> {
    let start = format!(" {name}=\"");
    svg.split(&start).skip(1).filter_map(|rest| rest.split('"').next()).collect()
}

/// Returns all positions that are drawn: x and y by the attributes that hold them.
fn places(svg: &str) -> (Vec<f64>, Vec<f64>) {
    let [mut xs, mut ys] =
        [["x", "x1", "x2", "cx"], ["y", "y1", "y2", "cy"]].map(|names| -> Vec<f64> {
            let texts = names.iter().flat_map(|n| attributes(svg, n));
            texts.map(|t| t.parse().expect("a number")).collect()
        });
    for pair in attributes(svg, "points").iter().flat_map(|p| p.split_whitespace()) {
        let (x, y) = pair.split_once(',').expect("a pair");
        xs.push(x.parse().expect("a number"));
        ys.push(y.parse().expect("a number"));
    }
    (xs, ys)
}

fn check_inside(svg: &str) -> Result<(), TestCaseError> {
    for one in svg.split("</svg>").filter(|s| s.contains("viewBox")) {
        let size: Vec<f64> = attributes(one, "viewBox")[0]
            .split(' ')
            .map(|v| v.parse().expect("a number"))
            .collect();
        let (xs, ys) = places(one);
        let width = 0.0..=size[2];
        let height = 0.0..=size[3];
        prop_assert!(xs.iter().all(|x| width.contains(x)), "x of {xs:?} outside in {one}");
        prop_assert!(ys.iter().all(|y| height.contains(y)), "y of {ys:?} outside in {one}");
        prop_assert!(!one.contains("NaN") && !one.contains("inf\""));
        let lengths = attributes(one, "width").into_iter().chain(attributes(one, "height"));
        for length in lengths {
            prop_assert!(length.parse::<f64>().expect("a number") >= 0.0, "{one}");
        }
    }
    Ok(())
}

const WORDS: Words<'_> = Words { title: "t", says: "s" };

proptest! {
    #[test]
    fn bars_and_intervals_stay_inside(v in any_number(), w in any_number(), m in any_number()) {
        check_inside(&bar(v, Some(w), m).into_string())?;
        check_inside(&interval(v, Some([w, m]), [m, w]).into_string())?;
        check_inside(&interval(v, None, [v, v]).into_string())?;
    }

    #[test]
    fn scatters_stay_inside(values in prop::collection::vec((any_number(), any_number()), 0..6)) {
        let marks: Vec<Mark<'_>> = values.iter().enumerate()
            .map(|(series, &(ms, accuracy))| Mark { name: "p", series, ms, accuracy }).collect();
        check_inside(&front(&marks, "HOTA", &WORDS).into_string())?;
    }

    #[test]
    fn curves_stay_inside(values in prop::collection::vec((any_number(), any_number()), 0..9)) {
        let points: Vec<CurvePoint> = values.iter()
            .map(|&(fppi, miss_rate)| CurvePoint { score: 0.0, fppi, miss_rate, precision: 0.0 }).collect();
        let curves = [Curve { name: "p", series: 9, points: &points }];
        check_inside(&miss_rate(&curves, &WORDS).into_string())?;
    }

    #[test]
    fn plans_stay_inside(
        a in prop::collection::vec(prop::array::uniform3(any_number()), 0..9),
        b in prop::collection::vec(prop::array::uniform3(any_number()), 0..9),
    ) {
        let truth = [Trajectory { id: 1, points: a }];
        let tracks = [Trajectory { id: 1, points: b }];
        if let Some(extent) = Extent::around(truth.iter().chain(&tracks)) {
            check_inside(&plan(&truth, &tracks, extent, &WORDS).into_string())?;
        }
    }

    #[test]
    fn ticks_are_few_and_rise(low in any_number(), high in any_number(), log in any::<bool>()) {
        let scale = if log { Scale::Log } else { Scale::Linear };
        let ticks = Axis::new(scale, [low, high], [0.0, 100.0]).ticks();
        prop_assert!(ticks.len() <= 22);
        prop_assert!(ticks.windows(2).all(|two| two[0].1 <= two[1].1));
        prop_assert!(ticks.iter().all(|(_, at)| (0.0..=100.0).contains(at)));
    }

    #[test]
    fn greater_values_lie_farther_along(a in -1e3..1e3, b in -1e3..1e3) {
        let axis = Axis::around(Scale::Linear, [a, b], [10.0, 90.0]);
        let x = axis.at(a).unwrap();
        let y = axis.at(b).unwrap();
        prop_assert_eq!(a <= b, x <= y);
    }
}

#[test]
fn ids_of_tracks_that_end_at_one_place_are_apart() {
    let tracks: Vec<Trajectory> = [7, 2, 12, 5]
        .map(|id| Trajectory { id, points: vec![[0.0, 1.0, 1.0], [1.0, 4.0, 0.0]] })
        .into();
    let extent = Extent::around(&tracks).expect("places");
    let svg = plan(&[], &tracks, extent, &WORDS).into_string();
    let labels: Vec<&str> = svg.split("<text class=\"label\"").skip(1).collect();
    let places: Vec<[f64; 2]> = labels
        .iter()
        .map(|text| ["x", "y"].map(|name| attributes(text, name)[0].parse().expect("a number")))
        .collect();
    assert_eq!(places.len(), tracks.len());
    for (at, [x, y]) in places.iter().enumerate() {
        for [other_x, other_y] in &places[..at] {
            let is_apart = (x - other_x).abs() >= 14.0 || (y - other_y).abs() >= 12.0;
            assert!(is_apart, "{places:?}");
        }
    }
}

#[test]
fn ticks_are_round() {
    for (axis, expected) in [
        (Axis::around(Scale::Linear, [0.13, 0.87], [0.0, 1.0]), "0.0 0.2 0.4 0.6 0.8 1.0"),
        (Axis::around(Scale::Log, [0.03, 2.0], [0.0, 1.0]), "0.02 0.05 0.1 0.2 0.5 1 2"),
        (Axis::new(Scale::Log, [0.001, 1.0], [0.0, 1.0]), "0.001 0.01 0.1 1"),
        (Axis::new(Scale::Linear, [-1.0, 1.0], [0.0, 1.0]), "\u{2212}1.0 \u{2212}0.5 0.0 0.5 1.0"),
    ] {
        let texts: Vec<String> = axis.ticks().into_iter().map(|(text, _)| text).collect();
        assert_eq!(texts.join(" "), expected);
    }
}

#[test]
fn series_differ_by_more_than_colour() {
    let looks: Vec<_> =
        (0..SERIES).map(|i| (mark(i, (0.0, 0.0), 1.0).into_string(), dashes(i))).collect();
    for (i, look) in looks.iter().enumerate() {
        assert!(!looks[..i].contains(look), "{i}: {look:?}");
    }
}
