//! Data sets become logs: tiny folders of each layout, written here, and read back as a pipeline
//! reads them.

use std::fs;
use std::path::Path;

use image::{ImageBuffer, Luma, Rgb};
use tagalong_log::{FrameSource, Input, InputSettings, Inputs, Limits, LogFrame};

use crate::common::{code, tagalong, text};

const SMALL: (u32, u32) = (64, 48);

fn colour(path: &Path, size: (u32, u32), level: u8) {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    ImageBuffer::from_pixel(size.0, size.1, Rgb([level, 90, 20])).save(path).unwrap();
}

fn depth(path: &Path, size: (u32, u32), units: u16) {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    ImageBuffer::from_pixel(size.0, size.1, Luma([units])).save(path).unwrap();
}

fn import(home: &Path, args: &[&str]) -> (i32, String) {
    let output = tagalong().arg("import").args(args).current_dir(home).output().unwrap();
    (code(&output), text(&output.stderr) + &text(&output.stdout))
}

fn frames(log: &Path, inputs: Inputs) -> Vec<LogFrame> {
    let input = InputSettings::default();
    let limits = Limits::default();
    let mut source = FrameSource::open(log, &input, &limits, inputs).unwrap();
    std::iter::from_fn(|| source.next_frame()).collect()
}

const DEPTH: Inputs = Inputs::ANY.require(Input::Colour).require(Input::Depth);

#[test]
fn a_tum_folder_has_depth_and_a_camera_that_moves() {
    let home = tempfile::tempdir().unwrap();
    let folder = home.path().join("rgbd_dataset_freiburg3_tiny");
    for i in 0..3u8 {
        colour(&folder.join(format!("rgb/{i}.png")), (640, 480), 10 * i);
        depth(&folder.join(format!("depth/{i}.png")), (640, 480), 10_000);
    }
    for (name, offset) in [("rgb", 0), ("depth", 8000)] {
        let lines = (0..3).map(|i| format!("100.{:06} {name}/{i}.png\n", 100_000 * i + offset));
        let list = "# a comment\n".to_owned() + &lines.collect::<String>();
        fs::write(folder.join(format!("{name}.txt")), list).unwrap();
    }
    // Upright, looking along Y, 1.4 m high, going ahead by 0.1 m an image.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let poses = (0..4)
        .map(|i| format!("100.{i} 1.0 {:.1} 1.4 {} 0 0 {half}\n", 2.0 + 0.1 * f64::from(i), -half));
    fs::write(folder.join("groundtruth.txt"), poses.collect::<String>()).unwrap();
    let (code, said) = import(home.path(), &["tum", "rgbd_dataset_freiburg3_tiny"]);
    assert_eq!(code, 0, "{said}");
    let found = frames(&home.path().join("runs/rgbd_dataset_freiburg3_tiny.mcap"), DEPTH);
    assert_eq!(found.len(), 3);
    let frame = &found[1].frame;
    assert_eq!(frame.depth().unwrap().get(5, 5), Some(2.0));
    assert_eq!(frame.colour().unwrap().get(5, 5), Some([10, 90, 20]));
    assert!((frame.camera.height_m() - 1.4).abs() < 1e-6);
    assert!(frame.camera.pitch_down_rad().abs() < 1e-6);
    assert!((frame.camera.focal_px() - 535.4).abs() < 1e-9);
    let way =
        found[2].odom_from_robot.translation.vector - found[0].odom_from_robot.translation.vector;
    assert!((way.y - 0.2).abs() < 1e-6 && way.x.abs() < 1e-6, "{way}");
}

#[test]
fn a_part_of_a_tum_folder_is_what_is_there_of_it() {
    let home = tempfile::tempdir().unwrap();
    let folder = home.path().join("part");
    for i in [0u8, 2] {
        colour(&folder.join(format!("rgb/{i}.png")), (640, 480), 10 * i);
        depth(&folder.join(format!("depth/{i}.png")), (640, 480), 10_000);
    }
    for name in ["rgb", "depth"] {
        let list: String = (0..3).map(|i| format!("100.{i} {name}/{i}.png\n")).collect();
        fs::write(folder.join(format!("{name}.txt")), list).unwrap();
    }
    let (code, said) = import(home.path(), &["tum", "part", "--height", "1.2"]);
    assert_eq!(code, 0, "{said}");
    assert!(said.contains("1 of 3 images of rgb.txt are not there"), "{said}");
    let found = frames(&home.path().join("runs/part.mcap"), DEPTH);
    assert_eq!(found.len(), 2);
    assert!((found[1].frame.camera.height_m() - 1.2).abs() < 1e-6);
    assert_eq!(found[1].frame.colour().unwrap().get(5, 5), Some([20, 90, 20]));
    fs::remove_dir_all(folder.join("rgb")).unwrap();
    fs::remove_dir_all(folder.join("depth")).unwrap();
    let (code, said) = import(home.path(), &["tum", "part", "--overwrite"]);
    assert_eq!(code, 1, "{said}");
    assert!(said.contains("has no images"), "{said}");
}

