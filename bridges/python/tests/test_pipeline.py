"""Pipelines on arrays and on logs."""

import ast
import inspect
import pathlib
import threading
import time
import warnings

import numpy as np
import pytest
import tagalong

CAMERA = tagalong.Camera(64, 48, fx=60.0, height_m=1.2)
DEPTH = np.full((48, 64), 3.0, np.float32)
COLOUR = np.zeros((48, 64, 3), np.uint8)
# Hand-weighted networks; each finds an upright bright blob.
MODELS = pathlib.Path(__file__).parents[3] / "crates/network/tests/models"


def lines(report, pose):
    """The lines of tracks-metres.csv for a report, in the robot frame."""
    for track in report.tracks:
        numbers = [f"{value:.4f}" for value in [*track.position, *track.velocity]]
        rows, columns = np.triu_indices(3)
        numbers += [f"{value:.6f}" for value in track.covariance[:3, :3][rows, columns]]
        numbers = [text.lstrip("-") if not text.strip("-0.") else text for text in numbers]
        yield [str(report.stamp_ns), str(report.index), str(track.id), *numbers, str(int(track.seen))]


def of_program(run):
    """The same lines as the program wrote them: without the places in the odometry frame."""
    rows = (run / "tracks-metres.csv").read_text().splitlines()[1:]
    cells = (row.split(",") for row in rows)
    return [[*row[:6], *row[9:]] for row in cells]


def test_frames_of_a_log_give_the_tracks_of_the_program(log, run):
    pipeline = tagalong.Pipeline.from_toml("depth-ekf")
    found = []
    for frame in pipeline.frames(log):
        found += lines(pipeline.step_frame(frame), frame.pose)
    assert len(found) > 100
    assert found == of_program(run)


def test_arrays_give_the_tracks_of_the_program(log, run):
    pipeline = tagalong.Pipeline.from_toml("depth-ekf")
    found, boxes = [], []
    frames = pipeline.frames(log)
    for frame in frames:
        report = pipeline.step(
            frame.colour, frame.depth, frame.camera, frame.pose, frame.stamp_ns, index=frame.index
        )
        found += lines(report, frame.pose)
        boxes += [
            f"{report.index},{t.id},{t.box[0]:.2f},{t.box[1]:.2f},{t.box[2]:.2f},{t.box[3]:.2f},"
            f"{t.score:.6f},-1,-1,-1"
            for t in report.tracks
            if t.seen and t.box
        ]
    assert found == of_program(run)
    assert boxes == (run / "tracks.csv").read_text().splitlines()
    assert not frames.data_lost and frames.counters["frames"] > 20


def test_a_config_is_a_name_a_file_or_a_text(tmp_path):
    text = tagalong.Pipeline.from_toml("depth-ekf").resolved
    path = tmp_path / "mine.toml"
    path.write_text(text)
    assert tagalong.Pipeline.from_toml(path).resolved == text
    assert tagalong.Pipeline.from_toml(str(path)).resolved == text
    assert tagalong.Pipeline.from_toml(text).resolved == text


def test_mistakes_in_configs_are_shown_with_their_line(tmp_path):
    with pytest.raises(tagalong.ConfigError, match="depth-ekv"):
        tagalong.Pipeline.from_toml("depth-ekv")
    with pytest.raises(tagalong.ConfigError, match=r"^<text>:1:1: unknown key `sed`; did you mean `seed`"):
        tagalong.Pipeline.from_toml("sed = 1\n")
    with pytest.raises(ValueError):
        tagalong.Pipeline.from_toml(tmp_path / "none.toml")


@pytest.mark.parametrize(
    ("colour", "depth", "message"),
    [
        (COLOUR.astype(float), DEPTH, "colour is an array of .*float64.*uint8"),
        (COLOUR[:, :, :2], DEPTH, r"colour has shape \[48, 64, 2\]; give rows x columns x 3"),
        (COLOUR, DEPTH.astype(np.int32), "depth is an array of .*int32.*float32"),
        (COLOUR, DEPTH[:40], "depth has 64 x 40 pixels and the camera 64 x 48"),
        (COLOUR, DEPTH.tolist(), "depth is a .*list.*, not a numpy array"),
        (COLOUR, DEPTH[:0], "depth has 64 x 0 pixels"),
        (COLOUR, DEPTH.ravel(), "depth has shape"),
    ],
)
def test_images_of_wrong_types_and_shapes_are_refused(colour, depth, message):
    pipeline = tagalong.Pipeline.from_toml("depth-ekf")
    with pytest.raises((TypeError, ValueError), match=message):
        pipeline.step(colour, depth, CAMERA, None, 0)


