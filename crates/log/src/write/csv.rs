//! Columns of `tracks.csv`, `tracks-metres.csv` and `joints.csv`.

use std::io::{self, Write};

use nalgebra::Point3;

use super::record::{FrameRecord, OutputSettings, probability};

/// Header line of `tracks-metres.csv`.
pub const METRES_HEADER: &str = "stamp_ns,frame,id,x_robot_m,y_robot_m,z_robot_m,x_odom_m,\
y_odom_m,z_odom_m,vx_robot_mps,vy_robot_mps,var_xx_m2,cov_xy_m2,cov_xz_m2,var_yy_m2,cov_yz_m2,\
var_zz_m2,seen";

/// Writes the lines of `tracks.csv` for one frame: the ten columns of the MOTChallenge,
/// `frame,id,x,y,w,h,score,-1,-1,-1`.
///
/// `frame` is the 1-based index of the frame; the box is the upper-body square, or that of the
/// whole person if the settings say so, clipped to the image, in pixels with (0, 0) at the upper
/// left corner; `score` is a probability. Only confirmed tracks are written, unless they have not
/// been seen for longer than `report_unseen_s`.
pub(super) fn boxes(
    out: &mut impl Write,
    record: &FrameRecord<'_>,
    settings: &OutputSettings,
) -> io::Result<()> {
    let report_unseen_s = settings.report_unseen_s;
    for track in record.confirmed() {
        let shown = track.seen || (track.unseen_s <= report_unseen_s && report_unseen_s > 0.0);
        let Some(region) = record.visible_region(track, settings.boxes).filter(|_| shown) else {
            continue;
        };
        writeln!(
            out,
            "{},{},{},{},{},{},{},-1,-1,-1",
            record.index,
            track.id,
            Decimal(region.x, 2),
            Decimal(region.y, 2),
            Decimal(region.width, 2),
            Decimal(region.height, 2),
            Decimal(probability(track.score), 6),
        )?;
    }
    Ok(())
}

/// Writes the lines of `tracks-metres.csv` for one frame, with all confirmed tracks.
pub(super) fn metres(out: &mut impl Write, record: &FrameRecord<'_>) -> io::Result<()> {
    for track in record.confirmed() {
        let person = &track.estimate.person;
        let covariance = &track.estimate.covariance;
        write!(out, "{},{},{}", record.stamp.nanos(), record.index, track.id)?;
        let in_odom = if record.is_odom_known {
            record.head_in_odom(track)
        } else {
            Point3::new(f64::NAN, f64::NAN, f64::NAN)
        };
        let places = [person.position, in_odom];
        for value in places.iter().flat_map(|p| p.iter()).chain(person.velocity.iter()) {
            write!(out, ",{}", Decimal(*value, 4))?;
        }
        for (row, column) in [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)] {
            write!(out, ",{}", Decimal(covariance[(row, column)], 6))?;
        }
        writeln!(out, ",{}", u8::from(track.seen))?;
    }
    Ok(())
}

/// Header line of `joints.csv`.
pub(super) const JOINTS_HEADER: &str = "stamp_ns,frame,id,joint,x_px,y_px,score";

/// Writes the lines of `joints.csv` for one frame: each joint of each confirmed track for which a
/// detector found joints, by its name in COCO.
pub(super) fn joints(out: &mut impl Write, record: &FrameRecord<'_>) -> io::Result<()> {
    for track in record.confirmed() {
        let Some(joints) = record.joints_of(track) else { continue };
        for (name, joint) in joints.iter() {
            writeln!(
                out,
                "{},{},{},{},{},{},{}",
                record.stamp.nanos(),
                record.index,
                track.id,
                name.name(),
                Decimal(joint.at.x, 1),
                Decimal(joint.at.y, 1),
                Decimal(joint.score, 3),
            )?;
        }
    }
    Ok(())
}

/// Number with fixed decimals that never prints a negative zero.
struct Decimal(f64, usize);

impl std::fmt::Display for Decimal {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        // Smaller values would be printed as zero, negative ones with a sign.
        let half = 0.5 * 10f64.powi(-(self.1 as i32));
        let value = if self.0.abs() < half { 0.0 } else { self.0 };
        write!(f, "{value:.*}", self.1)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::{Isometry2, Point2, Vector2};
    use tagalong_core::{Joint, JointName, Joints, TrackId};

    use super::super::record::BoxedPart;
    use super::super::testing::{camera, track};
    use super::*;

