#!/usr/bin/env python3
"""Whether commands agree: errors and floors of `compare`, `diagnose` and `identify` of twenty logs under three models each.

    cargo build --release -p proprio
    studies/one_answer/cases.py target/release/proprio DATA --write

DATA holds recorded logs: five chirps of a Go2 that hangs, three motions of a KUKA KR300, two of EMPS. The other logs are simulated legs, one effect hidden in
each. The models: none or the bare URDF, four plain effects as `identify` fits them, and all that `diagnose --apply` adds. Ten samples of ten times the
torque's rms are then put into one joint. A quarter of an hour of two cores.
"""

import argparse
import csv
import json
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

HERE = Path(__file__).resolve().parent
CHIRPS = ["2.0hz_p25d3.0", "7.0hz_p25d5.0", "9.0hz_p25d1.2", "9.0hz_p25d2.0", "9.0hz_p25d5.0"]
HIDDEN = [None, "spring:FR_thigh=4", "cogging:FR_calf=0.3", "delay:FR_hip=0.004", "payload:FR_calf=0.3", "stribeck:FR_thigh=0.4"]
HIDDEN += ["load_friction:FR_thigh=0.08", "quadratic_drag:FR_calf=0.01", "encoder_offset:FR_hip=0.05", "elasticity:FR_thigh=300"]
PLAIN = ["viscous", "coulomb", "armature", "bias"]
YARDSTICKS = ["zero_rms", "cad_rms", "given_rms", "noise_floor_rms"]


def logs(data):
    """Name, path or what is hidden, URDF."""
    for name in CHIRPS:
        yield f"Go2, chirp {name}", data / f"go2_air_chirp_{name}.csv", None
    for name in "ABC":
        yield f"KUKA KR300, {name}", data / f"kuka_kr300/kuka_{name}.csv", data / "kuka_kr300/kr300.urdf"
    for name in ["pulses", "train"]:
        yield f"EMPS, {name}", data / f"emps/emps_{name}.csv", data / "emps/emps.urdf"
    for hidden in HIDDEN:
        yield f"leg, {hidden or 'nothing hidden'}", hidden, None


class Bench:
    def __init__(self, proprio, folder):
        self.proprio, self.folder = proprio, folder

    def run(self, *words):
        said = subprocess.run([self.proprio, *words], cwd=self.folder, capture_output=True, text=True)
        if said.returncode:
            raise RuntimeError(f"{' '.join(map(str, words))}: {said.stderr[:300]}")
        return said.stdout

    def json(self, command, log, model, *more):
        file = ["-m", model] if model else []
        return json.loads(self.run(command, log, "--json", *file, *more))

    def differences(self, log, model):
        """The largest difference of two numbers that mean the same, and the floor."""
        compared = self.json("compare", log, model, "--given")
        others = [self.json("compare", log, model, "--fit"), self.json("diagnose", log, model), self.json("identify", log, model)]
        fitted, diagnosed, identified = others
        pairs = []
        for other in others:
            pairs += [(compared["error"][key], other["error"][key]) for key in ["before", "floor"]]
            pairs += [(compared[key], other[key]) for key in YARDSTICKS]
            for own, its in zip(compared["joints"], other["joints"], strict=True):
                pairs += [(own[key], its[key]) for key in ["before", "floor"]]
        pairs.append((diagnosed["path"][0]["error"], compared["error"]["after"]))
        if model:
            pairs.append((fitted["error"]["after"], identified["error"]["after"]))
        worst = max(abs(a - b) if a is not None and b is not None else float(a is not b) for a, b in pairs)
        return worst, compared["error"]["floor"]


def with_spikes(log, path):
    """The log with ten samples that are off."""
    with open(log, newline="") as file:
        head, *rows = csv.reader(file)
    column = next(k for k, name in enumerate(head) if name.startswith("tau/"))
    rms = (sum(float(row[column]) ** 2 for row in rows) / len(rows)) ** 0.5
    for k in range(10):
        row = rows[(2 * k + 1) * len(rows) // 20]
        row[column] = repr(float(row[column]) + 10 * rms)
    with open(path, "w", newline="") as file:
        csv.writer(file).writerows([head, *rows])


def row(proprio, name, log, urdf):
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(proprio, folder)
        if not isinstance(log, Path):
            hide = ["--hide", log] if log else []
            bench.run("simulate", "--typical", "--inertia-error", "0.03", "--legs", "FR", "--seed", "5", *hide, "-o", "log.csv")
            log = Path(folder) / "log.csv"
        bare = None
        given = ["--urdf", urdf] if urdf else []
        if urdf:
            bare = "bare.toml"
            (Path(folder) / bare).write_text(f'format = 1\n\n[robot]\nurdf = "{urdf}"\n')
            shutil.copy(Path(folder) / bare, Path(folder) / "complete.toml")
        bench.run("add", *PLAIN, "-m", "plain.toml", *given)
        bench.run("identify", log, "-m", "plain.toml", "-o", "fitted.toml")
        bench.run("diagnose", log, "-m", "complete.toml", "--apply")
        told = [bench.differences(log, model) for model in [bare, "fitted.toml", "complete.toml"]]
        with_spikes(log, Path(folder) / "spikes.csv")
        floors = [floor for _, floor in told]
        spiked = bench.json("compare", "spikes.csv", bare)["error"]["floor"]
        percent = lambda floor: "–" if floor is None else f"{100 * (floor / floors[0] - 1):+.1f}"
        number = lambda x: "–" if x is None else f"{x:.3g}"
        return f"| {name} | {max(worst for worst, _ in told):.0e} | {number(floors[0])} | {percent(floors[2])} | {percent(spiked)} |"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("proprio", type=Path)
    parser.add_argument("data", type=Path)
    parser.add_argument("--write", action="store_true", help="keep the table beside this file")
    asked = parser.parse_args()
    proprio, data = asked.proprio.resolve(), asked.data.resolve()

    def one(case):
        try:
            line = row(proprio, *case)
        except RuntimeError as error:
            line = f"| {case[0]} | {error} | | | |"
        print(line, file=sys.stderr, flush=True)
        return line

    with ThreadPoolExecutor(2) as pool:
        lines = list(pool.map(one, logs(data)))
    table = "\n".join(
        [
            "# Whether commands agree",
            "",
            "`studies/one_answer/cases.py PROPRIO DATA --write`: errors and floors of `compare --given`, `compare --fit`, `diagnose` and `identify` under three",
            "models of each log. The floor is of the CAD; beside it how far it is from that under the complete model, and with ten spikes in one joint's torque.",
            "",
            "| log | largest difference, N m | floor, N m | complete model, % | ten spikes, % |",
            "|---|---|---|---|---|",
            *lines,
            "",
        ]
    )
    if asked.write:
        (HERE / "table.md").write_text(table)
    else:
        print(table)


main()