@pytest.mark.parametrize(
    ("pose", "stamp", "message"),
    [
        ((0.0, 0.0, float("nan")), 0, "finite"),
        ((0.0, 0.0), 0, "4 x 4"),
        (np.eye(4) * 2.0, 0, "no rigid motion"),
        (None, -1.0, "stamp is -1"),
        (None, float("inf"), "stamp is inf"),
    ],
)
def test_poses_and_stamps_that_are_none_are_refused(pose, stamp, message):
    pipeline = tagalong.Pipeline.from_toml("depth-ekf")
    with pytest.raises(ValueError, match=message):
        pipeline.step(COLOUR, DEPTH, CAMERA, pose, stamp)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"fx": 1e30}, "fx is 10+; it must be above 0 and at most 64000"),
        ({"fx": float("nan")}, "fx is NaN"),
        ({"cx": -5.0}, "cx is -5"),
        ({"height_m": 0.0}, "height_m must be above 0"),
        ({"height_m": None}, "pose is missing"),
        ({"robot_from_camera": np.eye(4)}, "given twice"),
        ({"distortion": [0.1], "model": "fov"}, "no distortion model `fov`"),
        ({"distortion": [0.1] * 6}, "at most 5"),
        ({"distortion": [float("inf")]}, "finite"),
    ],
)
def test_cameras_that_cannot_be_are_refused(changed, message):
    with pytest.raises(ValueError, match=message):
        tagalong.Camera(64, 48, **{"fx": 60.0, "height_m": 1.2, **changed})


def test_a_camera_projects_along_its_axis():
    assert CAMERA.project([2.0, 0.0, 1.2]) == pytest.approx((31.5, 23.5))
    assert CAMERA.project([-2.0, 0.0, 1.2]) is None
    same = tagalong.Camera(64, 48, fx=60.0, robot_from_camera=CAMERA.robot_from_camera)
    assert same.project([2.0, 0.3, 1.0]) == pytest.approx(CAMERA.project([2.0, 0.3, 1.0]))


def test_tracks_have_the_joints_that_a_pose_network_finds():
    model = MODELS / "movenet.onnx"
    pipeline = tagalong.Pipeline.from_toml(
        f"""
        [[detectors]]
        plugin = "onnx"
        config = {{ model = "{model.as_posix()}" }}

        [filter]
        plugin = "ekf"
        """
    )
    camera = tagalong.Camera(384, 384, fx=300.0, height_m=1.0)
    colour = np.full((384, 384, 3), 10, np.uint8)
    colour[96:288, 192:288] = 240
    for tenth in range(6):
        report = pipeline.step(colour, None, camera, None, 1.0 + 0.1 * tenth)
    (track,) = report.tracks
    assert len(track.joints) == 17
    x, y, score = track.joints["left_wrist"]
    assert 191 <= x <= 289 and 95 <= y <= 289 and 0.0 < score <= 1.0
    assert track.raised_hand in (True, False)


def test_other_detectors_find_no_joints(log):
    pipeline = tagalong.Pipeline.from_toml("depth-ekf")
    tracks = [track for frame in pipeline.frames(log) for track in pipeline.step_frame(frame).tracks]
    assert tracks and all(track.joints is None and track.raised_hand is None for track in tracks)


