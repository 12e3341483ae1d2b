"""Plays a robot on an independent DDS (Cyclone) and checks what the bridge answers.

    python check_dds.py CHECK ROBOT.mcap DOMAIN HTTP_PORT BRIDGE_COMMAND ...

The log is one of `tagalong simulate`. Its images, calibrations, odometry and tf_static are published in
real time with stamps of now; one packet in a hundred is lost. tf_static, and a `true` for late readers,
are published before the bridge starts; the switch, the callers and a second listener come late. CHECK is
`all`, `camera` for the faults of the camera alone, `managed` for the states of a managed node, or `nav2`
for Nav2's following server as the driver.
"""

import json
import os
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request

# Read when the first participant is created: lost packets, in thousandths, and the time between two
# announcements of a participant. By default they are 8 s apart and count for 10 s, so that the bridge
# forgets a participant, with all that it sends, for six seconds after one is lost.
os.environ["CYCLONEDDS_URI"] = (
    "<CycloneDDS><Domain><Discovery><SPDPInterval>2s</SPDPInterval></Discovery>"
    "<Internal><Test><XmitLossiness>10</XmitLossiness></Test></Internal></Domain></CycloneDDS>"
)

from dataclasses import dataclass  # noqa: E402

from cyclonedds.core import Policy, Qos  # noqa: E402
from cyclonedds.domain import DomainParticipant  # noqa: E402
from cyclonedds.idl import IdlStruct  # noqa: E402
from cyclonedds.idl import types as t  # noqa: E402
from cyclonedds.pub import DataWriter  # noqa: E402
from cyclonedds.sub import DataReader  # noqa: E402
from cyclonedds.topic import Topic  # noqa: E402
from cyclonedds.util import duration  # noqa: E402
from mcap.reader import make_reader  # noqa: E402

import dds_nodes as nodes  # noqa: E402


@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: t.int32
    nanosec: t.uint32


@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: Time
    frame_id: str


@dataclass
class Vector3(IdlStruct, typename="geometry_msgs::msg::dds_::Vector3_"):
    x: t.float64
    y: t.float64
    z: t.float64


@dataclass
class Quaternion(IdlStruct, typename="geometry_msgs::msg::dds_::Quaternion_"):
    x: t.float64
    y: t.float64
    z: t.float64
    w: t.float64


@dataclass
class Pose(IdlStruct, typename="geometry_msgs::msg::dds_::Pose_"):
    position: Vector3
    orientation: Quaternion


@dataclass
class PoseWithCovariance(IdlStruct, typename="geometry_msgs::msg::dds_::PoseWithCovariance_"):
    pose: Pose
    covariance: t.array[t.float64, 36]


@dataclass
class PoseStamped(IdlStruct, typename="geometry_msgs::msg::dds_::PoseStamped_"):
    header: Header
    pose: Pose


@dataclass
class Twist(IdlStruct, typename="geometry_msgs::msg::dds_::Twist_"):
    linear: Vector3
    angular: Vector3


@dataclass
class TwistStamped(IdlStruct, typename="geometry_msgs::msg::dds_::TwistStamped_"):
    header: Header
    twist: Twist


@dataclass
class TwistWithCovariance(IdlStruct, typename="geometry_msgs::msg::dds_::TwistWithCovariance_"):
    twist: Twist
    covariance: t.array[t.float64, 36]


@dataclass
class Odometry(IdlStruct, typename="nav_msgs::msg::dds_::Odometry_"):
    header: Header
    child_frame_id: str
    pose: PoseWithCovariance
    twist: TwistWithCovariance


@dataclass
class Transform(IdlStruct, typename="geometry_msgs::msg::dds_::Transform_"):
    translation: Vector3
    rotation: Quaternion


@dataclass
class TransformStamped(IdlStruct, typename="geometry_msgs::msg::dds_::TransformStamped_"):
    header: Header
    child_frame_id: str
    transform: Transform


@dataclass
class TFMessage(IdlStruct, typename="tf2_msgs::msg::dds_::TFMessage_"):
    transforms: t.sequence[TransformStamped]


@dataclass
class Image(IdlStruct, typename="sensor_msgs::msg::dds_::Image_"):
    header: Header
    height: t.uint32
    width: t.uint32
    encoding: str
    is_bigendian: t.uint8
    step: t.uint32
    data: t.sequence[t.uint8]


@dataclass
class CompressedImage(IdlStruct, typename="sensor_msgs::msg::dds_::CompressedImage_"):
    header: Header
    format: str
    data: t.sequence[t.uint8]


@dataclass
class RegionOfInterest(IdlStruct, typename="sensor_msgs::msg::dds_::RegionOfInterest_"):
    x_offset: t.uint32
    y_offset: t.uint32
    height: t.uint32
    width: t.uint32
    do_rectify: bool


