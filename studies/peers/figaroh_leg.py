"""figaroh's exciting motion of a Go2's FR leg beside proprio's: same joint limits, same length, same time.

    python3 -m venv target/figaroh && target/figaroh/bin/pip install -r studies/peers/requirements-figaroh.txt
    cargo build --release -p proprio
    target/figaroh/bin/python studies/peers/figaroh_leg.py target/release/proprio

figaroh's parts are used as its BaseOptimalTrajectory does: cubic splines through waypoints (CubicSpline), its base regressor, its
objective numpy.linalg.cond(W_b), its IPOPT configuration for trajectories; velocity and torque limited at every sample, position at
the waypoints. Its default derivatives (numdifftools) take ten times as long as the forward differences that are used here, and
collisions are left out: both in its favour. Both run on one and the same core, so that time on the wall is alike. figaroh starts
anew from random waypoints, in turn every 2, 1 and 0.5 s, until it has had as much time as proprio took, on the wall and of the
processor, and the start that is under way then is finished; the best motion within its constraints counts. proprio keeps clear of the trunk besides, and to the torques of a leg with friction and parameters
off by 10 %; it is not given figaroh's cost but the condition number of all columns.

Printed for both motions: figaroh's own cost, and the condition number of the 17 nonzero singular values of all columns.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as ET

import cyipopt
import numpy as np
import pinocchio as pin
from figaroh.tools.qrdecomposition import build_baseRegressor, get_baseIndex
from figaroh.tools.regressor import build_regressor_basic, build_regressor_reduced, get_index_eliminate
from figaroh.tools.robot import Robot
from figaroh.tools.robotipopt import BaseOptimizationProblem, IPOPTConfig
from figaroh.identification.identification_tools import get_standard_parameters
from figaroh.utils.cubic_spline import CubicSpline

HERE = os.path.dirname(os.path.abspath(__file__))
LEG = ["FR_hip", "FR_thigh", "FR_calf"]
# Kept back as `proprio excite` does by default: rad from the stops, share of speed and of torque.
POSITION, SHARE = 0.05, 0.8
DURATION, RATE = 10.0, 50
# Waypoints per second: figaroh's examples have one every two seconds; with one the spline is as fast as they allow.
STEPS = [2.0, 1.0, 0.5]
# What counts as a zero singular value, and as a kept constraint.
ZERO, KEPT = 1e-6, 1e-3


def leg_urdf(folder):
    """The URDF of the leg alone, its limits drawn in."""
    root = ET.parse(os.path.join(HERE, "..", "oracle", "go2.urdf")).getroot()
    children = {}
    for joint in root.findall("joint"):
        children.setdefault(joint.find("parent").get("link"), []).append(joint)
    kept_links, kept_joints, open_links = set(), [], ["base"]
    while open_links:
        link = open_links.pop()
        kept_links.add(link)
        for joint in children.get(link, []):
            other_leg = joint.get("name")[:3] in ("FL_", "RR_", "RL_")
            if not other_leg:
                kept_joints.append(joint)
                open_links.append(joint.find("child").get("link"))
    for element in list(root):
        if element.tag == "link" and element.get("name") not in kept_links:
            root.remove(element)
        if element.tag == "joint" and element not in kept_joints:
            root.remove(element)
    for joint in kept_joints:
        limit = joint.find("limit")
        if limit is None or joint.get("type") == "fixed":
            continue
        limit.set("lower", str(float(limit.get("lower")) + POSITION))
        limit.set("upper", str(float(limit.get("upper")) - POSITION))
        for name in ("velocity", "effort"):
            limit.set(name, str(SHARE * float(limit.get(name))))
    path = os.path.join(folder, "leg.urdf")
    ET.ElementTree(root).write(path)
    return path


class Leg:
    """The leg in figaroh, its base parameters and its limits."""

    def __init__(self, path):
        self.robot = Robot(path, package_dirs=[os.path.dirname(path)])
        self.model = self.robot.model
        self.joints = [name for name in self.model.names if name != "universe"]
        assert self.model.nv == 3, self.joints
        self.config = {
            "is_joint_torques": True, "is_external_wrench": False, "force_torque": None, "has_friction": False,
            "has_actuator_inertia": False, "has_joint_offset": False, "has_custom_parameters": False, "act_idxv": [0, 1, 2],
        }
        random = np.random.default_rng(0)
        low, high = self.model.lowerPositionLimit, self.model.upperPositionLimit
        states = 300
        q = random.uniform(low, high, (states, 3))
        v, a = random.uniform(-5, 5, (states, 3)), random.uniform(-25, 25, (states, 3))
        w = self.regressor(q, v, a)
        names = get_standard_parameters(self.model, self.config)
        self.eliminated, kept = get_index_eliminate(w, names, tol_e=0.001)
        self.base = get_baseIndex(build_regressor_reduced(w, self.eliminated), kept)

    def regressor(self, q, v, a):
        return build_regressor_basic(self.robot, q, v, a, self.config)

    def cost(self, q, v, a):
        """figaroh's objective."""
        reduced = build_regressor_reduced(self.regressor(q, v, a), self.eliminated)
        return np.linalg.cond(build_baseRegressor(reduced, self.base))

    def truncated(self, q, v, a):
        """Largest over smallest nonzero singular value of all columns, and how many there are."""
        values = np.linalg.svd(self.regressor(q, v, a), compute_uv=False)
        values = values[values > ZERO * values[0]]
        return values[0] / values[-1], len(values)

    def torque(self, q, v, a):
        data = self.model.createData()
        return np.array([pin.rnea(self.model, data, *state) for state in zip(q, v, a)])


