"""What `diagnose` names of what another program hides: motions of robots, torques by Pinocchio's inverse dynamics, and one effect beside a plain drive.

    python3 -m venv target/pinocchio && target/pinocchio/bin/pip install -r studies/pinocchio/requirements.txt
    cargo build --release -p proprio
    target/pinocchio/bin/python studies/pinocchio/cases.py target/release/proprio --write

Nothing here is proprio's: bodies, motions, friction and noise are this file's, and the URDFs are those of example-robot-data (the Go2's leg:
tests/oracle/go2.urdf; `robots.py`). Each robot has its own bodies, 4 % off the URDF's, and its own drive, as shares of each joint's torque. The model that is given
is the URDF alone. A second part adds a load to arms that were diagnosed without it, a third hides two effects at once. Half an hour of two cores.
"""

import argparse
import re
import tempfile
import zlib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from robots import HERE, ROBOTS, SECONDS, Drive, drawn, load, loaded, motion, named, rms, said, scattered, settings, torque, write_log, write_model

# Which of them the catalogue has; what is found for the others is a formula, or the sentence that the catalogue lacks it.
CATALOGUE = ["spring", "stribeck", "quadratic_drag", "load_friction", "cogging", "payload", "torque_gain", "velocity_gain", "delay", "coupled_viscous", "presliding"]
OUTSIDE = ["grown_friction", "end_stop", "position_friction", "cable"]


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


def make(robot, effects, seed, folder):
    """A robot with these effects; the joint that has each."""
    random = np.random.default_rng([seed, zlib.crc32(f"{robot} {' '.join(effects)}".encode())])
    model, names, is_leg, noise, (t, q, dq, ddq), tau, drive = drawn(robot, random)
    joints, own, gains, fast, lag = [], np.zeros_like(tau), np.ones(model.nv), np.ones(model.nv), 0.0
    for effect in effects:
        j, its_own, its_gains, its_fast, its_lag = hidden(effect, model, t, q, dq, tau, drive, random)
        joints.append(j)
        own, gains, fast, lag = own + its_own, gains * its_gains, fast * its_fast, lag + its_lag
    if "payload" in effects:
        joints[effects.index("payload")], tau = model.nv - 1, torque(loaded(model, random, is_leg)[0], q, dq, ddq)
    tau = (tau + drive.torque(dq, ddq) + own) * gains
    tau = np.stack([np.interp(t - lag, t, column) for column in tau.T], axis=1)
    write_log(folder / "log.csv", names, t, q, dq * fast, tau, random, noise, drive.size)
    write_model(robot, folder / "model.toml")
    return [names[j] for j in joints]


def diagnosed(proprio, robot, effects, seed):
    """What `diagnose` says of a robot with these effects, and where each is."""
    with tempfile.TemporaryDirectory() as folder:
        joints = make(robot, effects, seed, Path(folder))
        # Without a model file the robot is a Go2.
        model = ["-m", "model.toml"] if ROBOTS[robot] else []
        found = said(proprio, folder, "diagnose", "log.csv", *model)
    places = [(effect, "base" if effect == "delay" else joint) for effect, joint in zip(effects, joints)]
    return found, places


def words(found, names, masses):
    """What was named, and the errors."""
    shown = ", ".join([f"{name}:{where}" for name, where in names] + [f"mass of {link}" for link in masses]) or "nothing"
    floor = found["error"]["floor"]
    floor = "unknown" if floor is None else f"{floor:.4g} N m"
    return f"{shown}; {found['error']['after']:.4g} N m, floor {floor}"


def heavier(found):
    """Of each body whose mass a diagnosis finds above the model's: by how much, and the standard deviation of that, kg."""
    told = "(.*): mass ([^ ]*) ± ([^ ]*) kg, the URDF says ([^ ]*) ± ([^ ]*) kg"
    matches = [re.match(told, body) for body in found.get("bodies", [])]
    numbers = {match[1]: [float(number) for number in match.groups()[1:]] for match in matches if match}
    return {link: (now - was, (std**2 + known**2) ** 0.5) for link, (now, std, was, known) in numbers.items() if now > was}


def of_case(proprio, robot, effect, seed):
    found, [(_, joint)] = diagnosed(proprio, robot, [effect], seed)
    if found["verdict"] == "refused" or "path" not in found:
        return effect, f"{robot}, {effect}: refused", "refused"
    names, masses = named(found), heavier(found)
    if effect == "none":
        verdict = "right" if not names and not found["outside_catalogue"] else "wrong"
    elif effect in OUTSIDE:
        formula = [one for one in names if one[1] == joint and one[0] not in CATALOGUE]
        verdict = "right" if formula and names[0] == formula[0] else "outside" if found["outside_catalogue"] else "wrong"
    elif effect == "payload" and not names:
        # A load is a body that is heavier.
        verdict = "right" if masses else "wrong"
    else:
        verdict = "right" if names == [(effect, joint)] else "with others" if (effect, joint) in names else "wrong"
    return effect, f"{robot}, {effect} at {joint}: {words(found, names, masses)}", verdict


def of_pair(proprio, seed):
    """Two effects of the catalogue on a robot, all drawn: how many are named, and how many names are neither."""
    random = np.random.default_rng([seed, 2])
    robot = list(ROBOTS)[random.integers(len(ROBOTS))]
    effects = [str(effect) for effect in random.choice(CATALOGUE, 2, replace=False)]
    found, places = diagnosed(proprio, robot, effects, seed)
    if "path" not in found:
        return robot, f"{robot}, {' and '.join(effects)}: refused", (0, 0)
    names, masses = named(found), heavier(found)
    known = [place in names or (place[0] == "payload" and bool(masses)) for place in places]
    false = [name for name in names if name not in places]
    hidden_at = " and ".join(f"{effect} at {joint}" for effect, joint in places)
    return robot, f"{robot}, {hidden_at}: {words(found, names, masses)}", (sum(known), len(false))


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
    parser.add_argument("--pairs", type=int, default=40, help="robots with two effects")
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
    pairs = [lambda n=n: of_pair(proprio, asked.seed + n) for n in range(asked.pairs if asked.only in "pairs" else 0)]
    with ThreadPoolExecutor(2) as pool:
        judged, carried, paired = (list(pool.map(run, part)) for part in (calls, loads, pairs))

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
    if paired:
        both = sum(count == 2 for *_, (count, _) in paired)
        false = sum(more > 0 for *_, (_, more) in paired)
        text += f"\n## Two effects at once\n\nOf {len(paired)} pairs that were drawn both effects are named in {both}, and a name is false in {false}. The others:\n\n"
        text += "".join(f"- {line}\n" for _, line, judgement in paired if judgement != (2, 0))
    print(text)
    if asked.write:
        (HERE / "table.md").write_text(text)


if __name__ == "__main__":
    main()