@dataclass
class CameraInfo(IdlStruct, typename="sensor_msgs::msg::dds_::CameraInfo_"):
    header: Header
    height: t.uint32
    width: t.uint32
    distortion_model: str
    d: t.sequence[t.float64]
    k: t.array[t.float64, 9]
    r: t.array[t.float64, 9]
    p: t.array[t.float64, 12]
    binning_x: t.uint32
    binning_y: t.uint32
    roi: RegionOfInterest


@dataclass
class String(IdlStruct, typename="std_msgs::msg::dds_::String_"):
    data: str


@dataclass
class Bool(IdlStruct, typename="std_msgs::msg::dds_::Bool_"):
    data: bool


@dataclass
class Empty(IdlStruct, typename="std_msgs::msg::dds_::Empty_"):
    structure_needs_at_least_one_member: t.uint8


@dataclass
class ObjectHypothesis(IdlStruct, typename="vision_msgs::msg::dds_::ObjectHypothesis_"):
    class_id: str
    score: t.float64


@dataclass
class Hypothesis(IdlStruct, typename="vision_msgs::msg::dds_::ObjectHypothesisWithPose_"):
    hypothesis: ObjectHypothesis
    pose: PoseWithCovariance


@dataclass
class BoundingBox3D(IdlStruct, typename="vision_msgs::msg::dds_::BoundingBox3D_"):
    center: Pose
    size: Vector3


@dataclass
class Detection3D(IdlStruct, typename="vision_msgs::msg::dds_::Detection3D_"):
    header: Header
    results: t.sequence[Hypothesis]
    bbox: BoundingBox3D
    id: str


@dataclass
class Detection3DArray(IdlStruct, typename="vision_msgs::msg::dds_::Detection3DArray_"):
    header: Header
    detections: t.sequence[Detection3D]


@dataclass
class ColorRGBA(IdlStruct, typename="std_msgs::msg::dds_::ColorRGBA_"):
    r: t.float32
    g: t.float32
    b: t.float32
    a: t.float32


@dataclass
class Duration(IdlStruct, typename="builtin_interfaces::msg::dds_::Duration_"):
    sec: t.int32
    nanosec: t.uint32


@dataclass
class Point(IdlStruct, typename="geometry_msgs::msg::dds_::Point_"):
    x: t.float64
    y: t.float64
    z: t.float64


@dataclass
class UVCoordinate(IdlStruct, typename="visualization_msgs::msg::dds_::UVCoordinate_"):
    u: t.float32
    v: t.float32


@dataclass
class MeshFile(IdlStruct, typename="visualization_msgs::msg::dds_::MeshFile_"):
    filename: str
    data: t.sequence[t.uint8]


@dataclass
class Marker(IdlStruct, typename="visualization_msgs::msg::dds_::Marker_"):
    header: Header
    ns: str
    id: t.int32
    type: t.int32
    action: t.int32
    pose: Pose
    scale: Vector3
    color: ColorRGBA
    lifetime: Duration
    frame_locked: bool
    points: t.sequence[Point]
    colors: t.sequence[ColorRGBA]
    texture_resource: str
    texture: CompressedImage
    uv_coordinates: t.sequence[UVCoordinate]
    text: str
    mesh_resource: str
    mesh_file: MeshFile
    mesh_use_embedded_materials: bool


@dataclass
class MarkerArray(IdlStruct, typename="visualization_msgs::msg::dds_::MarkerArray_"):
    markers: t.sequence[Marker]


@dataclass
class Person(IdlStruct, typename="people_msgs::msg::dds_::Person_"):
    name: str
    position: Point
    velocity: Point
    reliability: t.float64
    tagnames: t.sequence[str]
    tags: t.sequence[str]


@dataclass
class People(IdlStruct, typename="people_msgs::msg::dds_::People_"):
    header: Header
    people: t.sequence[Person]


# Services as rmw_cyclonedds carries them: the caller's number goes before the request, and comes back
# before the answer.
@dataclass
class TriggerRequest(IdlStruct, typename="std_srvs::srv::dds_::Trigger_Request_"):
    guid: t.uint64
    number: t.int64
    structure_needs_at_least_one_member: t.uint8


@dataclass
class TriggerResponse(IdlStruct, typename="std_srvs::srv::dds_::Trigger_Response_"):
    guid: t.uint64
    number: t.int64
    success: bool
    message: str


@dataclass
class ParameterValue(IdlStruct, typename="rcl_interfaces::msg::dds_::ParameterValue_"):
    type: t.uint8 = 0
    bool_value: bool = False
    integer_value: t.int64 = 0
    double_value: t.float64 = 0.0
    string_value: str = ""
    byte_array_value: t.sequence[t.uint8] = ()
    bool_array_value: t.sequence[bool] = ()
    integer_array_value: t.sequence[t.int64] = ()
    double_array_value: t.sequence[t.float64] = ()
    string_array_value: t.sequence[str] = ()


