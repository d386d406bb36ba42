"""Plain weighted least squares on logs of a hung Go2, beside what proprio's own commands make of the same logs. See README.md.

    python independent_least_squares.py LOG LOG LOG… [--proprio ../../target/release/proprio]

Each log is predicted by what the others say: bodies near the CAD, viscous and Coulomb friction, rotor inertia and bias of
every joint, by Pinocchio's regressor and numpy. Nothing of proprio's code takes part. The error is that of the mean torque over
20 ms, where the joint does not stand still, N m; `all` is the rms over joints and logs.

The reported velocity is the motion: filtered forward and backward with the magnitude of a Butterworth filter of fourth order, and
differentiated. The first lines show what the band alone does; the next ones what further terms do, each made of the motion and of the
torque that the fit itself predicts, never of the measured one; the last ones what a single log's fit is worth on the others.
"""

import argparse
import csv
import gzip
import json
import subprocess
import tempfile
from pathlib import Path

import numpy as np
import pinocchio as pin

import go2_urdf

LEGS = ("FR", "FL", "RR", "RL")
JOINTS = [f"{leg}_{part}" for leg in LEGS for part in ("hip", "thigh", "calf")]
FROM_PINOCCHIO = [0, 1, 2, 3, 4, 5, 7, 6, 8, 9]
STEP, WINDOW = 0.002, 10  # s, samples
BODIES = 30  # inertial parameters of a leg
REST, MOST_REST = 0.02, 0.125  # rad/s; share of a window
CUTOFFS = (80.0, 40.0, 25.0, 20.0, 15.0, 12.0)  # Hz
CUTOFF = 18.0  # Hz, for the further terms
CAD = 0.3  # relative standard deviation of a body's size; 0.1 to 1 differ by 1 %
RIDGE = 1e-3  # of a further term's column: far below what any log says
PLAIN = ("viscous", "coulomb", "armature", "bias")
DAHL = (0.002, 0.005, 0.01, 0.02, 0.05)  # rad

MODEL = pin.buildModelFromXML(go2_urdf.urdf())
DATA = MODEL.createData()
IDS = [MODEL.getJointId(f"{joint}_joint") for joint in JOINTS]
ORDER = np.array([MODEL.joints[i].idx_v for i in IDS])
COLUMNS = np.array([10 * (i - 1) + k for i in IDS for k in FROM_PINOCCHIO])
NOMINAL = np.concatenate([MODEL.inertias[i].toDynamicParameters()[FROM_PINOCCHIO] for i in IDS])


def read(path):
    """The log's channels at even times. A sample that repeats the one before is none."""
    opened = gzip.open if str(path).endswith(".gz") else open
    with opened(path, "rt") as file:
        rows = csv.reader(file)
        place = {name: n for n, name in enumerate(next(rows))}
        table = np.array([[float(x) if x else np.nan for x in row] for row in rows])
    t = table[:, place["t"]]
    channels = [table[:, [place[f"{c}/{j}"] for j in JOINTS]] for c in ("q", "dq", "tau")]
    moved = np.any(np.diff(np.hstack(channels[:2]), axis=0) != 0, axis=1)
    keep = np.append(True, moved) & np.append(True, np.diff(t) > 0)
    even = np.arange(t[keep][0], t[keep][-1], STEP)
    return [np.stack([np.interp(even, t[keep], x) for x in c[keep].T], 1) for c in channels]


def smooth(x, cutoff):
    """Forward and backward through a Butterworth filter of fourth order: its squared magnitude and no phase."""
    n = len(x)
    pad = min(n - 1, 500)
    whole = np.concatenate([2 * x[0] - x[pad:0:-1], x, 2 * x[-1] - x[-2 : -pad - 2 : -1]])
    frequency = np.fft.rfftfreq(len(whole), STEP)
    gain = 1 / (1 + (frequency / cutoff) ** 8)
    return np.fft.irfft(np.fft.rfft(whole, axis=0) * gain[:, None], len(whole), axis=0)[pad : pad + n]


def means(x):
    """Means over windows, by the trapezoidal rule."""
    count = (len(x) - 1) // WINDOW
    middle = 0.5 * (x[1:] + x[:-1])[: count * WINDOW]
    return middle.reshape(count, WINDOW, *x.shape[1:]).mean(1)


