//! Prints the processor time that an image of each camera takes, and how many images per second are
//! rendered on one thread and on two, with a digest of the images and the truth: a change that only
//! makes them faster does not change the digest.
//!
//! ```sh
//! cargo run --release -p tagalong-sim --example frame_rate
//! cargo run --release -p tagalong-sim --example frame_rate -- stereo   # some of them
//! ```
#![allow(clippy::expect_used, clippy::print_stdout, reason = "an example may stop loudly")]

use std::time::Instant;

use cpu_time::ProcessTime;
use tagalong_sim::{Event, Scene, Shot, Simulation};

/// Number of images of a scene that are rendered.
const SHOTS: usize = 10;
/// Number of rounds, of which the fastest counts, because other load on the machine only slows one
/// down.
const ROUNDS: usize = 2;

const RGBD: &str = "crowd = 5\nseed = 6\n[room]\nsize_m = [12.0, 8.0]\nclutter = 6\n";
/// The camera and the room of the rides of `tagalong follow`.
const RIDE: &str = "crowd = 2\nseed = 5\n[room]\nsize_m = [16.0, 6.0]\nclutter = 5\n[camera]\nwidth = 200\n\
    height = 150\nfield_of_view_deg = 70.0\n";
const STEREO: &str = "crowd = 5\nseed = 9\n[room]\nsize_m = [12.0, 9.0]\nheight_m = 3.5\n\
    floor = \"tiles\"\nclutter = 5\n[camera]\nkind = \"stereo\"\nwidth = 512\nheight = 384\n\
    field_of_view_deg = 100.0\nbaseline_m = 0.12\n";
const PANORAMA: &str = "crowd = 3\nseed = 42\n[room]\nsize_m = [10.0, 5.4]\nfloor = \"carpet\"\n\
    wallpaper = true\nclutter = 5\n[camera]\nkind = \"panorama\"\nwidth = 480\nheight = 480\n\
    height_m = 1.55\n";
const RESTS: &str = "[robot]\nstart = [0.8, 4.0]\n";
const MOVES: &str = "[robot]\nstart = [0.8, 4.0]\npath = [[3.0, 4.5], [5.5, 3.8]]\n";

fn main() {
    let scenes = [
        ("RGB-D 640x480, five people, moving", RGBD.to_owned() + MOVES),
        ("RGB-D 640x480, five people, at rest", RGBD.to_owned() + RESTS),
        ("RGB-D 640x480 on a carpet, moving", format!("{RGBD}floor = \"carpet\"\n{MOVES}")),
        ("depth 640x480, five people, moving", format!("{RGBD}[camera]\ncolour = false\n{MOVES}")),
        ("RGB-D 200x150 of a ride, two people, moving", RIDE.to_owned() + MOVES),
        ("stereo 512x384, five people, moving", STEREO.to_owned() + MOVES),
        ("stereo 512x384, five people, at rest", STEREO.to_owned() + RESTS),
        (
            "panorama 480x480, three people, at rest",
            PANORAMA.to_owned() + "[robot]\nstart = [4.3, 2.4]\n",
        ),
    ];
    println!(
        "{:<44} {:>12} {:>10} {:>10}  digest",
        "camera", "processor ms", "1 thread/s", "2 threads/s"
    );
    let part = std::env::args().nth(1).unwrap_or_default();
    for (name, text) in scenes.into_iter().filter(|(name, _)| name.contains(&part)) {
        let mut scene = Scene::parse(&text).expect("the scene is right");
        (scene.duration_s, scene.faults.dropped, scene.faults.late) = (60.0, 0.0, 0.0);
        let [one, two] = [1, 2].map(|threads| rate(&scene, threads));
        assert_eq!(one.digest, two.digest, "the images depend on the number of threads");
        let Rate { processor_ms, per_s, digest } = one;
        println!(
            "{name:<44} {processor_ms:>12.1} {per_s:>10.1} {:>10.1}  {digest:016x}",
            two.per_s
        );
    }
}

/// Times of the fastest rounds, and the digest of the images.
struct Rate {
    processor_ms: f64,
    per_s: f64,
    digest: u64,
}

fn rate(scene: &Scene, threads: usize) -> Rate {
    let mut best = Rate { processor_ms: f64::INFINITY, per_s: 0.0, digest: 0 };
    for _ in 0..ROUNDS {
        let mut simulation = Simulation::new(scene, threads);
        let start = Instant::now();
        let worked = ProcessTime::now();
        let shots = std::iter::from_fn(|| next_shot(&mut simulation)).take(SHOTS);
        let shots: Vec<Shot> = shots.collect();
        let count = shots.len() as f64;
        best.processor_ms = best.processor_ms.min(1e3 * worked.elapsed().as_secs_f64() / count);
        best.per_s = best.per_s.max(count / start.elapsed().as_secs_f64());
        best.digest = digest(&shots);
    }
    best
}

fn next_shot(simulation: &mut Simulation) -> Option<Shot> {
    loop {
        if let Event::Shot(shot) = simulation.next_event()? {
            return Some(*shot);
        }
    }
}

/// FNV-1a over all values of images and truth.
fn digest(shots: &[Shot]) -> u64 {
    let mut digest = 0xcbf2_9ce4_8422_2325_u64;
    for shot in shots {
        let images = &shot.images;
        let colour = images.colour.iter().flat_map(|image| image.pixels().as_flattened());
        let left = images.grey.iter().flat_map(|image| image.pixels());
        let right = images.right.iter().flat_map(|right| right.image.pixels());
        let depth = images.depth.iter().flat_map(|image| image.pixels());
        let text = format!("{:?} {:?}", shot.truth, shot.laser);
        let light = colour.chain(left).chain(right).copied();
        let depth = depth.flat_map(|metres| metres.to_bits().to_le_bytes());
        for byte in light.chain(depth).chain(text.bytes()) {
            digest = (digest ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
    digest
}