@dataclass
class Parameter(IdlStruct, typename="rcl_interfaces::msg::dds_::Parameter_"):
    name: str
    value: ParameterValue


@dataclass
class SetParametersResult(IdlStruct, typename="rcl_interfaces::msg::dds_::SetParametersResult_"):
    successful: bool
    reason: str


@dataclass
class SetParametersRequest(IdlStruct, typename="rcl_interfaces::srv::dds_::SetParameters_Request_"):
    guid: t.uint64
    number: t.int64
    parameters: t.sequence[Parameter]


@dataclass
class SetParametersResponse(
    IdlStruct, typename="rcl_interfaces::srv::dds_::SetParameters_Response_"
):
    guid: t.uint64
    number: t.int64
    results: t.sequence[SetParametersResult]


INPUTS = {
    "/camera/aligned_depth_to_color/camera_info": CameraInfo,
    "/camera/aligned_depth_to_color/image_raw": Image,
    "/camera/color/camera_info": CameraInfo,
    "/camera/color/image_raw/compressed": CompressedImage,
    "/odom": Odometry,
    "/tf_static": TFMessage,
}

CDR = Policy.DataRepresentation(use_cdrv0_representation=True)


def sensor():
    return Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(2), CDR)


def reliable(depth=64):
    wait = duration(seconds=1)
    return Qos(Policy.Reliability.Reliable(wait), Policy.History.KeepLast(depth), CDR)


def latched():
    wait = duration(seconds=1)
    return Qos(
        Policy.Reliability.Reliable(wait),
        Policy.Durability.TransientLocal,
        Policy.History.KeepLast(1),
        CDR,
    )


class Failed(Exception):
    pass


def check(is_so, text):
    if not is_so:
        raise Failed(text)
    print(f"ok: {text}", flush=True)


def wait_for(find, seconds, text):
    """Returns the first answer of `find` that is true."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        found = find()
        if found:
            check(True, text)
            return found
        time.sleep(0.02)
    raise Failed(f"within {seconds} s not: {text}")


class Listener:
    """Collects the messages of a topic with their times."""

    def __init__(self, participant, topic, kind):
        self.kind = kind
        self.reader = DataReader(participant, Topic(participant, topic, kind), qos=reliable())
        self.heard = []
        threading.Thread(target=self.listen, daemon=True).start()

    def listen(self):
        while True:
            now = time.monotonic()
            # A writer that leaves is told by a sample without a message.
            found = [m for m in self.reader.take(64) if isinstance(m, self.kind)]
            self.heard += [(now, message) for message in found]
            time.sleep(0.005)

    def since(self, then):
        return [message for at, message in list(self.heard) if at > then]


class Caller:
    """Calls a service as rmw_cyclonedds does."""

    def __init__(self, participant, service, request, response):
        self.request = request
        topic = Topic(participant, f"rq/{service}Request", request)
        self.writer = DataWriter(participant, topic, qos=reliable())
        self.answers = Listener(participant, f"rr/{service}Reply", response)
        self.number = 0

    def call(self, *content):
        self.number += 1
        guid = 0x1234_5678_9ABC_DEF0

        def answer():
            for message in self.answers.since(0):
                if (message.guid, message.number) == (guid, self.number):
                    return message
            return None

        end = time.monotonic() + 8
        while time.monotonic() < end:
            # The first may come before the server knows this caller; the verbs may come twice.
            self.writer.write(self.request(guid, self.number, *content))
            retry = time.monotonic() + 2.5
            while time.monotonic() < retry:
                if answer():
                    return answer()
                time.sleep(0.02)
        raise Failed(f"no answer to {self.request.__name__} {content}")


class Robot:
    """Publishes the log of a robot in real time."""

    def __init__(self, participant, path):
        self.participant, self.path, self.ends = participant, path, threading.Event()
        # Set while the camera sends its last images again, with their stamps.
        self.repeats = threading.Event()
        self.writers = {}
        for topic, kind in INPUTS.items():
            qos = latched() if topic == "/tf_static" else sensor()
            self.writers[topic] = DataWriter(
                participant, Topic(participant, f"rt{topic}", kind), qos=qos
            )

    def messages(self):
        with open(self.path, "rb") as file:
            reader = make_reader(file)
            for _, channel, message in reader.iter_messages(topics=list(INPUTS)):
                kind = INPUTS[channel.topic]
                yield channel.topic, message.log_time, kind.deserialize(message.data)

    def publish_transforms(self):
        for topic, _, message in self.messages():
            if topic == "/tf_static":
                self.writers[topic].write(message)
                return
        raise Failed("the log has no /tf_static")

    def play(self):
        """Publishes all but the transforms, whatever of it is lost."""
        start, first, sent = time.time(), None, {}
        for topic, log_time, message in self.messages():
            if self.ends.is_set():
                return
            if topic == "/tf_static":
                continue
            first = first or log_time
            due = start + (log_time - first) * 1e-9
            time.sleep(max(0.0, due - time.time()))
            shift = int(start * 1e9) - first
            stamp = message.header.stamp
            nanos = stamp.sec * 1_000_000_000 + stamp.nanosec + shift
            message.header.stamp = Time(nanos // 1_000_000_000, nanos % 1_000_000_000)
            if self.repeats.is_set() and topic != "/odom":
                message = sent[topic]
            sent[topic] = message
            self.writers[topic].write(message)


class Hand:
    """A hand at the deadman's switch, which enables ten times a second while it holds it."""

    def __init__(self, participant):
        def writer(topic, kind):
            return DataWriter(participant, Topic(participant, topic, kind), qos=reliable())

        self.participant = participant
        self.enable = writer("rt/people/enable", Bool)
        self.reset_writer = writer("rt/people/reset", Empty)
        self.holds, self.ends = False, threading.Event()
        self.thread = threading.Thread(target=self.repeat, daemon=True)
        self.thread.start()

    def repeat(self):
        while not self.ends.wait(0.1):
            if self.holds:
                self.enable.write(Bool(True))

    def close(self):
        """Leaves the network."""
        self.ends.set()
        self.thread.join()
        del self.enable, self.reset_writer, self.participant

    def reset(self):
        self.reset_writer.write(Empty(0))

    def switch_off(self):
        self.enable.write(Bool(False))


