"""Logs of any legged robot that MuJoCo walks, from its URDF: trot and sway, friction, IMU, feet. See README.md.

Bodies are lumped from the URDF by this file's own reader, so that nothing is shared with proprio's. Masses, centres of mass, friction, IMU and feet are
off from the CAD as `mujoco_walk.py` has a Go2's, in proportion to the robot's weight and the length of its legs. The robots are those of PyPI
`example-robot-data`, which are not copied here: `python mujoco_legged.py solo12 trot -o solo12.csv` writes the log, `solo12.toml` (a model file that
names URDF, feet and IMU) and `solo12.truth.json` beside it.
"""

import argparse
import gzip
import json
import os
import xml.etree.ElementTree as ET
from pathlib import Path

import mujoco
import numpy as np

GRAVITY = 9.81
STEP, CONTROL, SAMPLE = 5e-4, 2, 4  # s; steps per tick of the controller and per sample
HERE = Path(__file__).resolve().parent
SETTLE = 1.5  # s of standing before the log begins
# A Go2's, which all else is in proportion to.
MASS, REACH = 16.1, 0.52  # kg, m
GAIN_P, GAIN_D = 80.0, 2.0  # N m/rad, N m s/rad
FRICTION = {"viscous": 0.04, "coulomb": 0.15, "armature": 0.006}
GYRO, ACC, SPEED, TORQUE = 0.005, 0.05, 0.02, 0.05  # noise, rad/s, m/s², rad/s, N m

# URDF; joints of each leg and their angles as it stands; feet's links, sphere's centre and radius, or corners; IMU's link, or where in the base it is.
ROBOTS = {
    "solo12": dict(urdf="solo_description/robots/solo12.urdf", limbs=["FL", "FR", "HL", "HR"], joints=["{}_HAA", "{}_HFE", "{}_KFE"],
                   stand=[(0, 0.8, -1.6)] * 4, foot="{}_FOOT", radius=0.016, imu=((0.0, 0.0, 0.02), (0, 0, 0))),
    "anymal_b": dict(urdf="anymal_b_simple_description/robots/anymal.urdf", limbs=["LF", "RF", "LH", "RH"], joints=["{}_HAA", "{}_HFE", "{}_KFE"],
                     stand=[(0, 0.7, -1.2), (0, 0.7, -1.2), (0, -0.7, 1.2), (0, -0.7, 1.2)], foot="{}_FOOT", radius=0.031, centre=(0, 0, 0.02325)),
    "anymal_c": dict(urdf="anymal_c_simple_description/urdf/anymal.urdf", limbs=["LF", "RF", "LH", "RH"], joints=["{}_HAA", "{}_HFE", "{}_KFE"],
                     stand=[(0, 0.7, -1.2), (0, 0.7, -1.2), (0, -0.7, 1.2), (0, -0.7, 1.2)], foot="{}_FOOT", radius=0.03, centre=(0, 0, 0.02325)),
    "hyq": dict(urdf="hyq_description/robots/hyq_no_sensors.urdf", limbs=["lf", "rf", "lh", "rh"], joints=["{}_haa_joint", "{}_hfe_joint", "{}_kfe_joint"],
                stand=[(-0.1, 0.75, -1.5), (-0.1, 0.75, -1.5), (-0.1, -0.75, 1.5), (-0.1, -0.75, 1.5)], foot="{}_foot", radius=0.02175),
    "a1": dict(urdf="a1_description/urdf/a1.urdf", limbs=["FR", "FL", "RR", "RL"], joints=["{}_hip_joint", "{}_thigh_joint", "{}_calf_joint"],
               stand=[(0, 0.8, -1.6)] * 4, foot="{}_foot", radius=0.02),
    "b1": dict(urdf="b1_description/urdf/b1.urdf", limbs=["FR", "FL", "RR", "RL"], joints=["{}_hip_joint", "{}_thigh_joint", "{}_calf_joint"],
               stand=[(0, 0.8, -1.6)] * 4, foot="{}_foot", radius=0.04),
    # Made up: six legs, an IMU that is turned, no foot's sensor.
    "hexapod": dict(urdf=HERE / "legged/hexapod.urdf", limbs=["front_left", "front_right", "middle_left", "middle_right", "rear_left", "rear_right"],
                    joints=["{}_yaw", "{}_lift", "{}_knee"], stand=[(0, 0.4, -0.4)] * 6, foot="{}_foot", radius=0.015, centre=(0, 0, 0.015), groups=[0, 1, 1, 0, 0, 1]),
    "g1": dict(urdf="g1_description/urdf/g1_29dof_rev_1_0.urdf", limbs=["left", "right"],
               joints=["{}_hip_pitch_joint", "{}_hip_roll_joint", "{}_hip_yaw_joint", "{}_knee_joint", "{}_ankle_pitch_joint", "{}_ankle_roll_joint"],
               stand=[(-0.35, 0, 0, 0.7, -0.35, 0)] * 2, foot="{}_ankle_roll_link", radius=0.005,
               points=[(-0.05, 0.025, -0.03), (-0.05, -0.025, -0.03), (0.12, 0.03, -0.03), (0.12, -0.03, -0.03)], imu=((0, 0, 0.05), (0, 0, 0)), arms=1.0),
}


