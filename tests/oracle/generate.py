"""Writes the reference dynamics of the Go2 that proprio-core is compared with. See README.md.

Every regressor column is Pinocchio's answer for a robot whose only inertia is that parameter. No regressor formula
takes part, so none can be wrong in the same way as proprio's. Identities that tie the columns together, and
Pinocchio's own regressors where it has them, are asserted on the way.
"""

import json
import platform
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

import go2_urdf

SEED = 20240229
STATES = 200
WHOLE_STATES = 5  # states of the large systems whose regressors are stored whole
GRAVITY = 9.81  # m/s2, along -z of the world
HERE = Path(__file__).resolve().parent

JOINTS = [f"{leg}_{part}" for leg in ("FR", "FL", "RR", "RL") for part in ("hip", "thigh", "calf")]
PARAMETERS = ["m", "hx", "hy", "hz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz"]
# Pinocchio orders the inertia Ixx, Ixy, Iyy, Ixz, Iyz, Izz.
FROM_PINOCCHIO = [0, 1, 2, 3, 4, 5, 7, 6, 8, 9]
REGRESSORS = ("torque", "momentum", "coriolis", "gravity", "energy")
RANKS = {"leg": 17, "pinned": 68, "free": 94}

# Base of the free robot: uniform within plus or minus these (SI units).
BASE_POSITION, BASE_ANGULAR, BASE_LINEAR = 1.0, 5.0, 2.0
BASE_ANGULAR_ACCELERATION, BASE_LINEAR_ACCELERATION = 30.0, 20.0
JOINT_SPEED, JOINT_ACCELERATION = 10.0, 50.0


@dataclass
class System:
    """A Pinocchio model and the permutations between its order and proprio's."""

    name: str
    model: pin.Model
    free: bool
    bodies: list  # names, proprio order
    ids: list  # Pinocchio joint of each body
    q: np.ndarray  # Pinocchio's configuration index of each revolute joint
    v: np.ndarray  # Pinocchio's velocity index of each of proprio's velocities

    def __post_init__(self):
        self.weightless = self.model.copy()
        self.weightless.gravity = pin.Motion.Zero()
        # The same kinematics without any inertia, to be filled parameter by parameter.
        self.unit, self.unit_weightless = self.model.copy(), self.weightless.copy()
        for i in range(self.model.njoints):
            self.set_unit(i, pin.Inertia.Zero())
        self.data = self.model.createData()

    def set_unit(self, joint, inertia):
        self.unit.inertias[joint] = inertia
        self.unit_weightless.inertias[joint] = inertia

    def theta(self):
        """All inertial parameters of the nominal robot, proprio order."""
        blocks = [self.model.inertias[i].toDynamicParameters()[FROM_PINOCCHIO] for i in self.ids]
        return np.concatenate(blocks)

    def columns(self, regressor):
        """Pinocchio's regressor (rows already in proprio's order) with proprio's columns."""
        picked = [10 * (i - 1) + k for i in self.ids for k in FROM_PINOCCHIO]
        return regressor[..., picked]


def build(name):
    free = name == "free"
    root = (pin.JointModelFreeFlyer(),) if free else ()
    model = pin.buildModelFromXML(go2_urdf.urdf(), *root)
    if free:
        mass = sum(inertia.mass for inertia in model.inertias)
        assert abs(mass - go2_urdf.TOTAL_MASS) < 1e-12, mass
    joints = JOINTS
    if name == "leg":
        joints = JOINTS[:3]
        locked = [model.getJointId(f"{joint}_joint") for joint in JOINTS[3:]]
        model = pin.buildReducedModel(model, locked, pin.neutral(model))
    model.gravity = pin.Motion(np.array([0, 0, -GRAVITY]), np.zeros(3))
    ids = [model.getJointId(f"{joint}_joint") for joint in joints]
    q = np.array([model.joints[i].idx_q for i in ids])
    v = [model.joints[i].idx_v for i in ids]
    if free:
        # Pinocchio puts the base's linear part first, Featherstone (and proprio) the angular part.
        v = [3, 4, 5, 0, 1, 2] + v
        return System(name, model, free, ["base"] + joints, [1] + ids, q, np.array(v))
    return System(name, model, free, joints, ids, q, np.array(v))


