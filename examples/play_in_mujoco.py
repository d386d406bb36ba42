#!/usr/bin/env python3
"""Plays a motion of `proprio excite` on a robot in MuJoCo and records a log: the way through a log, before or without a robot.

    pip install mujoco
    ./play_in_mujoco.py robot.xml motion.csv log.csv

The robot stands where the file has it; joints that the motion does not move are held.
"""

import csv
import sys

import mujoco
import numpy as np

STEPS = 20  # of the simulation to a row of the motion: 0.1 ms at 500 Hz, at which stiff friction is stable


def read(path):
    """Time, the joints' names and the motion's columns, each with a row per sample."""
    with open(path, newline="") as file:
        rows = list(csv.DictReader(file))
    joints = [name[2:] for name in rows[0] if name.startswith("q/")]
    column = lambda kind: np.array([[float(row[f"{kind}/{joint}"]) for joint in joints] for row in rows])
    return np.array([float(row["t"]) for row in rows]), joints, {kind: column(kind) for kind in ("q", "dq", "tau", "kp", "kd")}


def load(path, step):
    model = mujoco.MjModel.from_xml_path(path)
    model.opt.timestep = step
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    # By default MuJoCo's dry friction builds up over 20 ms; so it does over two steps.
    model.dof_solref[:] = 2 * step, 1
    model.dof_solimp[:, :3] = 0.999, 0.9999, 0.001
    return model


def main(robot, motion, log):
    t, joints, wanted = read(motion)
    model = load(robot, (t[1] - t[0]) / STEPS)
    data = mujoco.MjData(model)
    known = {model.joint(n).name.removesuffix("_joint"): model.joint(n) for n in range(model.njnt)}
    moved = [known[joint.removesuffix("_joint")] for joint in joints]
    q = [int(joint.qposadr[0]) for joint in moved]
    dq = [int(joint.dofadr[0]) for joint in moved]
    data.qpos[q] = wanted["q"][0]
    others = np.setdiff1d(np.arange(model.nv), dq)
    rows = []
    for k in range(len(t)):
        torque = wanted["tau"][k] + wanted["kp"][k] * (wanted["q"][k] - data.qpos[q]) + wanted["kd"][k] * (wanted["dq"][k] - data.qvel[dq])
        data.qfrc_applied[dq] = torque
        rows.append((data.qpos[q].copy(), data.qvel[dq].copy(), torque))
        for _ in range(STEPS):
            data.qvel[others] = 0.0
            mujoco.mj_step(model, data)
    positions, velocities, held = map(np.array, zip(*rows))
    # A torque that is held from one sample to the next is, at a sample, the mean of both.
    held[1:] = 0.5 * (held[1:] + held[:-1])
    header = ["t"] + [f"{kind}/{joint}" for kind in ("q", "dq", "tau") for joint in joints]
    with open(log, "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(header)
        writer.writerows(np.column_stack([t, positions, velocities, held]).tolist())
    print(f"{log}: {len(t)} samples; off the motion by {np.abs(positions - wanted['q']).max():.3f} rad or m at most")


if __name__ == "__main__":
    main(*sys.argv[1:])
