"""What `diagnose` names of what another program hides: motions of robots, torques by Pinocchio's inverse dynamics, and one effect beside a plain drive.

    python3 -m venv target/pinocchio && target/pinocchio/bin/pip install -r studies/pinocchio/requirements.txt
    cargo build --release -p proprio
    target/pinocchio/bin/python studies/pinocchio/cases.py target/release/proprio --write

Nothing here is proprio's: bodies, motions, friction and noise are this file's, and the URDFs are those of example-robot-data (the Go2's leg:
tests/oracle/go2.urdf). Each robot has its own bodies, 4 % off the URDF's, and its own drive, as shares of each joint's torque. The model that is given
is the URDF alone. A second part adds a load to arms that were diagnosed without it. Twenty minutes of two cores.
"""

import argparse
import json
import re
import subprocess
import tempfile
import zlib
from concurrent.futures import ThreadPoolExecutor
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
# Which of them the catalogue has; what is found for the others is a formula, or the sentence that the catalogue lacks it.
CATALOGUE = ["spring", "stribeck", "quadratic_drag", "load_friction", "cogging", "payload", "torque_gain", "velocity_gain", "delay", "coupled_viscous", "presliding"]
OUTSIDE = ["grown_friction", "end_stop", "position_friction", "cable"]
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


def hidden(effect, model, t, q, dq, tau, drive, random):
    """What one effect adds to the torque, what the log then says of position, velocity and torque, and the joint."""
    j = int(random.integers(0, model.nv))
    own, sign, size = np.zeros_like(tau), np.tanh(dq[:, j] / 0.002), random.uniform(0.08, 0.2) * drive.size[j]
    away = q[:, j] - (q[:, j].max() + q[:, j].min()) / 2
    gains, fast, lag = np.ones(model.nv), np.ones(model.nv), 0.0
    if effect == "spring":
        own[:, j] = size / np.std(away) * (away - random.uniform(-0.3, 0.3))
    elif effect == "stribeck":
        own[:, j] = size * sign * np.exp(-((dq[:, j] / (random.uniform(0.1, 0.4) * rms(dq[:, j]))) ** 2))
    elif effect == "quadratic_drag":
        own[:, j] = size * dq[:, j] * abs(dq[:, j]) / np.mean(dq[:, j] ** 2)
    elif effect == "load_friction":
        own[:, j] = size / drive.size[j] * sign * abs(tau[:, j])
    elif effect == "cogging":
        own[:, j] = size * np.sin(random.choice([6, 12, 20, 36]) * q[:, j] + random.uniform(0, 6))
    elif effect == "torque_gain":
        gains[j] += random.choice([-1, 1]) * random.uniform(0.1, 0.2)
    elif effect == "velocity_gain":
        fast[j] += random.choice([-1, 1]) * random.uniform(0.06, 0.15)
    elif effect == "delay":
        lag = random.uniform(0.002, 0.006)
    elif effect == "coupled_viscous":
        j = max(1, j)
        apart = dq[:, j] - dq[:, j - 1]
        own[:, j] = size / rms(apart) * apart
        own[:, j - 1] = -own[:, j]
    elif effect == "presliding":
        most = random.uniform(0.04, 0.12) * np.std(away)
        z, bristle = 0.0, np.zeros(len(t))
        for n in range(1, len(t)):
            z = np.clip(z + q[n, j] - q[n - 1, j], -most, most)
            bristle[n] = z / most
        own[:, j] = drive.coulomb[j] * (bristle - sign)
    elif effect == "grown_friction":
        own[:, j] = 2 * size * sign * (t > random.uniform(0.25, 0.75) * SECONDS)
    elif effect == "end_stop":
        beyond = np.maximum(away - np.quantile(away, 0.85), 0)
        own[:, j] = 3 * size * beyond / np.quantile(beyond, 0.97)
    elif effect == "position_friction":
        own[:, j] = 2 * size * sign * np.sin(np.pi / 2 * away / np.std(away))
    elif effect == "cable":
        own[:, j] = 2 * size * away * abs(away) / np.mean(away**2)
    return j, own, gains, fast, lag


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


