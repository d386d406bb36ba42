"""Whether formulas that `diagnose` finds predict another log, on the robots of `robots.py` (the head of `cases.py` says how to install).

    target/pinocchio/bin/python studies/pinocchio/formulas.py target/release/proprio --write

Of each robot two logs with two motions hide one torque outside the catalogue. `diagnose --apply` of the first from the drive's four effects, `identify`
of it, `compare` of the second; beside that the model with the true formula, identified of the first. An hour of two cores.
"""

import argparse
import json
import re
import tempfile
import time
import zlib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from robots import DRIVE, HERE, ROBOTS, SECONDS, drawn, motion, rms, said, torque, write_log, write_model

KINDS = {
    "position_friction": "dry friction that varies along the way",
    "worn_place": "dry friction that is larger at a place",
    "end_stop": "a soft end stop",
    "cable": "a cable, stiffer the farther it is bent",
    "counterbalance": "a counterbalance by a spring and a lever",
    "detent": "a magnet that pulls to a place",
    "torque_ripple": "ripple in proportion to torque",
    "neighbour_friction": "dry friction that depends on another joint's position",
    "link_drag": "air drag of a link that two joints turn",
    "warming": "dry friction that falls in warming, without a temperature",
    "later_offset": "an offset from a time on",
    "later_viscous": "viscous friction from a time on",
    "later_coulomb": "Coulomb friction from a time on",
}
# Shares of the log (time) and of the joint's travel (place) within which a border is right.
IN_TIME, IN_PLACE = 0.02, 0.10


def hidden(kind, name, other, draw, q):
    """The torque as a formula with parameters, and with their numbers; what it is of, and where it begins, if it does."""
    low, high = q.min(), q.max()
    travel, middle = high - low, low + draw(0.3, 0.7) * (high - low)
    t1 = draw(0.25, 0.75) * SECONDS
    k, width = 2 * np.pi * draw(0.7, 2.5) / travel, draw(0.08, 0.2) * travel
    a, b = draw(-1, 1), draw(-1, 1)
    bend = draw(1.2, 1.6)
    bump = f"exp(-((q - q0)/{width:.4f})^2)"
    lever = f"sin(q - q0)/sqrt({bend:.3f} - cos(q - q0))"
    waves = ["a*sin(k*q)*{0} + b*cos(k*q)*{0}", dict(a=a, b=b, k=k)]
    at = lambda text, **more: [text, dict(c=1.0, **more)]
    return {
        "position_friction": (*[waves[0].format("sign(dq)"), waves[1]], {"q", "dq"}, None),
        "worn_place": (*at(f"c*{bump}*sign(dq)", q0=middle), {"q", "dq"}, None),
        "end_stop": (*at("c*max(q - q0, 0)", q0=high - 0.25 * travel), {"q"}, ("position", high - 0.25 * travel)),
        "cable": (*at("c*(q - q0)*abs(q - q0)", q0=middle), {"q"}, None),
        "counterbalance": (*at(f"c*{lever}", q0=middle), {"q"}, None),
        "detent": (*at(f"c*(q - q0)*{bump}", q0=middle), {"q"}, None),
        "torque_ripple": (*[waves[0].format("tau_rigid"), waves[1]], {"q", "tau_rigid"}, None),
        "neighbour_friction": (*at(f"c*q.{other}*sign(dq)"), {f"q.{other}", "dq"}, None),
        "link_drag": (*at(f"c*(dq + dq.{other})*abs(dq + dq.{other})"), {"dq", f"dq.{other}"}, None),
        "warming": (*at("c*exp(-t/T)*sign(dq)", T=draw(4, 10)), {"t", "dq"}, None),
        "later_offset": (*at("c*step(t - t1)", t1=t1), {"t"}, ("time", t1)),
        "later_viscous": (*at("c*step(t - t1)*dq", t1=t1), {"t", "dq"}, ("time", t1)),
        "later_coulomb": (*at("c*step(t - t1)*sign(dq)", t1=t1), {"t", "dq"}, ("time", t1)),
    }[kind]