def numbers(text, default=(0, 0, 0)):
    return np.array([float(x) for x in text.split()]) if text else np.array(default, float)


def turn(roll, pitch, yaw):
    c, s = np.cos, np.sin
    x = np.array([[1, 0, 0], [0, c(roll), -s(roll)], [0, s(roll), c(roll)]])
    y = np.array([[c(pitch), 0, s(pitch)], [0, 1, 0], [-s(pitch), 0, c(pitch)]])
    z = np.array([[c(yaw), -s(yaw), 0], [s(yaw), c(yaw), 0], [0, 0, 1]])
    return z @ y @ x


def origin(element):
    own = element.find("origin") if element is not None else None
    place = np.eye(4)
    if own is not None:
        place[:3, :3] = turn(*numbers(own.get("rpy")))
        place[:3, 3] = numbers(own.get("xyz"))
    return place


class Body:
    """What a joint moves, links that are fixed to it lumped in."""

    def __init__(self, name, parent, joint=None, placement=None):
        self.name, self.parent, self.placement = name, parent, np.eye(4) if placement is None else placement
        self.axis = numbers(joint.find("axis").get("xyz"), (1, 0, 0)) if joint is not None else None
        self.mass, self.moment, self.inertia = 0.0, np.zeros(3), np.zeros((3, 3))

    def add(self, link, there):
        own = link.find("inertial")
        if own is None:
            return
        m = float(own.find("mass").get("value"))
        about = {k: float(v) for k, v in own.find("inertia").attrib.items()}
        inertia = np.array([[about["ixx"], about["ixy"], about["ixz"]], [about["ixy"], about["iyy"], about["iyz"]], [about["ixz"], about["iyz"], about["izz"]]])
        place = there @ origin(own)
        self.put(m, place[:3, 3], place[:3, :3] @ inertia @ place[:3, :3].T)

    def put(self, m, com, about_com):
        self.mass += m
        self.moment = self.moment + m * com
        self.inertia = self.inertia + about_com + m * (com @ com * np.eye(3) - np.outer(com, com))

    def about_com(self):
        com = self.moment / self.mass
        return self.mass, com, self.inertia - self.mass * (com @ com * np.eye(3) - np.outer(com, com))

    def ten(self):
        full = self.inertia
        return [self.mass, *self.moment, full[0, 0], full[0, 1], full[0, 2], full[1, 1], full[1, 2], full[2, 2]]


def read(path):
    """Bodies depth first, the base first, and of each link its body's number and its place in it."""
    root = ET.parse(path).getroot()
    links = {link.get("name"): link for link in root.findall("link")}
    joints = [j for j in root.findall("joint") if j.find("child") is not None]
    children = {}
    for joint in joints:
        children.setdefault(joint.find("parent").get("link"), []).append(joint)
    base = (set(links) - {j.find("child").get("link") for j in joints}).pop()
    first = children[base]
    if len(first) == 1 and first[0].get("type") == "floating":
        base = first[0].find("child").get("link")
    bodies, frames = [Body("base", None)], {}

    def visit(link, b, there):
        frames[link] = (b, there)
        bodies[b].add(links[link], there)
        for joint in children.get(link, []):
            child, placed = joint.find("child").get("link"), there @ origin(joint)
            if joint.get("type") in ("fixed", "floating"):
                visit(child, b, placed)
            else:
                bodies.append(Body(joint.get("name"), b, joint, placed))
                visit(child, len(bodies) - 1, np.eye(4))

    visit(base, 0, np.eye(4))
    return bodies, frames


