from collections.abc import Iterator, Sequence
from os import PathLike
from typing import Any, Optional, Union, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

__version__: str

_Path = Union[str, PathLike[str]]
_Stamp = Union[int, float]
_Pose = Union[Sequence[float], NDArray[np.float64]]

class TagalongError(RuntimeError): ...
class ConfigError(ValueError): ...

@final
class Camera:
    """A pinhole camera: its image, its lens and its pose on the robot.

    width, height: pixels. fx, fy, cx, cy: pixels; (0, 0) is the centre of the upper left pixel.
    distortion: the coefficients of OpenCV for `model`, one of "plumb_bob",
    "rational_polynomial", "equidistant". The pose is either `height_m` above the floor with
    `pitch_down_deg` and `roll_deg`, looking forward, or `robot_from_camera`, 4 x 4: x right, y down,
    z forward of the camera in the robot's frame (x forward, y left, z up from the floor).
    """
    def __new__(
        cls,
        width: int,
        height: int,
        *,
        fx: float,
        fy: Optional[float] = None,
        cx: Optional[float] = None,
        cy: Optional[float] = None,
        distortion: Optional[Sequence[float]] = None,
        model: str = "plumb_bob",
        height_m: Optional[float] = None,
        pitch_down_deg: float = 0.0,
        roll_deg: float = 0.0,
        robot_from_camera: Optional[ArrayLike] = None,
    ) -> Camera: ...
    @property
    def width(self) -> int:
        """Columns of the image."""
    @property
    def height(self) -> int:
        """Rows of the image."""
    @property
    def focal_px(self) -> float:
        """Focal length along columns, pixels; for a panorama pixels per radian."""
    @property
    def robot_from_camera(self) -> NDArray[np.float64]:
        """Pose of the camera in the robot frame, 4 x 4."""
    def project(self, point: Sequence[float]) -> Optional[tuple[float, float]]:
        """Pixel (column, row) of a point in the robot frame, m; None behind the camera."""

@final
class Track:
    """A tracked person in one frame. Lengths are metres in the robot's frame: x forward, y left, z up."""
    @property
    def id(self) -> int:
        """ID of the track, never used twice."""
    @property
    def position(self) -> NDArray[np.float64]:
        """Centre of the head, (x, y, z), m."""
    @property
    def velocity(self) -> NDArray[np.float64]:
        """Velocity over ground in robot axes, (vx, vy), m/s."""
    @property
    def covariance(self) -> NDArray[np.float64]:
        """Covariance of (x, y, z, vx, vy), 5 x 5."""
    @property
    def box(self) -> Optional[tuple[float, float, float, float]]:
        """Upper-body square, clipped to the image: (x, y, width, height), pixels with (0, 0) at the
        upper left corner; None outside.
        """
    @property
    def joints(self) -> Optional[dict[str, tuple[float, float, float]]]:
        """Joints in the image by their names in COCO (`left_wrist`), each (x, y, score), pixels and 0 to 1;
        None unless a detector of this frame found them.
        """
    @property
    def body_direction(self) -> Optional[float]:
        """Direction in which the body is turned, rad from the x axis of the robot frame to the left;
        None if the joints do not show it.
        """
    @property
    def raised_hand(self) -> Optional[bool]:
        """True if a hand is held above the head; None without joints."""
    @property
    def score(self) -> float:
        """Probability that this is a person, smoothed over the track; `score` in Rust is its log-odds."""
    @property
    def seen(self) -> bool:
        """True if the track has evidence in this frame; otherwise it is predicted, with growing
        uncertainty, even outside of the view.
        """
    @property
    def confirmed(self) -> bool:
        """True once the track is reported."""
    @property
    def occluded(self) -> bool:
        """True if a nearer tracked person hides this one."""
    @property
    def age(self) -> int:
        """Number of frames since the track started."""
    @property
    def unseen_s(self) -> float:
        """Time since the track last had evidence, s."""