class Resetter:
    """A publisher of resets alone."""

    def __init__(self, participant):
        self.participant = participant
        topic = Topic(participant, "rt/people/reset", Empty)
        self.writer = DataWriter(participant, topic, qos=reliable())

    def reset(self):
        self.writer.write(Empty(0))

    def close(self):
        del self.writer, self.participant


class OldEnable:
    """A `true` that is kept for readers that come later, written before the bridge starts."""

    def __init__(self, domain):
        self.participant = DomainParticipant(domain)
        topic = Topic(self.participant, "rt/people/enable", Bool)
        self.writer = DataWriter(self.participant, topic, qos=latched())
        self.writer.write(Bool(True))

    def close(self):
        del self.writer, self.participant


CYLINDER, LINE_LIST, TEXT, DELETE_ALL = 3, 5, 9, 3


class Viewer:
    """Hears what RViz draws, and what a planner with a social cost map reads."""

    def __init__(self, participant):
        self.markers = Listener(participant, "rt/people/markers", MarkerArray)
        self.transforms = Listener(participant, "rt/tf", TFMessage)
        self.people = Listener(participant, "rt/people", People)
        self.grids = Listener(participant, "rt/people/forecast", nodes.OccupancyGrid)

    def check(self, tracks):
        """Checks that markers, transforms and people tell of the same people as the tracks."""

        def same_stamp():
            by_stamp = {
                (m.header.stamp.sec, m.header.stamp.nanosec): m
                for m in tracks.since(0)
                if m.detections
            }
            for array in reversed(self.markers.since(0)):
                stamp = array.markers[0].header.stamp
                found = by_stamp.get((stamp.sec, stamp.nanosec))
                kinds = {marker.type for marker in array.markers[1:]}
                if found and {CYLINDER, TEXT, LINE_LIST} <= kinds:
                    return array.markers, found
            return None

        markers, array = wait_for(same_stamp, 5, "markers have a body, a text and a trail")
        ids = sorted(int(detection.id) for detection in array.detections)
        bodies = [m for m in markers if m.ns == "people"]
        check(sorted(m.id for m in bodies) == ids, f"the markers are of the people {ids}")
        check(markers[0].action == DELETE_ALL, "markers of people who are gone are removed")
        check(all(m.lifetime.sec == 1 for m in markers[1:]), "and end by themselves after 1 s")
        check({m.header.frame_id for m in markers} == {"odom"}, "they are in the frame odom")
        texts = [m.text for m in markers if m.type == TEXT]
        check(all(text.endswith(" m") for text in texts), f"with ID and distance: {texts}")
        check(all(1.4 < m.scale.z < 2.1 for m in bodies), "as high as people are")

        moved = [t for m in self.transforms.since(0) for t in m.transforms]
        wanted = {f"person_{n}" for n in ids}
        check(wanted <= {t.child_frame_id for t in moved}, f"transforms to {sorted(wanted)}")
        heads = [t.transform.translation.z for t in moved]
        check(all(1.0 < z < 2.1 for z in heads), "at the height of their heads")

        people = [m for m in self.people.since(0) if m.people]
        check(people[-1].header.frame_id == "odom", "people_msgs/People are in the frame odom")
        known = [person for m in people for person in m.people]
        check({str(n) for n in ids} <= {person.name for person in known}, "of the same names")
        check(all(0.0 < person.reliability <= 1.0 for person in known), "with a reliability")
        speeds = [(p.velocity.x**2 + p.velocity.y**2) ** 0.5 for p in known]
        check(max(speeds) < 3.0, f"and a velocity, at most {max(speeds):.2f} m/s")
        self.check_forecast(people)

    def check_forecast(self, people):
        """Checks that the grid of a costmap has people where they are, and what is not seen unknown."""
        by_stamp = {(m.header.stamp.sec, m.header.stamp.nanosec): m.people for m in people}
        found = []
        for grid in self.grids.since(0):
            stamp = grid.header.stamp
            found += [(grid, person) for person in by_stamp.get((stamp.sec, stamp.nanosec), [])]
        check(len(found) > 10, f"nav_msgs/OccupancyGrid with people: {len(found)}")
        grid = found[-1][0]
        size = (grid.info.width, grid.info.height, round(grid.info.resolution, 3), len(grid.data))
        check(size == (120, 120, 0.1, 14400), f"of cells: {size}")
        check(all(g.header.frame_id == "odom" for g, _ in found), "in the frame odom")
        values = [g.at(p.position.x, p.position.y) for g, p in found]
        check(min(values) > 60, f"occupied where people are: at least {min(values)} %")
        check(all(-1 <= v <= 100 for g, _ in found[-3:] for v in g.data), "from -1 to 100")
        x, y = grid.info.origin.position.x + 0.5, grid.info.origin.position.y + 6.0
        check(grid.at(x, y) == -1, "unknown behind the robot")
        check(0 in grid.data, "and free where nobody comes")