def make(robot, effect, seed, folder):
    """A robot with one effect; the joint that has it."""
    random = np.random.default_rng([seed, zlib.crc32(f"{robot} {effect}".encode())])
    model, names = load(robot)
    is_leg = robot == "Go2's leg"
    rate, noise = settings(random)
    t, q, dq, ddq = motion(model, is_leg, rate, random)
    scattered(model, random)
    tau = torque(model, q, dq, ddq)
    drive = Drive(tau, dq, ddq, random)
    j, own, gains, fast, lag = hidden(effect, model, t, q, dq, tau, drive, random)
    if effect == "payload":
        j, tau = model.nv - 1, torque(loaded(model, random, is_leg)[0], q, dq, ddq)
    tau = (tau + drive.torque(dq, ddq) + own) * gains
    tau = np.stack([np.interp(t - lag, t, column) for column in tau.T], axis=1)
    write_log(folder / "log.csv", names, t, q, dq * fast, tau, random, noise, drive.size)
    write_model(robot, folder / "model.toml")
    return names[j]


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


def heavier(found):
    """Of each body whose mass a diagnosis finds above the model's: by how much, and the standard deviation of that, kg."""
    told = "(.*): mass ([^ ]*) ± ([^ ]*) kg, the URDF says ([^ ]*) ± ([^ ]*) kg"
    matches = [re.match(told, body) for body in found.get("bodies", [])]
    numbers = {match[1]: [float(number) for number in match.groups()[1:]] for match in matches if match}
    return {link: (now - was, (std**2 + known**2) ** 0.5) for link, (now, std, was, known) in numbers.items() if now > was}


def of_case(proprio, robot, effect, seed):
    with tempfile.TemporaryDirectory() as folder:
        joint = make(robot, effect, seed, Path(folder))
        # Without a model file the robot is a Go2.
        model = ["-m", "model.toml"] if ROBOTS[robot] else []
        found = said(proprio, folder, "diagnose", "log.csv", *model)
    if found["verdict"] == "refused" or "path" not in found:
        return effect, f"{robot}, {effect}: refused", "refused"
    names, after, floor = named(found), found["error"]["after"], found["error"]["floor"]
    masses = heavier(found)
    at = "base" if effect == "delay" else joint
    if effect == "none":
        verdict = "right" if not names and not found["outside_catalogue"] else "wrong"
    elif effect in OUTSIDE:
        formula = [one for one in names if one[1] == joint and one[0] not in CATALOGUE]
        verdict = "right" if formula and names[0] == formula[0] else "outside" if found["outside_catalogue"] else "wrong"
    elif effect == "payload" and not names:
        # A load is a body that is heavier.
        verdict = "right" if masses else "wrong"
    else:
        verdict = "right" if names == [(effect, at)] else "with others" if (effect, at) in names else "wrong"
    shown = ", ".join([f"{name}:{where}" for name, where in names] + [f"mass of {link}" for link in masses]) or "nothing"
    floor = "unknown" if floor is None else f"{floor:.4g} N m"
    return effect, f"{robot}, {effect} at {joint}: {shown}; {after:.4g} N m, floor {floor}", verdict


