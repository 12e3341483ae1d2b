//! Scans an image with a model repeatedly: `time_windows MODEL.toml PICTURE RUNS`. For the
//! comparison with OpenCV in `benches/peers/`.
#![allow(clippy::expect_used, clippy::print_stdout, reason = "a program for developers")]

use tagalong_core::GreyImage;
use tagalong_geometry::Rect;
use tagalong_hog_upper_body::{Grid, Model, Scanner, Wanted, merge, window_of};

fn main() {
    let mut arguments = std::env::args().skip(1);
    let [model, picture, runs] =
        [(); 3].map(|()| arguments.next().expect("MODEL.toml PICTURE RUNS"));
    let runs = runs.parse::<usize>().expect("a number");
    let text = std::fs::read_to_string(model).expect("the model can be read");
    let model = Model::from_text(&text).expect("it is a model");
    let image = image::open(picture).expect("the picture can be read").into_luma8();
    let width = image.width() as usize;
    let height = image.height() as usize;
    let image = GreyImage::from_pixels(width, height, image.into_raw()).expect("all pixels");
    let mut scanner = Scanner::new(&model);
    let mut windows = Vec::new();
    // OpenCV does not scan windows that extend beyond the image.
    for _ in 0..runs {
        // Windows are at least 64 pixels wide, and twice as wide as the upper body.
        let most = 0.5 * width.min(height) as f64;
        let sides = std::iter::successors(Some(32.0), |side| Some(side * 1.15));
        let least = model.sum_at(0.0);
        let sides = sides.take_while(|side| *side <= most);
        windows.clear();
        scanner.scan(
            &image,
            sides,
            least,
            |grid: &Grid, wanted: &mut Vec<Wanted>| {
                wanted.extend(grid.windows(|square: &Rect| {
                    let window = window_of(square, model.coverage);
                    let is_inside = window.x.min(window.y) >= 0.0
                        && window.right() <= width as f64
                        && window.bottom() <= height as f64;
                    is_inside.then_some(None)
                }))
            },
            &mut windows,
        );
        merge(&mut windows, model.coverage, 0.4, 0.4);
    }
    println!(
        "{} people, {} windows a run",
        windows.len(),
        scanner.looked_at() / runs.max(1) as u64
    );
}
