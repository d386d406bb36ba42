"""Logs of a whole Go2 that MuJoCo walks on ground that gives way by a millimetre, with gyro, accelerometer and foot counts. See README.md.

The robot is the oracle's free Go2 (`manifest.json`) with other masses than the CAD's. A PD controller of 1 kHz follows joint
angles from a gait; the log has 500 Hz, a Go2's quanta and noise, and an IMU with noise and bias. Beside the logs lies the truth.
"""

import argparse
import gzip
import io
import json
from pathlib import Path

import mujoco
import numpy as np

from generate import GRAVITY

HERE = Path(__file__).resolve().parent
FOLDER = HERE / "walk"
LEGS = ["FR", "FL", "RR", "RL"]
FRONT, SIDE = np.array([1, 1, -1, -1]), np.array([-1, 1, -1, 1])
JOINTS = [f"{leg}_{part}" for leg in LEGS for part in ("hip", "thigh", "calf")]
AXES = [(1, 0, 0), (0, 1, 0), (0, 1, 0)]
HIP, THIGH, LINK = np.array([0.1934, 0.0465, 0]), 0.0955, 0.213  # m
FOOT, RADIUS = (-0.002, 0, -LINK), 0.022  # m
IMU = (-0.02557, 0, 0.04232)  # m
MASS = 16.1  # kg: what a gait takes the robot for
STEP, CONTROL, SAMPLE = 5e-4, 2, 4  # s; steps per tick of the controller and per sample
GAIN_P, GAIN_D = 80.0, 2.0  # N m/rad, N m s/rad
EFFORT = np.tile([23.7, 23.7, 45.43], 4)  # N m
GEAR = np.tile([6.333, 6.333, 6.333 * 23 / 12], 4)
QUANTA = np.array([2 * np.pi / 32768 / GEAR, 2 * np.pi / 256 / GEAR, GEAR / 256])  # rad, rad/s, N m
NOISE = np.tile([0.035, 0.035, 0.022], 4), 0.05  # rad/s, N m
GYRO, ACC = (0.00107, 0.005), (0.0012, 0.05)  # quantum and noise, rad/s, m/s²
FRICTION = {
    "viscous": np.tile([0.03, 0.04, 0.05], 4),
    "coulomb": np.tile([0.15, 0.12, 0.35], 4),
    "armature": np.tile([0.005, 0.005, 0.018], 4),
}
SETTLE = 1.0  # s of standing before the log begins

# Per log: gait, seconds, seed of the robot, load on the trunk (kg, m, m, m).
LOGS = {
    "trot": ("trot", 4.5, 1, None),
    "load": ("trot", 4.5, 1, (2.0, 0.05, -0.02, 0.07)),
    "flying": ("flying", 4.5, 2, None),
    "sway": ("sway", 4.5, 3, None),
    "swung": ("swung", 4.5, 4, None),
    # As long as what is asked of a load's mass and place, and of the trunk's: see tests/tests/free_base.
    "trot_30s": ("trot", 30.0, 1, None),
    "load_30s": ("trot", 30.0, 1, (2.0, 0.05, -0.02, 0.07)),
    "sway_30s": ("sway", 30.0, 3, None),
    "slip": ("trot", 4.5, 5, None),
    "hop": ("hop", 4.5, 6, None),
    "leash": ("trot", 4.5, 1, None),
}
# The ground's friction: rubber on most floors, and on one where feet slide at every step.
GROUND = 0.9
SLIPPERY = {"slip": 0.15}
# A leash that lifts the trunk, N: a tenth of the weight, below what says by itself that the legs do not carry the robot.
LEASH = {"leash": 15.0}
SLIDES = 0.02  # m/s: a foot on the ground that is faster does not creep
STANDING = np.tile([0.0, 0.8, -1.6], 4)  # rad: where the whole robot's centre of mass is told
HOP = 2.4, 0.60  # Hz; share of a hop with the feet on the ground
SCALE = 0.005  # of an IMU's readings: data sheets say within 1 %
EARTH = 9.780, 9.832  # m/s²: gravity at the equator and at the poles
SWUNG = 1.5  # m: how high a hand holds the trunk