def mean_sign(v):
    """Means of the sign over windows, a reversal at its own time within a sample."""
    a, b = v[:-1], v[1:]
    share = (np.abs(a) * np.sign(a) + np.abs(b) * np.sign(b)) / (np.abs(a) + np.abs(b) + 1e-300)
    count = len(share) // WINDOW
    return share[: count * WINDOW].reshape(count, WINDOW, -1).mean(1)


def dahl(v, reach):
    """Friction that builds up over a path (Dahl 1968), of size one: dz/dx = (1 − z sign v)/reach, exact while v keeps its sign."""
    z = np.zeros_like(v)
    for k in range(1, len(v)):
        sign, fade = np.sign(v[k]), np.exp(-np.abs(v[k]) * STEP / reach)
        z[k] = sign + (z[k - 1] - sign) * fade
    return z


class Log:
    """A log's motion, and the window means of what is linear in the parameters."""

    def __init__(self, q, dq, tau, cutoff):
        slope = np.gradient(q, STEP, axis=0)
        self.q, self.v = smooth(q, cutoff), smooth(dq, cutoff)
        self.a = np.gradient(self.v, STEP, axis=0)
        self.rigid, self.mass = self.regressors()
        self.tau = means(tau)
        self.moves = means((np.abs(slope) < REST).astype(float)) < MOST_REST
        plain = (means(self.v), mean_sign(self.v), means(self.a), np.ones_like(self.tau))
        self.plain = [means(self.rigid[:, leg]) for leg in range(4)], plain

    def regressors(self):
        """Per leg, rows of its joints; and the joints' mass matrix at the CAD's bodies."""
        rigid, mass = np.zeros((len(self.q), 4, 3, BODIES)), np.zeros((len(self.q), 4, 3, 3))
        q, v, a = (np.zeros(MODEL.nv) for _ in range(3))
        for k in range(len(self.q)):
            q[ORDER], v[ORDER], a[ORDER] = self.q[k], self.v[k], self.a[k]
            w = pin.computeJointTorqueRegressor(MODEL, DATA, q, v, a)[np.ix_(ORDER, COLUMNS)]
            h = np.triu(pin.crba(MODEL, DATA, q))
            h = (h + np.triu(h, 1).T)[np.ix_(ORDER, ORDER)]
            for leg in range(4):
                rows, bodies = slice(3 * leg, 3 * leg + 3), slice(BODIES * leg, BODIES * leg + BODIES)
                rigid[k, leg], mass[k, leg] = w[rows, bodies], h[rows, rows]
        return rigid, mass

    def of(self, leg):
        """Reported torques and whether each joint moves."""
        own = slice(3 * leg, 3 * leg + 3)
        return self.tau[:, own], self.moves[:, own]

    def columns(self, leg, term, first):
        """Window means: \\[window, joint, parameter\\]."""
        own = slice(3 * leg, 3 * leg + 3)
        bodies, plain = self.plain
        blocks = [bodies[leg]] + [diagonal(x[:, own]) for x in plain]
        if term is not None:
            blocks.append(term(self, leg, first))
        return np.concatenate(blocks, axis=2)


def diagonal(x):
    """One parameter per joint, which acts at that joint."""
    out = np.zeros((len(x), 3, 3))
    for joint in range(3):
        out[:, joint, joint] = x[:, joint]
    return out


def per_joint(function):
    """A term of each joint's own motion."""

    def term(log, leg, _):
        own = slice(3 * leg, 3 * leg + 3)
        return diagonal(means(function(log.q[:, own], log.v[:, own], log.a[:, own])))

    return term


def presliding(reach, joints=(0, 1, 2)):
    return lambda log, leg, _: diagonal(means(dahl(log.v[:, 3 * leg : 3 * leg + 3], reach)))[:, :, list(joints)]


def load_friction(log, leg, first):
    own = slice(3 * leg, 3 * leg + 3)
    return diagonal(means(np.abs(log.rigid[:, leg] @ first[:BODIES]) * np.sign(log.v[:, own])))


def lateness(log, leg, first):
    """The torque that the four effects predict, by time."""
    own, torque = slice(3 * leg, 3 * leg + 3), log.rigid[:, leg] @ first[:BODIES]
    for n, x in enumerate((log.v, np.sign(log.v), log.a)):
        torque = torque + x[:, own] * first[BODIES + 3 * n : BODIES + 3 * n + 3]
    return diagonal(means(np.gradient(torque, STEP, axis=0)))


def compliance(log, leg, first):
    """q_link = q − c τ̂, to first order in c: the inertia's part."""
    torque = log.rigid[:, leg] @ first[:BODIES]
    twice = np.gradient(np.gradient(torque, STEP, axis=0), STEP, axis=0)
    return means(-log.mass[:, leg] * twice[:, None, :])


