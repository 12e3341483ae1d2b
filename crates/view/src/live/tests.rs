use std::io::{Read, Write};
use std::net::TcpStream;

use nalgebra::{Point3, SMatrix, Vector2};
use serde_json::Value;
use tagalong_config::Registry;
use tagalong_core::{EgoMotion, Estimate, Images, Person, RgbImage, Stamp, Track, TrackId};
use tagalong_geometry::{Camera, Distortion, Pinhole};

use super::*;

fn camera() -> Arc<Camera> {
    let lens = Pinhole { fx: 500.0, fy: 500.0, cx: 319.5, cy: 239.5, distortion: Distortion::None };
    Arc::new(Camera::mounted(lens, 640, 480, 1.2, 0.0, 0.0))
}

/// Returns a person 3 m ahead who walks to the left, in frame `index` of ten a second. From the sixth on the
/// distance is a guess.
fn moment(index: u64) -> (Frame, FrameReport) {
    let camera = camera();
    let stamp = Stamp::from_nanos(1_000_000_000 + index * 100_000_000);
    let colour = Some(Arc::new(RgbImage::from_fn(640, 480, |x, y| [x as u8, y as u8, 0])));
    let images = Images { colour, ..Images::default() };
    let position = Point3::new(3.0, 0.05 * index as f64, 1.6);
    let person = Person { position, velocity: Vector2::new(0.0, 0.5) };
    let region = camera.upper_body(&position);
    let sigma_m = if index < 6 { 0.1 } else { 0.5 };
    let covariance = SMatrix::<f64, 5, 5>::identity() * (sigma_m * sigma_m);
    let track = Track::new(TrackId(7), Estimate::new(person, covariance, region), 3.0).with_age(5);
    let mut report = FrameReport::new(index, stamp);
    report.tracks = vec![track];
    (Frame::new(index, stamp, camera, EgoMotion::at_rest(0.1), images), report)
}

fn live() -> Live {
    Live::start(
        parse_address("0").unwrap(),
        "depth-ekf",
        "walk.mcap",
        &Table::new(),
        &Registry::default(),
    )
    .unwrap()
}

fn offer(live: &Live, index: u64) {
    let (frame, report) = moment(index);
    live.offer(&frame, &Isometry2::identity(), &report);
}

/// Asks for a path behind the key, and returns the status and the body.
fn ask(live: &Live, method: &str, path: &str) -> (u16, String) {
    let host = live.bound();
    let key = live.address().split('/').nth(3).unwrap();
    let text = format!("{method} /{key}/{path} HTTP/1.1\r\nHost: {host}\r\n\r\n");
    send(live, &text)
}

fn send(live: &Live, text: &str) -> (u16, String) {
    let mut stream = TcpStream::connect(live.bound()).unwrap();
    stream.write_all(text.as_bytes()).unwrap();
    let mut answer = String::new();
    let _ = stream.read_to_string(&mut answer);
    let status = answer.split(' ').nth(1).and_then(|code| code.parse().ok()).unwrap_or(0);
    let body = answer.split_once("\r\n\r\n").map_or("", |(_, body)| body);
    (status, body.to_owned())
}

fn now(live: &Live, after: u64) -> Value {
    let (status, body) = ask(live, "GET", &format!("now?after={after}"));
    assert_eq!(status, 200, "{body}");
    serde_json::from_str(&body).unwrap()
}

#[test]
fn the_page_gets_the_newest_frame_with_image_trail_and_events() {
    let live = live();
    (1..=5).for_each(|index| offer(&live, index));
    let first = now(&live, 0);
    assert_eq!((first["seq"].as_u64(), first["t"].as_f64()), (Some(5), Some(0.4)));
    assert_eq!(first["image_px"], serde_json::json!([640, 480]));
    let track = &first["frame"]["tracks"][0];
    assert_eq!((track["id"].as_u64(), track["state"].as_str()), (Some(7), Some("seen")));
    assert_eq!(track.get("guess"), None);
    assert_eq!(track["trail"].as_array().unwrap().len(), 2 * 4, "four frames before");
    assert!(first["image"].as_str().unwrap().len() > 1000);
    assert_eq!(first["events"][0]["kind"], "started");
    offer(&live, 6);
    let second = now(&live, 5);
    assert_eq!(second["seq"], 6);
    assert_eq!(second["frame"]["tracks"][0]["guess"], true);
    assert!(second["events"].as_array().unwrap().is_empty(), "told once");
}

#[test]
fn the_page_and_its_files_are_served_and_refer_to_nothing_else() {
    let live = live();
    let (status, page) = ask(&live, "GET", "");
    assert_eq!(status, 200);
    assert!(page.contains("walk.mcap") && page.contains("depth-ekf"));
    for part in page.split("src=\"").skip(1).chain(page.split("href=\"").skip(1)) {
        let name = part.split('"').next().unwrap();
        if name.starts_with('#') || name.starts_with("data:") {
            continue;
        }
        assert_eq!(ask(&live, "GET", name).0, 200, "{name}");
    }
    for path in ["now", "now?after=x", "now?after=-1", "../page.css", "etc/passwd"] {
        assert!(matches!(ask(&live, "GET", path).0, 400 | 404), "{path}");
    }
}

