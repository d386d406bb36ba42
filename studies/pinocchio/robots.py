"""Robots whose torques Pinocchio makes: their URDFs, motions, drives and logs; and what `proprio` says of them."""

import json
import subprocess
from pathlib import Path

import numpy as np
import pinocchio as pin

HERE = Path(__file__).resolve().parent
URDFS = Path(pin.__file__).parents[4] / "share/example-robot-data/robots"
GO2 = HERE.parent.parent / "tests/oracle/go2.urdf"
ROBOTS = {
    "UR5": "ur_description/urdf/ur5_robot.urdf",
    "UR10": "ur_description/urdf/ur10_robot.urdf",
    "Z1": "z1_description/urdf/z1.urdf",
    "Panda": "panda_description/urdf/panda.urdf",
    "Go2's leg": None,
}
# Joints that rest at zero.
HELD = {"Panda": ["panda_finger_joint1", "panda_finger_joint2"]}
DRIVE = {"viscous", "coulomb", "armature", "bias"}
SECONDS = 20.0


def load(robot):
    """The model of a robot, and its joints as its log names them."""
    if robot == "Go2's leg":
        model = pin.buildModelFromUrdf(str(GO2))
        lock = [name for name in model.names[1:] if not name.startswith("FR_")]
    else:
        model = pin.buildModelFromUrdf(str(URDFS / ROBOTS[robot]))
        lock = HELD.get(robot, [])
    if lock:
        model = pin.buildReducedModel(model, [model.getJointId(name) for name in lock], pin.neutral(model))
    names = [model.names[n] for n in range(1, model.njoints)]
    return model, [name.removesuffix("_joint") if robot == "Go2's leg" else name for name in names]


def write_model(robot, path):
    """The URDF alone, which is what diagnosis begins with."""
    if not ROBOTS[robot]:
        return
    text = f'format = 1\n\n[robot]\nurdf = "{URDFS / ROBOTS[robot]}"\n'
    held = "".join(f"{name} = 0.0\n" for name in HELD.get(robot, []))
    path.write_text(text + (f"\n[held]\n{held}" if held else ""))


def scattered(model, random, share=0.04):
    """Bodies that are not quite the URDF's."""
    for n in range(1, model.njoints):
        body = model.inertias[n]
        body.mass *= 1 + share * random.normal()
        body.lever = body.lever + 0.3 * share * random.normal(size=3) * np.linalg.norm(body.lever)
        body.inertia = body.inertia * (1 + share * random.normal())
        model.inertias[n] = body


def motion(model, is_leg, rate, random):
    """Sums of six sines, within limits of position and velocity."""
    t = np.arange(int(SECONDS * rate)) / rate
    low, high = model.lowerPositionLimit.copy(), model.upperPositionLimit.copy()
    low[high <= low], high[high <= low] = -2.5, 2.5
    fastest = np.where(model.velocityLimit > 0, np.minimum(model.velocityLimit, 20), 3)
    tones, most = (np.array([0.1, 0.4, 1.3, 2.8, 4.9, 7.6]), 120) if is_leg else (np.array([0.1, 0.2, 0.3, 0.5, 0.8, 1.2]), 12)
    q, dq, ddq = np.zeros((3, len(t), model.nv))
    for j in range(model.nv):
        w = 2 * np.pi * tones * (1 + 0.03 * j / model.nv)
        a, phase = random.normal(size=6) / w**0.8, random.uniform(0, 2 * np.pi, 6)
        x, v, acc = ((part @ a) for part in (np.sin(np.outer(t, w) + phase), w * np.cos(np.outer(t, w) + phase), -w * w * np.sin(np.outer(t, w) + phase)))
        middle = (x.max() + x.min()) / 2
        half = 0.8 * min((high[j] - low[j]) / 2, 2)
        size = min(half / abs(x - middle).max(), 0.6 * fastest[j] / abs(v).max(), most / abs(acc).max())
        q[:, j], dq[:, j], ddq[:, j] = np.clip((low[j] + high[j]) / 2, -3, 3) + size * (x - middle), size * v, size * acc
    return t, q, dq, ddq


def torque(model, q, dq, ddq):
    data = model.createData()
    return np.array([pin.rnea(model, data, *row) for row in zip(q, dq, ddq)])


def rms(x):
    return np.sqrt(np.mean(x**2, axis=0))


class Drive:
    """Friction, rotor inertia and offset of each joint, by shares of its torque."""

    def __init__(self, tau, dq, ddq, random):
        self.size = np.maximum(rms(tau), 0.15 * rms(tau).max())
        share = lambda low, high: self.size * random.uniform(low, high, tau.shape[1])
        self.coulomb, self.viscous = share(0.05, 0.12), share(0.03, 0.08) / rms(dq)
        self.armature, self.bias = share(0.01, 0.05) / rms(ddq), share(-0.03, 0.03)

    def torque(self, dq, ddq):
        return self.coulomb * np.tanh(dq / 0.002) + self.viscous * dq + self.armature * ddq + self.bias


def loaded(model, random, is_leg):
    """The model with a load at its last body."""
    heavy, last = pin.Model(model), model.nv
    mass = random.uniform(0.5, 1.0) * max(model.inertias[last].mass, 0.03 * sum(body.mass for body in model.inertias))
    place = random.uniform(-0.05, 0.05, 3) * (0.3 if is_leg else 1)
    ball = pin.Inertia(mass, model.inertias[last].lever + place, np.eye(3) * mass * 0.015**2)
    heavy.inertias[last] = heavy.inertias[last] + ball
    return heavy, mass


def write_log(path, names, t, q, dq, tau, random, noise, size):
    q = q + 2e-5 * random.normal(size=q.shape)
    dq = dq + 0.002 * rms(dq) * random.normal(size=q.shape)
    tau = tau + noise * size * random.normal(size=q.shape)
    head = ",".join(["t", *(f"{channel}/{name}" for channel in ("q", "dq", "tau") for name in names)])
    np.savetxt(path, np.column_stack([t, q, dq, tau]), delimiter=",", header=head, comments="", fmt="%.7g")


def settings(random):
    return int(random.choice([250, 500, 1000])), float(random.choice([0.003, 0.01, 0.03]))


def drawn(robot, random, rate=None):
    """At this rate, or one that is drawn: a robot with its own bodies and drive, and a log's motion: the model, its joints, whether it is a leg, the share of noise, t, q, dq and ddq, the
    bodies' torque, the drive."""
    model, names = load(robot)
    is_leg = robot == "Go2's leg"
    own_rate, noise = settings(random)
    rate = rate or own_rate
    course = motion(model, is_leg, rate, random)
    scattered(model, random)
    tau = torque(model, *course[1:])
    return model, names, is_leg, noise, course, tau, Drive(tau, *course[2:], random)


def said(proprio, folder, *arguments):
    output = subprocess.run([proprio, *arguments, "--json"], cwd=folder, capture_output=True, text=True)
    return json.loads(output.stdout) if output.stdout else {"verdict": output.stderr}


def named(found):
    """Effects beyond the drive's that a diagnosis has added for good, with their joints."""
    added = {}
    for step in found["path"]:
        for joint in step["joints"]:
            if step["step"] == "add":
                added[step["effect"], joint] = True
            elif step["step"] == "remove":
                added.pop((step["effect"], joint), None)
    return [one for one in added if one[0] not in DRIVE]
