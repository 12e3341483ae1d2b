use std::ops::Range;
use std::sync::Arc;

use nalgebra::{Isometry2, Point2, Point3, SMatrix, Vector2};
use tagalong_core::{DepthImage, Detection, Estimate, Images, Person, Stamp, Track, TrackId};
use tagalong_geometry::{Camera, Distortion, ImageBox, Pinhole, Rect};
use tagalong_log::write::{self, BoxedPart};
use tagalong_pipeline::{Candidate, Cause, Fate, FrameReport};
use tagalong_vision::{Silhouette, Sketch, SketchMap, SketchPoint};

use super::canvas::LINE_PX;
use super::*;

const CALM: OverlayStyle =
    OverlayStyle { detail: Detail::People, boxes: BoxedPart::Upper, reach_m: 8 };
const DEBUG: OverlayStyle = OverlayStyle { detail: Detail::Debug, ..CALM };

fn track(id: u32, camera: &Camera) -> Track {
    let person = Person { position: Point3::new(3.0, 0.4, 1.6), velocity: Vector2::new(0.5, 0.0) };
    let region = camera.upper_body(&person.position);
    let covariance = SMatrix::<f64, 5, 5>::identity() * 0.01;
    Track::new(TrackId(id), Estimate::new(person, covariance, region), 3.0).with_age(5)
}

pub(crate) fn scene(tracks: &[u32], candidates: Vec<Candidate>) -> OverlayData {
    let lens = Pinhole { fx: 260.0, fy: 260.0, cx: 159.5, cy: 119.5, distortion: Distortion::None };
    let camera = Camera::mounted(lens, 320, 240, 1.2, 0.0, 0.0);
    let depth = Some(Arc::new(DepthImage::filled(320, 240, 4.0)));
    let mut report = FrameReport::new(3, Stamp::from_nanos(1_000_000_000));
    report.candidates = candidates;
    report.tracks = tracks.iter().map(|id| track(*id, &camera)).collect();
    OverlayData {
        scan: Vec::new(),
        is_around: false,
        images: Images { depth, ..Images::default() },
        odom_from_robot: Isometry2::identity(),
        report,
        camera: Arc::new(camera),
    }
}

fn changed(a: &RgbImage, b: &RgbImage, columns: Range<usize>, rows: Range<usize>) -> usize {
    rows.flat_map(|y| columns.clone().map(move |x| (x, y)))
        .filter(|(x, y)| a.row(*y)[*x] != b.row(*y)[*x])
        .count()
}

#[test]
fn the_state_of_the_filter_shows_in_the_image() {
    let without = picture(&scene(&[], Vec::new()), &Trails::default(), DEBUG);
    let mut scene = scene(&[], Vec::new());
    let run = Rect::new(100.0, 60.0, 30.0, 2.0);
    scene.report.visualisation = Some(Arc::new(Sketch {
        points: vec![SketchPoint { id: TrackId(1), pixel: Point2::new(200.5, 90.5), weight: 1.0 }],
        silhouettes: vec![Silhouette { id: TrackId(1), runs: vec![run] }],
        maps: vec![SketchMap { title: String::new(), columns: 10, values: vec![0.5; 50] }],
    }));
    let with = picture(&scene, &Trails::default(), DEBUG);
    let [run, particle, map] =
        [200..260, 390..412, 0..80].map(|columns| changed(&without, &with, columns, 0..480));
    assert_eq!(run, 4 * 60, "a run, twice as large in both directions");
    assert!(particle > 4, "a particle");
    let title = 2 * LINE_PX as usize;
    assert_eq!(map, 40 * 20 + title, "a map, and its title's bar");
}

#[test]
fn a_person_shows_in_the_image_and_from_above() {
    let empty = picture(&scene(&[], Vec::new()), &Trails::default(), DEBUG);
    let one = picture(&scene(&[1], Vec::new()), &Trails::default(), DEBUG);
    assert!(changed(&empty, &one, 0..640, 0..480) > 400);
    assert!(changed(&empty, &one, 640..1024, 0..480) > 100);
    // Title and counts are in the strip below.
    assert!(changed(&empty, &one, 0..640, 480..544) > 10);
}