class Http:
    """The HTTP client."""

    def __init__(self, port):
        self.base = f"http://127.0.0.1:{port}"

    def send(self, path, body=None, **headers):
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(f"{self.base}/{path}", data=data, headers=headers)
        if data is not None:
            request.add_header("Content-Type", "application/json")
        try:
            with urllib.request.urlopen(request, timeout=10) as answer:
                return answer.status, json.load(answer)
        except urllib.error.HTTPError as error:
            text = error.read().decode()
            return error.code, json.loads(text) if text.startswith("{") else text

    def is_open(self):
        """Says whether the server takes connections; it opens after the first messages are found."""
        try:
            self.send("status")
        except urllib.error.URLError:
            return False
        return True


def moves(commands):
    return any(c.twist.linear.x != 0.0 or c.twist.angular.z != 0.0 for c in commands)


def run(checks, path, domain, port, command):
    robot = Robot(DomainParticipant(domain), path)
    robot.publish_transforms()
    early = OldEnable(domain)
    bridge = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    said = []
    threading.Thread(target=lambda: said.extend(bridge.stderr), daemon=True).start()
    try:
        listeners = DomainParticipant(domain)
        commands = Listener(listeners, "rt/cmd_vel", TwistStamped)
        states = Listener(listeners, "rt/people/state", String)
        tracks = Listener(listeners, "rt/people/tracks", Detection3DArray)
        viewer = Viewer(listeners)
        threading.Thread(target=robot.play, daemon=True).start()
        http = Http(port)
        server = None
        if checks == "all":
            converse(domain, http, commands, states, tracks, early)
            viewer.check(tracks)
        else:
            early.close()
            hand = Hand(DomainParticipant(domain))
            if checks == "managed":
                manage(domain, hand, http, commands, tracks)
            elif checks == "nav2":
                server = let_nav2_drive(domain, hand, http, commands)
            else:
                start_moving(hand, http, commands)
                repeat_images(robot, http, commands)
        cancelled = len(server.cancelled) if server else 0
        bridge.send_signal(2)
        bridge.wait(timeout=10)
        check(bridge.returncode == 130, "the bridge ends by the signal")
        time.sleep(0.3)
        last = commands.since(0)[-1]
        check(not moves([last]), "the last command is zero")
        if server:
            check(len(server.cancelled) > cancelled, "the goal of Nav2 is cancelled at the end")
        if checks == "all":
            last = viewer.markers.since(0)[-1].markers
            check([m.action for m in last] == [DELETE_ALL], "the last markers remove all people")
    except Exception:
        print("the bridge said:\n" + "".join(said), file=sys.stderr)
        raise
    finally:
        robot.ends.set()
        bridge.kill()


def permission(http):
    return http.send("status")[1]["permission"]


