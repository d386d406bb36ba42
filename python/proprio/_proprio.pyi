"""The Rust side of `proprio`. Shapes: n is the number of joints, `...` any number of dimensions of samples."""

from collections.abc import Mapping, Sequence
from os import PathLike
from typing import Any, Literal, Optional, Protocol, TypedDict, Union, final

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
ArrayLike = npt.ArrayLike
Path = Union[str, PathLike[str]]

class Table(Protocol):
    """A data frame of pandas or Polars, or an Arrow table: columns by name."""
    def __getitem__(self, name: str, /) -> Any: ...

class Error(Exception):
    """Why a step cannot be done."""
    hint: Optional[str]
    """What can be done about it."""

class LogError(Error):
    """A log cannot be read or used: which, where in it, and why."""

class ModelError(Error):
    """A model file or a URDF is refused, or values that no body has."""

class UnknownNameError(Error):
    """There is no such joint, limb or effect, or a formula cannot be read."""

class MotionError(Error):
    """No motion can be designed within these limits."""

class DynamicsError(Error):
    """Samples that do not fit the robot, or a robot whose dynamics cannot be computed."""

class WriteError(Error):
    """A file cannot be written."""

@final
class Log:
    """What was recorded of a robot, from files or arrays; SI units, joint side.

    `Log("chirp.csv")`, `Log("a.mcap", "b.csv")`: files of any format that the command reads, together.

    `Log(frame)`: a pandas or Polars data frame, an Arrow table or a dictionary with columns `t` (s), `q/<joint>` (rad), `dq/<joint>` (rad/s),
    `tau/<joint>` (N m), and optionally those of docs/logs.md.

    `Log(t=t, q=q, dq=dq, tau=tau, joints=[...])`: arrays of shape (samples,) and (samples, joints).
    """
    def __new__(
        cls,
        *sources: Union[Path, Mapping[str, ArrayLike], Table],
        joints: Sequence[str] = ...,
        name: str = "log",
        t: Optional[ArrayLike] = None,
        q: Optional[ArrayLike] = None,
        dq: Optional[ArrayLike] = None,
        tau: Optional[ArrayLike] = None,
        temp: Optional[ArrayLike] = None,
        q_des: Optional[ArrayLike] = None,
    ) -> Log:
        """Samples are read and checked when a question is asked.

        Args:
            sources: files, tables and dictionaries; several count together.
            joints: the names of the columns of `q`, `dq`, `tau`.
            name: what messages call arrays.
            t: time, s, (samples,).
            q: position, rad, (samples, joints).
            dq: velocity, rad/s, (samples, joints).
            tau: measured torque, N m, (samples, joints). `predict` does not look at it.
            temp: motor temperature, degrees Celsius, (samples, joints).
            q_des: commanded position, rad, (samples, joints).
        """
    def findings(self, model: Optional[Model] = None) -> list[str]:
        """What is wrong with the samples, a sentence each; empty if nothing is."""
    def duration(self, model: Optional[Model] = None) -> float:
        """Length of all logs together, s."""

@final
class Model:
    """A robot: its bodies, its effects with their values, and how sure these are. It never changes: `add` returns a new one."""
    @staticmethod
    def go2() -> Model:
        """A Unitree Go2 that is suspended or held, level, without any effect."""
    @staticmethod
    def from_urdf(path: Path) -> Model:
        """Any robot on a fixed base, without any effect.

        Raises:
            ModelError: the file cannot be read or states no robot.
        """
    @staticmethod
    def load(path: Path) -> Model:
        """Reads a model file, as the commands write it.

        Raises:
            ModelError: with file, line and what is wrong.
        """
    def save(self, path: Path) -> None:
        """Writes the model file, whole or not at all.

        Raises:
            WriteError: what was there stays.
        """
    @property
    def joints(self) -> list[str]:
        """The joints' names, in the model's order."""
    @property
    def effects(self) -> list[str]:
        """The effects, in the order in which they were added: `coulomb:FR_hip`."""
    def add(self, effect: str) -> Model:
        """This model with an effect more: see `add`."""
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...

