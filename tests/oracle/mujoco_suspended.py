"""A log of a whole Go2 that hangs on a strap while its legs move, by MuJoCo: its trunk recoils. See README.md.

Robot, friction, quanta and noise are those of `mujoco_walk.py`. The strap is a spring of 2 kN/m between a point over the centre of mass and one 0.8 m
higher, so that the robot bounces at 1.8 Hz, swings and turns. Nothing of the base is in the log. Beside it lies the truth.
"""

import argparse
import gzip
import json
from pathlib import Path

import mujoco
import numpy as np

from mujoco_walk import CONTROL, EFFORT, FRICTION, GAIN_D, GAIN_P, GRAVITY, JOINTS, SAMPLE, STEP, mjcf, robot, written

FOLDER = Path(__file__).resolve().parent / "suspended"
SECONDS, SETTLE = 8.0, 1.0  # s
STIFFNESS, DAMPING, LENGTH, ABOVE = 2000.0, 40.0, 0.8, 0.12  # N/m, N s/m, m, m over the centre of mass
AIR, TURNING = 3.0, 0.3  # N s/m, N m s/rad: what ends a swing
MIDDLE = np.tile([0.0, 0.9, -1.7], 4)  # rad
WAVES, LEAST, MOST = 5, 0.8, 6.4  # sines of a joint, Hz
SIZE = np.tile([0.062, 0.086, 0.086], 4)  # rad


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("-o", type=Path, default=FOLDER)
    parser.add_argument("--seed", type=int, default=22, help="another robot, motion and noise")
    parser.add_argument("--seconds", type=float, default=SECONDS)
    args = parser.parse_args()
    random = np.random.default_rng([args.seed, 7])
    bodies = robot(args.seed, None)
    model = mujoco.MjModel.from_xml_string(mjcf(bodies))
    data = mujoco.MjData(model)
    base = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, "base")
    frequency, phase = random.uniform(LEAST, MOST, (12, WAVES)), random.uniform(0, 2 * np.pi, (12, WAVES))
    size = SIZE[:, None] * random.uniform(0.5, 1.2, (12, WAVES))

    def angles(t):
        return MIDDLE + np.clip(t, 0, 1) * (size * np.sin(2 * np.pi * frequency * t + phase)).sum(1)

    data.qpos[2], data.qpos[7:] = 2.0, angles(0.0)
    mujoco.mj_forward(model, data)
    local = data.subtree_com[base] - data.qpos[:3] + [0, 0, ABOVE]
    top = data.qpos[:3] + local + [0, 0, LENGTH]
    rest = LENGTH - sum(phi[0] for phi in bodies) * GRAVITY / STIFFNESS
    rows, turned = [], []
    for step in range(round((args.seconds + SETTLE) / STEP)):
        t = step * STEP - SETTLE
        if step % CONTROL == 0:
            want = angles(max(t, 0.0))
            speed = (angles(max(t, 0.0) + STEP) - want) / STEP
            torque = GAIN_P * (want - data.qpos[7:]) + GAIN_D * (speed - data.qvel[6:])
            data.ctrl[:] = np.clip(torque, -EFFORT, EFFORT)
        axes = np.zeros(9)
        mujoco.mju_quat2Mat(axes, data.qpos[3:7])
        axes = axes.reshape(3, 3)
        arm, turning = axes @ local, axes @ data.qvel[3:6]
        away = top - data.qpos[:3] - arm
        velocity = data.qvel[:3] + np.cross(turning, arm)
        along = away / np.linalg.norm(away)
        tension = max(0.0, STIFFNESS * (np.linalg.norm(away) - rest) - DAMPING * (along @ velocity))
        force = tension * along - AIR * velocity
        lever = data.qpos[:3] + arm - data.xipos[base]
        data.xfrc_applied[base] = [*force, *(np.cross(lever, force) - TURNING * turning)]
        if t >= 0 and step % SAMPLE == 1:
            nothing = np.zeros(3)
            rows.append((t, data.qpos[7:].copy(), data.qvel[6:].copy(), data.ctrl.copy(), nothing, nothing, np.zeros(4)))
            turned.append(data.qvel[3:6].copy())
        mujoco.mj_step(model, data)
    bias = {"gyro": 0.0, "acc": 0.0, "gyro_scale": 0.0, "acc_scale": 0.0}
    of_joints = 1 + 3 * len(JOINTS)
    lines = [",".join(line.split(",")[:of_joints]) for line in written(rows, random, bias).splitlines()]
    args.o.mkdir(exist_ok=True, parents=True)
    (args.o / "strap.csv.gz").write_bytes(gzip.compress(("\n".join(lines) + "\n").encode(), 9, mtime=0))
    truth = {f"{e}:{j}": float(x) for e, values in FRICTION.items() for j, x in zip(JOINTS, values)}
    (args.o / "truth.json").write_text(json.dumps(truth, indent=1) + "\n")
    print(f"{len(rows)} samples; the trunk turns with {np.sqrt(np.mean(np.square(turned))):.2f} rad/s rms about each axis")


if __name__ == "__main__":
    main()
