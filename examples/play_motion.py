#!/usr/bin/env python3
"""Plays a motion of `proprio excite` on a Unitree Go2 and records a log. Documentation: read examples/README.md first.

    pip install unitree_sdk2py
    ./play_motion.py eth0 motion.csv log.csv --scale 0.2
"""

import argparse
import csv
import math
import signal
import threading
import time

from unitree_sdk2py.core.channel import ChannelFactoryInitialize, ChannelPublisher, ChannelSubscriber
from unitree_sdk2py.idl.default import unitree_go_msg_dds__LowCmd_
from unitree_sdk2py.idl.unitree_go.msg.dds_ import LowCmd_, LowState_
from unitree_sdk2py.utils.crc import CRC

JOINTS = [f"{leg}_{joint}" for leg in ("FR", "FL", "RR", "RL") for joint in ("hip", "thigh", "calf")]
LOWER = {"hip": -1.0472, "thigh": -1.5708, "calf": -2.7227}
UPPER = {"hip": 1.0472, "thigh": 4.5379, "calf": -0.83776}
PERIOD = 0.002  # s
RAMP, HOLD, SOFT_STOP = 3.0, 1.0, 1.0  # s
STALE, ASTRAY, HOT = 0.02, 0.4, 75.0  # s, rad, degrees Celsius
DAMPING = 2.0  # N m s/rad, what is left after a soft stop


def read(path):
    """Rows of the motion, and the indices of the joints it moves."""
    with open(path, newline="") as file:
        rows = [{name: float(value) for name, value in row.items()} for row in csv.DictReader(file)]
    moved = [n for n, joint in enumerate(JOINTS) if f"q/{joint}" in rows[0]]
    return rows, moved


class Robot:
    """The latest state, and one command for all joints."""

    def __init__(self, interface):
        ChannelFactoryInitialize(0, interface)
        self.lock, self.state, self.stamp = threading.Lock(), None, 0.0
        self.publisher = ChannelPublisher("rt/lowcmd", LowCmd_)
        self.publisher.Init()
        self.subscriber = ChannelSubscriber("rt/lowstate", LowState_)
        self.subscriber.Init(self.receive, 10)
        self.crc, self.command = CRC(), unitree_go_msg_dds__LowCmd_()
        self.command.head[0], self.command.head[1] = 0xFE, 0xEF
        self.command.level_flag = 0xFF
        for motor in self.command.motor_cmd:
            motor.mode, motor.q, motor.dq, motor.kp, motor.kd, motor.tau = 0x01, 2.146e9, 16000.0, 0.0, 0.0, 0.0

    def receive(self, state):
        with self.lock:
            self.state, self.stamp = state, time.monotonic()

    def latest(self):
        with self.lock:
            return self.state, time.monotonic() - self.stamp

    def send(self, joint, q, dq, kp, kd, tau):
        motor = self.command.motor_cmd[joint]
        motor.q, motor.dq, motor.kp, motor.kd, motor.tau = q, dq, kp, kd, tau

    def publish(self):
        self.command.crc = self.crc.Crc(self.command)
        self.publisher.Write(self.command)


def fault(state, age, moved, wanted):
    """Why to stop, or None."""
    if state is None or age > STALE:
        return f"no state for {1e3 * age:.0f} ms"
    for n, q in zip(moved, wanted):
        motor, kind = state.motor_state[n], JOINTS[n].split("_")[1]
        # Asked so that what is not a number stops too.
        if not abs(motor.q - q) <= ASTRAY:
            return f"{JOINTS[n]} is {motor.q - q:+.2f} rad from where it should be"
        if not LOWER[kind] - 0.02 < motor.q < UPPER[kind] + 0.02:
            return f"{JOINTS[n]} is beyond its limits"
        if motor.temperature > HOT:
            return f"{JOINTS[n]} is at {motor.temperature} degrees"
    return None


def soft_stop(robot, moved, wanted, gains):
    """From position control to damping alone within SOFT_STOP, then damping for as long again."""
    begun = time.monotonic()
    while (elapsed := time.monotonic() - begun) < 2 * SOFT_STOP:
        share = max(0.0, 1.0 - elapsed / SOFT_STOP)
        for n, q, (kp, kd) in zip(moved, wanted, gains):
            robot.send(n, q, 0.0, share * kp, max(kd, DAMPING), 0.0)
        robot.publish()
        time.sleep(PERIOD)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("interface")
    parser.add_argument("motion")
    parser.add_argument("log")
    parser.add_argument("--scale", type=float, default=1.0, help="share of the motion about its first pose")
    arguments = parser.parse_args()
    # A larger motion than the one designed would be beyond the limits.
    if not 0.0 < arguments.scale <= 1.0:
        parser.error("--scale must be above 0 and at most 1")
    rows, moved = read(arguments.motion)
    names = [JOINTS[n] for n in moved]
    start = [rows[0][f"q/{joint}"] for joint in names]
    gains = [(rows[0][f"kp/{joint}"], rows[0][f"kd/{joint}"]) for joint in names]

    robot = Robot(arguments.interface)
    while robot.latest()[0] is None:
        time.sleep(0.1)
    here = [robot.latest()[0].motor_state[n].q for n in moved]
    stop = threading.Event()
    signal.signal(signal.SIGINT, lambda *_: stop.set())

    def asked(t):
        """Position, velocity and feed-forward of each joint at t seconds; None after the end."""
        if t < RAMP + HOLD:
            share = 0.5 - 0.5 * math.cos(math.pi * min(t / RAMP, 1.0))
            return [(a + (b - a) * share, 0.0, 0.0) for a, b in zip(here, start)]
        row = round((t - RAMP - HOLD) / PERIOD)
        if row >= len(rows):
            return None
        s = arguments.scale
        own = rows[row]
        # A smaller motion needs less torque by an unknown amount: feed-forward only at full size.
        tau = 1.0 if s == 1.0 else 0.0
        return [(q0 + s * (own[f"q/{j}"] - q0), s * own[f"dq/{j}"], tau * own[f"tau/{j}"]) for j, q0 in zip(names, start)]

    with open(arguments.log, "w", newline="") as file:
        log = csv.writer(file)
        log.writerow(["t"] + [f"{c}/{j}" for c in ("q", "dq", "tau", "q_des", "temp") for j in names])
        begun, wanted, last = time.monotonic(), here, None
        while not stop.is_set():
            t = time.monotonic() - begun
            command = asked(t)
            if command is None:
                break
            wanted = [q for q, _, _ in command]
            state, age = robot.latest()
            if why := fault(state, age, moved, wanted):
                print(f"stopping: {why}")
                break
            for n, (q, dq, tau), (kp, kd) in zip(moved, command, gains):
                robot.send(n, q, dq, kp, kd, tau)
            robot.publish()
            # A state that was seen already is no new sample.
            if t > RAMP + HOLD and state.tick != last:
                last = state.tick
                motors = [state.motor_state[n] for n in moved]
                log.writerow([f"{state.tick * 1e-3:.3f}"] + [m.q for m in motors] + [m.dq for m in motors]
                             + [m.tau_est for m in motors] + wanted + [m.temperature for m in motors])
            time.sleep(max(0.0, PERIOD - (time.monotonic() - begun - t)))
    soft_stop(robot, moved, wanted, gains)


if __name__ == "__main__":
    main()