@final
class Parameter:
    """A parameter with what the logs say of it."""
    @property
    def name(self) -> str:
        """`coulomb:FR_hip`; of a body `m:FR_hip`."""
    @property
    def unit(self) -> str:
        """SI unit of value and std."""
    @property
    def value(self) -> float:
        """Value, in `unit`."""
    @property
    def std(self) -> float:
        """Standard deviation, in `unit`."""
    @property
    def identified(self) -> bool:
        """Whether the logs identify it: else the value is mostly the prior's."""

@final
class Fitted:
    """A model fitted to a log. In a notebook it shows its page."""
    @property
    def model(self) -> Model:
        """The model with the values, and with which logs gave them."""
    @property
    def parameters(self) -> list[Parameter]:
        """Every parameter of every limb in the logs."""
    def parameter(self, name: str) -> Optional[Parameter]:
        """The parameter of that name."""
    @property
    def rms(self) -> float:
        """Residual over all joints and windows of 20 ms, root mean square, N m."""
    @property
    def held_out_rms(self) -> Optional[float]:
        """The same on held-out blocks of time, N m; None if too little can be held out."""
    @property
    def cad_rms(self) -> float:
        """The same of the URDF's rigid body without any effect, N m."""
    def to_dict(self) -> dict[str, Any]:
        """What `proprio identify --json` prints (docs/schema/identify.json)."""
    def to_pandas(self) -> Any:
        """A `pandas.DataFrame`: name, unit, value, std, identified."""
    def to_polars(self) -> Any:
        """A `polars.DataFrame`: name, unit, value, std, identified."""
    def page(self) -> str:
        """The page of `proprio identify --html`: one HTML document."""
    def _repr_html_(self) -> str: ...

class SeriesUnits(TypedDict):
    """Units of the columns of a `JointSeries`."""
    t: str
    q: str
    dq: str
    tau: str
    predicted: str
    residual: str

@final
class JointSeries:
    """Measured and predicted torque of a joint over time; arrays of shape (samples,)."""
    @property
    def joint(self) -> str:
        """Which joint."""
    @property
    def t(self) -> Array:
        """Time since the log's start, s."""
    @property
    def q(self) -> Array:
        """Position, rad."""
    @property
    def dq(self) -> Array:
        """Velocity, rad/s."""
    @property
    def tau(self) -> Array:
        """Measured torque, N m."""
    @property
    def predicted(self) -> Array:
        """The model's torque, N m."""
    @property
    def residual(self) -> Array:
        """Measured - predicted torque, N m."""
    @property
    def rms(self) -> float:
        """Root mean square of the residual, N m."""
    @property
    def units(self) -> SeriesUnits:
        """The unit of each column."""
    def to_pandas(self) -> Any:
        """A `pandas.DataFrame`: joint, t, q, dq, tau, predicted, residual."""
    def to_polars(self) -> Any:
        """A `polars.DataFrame`: joint, t, q, dq, tau, predicted, residual."""

@final
class Comparison:
    """A model held against a log. In a notebook it shows the report."""
    @property
    def rms(self) -> float:
        """Measured - predicted mean torque over windows of 20 ms, all joints, root mean square, N m."""
    @property
    def zero_rms(self) -> float:
        """The same of predicting zero, N m."""
    @property
    def cad_rms(self) -> float:
        """The same of the URDF's rigid body without any effect, N m."""
    @property
    def noise_floor_rms(self) -> Optional[float]:
        """Error that no model can remove, N m; None if the log is too short to estimate it."""
    @property
    def fitted(self) -> bool:
        """Whether values were fitted, to all blocks of time but the one that is predicted: the model has effects without a value."""
    @property
    def joints(self) -> list[JointSeries]:
        """Each joint's windows of 20 ms in which it moves."""
    @property
    def warnings(self) -> list[str]:
        """What is to be known of the logs, a sentence each."""
    def to_dict(self) -> dict[str, Any]:
        """What `proprio compare --json --verbose` prints (docs/schema/compare.json)."""
    def to_pandas(self) -> Any:
        """A `pandas.DataFrame`: joint, t, q, dq, tau, predicted, residual; a row per joint and window."""
    def to_polars(self) -> Any:
        """A `polars.DataFrame`: joint, t, q, dq, tau, predicted, residual; a row per joint and window."""
    def page(self) -> str:
        """The report: one HTML document that needs no network."""
    def save(self, path: Path) -> None:
        """Writes measured and predicted torque to a file, whole or not at all.

        `residuals.mcap`: at the log's rate, with residual, noise floor and events, for Foxglove, PlotJuggler and Rerun; any other name: CSV, a row per
        window of 20 ms.

        Raises:
            WriteError: it cannot be written.
        """
    def report(self, path: Path) -> None:
        """Writes the report to a file, whole or not at all.

        Raises:
            WriteError: it cannot be written.
        """
    def _repr_html_(self) -> str: ...

