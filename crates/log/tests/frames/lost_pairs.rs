//! Frames that are lost because no depth or right image belongs to them.

use super::*;

/// Number of frames of a ride, ten times a second.
const FRAMES: u32 = 20;

/// Writes colour images, and in front of each one depth where `depth` gives a stamp for it, s.
fn ride(depth: impl Fn(u32, f64) -> Option<f64>) -> SavedLog {
    let mut log = started();
    for index in 0..FRAMES {
        let t = 0.1 * f64::from(index);
        if let Some(stamp) = depth(index, t) {
            let data = 2000_u16.to_le_bytes().repeat(16 * 12);
            let image = Image::packed(Header::new(at(stamp), "colour"), "16UC1", 16, 12, &data);
            log.message("/camera/depth/image_raw", at(t), &image);
        }
        log.colour(at(t));
    }
    log.save()
}

fn read(saved: &SavedLog, inputs: Inputs) -> (usize, FrameSource) {
    let mut source = saved.open(&InputSettings::default(), inputs).unwrap();
    (frames(&mut source).len(), source)
}

fn told(source: &FrameSource) -> String {
    source.notes().iter().find(|note| note.contains("got no image of")).cloned().unwrap_or_default()
}

#[test]
fn frames_without_depth_are_lost_with_the_measured_cause() {
    type Depth<'a> = (&'a dyn Fn(u32, f64) -> Option<f64>, &'a str, &'a str);
    let cases: [Depth<'_>; 11] = [
        (&|_, t| Some(t.floor()), "its stamps are rounded to whole seconds", "--stamps recording"),
        (&|_, t| (t < 0.95).then_some(t), "it ends 1.0 s before the last frame", "record it"),
        (&|_, t| (t > 0.95).then_some(t), "it begins 1.0 s after the first frame", "record it"),
        (
            &|index, t| Some(if index % 2 == 0 { t } else { t + 0.045 }),
            "are 45 ms or more apart",
            "`pair_tolerance_s = 0.06`",
        ),
        (&|index, t| (index % 3 > 0).then_some(t), "it has 13 images, and there are 20", "record"),
        (
            &|_, t| Some(t + 3600.0),
            "3600.00 s later than those of the colour images",
            "--stamps rec",
        ),
        (
            &|_, t| Some(t + 5.0),
            "5.00 s later than those of the colour images",
            "--stamps recording",
        ),
        (&|_, t| Some(t - 5.0), "5.00 s earlier than those of the colour", "--stamps recording"),
        (
            &|_, t| Some(t + 1.0),
            "1.00 s later than those of the colour images",
            "--stamps recording",
        ),
        (&|_, t| Some(t - 0.9), "are 500 ms or more apart", "--stamps recording"),
        (&|_, t| Some(t + 0.05), "they come 0.050 s before or after it", "--stamps recording"),
    ];
    for (depth, cause, remedy) in cases {
        let saved = ride(depth);
        let (made, source) = read(&saved, DEPTH);
        let told = told(&source);
        assert!(made < FRAMES as usize && source.data_lost(), "{cause}: {:?}", source.notes());
        assert!(told.contains(cause) && told.contains(remedy), "{cause}: {told}");
        // No frame is lost where depth may be missing.
        let (made, source) = read(&saved, Inputs::ANY.require(Input::Colour));
        assert_eq!(made, FRAMES as usize);
        assert!(!source.data_lost(), "{cause}: {:?}", source.notes());
    }
}

/// Nearly all frames have depth, of another moment.
#[test]
fn depth_with_stamps_of_the_future_is_told_where_it_pairs() {
    let saved = ride(|_, t| Some(t + 0.3));
    let (_, source) = read(&saved, DEPTH);
    let told = source.account().used_as("depth").unwrap().to_string();
    assert!(told.contains("its stamps are 0.30 s later than those of the colour images"), "{told}");
    assert!(told.contains("--stamps recording"), "{told}");
    // Stamps that agree are right, however late the images are recorded.
    let (_, source) = read(&ride(|_, t| Some(t)), DEPTH);
    assert_eq!(source.account().used_as("depth").unwrap().problem, None);
}

#[test]
fn depth_that_stands_behind_its_frames_in_the_log_is_told() {
    let mut log = started();
    (0..FRAMES).for_each(|index| log.colour(at(0.1 * f64::from(index))));
    for index in 0..FRAMES {
        let stamp = at(0.1 * f64::from(index));
        let data = [0; 16 * 12 * 2];
        let image = Image::packed(Header::new(stamp, "colour"), "16UC1", 16, 12, &data);
        log.message("/camera/depth/image_raw", stamp.plus_seconds(5.0), &image);
    }
    let (made, source) = read(&log.save(), DEPTH);
    assert!(made < FRAMES as usize && source.data_lost(), "{made}: {:?}", source.notes());
    let told = told(&source);
    assert!(
        told.contains("stand 5.0 s after them in the log, and no frame waits so long; record it"),
        "{told}"
    );
}

#[test]
fn stamps_that_go_back_are_told() {
    let mut log = started();
    for index in 0..FRAMES {
        let stamp = at(5.0 - 0.1 * f64::from(index));
        log.colour(stamp);
        log.depth(stamp, "colour", 2.0);
    }
    let (made, source) = read(&log.save(), DEPTH);
    assert!(made < FRAMES as usize && source.data_lost(), "{made}: {:?}", source.notes());
    assert!(told(&source).contains("go back 19 times"), "{:?}", source.notes());
}

#[test]
fn a_missing_partner_now_and_then_and_a_slower_camera_lose_nothing() {
    let cases: [&dyn Fn(u32, f64) -> Option<f64>; 5] = [
        &|_, t| Some(t),
        &|index, t| (index >= 3).then_some(t),
        &|index, t| (index % 9 > 0).then_some(t),
        &|index, t| (index % 2 == 0).then_some(t),
        &|index, t| (index % 5 == 0).then_some(t + 0.01),
    ];
    for (case, depth) in cases.iter().enumerate() {
        let (made, source) = read(&ride(depth), DEPTH);
        let without = count(&source, "colour_without_depth") as usize;
        assert_eq!(made + without, FRAMES as usize, "{case}");
        assert!(!source.data_lost(), "{case}: {:?}", source.notes());
        assert_eq!(told(&source), "", "{case}");
        let is_told = source.notes().iter().any(|note| note.contains("images make no frame"));
        assert_eq!(is_told, case > 2, "{case}: {:?}", source.notes());
    }
}
