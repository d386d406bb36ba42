"""Logs of one pinned leg that MuJoCo moves, for every effect of the catalogue: the truth that `diagnose` is held to. See README.md.

    python mujoco_cases.py --list              # writes tests/battery/mujoco_cases.json: every case, once
    python mujoco_cases.py -o ../../target/mujoco_cases [--only TEXT] [--jobs 2]
    python mujoco_cases.py --sample            # writes mujoco_sample/: a dozen short logs, which tests/run judges
    python mujoco_cases.py --fresh 7 -o /tmp/fresh --jobs 2    # as many cases that nobody has seen: other sizes, friction, noise, motion

Per case: NAME.csv.gz, the log; NAME.toml, what the model has; NAME.true.toml, the same with what it lacks; NAME.json, the truth, with
how many standard deviations of an efficient estimate (Cramér-Rao) the effect is worth in this log.
"""

import argparse
import gzip
import hashlib
import io
import json
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
import pinocchio as pin

import go2_urdf
from mujoco_leg import GEAR, JOINTS, STEP, Leg, nominal, off_the_cad

HERE = Path(__file__).resolve().parent
LIST = HERE.parent / "battery" / "mujoco_cases.json"
SAMPLE = HERE / "mujoco_sample"
HIP, THIGH, CALF = JOINTS
DURATION = 20.0  # s
QUANTA = np.array([2 * np.pi / 32768 / GEAR, 2 * np.pi / 256 / GEAR, GEAR / 256])  # rad, rad/s, N m (go2.md)
CENTRE = np.array([-0.1, 0.9, -1.7])  # rad
REACH = np.array([0.5, 0.7, 0.7])  # rad
# Hz; no two joints share one.
FOURIER = np.array([[0.1, 0.4, 1.3, 2.8, 4.9, 7.6], [0.2, 0.5, 1.4, 2.9, 5.0, 7.7], [0.3, 0.6, 1.5, 3.0, 5.1, 7.8]])
PLAIN = ("viscous", "coulomb", "armature", "bias")
# A Go2's, hip to calf (go2.md: plausible ranges).
TYPICAL = {
    "viscous": (0.06, 0.05, 0.08),
    "coulomb": (0.2, 0.15, 0.5),
    "armature": (0.0045, 0.0045, 0.0165),
    "bias": (-0.1, 0.08, 0.1),
}
# The noise of the torque: standard deviation, N m, and memory, s (0: white; else that of a first-order autoregression).
TORQUE_NOISE = (0.0, 0.05, 0.1, 0.2, 0.4)
MEMORY = (0.0, 0.005, 0.0, 0.01, 0.02)
VELOCITY_NOISE = (0.0, 0.01, 0.02, 0.035, 0.05)  # rad/s
RATES = (500, 250, 1000, 500, 100)  # Hz
REPEATS = (0.0, 0.02, 0.0, 0.08, 0.17)
MOTIONS = ("fourier fast", "chirp fast", "fourier slow", "chirp slow")

