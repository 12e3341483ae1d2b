"""Starts the bridge beside a robot that runs plain ROS 2; needs the package `launch` alone.

    ros2 launch ./bridges/ros2/launch/follow.launch.py config:=configs/follow-depth.toml

`program` is the path of the bridge; in a workspace that colcon built, that of the workspace is found:

    ros2 launch tagalong_ros2 follow.launch.py config:=my-robot.toml

With `nav2:=true` its commands go to
`cmd_vel_nav`, for Nav2's collision monitor or a multiplexer to pass on.
"""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess
from launch.conditions import IfCondition, UnlessCondition
from launch.substitutions import LaunchConfiguration

# This file is share/tagalong_ros2/launch/follow.launch.py where colcon installed it.
SHARE = Path(__file__).resolve().parents[1]
INSTALLED = SHARE.parents[1] / "lib" / "tagalong_ros2" / "tagalong-ros2"
PROGRAM = str(INSTALLED) if INSTALLED.exists() else "tagalong-ros2"
CONFIGS = SHARE / "configs" if INSTALLED.exists() else Path("configs")

ARGUMENTS = {
    "program": (PROGRAM, "path of the program"),
    "config": (str(CONFIGS / "follow-depth.toml"), "config of the pipeline"),
    "namespace": ("/", "namespace of the robot"),
    "command_type": ("twist-stamped", "twist-stamped (Jazzy), or twist (Humble)"),
    "http": ("127.0.0.1:8080", "address of HTTP with JSON on this computer"),
    "clock": ("system", "system, or arrival for simulated time and replayed bags"),
    "nav2": ("false", "true to let Nav2 pass the commands on"),
}


def bridge(condition, *more):
    words = [LaunchConfiguration("program"), LaunchConfiguration("config")]
    for name in ("namespace", "command_type", "http", "clock"):
        words += ["--" + name.replace("_", "-"), LaunchConfiguration(name)]
    # Interrupted with the launch, it tells the wheels to stop.
    return ExecuteProcess(cmd=words + list(more), output="screen", condition=condition)


def generate_launch_description():
    nav2 = LaunchConfiguration("nav2")
    arguments = [
        DeclareLaunchArgument(name, default_value=default, description=text)
        for name, (default, text) in ARGUMENTS.items()
    ]
    return LaunchDescription(
        arguments
        + [
            bridge(UnlessCondition(nav2)),
            bridge(IfCondition(nav2), "--command", "cmd_vel_nav"),
        ]
    )
