"""What `diagnose` says of causes that no effect of the catalogue is, on the robots of `cases.py` (its head says how to install).

    target/pinocchio/bin/python studies/pinocchio/outside.py target/release/proprio --write

A cause may be said to be outside the catalogue, or found as a formula; names of the catalogue are stand-ins. Fifteen minutes of two cores.
"""

import argparse
import tempfile
import zlib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pinocchio as pin

from robots import HERE, ROBOTS, SECONDS, drawn, loaded, named, rms, said, torque, write_log, write_model

CAUSES = {
    "tip_drag": "drag of air or water at the last link's tip",
    "wall": "a soft wall that the tip meets",
    "string": "a mass that hangs from the tip",
    "sway": "a base that sways",
    "axis_off": "a joint's axis 3 to 5° off the URDF's",
    "longer_link": "a link 3 to 5 cm longer",
    "picked_up": "a load from a time on",
    "hysteresis": "a belt's hysteresis",
    "warming": "dry friction that falls in warming, without a temperature",
    "torque_ripple": "ripple in proportion to torque",
    "neighbour_friction": "dry friction that depends on another joint's position",
    "knocks": "twenty knocks",
    "drifting_offset": "an offset that drifts at random",
    "soft_torque": "a torque constant that falls with torque",
}
# Presliding friction is a belt's hysteresis, and a spring with it.
IS_NAMED = {
    "hysteresis": {"presliding", "elastic_hysteresis", "spring"},
    "axis_off": {"link_geometry"},
    "longer_link": {"link_geometry"},
}


def at_tip(model, q, tip):
    """Positions and Jacobians of a point of the last body."""
    data, last = model.createData(), model.nv
    places, jacobians = np.zeros((len(q), 3)), np.zeros((len(q), 3, model.nv))
    for n, row in enumerate(q):
        pin.computeJointJacobians(model, data, row)
        places[n] = data.oMi[last].act(tip)
        jacobian = pin.getJointJacobian(model, data, last, pin.LOCAL_WORLD_ALIGNED)
        jacobians[n] = jacobian[:3] - pin.skew(places[n] - data.oMi[last].translation) @ jacobian[3:]
    return places, jacobians


def of_force(jacobians, force, size, drive):
    """The joints' torques of a force, as large as `size` of the torque where it is largest; none: as it is."""
    own = np.einsum("nij,ni->nj", jacobians, force)
    share = rms(own) / drive.size
    return own if size is None else own * size / share.max()


def swinging(places, rate, mass, random):
    """The force on a hand from which a mass hangs by a string."""
    w = 2 * np.pi * random.uniform(0.8, 1.3)
    x, v, force = places[0].copy(), np.zeros(3), np.zeros_like(places)
    for n, place in enumerate(places):
        force[n] = mass * (w * w * (place - x) - 0.3 * w * v)
        v += force[n] / mass / rate
        x += v / rate
    force[:, 2] = 9.81 * mass
    return force


def make(robot, cause, seed, folder):
    random = np.random.default_rng([seed, zlib.crc32(f"{robot} {cause}".encode())])
    model, names, is_leg, noise, (t, q, dq, ddq), tau, drive = drawn(robot, random)
    j, size = int(random.integers(0, model.nv)), random.uniform(0.15, 0.3)
    own, sign, away = np.zeros_like(tau), np.tanh(dq[:, j] / 0.002), q[:, j] - q[:, j].mean()
    # A leg ends about twice as far from its joint as its last body's centre of mass is.
    tip = 2 * model.inertias[model.nv].lever if is_leg else np.array([0, 0, 0.1])
    if cause in ("tip_drag", "wall", "string"):
        places, jacobians = at_tip(model, q, tip)
        if cause == "tip_drag":
            u = np.gradient(places, t[1], axis=0)
            own = of_force(jacobians, u * np.linalg.norm(u, axis=1)[:, None], size, drive)
        elif cause == "wall":
            normal = random.normal(size=3)
            normal /= np.linalg.norm(normal)
            beyond = np.maximum(places @ normal - np.quantile(places @ normal, 0.9), 0)
            own = of_force(jacobians, beyond[:, None] * normal, 2 * size, drive)
        else:
            mass = 0.5 * max(model.inertias[model.nv].mass, 0.03 * sum(body.mass for body in model.inertias))
            own = of_force(jacobians, swinging(places, 1 / t[1], mass, random), None, drive)
    elif cause in ("axis_off", "longer_link"):
        j = max(1, j)
        other, direction = pin.Model(model), random.normal(size=3)
        place = other.jointPlacements[j]
        if cause == "axis_off":
            direction[2] = 0
            turn = pin.exp3(direction / np.linalg.norm(direction) * np.deg2rad(random.uniform(3, 5)))
            other.jointPlacements[j] = pin.SE3(place.rotation @ turn, place.translation)
        else:
            by = (0.03 if is_leg else 0.05) * direction / np.linalg.norm(direction)
            other.jointPlacements[j] = pin.SE3(place.rotation, place.translation + by)
        tau = torque(other, q, dq, ddq)
    elif cause == "sway":
        other, data = pin.Model(model), model.createData()
        size, w = 0.5 * random.normal(size=3), 2 * np.pi * random.uniform(0.4, 1.5)
        for n in range(len(t)):
            other.gravity = pin.Motion(np.r_[np.array([0, 0, -9.81]) - size * np.sin(w * t[n]), 0, 0, 0])
            tau[n] = pin.rnea(other, data, q[n], dq[n], ddq[n])
    elif cause == "picked_up":
        later = t > random.uniform(0.3, 0.7) * SECONDS
        tau = np.where(later[:, None], torque(loaded(model, random, is_leg)[0], q, dq, ddq), tau)
    elif cause == "hysteresis":
        gap = random.uniform(0.2, 0.5) * np.std(away)
        held, z = np.zeros(len(t)), 0.0
        for n in range(len(t)):
            z = np.clip(z, away[n] - gap, away[n] + gap)
            held[n] = z
        own[:, j] = 1.5 * size * drive.size[j] * (away - held) / gap
    elif cause == "warming":
        own[:, j] = -0.7 * drive.coulomb[j] * sign * (1 - np.exp(-t / random.uniform(4, 10)))
    elif cause == "torque_ripple":
        own[:, j] = 0.8 * size * tau[:, j] * np.sin(random.choice([6, 9, 14]) * q[:, j] + 1)
    elif cause == "neighbour_friction":
        other = q[:, (j + 1) % model.nv]
        own[:, j] = size * drive.size[j] * sign * (other - other.mean()) / np.std(other)
    elif cause == "knocks":
        for at in random.uniform(1, SECONDS - 1, 20):
            own[:, j] += random.choice([-3, 3]) * drive.size[j] * np.exp(-(((t - at) / 0.02) ** 2))
    elif cause == "drifting_offset":
        walk = np.cumsum(random.normal(size=len(t)))
        own[:, j] = 1.5 * size * drive.size[j] * (walk - walk.mean()) / walk.std()
    tau = tau + drive.torque(dq, ddq) + own
    if cause == "soft_torque":
        most = 2 * drive.size[j]
        tau[:, j] = most * np.tanh(tau[:, j] / most)
    write_log(folder / "log.csv", names, t, q, dq, tau, random, noise, drive.size)
    write_model(robot, folder / "model.toml")


