#!/usr/bin/env python3
"""Recordings as others write them, and the CSV that proprio must make of each, number for number.

Bags are written by `rosbags` (an implementation of rosbag2 and CDR of its own), archives by numpy, tables by pyarrow. What is
recorded is the motion of one simulated leg, or a real log given by --log; its numbers are made such as the format carries
(single precision, milliseconds), so that the CSV beside it holds exactly what was recorded. Usage:

    pip install -r tests/oracle/requirements-recordings.txt
    python3 tests/oracle/recordings.py OUTPUT [--log LOG.csv] [--seconds 2]
"""

import argparse
import csv
import gzip
import io
import json
import math
import shutil
from pathlib import Path

import mcap.reader
import mcap.writer
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

# Field order of unitree_ros2's message definitions: facts of an interface, which every sender must keep.
GO = {
    "unitree_go/msg/IMUState": "float32[4] quaternion\nfloat32[3] gyroscope\nfloat32[3] accelerometer\nfloat32[3] rpy\nint8 temperature",
    "unitree_go/msg/MotorState": "uint8 mode\nfloat32 q\nfloat32 dq\nfloat32 ddq\nfloat32 tau_est\nfloat32 q_raw\nfloat32 dq_raw\n"
    "float32 ddq_raw\nint8 temperature\nuint32 lost\nuint32[2] reserve",
    "unitree_go/msg/BmsState": "uint8 version_high\nuint8 version_low\nuint8 status\nuint8 soc\nint32 current\nuint16 cycle\n"
    "int8[2] bq_ntc\nint8[2] mcu_ntc\nuint16[15] cell_vol",
    "unitree_go/msg/LowState": "uint8[2] head\nuint8 level_flag\nuint8 frame_reserve\nuint32[2] sn\nuint32[2] version\nuint16 bandwidth\n"
    "IMUState imu_state\nMotorState[20] motor_state\nBmsState bms_state\nint16[4] foot_force\nint16[4] foot_force_est\nuint32 tick\n"
    "uint8[40] wireless_remote\nuint8 bit_flag\nfloat32 adc_reel\nint8 temperature_ntc1\nint8 temperature_ntc2\nfloat32 power_v\n"
    "float32 power_a\nuint16[4] fan_frequency\nuint32 reserve\nuint32 crc",
    "unitree_go/msg/MotorCmd": "uint8 mode\nfloat32 q\nfloat32 dq\nfloat32 tau\nfloat32 kp\nfloat32 kd\nuint32[3] reserve",
    "unitree_go/msg/BmsCmd": "uint8 off\nuint8[3] reserve",
    "unitree_go/msg/LowCmd": "uint8[2] head\nuint8 level_flag\nuint8 frame_reserve\nuint32[2] sn\nuint32[2] version\nuint16 bandwidth\n"
    "MotorCmd[20] motor_cmd\nBmsCmd bms_cmd\nuint8[40] wireless_remote\nuint8[12] led\nuint8[2] fan\nuint8 gpio\nuint32 reserve\nuint32 crc",
}
HG = {
    "unitree_hg/msg/IMUState": "float32[4] quaternion\nfloat32[3] gyroscope\nfloat32[3] accelerometer\nfloat32[3] rpy\nint16 temperature",
    "unitree_hg/msg/MotorState": "uint8 mode\nfloat32 q\nfloat32 dq\nfloat32 ddq\nfloat32 tau_est\nint16[2] temperature\nfloat32 vol\n"
    "uint32[2] sensor\nuint32 motorstate\nuint32[4] reserve",
    "unitree_hg/msg/LowState": "uint32[2] version\nuint8 mode_pr\nuint8 mode_machine\nuint32 tick\nIMUState imu_state\n"
    "MotorState[35] motor_state\nuint8[40] wireless_remote\nuint32[4] reserve\nuint32 crc",
    "unitree_hg/msg/MotorCmd": "uint8 mode\nfloat32 q\nfloat32 dq\nfloat32 tau\nfloat32 kp\nfloat32 kd\nuint32 reserve",
    "unitree_hg/msg/LowCmd": "uint8 mode_pr\nuint8 mode_machine\nMotorCmd[35] motor_cmd\nuint32[4] reserve\nuint32 crc",
}
LEGS = ["FR", "FL", "RR", "RL"]
JOINTS = [f"{leg}_{part}" for leg in LEGS for part in ["hip", "thigh", "calf"]]
# ns of a clock that has run for 50 years, as a recorder's has.
EPOCH = 1_790_000_000_000_000_000