# The four sizes of each effect's leading parameter, from hardly there to obvious, and its others.
SIZES = {
    "viscous": (0.01, 0.03, 0.08, 0.2),
    "coulomb": (0.03, 0.08, 0.2, 0.6),
    "armature": (0.001, 0.003, 0.008, 0.018),
    "bias": (0.05, 0.12, 0.3, 0.8),
    "asymmetric_coulomb": (0.03, 0.08, 0.2, 0.4),  # half the difference
    "stribeck": (0.05, 0.12, 0.25, 0.5),
    "load_friction": (0.02, 0.05, 0.1, 0.2),
    "quadratic_drag": (0.0005, 0.002, 0.006, 0.015),
    "thermal_viscous": (0.0005, 0.0015, 0.004, 0.01),
    "spring": (0.1, 0.3, 0.8, 2.0),
    "cogging": (0.03, 0.08, 0.2, 0.5),
    "torque_gain": (1.03, 1.08, 1.2, 0.75),
    "velocity_gain": (1.005, 1.02, 1.05, 1.1),
    "encoder_offset": (0.006, 0.015, 0.04, 0.1),
    "delay": (0.0005, 0.0015, 0.004, 0.008),
    "base_tilt": (0.005, 0.015, 0.04, 0.1),
    "payload": (0.01, 0.03, 0.1, 0.3),
    "contact": (1.5, 4.0, 10.0, 25.0),
    "elasticity": (2500.0, 1000.0, 400.0, 150.0),  # stiffness, N m/rad
    "backlash": (0.003, 0.006, 0.012, 0.03),
    "saturation": (0.003, 0.01, 0.04, 0.12),  # share of time in which more is asked for
    "asymmetric_viscous": (0.005, 0.015, 0.04, 0.1),
    "saturating_viscous": (0.05, 0.12, 0.3, 0.6),
    "presliding": (0.05, 0.12, 0.3, 0.6),
    "coupled_armature": (0.0005, 0.0015, 0.004, 0.01),
    "coupled_viscous": (0.005, 0.015, 0.04, 0.1),
    "coupled_coulomb": (0.03, 0.08, 0.2, 0.4),
}
# The steps of --list in which a plain effect of all joints is to be found too.
TO_FIND = {5: "viscous", 8: "armature", 11: "coulomb"}
COMPLETE = 40


def parameters(effect, size, joint, n):
    """The effect's parameters; the leading one first, as MuJoCo's leg takes them."""
    here = 0 if joint is None else JOINTS.index(joint)
    match effect:
        case "asymmetric_coulomb":
            mean = max(TYPICAL["coulomb"][here], 1.5 * size)
            return {"F_plus": mean + size, "F_minus": mean - size}
        case "stribeck":
            return {"Fs": size, "vs": (0.05, 0.1, 0.2)[n % 3]}
        case "spring":
            return {"k": size, "q0": float(CENTRE[here] + (0.3, -0.2)[n % 2])}
        case "cogging":
            return {"A": size, "N": float(GEAR[here] * (1, 2)[n % 2]), "psi": (0.0, 1.0, 2.0)[n % 3]}
        case "base_tilt":
            return {"roll": size, "pitch": size * (-0.7, 0.5)[n % 2]}
        case "payload":
            z = (0.0, -0.1, -0.12)[here]
            return {"m": size, "x": 0.02, "y": (0.02, -0.03, 0.0)[here], "z": z}
        case "contact":
            return {"z": size, "x": (0.0, 0.3)[n % 2] * size}
        case "elasticity":
            return {"k": size, "d": 0.1}
        case "backlash":
            return {"gap": size, "d": 0.02}
        case "thermal_viscous":
            return {"kT": size, "T0": 40.0}
        case "saturation":
            return {"share": size}
        case "saturating_viscous":
            return {"F": size, "vs": (0.5, 1.0, 2.0)[n % 3]}
        case "presliding":
            return {"F": size, "zs": (0.003, 0.01, 0.03)[n % 3]}
        case _:
            return {"value": size}


def draw(values, *key):
    """One of `values`, the same in every run: not by the case's number, whose remainders would go together."""
    digest = hashlib.sha256("/".join(map(str, key)).encode()).digest()
    return values[int.from_bytes(digest[:4], "little") % len(values)]


def sensors(name, level):
    """The noise of a case; `level` runs through the torque's noise in turn."""
    colour = draw(MEMORY, name, "memory")
    return {
        "duration": DURATION,
        "motion": draw(MOTIONS, name, "motion"),
        "rate": draw(RATES, name, "rate"),
        "torque_noise": TORQUE_NOISE[level % len(TORQUE_NOISE)],
        "torque_memory": colour,
        "velocity_noise": draw(VELOCITY_NOISE, name, "velocity"),
        "repeats": draw(REPEATS, name, "repeats"),
        # Whether the controller sees the noise of the velocity: then the torque carries it too.
        "feedback": draw((True, False), name, "feedback"),
        "inertia_error": draw((0.0, 0.03), name, "inertia"),
    }