@final
class Command:
    """A velocity for the robot, with its reason and the time until which it is valid."""
    @property
    def linear_mps(self) -> float:
        """Forward speed, m/s."""
    @property
    def lateral_mps(self) -> float:
        """Speed to the left, m/s."""
    @property
    def angular_rps(self) -> float:
        """Turn rate, rad/s, positive to the left."""
    @property
    def wheels_mps(self) -> tuple[float, float]:
        """Speeds of the wheels of a differential drive, (left, right), m/s."""
    @property
    def stamp_ns(self) -> int:
        """Capture time of the frame to which it responds, ns."""
    @property
    def valid_until_ns(self) -> int:
        """Time at which the wheels stop unless a newer command has arrived, ns."""
    @property
    def reason(self) -> str:
        """Reason for the speeds: "follow", "obstacle", "no-target" and others."""

@final
class Report:
    """Result of a frame."""
    @property
    def index(self) -> int:
        """Index of the frame, from 1."""
    @property
    def stamp_ns(self) -> int:
        """Capture time, ns."""
    @property
    def outcome(self) -> str:
        """"processed", or another outcome because of its stamp: for "duplicate" (the stamp of the
        previous frame) and "out-of-order" (slightly older) the frame was left out; for
        "reset-backward" and "reset-forward" (the clock was set back, or jumped ahead) all tracks
        ended before the frame was processed.
        """
    @property
    def tracks(self) -> list[Track]:
        """The confirmed tracks, nearest first, including predicted ones; see `Track.seen`."""
    @property
    def tentative(self) -> list[Track]:
        """Tracks that are not confirmed yet."""
    @property
    def ended(self) -> list[int]:
        """IDs of the tracks that ended in this frame."""
    @property
    def command(self) -> Optional[Command]:
        """Command for the wheels; None without a controller."""
    @property
    def target(self) -> Optional[int]:
        """ID of the track of the person to follow."""
    @property
    def dropped(self) -> dict[str, int]:
        """Number of candidates that each test dropped."""
    @property
    def timings_ms(self) -> dict[str, float]:
        """Time of each stage, ms."""

@final
class Frame:
    """One moment of a log: images, camera, and the robot's pose."""
    @property
    def index(self) -> int:
        """Index of the image in the log, from 1."""
    @property
    def stamp_ns(self) -> int:
        """Capture time, ns."""
    @property
    def colour(self) -> Optional[NDArray[np.uint8]]:
        """Colour image, rows x columns x 3, or grey image, rows x columns, uint8; None without one."""
    @property
    def depth(self) -> Optional[NDArray[np.float32]]:
        """Depth along the optical axis, m, rows x columns, float32; NaN where there is no reading.
        None without a depth image.
        """
    @property
    def scan(self) -> Optional[NDArray[np.float64]]:
        """Points of the laser scan, rows of x, y, z, m, robot frame; None without a scan."""
    @property
    def camera(self) -> Optional[Camera]:
        """The camera; None for a frame that has only a laser scan."""
    @property
    def pose(self) -> tuple[float, float, float]:
        """Pose of the robot in the odometry frame: x, y (m), heading (rad)."""
    @property
    def pose_is_stale(self) -> bool:
        """True if the pose is a guess, because odometry is silent or has jumped."""
    @property
    def odometry_age_s(self) -> float:
        """Age of the newest odometry at the time of the frame, s; infinite if there never was any."""

@final
class Frames(Iterator[Frame]):
    """Frames of a log, one after the other."""
    def __iter__(self) -> Frames: ...
    def __next__(self) -> Frame: ...
    @property
    def counters(self) -> dict[str, int]:
        """Counters so far: messages that were read, images that were skipped by reason, and damage."""
    @property
    def notes(self) -> list[str]:
        """Remarks about the log."""
    @property
    def data_lost(self) -> bool:
        """True if part of the log could not be used because it is damaged."""

