"""Logs of one pinned leg that MuJoCo moves, each with an effect that the rigid body lacks. See README.md.

The leg is FR of the oracle's Go2 (`manifest.json`). A PD controller of 2 kHz follows sums of sines; the log has 500 Hz, the
quanta and the noise of a Go2's bus. Torques are taken in the middle of a hold, where they are those of the instant.
"""

import gzip
import io
import json
import platform
from pathlib import Path

import mujoco
import numpy as np

from generate import GRAVITY

HERE = Path(__file__).resolve().parent
FOLDER = HERE / "mujoco"
SEED = 20240302
JOINTS = ["FR_hip", "FR_thigh", "FR_calf"]
# Origins in the parent and axes of the joints (go2.md).
ORIGINS = [(0.1934, -0.0465, 0), (0, -0.0955, 0), (0, 0, -0.213)]
AXES = [(1, 0, 0), (0, 1, 0), (0, 1, 0)]
# MuJoCo moves positions by the velocity at the end of a step, so that they lead torques by half of one: at a leg that swings at 5 Hz an eighth of a
# millisecond is as 0.003 N m s/rad of viscous friction.
STEP, DURATION = 2.5e-5, 10.0  # s
CONTROL, SAMPLE = 20, 80  # steps per tick of the controller and per sample
GAIN_P, GAIN_D = 60.0, 2.0  # N m/rad, N m s/rad
EFFORT = np.array([23.7, 23.7, 45.43])  # N m
GEAR = np.array([6.333, 6.333, 6.333 * 23 / 12])
QUANTA = np.array([2 * np.pi / 32768 / GEAR, 2 * np.pi / 256 / GEAR, GEAR / 256])  # rad, rad/s, N m
NOISE = np.array([0.035, 0.035, 0.022]), GEAR / 512  # rad/s, N m
CENTRE, REACH = np.array([-0.1, 0.9, -1.7]), np.array([0.5, 0.7, 0.7])  # rad
# Hz; no two joints share one. The slow ones give speeds near standstill.
FREQUENCIES = np.array([[0.1, 0.4, 1.3, 2.8, 4.9, 7.6], [0.2, 0.5, 1.4, 2.9, 5.0, 7.7], [0.3, 0.6, 1.5, 3.0, 5.1, 7.8]])

TYPICAL = {
    **{f"viscous:{j}": v for j, v in zip(JOINTS, (0.03, 0.04, 0.05))},
    **{f"coulomb:{j}": v for j, v in zip(JOINTS, (0.15, 0.12, 0.6))},
    **{f"armature:{j}": v for j, v in zip(JOINTS, (0.005, 0.005, 0.018))},
}
# Per log: what the leg has, by the catalogue's names, and which of it is the hidden one.
LOGS = {
    "rigid": ({}, []),
    "coulomb": ({"coulomb:FR_calf": 0.6}, ["coulomb:FR_calf"]),
    "armature": ({"armature:FR_thigh": 0.01}, ["armature:FR_thigh"]),
    "viscous": ({"viscous:FR_hip": 0.2}, ["viscous:FR_hip"]),
    "typical": (TYPICAL, []),
    "spring": ({**TYPICAL, "spring:FR_thigh": 1.5, "q0:spring:FR_thigh": 0.4}, ["spring:FR_thigh"]),
    "payload": ({**TYPICAL, "payload:FR_calf": 0.12, "x:payload:FR_calf": 0.02, "z:payload:FR_calf": -0.1},
                ["payload:FR_calf"]),
    "torque_gain": ({**TYPICAL, "torque_gain:FR_calf": 1.2}, ["torque_gain:FR_calf"]),
}