class Robot:
    def __init__(self, name, share, imu_off=(0, 0, 0)):
        self.facts = facts = ROBOTS[name]
        self.name, self.path = name, (share / facts["urdf"]).resolve()
        self.bodies, self.frames = read(self.path)
        self.mass = sum(body.mass for body in self.bodies)
        self.joints = [body.name for body in self.bodies[1:]]
        self.legs = [[self.joints.index(j.format(limb)) for j in facts["joints"]] for limb in facts["limbs"]]
        self.feet = []
        for limb in facts["limbs"]:
            b, there = self.frames[facts["foot"].format(limb)]
            points = facts.get("points", [facts.get("centre", (0, 0, 0))])
            self.feet.append((b, [there[:3, :3] @ np.array(p) + there[:3, 3] for p in points]))
        b, there = next((own for link, own in self.frames.items() if "imu" in link.lower() and own[0] == 0), (0, np.eye(4)))
        if "imu" in facts:
            there = np.eye(4)
            there[:3, 3], there[:3, :3] = facts["imu"][0], turn(*facts["imu"][1])
        assert b == 0
        self.imu = there.copy()
        self.imu[:3, 3] += imu_off
        self.reach = 0.0
        b, points = self.feet[0]
        self.reach = np.linalg.norm(points[0])
        while self.bodies[b].parent:
            self.reach += np.linalg.norm(self.bodies[b].placement[:3, 3])
            b = self.bodies[b].parent
        self.heavier, self.longer = self.mass / MASS, self.reach / REACH
        self.stand = np.zeros(len(self.joints))
        for leg, angles in zip(self.legs, facts["stand"]):
            self.stand[leg] = angles
        unit = self.heavier * self.longer
        self.friction = {"viscous": FRICTION["viscous"] * unit * self.longer**0.5, "coulomb": FRICTION["coulomb"] * unit,
                         "armature": FRICTION["armature"] * unit * self.longer}

    def perturb(self, random, load):
        for body in self.bodies:
            if body.mass <= 0:
                continue
            m, com, inertia = body.about_com()
            body.mass, body.moment, body.inertia = 0.0, np.zeros(3), np.zeros((3, 3))
            off = random.normal(size=3) * (0.005 if body.parent is None else 0.001) * self.longer
            body.put(m * (1 + 0.03 * random.normal()), com + off, inertia)
        if load:
            m, *place = load
            self.bodies[0].put(m, np.array(place), np.eye(3) * 0.4 * m * 0.04**2)

    def mjcf(self, ground, soft):
        text = lambda xs: " ".join(repr(float(x)) for x in xs)

        def quat(rotation):
            q = np.zeros(4)
            mujoco.mju_mat2Quat(q, rotation.flatten())
            return q

        def write(b):
            body = self.bodies[b]
            m, com, inertia = body.about_com()
            full = [inertia[k] for k in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
            out = f'<inertial pos="{text(com)}" mass="{m!r}" fullinertia="{text(full)}"/>'
            for n, (owner, points) in enumerate(self.feet):
                if owner == b:
                    for k, point in enumerate(points):
                        out += f'<geom name="foot{n}_{k}" type="sphere" size="{self.facts["radius"]}" pos="{text(point)}"/>'
            if b == 0:
                out += f'<site name="imu" pos="{text(self.imu[:3, 3])}" quat="{text(quat(self.imu[:3, :3]))}"/>'
            for c, child in enumerate(self.bodies):
                if c and child.parent == b:
                    f = self.friction
                    joint = (f'<joint name="{child.name}" axis="{text(child.axis)}" damping="{f["viscous"]}" frictionloss="{f["coulomb"]}" '
                             f'armature="{f["armature"]}"/>')
                    place = child.placement
                    out += f'<body name="{child.name}" pos="{text(place[:3, 3])}" quat="{text(quat(place[:3, :3]))}">{joint}{write(c)}</body>'
            return out

        motors = "".join(f'<motor joint="{j}"/>' for j in self.joints)
        contact = 'solref="0.008 1" solimp="0.8 0.97 0.003"' if soft else 'solref="0.004 1" solimp="0.9 0.99 0.001"'
        return f"""<mujoco><compiler balanceinertia="true" boundmass="1e-6" boundinertia="1e-9"/>
          <option timestep="{STEP}" gravity="0 0 {-GRAVITY}" integrator="implicitfast" iterations="30" tolerance="1e-9" cone="elliptic" impratio="10"/>
          <default><joint limited="false" solreffriction="{4 * STEP} 1" solimpfriction="0.999 0.9999 0.001"/>
            <geom mass="0" condim="3" friction="{ground} 0 0" {contact}/></default>
          <worldbody><geom type="plane" size="0 0 1"/><body name="base" pos="0 0 1"><freejoint/>{write(0)}</body></worldbody>
          <actuator>{motors}</actuator><sensor><gyro site="imu"/><accelerometer site="imu"/></sensor></mujoco>"""


class Gait:
    """Feet's targets in the base over time, and joint angles that reach them, by Newton's steps from the last ones."""

    def __init__(self, robot, model, kind, random):
        self.robot, self.model, self.kind = robot, model, kind
        self.data = mujoco.MjData(model)
        self.phases = random.uniform(0, 2 * np.pi, 40)
        self.q = robot.stand.copy()
        self.pose(self.q)
        self.home = [self.foot(n) for n in range(len(robot.feet))]
        middle = np.mean([p for p, _ in self.home], axis=0)
        com = self.data.subtree_com[1] - self.data.xpos[1]
        shift = np.array([com[0] - middle[0], com[1] - middle[1], 0.0])
        self.home = [(p + shift, r) for p, r in self.home]
        self.height = -min(p[2] for p, _ in self.home)
        # Frequencies of legs that swing, and sizes of all that moves, in proportion to these.
        self.slow = robot.longer**-0.5

    def pose(self, q):
        self.data.qpos[:7] = [0, 0, 0, 1, 0, 0, 0]
        self.data.qpos[7:] = q
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)

    def foot(self, n):
        b, points = self.robot.feet[n]
        rotation = self.data.xmat[b + 1].reshape(3, 3)
        return self.data.xpos[b + 1] + rotation @ np.mean(points, axis=0), rotation.copy()

    def tone(self, k, t, slow):
        p, w = self.phases, 2 * np.pi * slow
        return 0.6 * np.sin(w * t + p[k % 40]) + 0.4 * np.sin(2.3 * w * t + p[(k + 6) % 40])

    def targets(self, t):
        s = self.robot.longer
        ease = 0.5 - 0.5 * np.cos(np.pi * np.clip(t / 1.0, 0, 1))
        if self.kind == "sway":
            two = len(self.home) < 4
            size = np.array([0.02, 0.03, 0.06, 0.006, 0.012, 0.03] if two else [0.12, 0.11, 0.12, 0.03, 0.03, 0.03]) * ease
            r, p, y, dx, dy, dz = (size[k] * self.tone(k, t, f) for k, f in enumerate((0.45, 0.55, 0.35, 0.5, 0.4, 0.6)))
            if two:
                # A humanoid's knees are bent: it moves down more than up.
                dz -= 0.02 * ease
            lifts = [np.zeros(3)] * len(self.home)
            return self.place(turn(r, p, y), np.array([dx, dy, dz]) * s, lifts)
        frequency, duty, lift = {"trot": (2.2, 0.55, 0.07), "flying": (2.6, 0.40, 0.07)}[self.kind]
        frequency *= self.slow
        size = np.array([0.07, 0.06, 0.0, 0.01, 0.01, 0.02]) * ease
        r, p, _, dx, dy, dz = (size[k] * self.tone(k, t, f) for k, f in enumerate((0.5, 0.7, 0.3, 0.6, 0.4, 0.8)))
        ahead, aside, about = 0.25 * ease * self.tone(12, t, 0.11), 0.1 * ease * self.tone(13, t, 0.13), 0.3 * ease * self.tone(14, t, 0.1)
        lifts = []
        for n, (home, _) in enumerate(self.home):
            groups = self.robot.facts.get("groups")
            first = groups[n] == 0 if groups else (home[0] > 0) == (home[1] > 0)
            phase = (frequency * t + (0.0 if first else 0.5)) % 1.0
            speed = np.array([ahead, aside]) * s**0.5 + about * self.slow * np.array([-home[1], home[0]])
            stride = speed * duty / frequency
            if phase < duty:
                push = -0.025 * np.sin(np.pi * phase / duty) if self.kind == "flying" else 0.0
                lifts.append(np.array([*(stride * (0.5 - phase / duty)), push * ease * s]))
            else:
                u = (phase - duty) / (1 - duty)
                smooth = u - np.sin(2 * np.pi * u) / (2 * np.pi)
                lifts.append(np.array([*(stride * (smooth - 0.5)), lift * s * ease * 0.5 * (1 - np.cos(2 * np.pi * u))]))
        return self.place(turn(r, p, 0.0), np.array([dx, dy, dz]) * s, lifts)

    def place(self, rotation, shift, lifts):
        return [(rotation.T @ (home + lift - shift), rotation.T @ turned) for (home, turned), lift in zip(self.home, lifts)]

    def angles(self, t):
        want = self.targets(t)
        jp, jr = np.zeros((3, self.model.nv)), np.zeros((3, self.model.nv))
        for _ in range(3):
            self.pose(self.q)
            for n, leg in enumerate(self.robot.legs):
                at, rotation = self.foot(n)
                error = want[n][0] - at
                mujoco.mj_jac(self.model, self.data, jp, jr, at, self.robot.feet[n][0] + 1)
                columns = [6 + j for j in leg]
                rows = jp[:, columns]
                if len(leg) >= 6:
                    off = want[n][1] @ rotation.T
                    axis = 0.5 * np.array([off[2, 1] - off[1, 2], off[0, 2] - off[2, 0], off[1, 0] - off[0, 1]])
                    error, rows = np.concatenate([error, axis]), np.vstack([rows, jr[:, columns]])
                self.q[leg] += rows.T @ np.linalg.solve(rows @ rows.T + 1e-6 * np.eye(len(rows)), error)
        q = self.q.copy()
        ease = 0.5 - 0.5 * np.cos(np.pi * np.clip(t / 1.0, 0, 1))
        moved = {j for leg in self.robot.legs for j in leg}
        for j in range(len(q)):
            if j not in moved:
                q[j] = 0.15 * ease * self.tone(20 + j, t, 0.6)
        return q