def of_load(proprio, robot, seed):
    """A load on an arm whose model was diagnosed without it: how far its mass is off, in standard deviations."""
    random = np.random.default_rng([seed, zlib.crc32(robot.encode())])
    model, names = load(robot)
    rate, noise = settings(random)
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        write_model(robot, folder / "model.toml")
        first = motion(model, False, rate, random)
        second = motion(model, False, rate, random)
        scattered(model, random, 0.05)
        heavy, mass = loaded(model, random, False)
        drive = Drive(torque(model, *first[1:]), *first[2:], random)
        for name, bodies, (t, q, dq, ddq) in (("before.csv", model, first), ("after.csv", heavy, second)):
            tau = torque(bodies, q, dq, ddq) + drive.torque(dq, ddq)
            write_log(folder / name, names, t, q, dq, tau, random, noise, drive.size)
        said(proprio, folder, "diagnose", "before.csv", "-m", "model.toml", "--apply")
        gains = (folder / "model.toml").read_text().count("torque_gain")
        found = said(proprio, folder, "diagnose", "after.csv", "-m", "model.toml")
    own = [one for one in found.get("candidates", []) if one["effect"] == "payload" and one["joints"] == [names[-1]]]
    off = None
    if own and ("payload", names[-1]) in named(found):
        parameters = own[0]["parameters"]
        told = parameters[0][0] if isinstance(parameters[0], list) else parameters[0]
        off = (told["value"] - mass) / told["std"]
    elif len(bodies := heavier(found)) == 1:
        [(more, std)] = bodies.values()
        off = (more - mass) / std
    return robot, f"{robot}, {mass:.2f} kg: " + ("not named" if off is None else f"{off:+.1f} σ") + f", {gains} torque gains", (off, gains)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("proprio", type=Path)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--loads", type=int, default=10, help="robots with a load, of each arm")
    parser.add_argument("--only", default="", help="effects or robots whose name has this")
    parser.add_argument("--write", action="store_true", help="keep the table")
    asked = parser.parse_args()
    proprio = asked.proprio.resolve()
    cases = [(robot, effect) for effect in ["none", *CATALOGUE, *OUTSIDE] for robot in ROBOTS if asked.only in f"{robot} {effect}"]
    arms = [robot for robot in ("UR5", "UR10", "Panda") if asked.only in f"{robot} load"]

    def run(call):
        effect, line, verdict = call()
        print(f"{verdict}: {line}" if isinstance(verdict, str) else line, flush=True)
        return effect, line, verdict

    calls = [lambda robot=robot, effect=effect: of_case(proprio, robot, effect, asked.seed) for robot, effect in cases]
    loads = [lambda robot=robot, n=n: of_load(proprio, robot, asked.seed + n) for robot in arms for n in range(asked.loads)]
    with ThreadPoolExecutor(2) as pool:
        judged, carried = list(pool.map(run, calls)), list(pool.map(run, loads))

    text = (
        "# Logs that Pinocchio made\n\n"
        f"`studies/pinocchio/cases.py PROPRIO --seed {asked.seed} --write`: one robot a cell ({', '.join(ROBOTS)}), 20 s, 250 to 1000 Hz, noise of 0.3 to 3 % of the torque,\n"
        "bodies 4 % off the URDF's, which is all that `diagnose` is given.\n\n"
        "| hidden | right | the effect, and others | outside said | wrong | refused |\n|---|---|---|---|---|---|\n"
    )
    for effect in dict.fromkeys(effect for effect, _, _ in judged):
        verdicts = [verdict for own, _, verdict in judged if own == effect]
        counts = " | ".join(str(verdicts.count(kind)) for kind in ("right", "with others", "outside", "wrong", "refused"))
        text += f"| {effect} | {counts} |\n"
    wrong = [line for _, line, verdict in judged if verdict != "right"]
    text += "\n".join(["\nNot right:\n", *(f"- {line}" for line in wrong)]) + "\n"
    if carried:
        text += (
            "\n## A load after `diagnose --apply` without it\n\n| arm | robots | named | mass within 2 σ | torque gains added |\n|---|---|---|---|---|\n"
        )
        for arm in arms:
            own = [verdict for robot, _, verdict in carried if robot == arm]
            told = [off for off, _ in own if off is not None]
            text += f"| {arm} | {len(own)} | {len(told)} | {sum(abs(off) <= 2 for off in told)} | {sum(gains for _, gains in own)} |\n"
    print(text)
    if asked.write:
        (HERE / "table.md").write_text(text)


main()