#[test]
fn in_a_frozen_image_a_person_is_grey_and_stale() {
    fn coloured(scene: &OverlayData) -> usize {
        let picture = picture(scene, &Trails::default(), CALM);
        let colour = write::track_colour(TrackId(1));
        picture.pixels().iter().filter(|pixel| **pixel == colour).count()
    }

    let mut scene = scene(&[1], Vec::new());
    assert!(coloured(&scene) > 100, "{}", coloured(&scene));
    let name = "the depth image".to_owned();
    scene.report.cause = Some(Cause::Sensor { name, needs_reset: true, shows_past: true });
    assert_eq!(coloured(&scene), 0);
    let labels = image_view::placed_labels(&scene, CALM);
    assert_eq!(labels.bars()[0].1, "1 stale 3.0 m");
}

#[test]
fn small_images_are_enlarged_to_640_columns_and_all_pictures_have_one_even_size() {
    fn size(scene: &OverlayData) -> (usize, usize) {
        let picture = picture(scene, &Trails::default(), DEBUG);
        (picture.width(), picture.height())
    }

    let image = (640, 480);
    let plan = 480 * 4 / 5;
    assert_eq!(size(&scene(&[], Vec::new())), (image.0 + plan, image.1 + legend::height_px(DEBUG)));
    assert_eq!(size(&scene(&[1, 2], Vec::new())), size(&scene(&[], Vec::new())));
    let mut odd = scene(&[1], Vec::new());
    odd.camera = Arc::new(Camera { width: 217, height: 121, ..(*odd.camera).clone() });
    let (width, height) = size(&odd);
    assert!(width >= 640 && width % 2 == 0 && height % 2 == 0, "{width} {height}");
    // Without a camera there is the plan alone.
    odd.camera = Arc::new(Camera { width: 0, height: 0, ..(*odd.camera).clone() });
    odd.images = Images::default();
    assert_eq!(size(&odd), (640, ROWS_ALONE + legend::height_px(DEBUG)));
}

#[test]
fn points_of_a_scan_are_in_the_plan() {
    // 3 m ahead and 1 m to the left, by 50 pixels a metre, of a robot at column 180 and row 400.
    fn at(k: &usize) -> bool {
        (k % 360).abs_diff(130) <= 1 && (k / 360).abs_diff(250) <= 1
    }

    let empty = scene(&[], Vec::new());
    let scanned = OverlayData { scan: vec![Point2::new(3.0, 1.0)], ..scene(&[], Vec::new()) };
    let [without, with] = [empty, scanned]
        .map(|scene| plan_view::draw(&scene, &Trails::default(), DEBUG, 450).into_image());
    let changed: Vec<usize> =
        (0..without.pixels().len()).filter(|k| without.pixels()[*k] != with.pixels()[*k]).collect();
    assert!(!changed.is_empty() && changed.iter().all(at), "{changed:?}");
}

#[test]
fn a_person_behind_the_robot_is_in_the_plan_of_a_lidar_and_has_no_label_in_the_image() {
    let mut behind = scene(&[1], Vec::new());
    behind.report.tracks[0].estimate.person.position.x = -3.0;
    behind.report.tracks[0].estimate.region = Rect::default();
    assert!(image_view::placed_labels(&behind, OverlayStyle::default()).bars().is_empty());
    let [with, without] = [&behind, &scene(&[], Vec::new())].map(|scene| {
        image_view::draw(scene, &Trails::default(), OverlayStyle::default()).into_image()
    });
    assert!(with == without, "there is no box");
    // 3 m behind a robot at row 250, by 50 pixels a metre.
    for is_around in [true, false] {
        let empty = OverlayData { is_around, ..scene(&[], Vec::new()) };
        behind.is_around = is_around;
        let [with, without] = [&behind, &empty].map(|scene| {
            plan_view::draw(scene, &Trails::default(), OverlayStyle::default(), 450).into_image()
        });
        let pixels = changed(&with, &without, 0..360, 380..420);
        assert_eq!(pixels > 20, is_around, "{pixels}");
    }
}

#[test]
fn the_plan_reaches_as_far_as_the_pipeline() {
    let mut far = scene(&[1], Vec::new());
    far.report.tracks[0].estimate.person.position.x = 12.0;
    for (reach_m, ahead_m, is_there) in
        [(0.0, 8, false), (5.5, 8, false), (15.0, 16, true), (99.0, 30, true)]
    {
        let style = OverlayStyle::default().reaching(reach_m);
        assert_eq!(style.reach_m, ahead_m);
        let [with, without] = [&far, &scene(&[], Vec::new())]
            .map(|scene| plan_view::draw(scene, &Trails::default(), style, 450).into_image());
        assert_eq!(with != without, is_there, "{reach_m} m");
    }
}

