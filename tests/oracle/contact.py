"""Writes what Pinocchio makes of feet on the ground, for proprio-core's contact projector. See README.md."""

import json

import numpy as np
import pinocchio as pin

from generate import HERE, JOINTS, SEED, build, draw, write

STATES = 40
FOOT, RADIUS = np.array([-0.002, 0, -0.213]), 0.022  # m
CALVES = JOINTS[2::3]


def jacobian(system, q, calf):
    """3 x 18: velocity of the lowest point of a foot's sphere, in the world's axes, per unit of proprio's velocities."""
    model, data = system.model, system.data
    joint = model.getJointId(f"{calf}_joint")
    pin.computeJointJacobians(model, data, q)
    rows = pin.getJointJacobian(model, data, joint, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
    lever = data.oMi[joint].rotation @ FOOT + [0, 0, -RADIUS]
    return (rows[:3] - pin.skew(lever) @ rows[3:])[:, system.v]


def main():
    system = build("free")
    random = np.random.default_rng([SEED, 9])
    records = []
    for n in range(STATES):
        stored, q, v, a = draw(system, random)
        if n % 5 == 4:
            # Straight knees: the legs cannot shorten.
            q[system.q[2::3]] = stored["q"][2::3] = 0
        loaded = np.array([n % 2, n // 2 % 2, n // 4 % 2, n // 8 % 2], dtype=float)
        torque = pin.rnea(system.model, system.data, q, v, a)[system.v]
        stacked = [jacobian(system, q, calf) for calf, on in zip(CALVES, loaded) if on]
        stacked = np.vstack(stacked) if stacked else np.zeros((0, 18))
        force = random.uniform(-100, 100, len(stacked))
        # Singular values of a posture that is not singular are far above this.
        projector = np.eye(18) - np.linalg.pinv(stacked, rcond=1e-9) @ stacked
        records.append({
            "base_quaternion": stored["base_quaternion"],
            **{name: stored[name] for name in ("q", "v", "a")},
            "loaded": loaded,
            "without_contact": torque - stacked.T @ force,
            "projector_lower": projector[np.tril_indices(18)],
        })
    table = write(HERE / "contact.f64", records)
    manifest = {"command": "python contact.py", "pin": pin.__version__, "numpy": np.__version__, "table": table}
    (HERE / "contact.json").write_text(json.dumps(manifest, indent=1) + "\n")


if __name__ == "__main__":
    main()
