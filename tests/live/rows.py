"""Rows of a Go2's log, as a LowState can say them: time in whole milliseconds, numbers of single precision."""

import csv
import gzip
import struct
from dataclasses import dataclass, field


@dataclass
class Row:
    tick: int
    names: list
    q: list
    dq: list
    tau: list
    gyro: list = field(default_factory=lambda: [0.0] * 3)
    acc: list = field(default_factory=lambda: [0.0, 0.0, 9.81])
    feet: list = field(default_factory=lambda: [0] * 4)


def single(value):
    return struct.unpack("f", struct.pack("f", value))[0]


def rows(path):
    opened = gzip.open if str(path).endswith(".gz") else open
    with opened(path, "rt", newline="") as file:
        table = csv.DictReader(file)
        names = [name[2:] for name in table.fieldnames if name.startswith("q/")]
        has_imu = "gyro/x" in table.fieldnames
        for cells in table:
            part = lambda channel, of: [single(float(cells[f"{channel}/{name}"])) for name in of]
            # A stamp of half a millisecond is of the one before.
            row = Row(round(1000 * float(cells["t"]) - 1e-3), names, part("q", names), part("dq", names), part("tau", names))
            if has_imu:
                row.gyro, row.acc = part("gyro", "xyz"), part("acc", "xyz")
                row.feet = [int(x) for x in part("foot", ["FR", "FL", "RR", "RL"])]
            yield row