def value(text, numbers, signals):
    """A formula's value, by another reader than the program's."""
    words = {
        "sign": lambda x: np.tanh(x / 0.002), "step": lambda x: (x >= 0) * 1.0, "abs": np.abs, "max": np.maximum, "min": np.minimum,
        "exp": np.exp, "sqrt": np.sqrt, "sin": np.sin, "cos": np.cos,
    }
    spelled = re.sub(r"(d?q)\.(\w+)", r"\1__\2", text).replace("^", "**")
    return eval(spelled, {"__builtins__": {}}, {**words, **numbers, **signals}) + 0 * signals["t"]


def variables(text):
    return set(re.findall(r"\b(d?q(?:\.\w+)?|tau_rigid|t)\b", text))


def of_case(proprio, robot, kind, seed):
    """What is found, and what it is worth on the second log."""
    random = np.random.default_rng([seed, zlib.crc32(f"{robot} {kind}".encode())])
    model, names, is_leg, noise, first, tau, drive = drawn(robot, random)
    # Joints that carry something: a last wrist's friction is below its neighbours' noise.
    j = int(random.integers(0, model.nv - (0 if is_leg else 2)))
    other = (j + 1) % model.nv
    size = random.uniform(0.15, 0.3) * drive.size[j]
    text, numbers, of, border = hidden(kind, names[j], names[other], random.uniform, first[1][:, j])
    rate = round(1 / (first[0][1] - first[0][0]))
    second = motion(model, is_leg, rate, random)
    scale = None
    row = dict(kind=kind, robot=robot, seed=seed, joint=names[j], text=text)
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        for file, (t, q, dq, ddq), own in [("first.csv", first, tau), ("second.csv", second, None)]:
            own = torque(model, q, dq, ddq) if own is None else own
            signals = dict(t=t, q=q[:, j], dq=dq[:, j], tau_rigid=own[:, j])
            signals |= {f"q__{names[other]}": q[:, other], f"dq__{names[other]}": dq[:, other]}
            more = value(text, numbers, signals)
            scale = scale or 2 * size / max(rms(more), 1e-9)
            total = own + drive.torque(dq, ddq)
            total[:, j] += scale * more
            write_log(folder / file, names, t, q, dq, total, random, noise, drive.size)
        write_model(robot, folder / "found.toml")
        said(proprio, folder, "add", *sorted(DRIVE), "-m", "found.toml")
        (folder / "true.toml").write_text((folder / "found.toml").read_text())
        said(proprio, folder, "add", f"truth = {names[j]}: {text}", "-m", "true.toml")
        begun = time.time()
        found = said(proprio, folder, "diagnose", "first.csv", "-m", "found.toml", "--apply")
        row["seconds"] = time.time() - begun
        if "path" not in found:
            return row | dict(verdict="refused", words=found["verdict"])
        errors = {}
        for file in ["found", "true"]:
            said(proprio, folder, "identify", "first.csv", "-m", f"{file}.toml", "-o", f"{file}_fit.toml")
            compared = said(proprio, folder, "compare", "second.csv", "-m", f"{file}_fit.toml")
            errors[file] = next((own["rms"] for own in compared.get("joints", []) if own["joint"] == names[j]), None)
    own = [formula for formula in found.get("formulas", []) if formula["joint"] == names[j]]
    row["found"] = [formula["torque"] for formula in own]
    row["elsewhere"] = [f"{formula['joint']}: {formula['torque']}" for formula in found.get("formulas", []) if formula not in own]
    row["variables"] = bool(own) and set().union(*(variables(formula["torque"]) for formula in own)) == of
    row["errors"] = errors
    row["ratio"] = errors["found"] / errors["true"] if errors["found"] and errors["true"] else None
    row["border"] = None
    if border:
        kind_of, at = border
        within = IN_TIME * SECONDS if kind_of == "time" else IN_PLACE * np.ptp(first[1][:, j])
        edges = [edge["value"] for regime in found.get("regimes", []) + [f["regime"] for f in own if f.get("regime")] for edge in regime.get("edges", []) if edge]
        told = [p["value"] for formula in own for p in formula["parameters"] if p["symbol"] == "p"] + edges
        row["border"] = any(abs(value - at) <= within for value in told)
    row["verdict"] = "formula" if own else "outside" if found["outside_catalogue"] else "nothing"
    return row