def test_depth_in_millimetres_is_depth_in_metres_and_holes_are_holes(log):
    def millimetres(depth, hole=0):
        return np.nan_to_num(depth * 1000.0, nan=hole).round().astype(np.uint16)

    frames = tagalong.Pipeline.from_toml("depth-ekf").frames(log)
    assert all(np.isnan(frame.depth).any() for frame in frames)
    tracks = {}
    for name, depth_of in {
        "metres": lambda depth: depth,
        "double": lambda depth: depth.astype(np.float64),
        "millimetres": millimetres,
        "largest": lambda depth: millimetres(depth, 65535),
        "zero": lambda depth: np.nan_to_num(depth, nan=0.0),
        "negative": lambda depth: np.nan_to_num(depth, nan=-1.0).astype(np.float64),
        "infinite": lambda depth: np.nan_to_num(depth, nan=np.inf),
        "flipped": lambda depth: np.ascontiguousarray(depth[::-1])[::-1],
        "flipped millimetres": lambda depth: np.ascontiguousarray(millimetres(depth)[::-1])[::-1],
    }.items():
        pipeline = tagalong.Pipeline.from_toml("depth-ekf")
        tracks[name] = [
            list(lines(pipeline.step(None, depth_of(f.depth), f.camera, f.pose, f.stamp_ns), f.pose))
            for f in pipeline.frames(log)
        ]
    assert any(tracks["metres"])
    assert all(found == tracks["metres"] for found in tracks.values())


def test_stamps_are_nanoseconds_or_seconds_and_repeated_ones_are_told():
    pipeline = tagalong.Pipeline.from_toml("depth-ekf")
    outcomes = [
        pipeline.step(None, DEPTH, CAMERA, None, stamp).outcome
        for stamp in [10.0, 10_100_000_000, 10.1, 10.05, 2.0, 900.0]
    ]
    told = ["processed", "processed", "duplicate", "out-of-order", "reset-backward", "reset-forward"]
    assert outcomes == told


def test_an_outcome_other_than_processed_is_shown():
    pipeline = tagalong.Pipeline.from_toml("depth-ekf")
    reports = [pipeline.step(None, DEPTH, CAMERA, None, stamp) for stamp in [10.0, 10.0, 2.0]]
    shown = [repr(report) for report in reports]
    assert shown[0] == "Report(frame 1, 0 tracks)"
    assert "duplicate: left out" in shown[1] and "reset-backward: the clock" in shown[2]


def test_stamps_in_other_units_are_told():
    pipeline = tagalong.Pipeline.from_toml("depth-ekf")
    with pytest.raises(ValueError, match="stamp is 11: an int is nanoseconds"):
        pipeline.step(None, DEPTH, CAMERA, None, 11)
    pipeline.step(None, DEPTH, CAMERA, None, 1_790_000_000)
    with pytest.warns(UserWarning, match="stamp is 1 ns after") as told:
        for second in (1, 2, 3):
            pipeline.step(None, DEPTH, CAMERA, None, 1_790_000_000 + second)
    assert len(told) == 1


def test_a_frame_without_depth_is_refused_alone(log):
    pipeline = tagalong.Pipeline.from_toml("follow-depth")
    frames = list(pipeline.frames(log))
    given = lambda f, depth: pipeline.step(None, depth, f.camera, f.pose, f.stamp_ns)
    before = [given(f, f.depth) for f in frames[:-2]][-1]
    assert before.tracks
    with pytest.raises(ValueError, match="needs depth images, which this frame does not have"):
        given(frames[-2], None)
    assert pipeline.command_at(before.command.valid_until_ns + 1).reason == "expired"
    after = given(frames[-1], frames[-1].depth)
    assert {t.id for t in after.tracks} & {t.id for t in before.tracks}
    assert pipeline.fault is None and after.command is not None


def test_depth_and_sizes_that_are_odd_are_told_once():
    def told(*depths):
        pipeline = tagalong.Pipeline.from_toml("depth-ekf")
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            for count, depth in enumerate(depths):
                rows, columns = depth.shape
                camera = tagalong.Camera(columns, rows, fx=60.0, height_m=1.2)
                pipeline.step(None, depth, camera, None, 1.0 + 0.1 * count)
        return [str(one.message) for one in said]

    assert told(DEPTH, DEPTH) == []
    (metres,) = told(DEPTH * 1000.0, DEPTH * 1000.0)
    assert metres.startswith("the median of depth is 3000 m: floats are metres")
    (empty,) = told(DEPTH * np.nan, DEPTH * 0.0)
    assert empty.startswith("depth has not one reading")
    (size,) = told(DEPTH, DEPTH[:40], DEPTH)
    assert size.startswith("the images have 64 x 40 pixels, and those before 64 x 48")


