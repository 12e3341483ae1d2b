//! Checks for impossible headers and ranges of laser scans.

use super::laser::limits;
use crate::msgs::LaserScan;

/// Maximum number of rays of a scan.
const MAX_RAYS: usize = 65_536;

/// Rounding of the angles by drivers, in rays and as a fraction of the field of view.
const ROUNDED_RAYS: f64 = 2.0;
const ROUNDED_SHARE: f64 = 0.02;
/// Minimum angle between two rays, rad: a twentieth of that of the finest scanners.
const SMALLEST_STEP_RAD: f64 = 1e-5;
/// Maximum first angle, rad: some drivers add whole turns.
const LARGEST_ANGLE_RAD: f64 = 2.0 * std::f64::consts::TAU;
/// Maximum field of view of a scanner, rad: one turn, with a margin for rays that overlap.
const WIDEST_RAD: f64 = 1.1 * std::f64::consts::TAU;

/// Returns the impossible field of a scan with its value; `None` for a scan that can be used.
pub(crate) fn scan_fault(scan: &LaserScan) -> Option<String> {
    let fields = [
        ("angle_min", scan.angle_min),
        ("angle_increment", scan.angle_increment),
        ("range_min", scan.range_min),
    ];
    if let Some((name, value)) = fields.iter().find(|(_, value)| !value.is_finite()) {
        return Some(format!("{name} is {value}"));
    }
    if f64::from(scan.angle_min).abs() > LARGEST_ANGLE_RAD {
        return Some(format!("angle_min is {}: radians are wanted", scan.angle_min));
    }
    // If both are 0, the driver has not set them; by the definition of the message, all ranges
    // beyond them would be left out.
    let limits = limits(scan);
    if limits.is_empty() || limits.start() == limits.end() || scan.range_max.is_nan() {
        let min = scan.range_min;
        let max = scan.range_max;
        return Some(format!("range_max is {max} and range_min {min}"));
    }
    let rays = scan.ranges.len();
    if rays == 0 {
        return Some("ranges is empty".into());
    }
    if rays > MAX_RAYS {
        return Some(format!("ranges has {rays} values, more than {MAX_RAYS}"));
    }
    let increment = f64::from(scan.angle_increment);
    if rays > 1 && increment.abs() < SMALLEST_STEP_RAD {
        return Some(format!(
            "angle_increment is {} with {rays} ranges: all lie in one direction",
            scan.angle_increment
        ));
    }
    let view_rad = increment.abs() * (rays - 1) as f64;
    if view_rad > WIDEST_RAD {
        return Some(format!(
            "angle_increment is {increment} with {rays} ranges, a view of {view_rad:.1} rad"
        ));
    }
    told_view_fault(scan, view_rad).or_else(|| ranges_fault(scan))
}

/// Returns the contradiction between the last angle of a scan and its number of rays.
fn told_view_fault(scan: &LaserScan, view_rad: f64) -> Option<String> {
    let told_rad = f64::from(scan.angle_max) - f64::from(scan.angle_min);
    // Some drivers leave it out, and some add whole turns.
    if !told_rad.is_finite() || told_rad == 0.0 || scan.ranges.len() < 2 {
        return None;
    }
    let step_rad = f64::from(scan.angle_increment).abs();
    let slack_rad = ROUNDED_RAYS * step_rad + ROUNDED_SHARE * view_rad;
    let turned_rad = std::f64::consts::TAU - told_rad.abs();
    let off_rad = (told_rad.abs() - view_rad).abs();
    // A scanner that is mounted upside down counts from a larger angle to a smaller one.
    let is_turned = told_rad * f64::from(scan.angle_increment) < 0.0;
    if is_turned && off_rad <= slack_rad {
        return Some(format!(
            "angle_increment is {} and leads from angle_min {:.3} away from angle_max {:.3}",
            scan.angle_increment, scan.angle_min, scan.angle_max
        ));
    }
    if off_rad <= slack_rad || (turned_rad.abs() - view_rad).abs() <= slack_rad {
        return None;
    }
    // A tenth exceeds all rounding; smaller deviations are ignored and the ranges decide.
    (off_rad > 0.1 * view_rad.max(told_rad.abs())).then(|| {
        format!(
            "angle_min {:.3} to angle_max {:.3} is {:.3} rad, and {} ranges with angle_increment {} \
             are {view_rad:.3} rad",
            scan.angle_min,
            scan.angle_max,
            told_rad.abs(),
            scan.ranges.len(),
            scan.angle_increment
        )
    })
}

/// Maximum number of distinct values that a scanner may write in place of a range.
const MOST_CODES: usize = 3;
/// Multiple of the maximum range beyond which ranges must be in another unit.
const OTHER_UNIT: f32 = 5.0;
/// Distance that no scanner on a robot measures, m.
const FARTHEST_M: f32 = 500.0;

/// Returns the reason why the ranges of a scan are not distances in metres. Values that a scanner
/// writes for rays without a reflection are few, and each is frequent.
fn ranges_fault(scan: &LaserScan) -> Option<String> {
    let mut values: Vec<f32> =
        scan.ranges.iter().copied().filter(|range| range.is_finite() && *range != 0.0).collect();
    values.sort_by(f32::total_cmp);
    let negative = values.partition_point(|range| *range < 0.0);
    let is_mostly_negative = 2 * negative > values.len();
    values.dedup();
    let negative = values.partition_point(|range| *range < 0.0);
    if is_mostly_negative && negative > MOST_CODES {
        let median = values[negative / 2];
        return Some(format!("most ranges are negative, as {median:.3}"));
    }
    let positive = &values[negative..];
    if positive.len() <= MOST_CODES {
        return None;
    }
    let median = positive[positive.len() / 2];
    let max = scan.range_max;
    if positive[0] > max && median > OTHER_UNIT * max {
        return Some(format!(
            "all ranges are beyond range_max {max}, half of them beyond {median:.1}: metres are wanted"
        ));
    }
    (median > FARTHEST_M)
        .then(|| format!("half of the ranges are beyond {median:.1}: metres are wanted"))
}