def simulate(robot, kind, seconds, random, ground=0.9, soft=True):
    model = mujoco.MjModel.from_xml_string(robot.mjcf(ground, soft))
    data = mujoco.MjData(model)
    gait = Gait(robot, model, kind, random)
    unit = robot.heavier * robot.longer
    gain_p = GAIN_P * unit * (2.0 if len(robot.feet) < 4 else 1.0)
    gain_d = GAIN_D * unit * robot.longer**0.5 * (2.0 if len(robot.feet) < 4 else 1.0)
    data.qpos[:3] = [0, 0, gait.height + robot.facts["radius"]]
    data.qpos[7:] = gait.angles(0.0)
    geoms = [[mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, f"foot{n}_{k}") for k in range(len(points))] for n, (_, points) in enumerate(robot.feet)]
    rows, later = [], gait.angles(0.0)
    bears = np.zeros(len(robot.joints))
    for step in range(round((seconds + SETTLE) / STEP)):
        t = step * STEP - SETTLE
        if step % CONTROL == 0:
            want, later = later, gait.angles(max(t + CONTROL * STEP, 0.0))
            speed = (later - want) / (CONTROL * STEP)
            torque = gain_p * (want - data.qpos[7:]) + gain_d * (speed - data.qvel[6:])
            data.ctrl[:] = torque + bears
        if t >= 0 and step % SAMPLE == 1:
            mujoco.mj_forward(model, data)
            force, wrench = np.zeros(len(geoms)), np.zeros(6)
            for k in range(data.ncon):
                for n, own in enumerate(geoms):
                    if set(own) & set(data.contact[k].geom):
                        mujoco.mj_contactForce(model, data, k, wrench)
                        force[n] += wrench[0]
            rows.append((t, data.qpos[7:].copy(), data.qvel[6:].copy(), data.ctrl.copy(), data.sensordata[:3].copy(), data.sensordata[3:6].copy(), force))
            tilt = data.qpos[3:7]
            assert data.qpos[2] > 0.5 * gait.height and 1 - 2 * (tilt[1] ** 2 + tilt[2] ** 2) > 0.8, (kind, t, "fell")
        if step % CONTROL == 0:
            # Gravity of what hangs on the trunk is borne ahead of the controller; what stands on the ground is not.
            bears = data.qfrc_bias[6:].copy() if t < -1 else bears
        mujoco.mj_step(model, data)
    return rows


