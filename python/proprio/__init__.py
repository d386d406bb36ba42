"""What your robot's body really is, and what the model of it is still missing.

The loop of a robot's owner: a `Log`, `diagnose` which physical effect the model lacks, `identify` the values, `compare` the model with
another log; `predict` gives the torque at the log's own rate, `excite` the next motion to record. These are what the commands of the same
names do, and they give the same numbers.

    import proprio

    log = proprio.Log("chirp.csv")
    diagnosis = proprio.diagnose(log)
    fitted = proprio.identify(log, diagnosis.model)
    proprio.compare(proprio.Log("other.csv"), fitted.model)

All numbers are SI, on the joint side: s, rad, rad/s, N m, kg, degrees Celsius. Errors are exceptions (`proprio.Error`) whose `hint` says what
to do. Ctrl-C raises `KeyboardInterrupt` at once; a search that is running then ends by itself within seconds.
"""

from ._proprio import (
    Comparison,
    Diagnosis,
    DynamicsError,
    Error,
    Fitted,
    JointSeries,
    Log,
    LogError,
    Model,
    ModelError,
    Motion,
    MotionError,
    Parameter,
    UnknownNameError,
    WriteError,
    add,
    compare,
    diagnose,
    excite,
    forward_dynamics,
    identify,
    inverse_dynamics,
    mass_matrix,
    predict,
    regressor_parameters,
    torque_regressor,
)

__all__ = [
    "Comparison",
    "Diagnosis",
    "DynamicsError",
    "Error",
    "Fitted",
    "JointSeries",
    "Log",
    "LogError",
    "Model",
    "ModelError",
    "Motion",
    "MotionError",
    "Parameter",
    "UnknownNameError",
    "WriteError",
    "add",
    "compare",
    "diagnose",
    "excite",
    "forward_dynamics",
    "identify",
    "inverse_dynamics",
    "mass_matrix",
    "predict",
    "regressor_parameters",
    "torque_regressor",
]