def robot(seed, load):
    """φ of the 13 bodies: the CAD's, its masses and centres of mass off, and a load on the trunk."""
    random = np.random.default_rng([seed, 7])
    theta = json.loads((HERE / "manifest.json").read_text())["systems"]["free"]["theta"]
    bodies = []
    for b, phi in enumerate(np.reshape(theta, (13, 10))):
        m, com, inertia = about_com(phi)
        m *= 1 + 0.03 * random.normal()
        com = com + random.normal(size=3) * (0.005 if b == 0 else 0.001)
        bodies.append(about_origin(m, com, inertia))
    if load:
        m, *place = load
        bodies[0] = bodies[0] + about_origin(m, np.array(place), np.eye(3) * 0.4 * m * 0.04**2)
    return bodies


def about_com(phi):
    m, h = phi[0], phi[1:4]
    xx, xy, xz, yy, yz, zz = phi[4:]
    com = h / m
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return m, com, inertia - m * (com @ com * np.eye(3) - np.outer(com, com))


def about_origin(m, com, inertia):
    full = inertia + m * (com @ com * np.eye(3) - np.outer(com, com))
    return np.array([m, *(m * com), *(full[k] for k in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)))])


def mjcf(bodies, ground=GROUND, gravity=GRAVITY):
    text = lambda numbers: " ".join(repr(float(x)) for x in numbers)

    def inertial(phi):
        m, com, inertia = about_com(phi)
        full = [inertia[k] for k in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
        return f'<inertial pos="{text(com)}" mass="{float(m)!r}" fullinertia="{text(full)}"/>'

    legs = ""
    for n in range(4):
        origins = [HIP * [FRONT[n], SIDE[n], 0], (0, THIGH * SIDE[n], 0), (0, 0, -LINK)]
        for part in range(3):
            j = 3 * n + part
            legs += f"""<body name="{JOINTS[j]}" pos="{text(origins[part])}">{inertial(bodies[1 + j])}
              <joint name="{JOINTS[j]}" axis="{text(AXES[part])}" damping="{FRICTION['viscous'][j]}"
                frictionloss="{FRICTION['coulomb'][j]}" armature="{FRICTION['armature'][j]}"/>"""
        legs += f'<geom name="{LEGS[n]}" type="sphere" size="{RADIUS}" pos="{text(FOOT)}"/></body></body></body>'
    motors = "".join(f'<motor joint="{j}"/>' for j in JOINTS)
    return f"""<mujoco><option timestep="{STEP}" gravity="0 0 {-gravity}" integrator="implicitfast" iterations="30"
        tolerance="1e-9" cone="elliptic" impratio="10"/>
      <default><joint limited="false" solreffriction="{4 * STEP} 1" solimpfriction="0.999 0.9999 0.001"/>
        <geom mass="0" condim="3" friction="{ground} 0 0" solref="0.008 1" solimp="0.8 0.97 0.003"/></default>
      <worldbody><geom type="plane" size="0 0 1"/><body name="base" pos="0 0 0.33"><freejoint/>{inertial(bodies[0])}
        <site name="imu" pos="{text(IMU)}"/>{legs}</body></worldbody>
      <actuator>{motors}</actuator>
      <sensor><gyro site="imu"/><accelerometer site="imu"/></sensor></mujoco>"""


def leg_angles(n, foot):
    """Joint angles that put leg n's foot there, in the axes of the base about the leg's hip."""
    x, y, z = foot
    side = SIDE[n] * THIGH
    reach = np.sqrt(max(y * y + z * z - side * side, 1e-4))
    hip = np.arctan2(z, y) - np.arctan2(-reach, side)
    length = min(np.hypot(x, reach), 2 * LINK - 1e-3)
    knee = -(np.pi - np.arccos(np.clip(1 - length**2 / (2 * LINK**2), -1, 1)))
    thigh = np.arctan2(-x, reach) - knee / 2
    return np.array([np.arctan2(np.sin(hip), np.cos(hip)), thigh, knee])


def foot_at(n, angles):
    """Where leg n's foot is from its hip, in the base's axes: what `leg_angles` takes."""
    hip, thigh, calf = angles
    below = turn(0, calf, 0) @ [0, 0, -LINK] + [0, 0, -LINK]
    return turn(hip, 0, 0) @ (turn(0, thigh, 0) @ below + [0, THIGH * SIDE[n], 0])


def turn(roll, pitch, yaw):
    c, s = np.cos, np.sin
    x = np.array([[1, 0, 0], [0, c(roll), -s(roll)], [0, s(roll), c(roll)]])
    y = np.array([[c(pitch), 0, s(pitch)], [0, 1, 0], [-s(pitch), 0, c(pitch)]])
    z = np.array([[c(yaw), -s(yaw), 0], [s(yaw), c(yaw), 0], [0, 0, 1]])
    return z @ y @ x


class Gait:
    """Joint angles over time, and the body's pose as feet on the ground would have it."""

    def __init__(self, kind, random):
        self.kind = kind
        self.phases = random.uniform(0, 2 * np.pi, 12)

    def tone(self, n, t, slow):
        p = self.phases
        return 0.6 * np.sin(2 * np.pi * slow * t + p[n]) + 0.4 * np.sin(2 * np.pi * 2.3 * slow * t + p[(n + 6) % 12])

    def angles(self, t):
        ease = 0.5 - 0.5 * np.cos(np.pi * np.clip(t / 1.0, 0, 1))
        height = 0.29
        if self.kind == "swung":
            tones = [self.tone(k, t, f) for k, f in enumerate((0.9, 1.1, 1.4) * 4)]
            return np.tile([0.0, 0.8, -1.6], 4) + ease * np.tile([0.4, 0.6, 0.6], 4) * tones
        if self.kind == "sway":
            size = np.array([0.12, 0.11, 0.12, 0.03, 0.03, 0.03]) * ease
            r, p, y, dx, dy, dz = (size[k] * self.tone(k, t, f) for k, f in enumerate((0.45, 0.55, 0.35, 0.5, 0.4, 0.6)))
            return self.place([(0, 0, 0)] * 4, height + dz, turn(r, p, y), (dx, dy))
        frequency, duty, lift = {"trot": (2.2, 0.55, 0.07), "flying": (2.6, 0.40, 0.07), "hop": (*HOP, 0.03)}[self.kind]
        size = np.array([0.04, 0.04, 0.0, 0.01, 0.01, 0.01] if self.kind == "hop" else [0.07, 0.06, 0.0, 0.01, 0.01, 0.02]) * ease
        r, p, _, dx, dy, dz = (size[k] * self.tone(k, t, f) for k, f in enumerate((0.5, 0.7, 0.3, 0.6, 0.4, 0.8)))
        ahead, aside, about = 0.25 * ease * self.tone(2, t, 0.11), 0.1 * ease * self.tone(3, t, 0.13), 0.3 * ease * self.tone(4, t, 0.1)
        feet = []
        for n in range(4):
            phase = (frequency * t + (0.0 if n in (0, 3) or self.kind == "hop" else 0.5)) % 1.0
            speed = np.array([ahead, aside]) + about * np.array([-SIDE[n] * 0.142, FRONT[n] * 0.1934])
            stride = speed * duty / frequency
            if phase < duty:
                at = 0.5 - phase / duty
                push = -0.025 * np.sin(np.pi * phase / duty) if self.kind == "flying" else 0.0
                feet.append((*(stride * at), push * ease))
            else:
                s = (phase - duty) / (1 - duty)
                smooth = s - np.sin(2 * np.pi * s) / (2 * np.pi)
                feet.append((*(stride * (smooth - 0.5)), lift * ease * 0.5 * (1 - np.cos(2 * np.pi * s))))
        if self.kind == "hop":
            dz += ease * self.bounce(t)[0]
        return self.place(feet, height + dz, turn(r, p, 0.0), (dx, dy))

    def bounce(self, t):
        """How much higher a hopping trunk is than at touch-down (m), and its specific force (m/s²): thrown, and caught at a constant one."""
        frequency, duty = HOP
        stance, flight = duty / frequency, (1 - duty) / frequency
        speed, since = GRAVITY * flight / 2, frequency * t % 1.0 / frequency
        if since < stance:
            return speed * since * (since / stance - 1), GRAVITY / duty
        return speed * (since - stance) * (1 - (since - stance) / flight), 0.0

    def torque(self, t):
        """What bears the robot ahead of the controller: of a hop, which no controller of positions throws up."""
        if self.kind != "hop":
            return 0.0
        ease = 0.5 - 0.5 * np.cos(np.pi * np.clip(t / 1.0, 0, 1))
        bears = MASS * ((1 - ease) * GRAVITY + ease * self.bounce(t)[1]) / 4
        angles, torque = self.angles(t), []
        for n in range(4):
            of = lambda q: foot_at(n, q)[2]
            at = angles[3 * n : 3 * n + 3]
            torque += [-bears * (of(at + d) - of(at - d)) / 2e-6 for d in 1e-6 * np.eye(3)]
        return np.array(torque)

    def place(self, feet, height, rotation, shift):
        angles = []
        for n in range(4):
            hip = HIP * [FRONT[n], SIDE[n], 0]
            stand = hip + [0, SIDE[n] * THIGH, 0]
            at = np.array([stand[0] + feet[n][0] - shift[0], stand[1] + feet[n][1] - shift[1], feet[n][2] - height + RADIUS])
            angles.append(leg_angles(n, rotation.T @ at - hip))
        return np.concatenate(angles)


def by_hand(data, t):
    """Force and moment on the trunk of a hand that swings the robot to and fro, up and down and about."""
    ease, wave = 0.5 - 0.5 * np.cos(np.pi * np.clip(t, 0, 1)), lambda f, p=0.0: np.sin(2 * np.pi * f * t + p)
    there = np.array([0.25 * ease * wave(0.5), 0.2 * ease * wave(0.4), SWUNG + 0.15 * ease * wave(0.7)])
    force = 2500 * (there - data.qpos[:3]) - 200 * data.qvel[:3] + np.array([0, 0, 16 * GRAVITY])
    is_now = np.zeros(9)
    mujoco.mju_quat2Mat(is_now, data.qpos[3:7])
    is_now = is_now.reshape(3, 3)
    off = turn(*(ease * np.array([0.4 * wave(0.6), 0.4 * wave(0.45, 1.0), 0.2 * wave(0.3)]))) @ is_now.T
    axis = 0.5 * np.array([off[2, 1] - off[1, 2], off[0, 2] - off[2, 0], off[1, 0] - off[0, 1]])
    return [*force, *(150 * axis - 12 * (is_now @ data.qvel[3:6]))]


def leash(lift):
    """Force and moment on the trunk of what lifts it steadily, N."""
    return (lambda data, t: [0, 0, lift, 0, 0, 0]) if lift else None


def simulate(kind, seconds, bodies, random, gait=None, ground=GROUND, slides=None, gravity=GRAVITY, outside=None):
    """Rows of a log; to `slides` is added how fast each foot slides that carries a force, m/s. A gait of one's own has `angles(t)`, and may have `torque(t)`, the feed-forward.
    `outside(data, t)` is the force and moment on the trunk of what is no foot."""
    model = mujoco.MjModel.from_xml_string(mjcf(bodies, ground, gravity))
    data = mujoco.MjData(model)
    gait = gait or Gait(kind, random)
    ahead = getattr(gait, "torque", lambda t: 0.0)
    outside = by_hand if kind == "swung" else outside
    data.qpos[2] = SWUNG if kind == "swung" else 0.30
    base = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, "base")
    data.qpos[7:] = gait.angles(0.0)
    feet = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, leg) for leg in LEGS]
    rows = []
    later = gait.angles(0.0)
    for step in range(round((seconds + SETTLE) / STEP)):
        t = step * STEP - SETTLE
        if step % CONTROL == 0:
            want, later = later, gait.angles(max(t + CONTROL * STEP, 0.0))
            speed = (later - want) / (CONTROL * STEP)
            torque = GAIN_P * (want - data.qpos[7:]) + GAIN_D * (speed - data.qvel[6:])
            data.ctrl[:] = np.clip(torque + ahead(max(t, 0.0)), -EFFORT, EFFORT)
        if outside:
            data.xfrc_applied[base] = outside(data, t)
        if t >= 0 and step % SAMPLE == min(1, SAMPLE - 1):
            mujoco.mj_forward(model, data)
            force, wrench = np.zeros(4), np.zeros(6)
            for k in range(data.ncon):
                for n, geom in enumerate(feet):
                    if geom in data.contact[k].geom:
                        mujoco.mj_contactForce(model, data, k, wrench)
                        force[n] += wrench[0]
                        if slides is not None and wrench[0] > 0:
                            slides.append(sliding(model, data, data.contact[k].pos, feet[n]))
            rows.append((t, data.qpos[7:].copy(), data.qvel[6:].copy(), data.ctrl.copy(),
                         data.sensordata[:3].copy(), data.sensordata[3:6].copy(), force))
            tilt = data.qpos[3:7]
            assert data.qpos[2] > 0.15 and 1 - 2 * (tilt[1] ** 2 + tilt[2] ** 2) > 0.8, (kind, t, "fell")
        mujoco.mj_step(model, data)
    return rows