#[test]
fn a_bonn_folder_has_its_own_camera_and_no_poses_of_markers() {
    let home = tempfile::tempdir().unwrap();
    let folder = home.path().join("rgbd_bonn_tiny");
    colour(&folder.join("rgb/1548266469.88.png"), (640, 480), 30);
    depth(&folder.join("depth/1548266469.89.png"), (640, 480), 5000);
    fs::write(folder.join("rgb.txt"), "# color images\n1548266469.88 rgb/1548266469.88.png\n")
        .unwrap();
    fs::write(folder.join("depth.txt"), "1548266469.89 depth/1548266469.89.png\n").unwrap();
    fs::write(folder.join("groundtruth.txt"), "1548266469.88 1 2 3 0 0 0 1\n").unwrap();
    let (code, said) = import(home.path(), &["tum", "rgbd_bonn_tiny", "--height", "1.5"]);
    assert_eq!(code, 0, "{said}");
    let found = frames(&home.path().join("runs/rgbd_bonn_tiny.mcap"), DEPTH);
    let frame = &found[0].frame;
    assert!((frame.camera.focal_px() - 542.822_841).abs() < 1e-6);
    assert!((frame.camera.height_m() - 1.5).abs() < 1e-6, "not that of the poses");
    assert_eq!(frame.depth().unwrap().get(5, 5), Some(1.0));
}

#[test]
fn a_kitti_sequence_is_a_pair_with_boxes_and_a_drive() {
    let home = tempfile::tempdir().unwrap();
    let folder = home.path().join("training");
    for i in 0..2u8 {
        colour(&folder.join(format!("image_02/0007/{i:06}.png")), SMALL, 50);
        colour(&folder.join(format!("image_03/0007/{i:06}.png")), SMALL, 60);
    }
    for sub in ["calib", "label_02", "oxts"] {
        fs::create_dir_all(folder.join(sub)).unwrap();
    }
    let calib = "P0: 0 0 0 0 0 0 0 0 0 0 0 0\nP2: 50 0 31.5 5.0 0 50 23.5 0 0 0 1 0\n\
                 P3: 50 0 31.5 -20.0 0 50 23.5 0 0 0 1 0\n";
    fs::write(folder.join("calib/0007.txt"), calib).unwrap();
    let labels = "0 2 Pedestrian 0 0 -1.2 10 11 20 41 1.7 0.6 0.8 1 1.6 9 -1.1\n\
                  0 3 Cyclist 0 0 -1.2 30 11 40 41 1.7 0.6 0.8 1 1.6 9 -1.1\n\
                  1 -1 DontCare -1 -1 -10 0 0 5 5 -1 -1 -1 -1 -1 -1 -1\n";
    fs::write(folder.join("label_02/0007.txt"), labels).unwrap();
    // An image later 10 m north, at the same heading (north).
    let north = 49.0 + (10.0 / 6_378_137.0_f64).to_degrees();
    let oxts = [49.0, north].map(|lat| format!("{lat:.12} 8.4 100 0 0 1.5707963267948966 0 0\n"));
    fs::write(folder.join("oxts/0007.txt"), oxts.concat()).unwrap();
    let args = ["kitti", "training", "--sequence", "0007", "-o", "k.mcap"];
    let (code, said) = import(home.path(), &args);
    assert_eq!(code, 0, "{said}");
    let inputs = Inputs::ANY.require(Input::Colour).require(Input::Right);
    let found = frames(&home.path().join("k.mcap"), inputs);
    assert_eq!(found.len(), 2);
    let right = found[0].frame.right().unwrap();
    assert!((right.baseline_m - 0.5).abs() < 1e-9);
    assert!((found[0].frame.camera.height_m() - 1.65).abs() < 1e-6);
    let way = found[1].odom_from_robot.translation.vector;
    assert!((way.x - 10.0).abs() < 0.01 && way.y.abs() < 0.01, "ahead is X: {way}");
    let boxes = fs::read_to_string(home.path().join("k.boxes.csv")).unwrap();
    assert_eq!(boxes, "1,2,10,11,10.000,30.000,1,1,-1\n1,3,30,11,10.000,30.000,0,2,-1\n");
}

