"""Legged robots of many kinds on their feet: what `identify --free-base` and `diagnose --free-base` make of walks whose truth is known.

    target/pinocchio/bin/python studies/legged/study.py target/release/proprio --robots 5 --mujoco FOLDER --write

Robots are those of PyPI `example-robot-data` as `tests/oracle/mujoco_legged.py` knows them. Own logs are those of `simulate --walk` (20 s, 500 Hz,
`--typical --inertia-error 0.03`), each seed another robot; FOLDER holds MuJoCo's, `ROBOT/SEED.csv` and the same robot with a load,
`ROBOT/SEED.load.csv`, as `mujoco_legged.py` writes them with their truth. The load is a tenth of the mass on the trunk; it is looked for with the
robot's own model, identified from its walk without it. Rows that a run does not make again stay in the table. A minute of one core for each robot.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pinocchio as pin

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent.parent / "tests/oracle"))
from mujoco_legged import ROBOTS, Robot, model_file  # noqa: E402

SHARE = Path(pin.__file__).parents[4] / "share/example-robot-data/robots"
DRIVE = ["viscous", "coulomb", "armature", "bias"]
# A humanoid sways, all others trot.
GAIT = {"g1": "sway"}
NAMES = [name for name in ROBOTS if name != "hexapod"]
AXES = "xyz"
TABLE = HERE / "table.md"
FLOATS = ["m", "hx", "hy", "hz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz"]


class Study:
    def __init__(self, proprio, folder):
        self.proprio, self.folder = proprio, folder

    def said(self, *arguments):
        """What a command prints as JSON; its error where it refuses."""
        run = subprocess.run([self.proprio, *map(str, arguments), "--json"], capture_output=True, text=True, cwd=self.folder)
        try:
            return json.loads(run.stdout)
        except json.JSONDecodeError:
            return {"refused": run.stderr.strip()}

    def done(self, *arguments):
        run = subprocess.run([self.proprio, *map(str, arguments)], capture_output=True, text=True, cwd=self.folder)
        return run.stderr.strip() if run.returncode else None

    def robot(self, name):
        """Model files: the CAD's, and the same with what every drive has."""
        robot = Robot(name, SHARE)
        (self.folder / f"{name}.toml").write_text(model_file(robot, self.folder))
        return robot

    def own(self, robot, seed):
        """Two logs that proprio simulates, without and with the load, and what is true of the first."""
        name, gait = robot.name, GAIT.get(robot.name, "trot")
        load = [round(0.1 * robot.mass, 3), *(round(float(x) * robot.longer, 3) for x in (0.05, -0.02, 0.07))]
        plain, loaded = f"{name}_{seed}.csv", f"{name}_{seed}_load.csv"
        walk = ["simulate", "--walk", gait, "-m", f"{name}.toml", "--typical", "--inertia-error", "0.03", "--seed", seed]
        hide = "payload:base={},x={},y={},z={}".format(*load)
        for log, more in ((plain, []), (loaded, ["--hide", hide])):
            wrong = self.done(*walk, *more, "-o", log)
            if wrong:
                return None, wrong
        truth = json.loads((self.folder / plain).with_suffix(".truth.json").read_text())
        return (plain, loaded, load, {p["name"]: p["value"] for p in truth["parameters"]}, {q["name"]: q["value"] for q in truth["quantities"]}), None

    def of_mujoco(self, robot, seed, logs):
        plain, loaded = (logs / robot.name / f"{seed}{kind}.csv" for kind in ("", ".load"))
        truth, other = (json.loads(path.with_suffix(".truth.json").read_text()) for path in (plain, loaded))
        values = {f"{what}:{body}": x for body, ten in truth["bodies"].items() for what, x in zip(FLOATS, ten)}
        values |= {f"{what}:{joint}": truth["friction"][what] for what in ("viscous", "coulomb", "armature") for joint in robot.joints}
        quantities = {"total_mass": truth["mass"]} | {f"trunk_com_{a}": x for a, x in zip(AXES, truth["com_base"])}
        quantities |= {f"robot_com_{a}": x for a, x in zip(AXES, whole_com(robot, truth["bodies"]))}
        return (plain, loaded, other["load"], values, quantities), None

    def judged(self, robot, seed, logs):
        """One robot: figures of its walk, of its diagnosis, of the load's."""
        made, wrong = self.of_mujoco(robot, seed, logs) if logs else self.own(robot, seed)
        if wrong:
            return {"wrong": wrong}
        plain, loaded, load, values, quantities = made
        kind = "mujoco" if logs else "own"
        fitted, drive = f"{robot.name}_{seed}_{kind}.toml", f"{robot.name}_{seed}_{kind}_drive.toml"
        found = self.said("identify", "--free-base", plain, "-m", f"{robot.name}.toml", "--physical", "-o", fitted)
        if "refused" in found:
            return {"wrong": found["refused"]}
        own = {q["name"]: q for q in found["quantities"]}
        off = {name: own[name]["value"] - x for name, x in quantities.items() if name in own}
        z = [off[name] / own[name]["std"] for name in off if own[name]["std"] > 0]
        for p in found["parameters"]:
            if p["name"] in values and p["std"] > 0 and p["status"] == "identified":
                z.append((p["value"] - values[p["name"]]) / p["std"])
        figures = {
            "mass": off["total_mass"] / quantities["total_mass"],
            "base": max(abs(off[f"trunk_com_{a}"]) for a in AXES),
            "robot": max((abs(off[f"robot_com_{a}"]) for a in AXES if f"robot_com_{a}" in off), default=None),
            "z": z,
            "warnings": found.get("warnings", []),
        }
        # Complete: the CAD's bodies and what every drive has.
        (self.folder / drive).write_text((self.folder / f"{robot.name}.toml").read_text())
        for effect in DRIVE:
            self.done("add", effect, "-m", drive)
        figures["complete"] = named(self.said("diagnose", "--free-base", plain, "-m", drive))
        of_load = self.said("diagnose", "--free-base", loaded, "-m", fitted)
        figures["load"] = named(of_load)
        for candidate in of_load.get("candidates", []):
            if candidate["effect"] == "payload" and candidate["joints"] == ["base"] and "payload:base" in figures["load"]:
                own = [p["value"] for p in candidate["parameters"]]
                figures["load_mass"] = own[0] / load[0] - 1
                figures["load_place"] = max(abs(a - b) for a, b in zip(own[1:], load[1:]))
                figures["load_z"] = [(p["value"] - x) / p["std"] for p, x in zip(candidate["parameters"], load)]
        return figures


