"""Logs of an arm whose gear at one joint is elastic: what `diagnose` of an arm is held to. See README.md.

    python elastic_arm.py                      # writes elastic_arm/: one log a case, and truth.json
    python elastic_arm.py --fresh 7 -o /tmp/x  # as many cases that nobody has seen: other joints, stiffness, motion, bodies

The arm is tests/robots/arm.urdf with bodies some per cent off it. Pinocchio gives mass matrix and bias forces of the links; the rotor of
the elastic joint is a body of its own (Spong 1987, ASME J. Dyn. Syst. Meas. Control 109:310): I θ'' = τ − friction − k(θ − q) − d(θ' − q').
A controller follows sums of sines at the motors; four seconds pass before the log begins, so that no start swings in it.
"""

import argparse
import gzip
import io
import json
from pathlib import Path

import numpy as np
import pinocchio as pin

HERE = Path(__file__).resolve().parent
URDF = HERE.parent / "robots" / "arm.urdf"
STEP, RATE, DURATION, BEFORE = 1e-4, 200, 14.0, 4.0  # s, Hz, s, s
# Of each joint: rotor inertia, viscous and Coulomb friction, greatest torque, noise of the torque (SI), centre and reach of the motion.
DRIVES = {
    "yaw": (0.03, 0.1, 0.3, 40.0, 0.03, 0.0, 1.0),
    "shoulder": (0.03, 0.1, 0.3, 40.0, 0.03, -0.3, 0.9),
    "elbow": (0.02, 0.08, 0.2, 20.0, 0.02, 0.4, 1.0),
    "slide": (0.2, 2.0, 1.0, 60.0, 0.1, 0.1, 0.08),
}
# Name, joint, stiffness (N m/rad), damping ratio, highest frequency of the motion (Hz), seed.
CASES = [
    ("yaw_300", "yaw", 300.0, 0.05, 1.5, 1),
    ("shoulder_150", "shoulder", 150.0, 0.05, 1.5, 2),
    ("shoulder_400", "shoulder", 400.0, 0.03, 0.8, 3),
    ("elbow_100", "elbow", 100.0, 0.05, 1.5, 4),
    ("complete", None, 0.0, 0.0, 1.5, 5),
]


