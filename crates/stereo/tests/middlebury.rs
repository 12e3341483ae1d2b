//! x
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests may panic")]
use std::path::PathBuf;
use std::time::Instant;
use tagalong_core::GreyImage;
use tagalong_stereo::*;
fn read(p: PathBuf) -> GreyImage {
    let i = image::open(p).unwrap();
    let i = i.to_rgb8();
    let (w, h) = i.dimensions();
    tagalong_core::RgbImage::from_pixels(w as usize, h as usize, i.pixels().map(|p| p.0).collect())
        .unwrap()
        .to_grey()
}
#[test]
fn q() {
    let dir = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../../shared/data/stereo");
    for (name, scale, max, sg) in [
        ("tsukuba", 16.0, 16, 5.81),
        ("venus", 8.0, 32, 2.08),
        ("sawtooth", 8.0, 32, 3.73),
        ("teddy", 4.0, 64, 11.62),
    ] {
        let l = read(dir.join(name).join("im2.png"));
        let r = read(dir.join(name).join("im6.png"));
        let t = image::open(dir.join(name).join("disp2.png")).unwrap().to_luma8();
        for method in [Method::Block, Method::SemiGlobal] {
            let mut s = StereoSettings { method, threads: 1, ..StereoSettings::default() };
            if let Ok(u) = std::env::var("UNIQ") {
                s.uniqueness = u.parse().unwrap();
            }
            if let Ok(u) = std::env::var("P") {
                let v: Vec<u8> = u.split(',').map(|x| x.parse().unwrap()).collect();
                s.small_penalty = v[0];
                s.edge_penalty = v[1];
                s.large_penalty = v[2];
            }
            if let Ok(u) = std::env::var("WIN") {
                s.window = u.parse().unwrap();
            }
            if let Ok(u) = std::env::var("LR") {
                s.left_right = u.parse().unwrap();
            }
            let mut m = Matcher::new(s).unwrap();
            let mut best = f64::INFINITY;
            for _ in 0..5 {
                let i = Instant::now();
                m.disparities(&l, &r, max - 1).unwrap();
                best = best.min(i.elapsed().as_secs_f64());
            }
            let d = m.disparities(&l, &r, max - 1).unwrap();
            let (mut n, mut b1, mut b2, mut none, mut sq, mut near) = (0, 0, 0, 0, 0.0, 0);
            for (i, tr) in t.pixels().enumerate() {
                let tr = f64::from(tr.0[0]) / scale;
                if tr == 0.0 || i % l.width() < max {
                    continue;
                }
                n += 1;
                let v = f64::from(d.values[i]);
                if v.is_nan() {
                    none += 1;
                    b1 += 1;
                    b2 += 1;
                    continue;
                }
                if (v - tr).abs() > 1.0 {
                    b1 += 1;
                } else {
                    near += 1;
                    sq += (v - tr).powi(2);
                }
                if (v - tr).abs() > 2.0 {
                    b2 += 1;
                }
            }
            let pc = |k: i32| 100.0 * f64::from(k) / f64::from(n);
            println!(
                "{name} {method:?} bad1 {:.2} bad2 {:.2} none {:.2} rms {:.3} (SGBM {sg}) {:.2} ms {:?}",
                pc(b1),
                pc(b2),
                pc(none),
                (sq / f64::from(near)).sqrt(),
                best * 1e3,
                d.dropped
            );
        }
    }
}