def draw(system, random):
    """A random state: (what the record stores, Pinocchio's q, v, a)."""
    model = system.model
    n = len(system.q)
    lower, upper = model.lowerPositionLimit[system.q], model.upperPositionLimit[system.q]
    joints = random.uniform(lower, upper)
    velocity = random.uniform(-JOINT_SPEED, JOINT_SPEED, n)
    acceleration = random.uniform(-JOINT_ACCELERATION, JOINT_ACCELERATION, n)
    stored = {"q": joints}
    q = pin.neutral(model)
    q[system.q] = joints
    if system.free:
        position = random.uniform(-BASE_POSITION, BASE_POSITION, 3)
        quaternion = random.normal(size=4)
        quaternion /= np.linalg.norm(quaternion)  # w x y z, uniform over rotations
        q[:3], q[3:7] = position, np.roll(quaternion, -1)
        base = [BASE_ANGULAR] * 3 + [BASE_LINEAR] * 3
        velocity = np.append(random.uniform(-1, 1, 6) * base, velocity)
        base = [BASE_ANGULAR_ACCELERATION] * 3 + [BASE_LINEAR_ACCELERATION] * 3
        acceleration = np.append(random.uniform(-1, 1, 6) * base, acceleration)
        stored |= {"base_position": position, "base_quaternion": quaternion}
    v, a = np.zeros(model.nv), np.zeros(model.nv)
    v[system.v], a[system.v] = velocity, acceleration
    return stored | {"v": velocity, "a": acceleration}, q, v, a


def dynamics(system, model, weightless, q, v, a):
    """Everything that is linear in the inertial parameters, by the five regressors' names; proprio's rows."""
    data, order, zero = system.data, system.v, np.zeros(system.model.nv)
    coriolis = pin.computeCoriolisMatrix(model, data, q, v)
    return {
        "torque": pin.rnea(model, data, q, v, a)[order],
        "momentum": pin.rnea(weightless, data, q, zero, v)[order],
        "coriolis": (coriolis.T @ v)[order],
        "gravity": pin.computeGeneralizedGravity(model, data, q)[order],
        "energy": np.array([pin.computeKineticEnergy(model, data, q, v), pin.computePotentialEnergy(model, data, q)]),
    }


def unit_parameters():
    """Each parameter as a sum of weighted inertias that Pinocchio can hold (first moments need a mass)."""
    point = np.zeros((3, 3))
    yield [(1, pin.Inertia(1.0, np.zeros(3), point))]
    for e in np.eye(3) / 2:
        yield [(1, pin.Inertia(1.0, e, point)), (-1, pin.Inertia(1.0, -e, point))]
    for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)):
        unit = np.zeros((3, 3))
        unit[i, j] = unit[j, i] = 1
        yield [(1, pin.Inertia(0.0, np.zeros(3), unit))]


UNIT_PARAMETERS = list(unit_parameters())


def regressors(system, q, v, a):
    """The five regressors, column by column."""
    columns = {name: [] for name in REGRESSORS}
    for joint in system.ids:
        for terms in UNIT_PARAMETERS:
            column = dict.fromkeys(REGRESSORS, 0)
            for weight, inertia in terms:
                system.set_unit(joint, inertia)
                part = dynamics(system, system.unit, system.unit_weightless, q, v, a)
                for name in REGRESSORS:
                    column[name] = column[name] + weight * part[name]
            for name in REGRESSORS:
                columns[name].append(column[name])
        system.set_unit(joint, pin.Inertia.Zero())
    return {name: np.stack(columns[name], axis=1) for name in REGRESSORS}


def close(actual, expected, tolerance, what):
    """Largest error relative to the largest entry."""
    error = np.max(np.abs(actual - expected)) / max(np.max(np.abs(expected)), 1e-300)
    assert error < tolerance, f"{what}: relative error {error:.1e}"


def check_state(system, q, v, a, w, nominal, record):
    """The nominal robot and Pinocchio's own regressors agree with the columns."""
    model, data, order, theta = system.weightless, system.data, system.v, system.theta()
    zero = np.zeros(model.nv)
    for name in REGRESSORS:
        close(w[name] @ theta, nominal[name], 1e-12, f"{system.name} {name} W theta")
    close(w["momentum"] @ theta, record["H"] @ record["v"], 1e-12, "momentum")
    close(record["H"] @ record["a"] + record["Cv"] + record["g"], record["tau"], 1e-12, "torque")

    def torque(which, *motion):
        return system.columns(pin.computeJointTorqueRegressor(which, data, q, *motion)[order])

    close(w["torque"], torque(system.model, v, a), 1e-12, "torque regressor")
    close(w["gravity"], torque(system.model, zero, zero), 1e-12, "gravity regressor")
    close(w["momentum"], torque(model, zero, v), 1e-12, "momentum regressor")
    kinetic = system.columns(pin.computeKineticEnergyRegressor(system.model, data, q, v))
    potential = system.columns(pin.computePotentialEnergyRegressor(system.model, data, q))
    close(w["energy"], np.vstack([kinetic, potential]), 1e-12, "energy regressor")

    if system.free:
        # The base's rows of C^T v are what turns with the base: -(v0 x* h0).
        omega, linear = record["v"][:3], record["v"][3:6]
        moment, force = w["momentum"][:3], w["momentum"][3:6]
        turning = np.cross(omega, moment, axisb=0, axisc=0) + np.cross(linear, force, axisb=0, axisc=0)
        close(w["coriolis"][:3], -turning, 1e-12, "base rows, moment")
        close(w["coriolis"][3:6], -np.cross(omega, force, axisb=0, axisc=0), 1e-12, "base rows, force")


