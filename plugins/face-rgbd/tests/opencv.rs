//! Tests against the boxes that OpenCV's own tests expect of its cascades, on its photographs.
//! Without `../shared/data/opencv` each test is skipped with a message.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a broken test may stop loudly, and says what it skips"
)]

use std::path::{Path, PathBuf};

use roxmltree::{Document, Node};
use tagalong_core::{GreyImage, RgbImage};
use tagalong_face_rgbd::{Cascade, Scanner, grouped, scales};
use tagalong_geometry::Rect;

/// Largest difference of the edges of a box from the expected one, as a part of its width or in
/// pixels, whichever is more.
const OFF: f64 = 0.05;
const OFF_PX: f64 = 8.0;
/// Largest share of boxes without a partner, in either list, of those expected: `noPairE` of the
/// file.
const UNPAIRED: f64 = 0.1;

fn data(file: &str) -> Option<PathBuf> {
    tagalong_conformance::testdata::find(&format!("opencv/{file}"))
}

fn text(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap()
}

/// Equalises grey values as OpenCV's `equalizeHist` does.
fn equalised(grey: &GreyImage) -> GreyImage {
    let mut counts = [0_u32; 256];
    grey.pixels().iter().for_each(|v| counts[usize::from(*v)] += 1);
    let first = counts.iter().position(|count| *count > 0).unwrap();
    let rest = grey.pixels().len() as u32 - counts[first];
    let mut sum = 0;
    let mut to = [0_u8; 256];
    for value in first + 1..256 {
        sum += counts[value];
        to[value] = (f64::from(sum) * 255.0 / f64::from(rest)).round() as u8;
    }
    grey.map(|v| to[usize::from(v)])
}

fn photograph(path: &Path) -> GreyImage {
    let image = image::open(path).unwrap().into_rgb8();
    let width = image.width() as usize;
    let height = image.height() as usize;
    let pixels = image.pixels().map(|p| p.0).collect();
    equalised(&RgbImage::from_pixels(width, height, pixels).unwrap().to_grey())
}

fn child<'a, 'i>(of: Node<'a, 'i>, name: &str) -> Node<'a, 'i> {
    of.children().find(|node| node.has_tag_name(name)).unwrap()
}

fn words(of: Node<'_, '_>) -> Vec<String> {
    let parts = of.children().filter_map(|node| if node.is_text() { node.text() } else { None });
    parts.flat_map(|part| part.split_whitespace().map(String::from).collect::<Vec<_>>()).collect()
}

fn boxes(words: &[String]) -> Vec<Rect> {
    let numbers: Vec<f64> = words.iter().map(|word| word.parse().unwrap()).collect();
    numbers.chunks_exact(4).map(|b| Rect::new(b[0], b[1], b[2], b[3])).collect()
}

/// The faces that the cascade finds with the settings of OpenCV's tests.
fn found(cascade: &Cascade, image: &GreyImage) -> Vec<Rect> {
    let mut scanner = Scanner::default();
    let mut hits = Vec::new();
    let fitting = scales(cascade, 0.0, image.width() as f64, 1.1)
        .take_while(|scale| (cascade.height as f64 * scale).round() <= image.height() as f64);
    scanner.scan(image, cascade, fitting, &mut hits);
    grouped(&hits, 3).iter().map(|group| group.region).collect()
}

fn is_same(a: &Rect, b: &Rect) -> bool {
    let most = OFF_PX.max(OFF * b.width);
    let edges = [a.x - b.x, a.y - b.y, a.right() - b.right(), a.bottom() - b.bottom()];
    edges.iter().all(|off| off.abs() <= most)
}

/// The number of `these` without a partner among `those`.
fn unpaired(these: &[Rect], those: &[Rect]) -> usize {
    these.iter().filter(|a| !those.iter().any(|b| is_same(a, b))).count()
}

#[test]
fn cascades_of_both_layouts_find_what_opencv_expects() {
    let Some(file) = data("cascade.xml") else { return };
    let content = text(&file);
    let document = Document::parse(&content).unwrap();
    let root = child(document.root_element(), "cascade");
    let images: Vec<GreyImage> = words(child(root, "image_filenames"))
        .iter()
        .map(|name| {
            photograph(&file.with_file_name("images").join(Path::new(name).file_name().unwrap()))
        })
        .collect();
    let mut expected = 0;
    let mut missed = 0;
    let mut surplus = 0;
    for detector in child(root, "detectors").children().filter(Node::is_element) {
        let name = detector.tag_name().name();
        let cascade = words(child(detector, "fn")).concat();
        let cascade = Path::new(&cascade).file_name().unwrap();
        let Some(path) = data(&format!("cascades-old-layout/{}", cascade.display())) else {
            return;
        };
        let cascade = Cascade::from_xml(&text(&path)).unwrap();
        let of_images = child(child(root, "validation"), name);
        let mut here = (0, 0, 0);
        for (index, image) in images.iter().enumerate() {
            let wanted = boxes(&words(child(of_images, &format!("img_{index}"))));
            let found = found(&cascade, image);
            here.0 += wanted.len();
            here.1 += unpaired(&wanted, &found);
            here.2 += unpaired(&found, &wanted);
        }
        println!("{name}: {} boxes expected, {} missed, {} more", here.0, here.1, here.2);
        expected += here.0;
        missed += here.1;
        surplus += here.2;
    }
    println!("together: {expected} expected, {missed} missed, {surplus} more");
    assert!(expected > 300);
    assert!(missed as f64 <= UNPAIRED * f64::from(expected as u32), "{missed} missed");
    assert!(surplus as f64 <= UNPAIRED * f64::from(expected as u32), "{surplus} more");
}

#[test]
fn both_layouts_of_one_cascade_are_the_same_cascade() {
    for name in ["haarcascade_frontalface_alt2.xml", "haarcascade_frontalface_default.xml"] {
        let Some(old) = data(&format!("cascades-old-layout/{name}")) else { return };
        let Some(new) = data(&format!("cascades-new-layout/{name}")) else { return };
        let [old, new] = [old, new].map(|path| Cascade::from_xml(&text(&path)).unwrap());
        assert_eq!((old.width, old.height), (new.width, new.height));
        assert_eq!(old.stages.len(), new.stages.len());
        for (a, b) in old.stages.iter().zip(&new.stages) {
            assert!((a.threshold - b.threshold).abs() < 1e-4);
            assert_eq!(a.trees.len(), b.trees.len());
        }
        let Some(photo) = data("images/er.png") else { return };
        let image = photograph(&photo);
        let found = [old, new].map(|cascade| found(&cascade, &image));
        assert!(!found[0].is_empty());
        assert_eq!(found[0], found[1], "{name}");
    }
}

#[test]
fn other_kinds_of_cascades_are_refused_with_a_reason() {
    let Some(path) = data("cascades-old-layout/inria_caltech-17.01.2013.xml") else { return };
    assert!(!Cascade::from_xml(&text(&path)).unwrap_err().is_empty());
}
