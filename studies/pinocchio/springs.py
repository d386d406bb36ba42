"""Arms with one elastic gear, simulated forward: what `diagnose` says of them.

    target/pinocchio/bin/python studies/pinocchio/springs.py target/release/proprio --arms 10 --write

Motor and link of the elastic joint are two masses with a spring and a damper between them, and friction acts at the motor (Spong 1987, ASME J. Dyn. Syst.
Meas. Control 109:310). A controller at 1 kHz makes the motors follow sums of sines. Nothing here is quasi-static: the link swings, and rings where dry
friction stops its motor. Each arm's stiffness is drawn so that, quasi-statically, the spring does 0.3 to 10 times the noise of a window of 20 ms to its
own joint's torque; one arm of six is rigid. Some 20 s of a core for each arm.
"""

import argparse
import tempfile
import zlib
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
import pinocchio as pin

from robots import HERE, ROBOTS, SECONDS, drawn, load, named, rms, said, torque, write_log, write_model

STEP, CONTROL, BEFORE = 1e-4, 1e-3, 3.0  # s
STIFFNESS = 100.0, 1e7  # of arms' gears, N m/rad
RIGID = 1 / 6


def full(model, data, q):
    """The mass matrix, both halves."""
    upper = np.triu(pin.crba(model, data, q))
    return upper + np.triu(upper, 1).T


def stiffness(model, drive, course, noise, size, j):
    """With which a spring of a joint does so many times a window's noise."""
    t, q, dq, ddq = course
    tau = torque(model, q, dq, ddq)
    ahead = [tau[:, j]]
    for _ in range(2):
        ahead.append(np.gradient(ahead[-1], t))
    soft = 1e3 * rms(tau[:, j])
    moved = [of + np.eye(model.nv)[j] * by[:, None] / soft for of, by in zip((q, dq, ddq), ahead)]
    done = rms(torque(model, *moved)[:, j] - tau[:, j])
    return soft * done / (noise * drive.size[j] / np.sqrt(0.02 / (t[1] - t[0])) * size)


def simulated(model, nominal, drive, course, soft, k, ratio):
    """Time, motor positions and velocities and torques of an arm whose gear at `soft` has this stiffness; of a rigid one if that is None."""
    t, q, dq, ddq = course
    n, data, own = model.nv, model.createData(), nominal.createData()
    arm = drive.armature
    inertia = np.diag(full(model, data, q[0])) + arm
    light = 1 / np.diag(np.linalg.inv(full(model, data, q[0]) + np.diag(arm)))
    wide = 2 * np.pi * 4
    kp, kd = inertia * wide**2, 1.4 * inertia * wide
    if soft is not None:
        light[soft] = arm[soft]
        # A motor alone is lighter than with its link.
        kd[soft] = min(kd[soft], 0.15 * arm[soft] / CONTROL)
        kp[soft] = kd[soft] * wide / 1.4
        damping = 2 * ratio * np.sqrt(k * (inertia[soft] - arm[soft]))
    # Dry friction as steep as the step allows.
    steep = np.maximum(0.002, drive.coulomb * STEP / (0.5 * light))
    rigid = [j for j in range(n) if j != soft]
    motor, speed = q[0].copy(), np.zeros(n)
    link, turned = motor.copy(), speed.copy()
    if soft is not None:
        link[soft] -= pin.computeGeneralizedGravity(model, data, link)[soft] / k
    rows, last, rate = [], None, 1 / (t[1] - t[0])
    each = round(1 / (rate * STEP))
    at = lambda time, of: np.array([np.interp(time, t, of[:, j]) for j in range(n)])
    for c in range(round(SECONDS / CONTROL)):
        now = c * CONTROL
        asked, fast, faster = (at(now, of) for of in (q, dq, ddq))
        # It starts from rest within a second.
        begin = min(now, 1.0)
        begin = begin * begin * (3 - 2 * begin)
        u = pin.rnea(nominal, own, asked, begin * fast, begin * faster) + kp * (asked - motor) + kd * (begin * fast - speed)
        u += drive.coulomb * np.tanh(fast / 0.05) + drive.viscous * fast
        for s in range(round(CONTROL / STEP)):
            step = c * round(CONTROL / STEP) + s
            if now >= BEFORE and step % each == 0:
                # The torque at a moment between two of the controller's is the mean of both.
                rows.append(np.concatenate([[step * STEP], motor, speed, u if s else (u + last) / 2]))
            friction = drive.coulomb * np.tanh(speed / steep) + drive.viscous * speed + drive.bias
            force = u - friction - pin.nonLinearEffects(model, data, link, turned)
            mass = full(model, data, link) + np.diag(arm)
            if soft is not None:
                spring = k * (motor[soft] - link[soft]) + damping * (speed[soft] - turned[soft])
                mass[soft, soft] -= arm[soft]
                force[soft] += spring - u[soft] + friction[soft]
            turns = np.linalg.solve(mass, force)
            motors = turns.copy()
            if soft is not None:
                motors[soft] = (u[soft] - friction[soft] - spring) / arm[soft]
            turned = turned + STEP * turns
            link = link + STEP * turned
            speed = speed + STEP * motors
            motor = motor + STEP * speed
            motor[rigid], speed[rigid] = link[rigid], turned[rigid]
        last = u
    rows = np.array(rows)
    return rows[:, 0], rows[:, 1 : 1 + n], rows[:, 1 + n : 1 + 2 * n], rows[:, 1 + 2 * n :]


