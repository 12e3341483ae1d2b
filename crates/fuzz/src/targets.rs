//! Parsers of foreign bytes, each with small valid files to begin with.

use std::path::Path;

use tagalong_config::Registry;
use tagalong_eval::formats::{Timeline, floor, kitti, metres, mot, people};
use tagalong_log::images::{decode_compressed, decode_raw};
use tagalong_log::msgs::{self, decode};
use tagalong_log::{FrameSource, InputSettings, Inputs, Limits, LogWalker};
use tagalong_pipeline::Pipeline;
use tagalong_sim::Scene;

use crate::{definitions, live};

/// A parser.
pub struct Target {
    /// Its name on the command line.
    pub name: &'static str,
    /// Kind of its input.
    pub about: &'static str,
    /// Valid files.
    pub seeds: Vec<Vec<u8>>,
    /// Parses bytes and drops the result; a panic is a finding. The path is that of a file of its
    /// own, for parsers that read files.
    pub parse: fn(&[u8], &Path),
}

const MCAP: &[u8] = include_bytes!("../seeds/tiny.mcap");
const BAG: &[u8] = include_bytes!("../seeds/tiny.bag");
const DATABASE: &[u8] = include_bytes!("../seeds/tiny.db3");
/// Databases of which a transaction was under way, and the files beside them.
const UNCOMMITTED: &[u8] = include_bytes!("../seeds/tiny-journal.db3");
const JOURNAL: &[u8] = include_bytes!("../seeds/tiny-journal.db3-journal");
const LOGGED_AHEAD: &[u8] = include_bytes!("../seeds/tiny-wal.db3");
const WRITE_AHEAD_LOG: &[u8] = include_bytes!("../seeds/tiny-wal.db3-wal");
const CASCADE: &str = include_str!("../seeds/tiny-cascade.xml");
const FOLLOW_BENCH: &str = include_str!("../seeds/follow-bench.yaml");
const COLOR_TEXTURE: &str = include_str!("../../../configs/models/color-texture.toml");
const BODY_NET: &str = include_str!("../../../configs/models/body-net.toml");
const DEPTH_NET: &str = include_str!("../../../configs/models/depth-net.toml");
const OMNI_DISTANCE: &str = include_str!("../../../configs/models/omni-distance.toml");
const SVM_PATCH: &str = include_str!("../../../configs/models/svm-patch.toml");

/// Tables of people, in images and on the floor, and of tracks.
const TABLES: [&str; 3] = [
    "frame,id,ub_x,ub_y,ub_w,ub_h\n1,1,10,20,30,40\n2,1,11,20,30,40\n",
    "stamp_s,scan,id,x_laser_m,y_laser_m,ignore,source\n0.1,0,1,2.5,-1,0,annotated\n",
    "stamp_ns,frame,id,x_robot_m,y_robot_m,z_robot_m,x_odom_m,y_odom_m,z_odom_m,seen\n\
     100,1,1,2.5,0,1.6,2.5,0,1.6,1\n",
];
/// Annotations of a video and of images.
const CVAT: [&str; 2] = [
    "<annotations><track id=\"0\" label=\"person\"><box frame=\"0\" keyframe=\"1\" outside=\"0\" \
     occluded=\"0\" xtl=\"10\" ytl=\"20\" xbr=\"60\" ybr=\"90\"/></track></annotations>",
    "<annotations><image id=\"7\"><box label=\"person\" xtl=\"1\" ytl=\"2\" xbr=\"31\" ybr=\"32\">\
     <attribute name=\"id\">3</attribute></box></image></annotations>",
];

const PERSON_BOXES: [&str; 2] = [
    "{\"images\":[{\"id\":1,\"file_name\":\"a.jpg\"}],\"annotations\":[{\"image_id\":1,\"category_id\":1,\
     \"bbox\":[1,2,30,40],\"track_id\":3}],\"categories\":[{\"id\":1,\"name\":\"person\"}]}",
    "image,track_id,class,bbox\na.jpg,3,person,\"[1, 2, 30, 40]\"\n",
];

