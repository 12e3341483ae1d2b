"""Starts the bridge beside a robot that runs plain ROS 2; needs the package `launch` alone.

    ros2 launch ./bridges/ros2/launch/follow.launch.py config:=configs/follow-depth.toml

`program` is the path of the bridge; in a workspace that colcon built, that of the workspace is found:

    ros2 launch tagalong_ros2 follow.launch.py config:=my-robot.toml

With `nav2:=true` its commands go to `cmd_vel_nav`, for Nav2's collision monitor or a multiplexer to pass
on. All other options of the bridge go into `options`, as one text:

    ros2 launch ... options:="--serve=8081 --rmw rmw_cyclonedds_cpp --colour /camera/image_raw"

With `rviz:=true` RViz starts, too; `image` and `scan` are the topics that it shows:

    ros2 launch ... rviz:=true image:=/oakd/rgb/image_raw
"""

import shlex
from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess, OpaqueFunction
from launch.substitutions import LaunchConfiguration

# This file is share/tagalong_ros2/launch/follow.launch.py where colcon installed it.
SHARE = Path(__file__).resolve().parents[1]
INSTALLED = SHARE.parents[1] / "lib" / "tagalong_ros2" / "tagalong-ros2"
PROGRAM = str(INSTALLED) if INSTALLED.exists() else "tagalong-ros2"
CONFIGS = SHARE / "configs" if INSTALLED.exists() else Path("configs")
RVIZ = SHARE / "rviz" / "tagalong.rviz"

ARGUMENTS = {
    "program": (PROGRAM, "path of the program"),
    "config": (str(CONFIGS / "follow-depth.toml"), "config of the pipeline"),
    "namespace": ("/", "namespace of the robot"),
    "command_type": ("twist-stamped", "twist-stamped (Jazzy), or twist (Humble)"),
    "http": ("127.0.0.1:8080", "address of HTTP with JSON on this computer"),
    "clock": ("system", "system, or arrival for simulated time and replayed bags"),
    "nav2": ("false", "true to let Nav2 pass the commands on"),
    "rviz": ("false", "true to start RViz as well"),
    "image": ("/camera/color/image_raw", "topic of the image in RViz"),
    "scan": ("/scan", "topic of the laser scan in RViz"),
    "options": ("", "further options of the bridge, as in a shell"),
}

# Arguments that are options of the bridge, by the same names.
NAMED = ("namespace", "command_type", "http", "clock")

# Topics in the file of RViz: those of sensors, by argument, and those of the bridge, which lie in its
# namespace.
SENSORS = {"image": "/camera/color/image_raw", "scan": "/scan"}
PEOPLE = ("/people/markers", "/people/target_pose", "/people/forecast")


def command(value):
    """Returns the words that start the bridge; `value` returns that of an argument."""
    words = [value("program"), value("config")]
    for name in NAMED:
        words += ["--" + name.replace("_", "-"), value(name)]
    if value("nav2").lower() in ("true", "1"):
        words += ["--command", "cmd_vel_nav"]
    return words + shlex.split(value("options"))


def viewer(value):
    """Returns the words that start RViz with the topics of this robot."""
    remapped = {topic: value(name) for name, topic in SENSORS.items()}
    namespace = value("namespace").strip("/")
    if namespace:
        remapped.update({topic: f"/{namespace}{topic}" for topic in PEOPLE})
    words = ["rviz2", "-d", str(RVIZ), "--ros-args"]
    for topic, name in remapped.items():
        words += ["-r", f"{topic}:={name}"]
    return words


def processes(context):
    def value(name):
        return LaunchConfiguration(name).perform(context)

    # Interrupted with the launch, it tells the wheels to stop.
    started = [ExecuteProcess(cmd=command(value), output="screen")]
    if value("rviz").lower() in ("true", "1"):
        started.append(ExecuteProcess(cmd=viewer(value), output="screen"))
    return started


def generate_launch_description():
    arguments = [
        DeclareLaunchArgument(name, default_value=default, description=text)
        for name, (default, text) in ARGUMENTS.items()
    ]
    return LaunchDescription(arguments + [OpaqueFunction(function=processes)])
