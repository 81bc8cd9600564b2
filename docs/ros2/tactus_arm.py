#!/usr/bin/env python3
"""A ROS 2 node between a probe with the firmware `tactus-arm` and an arm that moveit_servo moves.

It is an example and is not built or run by this repository's checks: what is of your arm is marked so.

usage: tactus_arm.py [--ros-args -p port:=/dev/ttyACM0]

It calls the service of `moveit_servo` that takes twists (geometry_msgs/TwistStamped on /servo_node/delta_twist_cmds), reads where the finger is
from tf, and publishes what the probe says as JSON on /tactus/report.
"""

import json
import threading

import rclpy
from geometry_msgs.msg import TwistStamped
from rclpy.node import Node
from rclpy.time import Time
from std_msgs.msg import String
from tf2_ros import Buffer, TransformListener

import tactus

# of your arm: the finger's frame, and the sample's, with x along it and z up from its top
FINGER, SAMPLE = "tactus_finger", "tactus_sample"
SAFE_MM, LIFTS_MM_S, MOVES_MM_S, MARGIN_MM, SAMPLE_MM = 8.0, 30.0, 60.0, 2.0, 75.0


class Arm(tactus.Rig, Node):
    def __init__(self):
        super().__init__("tactus_arm")
        self.port = self.declare_parameter("port", "/dev/ttyACM0").value
        self.twists = self.create_publisher(TwistStamped, "/servo_node/delta_twist_cmds", 1)
        self.reports = self.create_publisher(String, "/tactus/report", 100)
        self.tf = Buffer()
        self.listener = TransformListener(self.tf, self)
        self.rate = self.create_rate(100)

    def go(self, along=0.0, up=0.0):
        twist = TwistStamped()
        twist.header.stamp = self.get_clock().now().to_msg()
        twist.header.frame_id = SAMPLE
        twist.twist.linear.x, twist.twist.linear.z = along / 1e3, up / 1e3
        self.twists.publish(twist)

    def wait(self):
        """The next hundredth of a second: time (s), place and height (mm)."""
        self.rate.sleep()
        self.alive()
        at = self.tf.lookup_transform(SAMPLE, FINGER, Time())
        where, stamp = at.transform.translation, at.header.stamp
        return stamp.sec + stamp.nanosec * 1e-9, where.x * 1e3, where.z * 1e3

    def press(self, movement):
        speed, length = movement["speed_um_s"] / 1e3, movement["length_um"] / 1e3
        room = max(SAMPLE_MM - 2 * MARGIN_MM - length - 0.2 * speed, 0.0)
        begin = MARGIN_MM + room * movement["start"] / 1e3
        _, x, height = self.wait()
        while abs(begin - x) > 0.2 or height < SAFE_MM:
            self.go(max(-MOVES_MM_S, min(MOVES_MM_S, 5 * (begin - x))), LIFTS_MM_S if height < SAFE_MM else 0.0)
            _, x, height = self.wait()
        wanted, fastest, right = movement["force_mn"] / 1e3, movement["approach_um_s"] / 1e3, 0
        while right < 10:
            missing = wanted - self.force_n
            right = right + 1 if abs(missing) < 0.03 * wanted + 0.006 else 0
            down = fastest if self.force_n < 0.03 else max(-fastest, min(fastest, 1.5 * missing))
            self.go(0.0, 0.0 if right else -down)
            self.wait()
        self.go()

    def slide(self, movement):
        speed, length = movement["speed_um_s"] / 1e3, movement["length_um"] / 1e3
        since, before = self.wait()[:2]
        while True:
            self.go(speed)
            at, x, _ = self.wait()
            if at > since and abs((x - before) / (at - since) - speed) < 0.03 * speed:
                break
            since, before = at, x
        self.steady()
        began, begin = at, x
        while x - begin < length:
            self.go(speed)
            at, x, _ = self.wait()
        self.go()
        for _ in range(20):
            self.wait()
        return x - begin, (x - begin) / (at - began)

    def lift(self):
        while self.wait()[2] < SAFE_MM:
            self.go(0.0, LIFTS_MM_S)
        self.go()

    def stop(self):
        # of your arm: its protective stop, if it has a service for that
        self.go()


def main():
    rclpy.init()
    arm = Arm()
    threading.Thread(target=rclpy.spin, args=(arm,), daemon=True).start()
    with tactus.Probe(arm.port) as probe:
        for report in arm.drive(probe, probe.identify()):
            arm.reports.publish(String(data=json.dumps(report)))
    rclpy.shutdown()


if __name__ == "__main__":
    main()