def leg(effects):
    """The MJCF of the leg with these effects, all by MuJoCo's own attributes."""
    theta = json.loads((HERE / "manifest.json").read_text())["systems"]["leg"]["theta"]
    value = lambda effect, joint, default=0.0: effects.get(f"{effect}:{joint}", default)
    bodies = ""
    for joint, origin, axis, phi in zip(JOINTS, ORIGINS, AXES, np.reshape(theta, (3, 10))):
        m, h = phi[0], phi[1:4]
        xx, xy, xz, yy, yz, zz = phi[4:]
        com = h / m
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        inertia -= m * (com @ com * np.eye(3) - np.outer(com, com))
        full = [inertia[k] for k in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
        text = lambda numbers: " ".join(repr(float(x)) for x in numbers)
        bodies += f"""<body name="{joint}" pos="{text(origin)}">
          <inertial pos="{text(com)}" mass="{float(m)!r}" fullinertia="{text(full)}"/>
          <joint name="{joint}" axis="{text(axis)}" damping="{value('viscous', joint)}"
            frictionloss="{value('coulomb', joint)}" armature="{value('armature', joint)}"
            stiffness="{value('spring', joint)}" springref="{value('q0:spring', joint)}"/>"""
        load = value("payload", joint)
        if load:
            place = text(value(f"{axis}:payload", joint) for axis in "xyz")
            # A ball of 1 cm: what MuJoCo takes for a point.
            ball = 0.4 * load * 0.01**2
            bodies += f"""<body pos="{place}"><inertial pos="0 0 0" mass="{load}" diaginertia="{ball} {ball} {ball}"/></body>"""
    motors = "".join(f'<motor joint="{j}" gear="{value("torque_gain", j, 1.0)}"/>' for j in JOINTS)
    # Friction as hard as MuJoCo makes it: its width at standstill is then below the sensor's noise.
    return f"""<mujoco><compiler angle="radian"/><option timestep="{STEP}" gravity="0 0 {-GRAVITY}" integrator="implicitfast" iterations="200"
        tolerance="1e-12"/>
      <default><joint limited="false" solreffriction="{2 * STEP} 1" solimpfriction="0.999 0.9999 0.001"/></default>
      <worldbody>{bodies}{'</body>' * 3}</worldbody><actuator>{motors}</actuator></mujoco>"""


def reference(phases, t):
    size = 0.5 - 0.5 * np.cos(np.pi * min(t, 1.0))
    rate = 0.5 * np.pi * np.sin(np.pi * min(t, 1.0))
    amplitude = 1 / (FREQUENCIES * 10 + 5)
    amplitude *= (REACH / amplitude.sum(axis=1))[:, None]
    turn = 2 * np.pi * FREQUENCIES
    offset = (amplitude * np.sin(turn * t + phases)).sum(axis=1)
    speed = (amplitude * turn * np.cos(turn * t + phases)).sum(axis=1)
    return CENTRE + size * offset, size * speed + rate * offset


def simulate(effects, random):
    model = mujoco.MjModel.from_xml_string(leg(effects))
    data = mujoco.MjData(model)
    phases = random.uniform(0, 2 * np.pi, (3, 6))
    data.qpos[:] = reference(phases, 0.0)[0]
    rows = []
    for step in range(round(DURATION / STEP) + CONTROL):
        if step % CONTROL == 0:
            q, dq = reference(phases, data.time)
            torque = GAIN_P * (q - data.qpos) + GAIN_D * (dq - data.qvel)
            data.ctrl[:] = np.clip(torque, -EFFORT, EFFORT)
        if step % SAMPLE == CONTROL // 2:
            rows.append([data.time - CONTROL // 2 * STEP, data.qpos.copy(), data.qvel.copy(), data.ctrl.copy()])
        mujoco.mj_step(model, data)
    return rows


def written(rows, random):
    """The log as text: noise, quanta, decimals that are finer than these."""
    heads = ["t"] + [f"{channel}/{joint}" for channel in ("q", "dq", "tau") for joint in JOINTS]
    out = io.StringIO()
    out.write(",".join(heads) + "\n")
    for t, *channels in rows:
        channels[1] = channels[1] + NOISE[0] * random.normal(size=3)
        channels[2] = channels[2] + NOISE[1] * random.normal(size=3)
        values = [np.round(c / quantum) * quantum for c, quantum in zip(channels, QUANTA)]
        cells = [f"{x:.{places}f}" for places, three in zip((5, 4, 3), values) for x in three]
        out.write(f"{t:.3f}," + ",".join(cells) + "\n")
    return out.getvalue()


def main():
    FOLDER.mkdir(exist_ok=True)
    logs = {}
    for name, (effects, hidden) in LOGS.items():
        random = np.random.default_rng(SEED)
        text = written(simulate(effects, random), random)
        packed = gzip.compress(text.encode(), 9, mtime=0)
        assert len(packed) < 150_000, (name, len(packed))
        (FOLDER / f"{name}.csv.gz").write_bytes(packed)
        logs[name] = {"hidden": hidden, "parameters": effects}
        print(f"{name}: {text.count(chr(10)) - 1} samples, {len(packed)} bytes")
    manifest = {
        "command": "python mujoco_logs.py",
        "mujoco": mujoco.__version__,
        "numpy": np.__version__,
        "python": platform.python_version(),
        "seed": SEED,
        "logs": logs,
    }
    (FOLDER / "truth.json").write_text(json.dumps(manifest, indent=1) + "\n")


if __name__ == "__main__":
    main()