def stands(commands, seconds, text):
    """Checks that no command moves the robot for a while."""
    then = time.monotonic()
    time.sleep(seconds)
    check(not moves(commands.since(then)), text)


def moves_again(commands, text):
    then = time.monotonic()
    wait_for(lambda: moves(commands.since(then)), 8, text)


def reset_until(hand, http, wanted, text):
    """Resets, again because the first may come before the bridge knows its publisher."""

    def is_reset():
        hand.reset()
        time.sleep(0.3)
        return permission(http) == wanted

    wait_for(is_reset, 30, text)


def start_moving(hand, http, commands):
    wait_for(http.is_open, 30, "the HTTP server answers")
    wait_for(lambda: http.send("status")[1]["frames"] > 5, 30, "frames come")
    reset_until(hand, http, "not enabled", "reset, the robot waits for the switch")
    hand.holds = True
    moves_again(commands, "pressed, the robot moves")


def repeat_images(robot, http, commands):
    """The camera sends its last images again while odometry goes on."""
    robot.repeats.set()
    # The validity of a command, a period of the camera and one of the commands.
    time.sleep(0.25 + 0.1 + 0.2)
    stands(commands, 3.0, "images that are sent again move nothing")
    code, health = http.send("healthz")
    check(code == 503 and "no frame for" in health["reason"], f"GET /healthz: {health['reason']}")
    robot.repeats.clear()
    moves_again(commands, "new images, the robot moves")
    check(http.send("healthz")[0] == 200, "GET /healthz: well")


def press_after_reset(hand, http, commands):
    """An enable that goes on through a reset needs a release and a press."""

    def is_off():
        # The first may come before the bridge knows the hand.
        hand.switch_off()
        time.sleep(0.2)
        return permission(http) == "switched off"

    wait_for(is_off, 10, "switched off")
    hand.holds = True
    time.sleep(1.0)
    check(not moves(commands.since(0)), "an enable without a reset moves nothing")
    wanted = "release the enable and press it again"
    reset_until(hand, http, wanted, f"reset while the switch is held: {wanted}")
    stands(commands, 1.0, "which moves nothing")
    hand.holds = False
    wait_for(lambda: permission(http) == "not enabled", 3, "released")
    hand.holds = True
    moves_again(commands, "pressed, the robot moves")


def count_by_source_time(hand, commands):
    """Old enables that arrive now do not count."""
    hand.holds = False
    time.sleep(1.0)
    then = time.monotonic()
    for _ in range(10):
        hand.enable.write(Bool(True), timestamp=time.time_ns() - 3_000_000_000)
        time.sleep(0.1)
    check(not moves(commands.since(then)), "enables of three seconds ago move nothing")
    hand.holds = True
    moves_again(commands, "enables of now do")


def contest(domain, hand, http, commands):
    """A second publisher at the switch, which is silent and then takes over."""
    other = Hand(DomainParticipant(domain))
    cause = "more than one publisher of the enable"
    wait_for(lambda: permission(http) == cause, 10, f"a second, silent publisher: {cause}")
    stands(commands, 0.7, "which is a stop, though the hand holds on")
    hand.holds = False
    other.holds = True
    other.reset()
    stands(commands, 1.5, "the hand lets go, and the other does not drive on")
    check(permission(http) == cause, "nor does a reset help")
    other.close()
    reset_until(hand, http, "not enabled", "the other is gone: reset")
    hand.holds = True
    moves_again(commands, "pressed, the robot moves")


def is_silent(commands, then):
    """Says whether commands ceased after `then`, the last of them zero."""
    told = commands.since(then)
    return told and not moves(told[-1:]) and not commands.since(time.monotonic() - 0.4)