#[test]
fn the_labels_of_two_people_side_by_side_do_not_overlap() {
    let mut scene = scene(&[1, 2, 3], vec![dropped("head width")]);
    // Beside each other, and the third one at the upper edge of the image.
    for (track, x, y) in [(0, 100.0, 60.0), (1, 112.0, 62.0), (2, 100.0, -10.0)] {
        let region = &mut scene.report.tracks[track].estimate.region;
        (region.x, region.y) = (x, y);
    }
    scene.report.tracks[1].seen = false;
    scene.report.tracks[2].estimate.covariance *= 100.0;
    let labels = image_view::placed_labels(&scene, DEBUG);
    let bars = labels.bars();
    let texts: Vec<&str> = bars.iter().map(|(_, text)| *text).collect();
    assert_eq!(texts, ["1 3.0 m", "2 predicted 3.0 m", "3 ~3.0 m", "head width"]);
    for (i, (bar, text)) in bars.iter().enumerate() {
        assert!(bar.height >= 16.0, "{text}");
        assert_eq!(bar.clipped(640, 480), *bar, "{text} leaves the image");
        for (other, name) in &bars[..i] {
            assert_eq!(bar.intersection(other).area(), 0.0, "{text} is over {name}");
        }
    }
}

#[test]
fn the_ids_of_two_people_at_one_place_can_both_be_read_in_the_plan() {
    let scene = scene(&[1, 12, 3, 4, 5, 6], Vec::new());
    let labels = plan_view::placed_ids(&scene, CALM, 480);
    let bars = labels.bars();
    assert_eq!(bars.len(), 6, "{bars:?}");
    for (i, (bar, text)) in bars.iter().enumerate() {
        for (other, name) in &bars[..i] {
            assert_eq!(bar.intersection(other).area(), 0.0, "{text} is over {name}");
        }
    }
}

#[test]
fn a_predicted_person_is_a_ring_in_the_plan() {
    let mut scene = scene(&[1], Vec::new());
    scene.report.tracks[0].estimate.person.velocity = Vector2::zeros();
    let [predicted, seen] = [false, true].map(|seen| {
        scene.report.tracks[0].seen = seen;
        let plan = plan_view::draw(&scene, &Trails::default(), CALM, 480).into_image();
        // The person is 3 m ahead and 0.4 m to the left; 480 rows show 9 m.
        plan.get(192 - 21, 427 - 160)
    });
    assert_ne!(predicted, seen);
    assert_eq!(predicted, Some([24, 24, 28]));
}

#[test]
fn a_predicted_person_outside_of_the_image_has_no_label() {
    let mut scene = scene(&[1, 2], Vec::new());
    let side = scene.report.tracks[0].estimate.region.width;
    scene.report.tracks[0].seen = false;
    for (x, expected) in [
        (-500.0, &["2 3.0 m"][..]),
        (-0.9 * side, &["2 3.0 m"]),
        (-0.5 * side, &["1 predicted 3.0 m", "2 3.0 m"]),
    ] {
        scene.report.tracks[0].estimate.region.x = x;
        let labels = image_view::placed_labels(&scene, DEBUG);
        let texts: Vec<&str> = labels.bars().into_iter().map(|(_, text)| text).collect();
        assert_eq!(texts, expected);
    }
}

fn dropped(test: &'static str) -> Candidate {
    let detection =
        Detection::new("test", Point3::new(4.0, 1.0, 1.0), nalgebra::Matrix3::identity(), -1.0)
            .with_image(ImageBox::upper_body(Rect::new(20.0, 150.0, 60.0, 60.0)));
    Candidate { detection, fate: Fate::Dropped(test) }
}

#[test]
fn dropped_candidates_are_in_the_picture() {
    let empty = picture(&scene(&[], Vec::new()), &Trails::default(), DEBUG);
    let shown = picture(&scene(&[], vec![dropped("margin")]), &Trails::default(), DEBUG);
    assert!(changed(&empty, &shown, 40..160, 0..480) > 200);
    assert_eq!(changed(&empty, &shown, 240..1024, 0..480), 0);
}