/// Returns all parsers.
pub fn targets() -> Vec<Target> {
    vec![
        Target {
            name: "mcap",
            about: "records of an MCAP file",
            seeds: vec![MCAP.to_vec()],
            parse: |bytes, _| walk(LogWalker::new(bytes, &small()).ok()),
        },
        Target {
            name: "bag",
            about: "records of a ROS 1 bag",
            seeds: vec![BAG.to_vec()],
            parse: |bytes, _| walk(LogWalker::new(bytes, &small()).ok()),
        },
        Target {
            name: "database",
            about: "rows of a rosbag2 database",
            seeds: vec![DATABASE.to_vec()],
            parse: |bytes, path| {
                if std::fs::write(path, bytes).is_ok() {
                    walk(LogWalker::open(path, &small()).ok());
                }
            },
        },
        Target {
            name: "journal",
            about: "a rollback journal beside a rosbag2 database",
            seeds: vec![JOURNAL.to_vec()],
            parse: |bytes, path| walk_unfinished(UNCOMMITTED, bytes, path, "-journal"),
        },
        Target {
            name: "write-ahead-log",
            about: "a write-ahead log beside a rosbag2 database",
            seeds: vec![WRITE_AHEAD_LOG.to_vec()],
            parse: |bytes, path| walk_unfinished(LOGGED_AHEAD, bytes, path, "-wal"),
        },
        Target {
            name: "frames",
            about: "an MCAP file, its messages and images, to frames",
            seeds: vec![MCAP.to_vec()],
            parse: |bytes, path| {
                if std::fs::write(path, bytes).is_ok() {
                    frames(path);
                }
            },
        },
        Target { name: "cdr", about: "ROS messages", seeds: payloads(), parse: messages },
        Target { name: "images", about: "image messages", seeds: pictures(), parse: images },
        Target {
            name: "video",
            about: "streams of H.264",
            seeds: live::streams(),
            parse: live::frames_of_video,
        },
        Target {
            name: "points",
            about: "clouds of points",
            seeds: live::clouds(),
            parse: live::points,
        },
        Target {
            name: "detections",
            about: "messages of other detectors, to frames",
            seeds: live::detections(),
            parse: live::frame_of_detections,
        },
        Target {
            name: "definitions",
            about: "definitions of messages in a log, each with a message",
            seeds: definitions::seeds(),
            parse: definitions::frames_of_definition,
        },
        Target {
            name: "config",
            about: "the TOML of a pipeline",
            seeds: vec![
                include_bytes!("../../../configs/depth-verified.toml").to_vec(),
                include_bytes!("../../../configs/follow-depth.toml").to_vec(),
                include_bytes!("../../../configs/mono.toml").to_vec(),
            ],
            parse: config,
        },
        Target {
            name: "scene",
            about: "the TOML of a scene",
            seeds: vec![include_bytes!("../../../configs/scenes/follow-passing.toml").to_vec()],
            parse: |bytes, _| as_text(bytes, |text| drop(Scene::parse(text))),
        },
        model_target("cascade", CASCADE, |bytes, _| {
            as_text(bytes, |text| drop(tagalong_face_rgbd::Cascade::from_xml(text)));
        }),
        model_target("body-net", &short_numbers(BODY_NET), |bytes, _| {
            as_text(bytes, |text| drop(tagalong_body_net::Model::from_text(text)));
        }),
        model_target("depth-net", &short_numbers(DEPTH_NET), |bytes, _| {
            as_text(bytes, |text| drop(tagalong_depth_net::Model::from_text(text)));
        }),
        Target {
            name: "hog",
            about: "a model file",
            seeds: vec![
                include_bytes!("../../../configs/models/hog-upper-body.toml").to_vec(),
                include_bytes!("../../../configs/models/hog-upper-body-linear.toml").to_vec(),
            ],
            parse: |bytes, _| {
                as_text(bytes, |text| drop(tagalong_hog_upper_body::Model::from_text(text)));
            },
        },
        model_target("color-texture", &first_trees(COLOR_TEXTURE), |bytes, _| {
            as_text(bytes, |text| drop(tagalong_color_texture::Model::from_text(text)));
        }),
        model_target("omni-distance", OMNI_DISTANCE, |bytes, _| {
            as_text(bytes, |text| drop(tagalong_omni_appearance::Model::from_text(text)));
        }),
        model_target("svm-patch", &first_vectors(SVM_PATCH), |bytes, _| {
            as_text(bytes, |text| drop(tagalong_svm_patch::Model::from_text(text)));
        }),
        model_target(
            "laser-legs",
            include_str!("../../../configs/models/laser-legs.toml"),
            |bytes, _| {
                as_text(bytes, |text| drop(tagalong_laser_legs::Model::from_text(text)));
            },
        ),
        text_target(
            "mot",
            "1,1,10,20,30,40,1,1,0.5\n2,-1,1e1,2.5,3,4,0.9,-1,-1,-1\n",
            |bytes, _| {
                as_text(bytes, |text| {
                    let rows = mot::parse(text, "x").unwrap_or_default();
                    let mut timeline = Timeline::new();
                    timeline.add_reports(rows.iter().map(mot::Row::report));
                    whole(timeline);
                    drop(mot::parse_truth(text, "x", mot::Rules::Mot17));
                    drop(mot::parse_tracks(text, "x"));
                    drop(mot::parse_info(text, "x"));
                });
            },
        ),
        text_target(
            "kitti",
            "0 1 Pedestrian 0 0 -1.5 10 20 30 40 1.7 0.6 0.8 1 2 9 0.1\n",
            |bytes, _| {
                as_text(bytes, |text| {
                    let mut timeline = Timeline::new();
                    kitti::add_truths(&mut timeline, &kitti::parse(text, "x").unwrap_or_default());
                    whole(timeline);
                });
            },
        ),
        Target {
            name: "people",
            about: "tables of people, on the floor and in images",
            seeds: TABLES.map(|table| table.as_bytes().to_vec()).to_vec(),
            parse: |bytes, _| {
                as_text(bytes, |text| {
                    drop(people::parse(text, "x"));
                    drop(metres::parse(text, "x"));
                    drop(floor::parse(text, "x"));
                });
            },
        },
        Target {
            name: "cvat",
            about: "annotations of CVAT",
            seeds: CVAT.map(|file| file.as_bytes().to_vec()).to_vec(),
            parse: |bytes, _| as_text(bytes, |text| drop(tagalong_import::people_of_cvat(text))),
        },
        Target {
            name: "person-boxes",
            about: "boxes of people in a folder of images",
            seeds: PERSON_BOXES.map(|file| file.as_bytes().to_vec()).to_vec(),
            parse: |bytes, _| as_text(bytes, |text| drop(tagalong_import::person_boxes(text))),
        },
        text_target("follow-bench", FOLLOW_BENCH, |bytes, _| {
            as_text(bytes, |text| drop(tagalong_import::scene_of_follow_bench(text, "x")));
        }),
    ]
}