@final
class Diagnosis:
    """Which effects a model lacks. In a notebook it shows its page."""
    @property
    def missing(self) -> list[str]:
        """The effects that are missing, in the order in which they were found, as `add` takes them."""
    @property
    def model(self) -> Model:
        """The model with these effects, which have no value yet: `identify` gives them theirs."""
    @property
    def before(self) -> float:
        """Error of the model with the values that it has, root mean square over all joints, N m."""
    @property
    def after(self) -> float:
        """Held-out error with what is missing, N m."""
    @property
    def noise_floor_rms(self) -> Optional[float]:
        """Error that no model can remove, N m; None if the log is too short to estimate it."""
    @property
    def outside_catalogue(self) -> list[str]:
        """Structure that no effect of the catalogue explains, a sentence each."""
    @property
    def warnings(self) -> list[str]:
        """What is to be known of the logs, a sentence each."""
    def to_dict(self) -> dict[str, Any]:
        """What `proprio diagnose --json` prints (docs/schema/diagnose.json)."""
    def to_pandas(self) -> Any:
        """A `pandas.DataFrame`: the ladder, a row per step with its effect, joints and held-out error, N m."""
    def to_polars(self) -> Any:
        """A `polars.DataFrame`: the ladder, a row per step with its effect, joints and held-out error, N m."""
    def page(self) -> str:
        """The page of `proprio diagnose --html`: one HTML document."""
    def _repr_html_(self) -> str: ...

class MotionUnits(TypedDict):
    """Units of the arrays of a `Motion`."""
    t: str
    q: str
    dq: str
    ddq: str
    tau: str

@final
class Motion:
    """A motion within the robot's limits, at 500 Hz; arrays of shape (samples,) and (samples, joints)."""
    @property
    def joints(self) -> list[str]:
        """The joints that move: the columns."""
    @property
    def t(self) -> Array:
        """Time, s, (samples,)."""
    @property
    def q(self) -> Array:
        """Position, rad, (samples, joints)."""
    @property
    def dq(self) -> Array:
        """Velocity, rad/s, (samples, joints)."""
    @property
    def ddq(self) -> Array:
        """Acceleration, rad/s^2, (samples, joints)."""
    @property
    def tau(self) -> Array:
        """Feed-forward torque, N m, (samples, joints)."""
    @property
    def condition_number(self) -> float:
        """Of the identifiable inertial columns, each kind scaled by the prior: the largest of the limbs."""
    @property
    def rank(self) -> int:
        """How many combinations of inertial parameters are identifiable, over all limbs."""
    @property
    def log_det(self) -> float:
        """log det(1 + R^T R) of all parameters scaled by the prior, nats."""
    @property
    def units(self) -> MotionUnits:
        """The unit of each array."""
    def save(self, path: Path, kp: float = 40.0, kd: float = 1.5) -> None:
        """Writes the CSV that `proprio excite` writes, with feedback gains kp (N m/rad) and kd (N m s/rad)."""
    def to_pandas(self) -> Any:
        """A `pandas.DataFrame`: t, q/<joint>, dq/<joint>, ddq/<joint>, tau/<joint>."""
    def to_polars(self) -> Any:
        """A `polars.DataFrame`: t, q/<joint>, dq/<joint>, ddq/<joint>, tau/<joint>."""

def add(model: Model, effect: str) -> Model:
    """The model with an effect more: `coulomb:FR_hip`, `coulomb` at all joints, or a torque of your own, `FR_calf: c*sin(3*q)`.

    It has no value until `identify` gives it one.

    Raises:
        UnknownNameError: no such effect or joint, with the nearest name; or the formula cannot be read.
    """

def compare(log: Log, model: Optional[Model] = None) -> Comparison:
    """Holds a model (default: the Go2's rigid body) against a log.

    Values are the model's; if an effect of it has none, all are fitted to every block of time but the one that is predicted.

    Raises:
        LogError: a log cannot be read, is too short, or no joint moves.
    """

