//! Scans an image with a cascade repeatedly: `time_cascade CASCADE.xml PICTURE RUNS`. For the
//! comparisons with OpenCV in `benches/peers/`. Prints the boxes, too: x, y, width, height.
#![allow(clippy::expect_used, clippy::print_stdout, reason = "a program for developers")]

use tagalong_core::GreyImage;
use tagalong_face_rgbd::{Cascade, Scanner, grouped, scales};
use tagalong_geometry::Rect;

fn main() {
    let mut arguments = std::env::args().skip(1);
    let [cascade, picture, runs] =
        [(); 3].map(|()| arguments.next().expect("CASCADE.xml PICTURE RUNS"));
    let runs = runs.parse::<usize>().expect("a number");
    let text = std::fs::read_to_string(cascade).expect("the cascade can be read");
    let cascade = Cascade::from_xml(&text).expect("it is a cascade");
    let image = image::open(picture).expect("the picture can be read").into_luma8();
    let width = image.width() as usize;
    let height = image.height() as usize;
    let image = GreyImage::from_pixels(width, height, image.into_raw()).expect("all pixels");
    let (mut scanner, mut found): (_, Vec<Rect>) = (Scanner::default(), Vec::new());
    for _ in 0..runs {
        let mut hits = Vec::new();
        let sizes = scales(&cascade, 0.0, width as f64, 1.1)
            .take_while(|scale| (cascade.height as f64 * scale).round() <= height as f64);
        scanner.scan(&image, &cascade, sizes, &mut hits);
        found = grouped(&hits, 3).iter().map(|group| group.region).collect();
    }
    println!("{} faces, {} windows a run", found.len(), scanner.looked_at() / runs.max(1) as u64);
    for Rect { x, y, width, height } in found {
        println!("{x} {y} {width} {height}");
    }
}