def of_arm(proprio, robot, seed):
    """A line of an arm, and what is right of it: its spring named, named alone, the error of 1/k in standard deviations, its size."""
    random = np.random.default_rng([seed, 5, zlib.crc32(robot.encode())])
    nominal, _ = load(robot)
    model, names, _, noise, course, _, drive = drawn(robot, random)
    size = np.exp(random.uniform(np.log(0.3), np.log(10)))
    ratio = random.uniform(0.02, 0.1)
    soft, k = None, None
    if random.random() >= RIGID:
        stiff = [(j, stiffness(model, drive, course, noise, size, j)) for j in range(model.nv)]
        # A motor on its spring swings slowly enough for the step.
        drawable = [(j, k) for j, k in stiff if STIFFNESS[0] <= k <= STIFFNESS[1] and k * STEP**2 < 0.1 * drive.armature[j]]
        if not drawable:
            return f"{robot} {seed}: no gear of an arm does so little", None
        soft, k = drawable[random.integers(len(drawable))]
    log = simulated(model, nominal, drive, course, soft, k, ratio)
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        write_log(folder / "log.csv", names, *log, random, noise, drive.size)
        write_model(robot, folder / "model.toml")
        found = said(proprio, folder, "diagnose", "log.csv", "-m", "model.toml")
    where = "rigid" if soft is None else f"{k:.3g} N m/rad at {names[soft]}, {size:.1f} times a window's noise"
    line = f"{robot}, {round(1 / (course[0][1] - course[0][0]))} Hz, {where}: "
    if "path" not in found:
        return line + "refused", (soft is None, False, False, None, size)
    there = named(found)
    line += ", ".join(f"{effect}:{joint}" for effect, joint in there) or "nothing"
    error = found["error"]
    line += f"; {error['after']:.4g} N m, floor {error['floor']:.4g} N m" if error["floor"] else f"; {error['after']:.4g} N m"
    if soft is None:
        return line, (True, not there and not found["outside_catalogue"], False, None, size)
    own = ("elasticity", names[soft])
    right, off = own in there, None
    known = [one for one in found.get("candidates", []) if one["effect"] == "elasticity" and one["joints"] == [names[soft]]]
    if right and known and known[0]["parameters"]:
        told = known[0]["parameters"][0]
        off = (told["value"] - 1 / k) / told["std"]
        line += f"; 1/k {told['value'] * k:.2f} of the truth, {off:+.1f} σ"
    return line, (False, right, there == [own], off, size)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("proprio", type=Path)
    parser.add_argument("--arms", type=int, default=10, help="of each robot")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--write", action="store_true", help="keep the table")
    asked = parser.parse_args()
    arms = [robot for robot, urdf in ROBOTS.items() if urdf]
    calls = [(robot, asked.seed + n) for n in range(asked.arms) for robot in arms]
    with ProcessPoolExecutor(2) as pool:
        running = [pool.submit(of_arm, asked.proprio.resolve(), *call) for call in calls]
        told = []
        for one in running:
            told.append(one.result())
            print(told[-1][0], flush=True)
    told = [(line, verdict) for line, verdict in told if verdict]
    rigid = [verdict for _, verdict in told if verdict[0]]
    text = (
        "# Springs in gears of arms, simulated forward\n\n"
        f"`studies/pinocchio/springs.py PROPRIO --arms {asked.arms} --seed {asked.seed} --write`: {', '.join(arms)}; 17 s at 250 to 1000 Hz, noise of 0.3 to 3 % of the\n"
        "torque, bodies 4 % off the URDF's, which is all that `diagnose` is given.\n\n"
        "| what the spring does, times a window's noise | arms | named | named alone | stiffness within 2 σ |\n|---|---|---|---|---|\n"
    )
    for least, most in ((0.3, 1), (1, 3), (3, 10)):
        own = [verdict for _, verdict in told if not verdict[0] and least <= verdict[4] < most]
        known = [off for *_, off, _ in own if off is not None]
        text += f"| {least} to {most} | {len(own)} | {sum(v[1] for v in own)} | {sum(v[2] for v in own)} | {sum(abs(off) <= 2 for off in known)} of {len(known)} |\n"
    text += f"\nOf {len(rigid)} rigid arms {sum(v[1] for v in rigid)} lack nothing.\n\n" + "".join(f"- {line}\n" for line, _ in told)
    print(text)
    if asked.write:
        (HERE / "springs.md").write_text(text)


if __name__ == "__main__":
    main()
