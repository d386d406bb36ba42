"""Complete robots: what `diagnose` names where nothing is hidden, for twelve kinds of what encoders, torques and recorders do.

    target/pinocchio/bin/python studies/pinocchio/complete.py target/release/proprio --robots 400 --write

Robots, motions and drives are those of `robots.py`. Each log has one kind of trouble, at a size and a rate that are drawn. A name of any effect beyond the
drive's counts as false, and so does "something that the catalogue does not have"; offsets of sensors, which are one, do not. Two hours of two cores.
"""

import argparse
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from robots import HERE, ROBOTS, drawn, named, rms, said, write_model

RATES = [100, 250, 333, 500, 1000, 2000, 5000]
ENCODERS = [4096, 16384, 65536, 2**19]


def coloured(random, shape, rate, corner):
    """Noise of unit size whose power falls above a corner, Hz."""
    keep = np.exp(-2 * np.pi * corner / rate)
    noise, state = np.empty(shape), random.normal(size=shape[1])
    for n in range(shape[0]):
        state = keep * state + np.sqrt(1 - keep**2) * random.normal(size=shape[1])
        noise[n] = state
    return noise


class Log:
    """A log without noise, and what is done to it."""

    def __init__(self, rate, t, q, dq, tau, size, random):
        self.rate, self.t, self.q, self.dq, self.tau, self.size, self.random = rate, t, q.copy(), dq.copy(), tau.copy(), size, random
        self.rows = np.arange(len(t))

    def add(self, q=0.0, dq=0.0, tau=0.0):
        """White noise: rad, share of each joint's speed, share of its torque."""
        white = lambda: self.random.normal(size=self.q.shape)
        self.q += q * white()
        self.dq += dq * rms(self.dq) * white()
        self.tau += tau * self.size * white()

    def position_noise(self):
        self.add(q=np.exp(self.random.uniform(np.log(5e-5), np.log(1.5e-3))))

    def velocity_noise(self):
        self.dq += self.random.uniform(0.005, 0.04) * self.random.normal(size=self.dq.shape)

    def torque_noise(self):
        self.add(tau=self.random.uniform(0.03, 0.15))

    def coarse_encoder(self):
        step = 2 * np.pi / self.random.choice(ENCODERS)
        self.q = step * np.round(self.q / step)

    def differences(self):
        """Velocity from the encoder's counts, over some rows."""
        self.coarse_encoder()
        over = max(1, int(self.rate * self.random.uniform(0.002, 0.01)))
        self.dq[over:-over] = (self.q[2 * over :] - self.q[: -2 * over]) * self.rate / (2 * over)

    def coarse_torque(self):
        step = self.random.uniform(0.01, 0.08) * self.size
        self.tau = step * np.round(self.tau / step)

    def slow_noise(self):
        corner = self.random.uniform(2, 30)
        self.tau += self.random.uniform(0.01, 0.05) * self.size * coloured(self.random, self.tau.shape, self.rate, corner)

    def noise_with_torque(self):
        self.tau *= 1 + self.random.uniform(0.02, 0.1) * self.random.normal(size=self.tau.shape)

    def heavy_tails(self):
        self.tau += self.random.uniform(0.01, 0.03) * self.size * self.random.standard_t(2.5, size=self.tau.shape)

    def spikes(self):
        hit = self.random.random(self.tau.shape) < self.random.uniform(1e-4, 2e-3)
        self.tau += hit * self.random.uniform(3, 10) * self.size * self.random.choice([-1, 1], self.tau.shape)

    def late_stamps(self):
        self.t = self.t + self.random.uniform(0.05, 0.4) / self.rate * self.random.random(len(self.t))

    def lost_rows(self):
        self.rows = self.rows[self.random.random(len(self.rows)) > self.random.uniform(0.005, 0.1)]

    def repeated_rows(self):
        """A recorder that reads the last message again."""
        again = self.random.random(len(self.t)) < self.random.uniform(0.01, 0.2)
        last = np.maximum.accumulate(np.where(again, 0, np.arange(len(self.t))))
        self.q, self.dq, self.tau = self.q[last], self.dq[last], self.tau[last]

    def write(self, path, names):
        head = ",".join(["t", *(f"{channel}/{name}" for channel in ("q", "dq", "tau") for name in names)])
        table = np.column_stack([self.t, self.q, self.dq, self.tau])[self.rows]
        np.savetxt(path, table, delimiter=",", header=head, comments="", fmt="%.9g")


