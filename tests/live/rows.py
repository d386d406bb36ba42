"""Rows of a Go2's log, as a LowState can say them: time in whole milliseconds, numbers of single precision."""

import csv
import struct
from dataclasses import dataclass


@dataclass
class Row:
    tick: int
    names: list
    q: list
    dq: list
    tau: list


def single(value):
    return struct.unpack("f", struct.pack("f", value))[0]


def rows(path):
    with open(path, newline="") as file:
        table = csv.DictReader(file)
        names = [name[2:] for name in table.fieldnames if name.startswith("q/")]
        for cells in table:
            part = lambda channel: [single(float(cells[f"{channel}/{name}"])) for name in names]
            yield Row(round(1000 * float(cells["t"])), names, part("q"), part("dq"), part("tau"))