def coupling(signal):
    """What the other two joints of the leg do."""

    def term(log, leg, _):
        own = means(signal(log)[:, 3 * leg : 3 * leg + 3])
        out = np.zeros((len(own), 3, 6))
        for n, (joint, other) in enumerate((j, k) for j in range(3) for k in range(3) if j != k):
            out[:, joint, n] = own[:, other]
        return out

    return term


TERMS = {
    **{f"presliding, {reach} rad": presliding(reach) for reach in DAHL},
    "presliding of the calves, 0.01 rad": presliding(0.01, (2,)),
    "load friction": load_friction,
    "torque late": lateness,
    "compliance": compliance,
    "asymmetric Coulomb": per_joint(lambda q, v, a: np.minimum(np.sign(v), 0)),
    "Stribeck, 0.3 rad/s": per_joint(lambda q, v, a: np.sign(v) * np.exp(-((v / 0.3) ** 2))),
    "quadratic drag": per_joint(lambda q, v, a: v * np.abs(v)),
    "spring": per_joint(lambda q, v, a: q),
    "coupled accelerations": coupling(lambda log: log.a),
    "coupled Coulomb": coupling(lambda log: np.sign(log.v)),
    "coupled velocities": coupling(lambda log: log.v),
}


def prior(leg):
    """Square root of the information on a leg's bodies: each pseudo-inertia L Lᵀ becomes L (1 + E)(1 + E)ᵀ Lᵀ."""
    root = np.zeros((BODIES, BODIES))
    for body in range(3):
        at = slice(10 * body, 10 * body + 10)
        m, hx, hy, hz, xx, xy, xz, yy, yz, zz = NOMINAL[BODIES * leg :][at]
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        p = np.zeros((4, 4))
        p[:3, :3] = np.trace(inertia) / 2 * np.eye(3) - inertia
        p[:3, 3] = p[3, :3] = hx, hy, hz
        p[3, 3] = m
        size, slopes = np.linalg.cholesky(p), []
        for i, j in np.ndindex(4, 4):
            change = np.zeros((4, 4))
            change[i, j] = CAD
            change = size @ (change + change.T) @ size.T
            s = change[:3, :3]
            moment = np.trace(s) * np.eye(3) - s
            slopes.append([change[3, 3], *change[:3, 3], *moment[np.triu_indices(3)]])
        slopes = np.array(slopes)
        root[at, at] = np.linalg.inv(np.linalg.cholesky(slopes.T @ slopes))
    return root.T @ root


class Squares:
    """Normal equations of every log, leg and joint, from which any union of logs is fitted."""

    def __init__(self, logs, term=None, first=None):
        self.of, self.count = {}, {}
        for i, log in enumerate(logs):
            for leg in range(4):
                columns = log.columns(leg, term, None if first is None else first[leg])
                tau, moves = log.of(leg)
                for joint in range(3):
                    on = moves[:, joint]
                    rows = np.column_stack([columns[on, joint], tau[on, joint]])
                    self.of[i, leg, joint], self.count[i, leg, joint] = rows.T @ rows, on.sum()

    def fit(self, logs, leg):
        """θ of a leg; joints are weighted by their own residual."""
        p = len(self.of[0, leg, 0]) - 1
        nominal = np.append(NOMINAL[BODIES * leg :][:BODIES], np.zeros(p - BODIES))
        weights = np.ones(3)
        for _ in range(4):
            sum_ = sum(weights[j] * self.of[i, leg, j] for i in logs for j in range(3))
            normal, right = sum_[:p, :p].copy(), sum_[:p, p] - sum_[:p, :p] @ nominal
            normal[:BODIES, :BODIES] += prior(leg)
            extra = np.arange(BODIES + 3 * len(PLAIN), p)
            normal[extra, extra] *= 1 + RIDGE**2
            size = np.sqrt(np.diag(normal)) + 1e-12
            normal = normal / np.outer(size, size) + 1e-12 * np.eye(p)
            theta = nominal + np.linalg.solve(normal, right / size) / size
            for j in range(3):
                weights[j] = 1 / self.rms(logs, leg, j, theta) ** 2
        return theta

    def rms(self, logs, leg, joint, theta):
        u = np.append(-theta, 1)
        total = sum(u @ self.of[i, leg, joint] @ u for i in logs)
        return np.sqrt(max(total, 0) / sum(self.count[i, leg, joint] for i in logs))


