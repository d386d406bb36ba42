"""A log of a Go2 that MuJoCo moves as `proprio excite --standing` says, over four planted feet. See README.md.

Robot, ground, sensors and noise are those of `mujoco_walk.py`; the controller follows the motion's angles and adds its feed-forward.
"""

import argparse
import csv
import gzip
import json
from pathlib import Path

import mujoco
import numpy as np

from mujoco_walk import FOLDER, JOINTS, imu_bias, robot, simulate, told, written

SEED = 5  # of the robot: none of the walks'


class Motion:
    """The columns of a motion file, between its rows as its speeds and accelerations have it."""

    def __init__(self, path):
        with open(path, newline="") as file:
            rows = list(csv.reader(file))
        heads = {name: k for k, name in enumerate(rows[0])}
        table = np.array(rows[1:], dtype=float)
        self.t = table[:, heads["t"]]
        self.q, self.dq, self.ddq, self.tau = (
            table[:, [heads[f"{channel}/{joint}"] for joint in JOINTS]] for channel in ("q", "dq", "ddq", "tau"))

    def row(self, t):
        return min(max(np.searchsorted(self.t, t + 1e-9) - 1, 0), len(self.t) - 1)

    def angles(self, t):
        n = self.row(t)
        dt = min(t, self.t[-1]) - self.t[n]
        return self.q[n] + dt * (self.dq[n] + 0.5 * dt * self.ddq[n])

    def torque(self, t):
        return self.tau[self.row(t)]


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("motion", type=Path)
    parser.add_argument("-o", type=Path, default=FOLDER / "standing.csv.gz")
    parser.add_argument("--seed", type=int, default=SEED, help="another robot and noise")
    args = parser.parse_args()
    random = np.random.default_rng([args.seed, 3])
    bodies, motion = robot(args.seed, None), Motion(args.motion)
    bias = imu_bias(random)
    rows = simulate("standing", motion.t[-1], bodies, random, motion)
    lost = np.mean([[f < 1.0 for f in row[6]] for row in rows])
    off = max(np.max(np.abs(row[1] - motion.angles(row[0]))) for row in rows)
    packed = gzip.compress(written(rows, random, bias).encode(), 9, mtime=0)
    args.o.write_bytes(packed)
    truth = told("standing", None, bodies, bias)
    manifest = {"command": "python mujoco_standing.py MOTION", "mujoco": mujoco.__version__, "numpy": np.__version__,
                "logs": {"standing": truth}}
    args.o.with_name("standing.json").write_text(json.dumps(manifest, indent=1) + "\n")
    print(f"{len(rows)} samples, {len(packed)} bytes; a foot carries less than 1 N for {100 * lost:.1f} % of the time; joints are {off:.3f} rad off at most")


if __name__ == "__main__":
    main()