def cases(seed=None):
    """All cases, in their order; with a seed, others: sizes and what the joints have anyhow off by up to half, all else drawn anew."""
    out, first = [], "" if seed is None else f"{seed}-"
    off = lambda *key: 1.0 if seed is None else draw(np.geomspace(1 / 1.5, 1.5, 101).tolist(), seed, *key)
    for effect, sizes in SIZES.items():
        places = {"base_tilt": [None], "contact": [CALF], "saturation": [THIGH, CALF],
                  "coupled_armature": [THIGH, CALF], "coupled_viscous": [THIGH, CALF], "coupled_coulomb": [THIGH, CALF]}.get(effect, JOINTS)
        for n in range(12):
            joint, size = places[n % len(places)], sizes[n // 3]
            name = f"{first}{effect}-{'base' if joint is None else joint}-{n:02}"
            # Of a gain, what it differs from one by.
            size = 1 + (size - 1) * off(name) if effect.endswith("_gain") else size * off(name)
            out.append({"name": name, "effect": effect, "joint": joint, "parameters": parameters(effect, size, joint, n),
                        "size": n // 3, "to_find": TO_FIND.get(n), **sensors(name, n + len(effect))})
    for n in range(COMPLETE):
        name = f"{first}complete-{n:02}"
        out.append({"name": name, "effect": None, "joint": None, "parameters": {}, "size": 0, "to_find": None, **sensors(name, n)})
    if seed is not None:
        for case in out:
            case["typical"] = {e: [v * off(case["name"], e, j) for j, v in enumerate(values)] for e, values in TYPICAL.items()}
    return out


def sample():
    """A few short logs of obvious effects and of complete models, loud and quiet."""
    hidden = [("viscous", HIP), ("coulomb", CALF), ("armature", THIGH), ("spring", THIGH), ("payload", CALF), ("delay", THIGH),
              ("torque_gain", CALF), ("quadratic_drag", HIP), ("elasticity", CALF), (None, None), (None, None), (None, None)]
    noise = [(0.05, 0.0), (0.1, 0.0), (0.0, 0.0), (0.05, 0.01), (0.05, 0.0), (0.1, 0.01),
             (0.05, 0.0), (0.1, 0.0), (0.0, 0.0), (0.0, 0.0), (0.2, 0.01), (0.4, 0.0)]
    out = []
    for n, ((effect, joint), (level, memory)) in enumerate(zip(hidden, noise)):
        name = f"sample-{effect or 'complete'}-{n:02}"
        given = {} if effect is None else parameters(effect, SIZES[effect][3], joint, n)
        out.append({"name": name, "effect": effect, "joint": joint, "parameters": given, "size": 3, "to_find": None,
                    "duration": 10.0, "motion": MOTIONS[n % 2], "rate": 250, "torque_noise": level, "torque_memory": memory,
                    "velocity_noise": 0.02, "repeats": (0.0, 0.02)[n % 2], "feedback": n % 3 == 0, "inertia_error": 0.03})
    return out


def what_is_there(case):
    """(all effects of the leg, those that the model has, those that it lacks), the latter two by name and joint."""
    effects = {(e, j): {"value": v[n]} for e, v in case.get("typical", TYPICAL).items() for n, j in enumerate(JOINTS)}
    model, place = set(effects), (case["effect"], case["joint"])
    missing = [] if case["effect"] is None else [place]
    if case["effect"]:
        effects[place] = dict(case["parameters"])
        model.discard(place)
    if case["effect"] == "asymmetric_coulomb":
        # It is Coulomb friction and a bias, apart from words: the model has neither.
        for plain in ("coulomb", "bias"):
            effects.pop((plain, case["joint"]))
            model.discard((plain, case["joint"]))
    if case["to_find"]:
        found = [(case["to_find"], j) for j in JOINTS if (case["to_find"], j) in model]
        model -= set(found)
        missing += found
    return effects, model, missing


def reference(motion, duration, random):
    t = np.arange(0, duration + 2 * STEP, STEP)
    kind, speed = motion.split()
    slower = 1.0 if speed == "fast" else 0.35
    size = 0.5 - 0.5 * np.cos(np.pi * np.minimum(t, 1.0))
    phases = random.uniform(0, 2 * np.pi, (3, 6))
    if kind == "fourier":
        amplitude = 1 / (FOURIER * 10 + 5)
        amplitude *= (REACH / amplitude.sum(axis=1))[:, None]
        offset = np.einsum("jk,tjk->tj", amplitude, np.sin(2 * np.pi * slower * FOURIER * t[:, None, None] + phases))
    else:
        # From 0.1 Hz to 8.5 Hz and a little less for each joint, by equal ratios; no faster than 6 rad/s.
        last = np.array([8.5, 8.0, 7.5]) * slower
        growth = np.log(last / 0.1) / duration
        rate = 0.1 * np.exp(growth * t[:, None])
        phase = 2 * np.pi * (rate - 0.1) / growth + phases[:, 0]
        amplitude = np.minimum(REACH, 6.0 * (1.0 if speed == "fast" else 0.6) / (2 * np.pi * rate))
        offset = amplitude * np.sin(phase)
        drift = 0.25 * np.sin(2 * np.pi * np.array([0.11, 0.13, 0.17]) * t[:, None] + phases[:, 1])
        offset = offset + drift
    q = CENTRE + size[:, None] * offset
    return t, q, np.gradient(q, STEP, axis=0)


def simulated(case, random):
    """The leg's run without noise, and what its effects are in the end."""
    effects, model, missing = what_is_there(case)
    bodies = off_the_cad(nominal(), case["inertia_error"], random)
    follow = reference(case["motion"], case["duration"], random)
    noise = None
    if case["feedback"] and case["velocity_noise"]:
        samples = random.normal(size=(int(case["duration"] * case["rate"]) + 2, 3)) * case["velocity_noise"]
        noise = samples[np.minimum((follow[0] * case["rate"] + 1e-9).astype(int), len(samples) - 1)]
    if case["effect"] == "saturation":
        place = (case["effect"], case["joint"])
        share = effects.pop(place)["share"]
        asked = np.abs(Leg(effects, bodies).run(follow, noise).tau[:, JOINTS.index(case["joint"])])
        effects[place] = {"limit": float(np.quantile(asked, 1 - share))}
    run = Leg(effects, bodies).run(follow, noise)
    return run, effects, model, missing, bodies, noise


def reported(run, effects, noise):
    """What the sensors would say without noise of their own, at every step."""
    q, dq, tau = run.q.copy(), run.dq.copy(), run.tau.copy()
    if noise is not None:
        dq = dq + noise
    for (effect, joint), values in effects.items():
        value = next(iter(values.values()))
        n = None if joint is None else JOINTS.index(joint)
        if effect == "torque_gain":
            tau[:, n] /= value
        elif effect == "velocity_gain":
            dq[:, n] *= value
        elif effect == "encoder_offset":
            q[:, n] += value
        elif effect == "delay":
            tau[:, n] = np.interp(run.t - value, run.t, tau[:, n])
    return q, dq, tau


def coloured(shape, std, memory, rate, random):
    white = random.normal(size=shape) * std
    if memory == 0 or std == 0:
        return white
    keep = np.exp(-1 / (rate * memory))
    out = white.copy()
    for k in range(1, len(out)):
        out[k] = keep * out[k - 1] + np.sqrt(1 - keep**2) * white[k]
    return out


def sampled(case, run, effects, noise, random):
    """The log: rows of t, q, dq, tau, temperature."""
    every = round(1 / (STEP * case["rate"]))
    q, dq, tau = (x[::every] for x in reported(run, effects, noise))
    if noise is None:
        dq = dq + random.normal(size=dq.shape) * case["velocity_noise"]
    tau = tau + coloured(tau.shape, case["torque_noise"], case["torque_memory"], case["rate"], random)
    values = [np.round(x / quantum) * quantum for x, quantum in zip((q, dq, tau), QUANTA)]
    channels = np.hstack([*values, np.round(run.temperature[::every])])
    repeats = np.flatnonzero(random.uniform(size=len(channels)) < case["repeats"])
    for k in repeats[repeats > 0]:
        channels[k] = channels[k - 1]
    return run.t[::every], channels


def written(times, channels, with_temperature):
    heads = ["t"] + [f"{c}/{j}" for c in ("q", "dq", "tau") for j in JOINTS]
    heads += [f"temp/{j}" for j in JOINTS] if with_temperature else []
    # Finer than the quanta.
    places = [5] * 3 + [4] * 3 + [3] * 3 + [0] * 3
    out = io.StringIO()
    out.write(",".join(heads) + "\n")
    np.savetxt(out, np.column_stack([times, channels[:, : len(heads) - 1]]), delimiter=",",
               fmt=["%.4f"] + [f"%.{p}f" for p in places[: len(heads) - 1]])
    return out.getvalue()


def model_file(places):
    # The base is the place of what is no joint's.
    lines = ["format = 1", "", "[robot]", 'builtin = "go2"', "", "[base]", 'mount = "pinned"']
    for effect, joint in sorted(places, key=str):
        lines += ["", "[[effect]]", f'name = "{effect}"'] + [f'joint = "{joint or "base"}"']
    return "\n".join(lines) + "\n"


# What the log can tell


def pinocchio_leg():
    model = pin.buildModelFromXML(go2_urdf.urdf())
    others = [i for i in range(1, model.njoints) if not model.names[i].startswith("FR_")]
    return pin.buildReducedModel(model, others, pin.neutral(model))


LEG = pinocchio_leg()
FROM_PINOCCHIO = [0, 1, 2, 3, 4, 5, 7, 6, 8, 9]
WINDOW = 0.02  # s
REST = 0.02  # rad/s
FINEST = 0.003  # N m: what the mechanics' own steps leave of a window


def size_over_std(case, run, effects, model, bodies):
    """The signature of what is missing, over the noise of window means, with what the model may fit instead taken off."""
    count = round(WINDOW / STEP)
    windows = len(run.t) // count - 1
    # The middles of all steps: of a motor that shakes with the noise that its controller sees, a few instants of a window are no mean.
    at = np.arange(windows * count)
    q, dq, tau = ((x[at] + x[at + 1]) / 2 for x in reported(run, effects, None))
    ddq = np.diff(reported(run, effects, None)[1], axis=0)[at] / STEP
    data, theta = LEG.createData(), []
    for mass, com, inertia in bodies:
        about = inertia + mass * (com @ com * np.eye(3) - np.outer(com, com))
        theta += [mass, *(mass * com), *about[np.triu_indices(3)]]
    columns = [10 * b + k for b in range(3) for k in FROM_PINOCCHIO]
    rows = np.array([pin.computeJointTorqueRegressor(LEG, data, *state)[:, columns] for state in zip(q, dq, ddq)])
    mean = lambda x: x.reshape(windows, count, *x.shape[1:]).mean(1)
    own = {e: mean(x) for e, x in zip(PLAIN, (dq, np.sign(dq), ddq, np.ones_like(q)))}
    left = mean(tau - rows @ np.array(theta))
    # A reversal within a step is neither of its sides.
    steady = np.abs(mean(np.sign(dq))) == 1
    rows, moves = mean(rows), steady & (mean((np.abs(dq) < REST).astype(float)) == 0)
    noise, target, design = window_noise(case), [], []
    for j, joint in enumerate(JOINTS):
        on, block = moves[:, j], np.zeros((windows, 30 + 3 * len(PLAIN)))
        block[:, :30] = rows[:, j]
        for n, e in enumerate(PLAIN):
            if (e, joint) in model:
                left[:, j] -= own[e][:, j] * effects[e, joint]["value"]
                block[:, 30 + 3 * n + j] = own[e][:, j]
        target.append(left[on, j] / noise[j])
        design.append(block[on] / noise[j])
    cad = np.eye(30, 30 + 3 * len(PLAIN)) / (0.1 * scale(bodies))[:, None]
    design, target = np.vstack([*design, cad]), np.concatenate([*target, np.zeros(30)])
    size = np.linalg.norm(design, axis=0) + 1e-12
    normal = (design / size).T @ (design / size) + 1e-12 * np.eye(design.shape[1])
    fitted = np.linalg.solve(normal, (design / size).T @ target) / size
    return float(np.linalg.norm(target - design @ fitted))


def scale(bodies):
    """What a relative change of one moves each parameter by, roughly: its body's mass, size and inertia."""
    out = []
    for mass, com, inertia in bodies:
        length = np.sqrt(com @ com + np.trace(inertia) / mass)
        out += [mass] + [mass * length] * 3 + [mass * length**2] * 6
    return np.array(out)


def window_noise(case):
    """Standard deviation of a window's mean torque, N m: the sensor's noise with its memory, quanta, and the velocity's noise through
    the inertia, of which a local parabola leaves half."""
    inertia = np.array([0.06, 0.05, 0.022])
    samples = max(1.0, WINDOW * case["rate"])
    memory = 1 + 2 * case["torque_memory"] * case["rate"]
    torque = (case["torque_noise"] ** 2 * memory + QUANTA[2] ** 2 / 12) / samples
    speed = case["velocity_noise"] ** 2 + QUANTA[1] ** 2 / 12
    return np.sqrt(FINEST**2 + torque + (inertia * 0.5 / WINDOW) ** 2 * 2 * speed)


def make(case, folder):
    random = np.random.default_rng(int.from_bytes(hashlib.sha256(case["name"].encode()).digest()[:8], "little"))
    run, effects, model, missing, bodies, noise = simulated(case, random)
    times, channels = sampled(case, run, effects, noise, random)
    stem = folder / case["name"]
    log = written(times, channels, ("thermal_viscous" == case["effect"]) or case["name"].endswith("7"))
    Path(f"{stem}.csv.gz").write_bytes(gzip.compress(log.encode(), 6, mtime=0))
    Path(f"{stem}.toml").write_text(model_file(model))
    Path(f"{stem}.true.toml").write_text(model_file(model | set(missing)))
    if case["effect"] == "asymmetric_coulomb":
        equal = [["coulomb", case["joint"]], ["bias", case["joint"]]]
    else:
        equal = []
    main = effects.get((case["effect"], case["joint"]), {})
    truth = {
        **case,
        "truth": [{"effect": e, "joint": j, "parameters": v} for (e, j), v in effects.items()],
        "missing": missing,
        # Other words for the same torque: all of these together say what the effect says.
        "equal": equal,
        "value": None if case["effect"] is None else leading(case["effect"], main),
        "snr": size_over_std(case, run, effects, model, bodies),
    }
    Path(f"{stem}.json").write_text(json.dumps(truth, indent=1) + "\n")
    return case["name"], truth["snr"]


def leading(effect, values):
    """The parameter that `diagnose` gives as the value."""
    value = next(iter(values.values()))
    match effect:
        case "elasticity":
            return 1 / value
        case "contact":
            # The mean over an episode, as `diagnose` tells it, of half a sine's root.
            return values["z"] * float(np.mean(np.sin(np.pi * (np.arange(1000) + 0.5) / 1000) ** 0.5))
        case "cogging":
            return values["A"] * float(np.cos(values["psi"]))
        case _:
            return value


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--only", default="", help="cases whose name has this text")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--list", action="store_true", help="write the list of cases instead")
    parser.add_argument("--sample", action="store_true", help="write the committed sample instead")
    parser.add_argument("--fresh", type=int, metavar="SEED", help="other cases than the listed ones")
    arguments = parser.parse_args()
    if arguments.list:
        rows = ",\n".join(json.dumps(case) for case in cases())
        LIST.write_text(f"[\n{rows}\n]\n")
        return
    if not (arguments.output or arguments.sample):
        parser.error("say where the logs go: -o FOLDER")
    folder = SAMPLE if arguments.sample else arguments.output
    fresh = None if arguments.fresh is None else cases(arguments.fresh)
    listed = sample() if arguments.sample else fresh or json.loads(LIST.read_text())
    wanted = [case for case in listed if arguments.only in case["name"]]
    folder.mkdir(parents=True, exist_ok=True)
    with ProcessPoolExecutor(arguments.jobs) as pool:
        for n, (name, snr) in enumerate(pool.map(make, wanted, [folder] * len(wanted))):
            print(f"{n + 1} of {len(wanted)}: {name}, {snr:.1f} standard deviations", flush=True)


if __name__ == "__main__":
    main()