def errors(train, test, logs):
    """rms \\[log, joint\\] of `logs` by what `train` has; other logs' motion may be given in `test`."""
    out = np.zeros((len(logs), 12))
    for n, i in enumerate(logs):
        others = [k for k in logs if k != i]
        for leg in range(4):
            theta = train.fit(others, leg)
            out[n, 3 * leg : 3 * leg + 3] = [test.rms([i], leg, j, theta) for j in range(3)]
    return out


def over(error):
    return np.sqrt(np.mean(error**2, axis=-1))


def line(name, error, reference):
    per_log = over(error)
    whole = over(per_log)
    share = f"{whole / reference:6.3f}" if reference else "      "
    print(f"{name:42s}", *(f"{x:7.4f}" for x in per_log), f"{whole:8.4f}", share, flush=True)
    return whole


def by_proprio(proprio, paths):
    """`identify -o` on all logs but one, `compare --given` on that one."""
    error = np.zeros((len(paths), 12))
    run = lambda *arguments: subprocess.run([proprio, *map(str, arguments)], check=True, capture_output=True, text=True)
    with tempfile.TemporaryDirectory() as folder:
        plain, fitted = Path(folder) / "plain.toml", Path(folder) / "fitted.toml"
        run("add", *PLAIN, "-m", plain)
        for n, path in enumerate(paths):
            run("identify", *(p for p in paths if p != path), "-m", plain, "-o", fitted)
            compared = json.loads(run("compare", path, "-m", fitted, "--given", "--json").stdout)
            rms = {joint["joint"]: joint["rms"] for joint in compared["joints"]}
            error[n] = [rms[joint] for joint in JOINTS]
    return error


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("logs", nargs="+", type=Path)
    parser.add_argument("--proprio", type=Path, help="the command to compare with")
    parser.add_argument("--joints", action="store_true", help="also each joint's error")
    arguments = parser.parse_args()
    if len(arguments.logs) < 2:
        parser.error("give two logs or more: each is predicted by the others")
    for n, path in enumerate(arguments.logs):
        print(f"{n + 1}: {path.name}")
    print(f"\n{'rms, N m':42s}", *(f"{n + 1:7d}" for n in range(len(arguments.logs))), f"{'all':>8s}", " share")
    reference, error = None, None
    if arguments.proprio:
        error = by_proprio(arguments.proprio, arguments.logs)
        reference = line("proprio identify, four effects", error, None)
    raw, indices = [read(path) for path in arguments.logs], range(len(arguments.logs))
    squares = {c: Squares([Log(*channels, c) for channels in raw]) for c in CUTOFFS}
    for cutoff, of in squares.items():
        line(f"four effects, motion below {cutoff:.0f} Hz", errors(of, of, indices), reference)
    rough, fine = squares[CUTOFFS[0]], squares[20.0]
    line(f"  fit below {CUTOFFS[0]:.0f} Hz, prediction below 20 Hz", errors(rough, fine, indices), reference)
    line(f"  fit below 20 Hz, prediction below {CUTOFFS[0]:.0f} Hz", errors(fine, rough, indices), reference)
    logs = [Log(*channels, CUTOFF) for channels in raw]
    plain = Squares(logs)
    own = errors(plain, plain, indices)
    line(f"four effects, motion below {CUTOFF:.0f} Hz", own, reference)
    # The torque that further terms are made of: by all logs, since a fit of four of them differs by far less than the terms do.
    first = [plain.fit(indices, leg) for leg in range(4)]
    for name, term in TERMS.items():
        with_term = Squares(logs, term, first)
        line(f"  and {name}", errors(with_term, with_term, indices), reference)
    print("\none log's four effects on each log")
    for i in indices:
        theta = [plain.fit([i], leg) for leg in range(4)]
        rms = [[plain.rms([k], leg, j, theta[leg]) for leg in range(4) for j in range(3)] for k in indices]
        print(f"{arguments.logs[i].name:42s}", *(f"{x:7.4f}" for x in over(np.array(rms))))
    if arguments.joints:
        print(f"\n{'joint':12s} {'here':>7s}" + (" proprio" if reference else ""))
        for j, joint in enumerate(JOINTS):
            theirs = f" {over(error[:, j]):7.4f}" if reference else ""
            print(f"{joint:12s} {over(own[:, j]):7.4f}{theirs}")


if __name__ == "__main__":
    main()