    #[test]
    fn joints_are_written_by_their_names() {
        let mut all = [Joint { at: Point2::new(3.04, 5.0), score: 0.25 }; 17];
        all[JointName::RightAnkle as usize].at = Point2::new(-0.01, 470.0);
        let joints = [(TrackId(12), Arc::new(Joints::new(all)))];
        let (known, other) = (track(12), track(13));
        let tracks = [known, other];
        let record = FrameRecord {
            index: 7,
            stamp: tagalong_core::Stamp::from_nanos(5),
            camera: &camera(),
            odom_from_robot: &Isometry2::identity(),
            is_odom_known: true,
            tracks: &tracks,
            joints: &joints,
            target: None,
            command: None,
        };
        let mut text = Vec::new();
        super::joints(&mut text, &record).unwrap();
        let text = String::from_utf8(text).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!((lines.len(), lines[0]), (17, "5,7,12,nose,3.0,5.0,0.250"));
        assert_eq!(lines[16], "5,7,12,right_ankle,0.0,470.0,0.250");
    }

    fn lines(tracks: &[tagalong_core::Track], unseen_s: f64) -> (String, String) {
        let record = FrameRecord {
            index: 7,
            stamp: tagalong_core::Stamp::from_nanos(1_500_000_000),
            camera: &camera(),
            odom_from_robot: &Isometry2::new(Vector2::new(1.0, 2.0), std::f64::consts::FRAC_PI_2),
            is_odom_known: true,
            tracks,
            joints: &[],
            target: None,
            command: None,
        };
        let mut a = Vec::new();
        let mut b = Vec::new();
        let settings = OutputSettings { report_unseen_s: unseen_s, ..OutputSettings::default() };
        boxes(&mut a, &record, &settings).unwrap();
        metres(&mut b, &record).unwrap();
        (String::from_utf8(a).unwrap(), String::from_utf8(b).unwrap())
    }

    #[test]
    fn boxes_have_ten_columns_and_stay_in_the_image() {
        let mut one = track(12);
        one.estimate.region = tagalong_geometry::Rect::new(-10.0, 400.0, 100.0, 100.0);
        one.score = 0.0;
        let (text, _) = lines(&[one], 0.0);
        assert_eq!(text, "7,12,0.00,400.00,90.00,80.00,0.500000,-1,-1,-1\n");
    }

    #[test]
    fn boxes_are_those_of_whole_people_where_the_settings_say_so() {
        let one = track(4);
        let record = FrameRecord {
            index: 1,
            stamp: tagalong_core::Stamp::from_nanos(1),
            camera: &camera(),
            odom_from_robot: &Isometry2::identity(),
            is_odom_known: true,
            tracks: std::slice::from_ref(&one),
            joints: &[],
            target: None,
            command: None,
        };
        let upper = record.visible_region(&one, BoxedPart::Upper).unwrap();
        let full = record.visible_region(&one, BoxedPart::Full).unwrap();
        assert!(full.height > 1.5 * upper.height, "{upper:?} {full:?}");
        assert!(full.bottom() <= camera().height as f64, "it ends with the image");
        let settings = OutputSettings { boxes: BoxedPart::Full, ..OutputSettings::default() };
        let mut text = Vec::new();
        boxes(&mut text, &record, &settings).unwrap();
        let text = String::from_utf8(text).unwrap();
        assert!(text.contains(&format!(",{:.2},{:.2},", full.width, full.height)), "{text}");
    }

    #[test]
    fn only_confirmed_and_recently_seen_tracks_have_boxes() {
        let mut tentative = track(1);
        tentative.confirmed = false;
        let mut coasting = track(2);
        (coasting.seen, coasting.unseen_s) = (false, 0.4);
        let mut outside = track(3);
        outside.estimate.region = tagalong_geometry::Rect::new(700.0, 0.0, 50.0, 50.0);
        let tracks = [tentative, coasting, outside];
        assert_eq!(lines(&tracks, 0.0).0, "");
        assert!(lines(&tracks, 0.5).0.starts_with("7,2,"), "a coasting track may be asked for");
        assert_eq!(lines(&tracks, 0.5).0.lines().count(), 1);
        assert_eq!(lines(&tracks, 0.0).1.lines().count(), 2, "metres list coasting tracks");
    }

    #[test]
    fn metres_are_given_in_both_frames() {
        let (_, text) = lines(&[track(4)], 0.0);
        let cells: Vec<&str> = text.trim_end().split(',').collect();
        assert_eq!(cells.len(), METRES_HEADER.split(',').count());
        assert_eq!(cells[..3], ["1500000000", "7", "4"]);
        assert_eq!(cells[3..6], ["3.0000", "0.5000", "1.6000"]);
        assert_eq!(cells[6..9], ["0.5000", "5.0000", "1.6000"], "turned left, then moved");
        assert_eq!(cells[17], "1");
    }

    #[test]
    fn no_number_is_a_negative_zero() {
        assert_eq!(Decimal(-0.001, 2).to_string(), "0.00");
        assert_eq!(Decimal(-0.006, 2).to_string(), "-0.01");
    }
}