/// The parser of a model file, with one such file.
fn model_target(name: &'static str, seed: &str, parse: fn(&[u8], &Path)) -> Target {
    Target { name, about: "a model file", seeds: vec![seed.as_bytes().to_vec()], parse }
}

/// The parser of a text format, with one such text.
fn text_target(name: &'static str, seed: &str, parse: fn(&[u8], &Path)) -> Target {
    Target { name, about: "a text format", seeds: vec![seed.as_bytes().to_vec()], parse }
}

/// Makes the sequence of a timeline as scoring does, with all frames between those that have rows.
fn whole(timeline: Timeline) {
    let last = timeline.last().unwrap_or(0);
    drop(timeline.into_sequence("x", 1, last, 30.0));
}

/// Returns a model of the first trees of one, which has a tree in each line.
fn first_trees(text: &str) -> String {
    let lines: Vec<&str> = text.lines().take(8).collect();
    format!("{}]\n", lines.join("\n").trim_end_matches(','))
}

/// Returns a model with short numbers in its arrays: a file of half the length, in which
/// a mutation is more likely to hit something else than a digit.
fn short_numbers(text: &str) -> String {
    fn is_row(line: &str) -> bool {
        line.starts_with("  ") && line.ends_with(',')
    }

    fn shortened(line: &str) -> String {
        if is_row(line) { "1.0,".repeat(line.matches(',').count()) } else { line.to_owned() }
    }

    text.lines().map(|line| shortened(line) + "\n").collect()
}

/// Returns a model of the first two support vectors of one.
fn first_vectors(text: &str) -> String {
    let third = text.match_indices("[[vectors]]").nth(2);
    text[..third.map_or(text.len(), |(at, _)| at)].to_owned()
}

/// Limits at which a parser that obeys them cannot take much memory or time.
fn small() -> Limits {
    Limits { record_bytes: 1 << 20, ..Limits::default() }
}

fn as_text(bytes: &[u8], parse: impl FnOnce(&str)) {
    if let Ok(text) = std::str::from_utf8(bytes) {
        parse(text);
    }
}

fn walk<R: std::io::Read>(walker: Option<LogWalker<R>>) {
    let Some(mut walker) = walker else { return };
    while walker.next().is_some() {}
}

/// Walks through a database with a file of this ending beside it.
fn walk_unfinished(database: &[u8], bytes: &[u8], path: &Path, ending: &str) {
    let mut beside = path.as_os_str().to_owned();
    beside.push(ending);
    if std::fs::write(path, database).is_ok() && std::fs::write(&beside, bytes).is_ok() {
        walk(LogWalker::open(path, &small()).ok());
    }
    // Other parsers have the same path.
    let _ = std::fs::remove_file(beside);
}

