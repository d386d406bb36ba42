"""Writes what Pinocchio and MuJoCo make of the files that `proprio export` writes. See README.md.

The robot is the Go2 with every body changed: each pseudo-inertia P becomes A P A' with a random A near 1, so that all
stay physical and none is symmetric; its base is tilted, its joints have friction and rotors.
"""

import hashlib
import json
import platform
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin

from generate import GRAVITY, JOINTS, PARAMETERS

SEED = 20240301
STATES = 50
HERE = Path(__file__).resolve().parent
RPY = (0.1, -0.2, 0.3)  # the base in the world
EFFECTS = {"viscous": (0.02, 0.1), "coulomb": (0.1, 0.6), "armature": (0.003, 0.02)}  # uniform between these
# MuJoCo's friction is a constraint that saturates; at these speeds it has (asserted by the agreement with Pinocchio).
SPEEDS, ACCELERATION = (1.5, 10.0), 50.0
EXPORTS = {
    "whole.urdf": ["--urdf"],
    "user.urdf": ["--urdf", "go2.urdf"],
    "whole.xml": ["--mjcf"],
    "user.xml": ["--mjcf", "user.xml"],
}


def pseudo_inertia(phi):
    m, hx, hy, hz, xx, xy, xz, yy, yz, zz = phi
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    p = np.zeros((4, 4))
    p[:3, :3] = np.trace(inertia) / 2 * np.eye(3) - inertia
    p[:3, 3] = p[3, :3] = hx, hy, hz
    p[3, 3] = m
    return p


def parameters(p):
    s = p[:3, :3]
    i = np.trace(s) * np.eye(3) - s
    return np.array([p[3, 3], *p[:3, 3], i[0, 0], i[0, 1], i[0, 2], i[1, 1], i[1, 2], i[2, 2]])


def write_model(random):
    """The model file; returns the effects' values, joint by joint."""
    theta = json.loads((HERE / "manifest.json").read_text())["systems"]["pinned"]["theta"]
    text = f'format = 1\n\n[robot]\nbuiltin = "go2"\n\n[base]\nmount = "pinned"\nrpy = {list(RPY)}\n'
    effects = {}
    for joint in JOINTS:
        for effect, bounds in EFFECTS.items():
            value = float(f"{random.uniform(*bounds):.4g}")
            effects[effect, joint] = value
            text += f'\n[[effect]]\nname = "{effect}"\njoint = "{joint}"\nvalue = {value}\n'
    for joint, phi in zip(JOINTS, np.reshape(theta, (-1, 10))):
        p = pseudo_inertia(phi)
        # Changes of 5 % in the body's own size: length and mass units would otherwise mix.
        size = np.linalg.cholesky(p)
        change = np.eye(4) + 0.05 * random.normal(size=(4, 4))
        phi = parameters(size @ change @ change.T @ size.T)
        text += f"\n[body.{joint}]\n" + "".join(f"{k} = {v:.6g}\n" for k, v in zip(PARAMETERS, phi))
    (HERE / "model.toml").write_text(text)
    return effects


def exported(proprio):
    """What `proprio export` writes, by name."""
    command = [proprio, "export", "-m", "model.toml"]
    run = lambda arguments: subprocess.run(command + arguments, cwd=HERE, check=True, capture_output=True, text=True)
    return {name: run(arguments).stdout for name, arguments in EXPORTS.items()}


def pinocchio_torques(text, effects, states):
    """Rigid-body torques; the friction is read from the file too, but its torque is ours to state."""
    model = pin.buildModelFromXML(text)
    ids = [model.getJointId(f"{joint}_joint") for joint in JOINTS]
    order = np.array([model.joints[i].idx_v for i in ids])
    for values, effect in ((model.upperDryFrictionLimit, "coulomb"), (model.damping, "viscous")):
        assert np.array_equal(values[order], [effects[effect, joint] for joint in JOINTS]), effect
    base = pin.rpy.rpyToMatrix(*RPY)
    model.gravity = pin.Motion(base.T @ np.array([0, 0, -GRAVITY]), np.zeros(3))
    data = model.createData()
    torques = []
    for state in states:
        q, v, a = (np.zeros(model.nv) for _ in range(3))
        q[order], v[order], a[order] = state
        torques.append(pin.rnea(model, data, q, v, a)[order])
    return np.array(torques)


def mujoco_torques(name, text, states):
    """All torques: rigid body, armature, damping and friction."""
    model = mujoco.MjModel.from_xml_string(text)
    joints = [model.joint(f"{joint}_joint") for joint in JOINTS]
    q, v = (np.array([getattr(j, key)[0] for j in joints]) for key in ("qposadr", "dofadr"))
    if name.startswith("user"):
        # The user's base stays level: gravity turns instead.
        model.opt.gravity[:] = pin.rpy.rpyToMatrix(*RPY).T @ np.array([0, 0, -GRAVITY])
    data = mujoco.MjData(model)
    torques = []
    for state in states:
        data.qpos[q], data.qvel[v], data.qacc[v] = state
        mujoco.mj_inverse(model, data)
        torques.append(data.qfrc_inverse[v].copy())
    return np.array(torques)


def draw(random):
    lower = np.array([-1.0, -0.5, -2.6] * 4)
    upper = np.array([1.0, 3.4, -0.9] * 4)
    speed = random.uniform(*SPEEDS, 12) * random.choice([-1, 1], 12)
    return np.array([random.uniform(lower, upper), speed, random.uniform(-ACCELERATION, ACCELERATION, 12)])


def main():
    proprio = sys.argv[1] if len(sys.argv) > 1 else HERE.parents[1] / "target/release/proprio"
    random = np.random.default_rng(SEED)
    effects = write_model(random)
    states = [draw(random) for _ in range(STATES)]
    files = exported(proprio)
    rigid = [pinocchio_torques(text, effects, states) for name, text in files.items() if name.endswith("urdf")]
    whole = [mujoco_torques(name, text, states) for name, text in files.items() if name.endswith("xml")]
    assert np.abs(rigid[0] - rigid[1]).max() < 1e-9, np.abs(rigid[0] - rigid[1]).max()
    assert np.abs(whole[0] - whole[1]).max() < 1e-8, np.abs(whole[0] - whole[1]).max()
    gap = {}
    for k, (_, v, a) in enumerate(states):
        at = lambda effect: np.array([effects[effect, joint] for joint in JOINTS])
        sum_ = rigid[0][k] + at("viscous") * v + at("coulomb") * np.sign(v) + at("armature") * a
        gap[k] = np.abs(sum_ - whole[0][k]).max()
    print(f"whole against user's: URDF {np.abs(rigid[0] - rigid[1]).max():.1e}, MJCF "
          f"{np.abs(whole[0] - whole[1]).max():.1e} N m; Pinocchio and effects against MuJoCo {max(gap.values()):.1e}")
    records = np.concatenate([np.reshape(states, (STATES, -1)), rigid[0], whole[0]], axis=1)
    (HERE / "export.f64").write_bytes(records.astype("<f8").tobytes())
    manifest = {
        "command": "python export.py",
        "pin": pin.__version__,
        "mujoco": mujoco.__version__,
        "numpy": np.__version__,
        "python": platform.python_version(),
        "seed": SEED,
        "fields": ["q", "v", "a", "tau_pinocchio", "tau_mujoco"],
        "sha256": {name: hashlib.sha256(text.encode()).hexdigest() for name, text in files.items()},
    }
    (HERE / "export.json").write_text(json.dumps(manifest, indent=1) + "\n")


if __name__ == "__main__":
    main()
