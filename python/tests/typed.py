"""A user's program, for `mypy --strict`: never run."""

import numpy as np

import proprio


def loop(path: str) -> float:
    log: proprio.Log = proprio.Log(path)
    diagnosis = proprio.diagnose(log)
    fitted = proprio.identify(log, diagnosis.model)
    friction = fitted.parameter("coulomb:FR_hip")
    if friction is None:
        return 0.0
    unit: str = friction.unit
    print(unit, fitted.held_out_rms)
    series = proprio.predict(log, fitted.model)
    total: float = sum(float(np.max(np.abs(joint.residual))) for joint in series)
    comparison = proprio.compare(log, fitted.model)
    comparison.report("report.html")
    return total + comparison.rms


def arrays(t: "np.ndarray[tuple[int], np.dtype[np.float64]]") -> proprio.Log:
    q = np.zeros((t.size, 3))
    return proprio.Log(t=t, q=q, dq=q, tau=q, joints=["FR_hip", "FR_thigh", "FR_calf"])
