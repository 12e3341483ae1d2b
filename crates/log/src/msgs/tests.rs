use proptest::prelude::*;

use super::*;

fn header() -> Header {
    Header { stamp: Time { sec: 7, nanosec: 8 }, frame_id: "camera".into() }
}

fn detections() -> Detection3DArray {
    let mut one = Detection3D { header: header(), id: "12".into(), ..Default::default() };
    one.bbox.center.position.x = 2.5;
    let mut result = ObjectHypothesisWithPose {
        hypothesis: ObjectHypothesis { class_id: "person".into(), score: 0.5 },
        ..Default::default()
    };
    result.pose.covariance[2][3] = 0.25;
    one.results.push(result);
    Detection3DArray { header: header(), detections: vec![one.clone(), one] }
}

#[test]
fn an_image_lies_in_cdr_as_ros_writes_it() {
    let image = Image {
        header: header(),
        height: 1,
        width: 2,
        encoding: "mono8".into(),
        is_bigendian: 0,
        step: 2,
        data: &[9, 10],
    };
    // Written by hand from the rules of CDR: alignment to the size of the value counted after the
    // encapsulation header, strings with their zero.
    let expected = [
        &[0, 1, 0, 0][..],                                    // little endian
        &[7, 0, 0, 0, 8, 0, 0, 0],                            // stamp
        &[7, 0, 0, 0, b'c', b'a', b'm', b'e', b'r', b'a', 0], // frame_id
        &[0],                                                 // padding
        &[1, 0, 0, 0, 2, 0, 0, 0],                            // height, width
        &[6, 0, 0, 0, b'm', b'o', b'n', b'o', b'8', 0],       // encoding
        &[0],                                                 // is_bigendian
        &[0],                                                 // padding
        &[2, 0, 0, 0],                                        // step
        &[2, 0, 0, 0, 9, 10],                                 // data
    ]
    .concat();
    assert_eq!(encode(&image), expected);
    assert_eq!(decode::<Image<'_>>(&expected).unwrap(), image);
}

#[test]
fn both_byte_orders_are_read() {
    let sent = detections();
    assert_eq!(decode::<Detection3DArray>(&encode(&sent)).unwrap(), sent);
    assert_eq!(decode::<Detection3DArray>(&encode_big_endian(&sent)).unwrap(), sent);
}

/// Appends the header of ROS 1: sequence number, stamp and frame.
fn ros1_header(bytes: &mut Vec<u8>) {
    bytes.extend(ROS1_MARK);
    bytes.extend([7_u32, 7, 8, 6].iter().flat_map(|word| word.to_le_bytes()));
    bytes.extend(b"camera");
}

#[test]
fn ranges_are_read_with_and_without_their_variance_and_in_ros_1() {
    let sent = Range {
        header: header(),
        radiation_type: 1,
        field_of_view: 0.5,
        min_range: 0.1,
        max_range: 4.0,
        range: 1.5,
    };
    let written = encode(&sent);
    assert_eq!(decode::<Range>(&written).unwrap(), sent);
    let with_variance = [&written[..], &0.01_f32.to_le_bytes()].concat();
    assert_eq!(decode::<Range>(&with_variance).unwrap(), sent);
    let mut ros1 = Vec::new();
    ros1_header(&mut ros1);
    ros1.push(1);
    ros1.extend([0.5_f32, 0.1, 4.0, 1.5].iter().flat_map(|number| number.to_le_bytes()));
    assert_eq!(decode::<Range>(&ros1).unwrap(), sent);
    for end in 0..ros1.len() {
        assert!(decode::<Range>(&ros1[..end]).is_err(), "{end}");
    }
}

#[test]
fn bumpers_are_read_from_the_beginning_of_their_messages() {
    let state = BumperState { header: header(), bumper: 2 };
    let rest = [1.5_f32, 0.0, 0.0].iter().flat_map(|number| number.to_le_bytes());
    let message: Vec<u8> = encode(&state).into_iter().chain(rest).collect();
    assert_eq!(decode::<BumperState>(&message).unwrap(), state);
    let mut ros1 = Vec::new();
    ros1_header(&mut ros1);
    ros1.extend(2_u32.to_le_bytes());
    ros1.extend(b"the contacts themselves");
    let contacts = decode::<ContactCount>(&ros1).unwrap();
    assert_eq!(contacts, ContactCount { header: header(), contacts: 2 });
    let event = decode::<BumperEvent>(&[ROS1_MARK.as_slice(), &[2, 1]].concat()).unwrap();
    assert_eq!(event, BumperEvent { bumper: 2, state: BumperEvent::PRESSED });
    let hazard = HazardDetection { header: header(), kind: HazardDetection::BUMP };
    let hazards = HazardDetectionVector { header: header(), detections: vec![hazard] };
    assert_eq!(decode::<HazardDetectionVector>(&encode(&hazards)).unwrap(), hazards);
}

#[test]
fn other_encapsulations_are_refused_by_name() {
    let mut bytes = encode(&StringMsg { data: "a".into() });
    bytes[1] = 3;
    let error = decode::<StringMsg>(&bytes).unwrap_err();
    assert_eq!(error, CdrError::Encapsulation(vec![0, 3, 0, 0]));
    assert!(decode::<StringMsg>(&[0, 1]).is_err());
}

#[test]
fn every_truncation_is_an_error() {
    let bytes = encode(&detections());
    for length in 0..bytes.len() {
        assert!(decode::<Detection3DArray>(&bytes[..length]).is_err(), "cut at {length}");
    }
}

#[test]
fn a_giant_sequence_is_refused_without_its_memory() {
    let mut bytes = encode(&TFMessage::default());
    bytes[4..8].copy_from_slice(&u32::MAX.to_le_bytes());
    assert!(decode::<TFMessage>(&bytes).is_err());
}

#[test]
fn definitions_name_every_part() {
    assert!(Detection3DArray::DEFINITION.contains("MSG: vision_msgs/ObjectHypothesis\n"));
    assert!(Odometry::DEFINITION.contains("float64[36] covariance"));
    assert!(TFMessage::DEFINITION.starts_with("geometry_msgs/TransformStamped[] transforms\n"));
}

#[test]
fn a_transform_that_is_none_is_seen() {
    let mut transform = Transform::default();
    assert!(transform.isometry().is_some());
    transform.rotation.w = 0.0;
    assert!(transform.isometry().is_none());
    transform = Transform::default();
    transform.translation.y = f64::NAN;
    assert!(transform.isometry().is_none());
}

proptest! {
    #[test]
    fn any_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..300), order in 0..2u8) {
        let message = [&[0, order, 0, 0][..], &bytes].concat();
        let _ = decode::<Image<'_>>(&message);
        let _ = decode::<CameraInfo>(&message);
        let _ = decode::<TFMessage>(&message);
        let _ = decode::<Odometry>(&message);
        let _ = decode::<Detection3DArray>(&message);
        let _ = decode::<Range>(&message);
        let _ = decode::<HazardDetectionVector>(&message);
        let _ = decode::<BoolMsg>(&message);
    }

    #[test]
    fn odometry_round_trips(x in any::<f64>(), c in -1.0..1.0f64, name in "[a-z/]{0,9}") {
        prop_assume!(!x.is_nan());
        let mut sent = Odometry { header: header(), child_frame_id: name, ..Default::default() };
        sent.pose.pose.position.x = x;
        sent.twist.covariance[5][5] = c;
        prop_assert_eq!(&decode::<Odometry>(&encode(&sent)).unwrap(), &sent);
        prop_assert_eq!(decode::<Odometry>(&encode_big_endian(&sent)).unwrap(), sent);
    }
}