# A person of 1.7 m who walks to the right, 4 m before the camera.
CAMERA_OF_BOXES = tagalong.Camera(640, 480, fx=525.0, height_m=1.2)
BOXES = [(200.0 + 5.0 * step, 174.0, 60.0, 223.0, 0.9) for step in range(20)]
HEADS = [(4.0, 0.9 - 0.04 * step, 1.6, 0.9) for step in range(20)]


@pytest.mark.parametrize(
    ("config", "walk", "rows"),
    [
        ("recorded", BOXES, lambda found: [found]),
        ("recorded", BOXES, lambda found: np.array([found])),
        ("heads", HEADS, lambda found: [found]),
    ],
)
def test_detections_of_the_caller_are_tracked(config, walk, rows):
    pipeline = tagalong.Pipeline.from_toml(RECORDED_HEADS if config == "heads" else config)
    step = lambda at, found: pipeline.step(None, None, CAMERA_OF_BOXES, None, at, detections=found)
    with pytest.raises(ValueError, match=r"give detections=\[\(x, y"):
        step(1.0, None)
    for count, found in enumerate(walk):
        # The detector rests in every fourth frame.
        report = step(2.0 + 0.1 * count, None if count % 4 == 1 else rows(found))
    (track,) = report.tracks
    assert track.seen and 3.5 < np.hypot(*track.position[:2]) < 4.6
    (track,) = step(4.0, []).tracks
    assert not track.seen


RECORDED_HEADS = """
filter.plugin = "ekf"
[[detectors]]
plugin = "recorded-detections"
[input]
detections_topic = "/none"
"""


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ([(1.0, 2.0)], "detections are rows of x, y, width, height, score"),
        ([(1.0, 2.0, 0.0, 5.0, 0.5)], "a detection is 0 x 5 pixels"),
        ([(1.0, 2.0, 3.0, float("nan"), 0.5)], "not finite"),
        ("boxes", "detections are rows"),
    ],
)
def test_detections_that_are_none_are_refused(rows, message):
    pipeline = tagalong.Pipeline.from_toml("recorded")
    with pytest.raises(ValueError, match=message):
        pipeline.step(None, None, CAMERA, None, 1.0, detections=rows)
    with pytest.raises(ValueError, match="give its camera"):
        pipeline.step(None, None, None, None, 1.0, detections=[(1.0, 2.0, 3.0, 4.0, 0.5)])


def test_a_controller_commands_and_needs_odometry(log):
    pipeline = tagalong.Pipeline.from_toml("follow-depth")
    assert pipeline.has_controller
    with pytest.raises(ValueError, match="no odometry"):
        pipeline.step(COLOUR, DEPTH, CAMERA, None, 0)
    reports = [
        pipeline.step(f.colour, f.depth, f.camera, f.pose, f.stamp_ns) for f in pipeline.frames(log)
    ]
    command = reports[-1].command
    assert {report.target for report in reports} - {None}
    assert command.valid_until_ns > command.stamp_ns == reports[-1].stamp_ns
    assert pipeline.command_at(command.valid_until_ns + 1).reason == "expired"
    pipeline.disarm()
    assert pipeline.fault and pipeline.command_at(command.stamp_ns).wheels_mps == (0.0, 0.0)
    pipeline.arm()
    assert pipeline.fault is None


def test_a_jump_of_the_odometry_stops_the_robot():
    pipeline = tagalong.Pipeline.from_toml("follow-depth")
    for at, x in enumerate([0.0, 0.05, 0.1, 5.0]):
        pipeline.step(COLOUR, DEPTH, CAMERA, (x, 0.0, 0.0), 1.0 + 0.1 * at)
        assert (pipeline.fault is not None) == (x == 5.0)


def test_frozen_depth_and_old_odometry_stop_the_robot():
    pipeline = tagalong.Pipeline.from_toml("follow-depth")
    rng = np.random.default_rng(1)
    noisy = lambda: (DEPTH + rng.normal(0.0, 0.003, DEPTH.shape)).astype(np.float32)
    reason = lambda depth, at, **more: pipeline.step(
        None, depth, CAMERA, (0.0, 0.0, 0.0), 1.0 + 0.1 * at, **more
    ).command.reason
    live = [reason(noisy(), at) for at in range(8)]
    assert live[-1] not in {"frozen", "odometry"}, live
    assert reason(noisy(), 8, odometry_age_s=0.9) == "odometry"
    same = noisy()
    assert [reason(same, at) for at in range(9, 16)][-1] == "frozen"