def sliding(model, data, at, geom):
    """How fast the point of a foot that touches the ground moves along it, m/s."""
    jacobian = np.zeros((3, model.nv))
    mujoco.mj_jac(model, data, jacobian, None, at, model.geom_bodyid[geom])
    return float(np.hypot(*(jacobian[:2] @ data.qvel)))


def written(rows, random, bias):
    """The log as text: noise, bias, quanta, decimals that are finer than these."""
    heads = ["t"] + [f"{c}/{j}" for c in ("q", "dq", "tau") for j in JOINTS]
    heads += [f"{c}/{a}" for c in ("gyro", "acc") for a in "xyz"] + [f"foot/{leg}" for leg in LEGS]
    out = io.StringIO()
    out.write(",".join(heads) + "\n")
    offset, gain = random.uniform(8, 20, 4), random.uniform(0.3, 0.6, 4)
    count = np.zeros(4)
    for t, q, dq, tau, gyro, acc, force in rows:
        dq = dq + NOISE[0] * random.normal(size=12)
        tau = tau + NOISE[1] * random.normal(size=12)
        gyro = gyro * (1 + bias["gyro_scale"]) + bias["gyro"] + GYRO[1] * random.normal(size=3)
        acc = acc * (1 + bias["acc_scale"]) + bias["acc"] + ACC[1] * random.normal(size=3)
        # A pad of rubber and air: 10 ms late, an offset and a gain of its own.
        count += (force - count) * (1 - np.exp(-STEP * SAMPLE / 0.01))
        feet = np.round(offset + gain * count + random.normal(size=4))
        cells = []
        for x, quantum, places in zip((q, dq, tau), QUANTA, (5, 4, 3)):
            cells += [f"{v:.{places}f}" for v in np.round(x / quantum) * quantum]
        cells += [f"{v:.4f}" for v in np.round(gyro / GYRO[0]) * GYRO[0]]
        cells += [f"{v:.3f}" for v in np.round(acc / ACC[0]) * ACC[0]]
        cells += [f"{v:.0f}" for v in feet]
        out.write(f"{t:.4f}," + ",".join(cells) + "\n")
    return out.getvalue()