def simulated(joint, stiffness, ratio, highest, seed):
    rng = np.random.default_rng(seed)
    model = pin.buildModelFromUrdf(str(URDF))
    data, n = model.createData(), model.nv
    names = list(model.names)[1:]
    for b in range(1, n + 1):
        share = 1 + 0.03 * rng.standard_normal()
        body = model.inertias[b]
        model.inertias[b] = pin.Inertia(body.mass * share, body.lever, body.inertia * share)
    rotor, viscous, coulomb, most, noise, centre, reach = (np.array(x) for x in zip(*(DRIVES[name] for name in names)))
    bias = 0.3 * coulomb * rng.standard_normal(n)
    f = np.array([0.09, 0.23, 0.47, 0.5 + 0.5 * (highest - 0.5), highest]) * (1 + 0.1 * rng.random((n, 1))) + 0.013 * np.arange(n)[:, None]
    size = rng.random((n, 5)) / (1 + (f / 0.4) ** 1.2)
    size *= (reach / size.sum(1))[:, None]
    phase = 2 * np.pi * rng.random((n, 5))

    def asked(t):
        angle = 2 * np.pi * f * t + phase
        return centre + (size * np.sin(angle)).sum(1), (2 * np.pi * f * size * np.cos(angle)).sum(1)

    full = lambda q: pin.integrate(model, pin.neutral(model), q)
    motor, speed = (x.copy() for x in asked(-BEFORE))
    link, link_speed = motor.copy(), speed.copy()
    soft = names.index(joint) if joint else None
    if joint:
        link[soft] -= pin.computeGeneralizedGravity(model, data, full(link))[soft] / stiffness
        turned = pin.crba(model, data, full(link))[soft, soft]
        damping = 2 * ratio * np.sqrt(stiffness * turned)
    gains = np.array([400.0, 400.0, 250.0, 4000.0]), np.array([12.0, 12.0, 8.0, 120.0])
    rows, tau = [], np.zeros(n)
    for step in range(-round(BEFORE / STEP), round(DURATION / STEP)):
        t = step * STEP
        if step % 10 == 0:
            q, dq = asked(t)
            weight = pin.computeGeneralizedGravity(model, data, full(motor))
            tau = np.clip(weight + gains[0] * (q - motor) + gains[1] * (dq - speed), -most, most)
        if step >= 0 and step % round(1 / RATE / STEP) == 0:
            rows.append(np.concatenate([[t], motor, speed, tau]))
        own = viscous * speed + coulomb * np.tanh(speed / (0.003 * reach)) + bias
        mass = pin.crba(model, data, full(link))
        mass = np.triu(mass) + np.triu(mass, 1).T
        force = tau - own - pin.nonLinearEffects(model, data, full(link), link_speed)
        apparent = mass + np.diag(rotor)
        if joint:
            spring = stiffness * (motor[soft] - link[soft]) + damping * (speed[soft] - link_speed[soft])
            apparent[soft, soft] -= rotor[soft]
            force[soft] += spring - tau[soft] + own[soft]
        link_acceleration = np.linalg.solve(apparent, force)
        acceleration = link_acceleration.copy()
        if joint:
            acceleration[soft] = (tau[soft] - own[soft] - spring) / rotor[soft]
        link_speed = link_speed + STEP * link_acceleration
        link = link + STEP * link_speed
        speed = speed + STEP * acceleration
        motor = motor + STEP * speed
        stiff = [j for j in range(n) if j != soft]
        motor[stiff], speed[stiff] = link[stiff], link_speed[stiff]
    rows = np.array(rows)
    count = len(rows)
    rows[:, 1:1 + n] += 2e-5 * rng.standard_normal((count, n))
    rows[:, 1 + n:1 + 2 * n] += 2e-3 * rng.standard_normal((count, n))
    rows[:, 1 + 2 * n:] += noise * rng.standard_normal((count, n))
    head = ["t"] + [f"{column}/{name}" for column in ("q", "dq", "tau") for name in names]
    text = io.StringIO()
    np.savetxt(text, rows, delimiter=",", header=",".join(head), comments="", fmt=["%.4f"] + ["%.5f"] * n + ["%.4f"] * n + ["%.3f"] * n)
    return text.getvalue()


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("-o", "--output", type=Path, default=HERE / "elastic_arm")
    arguments.add_argument("--fresh", type=int, help="seed of cases that nobody has seen")
    given = arguments.parse_args()
    cases = CASES
    if given.fresh is not None:
        rng = np.random.default_rng(given.fresh)
        cases = []
        for n in range(12):
            joint, k = ["yaw", "shoulder", "elbow"][n % 3], 10 ** rng.uniform(1.9, 2.8)
            cases.append((f"{joint}_{k:.0f}", joint, k, rng.uniform(0.01, 0.12), rng.uniform(0.6, 2.5), 1000 * given.fresh + n))
        cases += [(f"complete_{n}", None, 0.0, 0.0, rng.uniform(0.6, 2.5), 1000 * given.fresh + 50 + n) for n in range(4)]
    given.output.mkdir(exist_ok=True)
    truth = {}
    for name, joint, stiffness, ratio, highest, seed in cases:
        text = simulated(joint, stiffness, ratio, highest, seed)
        with gzip.GzipFile(given.output / f"{name}.csv.gz", "wb", mtime=0) as file:
            file.write(text.encode())
        truth[name] = {"joint": joint, "stiffness": stiffness, "damping_ratio": ratio, "highest_frequency": highest, "seed": seed}
        print(name)
    (given.output / "truth.json").write_text(json.dumps(truth, indent=1) + "\n")


if __name__ == "__main__":
    main()