#[test]
fn nothing_can_be_changed_and_others_are_refused() {
    let live = live();
    assert!(live.bound().ip().is_loopback());
    for path in ["", "now?after=0", "page.css", "enable"] {
        for method in ["POST", "PUT", "DELETE", "PATCH"] {
            assert!(matches!(ask(&live, method, path).0, 403 | 405), "{method} {path}");
        }
    }
    let host = live.bound();
    let key = live.address().split('/').nth(3).unwrap();
    for (path, headers) in [
        ("", format!("Host: {host}")),
        (key, format!("Host: {host}")),
        (&format!("{key}/"), "Host: evil.example".into()),
        (&format!("{key}/"), format!("Host: {host}\r\nOrigin: http://evil.example")),
    ] {
        let (status, body) = send(&live, &format!("GET /{path} HTTP/1.1\r\n{headers}\r\n\r\n"));
        assert_eq!(status, 403, "{path} {headers}");
        assert!(!body.contains("DOCTYPE"));
    }
}

/// Time that the server gives a browser that does not read.
const PATIENCE: Duration = Duration::from_secs(10);

#[test]
fn browsers_that_do_not_read_cost_the_pipeline_nothing() {
    let live = live();
    offer(&live, 1);
    let host = live.bound();
    let key = live.address().split('/').nth(3).unwrap();
    // More requests than the server answers at once; none of the clients reads a byte.
    let silent: Vec<TcpStream> = (0..40)
        .map(|_| {
            let mut stream = TcpStream::connect(host).unwrap();
            let text = format!("GET /{key}/now?after=0 HTTP/1.1\r\nHost: {host}\r\n\r\n");
            stream.write_all(text.as_bytes()).unwrap();
            stream
        })
        .collect();
    thread::sleep(Duration::from_millis(100));
    let (frame, report) = moment(2);
    let start = Instant::now();
    let mut longest = Duration::ZERO;
    for _ in 0..300 {
        let begun = Instant::now();
        live.offer(&frame, &Isometry2::identity(), &report);
        longest = longest.max(begun.elapsed());
    }
    let all = start.elapsed();
    assert!(all < PATIENCE, "300 frames took {all:?}, the longest {longest:?}");
    drop(silent);
    // The newest frame wins: all others are gone.
    thread::sleep(Duration::from_millis(100));
    assert_eq!(now(&live, 0)["seq"], 301);
}

#[test]
fn images_are_encoded_only_for_a_page_that_asks() {
    let live = live();
    let (frame, report) = moment(1);
    live.offer(&frame, &Isometry2::identity(), &report);
    let colour = frame.images().colour.unwrap();
    // The frame here, the newest one, and this handle: shared, not copied.
    assert_eq!(Arc::strong_count(&colour), 3);
    live.offer(&moment(2).0, &Isometry2::identity(), &moment(2).1);
    assert_eq!(Arc::strong_count(&colour), 2, "the frame before is let go");
}

#[test]
fn the_end_is_told_and_does_not_wait_for_a_page() {
    let live = live();
    offer(&live, 1);
    let start = Instant::now();
    thread::scope(|scope| {
        let waiting = scope.spawn(|| now(&live, 1));
        while !live.newest.was_asked() {
            assert!(start.elapsed() < newest::WAIT / 2, "the page has not asked");
            thread::sleep(Duration::from_millis(5));
        }
        live.newest.end("The run has ended.");
        let last = waiting.join().unwrap();
        assert_eq!(last["ended"], "The run has ended.");
        assert!(last["frame"].is_null());
    });
    // Without the event the page would have had its answer when its wait was over.
    assert!(start.elapsed() < newest::WAIT, "{:?}", start.elapsed());
    assert!(!live.newest.is_watched(), "the only page was told");
    live.finish("again");
}

#[test]
fn addresses_have_three_forms() {
    for (text, expected) in [
        ("0", "127.0.0.1:0"),
        ("8080", "127.0.0.1:8080"),
        ("192.0.2.7", "192.0.2.7:0"),
        ("0.0.0.0:8080", "0.0.0.0:8080"),
        ("::1", "[::1]:0"),
        ("[::1]:9", "[::1]:9"),
    ] {
        assert_eq!(parse_address(text).unwrap().to_string(), expected, "{text}");
    }
    for text in ["", "robot", "localhost:80", "99999", "1.2.3.4:x", "-1"] {
        assert!(parse_address(text).is_err(), "{text}");
    }
}

#[test]
fn a_port_that_is_taken_is_an_error() {
    let first = live();
    assert!(Live::start(first.bound(), "a", "b", &Table::new(), &Registry::default()).is_err());
}