#[test]
fn a_folder_of_images_has_the_camera_of_the_options() {
    let home = tempfile::tempdir().unwrap();
    for i in 0..4u8 {
        colour(&home.path().join(format!("photos/{i}.png")), SMALL, i);
        depth(&home.path().join(format!("z/{i}.png")), SMALL, 250);
    }
    fs::write(home.path().join("photos/readme.txt"), "no image").unwrap();
    let args = "images photos -o p.mcap --fps 20 --view 90 --height 1.1 --tilt 5 --depth z --depth-unit 0.01";
    let args: Vec<&str> = args.split(' ').collect();
    let (code, said) = import(home.path(), &args);
    assert_eq!(code, 0, "{said}");
    let found = frames(&home.path().join("p.mcap"), DEPTH);
    assert_eq!(found.len(), 4);
    let frame = &found[3].frame;
    assert!((frame.camera.focal_px() - 32.0).abs() < 1e-9);
    assert!((frame.camera.height_m() - 1.1).abs() < 1e-9);
    assert!((frame.camera.pitch_down_rad().to_degrees() - 5.0).abs() < 1e-6);
    assert_eq!(frame.depth().unwrap().get(0, 0), Some(2.5));
    assert!((frame.stamp.seconds_since(found[0].frame.stamp) - 0.15).abs() < 1e-9);
    // Existing files are not overwritten unasked.
    let (code, said) = import(home.path(), &args);
    assert!(code == 2 && said.contains("--overwrite"), "{said}");
}

#[test]
fn boxes_of_a_folder_of_images_become_its_truth() {
    let home = tempfile::tempdir().unwrap();
    for i in 1..4u8 {
        colour(&home.path().join(format!("photos/img{i}.png")), SMALL, i);
    }
    let coco = r#"{"images": [{"id": 1, "file_name": "img3.png"}, {"id": 2, "file_name": "img1.png"}],
        "annotations": [{"image_id": 1, "bbox": [2, 3, 10, 20], "track_id": 7},
        {"image_id": 2, "bbox": [4, 5, 10, 20], "track_id": 7}]}"#;
    let csv = "filename,xmin,ymin,xmax,ymax,track_id\nimg3.png,2,3,12,23,7\nimg1.png,4,5,14,25,7\n";
    for (name, text) in [("boxes.json", coco), ("boxes.csv", csv)] {
        fs::write(home.path().join(name), text).unwrap();
        let args = ["images", "photos", "--boxes", name, "-o", "p.mcap", "--overwrite"];
        let (code, said) = import(home.path(), &args);
        assert_eq!(code, 0, "{said}");
        assert!(said.contains("truth is in p.boxes.csv"), "{said}");
        let truth = fs::read_to_string(home.path().join("p.boxes.csv")).unwrap();
        assert_eq!(truth, "1,1,4,5,10,20,1,1,1\n3,1,2,3,10,20,1,1,1\n", "{name}");
        // The file is the path by mistake.
        let (code, said) = import(home.path(), &["images", name]);
        assert!(code == 1 && said.contains(&format!("--boxes {name}`")), "{said}");
    }
    let (code, said) = import(home.path(), &["mot", "photos", "--boxes", "boxes.csv"]);
    assert!(code == 2 && said.contains("--boxes is for a folder of images"), "{said}");
}

