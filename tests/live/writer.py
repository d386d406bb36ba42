"""A robot: publishes rows of a log with CycloneDDS. Prints one JSON object: what it sent, and the topics that others write."""

import argparse
import json
import os
import sys
import time
from dataclasses import dataclass

from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, float32, float64, int8, int16, int32, sequence, uint8, uint16, uint32
from cyclonedds.core import Policy, Qos
from cyclonedds.pub import DataWriter
from cyclonedds.util import duration
from cyclonedds.topic import Topic

from rows import rows


@dataclass
class Imu(IdlStruct, typename="unitree_go.msg.dds_.IMUState_"):
    quaternion: array[float32, 4]
    gyroscope: array[float32, 3]
    accelerometer: array[float32, 3]
    rpy: array[float32, 3]
    temperature: int8


@dataclass
class Motor(IdlStruct, typename="unitree_go.msg.dds_.MotorState_"):
    mode: uint8
    q: float32
    dq: float32
    ddq: float32
    tau_est: float32
    q_raw: float32
    dq_raw: float32
    ddq_raw: float32
    temperature: int8
    lost: uint32
    reserve: array[uint32, 2]


@dataclass
class Bms(IdlStruct, typename="unitree_go.msg.dds_.BmsState_"):
    version_high: uint8
    version_low: uint8
    status: uint8
    soc: uint8
    current: int32
    cycle: uint16
    bq_ntc: array[int8, 2]
    mcu_ntc: array[int8, 2]
    cell_vol: array[uint16, 15]


@dataclass
class LowState(IdlStruct, typename="unitree_go.msg.dds_.LowState_"):
    head: array[uint8, 2]
    level_flag: uint8
    frame_reserve: uint8
    sn: array[uint32, 2]
    version: array[uint32, 2]
    bandwidth: uint16
    imu_state: Imu
    motor_state: array[Motor, 20]
    bms_state: Bms
    foot_force: array[int16, 4]
    foot_force_est: array[int16, 4]
    tick: uint32
    wireless_remote: array[uint8, 40]
    bit_flag: uint8
    adc_reel: float32
    temperature_ntc1: int8
    temperature_ntc2: int8
    power_v: float32
    power_a: float32
    fan_frequency: array[uint16, 4]
    reserve: uint32
    crc: uint32


@dataclass
class HgImu(IdlStruct, typename="unitree_hg.msg.dds_.IMUState_"):
    quaternion: array[float32, 4]
    gyroscope: array[float32, 3]
    accelerometer: array[float32, 3]
    rpy: array[float32, 3]
    temperature: int16


@dataclass
class HgMotor(IdlStruct, typename="unitree_hg.msg.dds_.MotorState_"):
    mode: uint8
    q: float32
    dq: float32
    ddq: float32
    tau_est: float32
    temperature: array[int16, 2]
    vol: float32
    sensor: array[uint32, 2]
    motorstate: uint32
    reserve: array[uint32, 4]


@dataclass
class HgLowState(IdlStruct, typename="unitree_hg.msg.dds_.LowState_"):
    version: array[uint32, 2]
    mode_pr: uint8
    mode_machine: uint8
    tick: uint32
    imu_state: HgImu
    motor_state: array[HgMotor, 35]
    wireless_remote: array[uint8, 40]
    reserve: array[uint32, 4]
    crc: uint32


@dataclass
class Time(IdlStruct, typename="builtin_interfaces.msg.dds_.Time_"):
    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct, typename="std_msgs.msg.dds_.Header_"):
    stamp: Time
    frame_id: str


@dataclass
class JointState(IdlStruct, typename="sensor_msgs.msg.dds_.JointState_"):
    header: Header
    name: sequence[str]
    position: sequence[float64]
    velocity: sequence[float64]
    effort: sequence[float64]


@dataclass
class Other(IdlStruct, typename="other_robot.msg.dds_.LowState_"):
    bytes: array[uint8, 1176]