def whole_com(robot, bodies):
    """The whole robot's centre of mass with its joints at zero, or at the stop nearest to it, m: as `robot_com_*` has it."""
    model = pin.buildModelFromUrdf(str(robot.path), pin.JointModelFreeFlyer())
    q = pin.neutral(model)
    q[7:] = np.clip(0, model.lowerPositionLimit[7:], model.upperPositionLimit[7:])
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    mass, moment = 0.0, np.zeros(3)
    for name, (m, *first) in ((name, ten[:4]) for name, ten in bodies.items()):
        place = data.oMi[1 if name == "base" else model.getJointId(name)]
        mass, moment = mass + m, moment + place.rotation @ np.array(first) + m * place.translation
    return moment / mass


def named(diagnosis):
    """What a diagnosis says is missing."""
    if "refused" in diagnosis or diagnosis.get("verdict") == "refused":
        return ["refused: " + str(diagnosis.get("refused") or diagnosis.get("reason"))]
    steps = [step for step in diagnosis["path"] if step["step"] in ("add", "remove")]
    return [f"{step['effect']}:{','.join(step['joints'])}" for step in steps] + [str(x) for x in diagnosis.get("outside_catalogue", [])]


def row(robot, gait, source, all_of):
    good = [f for f in all_of if "wrong" not in f]
    if not good:
        return f"| {robot.name} | {source} | {gait} | 0 of {len(all_of)} | {all_of[0]['wrong'].splitlines()[0]} | | | | | | | |\n"
    z = np.abs(np.concatenate([f["z"] for f in good]))
    worst = lambda key, scale: f"{scale * max(abs(f[key]) for f in good):.2f}" if all(f.get(key) is not None for f in good) else "–"
    mean = 100 * np.mean([f["mass"] for f in good])
    right = [f for f in good if f["load"] == ["payload:base"]]
    of = lambda key, scale, some: f"{scale * max(abs(f[key]) for f in some if key in f):.1f}" if any(key in f for f in some) else "–"
    of_load = [z for f in right for z in f.get("load_z", [])]
    z_of_load = f"{sum(abs(z) <= 2 for z in of_load)} of {len(of_load)}" if of_load else "–"
    complete = sum(not f["complete"] for f in good)
    return (f"| {robot.name}, {robot.mass:.1f} kg | {source} | {gait} | {len(good)} of {len(all_of)} | {mean:+.2f}; {worst('mass', 100)} | {worst('base', 1e3)} | "
            f"{worst('robot', 1e3)} | {np.sum(z <= 2)} of {len(z)} ({100 * np.mean(z <= 2):.0f} %) | {complete} of {len(good)} | "
            f"{len(right)} of {len(good)} | {of('load_mass', 100, right)}; {of('load_place', 1e3, right)} | {z_of_load} |\n")