def check_motion(system, q, v, a):
    """d/dt(H v) = C^T v + tau - g and the power balance, integrated along 20 ms of motion, for every column."""
    duration = 0.02
    # tau - g, H and C^T v in base coordinates do not depend on the base's pose, so only the joints need to move.
    n = len(system.q)  # Pinocchio, too, puts the joints after the base

    def at(t):
        moved = q.copy()
        moved[-n:] += (v * t + a * t * t / 2)[-n:]
        return regressors(system, moved, v + a * t, a), (v + a * t)[system.v]

    momentum = kinetic = 0
    for node, weight in zip(*np.polynomial.legendre.leggauss(12)):
        w, velocity = at((node + 1) * duration / 2)
        net = w["torque"] - w["gravity"]
        momentum = momentum + weight * duration / 2 * (w["coriolis"] + net)
        kinetic = kinetic + weight * duration / 2 * (velocity @ net)
    (first, _), (last, _) = at(0), at(duration)
    close(momentum, last["momentum"] - first["momentum"], 1e-11, f"{system.name} momentum balance")
    close(kinetic, last["energy"][0] - first["energy"][0], 1e-11, f"{system.name} power balance")
    # Gravity is the slope of the potential energy, here along v with the base moving too.
    step = 1e-5
    ahead, behind = (pin.integrate(system.model, q, sign * step * v) for sign in (1, -1))
    rise = regressors(system, ahead, v, a)["energy"][1] - regressors(system, behind, v, a)["energy"][1]
    close(rise / (2 * step), first["gravity"].T @ v[system.v], 1e-7, f"{system.name} potential")


def generate(name, index):
    """All records of one system: (system, per-state fields, regressors)."""
    system = build(name)
    random = np.random.default_rng([SEED, index])
    records, whole = [], []
    for i in range(STATES):
        record, q, v, a = draw(system, random)
        w = regressors(system, q, v, a)
        nominal = dynamics(system, system.model, system.weightless, q, v, a)
        h = pin.crba(system.model, system.data, q)
        h = (np.triu(h) + np.triu(h, 1).T)[np.ix_(system.v, system.v)]
        record |= {
            "tau": nominal["torque"],
            "H": h,
            "g": nominal["gravity"],
            "Cv": pin.rnea(system.weightless, system.data, q, v, np.zeros(system.model.nv))[system.v],
            "Ctv": nominal["coriolis"],
            "kinetic": nominal["energy"][:1],
            "potential": nominal["energy"][1:],
        }
        check_state(system, q, v, a, w, nominal, record)
        if i < 3:
            check_motion(system, q, v, a)
        whole.append({f"W_{key}": w[key] for key in REGRESSORS})
        if name != "leg":
            u = {"u": random.uniform(-1, 1, system.model.nv), "u_energy": random.uniform(-1, 1, 2)}
            record |= u
            for key in REGRESSORS:
                record[f"uW_{key}"] = u["u_energy" if key == "energy" else "u"] @ w[key]
        records.append(record)
    rank = np.linalg.matrix_rank(np.vstack([w["W_torque"] for w in whole]), tol=1e-8)
    assert rank == RANKS[name], (name, rank)
    return system, records, whole


def write(path, records):
    """Writes equally shaped records and returns their entry of the manifest."""
    fields = [{"name": key, "shape": list(value.shape)} for key, value in records[0].items()]
    flat = [value.ravel() for record in records for value in record.values()]
    path.write_bytes(np.concatenate(flat).astype("<f8").tobytes())
    return {"file": path.name, "records": len(records), "fields": fields}


def pack(record):
    """The record with only the lower triangle of the symmetric H, row by row."""
    h = record["H"]
    return {key: value for key, value in record.items() if key != "H"} | {"H_lower": h[np.tril_indices(len(h))]}


def main():
    (HERE / "go2.urdf").write_text(go2_urdf.urdf())
    systems = {}
    for index, name in enumerate(RANKS):
        system, records, whole = generate(name, index)
        records = [pack(record) for record in records]
        if name == "leg":
            tables = [write(HERE / "leg.f64", [r | w for r, w in zip(records, whole)])]
        else:
            tables = [
                write(HERE / f"{name}.f64", records),
                write(HERE / f"{name}_whole.f64", whole[:WHOLE_STATES]),
            ]
        systems[name] = {
            "bodies": system.bodies,
            "velocities": system.model.nv,
            "theta": system.theta().tolist(),
            "states": STATES,
            "tables": tables,
        }
        print(name, "ok")
    manifest = {
        "command": "python generate.py",
        "pin": pin.__version__,
        "numpy": np.__version__,
        "python": platform.python_version(),
        "seed": SEED,
        "gravity": GRAVITY,
        "parameters": PARAMETERS,
        "systems": systems,
    }
    text = json.dumps(manifest, indent=1)
    text = re.sub(r"\[[^][{}]*\]", lambda found: " ".join(found[0].split()), text)  # a list is one line
    (HERE / "manifest.json").write_text(text + "\n")


if __name__ == "__main__":
    main()