KINDS = [
    Log.position_noise, Log.velocity_noise, Log.torque_noise, Log.coarse_encoder, Log.differences, Log.coarse_torque, Log.slow_noise,
    Log.noise_with_torque, Log.heavy_tails, Log.spikes, Log.late_stamps, Log.lost_rows, Log.repeated_rows,
]  # fmt: skip


def of_robot(proprio, seed):
    random = np.random.default_rng([seed, 3])
    robot, kind = list(ROBOTS)[random.integers(len(ROBOTS))], KINDS[random.integers(len(KINDS))]
    rate = int(random.choice(RATES))
    model, names, _, noise, (t, q, dq, ddq), tau, drive = drawn(robot, random, rate)
    log = Log(rate, t, q, dq, tau + drive.torque(dq, ddq), drive.size, random)
    log.add(q=2e-5, dq=0.002, tau=noise)
    kind(log)
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        log.write(folder / "log.csv", names)
        write_model(robot, folder / "model.toml")
        found = said(proprio, folder, "diagnose", "log.csv", *(["-m", "model.toml"] if ROBOTS[robot] else []))
    what = f"{robot}, {rate} Hz, {kind.__name__}, seed {seed}"
    if "path" not in found:
        return kind.__name__, f"{what}: refused: {found.get('message', found['verdict'])}", "refused"
    false = [f"{effect}:{joint}" for effect, joint in named(found)]
    if found["outside_catalogue"]:
        false.append("outside the catalogue")
    bodies = [body.split(":")[0] for body in found.get("bodies", [])]
    line = f"{what}: {', '.join(false) or 'nothing'}; {found['error']['after']:.4g} N m, floor {found['error']['floor']}"
    line += f"; bodies {bodies}" if bodies else ""
    return kind.__name__, line, "name" if false else "body" if bodies else "nothing"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("proprio", type=Path)
    parser.add_argument("--robots", type=int, default=400)
    parser.add_argument("--seed", type=int, default=1, help="of the first; each has the next")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--write", action="store_true", help="keep the table")
    asked = parser.parse_args()
    proprio = asked.proprio.resolve()

    def run(seed):
        of = of_robot(proprio, seed)
        print(f"{of[2]}: {of[1]}", flush=True)
        return of

    with ThreadPoolExecutor(asked.threads) as pool:
        judged = list(pool.map(run, range(asked.seed, asked.seed + asked.robots)))
    text = (
        "# Complete robots\n\n"
        f"`studies/pinocchio/complete.py PROPRIO --robots {asked.robots} --seed {asked.seed} --write`: {', '.join(ROBOTS)}; {RATES[0]} to {RATES[-1]} Hz, 20 s.\n\n"
        "| what the log has | robots | no name | a name | a body | refused |\n|---|---|---|---|---|---|\n"
    )
    for kind in [*(kind.__name__ for kind in KINDS), None]:
        own = [verdict for name, _, verdict in judged if kind in (name, None)]
        counts = " | ".join(str(own.count(one)) for one in ("nothing", "name", "body", "refused"))
        text += f"| {kind.replace('_', ' ') if kind else 'all'} | {len(own)} | {counts} |\n"
    text += "\n".join(["\nNot silent:\n", *(f"- {line}" for _, line, verdict in judged if verdict != "nothing")]) + "\n"
    print(text)
    if asked.write:
        (HERE / "complete.md").write_text(text)


if __name__ == "__main__":
    main()