@pytest.mark.parametrize(("stamped", "frozen"), [(True, False), (False, True)])
def test_a_scan_that_is_given_again_with_its_stamp_is_not_frozen(stamped, frozen):
    """The scanner is six times slower than the camera."""
    pipeline = tagalong.Pipeline.from_toml("follow-depth")
    rng = np.random.default_rng(2)
    angles = np.linspace(-3.1, 3.1, 360)
    reasons, scan = [], None
    for at in range(24):
        depth = (DEPTH + rng.normal(0.0, 0.003, DEPTH.shape)).astype(np.float32)
        if at % 6 == 0:
            ranges = 3.0 + rng.normal(0.0, 0.01, angles.shape)
            scan = np.stack([ranges * np.cos(angles), ranges * np.sin(angles)], axis=1)
            scan = np.column_stack([scan, np.full(angles.shape, 0.3)])
        taken = 1.0 + 0.05 * (at - at % 6)
        more = {"scan_stamp": taken} if stamped else {}
        report = pipeline.step(
            None, depth, CAMERA, (0.0, 0.0, 0.0), 1.0 + 0.05 * at, scan=scan, **more
        )
        reasons.append(report.command.reason)
    assert ("frozen" in reasons) == frozen, reasons


def test_a_scan_alone_makes_a_frame():
    pipeline = tagalong.Pipeline.from_toml("laser-legs")
    angles = np.linspace(-1.0, 1.0, 181)
    scan = np.stack([3.0 * np.cos(angles), 3.0 * np.sin(angles)], axis=1)
    assert pipeline.step(None, None, None, None, 1.0, scan=scan).tracks == []
    with pytest.raises(ValueError, match="not finite"):
        pipeline.step(None, None, None, None, 2.0, scan=scan * np.nan)


def test_the_interpreter_is_free_while_a_pipeline_works(log):
    """Another thread counts on while frames are tracked."""
    pipeline = tagalong.Pipeline.from_toml("depth-verified")
    frames = list(pipeline.frames(log))
    counted, ticks = threading.Event(), []

    def count():
        while not counted.is_set():
            ticks.append(time.monotonic())
            time.sleep(0.001)

    other = threading.Thread(target=count)
    other.start()
    longest = 0.0
    for frame in frames:
        start, before = time.monotonic(), len(ticks)
        pipeline.step_frame(frame)
        took = time.monotonic() - start
        if took > 0.02:
            longest = max(longest, took)
            assert len(ticks) > before, f"no tick in {took} s"
    counted.set()
    other.join()


def test_frames_tell_the_age_of_odometry(log):
    pipeline = tagalong.Pipeline.from_toml("depth-ekf")
    ages = [frame.odometry_age_s for frame in pipeline.frames(log)]
    assert len(ages) > 20 and all(0 <= age < 0.1 for age in ages), ages
    pipeline.step(COLOUR, DEPTH, CAMERA, (0, 0, 0), 1.0, odometry_age_s=0.2)
    with pytest.raises(ValueError, match="odometry_age_s is -1"):
        pipeline.step(COLOUR, DEPTH, CAMERA, (0, 0, 0), 2.0, odometry_age_s=-1.0)
    with pytest.raises(ValueError, match="odometry_age_s is NaN"):
        pipeline.step(COLOUR, DEPTH, CAMERA, (0, 0, 0), 3.0, odometry_age_s=float("nan"))


def test_the_stub_says_what_the_classes_say():
    stub = pathlib.Path(tagalong.__file__).with_name("_tagalong.pyi")
    documented = 0
    for node in ast.parse(stub.read_text()).body:
        if not isinstance(node, ast.ClassDef) or ast.get_docstring(node) is None:
            continue
        of_class = getattr(tagalong, node.name)
        pairs = [(node, of_class)]
        functions = [inner for inner in node.body if isinstance(inner, ast.FunctionDef)]
        pairs += [(inner, getattr(of_class, inner.name)) for inner in functions if inner.name[0] != "_"]
        for written, real in pairs:
            assert ast.get_docstring(written) == inspect.getdoc(real), written.name
            documented += 1
    assert documented > 60