def written(robot, rows, random, bias, sensors):
    heads = ["t"] + [f"{c}/{j}" for c in ("q", "dq", "tau") for j in robot.joints] + [f"{c}/{a}" for c in ("gyro", "acc") for a in "xyz"]
    heads += [f"foot/{limb}" for limb in robot.facts["limbs"]] if sensors else []
    unit, out = robot.heavier * robot.longer, []
    for t, q, dq, tau, gyro, acc, force in rows:
        dq = dq + SPEED * random.normal(size=len(dq))
        tau = tau + TORQUE * unit * random.normal(size=len(tau))
        gyro = gyro + bias[0] + GYRO * random.normal(size=3)
        acc = acc + bias[1] + ACC * random.normal(size=3)
        feet = force + 0.01 * robot.mass * random.normal(size=len(force)) if sensors else []
        q = np.round(q / 3e-5) * 3e-5
        out.append(f"{t:.4f}," + ",".join([*(f"{x:.6f}" for x in q), *(f"{x:.4f}" for x in dq), *(f"{x:.5g}" for x in tau), *(f"{x:.4f}" for x in gyro),
                                           *(f"{x:.3f}" for x in acc), *(f"{x:.1f}" for x in feet)]))
    return ",".join(heads) + "\n" + "\n".join(out) + "\n"