def manage(domain, hand, http, commands, tracks):
    """A manager leads the node through its states."""
    participant = DomainParticipant(domain)
    get = Caller(
        participant, "tagalong/get_state", nodes.GetStateRequest, nodes.GetStateResponse
    )
    kinds = (nodes.ChangeStateRequest, nodes.ChangeStateResponse)
    change = Caller(participant, "tagalong/change_state", *kinds)
    kinds = (nodes.TransitionsRequest, nodes.TransitionsResponse)
    offered = Caller(participant, "tagalong/get_available_transitions", *kinds)
    events = Listener(
        participant, "rt/tagalong/transition_event", nodes.TransitionEvent
    )

    def state():
        return get.call(0).current_state.label

    def to(label, wanted):
        answer = change.call(nodes.Transition(0, label))
        check(answer.success and state() == wanted, f"{label}: {wanted}")

    check(state() == "unconfigured", "the node waits for a manager")
    # The first request may be lost, and each counts once: one that is refused is asked until both know.
    check(not change.call(nodes.Transition(3, "")).success, "which cannot activate it yet")
    to("configure", "inactive")
    ids = [d.transition.id for d in offered.call(0).available_transitions]
    check(ids == [2, 3, 6], f"offered from there: {ids}")
    time.sleep(1.5)
    check(not tracks.since(0) and not commands.since(0), "an inactive node publishes nothing")
    check(http.send("healthz")[1]["reason"] == "the node is inactive", "GET /healthz: inactive")
    to("activate", "active")
    start_moving(hand, http, commands)
    then = time.monotonic()
    to("deactivate", "inactive")
    wait_for(lambda: is_silent(commands, then), 3, "zero, and then no command")
    to("activate", "active")
    stands(commands, 1.0, "an activation alone moves nothing, though the hand holds on")
    hand.holds = False
    reset_until(hand, http, "not enabled", "reset")
    hand.holds = True
    moves_again(commands, "pressed, the robot moves")
    to("deactivate", "inactive")
    to("cleanup", "unconfigured")
    to("configure", "inactive")
    to("activate", "active")
    hand.holds = False
    start_moving(hand, http, commands)
    then = time.monotonic()
    to("shutdown", "finalized")
    wait_for(lambda: is_silent(commands, then), 3, "zero, and then no command")
    passed = [event.transition.id for event in events.since(0)]
    wanted = [1, 10, 3, 30, 4, 40, 3, 30, 4, 40, 2, 20, 1, 10, 3, 30, 7, 50]
    check(passed == wanted, f"each transition is told: {passed}")


def let_nav2_drive(domain, hand, http, commands):
    """Nav2's following server has a goal while the hand holds the switch."""
    participant = DomainParticipant(domain)

    def reader(topic, kind):
        return DataReader(participant, Topic(participant, topic, kind), qos=reliable())

    def writer(topic, kind):
        return DataWriter(participant, Topic(participant, topic, kind), qos=reliable())

    server = nodes.FollowingServer(reader, writer)

    def goal():
        return http.send("status")[1]["nav2"]

    wait_for(http.is_open, 30, "the HTTP server answers")
    wait_for(lambda: http.send("status")[1]["frames"] > 5, 30, "frames come")
    wait_for(goal, 20, "the action FollowObject is found")
    reset_until(hand, http, "not enabled", "reset, Nav2 waits for the switch")
    check(not server.asked, "no goal before a press")
    for turn in range(2):
        hand.holds = True
        wait_for(lambda: len(server.asked) == turn + 1, 10, "pressed: it has a goal")
        wait_for(lambda: goal()["state"] == "drives", 5, "Nav2 drives")
        time.sleep(0.3)
        then = time.monotonic()
        time.sleep(0.7)
        check(not commands.since(then), "and nobody else")
        then = time.monotonic()
        hand.holds = False
        wait_for(lambda: len(server.cancelled) == turn + 1, 5, "released: cancelled")
        late = server.cancelled[-1] - then
        check(late < 1.0, f"after {late:.2f} s, of which an enable holds 0.5")
        wait_for(lambda: goal()["state"] == "no goal", 5, "which is confirmed")
        check(len(commands.since(then)) > 0, "zeros go out")
    check(server.asked == ["/people/target_pose"] * 2, "the goals are the pose of the target")
    fail_nav2(server, hand, http, goal, commands)
    hand.holds = True
    wait_for(lambda: goal()["state"] == "drives", 10, "pressed: Nav2 drives")
    count = len(server.cancelled)
    hand.switch_off()
    wait_for(lambda: len(server.cancelled) > count, 2, "switched off: cancelled")
    hand.holds = False
    reset_until(hand, http, "not enabled", "reset")
    hand.holds = True
    wait_for(lambda: goal()["state"] == "drives", 10, "pressed: Nav2 drives")
    check(not moves(commands.since(0)), "the bridge itself moves nothing")
    return server


def fail_nav2(server, hand, http, goal, commands):
    """The following server refuses, gives up, falls silent, and is deaf."""

    def press(mode):
        hand.holds = False
        wait_for(lambda: goal()["state"] == "no goal", 5, "released")
        server.mode, count = mode, len(server.asked)
        hand.holds = True
        wait_for(lambda: len(server.asked) > count, 10, f"pressed: a server that {mode} is asked")

    for mode, reason in (
        ("refuses", "Nav2 refuses the goal"),
        ("aborts", "it does not detect the person (902), after 0 retries: no pose"),
        ("is silent", "no feedback from Nav2"),
    ):
        press(mode)
        wait_for(lambda: goal()["state"] == "goal ended", 6, "the goal ends")
        check(reason in goal()["reason"], goal()["reason"])
        count = len(server.asked)
        time.sleep(1.0)
        check(len(server.asked) == count, "and no other is given, though the hand holds on")
    press("obeys")
    wait_for(lambda: goal()["state"] == "drives", 5, "Nav2 drives")
    server.mode = "is deaf"
    hand.holds = False
    wait_for(lambda: goal()["is_unconfirmed"], 5, "a cancellation is not confirmed")
    # Longer than zeros go on after one that is.
    time.sleep(2.5)
    check(commands.since(time.monotonic() - 0.3), "zeros go on")
    code, health = http.send("healthz")
    check(code == 503 and "does not confirm" in health["reason"], f"GET /healthz: {health['reason']}")
    server.mode = "obeys"
    wait_for(lambda: goal()["state"] == "no goal", 5, "it is repeated, and confirmed")
    time.sleep(0.5)
    check(not commands.since(time.monotonic() - 0.3), "zeros end")