def kept(made):
    """Rows of the table in the file with one that is made anew, in the order of ROBOTS."""
    key = lambda line: tuple(cell.strip().split(",")[0] for cell in line.split("|")[1:3])
    rows = {key(line): line for line in TABLE.read_text().splitlines(keepends=True) if key(line)[:1] in [(name,) for name in NAMES]}
    rows[key(made)] = made
    return "".join(rows[own] for own in sorted(rows, key=lambda own: (own[1] != "own", NAMES.index(own[0]))))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("proprio", type=Path)
    parser.add_argument("--robots", type=int, default=5, help="seeds of each kind")
    parser.add_argument("--only", nargs="*", default=NAMES, choices=NAMES)
    parser.add_argument("--mujoco", type=Path, help="judge MuJoCo's logs of this folder too, of the robots that it has")
    parser.add_argument("--without-own", action="store_true", help="judge MuJoCo's alone")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--write", action="store_true", help="keep the table in studies/legged/table.md")
    args = parser.parse_args()
    text = ("# Legged robots of many kinds\n\nMade by `target/pinocchio/bin/python studies/legged/study.py` (its head says how). Each robot has other bodies, gait and noise. "
            "\"Within 2 std\" counts identified parameters, masses and centres of mass. The load is a tenth of the mass on the trunk, looked for with the model identified "
            "without it. Each walk is 20 s long.\n\n"
            "| robot | logs | gait | walked | total mass, mean; worst, % | trunk's centre of mass, worst, mm | the whole robot's | within 2 std | complete: "
            "nothing named | load named alone | its mass, %; place, mm | within 2 std |\n|---|---|---|---|---|---|---|---|---|---|---|---|\n")
    with tempfile.TemporaryDirectory() as folder:
        study = Study(args.proprio.resolve(), Path(folder))
        seeds = range(1, args.robots + 1)
        for name in args.only:
            robot = study.robot(name)
            gait = GAIT.get(name, "trot")
            sources = ([] if args.without_own else [("own", None)]) + ([("MuJoCo", args.mujoco.resolve())] if args.mujoco and (args.mujoco / name).is_dir() else [])
            for source, logs in sources:
                with ThreadPoolExecutor(args.jobs) as pool:
                    found = list(pool.map(lambda seed: study.judged(robot, seed, logs), seeds))
                for seed, figures in zip(seeds, found):
                    print(name, source, seed, {k: v for k, v in figures.items() if k != "z"}, file=sys.stderr, flush=True)
                made = row(robot, gait, source, found)
                print(made, end="", flush=True)
                if args.write:
                    TABLE.write_text(text + kept(made))


if __name__ == "__main__":
    main()