@final
class Pipeline:
    """A pipeline: detectors, verifiers, association, filter, and a controller if the config has one."""
    @staticmethod
    def from_toml(
        source: _Path, *, folder: Optional[_Path] = None, seed: Optional[int] = None
    ) -> Pipeline:
        """Builds a pipeline.

        source: the path of a TOML file, the name of a built-in config ("depth-verified"), or the
        text of a config: a str that contains a line break or a `=`. folder: base folder of relative
        paths in such a text. seed: replaces the seed of the config.

        Raises ConfigError, with the line and the remedy.
        """
    def step(
        self,
        colour: Optional[NDArray[np.uint8]],
        depth: Optional[NDArray[Any]],
        camera: Optional[Camera],
        pose: Optional[_Pose],
        stamp: _Stamp,
        *,
        scan: Optional[NDArray[np.float64]] = None,
        scan_stamp: Optional[_Stamp] = None,
        right: Optional[NDArray[np.uint8]] = None,
        baseline_m: Optional[float] = None,
        index: Optional[int] = None,
        odometry_age_s: Optional[float] = None,
        detections: Optional[ArrayLike] = None,
    ) -> Report:
        """Runs the pipeline on one frame and returns a Report.

        Raises ValueError for a frame that cannot be used, such as one without depth for a pipeline
        that needs it: no command follows from this frame, and the next one is processed as usual.

        colour: uint8, rows x columns x 3 (red, green, blue) or rows x columns. depth: float32 in
        metres or uint16 in millimetres, registered to colour. camera: a Camera with the size of the
        images. pose: pose of the robot in the odometry frame, (x, y, heading) or 4 x 4; None
        without odometry. stamp: capture time, ns as an int or seconds as a float. scan: float64,
        rows of x, y or x, y, z of a laser scan in the robot frame. scan_stamp: time of the scan,
        given like stamp, if the scanner is slower than the images and its last scan is passed again
        [default: stamp]. right, baseline_m: the right image of a rectified stereo pair, and its
        baseline, m. index: index of the frame [default: number of frames so far]. odometry_age_s:
        age of the odometry that the pose comes from, at the time of the stamp; a robot is not
        steered by old odometry [default: 0, and infinite without a pose]. detections: the output of
        your own detector, for a config with the plugin `recorded-detections` ("recorded"): rows of
        x, y, width, height, score, in pixels of the camera's image, or of x, y, z, score, with the
        centre of the head in the robot frame, m; [] if it found no person, None if it did not run.
        """
    def step_frame(self, frame: Frame) -> Report:
        """Runs the pipeline on a frame of `frames`, as the program does."""
    def frames(self, log: _Path) -> Frames:
        """Opens a log (.mcap, .db3, .bag, or the folder of a recording) for this pipeline, with the
        `[input]` of its config, and returns its frames.
        """
    def command_at(self, stamp: _Stamp) -> Optional[Command]:
        """The command in force at a time (given like `stamp` of `step`): the last one until it
        expires, then zero; None without a controller.
        """
    def choose_target(self, track: int) -> None:
        """Follows the person of this track. Raises ValueError without a controller, or if the last
        frame has no such track.
        """
    def disarm(self) -> None:
        """Stops the robot until `arm`."""
    def arm(self) -> None:
        """Lets the robot move again after a fault that a person has checked."""
    def set_driving(self, is_driving: bool) -> None:
        """Sets whether the base executes the commands from now on. Only then are they compared with
        the odometry: a base that does something else, or responds too late, is a fault.
        """
    @property
    def fault(self) -> Optional[str]:
        """The fault that stops the robot until `arm`; None without one."""
    @property
    def has_controller(self) -> bool:
        """True if the config has a controller."""
    @property
    def resolved(self) -> str:
        """The config with every default filled in, as TOML."""

def main(arguments: Sequence[str]) -> int: ...
def run(
    config: Optional[_Path],
    log: _Path,
    out: _Path,
    *,
    overlay: bool,
    with_images: bool,
    smoothed: bool,
    overwrite: bool,
    strict: bool,
    seed: Optional[int],
    camera: Optional[str],
) -> bool: ...
def scores(
    truth: _Path,
    tracks: _Path,
    *,
    similarity: str,
    log: Optional[_Path],
    rate: Optional[float],
    upper_body: bool,
    repairs: bool,
    drop_doubled_ids: bool,
) -> str: ...