def standing_com(bodies):
    """The whole robot's centre of mass about the base's origin, m."""
    model = mujoco.MjModel.from_xml_string(mjcf(bodies))
    data = mujoco.MjData(model)
    data.qpos[:] = [0, 0, 0, 1, 0, 0, 0, *STANDING]
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    return list(map(float, data.subtree_com[mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, "base")]))


def told(gait, load, bodies, bias):
    """The truth that lies beside a log."""
    return {
        "gait": gait,
        "load": load,
        "mass": float(sum(phi[0] for phi in bodies)),
        "com": standing_com(bodies),
        "bodies": {b: dict(zip("m hx hy hz Ixx Ixy Ixz Iyy Iyz Izz".split(), map(float, phi)))
                   for b, phi in zip(["base", *JOINTS], bodies)},
        "effects": {f"{e}:{j}": float(x) for e, values in FRICTION.items() for j, x in zip(JOINTS, values)},
        "acc_bias": list(map(float, bias["acc"])),
        "gyro_bias": list(map(float, bias["gyro"])),
    }


def imu_bias(random):
    gyro, acc = 0.003 * random.normal(size=3), np.array([0.05, -0.04, 0.08]) * random.choice([-1, 1], 3)
    return {"gyro": gyro, "acc": acc, "gyro_scale": 0.0, "acc_scale": 0.0}


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("-o", type=Path, default=FOLDER)
    parser.add_argument("--seconds", type=float)
    parser.add_argument("--seed", type=int, default=0, help="another robot, gait and noise, somewhere else on the Earth")
    parser.add_argument("logs", nargs="*", default=[])
    args = parser.parse_args()
    args.o.mkdir(exist_ok=True, parents=True)
    truth = {}
    for name in args.logs or LOGS:
        gait, seconds, seed, load = LOGS[name]
        seed += args.seed
        random = np.random.default_rng([seed, 3])
        bodies = robot(seed, load)
        bias = imu_bias(random)
        slides = [] if name in SLIPPERY else None
        # The committed logs are of 9.81 m/s² and an IMU of the right scale; other robots are where they are, with the IMU that they have.
        gravity = GRAVITY
        if args.seed:
            elsewhere = np.random.default_rng([seed, 5])
            gravity = float(elsewhere.uniform(*EARTH))
            bias["gyro_scale"], bias["acc_scale"] = map(float, SCALE * elsewhere.normal(size=2))
        rows = simulate(gait, args.seconds or seconds, bodies, random, ground=SLIPPERY.get(name, GROUND), slides=slides, gravity=gravity,
                        outside=leash(LEASH.get(name)))
        packed = gzip.compress(written(rows, random, bias).encode(), 9, mtime=0)
        (args.o / f"{name}.csv.gz").write_bytes(packed)
        air = np.mean([[f < 1e-6 for f in row[6]] for row in rows])
        print(f"{name}: {len(rows)} samples, {len(packed)} bytes; a foot is in the air for {100 * air:.0f} % of the time")
        truth[name] = told(gait, load, bodies, bias)
        if args.seed:
            truth[name] |= {"gravity": gravity, "gyro_scale": bias["gyro_scale"], "acc_scale": bias["acc_scale"]}
        if slides:
            fast = [speed for speed in slides if speed > SLIDES]
            truth[name]["slip"] = {"share": len(fast) / len(slides), "speed": float(np.sqrt(np.mean(np.square(fast))))}
            print(f"  feet that carry a force slide for {100 * truth[name]['slip']['share']:.0f} % of that time, at {truth[name]['slip']['speed']:.2f} m/s rms")
    before = args.o / "truth.json"
    if args.logs and before.exists():
        # Logs that are not made anew keep their truth.
        truth = json.loads(before.read_text())["logs"] | truth
    manifest = {"command": "python mujoco_walk.py", "mujoco": mujoco.__version__, "numpy": np.__version__, "logs": truth}
    (args.o / "truth.json").write_text(json.dumps(manifest, indent=1) + "\n")


if __name__ == "__main__":
    main()