#[test]
fn a_mot_sequence_brings_its_truth() {
    let home = tempfile::tempdir().unwrap();
    let folder = home.path().join("MOT17-99");
    colour(&folder.join("img1/000001.jpg"), SMALL, 3);
    colour(&folder.join("img1/000002.jpg"), SMALL, 4);
    let ini = "[Sequence]\nname=MOT17-99\nimDir=img1\nframeRate=25\nseqLength=2\n";
    fs::write(folder.join("seqinfo.ini"), ini).unwrap();
    fs::create_dir_all(folder.join("gt")).unwrap();
    fs::write(folder.join("gt/gt.txt"), "1,1,2,3,10,20,1,1,1\n").unwrap();
    let (code, said) = import(home.path(), &["mot", "MOT17-99"]);
    assert_eq!(code, 0, "{said}");
    let found = frames(&home.path().join("runs/MOT17-99.mcap"), Inputs::ANY);
    assert!((found[1].frame.stamp.seconds_since(found[0].frame.stamp) - 0.04).abs() < 1e-9);
    let truth = fs::read_to_string(home.path().join("runs/MOT17-99.boxes.csv")).unwrap();
    assert_eq!(truth, "1,1,2,3,10,20,1,1,1\n");
    assert!(!said.contains("tagalong run"), "there are no detections: {said}");
}

/// The command that the import prints is run as printed.
#[test]
fn detections_of_a_mot_sequence_are_tracked_as_the_import_says() {
    let home = tempfile::tempdir().unwrap();
    let folder = home.path().join("MOT17-99");
    let mut boxes = String::new();
    for frame in 1..=5 {
        colour(&folder.join(format!("img1/{frame:06}.jpg")), SMALL, 3);
        boxes += &format!("{frame},-1,{},3,20,40,0.95\n", 2 + frame);
    }
    let ini = "[Sequence]\nname=MOT17-99\nimDir=img1\nframeRate=25\nseqLength=5\n";
    fs::write(folder.join("seqinfo.ini"), ini).unwrap();
    fs::create_dir_all(folder.join("det")).unwrap();
    fs::write(folder.join("det/det.txt"), boxes).unwrap();
    let (code, said) = import(home.path(), &["mot", "MOT17-99"]);
    assert_eq!(code, 0, "{said}");
    let command = said.lines().find_map(|line| line.split("tracked: tagalong ").nth(1)).unwrap();
    let args: Vec<&str> = command.split_whitespace().collect();
    assert_eq!(args[0], "run");
    let done = tagalong().args(&args).current_dir(home.path()).output().unwrap();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let tracks = home.path().join("runs/MOT17-99-MOT17-99.recorded/tracks.csv");
    let tracks = fs::read_to_string(tracks).unwrap();
    assert!(tracks.lines().filter(|line| !line.starts_with('#')).count() >= 3, "{tracks}");
}

#[test]
fn what_is_not_of_the_layout_is_told() {
    let home = tempfile::tempdir().unwrap();
    fs::create_dir_all(home.path().join("empty")).unwrap();
    fs::write(home.path().join("a.bag"), "#ROSBAG").unwrap();
    fs::create_dir_all(home.path().join("bare")).unwrap();
    fs::write(home.path().join("bare/seqinfo.ini"), "frameRate=30\n").unwrap();
    let cases: [(&[&str], i32, &str); 7] = [
        (&["tum", "empty"], 1, "TUM RGB-D"),
        (&["kitti", "empty"], 1, "KITTI"),
        (&["mot", "empty"], 1, "MOTChallenge"),
        (&["mot", "bare"], 1, "without them; --boxes DIR names the folder of the boxes"),
        (&["images", "empty"], 1, "no images"),
        (&["images", "nowhere"], 1, "no such file"),
        (&["images", "a.bag"], 1, "is a file"),
    ];
    for (args, expected, says) in cases {
        let (code, said) = import(home.path(), args);
        assert_eq!(code, expected, "{args:?}: {said}");
        assert!(said.contains(says), "{args:?}: {said}");
    }
    assert!(!home.path().join("runs").exists(), "what fails leaves nothing behind");
}