def line(row):
    if row["verdict"] == "refused":
        return f"{row['robot']}, {row['kind']}: refused: {row['words'][:100]}"
    ratio = "?" if row["ratio"] is None else f"{row['ratio']:.2f}"
    return f"{row['robot']} {row['joint']}, {row['kind']} ({row['text']}): {'; '.join(row['found']) or row['verdict']}; error {ratio} × that of the true formula"


def share(rows, right):
    rows = list(rows)
    return f"{sum(map(bool, map(right, rows)))} of {len(rows)}" if rows else "–"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("proprio", type=Path)
    parser.add_argument("--seeds", type=int, nargs="*", default=[1, 2], help="robots of each kind")
    parser.add_argument("--only", default="", help="kinds or robots whose name has this")
    parser.add_argument("--rows", type=Path, help="file of results, one a line: what it has is not run again")
    parser.add_argument("--write", action="store_true", help="keep the table")
    asked = parser.parse_args()
    cases = [(robot, kind, seed) for seed in asked.seeds for robot in ROBOTS for kind in KINDS if asked.only in f"{robot} {kind}"]

    lines = asked.rows.read_text().splitlines() if asked.rows and asked.rows.exists() else []
    known = {(row["robot"], row["kind"], row["seed"]): row for row in map(json.loads, lines)}

    def run(case):
        row = known.get(case)
        if row is None:
            row = of_case(asked.proprio.resolve(), *case)
            if asked.rows:
                with asked.rows.open("a") as kept:
                    kept.write(json.dumps(row, default=bool) + "\n")
        print(f"{line(row)}; {row['seconds']:.0f} s" if "seconds" in row else line(row), flush=True)
        return row

    with ThreadPoolExecutor(2) as pool:
        rows = list(pool.map(run, cases))
    robots = len(ROBOTS) * len(asked.seeds)
    judged = [row for row in rows if row["verdict"] != "refused"]
    good = lambda row: row["ratio"] is not None and row["ratio"] <= 1.3
    text = (
        "# Formulas for hidden torques, on another log\n\n"
        f"`studies/pinocchio/formulas.py PROPRIO --seeds {' '.join(map(str, asked.seeds))} --write`: {robots} robots a kind ({', '.join(ROBOTS)}). `diagnose --apply` of the first log,\n"
        "`identify` of it, `compare` of a second log with another motion. Errors are of the joint that hides the torque, beside those of the model with the true\n"
        "formula. Variables are right where the formulas of the joint have all that the truth has and no more. A border is right within 10 % of the joint's travel,\n"
        "or within 2 % of the log's time.\n\n"
        "| hidden | formula found | error at most 1.3 × that of the true formula | median | right variables | right border |\n|---|---|---|---|---|---|\n"
    )
    table = [(KINDS[kind], [row for row in judged if row["kind"] == kind]) for kind in KINDS]
    for label, own in [*table, ("all", judged)]:
        if not own:
            continue
        ratios = [row["ratio"] for row in own if row["ratio"] is not None]
        middle = f"{np.median(ratios):.2f}" if ratios else "–"
        text += (
            f"| {label} | {share(own, lambda row: row['verdict'] == 'formula')} | {share(own, good)} | {middle} | "
            f"{share(own, lambda row: row['variables'])} | {share((row for row in own if row['border'] is not None), lambda row: row['border'])} |\n"
        )
    told = [row for row in judged if row["elsewhere"] is not None]
    text += f"\nA formula at another joint, too, in {share(told, lambda row: row['elsewhere'])} cases; {len(rows) - len(judged)} refused. Those above 1.3 ×:\n\n"
    text += "".join(f"- {line(row)}\n" for row in judged if not good(row))
    print(text)
    if asked.write:
        (HERE / "formulas.md").write_text(text)


if __name__ == "__main__":
    main()