def low_state(row):
    motors = [Motor(1, q, dq, 0, tau, 0, 0, 0, 30, 0, [0, 0]) for q, dq, tau in zip(row.q, row.dq, row.tau)]
    motors += [Motor(0, 0, 0, 0, 0, 0, 0, 0, 0, 0, [0, 0])] * (20 - len(motors))
    imu = Imu([1, 0, 0, 0], row.gyro, row.acc, [0, 0, 0], 40)
    bms = Bms(0, 0, 0, 0, 0, 0, [0, 0], [0, 0], [0] * 15)
    return LowState(
        [0, 0], 0, 0, [0, 0], [0, 0], 0, imu, motors, bms, row.feet, [0] * 4, row.tick, [0] * 40, 0, 0, 0, 0, 0, 0, [0] * 4, 0, 0
    )


def hg_low_state(row):
    """A humanoid's: its 29 motors move as those of the log, over and over."""
    joints = list(zip(row.q, row.dq, row.tau))
    motors = [HgMotor(1, *joints[n % len(joints)][:2], 0, joints[n % len(joints)][2], [30, 31], 48, [0, 0], 0, [0] * 4) for n in range(29)]
    motors += [HgMotor(0, 0, 0, 0, 0, [0, 0], 0, [0, 0], 0, [0] * 4)] * 6
    imu = HgImu([1, 0, 0, 0], row.gyro, row.acc, [0, 0, 0], 40)
    return HgLowState([0, 0], 0, 5, row.tick, imu, motors, [0] * 40, [0] * 4, 0)


def joint_state(row):
    stamp = Time(row.tick // 1000, row.tick % 1000 * 1_000_000)
    return JointState(Header(stamp, ""), row.names, row.q, row.dq, row.tau)


KINDS = {
    "low_state": ("rt/lowstate", LowState, low_state),
    "hg_low_state": ("rt/lowstate", HgLowState, hg_low_state),
    "joint_state": ("rt/joint_states", JointState, joint_state),
    "other": ("rt/lowstate", Other, lambda row: Other([0] * 1176)),
}


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("log")
    arguments.add_argument("--kind", choices=KINDS, default="low_state")
    arguments.add_argument("--seconds", type=float)
    arguments.add_argument("--domain", type=int, default=0)
    arguments.add_argument("--readers", type=int, default=1)
    arguments.add_argument("--depth", type=int, default=1, help="messages that it keeps, to send them again; ROS 2's writers keep 10")
    asked = arguments.parse_args()
    # A robot is another computer: what else runs on this one does not delay it.
    os.setpriority(os.PRIO_PROCESS, 0, -20)
    topic, kind, message = KINDS[asked.kind]
    participant = DomainParticipant(asked.domain)
    builtin = BuiltinDataReader(participant, BuiltinTopicDcpsPublication)
    quality = Qos(Policy.Reliability.Reliable(duration(milliseconds=100)), Policy.History.KeepLast(asked.depth))
    writer = DataWriter(participant, Topic(participant, topic, kind), qos=quality)
    # Made before the clock runs: Python is slow.
    sent = [row for row in rows(asked.log) if asked.seconds is None or row.tick < 1000 * asked.seconds]
    print("waits", file=sys.stderr, flush=True)
    until = time.time() + 30
    while len(writer.get_matched_subscriptions()) < asked.readers and time.time() < until:
        time.sleep(0.05)
    # The reader may know the writer later than the writer the reader.
    time.sleep(0.7)
    print("begins", file=sys.stderr, flush=True)
    begin = time.perf_counter()
    for row in sent:
        # In two parts: what is made before the moment comes does not delay it.
        made = message(row)
        wait = begin + (row.tick - sent[0].tick) / 1000 - time.perf_counter()
        if wait > 0:
            time.sleep(wait)
        writer.write(made)
    own = participant.guid.bytes[:12]
    others = [data.topic_name for data in builtin.take(100) if data.key.bytes[:12] != own]
    time.sleep(0.5)
    print(json.dumps({"sent": len(sent), "others_write": others}))


main()
