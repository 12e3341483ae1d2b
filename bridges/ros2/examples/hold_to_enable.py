#!/usr/bin/env python3
"""Enables the robot while a button of a gamepad is held: a deadman's switch.

    ros2 run joy joy_node                                          # on the same machine
    python3 bridges/ros2/examples/hold_to_enable.py --ros-args -p button:=4

On a TurtleBot 4 buttons 4 and 5 are those of its own teleoperation, and its joy node runs already: take
`-p button:=6` (L2) and leave out the first line.

It publishes nothing while the button is free: the robot stands then, and goes on with the next press
(after a reset, if it was stopped). joy_node repeats the state of the gamepad; what is older than 0.2 s
enables nothing. Before a ride hold the button, and pull the cable or the battery of the gamepad: the
robot must stand. Some wireless gamepads go on to report their last state: take none of these.
"""

import rclpy
from rclpy.node import Node
from sensor_msgs.msg import Joy
from std_msgs.msg import Bool

OLDEST_S = 0.2


class HoldToEnable(Node):
    def __init__(self):
        super().__init__("hold_to_enable")
        self.button = self.declare_parameter("button", 4).value
        self.enable = self.create_publisher(Bool, "people/enable", 1)
        self.create_subscription(Joy, "joy", self.heard, 1)

    def heard(self, joy):
        stamp_s = joy.header.stamp.sec + joy.header.stamp.nanosec * 1e-9
        age_s = self.get_clock().now().nanoseconds * 1e-9 - stamp_s
        is_held = self.button < len(joy.buttons) and joy.buttons[self.button] == 1
        if is_held and abs(age_s) < OLDEST_S:
            self.enable.publish(Bool(data=True))


rclpy.init()
rclpy.spin(HoldToEnable())