fn frames(path: &Path) {
    let inputs = Inputs::ANY;
    let Ok(mut source) = FrameSource::open(path, &InputSettings::default(), &small(), inputs)
    else {
        return;
    };
    while source.next_frame().is_some() {}
}

/// Returns the messages of the seed.
fn payloads() -> Vec<Vec<u8>> {
    let mut payloads = Vec::new();
    if let Ok(mut walker) = LogWalker::new(MCAP, &small()) {
        while let Some(message) = walker.next() {
            payloads.push(message.data.to_vec());
        }
    }
    payloads
}

/// Returns those of its messages that are images.
fn pictures() -> Vec<Vec<u8>> {
    payloads()
        .into_iter()
        .filter(|data| {
            decode::<msgs::Image<'_>>(data).is_ok_and(|image| image.width > 0)
                || decode::<msgs::CompressedImage<'_>>(data)
                    .is_ok_and(|image| image.data.len() > 20)
        })
        .collect()
}

fn messages(bytes: &[u8], _: &Path) {
    drop(decode::<msgs::Image<'_>>(bytes));
    drop(decode::<msgs::CompressedImage<'_>>(bytes));
    drop(decode::<msgs::CameraInfo>(bytes));
    drop(decode::<msgs::TFMessage>(bytes));
    drop(decode::<msgs::Odometry>(bytes));
    drop(decode::<msgs::LaserScan>(bytes));
    drop(decode::<msgs::StringMsg>(bytes));
    drop(decode::<msgs::Range>(bytes));
    drop(decode::<msgs::BoolMsg>(bytes));
    drop(decode::<msgs::BumperEvent>(bytes));
    drop(decode::<msgs::BumperState>(bytes));
    drop(decode::<msgs::ContactCount>(bytes));
    drop(decode::<msgs::HazardDetectionVector>(bytes));
}

fn images(bytes: &[u8], _: &Path) {
    if let Ok(image) = decode::<msgs::Image<'_>>(bytes) {
        drop(decode_raw(&image, None, &small()));
    }
    if let Ok(image) = decode::<msgs::CompressedImage<'_>>(bytes) {
        drop(decode_compressed(&image, None, &small()));
    }
}

fn config(bytes: &[u8], _: &Path) {
    thread_local! {
        static REGISTRY: Registry = tagalong_catalog::registry();
    }
    as_text(bytes, |text| {
        REGISTRY.with(|registry| drop(Pipeline::builder(registry).from_toml(text)));
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unfinished_databases_are_read_up_to_their_last_commit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.db3");
        let seeds =
            [(UNCOMMITTED, JOURNAL, "-journal", 6), (LOGGED_AHEAD, WRITE_AHEAD_LOG, "-wal", 7)];
        for (database, beside, ending, count) in seeds {
            std::fs::write(&path, database).unwrap();
            std::fs::write(folder.path().join(format!("log.db3{ending}")), beside).unwrap();
            let mut walker = LogWalker::open(&path, &small()).unwrap();
            let mut read = 0;
            while walker.next().is_some() {
                read += 1;
            }
            assert_eq!((read, walker.data_lost()), (count, true), "{ending}");
            std::fs::remove_file(folder.path().join(format!("log.db3{ending}"))).unwrap();
        }
    }

    #[test]
    fn the_scene_of_follow_bench_is_read() {
        let scene = tagalong_import::scene_of_follow_bench(FOLLOW_BENCH, "x").unwrap();
        assert_eq!((scene.people.len(), scene.blocks.len()), (2, 1));
    }

    #[test]
    fn first_parts_of_models_are_models() {
        assert!(tagalong_color_texture::Model::from_text(&first_trees(COLOR_TEXTURE)).is_ok());
        assert!(tagalong_svm_patch::Model::from_text(&first_vectors(SVM_PATCH)).is_ok());
        let cascade = tagalong_face_rgbd::Cascade::from_xml(CASCADE);
        assert!(cascade.is_ok_and(|cascade| cascade.stages.len() == 2 && cascade.check().is_ok()));
    }

    #[test]
    fn shortened_models_are_still_models() {
        let body = tagalong_body_net::Model::from_text(&short_numbers(BODY_NET));
        let depth = tagalong_depth_net::Model::from_text(&short_numbers(DEPTH_NET));
        assert!(body.is_ok() && depth.is_ok(), "{:?} {:?}", body.err(), depth.err());
        assert!(short_numbers(BODY_NET).len() < BODY_NET.len() / 2);
    }
}