#[cfg(test)]
mod tests {
    use tagalong_core::Stamp;

    use super::*;
    use crate::msgs::Header;

    fn base() -> LaserScan {
        LaserScan {
            header: Header::new(Stamp::default().plus_seconds(1.0), "laser"),
            angle_min: -0.5,
            angle_max: 0.5,
            angle_increment: 0.01,
            range_min: 0.1,
            range_max: 10.0,
            ranges: vec![1.0; 101],
            ..LaserScan::default()
        }
    }

    #[test]
    fn a_header_that_cannot_be_is_refused_with_its_field() {
        assert_eq!(scan_fault(&base()), None);
        let nan = f32::NAN;
        for (field, broken) in [
            ("angle_min is NaN", LaserScan { angle_min: nan, ..base() }),
            ("angle_increment is inf", LaserScan { angle_increment: f32::INFINITY, ..base() }),
            ("angle_increment is 0", LaserScan { angle_increment: 0.0, ..base() }),
            ("angle_increment is 0.1", LaserScan { angle_increment: 0.1, ..base() }),
            ("angle_max 3.000", LaserScan { angle_max: 3.0, ..base() }),
            ("range_max is NaN", LaserScan { range_max: nan, ..base() }),
            ("range_max is 0.01", LaserScan { range_max: 0.01, ..base() }),
            ("range_max is 0 and", LaserScan { range_min: 0.0, range_max: 0.0, ..base() }),
            ("angle_min is 1000000", LaserScan { angle_min: 1e6, angle_max: 1e6, ..base() }),
            (
                "angle_increment is 0.0000001 with",
                LaserScan { angle_increment: 1e-7, angle_max: -0.49999, ..base() },
            ),
            ("angle_increment is -0.01 and", LaserScan { angle_increment: -0.01, ..base() }),
            ("angle_min 0.500 away", LaserScan { angle_min: 0.5, angle_max: -0.5, ..base() }),
            ("range_min is NaN", LaserScan { range_min: nan, ..base() }),
            ("ranges is empty", LaserScan { ranges: vec![], ..base() }),
            ("ranges has 65537", LaserScan { ranges: vec![1.0; MAX_RAYS + 1], ..base() }),
        ] {
            let why = scan_fault(&broken).unwrap_or_default();
            assert!(why.contains(field), "{field}: {why}");
        }
    }

    #[test]
    fn headers_of_real_drivers_are_taken() {
        for fine in [
            // One ray more or less than the angles say, both ends of a turn, a turn the other way,
            // no last angle, no largest range.
            LaserScan { ranges: vec![1.0; 102], ..base() },
            LaserScan { ranges: vec![1.0; 100], ..base() },
            LaserScan { angle_min: 0.5, angle_max: -0.5, angle_increment: -0.01, ..base() },
            LaserScan { angle_min: 0.0, angle_max: 0.0, ..base() },
            LaserScan { range_max: f32::INFINITY, ..base() },
            LaserScan { ranges: vec![1.0], angle_increment: 0.0, ..base() },
            // A view across the back, which begins on the left.
            LaserScan { angle_min: 2.64, angle_max: -2.64, ..base() },
        ] {
            assert_eq!(scan_fault(&fine), None, "{fine:?}");
        }
    }

    /// Returns ranges as of a room, in metres times `factor`.
    fn room(factor: f32) -> Vec<f32> {
        (0..101_u16).map(|ray| factor * (1.0 + 0.05 * f32::from(ray))).collect()
    }

    #[test]
    fn ranges_of_another_unit_are_refused() {
        for (words, ranges, range_max) in [
            ("beyond range_max 10", room(1000.0), 10.0),
            ("beyond range_max 10", room(100.0), 10.0),
            ("half of the ranges", room(1000.0), 10_000.0),
            ("half of the ranges", room(1000.0), f32::INFINITY),
            ("most ranges are negative", room(-1.0), 10.0),
        ] {
            let why = scan_fault(&LaserScan { ranges, range_max, ..base() }).unwrap_or_default();
            assert!(why.contains(words), "{words}: {why}");
        }
    }

    #[test]
    fn values_in_place_of_ranges_are_no_fault() {
        let mut partly = room(1.0);
        partly[..80].fill(f32::MAX);
        let mut partly_negative = room(1.0);
        partly_negative[..80].fill(-1.0);
        for (ranges, range_max) in [
            (room(1.0), 10.0),
            // A hall beyond the range, and one of which a part is within it.
            (room(8.0), 7.0),
            (room(8.0), 20.0),
            (partly, f32::MAX),
            (partly_negative, 10.0),
            (vec![0.0; 101], 10.0),
            (vec![65.533; 101], 10.0),
            (vec![f32::INFINITY; 101], 10.0),
            (vec![f32::NAN; 101], 10.0),
            (vec![f32::NEG_INFINITY; 101], 10.0),
        ] {
            let scan = LaserScan { ranges, range_max, ..base() };
            assert_eq!(scan_fault(&scan), None, "{scan:?}");
        }
    }
}