def converse(domain, http, commands, states, tracks, early):
    found = wait_for(
        lambda: [m for m in tracks.since(0) if m.detections], 25, "people are tracked"
    )
    place = found[0].detections[0].bbox.center.position
    check(1.5 < place.x < 4.5 and abs(place.y) < 1.0, f"where they are: {place.x:.2f} m ahead")
    wait_for(lambda: states.since(0), 5, "states are told")
    check(commands.since(0) == [], "no command before the switch allows it")

    operator = Resetter(DomainParticipant(domain))
    reset_until(operator, http, "not enabled", "a `true` from before the bridge is no enable")
    time.sleep(1.0)
    check(commands.since(0) == [], "and moves nothing after a reset")
    early.close()
    operator.close()

    # The participants of the switch, of the callers and of a second listener come only now.
    late = DomainParticipant(domain)
    hand = Hand(late)
    late_tracks = Listener(late, "rt/people/tracks", Detection3DArray)
    trigger = (TriggerRequest, TriggerResponse)
    status = Caller(late, "people/status", *trigger)
    enroll = Caller(late, "people/enroll", SetParametersRequest, SetParametersResponse)
    clear = Caller(late, "people/clear", *trigger)
    wait_for(lambda: late_tracks.since(0), 5, "a listener that came late hears tracks")
    press_after_reset(hand, http, commands)
    count_by_source_time(hand, commands)
    contest(domain, hand, http, commands)

    code, health = http.send("healthz")
    check((code, health["ok"]) == (200, True), "GET /healthz: well")
    code, data = http.send("status")
    check(code == 200 and data["follows"], f"GET /status: {data['state']}, {data['reason']}")
    people = [person["track"] for person in data["people"]]
    check(data["track"] in people and data["distance_m"] > 1.0, "with the person and the distance")

    code, answer = http.send("clear", {})
    check((code, answer) == (200, {"ok": True}), "POST /clear")
    wait_for(lambda: http.send("status")[1]["reason"] == "cleared", 3, "cleared")
    time.sleep(2.0)
    then = time.monotonic()
    time.sleep(0.5)
    check(commands.since(then) and not moves(commands.since(then)), "after it the robot stands")
    code, answer = http.send("enroll", {"person": {"track": 4711}})
    check(code == 409 and "no track 4711" in answer["reason"], f"refused: {answer['reason']}")
    code, answer = http.send("enroll", {"person": "somebody"})
    check(code == 400, "no request of the skill: refused")
    code, _ = http.send("clear", {}, Host="evil.example")
    check(code == 403, "of another host: refused")

    left, top, width, height = http.send("status")[1]["people"][0]["box"]
    point = [max(1.0, left + 0.5 * width), max(1.0, top + 0.3 * height)]
    code, answer = http.send("enroll", {"person": {"point": point}})
    check(code == 200, f"POST /enroll the person at a point: {answer}")
    wait_for(lambda: moves(commands.since(then + 0.6)), 5, "the robot moves again")

    answer = status.call(0)
    check(answer.success and '"state"' in answer.message, "service people/status")
    check(clear.call(0).success, "service people/clear")
    wrong = Parameter("track", ParameterValue(type=2, integer_value=4711))
    result = enroll.call([wrong]).results[0]
    check(not result.successful and "4711" in result.reason, f"refused: {result.reason}")
    nearest = Parameter("person", ParameterValue(type=4, string_value="nearest"))
    check(enroll.call([nearest]).results[0].successful, "service people/enroll")
    then = time.monotonic()
    wait_for(lambda: moves(commands.since(then)), 5, "and the robot follows")

    hand.switch_off()
    time.sleep(0.5)
    then = time.monotonic()
    time.sleep(1.0)
    check(not moves(commands.since(then)), "a false latches, though true is repeated")


def main():
    checks, path, domain, port, *command = sys.argv[1:]
    try:
        run(checks, path, int(domain), int(port), command)
    except Failed as error:
        sys.exit(f"FAILED: {error}")


main()