#[test]
fn annotations_of_cvat_become_truth_that_eval_reads() {
    let home = tempfile::tempdir().unwrap();
    let shapes = (0..4).map(|frame| {
        format!(
            "<box frame=\"{frame}\" keyframe=\"1\" outside=\"0\" occluded=\"0\" \
             xtl=\"10\" ytl=\"10\" xbr=\"40\" ybr=\"40\"/>"
        )
    });
    let shapes: String = shapes.collect();
    let text =
        format!("<annotations><track id=\"2\" label=\"person\">{shapes}</track></annotations>");
    fs::write(home.path().join("walk.xml"), text).unwrap();
    let (code, said) = import(home.path(), &["cvat", "walk.xml"]);
    assert_eq!(code, 0, "{said}");
    assert!(said.contains("4 boxes are in walk.people.csv"), "{said}");
    let tracks: String = (1..=4).map(|frame| format!("{frame},9,10,10,30,30,1\n")).collect();
    fs::write(home.path().join("tracks.csv"), tracks).unwrap();
    let output = tagalong()
        .args(["eval", "--truth", "walk.people.csv", "--tracks", "tracks.csv", "--format", "json"])
        .current_dir(home.path())
        .output()
        .unwrap();
    let scores: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(scores["MOTA"], 1.0, "{scores}");
    assert_eq!(import(home.path(), &["cvat", "walk.xml"]).0, 2, "it is not replaced unasked");
}

#[test]
fn a_number_of_a_track_beyond_all_is_refused_with_its_line() {
    let home = tempfile::tempdir().unwrap();
    let box_ = r#"<box frame="0" xtl="1" ytl="2" xbr="31" ybr="32"/>"#;
    let text = format!(
        "<annotations>\n<track id=\"{}\" label=\"person\">{box_}</track></annotations>",
        i64::MAX
    );
    fs::write(home.path().join("a.xml"), text).unwrap();
    let (code, told) = import(home.path(), &["cvat", "a.xml"]);
    assert!(code == 1 && told.contains("a.xml, line 2: `id` is "), "{code} {told}");
}

#[test]
fn numbered_images_are_in_the_order_of_their_numbers() {
    let home = tempfile::tempdir().unwrap();
    for number in [1, 2, 9, 10, 11] {
        colour(&home.path().join(format!("photos/img{number}.png")), SMALL, 10 * number);
    }
    let (code, said) = import(home.path(), &["images", "photos", "--view", "60"]);
    assert_eq!(code, 0, "{said}");
    assert!(said.contains("next: tagalong run runs/photos.mcap --overlay"), "{said}");
    let found = frames(&home.path().join("runs/photos.mcap"), Inputs::ANY.require(Input::Colour));
    let levels: Vec<u8> =
        found.iter().map(|item| item.frame.colour().unwrap().pixels()[0][0]).collect();
    assert_eq!(levels, [10, 20, 90, 100, 110]);
}

/// A ROS 1 bag, record by record: two scans 0.1 s apart, and people half way after each.
fn leg_bag(topics: &[&str]) -> Vec<u8> {
    let mut records = bag_connection(0, "/ground_truth_people_tracks", "leg_tracker/Person");
    for (id, topic) in (1..).zip(topics) {
        records.extend(bag_connection(id, topic, "sensor_msgs/LaserScan"));
    }
    for (at, step) in [(0, 0), (2, 1)] {
        for id in 1..=topics.len() as u32 {
            records.extend(bag_message(id, at, &bag_scan(step)));
        }
        records.extend(bag_message(0, at + 1, &bag_person(4, 2.0, -0.1)));
        if step == 1 {
            records.extend(bag_message(0, at + 1, &bag_person(1000, 5.0, 1.25)));
        }
    }
    let head = [
        bag_field("op", &[5]),
        bag_field("compression", b"none"),
        bag_field("size", &(records.len() as u32).to_le_bytes()),
    ];
    let magic: &[u8] = b"#ROSBAG V2.0\n";
    let end = bag_record(&[bag_field("op", &[6])], &[0; 8]);
    [magic, &bag_record(&[bag_field("op", &[3])], &[b' '; 40]), &bag_record(&head, &records), &end]
        .concat()
}

fn bag_field(name: &str, value: &[u8]) -> Vec<u8> {
    let body = [name.as_bytes(), b"=", value].concat();
    [&(body.len() as u32).to_le_bytes()[..], &body].concat()
}

fn bag_record(header: &[Vec<u8>], data: &[u8]) -> Vec<u8> {
    let header = header.concat();
    let lengths = [header.len(), data.len()].map(|length| (length as u32).to_le_bytes());
    [&lengths[0][..], &header, &lengths[1], data].concat()
}

fn bag_connection(id: u32, topic: &str, kind: &str) -> Vec<u8> {
    let head = [
        bag_field("op", &[7]),
        bag_field("conn", &id.to_le_bytes()),
        bag_field("topic", topic.as_bytes()),
    ];
    let data = [bag_field("topic", topic.as_bytes()), bag_field("type", kind.as_bytes())].concat();
    bag_record(&head, &data)
}