def model_file(robot, folder):
    f = robot.facts
    text = f'format = 1\n\n[robot]\nurdf = "{os.path.relpath(robot.path, folder)}"\n'
    for limb in f["limbs"]:
        place = f'points = {[list(p) for p in f["points"]]}' if "points" in f else f'place = {list(map(float, f.get("centre", (0, 0, 0))))}'
        text += f'\n[[foot]]\nname = "{limb}"\nlink = "{f["foot"].format(limb)}"\n{place}\nradius = {f["radius"]}\n'
    if "imu" in f:
        text += f'\n[imu]\nplace = {list(map(float, f["imu"][0]))}\nrpy = {list(map(float, f["imu"][1]))}\n'
    return text


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("robot", choices=ROBOTS)
    parser.add_argument("gait", choices=["trot", "flying", "sway"])
    parser.add_argument("-o", type=Path, required=True, help="the log; the model and the truth go beside it")
    parser.add_argument("--share", type=Path, default=HERE, help="folder of example-robot-data's robots")
    parser.add_argument("--seconds", type=float, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--load", type=float, nargs=4, help="kg and m, m, m on the trunk")
    parser.add_argument("--imu-off", type=float, nargs=3, default=(0, 0, 0), help="the IMU is so far (m) from where the model has it")
    parser.add_argument("--hard", action="store_true", help="ground that gives way less")
    parser.add_argument("--packed", action="store_true", help="write the log as .csv.gz")
    parser.add_argument("--no-sensors", action="store_true", help="no foot/ columns")
    args = parser.parse_args()
    random = np.random.default_rng([args.seed, 11])
    robot = Robot(args.robot, args.share, args.imu_off)
    cad = robot.mass
    robot.perturb(random, args.load)
    bias = 0.003 * random.normal(size=3), np.array([0.05, -0.04, 0.08]) * random.choice([-1, 1], 3)
    rows = simulate(robot, args.gait, args.seconds, random, soft=not args.hard)
    text = written(robot, rows, random, bias, not args.no_sensors)
    if args.packed:
        args.o.with_suffix(".csv.gz").write_bytes(gzip.compress(text.encode(), 9, mtime=0))
    else:
        args.o.write_text(text)
    args.o.with_suffix(".toml").write_text(model_file(robot, args.o.resolve().parent))
    base = robot.bodies[0]
    model = mujoco.MjModel.from_xml_string(robot.mjcf(0.9, True))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    truth = {"robot": args.robot, "gait": args.gait, "cad": cad, "mass": sum(b.mass for b in robot.bodies), "com_base": list(base.moment / base.mass),
             "bodies": {b.name: b.ten() for b in robot.bodies}, "friction": robot.friction, "acc_bias": list(bias[1]), "load": args.load,
             "imu_off": list(args.imu_off), "mujoco": mujoco.__version__, "numpy": np.__version__}
    args.o.with_suffix(".truth.json").write_text(json.dumps(truth, indent=1) + "\n")
    air = np.mean([[f < 1e-6 for f in row[6]] for row in rows])
    print(f"{args.robot} {args.gait}: {len(rows)} samples, {robot.mass:.2f} kg on paper, {truth['mass']:.3f} kg; a foot is in the air for {100 * air:.0f} % of the time")


if __name__ == "__main__":
    main()
