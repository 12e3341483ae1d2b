use nalgebra::{Point2, Point3, SMatrix, Vector2};
use tagalong_core::{DepthImage, Detection, Estimate, Person, Stamp, Track, TrackId};
use tagalong_geometry::{Distortion, ImageBox, Pinhole, Rect};
use tagalong_pipeline::{Candidate, Fate};
use tagalong_vision::{Silhouette, Sketch, SketchMap, SketchPoint};

use super::canvas::LINE_PX;
use super::*;

fn track(id: u32, camera: &Camera) -> Track {
    let person = Person { position: Point3::new(3.0, 0.4, 1.6), velocity: Vector2::new(0.5, 0.0) };
    let region = camera.upper_body(&person.position);
    let covariance = SMatrix::<f64, 5, 5>::identity() * 0.01;
    Track {
        id: TrackId(id),
        estimate: Estimate { person, covariance, region },
        seen: true,
        occluded: false,
        confirmed: true,
        age: 5,
        unseen_s: 0.0,
        score: 3.0,
    }
}

fn scene(tracks: &[u32], candidates: Vec<Candidate>) -> OverlayData {
    let lens = Pinhole { fx: 260.0, fy: 260.0, cx: 159.5, cy: 119.5, distortion: Distortion::None };
    let camera = Camera::mounted(lens, 320, 240, 1.2, 0.0, 0.0);
    let depth = Some(Arc::new(DepthImage::filled(320, 240, 4.0)));
    OverlayData {
        images: Images { depth, ..Images::default() },
        odom_from_robot: Isometry2::identity(),
        report: FrameReport {
            candidates,
            tracks: tracks.iter().map(|id| track(*id, &camera)).collect(),
            ..FrameReport::new(3, Stamp::from_nanos(1_000_000_000))
        },
        camera: Arc::new(camera),
    }
}

fn changed(a: &RgbImage, b: &RgbImage, columns: std::ops::Range<usize>) -> usize {
    let rows = 0..a.height();
    rows.flat_map(|y| columns.clone().map(move |x| (x, y)))
        .filter(|(x, y)| a.row(*y)[*x] != b.row(*y)[*x])
        .count()
}

#[test]
fn what_the_filter_imagines_shows_in_the_image() {
    let without = picture(&scene(&[], Vec::new()), &Trails::default());
    let mut scene = scene(&[], Vec::new());
    let run = Rect::new(100.0, 60.0, 30.0, 2.0);
    scene.report.visualisation = Some(Arc::new(Sketch {
        points: vec![SketchPoint { id: TrackId(1), pixel: Point2::new(200.5, 90.5), weight: 1.0 }],
        silhouettes: vec![Silhouette { id: TrackId(1), runs: vec![run] }],
        maps: vec![SketchMap { title: String::new(), columns: 10, values: vec![0.5; 50] }],
    }));
    let with = picture(&scene, &Trails::default());
    assert_eq!(changed(&without, &with, 100..130), 60, "a run");
    assert!(changed(&without, &with, 195..206) > 0, "a particle");
    let title = 2 * LINE_PX as usize;
    assert_eq!(changed(&without, &with, 0..40), 20 * 10 + title, "a map, and its title's bar");
}

#[test]
fn a_person_shows_in_the_image_and_from_above() {
    let empty = picture(&scene(&[], Vec::new()), &Trails::default());
    let one = picture(&scene(&[1], Vec::new()), &Trails::default());
    assert_eq!((one.width(), one.height()), (320 + 192, 240));
    assert!(changed(&empty, &one, 0..320) > 100);
    assert!(changed(&empty, &one, 320..512) > 50);
}

#[test]
fn what_was_dropped_is_drawn_too() {
    let detection = Detection {
        image: Some(ImageBox::upper_body(Rect::new(20.0, 150.0, 60.0, 60.0))),
        position: Point3::new(4.0, 1.0, 1.0),
        covariance: nalgebra::Matrix3::identity(),
        score: -1.0,
        source: "test",
    };
    let dropped = Candidate { detection, fate: Fate::Dropped("margin") };
    let empty = picture(&scene(&[], Vec::new()), &Trails::default());
    let shown = picture(&scene(&[], vec![dropped]), &Trails::default());
    assert!(changed(&empty, &shown, 20..80) > 100);
    assert_eq!(changed(&empty, &shown, 120..512), 0);
}

#[test]
fn the_picture_is_a_png_of_the_frame() {
    let home = tempfile::tempdir().unwrap();
    let mut overlay = Overlay::new(home.path().to_owned());
    overlay.draw(&scene(&[1], Vec::new())).unwrap();
    let file = std::io::BufReader::new(File::open(home.path().join("000003.png")).unwrap());
    let reader = png::Decoder::new(file).read_info().unwrap();
    assert_eq!((reader.info().width, reader.info().height), (512, 240));
    let error = Overlay::new(home.path().join("gone")).draw(&scene(&[], Vec::new())).unwrap_err();
    assert!(error.contains("000003.png"), "{error}");
}

#[test]
fn trails_follow_people_and_end_with_them() {
    let mut trails = Trails::default();
    let (with, without) = (scene(&[1], Vec::new()), scene(&[], Vec::new()));
    for _ in 0..100 {
        trails.follow(&with);
    }
    let [(id, points)] = &trails.in_robot(&with)[..] else { panic!("one trail") };
    assert_eq!((id.0, points.len()), (1, 60));
    assert!((points[0] - Point3::new(3.0, 0.4, 1.6)).norm() < 1e-12);
    trails.follow(&without);
    assert!(trails.in_robot(&without).is_empty());
}