class Waypoints(BaseOptimizationProblem):
    """The problem that figaroh's BaseOptimalTrajectory hands to IPOPT."""

    def __init__(self, leg, step, random):
        super().__init__("leg")
        self.leg, self.count = leg, round(DURATION / step) + 1
        self.spline = CubicSpline(leg.robot, self.count, leg.joints)
        self.times = np.matrix([step * k for k in range(self.count)]).transpose()
        self.low, self.high = leg.model.lowerPositionLimit, leg.model.upperPositionLimit
        self.start = (self.low + self.high) / 2
        self.last = None
        self.best = (np.inf, None)
        size = 1.0
        guess = random.uniform(self.low, self.high, (self.count - 1, 3)) - self.start
        # Drawn in until it is within the limits.
        while True:
            self.guess = (self.start + size * guess).ravel()
            if self.violation(self.guess) <= KEPT:
                break
            size *= 0.8

    def motion(self, x):
        waypoints = np.vstack((self.start, np.reshape(x, (self.count - 1, 3)))).T
        rest = np.zeros((3, self.count))
        _, q, v, a = self.spline.get_full_config(RATE, self.times, waypoints, rest, rest)
        return np.asarray(q), np.asarray(v), np.asarray(a)

    def both(self, x):
        if self.last is None or not np.array_equal(self.last[0], x):
            q, v, a = self.motion(x)
            torque = self.leg.torque(q, v, a)
            limits = np.concatenate([v.ravel(), torque.ravel()])
            self.last = (np.array(x), self.leg.cost(q, v, a), limits)
        return self.last

    def most(self):
        samples = len(self.last[2]) // 6
        return np.concatenate(
            [np.tile(self.leg.model.velocityLimit, samples), np.tile(self.leg.model.effortLimit, samples)])

    def violation(self, x):
        limits = self.both(x)[2]
        return np.max(np.abs(limits) / self.most()) - 1

    def objective(self, x):
        cost = self.both(x)[1]
        if cost < self.best[0] and self.violation(x) <= KEPT:
            self.best = (cost, np.array(x))
        return cost

    def constraints(self, x):
        return self.both(x)[2]

    def differences(self, x, which):
        here = self.both(x)[which]
        columns = []
        for k in range(len(x)):
            there = np.array(x)
            there[k] += 1e-6
            columns.append((self.both(there)[which] - here) / 1e-6)
        self.last = None
        return columns

    def gradient(self, x):
        return np.array(self.differences(x, 1))

    def jacobian(self, x):
        return np.array(self.differences(x, 2)).T.ravel()

    def get_variable_bounds(self):
        return list(np.tile(self.low, self.count - 1)), list(np.tile(self.high, self.count - 1))

    def get_constraint_bounds(self):
        self.both(self.guess)
        most = self.most()
        return list(-most), list(most)

    def get_initial_guess(self):
        return list(self.guess)