fn bag_message(id: u32, tenths: u32, data: &[u8]) -> Vec<u8> {
    let time = [9_u32.to_le_bytes(), (tenths * 50_000_000).to_le_bytes()].concat();
    bag_record(
        &[bag_field("op", &[2]), bag_field("conn", &id.to_le_bytes()), bag_field("time", &time)],
        data,
    )
}

/// Returns a scan by the clock of the scanner, which is another one than that of the recorder.
fn bag_scan(sec: u32) -> Vec<u8> {
    let mut out = [sec, 1400 + sec, 500].map(u32::to_le_bytes).concat();
    out.extend([&5_u32.to_le_bytes()[..], b"laser"].concat());
    let fixed = [-0.1_f32, 0.1, 0.1, 0.0, 0.1, 0.05, 9.0];
    out.extend(fixed.iter().flat_map(|value| value.to_le_bytes()));
    out.extend(3_u32.to_le_bytes());
    out.extend([2.0_f32, 2.0, f32::INFINITY].iter().flat_map(|v| v.to_le_bytes()));
    out.extend(0_u32.to_le_bytes());
    out
}

fn bag_person(id: u32, x: f64, y: f64) -> Vec<u8> {
    let pose = [x, y, 0.0, 0.0, 0.0, 0.0, 1.0].map(f64::to_le_bytes).concat();
    [&pose[..], &id.to_le_bytes()].concat()
}

#[test]
fn annotated_bags_of_the_leg_tracker_become_truth_on_the_floor() {
    let home = tempfile::tempdir().unwrap();
    fs::write(home.path().join("walk.bag"), leg_bag(&["/scan"])).unwrap();
    let (code, said) = import(home.path(), &["leg-tracker", "walk.bag"]);
    assert_eq!(code, 0, "{said}");
    let text = fs::read_to_string(home.path().join("walk.people-floor.csv")).unwrap();
    assert_eq!(
        text,
        "stamp_s,scan,id,x_laser_m,y_laser_m,points,ignore,source\n\
         1400.000000500,0,4,2.0000,-0.1000,2,0,annotated\n\
         1401.000000500,1,4,2.0000,-0.1000,2,0,annotated\n\
         1401.000000500,1,1000,5.0000,1.2500,0,0,annotated\n"
    );
    let rows = tagalong_eval::formats::floor::parse(&text, "made").unwrap();
    assert!(rows.len() == 3 && rows.iter().all(|row| row.annotated && !row.ignore));
    // Two scanners: which one was annotated has to be told.
    fs::write(home.path().join("two.bag"), leg_bag(&["/left", "/right"])).unwrap();
    let (code, said) = import(home.path(), &["leg-tracker", "two.bag"]);
    assert!(code == 1 && said.contains("scans on /left, /right; name one with --scan"), "{said}");
    let (code, said) = import(home.path(), &["leg-tracker", "two.bag", "--scan", "/rear"]);
    assert!(code == 1 && said.contains("there are: /left, /right"), "{said}");
    let (code, said) = import(home.path(), &["leg-tracker", "two.bag", "--scan", "/right"]);
    assert_eq!(code, 0, "{said}");
}

#[test]
fn bags_whose_people_cannot_be_told_are_refused() {
    let home = tempfile::tempdir().unwrap();
    let whole = leg_bag(&["/scan"]);
    let other = String::from_utf8_lossy(b"ground_truth_people_tracks").into_owned();
    let mut renamed = whole.clone();
    while let Some(at) = renamed.windows(other.len()).position(|part| part == other.as_bytes()) {
        renamed[at] = b'x';
    }
    for (bytes, cause) in [
        (&whole[..whole.len() - 40], "damaged"),
        (&renamed, "no annotations on /ground_truth_people_tracks"),
        (b"no bag at all, but text".as_slice(), "walk.bag"),
    ] {
        fs::write(home.path().join("walk.bag"), bytes).unwrap();
        let (code, said) = import(home.path(), &["leg-tracker", "walk.bag"]);
        assert!(code == 1 && said.contains(cause), "{cause}: {said}");
        assert!(!home.path().join("walk.people-floor.csv").exists());
    }
}