def diagnose(log: Log, model: Optional[Model] = None) -> Diagnosis:
    """Looks for the effects that a model (default: the Go2's rigid body) lacks, each judged by its held-out error.

    Raises:
        LogError: a log cannot be read, is too short, or is not what the model says.
    """

def identify(log: Log, model: Optional[Model] = None) -> Fitted:
    """Fits bodies and effects of a model to a log, within their priors.

    The default is a Go2 with viscous and Coulomb friction, armature and torque offset at each joint that was recorded.

    Raises:
        LogError: a log cannot be read, is too short, or no joint moves.
    """

def predict(log: Log, model: Optional[Model] = None) -> list[JointSeries]:
    """The torque that a model's drives would report, at the log's own samples, from the motion alone.

    Each number is a mean over the two sample periods around its time. The measured torque is not looked at: of a motion that is only planned,
    give zeros.

    Raises:
        LogError: a log cannot be read.
    """

def excite(
    model: Optional[Model] = None,
    *,
    limbs: Sequence[str] = ...,
    duration: Optional[float] = None,
    cost: Literal["condition", "condition-si", "determinant"] = "condition",
    parameters: Sequence[str] = ...,
    seed: Optional[int] = None,
    starts: Optional[int] = None,
) -> Motion:
    """Designs a motion that excites what can be identified, within the robot's limits at every instant.

    Args:
        model: default: the Go2's rigid body.
        limbs: `["FR"]`; default: all.
        duration: s; default 10.
        cost: what the motion is to be good for.
        parameters: instead of `cost`, the parameters whose variance is to be small, `["m:FR_calf"]`.
        seed: the same gives the same motion.
        starts: starts of the search per limb.

    Raises:
        MotionError: the limits leave no motion.
        UnknownNameError: no such limb or parameter.
    """

def torque_regressor(
    model: Model, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, limb: Optional[str] = None
) -> Array:
    """W of shape (..., n, 10 n) with W theta = H ddq + C dq + g: the rigid body's torque is linear in its inertial parameters.

    Args:
        model: its bodies count, not its effects.
        q: position, rad, (..., n).
        dq: velocity, rad/s, (..., n).
        ddq: acceleration, rad/s^2, (..., n).
        limb: n joints of this limb (`"FR"`) instead of all; columns of other limbs are zero.

    Raises:
        ValueError: shapes that do not fit.
        UnknownNameError: no such limb.
    """

def regressor_parameters(model: Model, limb: Optional[str] = None) -> list[str]:
    """What the 10 n columns multiply: `m:FR_hip` (kg), `hx`, `hy`, `hz` (kg m), `Ixx` ... `Izz` (kg m^2), about the joint frame's origin."""

def inverse_dynamics(
    model: Model, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, limb: Optional[str] = None
) -> Array:
    """The rigid body's torque, N m, (..., n), at q (rad), dq (rad/s), ddq (rad/s^2) of shape (..., n)."""

def mass_matrix(model: Model, q: ArrayLike, limb: Optional[str] = None) -> Array:
    """The joint-space inertia matrix, kg m^2, (..., n, n), at q (rad) of shape (..., n)."""

def forward_dynamics(
    model: Model,
    q: ArrayLike,
    dq: ArrayLike,
    tau: ArrayLike,
    armature: Optional[Sequence[float]] = None,
    limb: Optional[str] = None,
) -> Array:
    """The rigid body's acceleration, rad/s^2, (..., n), at q (rad), dq (rad/s), tau (N m) of shape (..., n).

    `armature` adds n rotor inertias, kg m^2. Friction is no part of it: subtract it from `tau`.
    """

def regressor_seconds(
    model: Model, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, limb: Optional[str] = None
) -> float:
    """How long the library itself takes for `torque_regressor`, s: for the benchmark."""

def fleet_schema() -> bytes:
    """An empty table's Parquet: names and types of its columns."""

def fleet_partial(source: Union[bytes, str]) -> tuple[bytes, list[str]]:
    """The Parquet of the blocks that are let in, in one order, and why others are not. `source`: a file, or a table's Parquet."""

def fleet_final(source: Union[bytes, str]) -> tuple[str, list[str]]:
    """All answers as JSON, and why blocks are not among them."""

def run_command(words: Sequence[str]) -> int:
    """Runs the command `proprio` with these words, the first of which is the program: its exit status."""