def types():
    store = get_typestore(Stores.ROS2_HUMBLE)
    for messages in (GO, HG):
        found = {}
        for name, text in messages.items():
            found.update(get_types_from_msg(text, name))
        store.register(found)
    return store


def zeros(store, name, **fields):
    """A message with all fields zero but these."""
    kinds = {"float32": np.float32, "uint8": np.uint8, "int8": np.int8, "uint16": np.uint16, "int16": np.int16,
             "int32": np.int32, "uint32": np.uint32}
    values = dict(fields)
    for field in (GO | HG)[name].split("\n"):
        kind, field = field.split(" ")
        if field in values:
            continue
        kind, _, count = kind.partition("[")
        if kind in kinds:
            values[field] = np.zeros(int(count[:-1]), kinds[kind]) if count else (0.0 if kind == "float32" else 0)
        else:
            values[field] = zeros(store, f"{name.split('/')[0]}/msg/{kind}")
    return store.types[name](**values)


def single(x):
    return float(np.float32(x))


class Motion:
    """Rows of t (s) and, by joint, q, dq, tau, temp; and IMU and feet."""

    def __init__(self, log, seconds):
        self.t, self.rows = [], []
        if log is None:
            self.made_up(seconds)
        else:
            self.read(log, seconds)

    def made_up(self, seconds):
        """A leg that swings on three tones: numbers to carry, not physics to explain."""
        for k in range(int(seconds * 500)):
            t = 0.002 * k
            row = {}
            for n, joint in enumerate(JOINTS):
                middle = [0.0, 0.9, -1.7][n % 3]
                w = 2 * math.pi * (0.7 + 0.3 * (n % 3))
                row[joint] = (
                    middle + 0.2 * math.sin(w * t + n),
                    0.2 * w * math.cos(w * t + n),
                    1.5 * math.sin(w * t + n) + 0.1 * n,
                    float(30 + n + k // 200),
                )
            self.t.append(t)
            self.rows.append(row)

    def read(self, log, seconds):
        with gzip.open(log, "rt") if str(log).endswith(".gz") else open(log) as file:
            for record in csv.DictReader(file):
                t = float(record["t"])
                if t > seconds:
                    break
                self.t.append(t)
                self.rows.append({j: tuple(float(record[f"{c}/{j}"]) for c in ("q", "dq", "tau")) + (30.0,) for j in JOINTS})


def write_csv(path, times, rows, channels, extra=()):
    """What proprio must make of the recording: each number as the shortest that reads back the same."""
    joints = list(rows[0])
    with gzip.GzipFile(f"{path}.gz", "wb", mtime=0) as packed, io.TextIOWrapper(packed) as file:
        header = ["t"] + [f"{c}/{j}" for c in channels for j in joints] + [name for name, _ in extra]
        file.write(",".join(header) + "\n")
        for k, (t, row) in enumerate(zip(times, rows)):
            numbers = [t] + [row[j][c] for c in range(len(channels)) for j in joints] + [f(k) for _, f in extra]
            file.write(",".join(shortest(x) for x in numbers) + "\n")


def shortest(x):
    """Python's repr without an exponent or a trailing `.0`, as Rust prints."""
    x = float(x)
    text = np.format_float_positional(x, unique=True, trim="-")
    return text


def low_states(store, motion, kind, motors, order):
    """LowState messages: (log time, message)."""
    package = kind.split("/")[0]
    for k, row in enumerate(motion.rows):
        state = []
        for n in range(motors):
            q, dq, tau, temp = row[order[n]] if n < len(order) else (0.0, 0.0, 0.0, 0.0)
            temperature = int(temp) if package == "unitree_go" else np.array([int(temp), 40], np.int16)
            state.append(zeros(store, f"{package}/msg/MotorState", mode=1, q=single(q), dq=single(dq), tau_est=single(tau), temperature=temperature))
        imu = zeros(
            store,
            f"{package}/msg/IMUState",
            quaternion=np.array([1, 0, 0, 0], np.float32),
            gyroscope=np.array([0.01 * k, -0.25, 0.5], np.float32),
            accelerometer=np.array([0.125, -0.0625, 9.81], np.float32),
        )
        fields = dict(imu_state=imu, motor_state=state, tick=1000 + round(1000 * motion.t[k]))
        if package == "unitree_go":
            fields["foot_force"] = np.array([20, -3, k % 100, 7], np.int16)
        # A recorder receives late, and by differing amounts.
        late = 300_000 + 70_000 * (k % 7)
        yield EPOCH + round(motion.t[k] * 1e9) + late, zeros(store, kind, **fields)


def low_commands(store, motion, kind, motors, order):
    """LowCmd messages of another rate than the states', the first before them: (log time, message), and what each asks of each joint."""
    package = kind.split("/")[0]
    for k in range(round((motion.t[-1] - motion.t[0]) / 0.0025) + 2):
        at = min(round(0.0025 * k / 0.002), len(motion.rows) - 1)
        asked = {}
        for n, joint in enumerate(order):
            q, dq, tau, _ = motion.rows[at][joint]
            asked[joint] = tuple(single(x) for x in (q + 0.01 * n, 0.5 * dq, 0.25 * tau, 20 + n + k % 3, 0.5 + 0.01 * n))
        command = []
        for n in range(motors):
            values = dict(zip(("q", "dq", "tau", "kp", "kd"), asked[order[n]])) if n < len(order) else {"q": 2.146e9, "dq": 16000.0}
            command.append(zeros(store, f"{package}/msg/MotorCmd", mode=1, **values))
        yield EPOCH + round((motion.t[0] + 0.0025 * k) * 1e9) - 1_000_000, zeros(store, kind, motor_cmd=command), asked


def in_force(states, commands):
    """Of each state what the last command that was received before it asks, q, dq, tau, kp, kd by joint."""
    return [[asked for time, _, asked in commands if time <= at][-1] for at, _ in states]


def joint_states(store, motion, joints, second=True):
    types = store.types
    for k, row in enumerate(motion.rows):
        stamp = EPOCH + round(motion.t[k] * 1e9)
        header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](stamp // 10**9, stamp % 10**9), "base")
        # Not in the order of any robot, and not always in the same.
        names = joints if k % 2 == 0 else list(reversed(joints))
        columns = [np.array([row[j][c] for j in names]) for c in range(3)]
        yield stamp + 400_000, types["sensor_msgs/msg/JointState"](header, names, *columns)
        if second and k % 50 == 0:
            one = np.array([0.01])
            yield stamp + 450_000, types["sensor_msgs/msg/JointState"](header, ["gripper"], one, one, one)


def write_bag(path, store, topics, storage, compression=None):
    """topics: (name, kind, [(log time, message)])."""
    if path.exists():
        shutil.rmtree(path)
    writer = Writer(path, version=9, storage_plugin=storage)
    if compression:
        writer.set_compression(CompressionMode.STORAGE, compression)
    with writer:
        everything = []
        for name, kind, messages in topics:
            connection = writer.add_connection(name, kind, typestore=store)
            everything += [(time, connection, kind, message) for time, message in messages]
        for time, connection, kind, message in sorted(everything, key=lambda m: m[0]):
            writer.write(connection, time, store.serialize_cdr(message, kind))


def recompress(source, target, compression):
    """The same messages in chunks of another compression, by Foxglove's own library."""
    with open(source, "rb") as read, open(target, "wb") as written:
        writer = mcap.writer.Writer(written, chunk_size=64 * 1024, compression=compression)
        writer.start("ros2", "recordings.py")
        schemas, channels = {}, {}
        for schema, channel, message in mcap.reader.make_reader(read).iter_messages():
            if schema.id not in schemas:
                schemas[schema.id] = writer.register_schema(schema.name, schema.encoding, schema.data)
            if channel.id not in channels:
                channels[channel.id] = writer.register_channel(channel.topic, channel.message_encoding, schemas[schema.id], channel.metadata)
            writer.add_message(channels[channel.id], message.log_time, message.data, message.publish_time)
        writer.finish()


def ticks_to_seconds(motion):
    ticks = [1000 + round(1000 * t) for t in motion.t]
    return [(tick - ticks[0]) * 1_000_000 / 1e9 for tick in ticks]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("output", type=Path)
    parser.add_argument("--log", type=Path)
    parser.add_argument("--seconds", type=float, default=0.24)
    arguments = parser.parse_args()
    out = arguments.output
    out.mkdir(parents=True, exist_ok=True)
    store = types()
    motion = Motion(arguments.log, arguments.seconds)
    singles = [{j: tuple(single(x) for x in row[j]) for j in JOINTS} for row in motion.rows]

    # LowState: times in milliseconds of the robot's own clock, numbers in single precision.
    times = ticks_to_seconds(motion)
    gyro = lambda k: single(0.01 * k)
    extra = [(f"quat/{axis}", lambda k, x=x: x) for axis, x in zip("wxyz", [1, 0, 0, 0])]
    extra += [("gyro/x", gyro), ("gyro/y", lambda k: -0.25), ("gyro/z", lambda k: 0.5)]
    extra += [(f"acc/{axis}", lambda k, x=x: single(x)) for axis, x in zip("xyz", [0.125, -0.0625, 9.81])]
    feet = [(f"foot/{leg}", lambda k, n=n: [20, -3, k % 100, 7][n]) for n, leg in enumerate(LEGS)]
    write_csv(out / "low_state.csv", times, singles, ["q", "dq", "tau", "temp"], extra + feet)
    kind = "unitree_go/msg/LowState"
    states = list(low_states(store, motion, kind, 20, JOINTS))
    # A thinned copy, as the robot sends it, and another topic.
    topics = [
        ("/lf/lowstate", kind, states[::25]),
        ("/lowstate", kind, states),
        ("/note", "std_msgs/msg/String", [(states[0][0], store.types["std_msgs/msg/String"]("hung in the air"))]),
    ]
    write_bag(out / "go_mcap", store, topics, StoragePlugin.MCAP)
    write_bag(out / "go_mcap_zstd", store, topics, StoragePlugin.MCAP, CompressionFormat.ZSTD)
    write_bag(out / "go_db3", store, topics, StoragePlugin.SQLITE3)
    recompress(out / "go_mcap" / "go_mcap.mcap", out / "go_lz4.mcap", mcap.writer.CompressionType.LZ4)

    # The same beside what the drives were asked to do, of a Go2 and of a humanoid.
    command = "unitree_go/msg/LowCmd"
    commands = list(low_commands(store, motion, command, 20, JOINTS))
    asked = in_force(states, commands)
    rows = [{j: row[j] + asked[k][j] for j in JOINTS} for k, row in enumerate(singles)]
    channels = ["q", "dq", "tau", "temp", "q_des", "dq_des", "tau_des", "kp", "kd"]
    write_csv(out / "commanded.csv", times, rows, channels, extra + feet)
    topics = [("/lowcmd", command, [(time, message) for time, message, _ in commands]), ("/lowstate", kind, states)]
    write_bag(out / "commanded_db3", store, topics, StoragePlugin.SQLITE3)

    # JointState: names, stamps in nanoseconds, double precision.
    stamps = [round(t * 1e9) for t in motion.t]
    times = [(stamp - stamps[0]) / 1e9 for stamp in stamps]
    doubles = [{j: row[j][:3] for j in JOINTS} for row in motion.rows]
    write_csv(out / "joint_state.csv", times, doubles, ["q", "dq", "tau"])
    joints = [f"{j}_joint" for j in sorted(JOINTS)]
    renamed = Motion.__new__(Motion)
    renamed.t, renamed.rows = motion.t, [{f"{j}_joint": row[j] for j in JOINTS} for row in motion.rows]
    states = list(joint_states(store, renamed, joints))
    topics = [("/joint_states", "sensor_msgs/msg/JointState", states)]
    write_bag(out / "joint_mcap", store, topics, StoragePlugin.MCAP)
    write_bag(out / "joint_db3", store, topics, StoragePlugin.SQLITE3)

    # Arrays of double precision.
    names = [f"{j}_joint" for j in JOINTS]
    arrays = {c: np.array([[row[j][n] for j in JOINTS] for row in motion.rows]) for n, c in enumerate(["q", "dq", "tau"])}
    arrays["q"] = np.asfortranarray(arrays["q"])
    np.savez(out / "log.npz", t=np.array(times), joint_names=np.array(names), **arrays)
    np.savez_compressed(out / "log_compressed.npz", time=np.array(times), joint_names=np.array(names, dtype="S"), **arrays)
    columns = {f"{c}/{j}": [row[j][n] for row in motion.rows] for n, c in enumerate(["q", "dq", "tau"]) for j in JOINTS}
    np.savez(out / "columns.npz", t=np.array(times), **{name.replace("/", "/"): np.array(x) for name, x in columns.items()})
    pq.write_table(pa.table({"t": times, **columns, "note": ["x"] * len(times)}), out / "log.parquet", compression="zstd")

    # A LeRobot data set of two episodes, 500 Hz, in single precision.
    half = len(times) // 2
    data = out / "lerobot"
    (data / "meta").mkdir(parents=True, exist_ok=True)
    (data / "data" / "chunk-000").mkdir(parents=True, exist_ok=True)
    features = {f"observation.{name}": {"dtype": "float32", "shape": [12], "names": [f"{j}.{s}" for j in JOINTS]}
                for name, s in [("state", "pos"), ("velocity", "vel"), ("effort", "effort")]}
    features["observation.effort"]["names"] = {"motors": JOINTS}
    (data / "meta" / "info.json").write_text(json.dumps({"codebase_version": "v3.0", "fps": 500, "features": features}))
    lists = {f"observation.{name}": pa.array([[row[j][c] for j in JOINTS] for row in singles], pa.list_(pa.float32(), 12) if c else pa.list_(pa.float32()))
             for c, name in enumerate(["state", "velocity", "effort"])}
    stamps = [single(0.002 * (k if k < half else k - half)) for k in range(len(times))]
    table = pa.table({**lists, "timestamp": pa.array(stamps, pa.float32()), "episode_index": [int(k >= half) for k in range(len(times))], "task": ["hang"] * len(times)})
    pq.write_table(table, data / "data" / "chunk-000" / "file-000.parquet", compression="snappy")
    shift = stamps[half - 1] + 1.0 - stamps[half]
    episode_times = [t if k < half else t + shift for k, t in enumerate(stamps)]
    write_csv(out / "lerobot.csv", episode_times, [{j: row[j][:3] for j in JOINTS} for row in singles], ["q", "dq", "tau"])

    # A humanoid's state: 29 motors, by number.
    def humanoid():
        wide = Motion.__new__(Motion)
        wide.t = motion.t
        wide.rows = [{f"m{n}": row[JOINTS[n % 12]] for n in range(29)} for row in motion.rows]
        return wide

    kind, command = "unitree_hg/msg/LowState", "unitree_hg/msg/LowCmd"
    order = [f"m{n}" for n in range(29)]
    states = list(low_states(store, humanoid(), kind, 35, order))
    commands = list(low_commands(store, humanoid(), command, 35, order))
    asked = in_force(states, commands)
    rows = [{n: row[JOINTS[n % 12]] + asked[k][f"m{n}"] for n in range(29)} for k, row in enumerate(singles)]
    write_csv(out / "hg.csv", ticks_to_seconds(motion), rows, channels)
    topics = [("/lowstate", kind, states), ("/lowcmd", command, [(time, message) for time, message, _ in commands])]
    write_bag(out / "hg_mcap", store, topics, StoragePlugin.MCAP, CompressionFormat.ZSTD)


main()