def of_case(proprio, robot, cause, seed):
    """Whether the cause is said to be outside or is a formula, and the catalogue's names."""
    with tempfile.TemporaryDirectory() as folder:
        make(robot, cause, seed, Path(folder))
        model = ["-m", "model.toml"] if ROBOTS[robot] else []
        found = said(proprio, folder, "diagnose", "log.csv", *model)
    if "path" not in found:
        return cause, robot, "refused", [], found["verdict"]
    names = named(found)
    formulas = [one for one in names if any(formula["effect"] == one[0] for formula in found.get("formulas", []))]
    right = IS_NAMED.get(cause, set())
    names = [one for one in names if one not in formulas and one[0] not in right]
    outside, after, floor = found["outside_catalogue"], found["error"]["after"], found["error"]["floor"]
    is_load = bool(found.get("load_changes"))
    verdict = "load" if is_load else "formula" if formulas else "outside" if outside else "body" if found.get("bodies") else "nothing"
    if right & {one[0] for one in named(found)}:
        verdict = "named"
    shown = "; ".join([f"{name}:{where}" for name, where in names] + [f"{name} (formula)" for name, _ in formulas])
    floor = "unknown" if floor is None else f"{floor:.4g}"
    return cause, robot, verdict, names, f"{shown or 'no name'}; {after:.4g} N m, floor {floor}"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("proprio", type=Path)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="causes or robots whose name has this")
    parser.add_argument("--write", action="store_true", help="keep the table")
    asked = parser.parse_args()
    cases = [(robot, cause) for cause in CAUSES for robot in ROBOTS if asked.only in f"{robot} {cause}"]

    def run(case):
        result = of_case(asked.proprio.resolve(), *case, asked.seed)
        cause, robot, verdict, _, line = result
        print(f"{verdict}: {robot}, {cause}: {line}", flush=True)
        return result

    with ThreadPoolExecutor(2) as pool:
        judged = list(pool.map(run, cases))
    kinds = ["outside", "formula", "load", "named", "body", "nothing", "refused"]
    text = (
        "# Causes that the catalogue does not have\n\n"
        f"`studies/pinocchio/outside.py PROPRIO --seed {asked.seed} --write`: one robot a cell ({', '.join(ROBOTS)}), as in [table.md](table.md). What is said: that the\n"
        "cause is outside the catalogue, a formula, a load that comes within the log, its own name, a body that differs from the URDF's, or nothing. Names are the\n"
        "catalogue's at the end, which stand in for the cause; a family of joints counts once.\n\n"
        f"| cause | {' | '.join(kinds)} | names at 0, 1, more robots |\n|---|{'---|' * (len(kinds) + 1)}\n"
    )
    totals = [0, 0, 0]
    for cause in dict.fromkeys(cause for cause, *_ in judged):
        own = [case for case in judged if case[0] == cause]
        verdicts = [verdict for _, _, verdict, _, _ in own]
        names = [min(len({name for name, _ in found}), 2) for _, _, _, found, _ in own]
        counts = [names.count(n) for n in range(3)]
        totals = [total + count for total, count in zip(totals, counts)]
        text += f"| {CAUSES[cause]} | {' | '.join(str(verdicts.count(kind)) for kind in kinds)} | {', '.join(map(str, counts))} |\n"
    text += f"\nNo name in {totals[0]} cases, one in {totals[1]}, more in {totals[2]}. Those with names:\n\n"
    text += "".join(f"- {robot}, {cause}: {line}\n" for cause, robot, _, names, line in judged if names)
    print(text)
    if asked.write:
        (HERE / "outside.md").write_text(text)


if __name__ == "__main__":
    main()