def figaroh_best(leg, seconds):
    """The best of as many starts as there is time for, waypoints by turns every 2, 1 and 0.5 s."""
    best, begun, seed = (np.inf, None, None), now(), 0
    while np.any(now() - begun < seconds):
        problem = Waypoints(leg, STEPS[seed % len(STEPS)], np.random.default_rng(seed))
        lower, upper = problem.get_variable_bounds()
        least, most = problem.get_constraint_bounds()
        solver = cyipopt.Problem(n=len(lower), m=len(least), problem_obj=problem, lb=lower, ub=upper, cl=least, cu=most)
        config = IPOPTConfig.for_trajectory_optimization()
        config.print_level = 0
        # No start takes more than a third, so that each spacing of waypoints has its turn.
        config.max_cpu_time = float(max(1.0, seconds[1] / 3))
        for name, value in config.to_ipopt_options().items():
            solver.add_option(name.decode(), value.decode() if isinstance(value, bytes) else value)
        solver.solve(np.array(problem.get_initial_guess()))
        print(f"figaroh, start {seed}, waypoints every {STEPS[seed % len(STEPS)]} s: {problem.best[0]:.1f}", file=sys.stderr)
        if problem.best[0] < best[0]:
            best = (problem.best[0], problem, problem.best[1])
        seed += 1
    return best, seed, now() - begun


def now():
    """Time on the wall and of this process, s."""
    return np.array([time.monotonic(), time.process_time()])


def ours(proprio, folder):
    """proprio's motion, and its time on the wall and of the processor, s."""
    motion = os.path.join(folder, "motion.csv")
    before, begun = os.times(), time.monotonic()
    subprocess.run(
        [proprio, "excite", "--legs", "FR", "--cost", "condition-si", "-o", motion, "--json"],
        check=True, stdout=subprocess.PIPE, cwd=folder)
    after, wall = os.times(), time.monotonic() - begun
    with open(motion) as file:
        header = file.readline().strip().split(",")
    rows = np.loadtxt(motion, delimiter=",", skiprows=1)[:: 500 // RATE]
    part = lambda channel: rows[:, [header.index(f"{channel}/{joint}") for joint in LEG]]
    seconds = after.children_user + after.children_system - before.children_user - before.children_system
    return (part("q"), part("dq"), part("ddq")), np.array([wall, seconds])


def main():
    proprio = os.path.abspath(sys.argv[1])
    # proprio searches on as many threads as there are cores: on one core nobody has more of the processor than the other.
    os.sched_setaffinity(0, [min(os.sched_getaffinity(0))])
    with tempfile.TemporaryDirectory() as folder:
        leg = Leg(leg_urdf(folder))
        motion, seconds = ours(proprio, folder)
        (_, problem, x), starts, spent = figaroh_best(leg, seconds)
        result = {"base_columns": len(leg.base)}
        peers = problem.motion(x) if problem is not None else None
        for name, of, time_spent in (("figaroh", peers, spent), ("proprio", motion, seconds)):
            if of is None:
                continue
            truncated, rank = leg.truncated(*of)
            result[name] = {
                "cond_base": round(leg.cost(*of), 2), "cond_all": round(truncated, 2), "rank": rank,
                "wall_seconds": round(time_spent[0], 1), "processor_seconds": round(time_spent[1], 1),
                "highest_speed_share": round(float(np.max(np.abs(of[1]) / leg.model.velocityLimit)), 3),
                "highest_torque_share": round(float(np.max(np.abs(leg.torque(*of)) / leg.model.effortLimit)), 3),
            }
        result["figaroh_starts"] = starts
        print(json.dumps(result, indent=1))


main()
