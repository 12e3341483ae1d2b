use std::collections::{BTreeMap, BTreeSet};
use std::thread::sleep;
use std::time::{Duration, Instant};

use clap::Parser;
use tagalong::log::msgs::{Image, LaserScan, Message, SceneUpdate};

use super::*;

const RVIZ: &str = include_str!("../../../rviz/tagalong.rviz");
const LAUNCH: &str = include_str!("../../../launch/follow.launch.py");
const FOXGLOVE: &str = include_str!("../../../foxglove/tagalong.json");

/// Topics of `tracks.mcap` that the bridge does not publish: the layout is for both.
const ONLY_IN_FILES: [&str; 4] =
    ["/camera/camera_info", "/camera/image/compressed", "/people/annotations", "/people/scene"];

/// Display of RViz with a topic.
#[derive(Debug, PartialEq)]
struct Display {
    class: String,
    topic: String,
    is_reliable: bool,
    is_latched: bool,
}

/// Returns the displays that have a topic, by the lines of the file.
fn displays(config: &str) -> Vec<Display> {
    let mut all: Vec<Display> = Vec::new();
    let mut class = String::new();
    let mut in_topic = false;
    let mut is_reliable = false;
    let mut is_latched = false;
    for line in config.lines() {
        let text = line.trim();
        if let Some(name) = text.strip_prefix("- Class: rviz_default_plugins/") {
            class = name.to_owned();
        }
        match text {
            "Topic:" => in_topic = true,
            "Reliability Policy: Reliable" => is_reliable = true,
            "Reliability Policy: Best Effort" => is_reliable = false,
            "Durability Policy: Transient Local" => is_latched = true,
            "Durability Policy: Volatile" => is_latched = false,
            _ => {}
        }
        if let Some(topic) = text.strip_prefix("Value: /").filter(|_| in_topic) {
            let topic = format!("/{topic}");
            all.push(Display { class: class.clone(), topic, is_reliable, is_latched });
            in_topic = false;
        }
    }
    all
}

/// Returns the type that a display of RViz shows.
fn shown_type(class: &str) -> &'static str {
    match class {
        "MarkerArray" => MarkerArray::TYPE,
        "Pose" => PoseStamped::TYPE,
        "Map" => "nav_msgs/msg/OccupancyGrid",
        "LaserScan" => LaserScan::TYPE,
        "Image" => <Image<'_> as Message>::TYPE,
        _ => panic!("the type of the display {class} is not known"),
    }
}

/// Adds the topics of a layout of Foxglove, with the kinds of their panels.
fn add_topics(panel: &str, value: &serde_json::Value, topics: &mut BTreeSet<(String, String)>) {
    let mut names: Vec<&String> = Vec::new();
    match value {
        serde_json::Value::Object(fields) => {
            names.extend(fields.keys());
            fields.values().for_each(|field| add_topics(panel, field, topics));
        }
        serde_json::Value::Array(items) => {
            items.iter().for_each(|item| add_topics(panel, item, topics));
        }
        serde_json::Value::String(text) => names.push(text),
        _ => {}
    }
    for name in names.into_iter().filter(|name| name.starts_with('/')) {
        topics.insert((panel.to_owned(), name.clone()));
    }
}

/// Returns the topics with their types that a bridge of the default options publishes, as another
/// participant discovers them; `None` where participants do not hear each other.
fn published() -> Option<BTreeMap<String, String>> {
    // A domain that the other tests do not use.
    let domain = 48 - (std::process::id() % 17) as u16;
    let options = Options::parse_from(["tagalong-ros2", "config.toml"]);
    let mut bridge = Network::join(domain, "/").unwrap();
    let _out = Out::new(&options, &mut bridge).unwrap();
    let viewer = Network::join(domain, "/").unwrap();
    let from = Instant::now();
    while from.elapsed() < Duration::from_secs(15) {
        let found: BTreeMap<String, String> = viewer.topics().into_iter().collect();
        if [&options.tracks, &options.markers, &options.forecast, &options.state]
            .iter()
            .all(|topic| found.contains_key(&format!("/{topic}")))
        {
            // The others come with them.
            sleep(Duration::from_millis(500));
            return Some(viewer.topics().into_iter().collect());
        }
        sleep(Duration::from_millis(50));
    }
    None
}

#[test]
fn the_files_for_viewers_name_topics_and_types_that_are_published() {
    let Some(published) = published() else {
        eprintln!("skipped: two participants do not hear each other here (no multicast?)");
        return;
    };
    assert!(published.len() >= 8, "{published:?}");
    let displays = displays(RVIZ);
    assert_eq!(displays.len(), 5, "{displays:?}");
    let sensors = ["/scan", "/camera/color/image_raw"];
    for Display { class, topic, is_reliable, is_latched } in &displays {
        assert!(LAUNCH.contains(&format!("\"{topic}\"")), "the launch file does not remap {topic}");
        if sensors.contains(&topic.as_str()) {
            // A reliable subscriber hears no best-effort driver.
            assert!(!is_reliable, "{topic}");
            assert!(["LaserScan", "Image"].contains(&class.as_str()), "{class} of {topic}");
            continue;
        }
        let kind = published.get(topic);
        assert_eq!(kind.map(String::as_str), Some(shown_type(class)), "{class} of {topic}");
        assert!(!is_latched || class == "Map", "{topic} is not kept for late subscribers");
    }
    assert_eq!(
        published.get("/tf").map(String::as_str),
        Some(TFMessage::TYPE),
        "display of frames"
    );
    assert!(RVIZ.contains("rviz_default_plugins/TF") && RVIZ.contains("Fixed Frame: odom"));

    let layout: serde_json::Value = serde_json::from_str(FOXGLOVE).unwrap();
    let mut shown = BTreeSet::new();
    for (panel, config) in layout["configById"].as_object().unwrap() {
        add_topics(panel.split('!').next().unwrap(), config, &mut shown);
    }
    assert_eq!(shown.len(), 6, "{shown:?}");
    for (panel, topic) in &shown {
        let kind = published.get(topic).map(String::as_str);
        if ONLY_IN_FILES.contains(&topic.as_str()) {
            assert_eq!(kind, None, "{topic}");
            continue;
        }
        let drawn = [MarkerArray::TYPE, SceneUpdate::TYPE];
        match panel.as_str() {
            "3D" => assert!(kind.is_some_and(|kind| drawn.contains(&kind)), "{topic}: {kind:?}"),
            "RawMessages" => assert!(kind.is_some(), "{topic}"),
            _ => panic!("{panel} shows {topic}"),
        }
    }
}
