#!/usr/bin/env python3
"""Which links bend: what `proprio frf` says of simulated arms with springs at the joints, and of those that bend besides.

    python3 studies/frf/bends.py PROPRIO [--seeds 20] [--first 1] [--write]

PROPRIO is an optimised binary. Of each seed: an arm (tests/robots/arm.urdf) with three springs, friction and masses that `identify` finds from a slow log, excited
by the plan of `excite --frf` (six points). Stiffness and damping are drawn. `--write` makes studies/frf/bends.md.
"""

import argparse
import json
import math
import pathlib
import random
import statistics
import subprocess
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
ARM = HERE.parents[1] / "tests/robots/arm.urdf"
# Stiffness about which each joint's spring and bends are drawn, N m/rad: resonances of 8 to 30 Hz with the arm's own inertias.
SPRINGS = {"yaw": 3000.0, "shoulder": 4000.0, "elbow": 900.0}
BENDS = {"yaw": 10000.0, "shoulder": 6000.0, "elbow": 2500.0}
AXES = [(joint, axis) for joint in BENDS for axis in (1, 2)]
FRICTION = ["coulomb=1.5", "coulomb:elbow=0.8"]

# Name, how many bends, dry friction, how far masses are off the description.
CASES = [
    ("three springs alone", 0, True, 0.0),
    ("three springs alone, masses 5 % off", 0, True, 0.05),
    ("and one bend", 1, True, 0.0),
    ("and one bend, masses 5 % off", 1, True, 0.05),
    ("and two bends", 2, True, 0.0),
    ("and two bends, without dry friction", 2, False, 0.0),
]


def run(folder, *words):
    done = subprocess.run([str(w) for w in words], cwd=folder, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(done.stderr.strip().splitlines()[0] if done.stderr else "failed")
    return done.stdout


def robot(proprio, seed, bends, friction, masses):
    """Truth, result and which bends are hidden."""
    draw = random.Random(1000 * seed + bends)
    around = lambda k: k * math.exp(draw.uniform(-0.6, 0.6))
    hide = ["viscous=0.6"] + (FRICTION if friction else [])
    for joint, k in SPRINGS.items():
        k = around(k)
        hide.append(f"elasticity:{joint}={k:.1f},damping={k * 1e-3:.4f}")
    hidden = draw.sample(AXES, bends)
    for joint, axis in hidden:
        k = around(BENDS[joint])
        hide.append(f"link_elasticity:{joint}={k:.1f},damping={k * 1e-3:.4f},axis={axis}")
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        (folder / "arm.toml").write_text(f'format = 1\n[robot]\nurdf = "{ARM}"\n[held]\nslide = 0.0\n')
        words = [word for what in hide for word in ("--hide", what)]
        run(folder, proprio, "simulate", "--frf", "-m", "arm.toml", "--slow", "slow.csv", "-o", "frf.csv", "--seed", seed,
            "--inertia-error", masses, *words)
        run(folder, proprio, "add", "viscous", "coulomb", "armature", "-m", "arm.toml")
        run(folder, proprio, "identify", "slow.csv", "-m", "arm.toml", "-o", "fitted.toml")
        found = json.loads(run(folder, proprio, "frf", "frf.csv", "-m", "fitted.toml", "--json"))
        truth = json.loads((folder / "frf.truth.json").read_text())
    truth = {p["name"]: p["value"] for p in truth["parameters"]}
    return truth, found, [(joint, f"bend_{axis}") for joint, axis in hidden]


def row(proprio, seeds, case):
    name, bends, friction, masses = case
    first = complete = all_found = refused = 0
    errors = {"k": [], "d": [], "k_e": [], "d_e": []}
    within = []
    held = []
    for seed in seeds:
        try:
            truth, found, hidden = robot(proprio, seed, bends, friction, masses)
        except RuntimeError as why:
            print(f"{name}, seed {seed}: {why}", flush=True)
            refused += 1
            continue
        taken = [(c["joint"], c["axis"]) for c in found["candidates"] if c["taken"]]
        first += bool(taken) and taken[0] in hidden
        complete += not taken
        all_found += sorted(taken) == sorted(hidden)
        held.append((found["springs_alone"], found["error"]["after"]))
        print(f"{name}, seed {seed}: hidden {hidden}, taken {taken}, chi2 {found['chi_squared']:.2f}", flush=True)
        for p in found["parameters"]:
            if p["name"] not in truth or not any(word in p["name"] for word in ("elasticity",)):
                continue
            wrong = p["value"] / truth[p["name"]] - 1
            kind = p["name"].split(":")[0]
            kind = {"1/k": "k", "d": "d"}.get(kind, "d_e" if kind.endswith("_d") else "k_e")
            errors[kind].append(abs(wrong))
            within.append(abs(p["value"] - truth[p["name"]]) <= 2 * p["std"])
            if abs(wrong) > 0.1:
                print(f"    {p['name']} {100 * wrong:+.1f} %, std {100 * p['std'] / truth[p['name']]:.1f} %", flush=True)
    count = len(seeds) - refused
    shown = lambda of: f"{100 * statistics.median(of):.1f}, {100 * max(of):.1f}" if of else "–"
    before, after = (statistics.median(x) if x else math.nan for x in zip(*held)) if held else (math.nan, math.nan)
    return (f"| {name} | {first} of {count} | {complete} of {count} | {all_found} of {count} | {shown(errors['k'])} | {shown(errors['d'])} "
            f"| {shown(errors['k_e'])} | {shown(errors['d_e'])} | {sum(within)} of {len(within)} | {before:.2f} → {after:.2f} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("proprio", type=pathlib.Path)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--case", type=int, help="one case alone, counted from 0")
    parser.add_argument("--write", action="store_true")
    asked = parser.parse_args()
    seeds = range(asked.first, asked.first + asked.seeds)
    cases = CASES if asked.case is None else [CASES[asked.case]]
    table = "\n".join(row(asked.proprio.resolve(), seeds, case) for case in cases)
    text = f"""# Links that bend, by frequency responses

Made by `python3 studies/frf/bends.py PROPRIO --seeds {asked.seeds} --write`: {asked.seeds} arms of `tests/robots/arm.urdf` a row, six points, 43 lines up to 55 Hz. Friction and
masses are as `identify` finds them from a slow log. Errors of values: median and largest, %; held-out error: log magnitude with springs alone and in the end, medians.

| arm | first bend named is hidden | none named | exactly the hidden ones | k % | d % | k_e % | d_e % | within 2σ | held-out error |
|---|---|---|---|---|---|---|---|---|---|
{table}
"""
    print(text)
    if asked.write:
        (HERE / "bends.md").write_text(text)


if __name__ == "__main__":
    main()