#[test]
fn the_picture_is_a_png_of_the_frame() {
    let home = tempfile::tempdir().unwrap();
    let mut overlay = Overlay::new(home.path().to_owned(), DEBUG);
    overlay.draw(&scene(&[1], Vec::new())).unwrap();
    let file = std::io::BufReader::new(File::open(home.path().join("000003.png")).unwrap());
    let reader = png::Decoder::new(file).read_info().unwrap();
    assert_eq!((reader.info().width, reader.info().height), (1024, 544));
    let error =
        Overlay::new(home.path().join("gone"), DEBUG).draw(&scene(&[], Vec::new())).unwrap_err();
    assert!(error.contains("000003.png"), "{error}");
}

#[test]
fn calm_pictures_show_confirmed_people_alone() {
    let empty = picture(&scene(&[], Vec::new()), &Trails::default(), CALM);
    let mut busy = scene(&[1], vec![dropped("margin")]);
    busy.report.tracks[0].confirmed = false;
    busy.report.visualisation = Some(Arc::new(Sketch {
        points: vec![SketchPoint { id: TrackId(1), pixel: Point2::new(200.5, 90.5), weight: 1.0 }],
        silhouettes: Vec::new(),
        maps: vec![SketchMap { title: "map".into(), columns: 10, values: vec![0.5; 50] }],
    }));
    let calm = picture(&busy, &Trails::default(), CALM);
    assert_eq!(changed(&empty, &calm, 0..1024, 0..480), 0);
    let debug = picture(&busy, &Trails::default(), DEBUG);
    assert!(changed(&empty, &debug, 0..1024, 0..480) > 1000);
    let labels = image_view::placed_labels(&scene(&[1], vec![dropped("margin")]), CALM);
    assert_eq!(labels.bars().len(), 1, "{:?}", labels.bars());
}

#[test]
fn boxes_are_those_of_the_output_settings() {
    let scene = scene(&[1], Vec::new());
    let full = OverlayStyle { boxes: BoxedPart::Full, ..CALM };
    let track = &scene.report.tracks[0];
    assert_eq!(CALM.region(&scene, track), track.estimate.region);
    let whole = full.region(&scene, track);
    assert!(whole.height > 2.0 * track.estimate.region.height, "{whole:?}");
    let calm = picture(&scene, &Trails::default(), CALM);
    // Feet are 3 m away, below the middle of the image, where no upper body is.
    let feet = (2.0 * whole.bottom()) as usize;
    assert!(feet > 260 && feet < 480, "{feet}");
    let shown = picture(&scene, &Trails::default(), full);
    assert!(changed(&calm, &shown, 0..640, feet - 8..feet + 8) > 20);
}

#[test]
fn trails_end_with_their_people_and_after_two_seconds() {
    let mut trails = Trails::default();
    let mut with = scene(&[1], Vec::new());
    for tenth in 0..100 {
        with.report.stamp = Stamp::from_nanos(1_000_000_000 + tenth * 100_000_000);
        trails.follow(&with);
    }
    let [(id, points)] = &trails.in_robot(&with)[..] else { panic!("one trail") };
    assert_eq!((id.0, points.len()), (1, 21));
    assert!((points[0] - Point3::new(3.0, 0.4, 1.6)).norm() < 1e-12);
    let without = scene(&[], Vec::new());
    trails.follow(&without);
    assert!(trails.in_robot(&without).is_empty());
}

#[test]
fn a_person_who_is_not_seen_has_no_trail_and_a_gap_splits_it() {
    let mut trails = Trails::default();
    let mut scene = scene(&[1], Vec::new());
    for tenth in 0..20 {
        scene.report.stamp = Stamp::from_nanos(1_000_000_000 + tenth * 100_000_000);
        scene.report.tracks[0].seen = !(5..15).contains(&tenth);
        trails.follow(&scene);
        let is_empty = trails.in_robot(&scene).is_empty();
        assert_eq!(is_empty, !scene.report.tracks[0].seen, "{tenth}");
    }
    let pieces: Vec<usize> = trails.in_robot(&scene).iter().map(|(_, at)| at.len()).collect();
    assert_eq!(pieces, [5, 5]);
}

#[test]
fn the_label_of_the_target_says_so() {
    let mut scene = scene(&[1], Vec::new());
    scene.report.tracks[0].confirmed = true;
    let plain = image_view::placed_labels(&scene, CALM);
    assert!(!plain.bars()[0].1.contains("target"), "{:?}", plain.bars());
    scene.report.target = Some(TrackId(1));
    let labels = image_view::placed_labels(&scene, CALM);
    assert!(labels.bars()[0].1.starts_with("1 target "), "{:?}", labels.bars());
}
