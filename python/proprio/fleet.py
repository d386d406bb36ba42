"""Blocks of many robots on an engine that exists: two functions of Arrow tables, which Ray, Spark or plain Python spread over machines.

`partial` makes of a file, or of rows, those that count; `final` makes the answers of all of them. Between them rows go as an engine sends them, in any
parts and order, more than once: the answers are the same to the bit. They are what `proprio-fleet report --json` prints.

    from proprio import fleet

    answers = fleet.final(fleet.together(fleet.partial(path) for path in paths))
    answers = fleet.on_ray(paths)
    answers = fleet.on_spark(paths, spark)

PyArrow is asked for here alone.
"""

from __future__ import annotations

import importlib
import io
import json
import os
import tempfile
import warnings
import zlib
from collections.abc import Callable, Iterable, Iterator
from typing import Any, Union

import pyarrow  # type: ignore[import-untyped]
import pyarrow.compute  # type: ignore[import-untyped]
import pyarrow.parquet  # type: ignore[import-untyped]

from ._proprio import Error, fleet_final, fleet_partial, fleet_schema, run_command

__all__ = ["factors", "final", "on_ray", "on_spark", "partial", "read", "schema", "together"]

# What the columns of a factor are, before their hash in a file's metadata. Engines lose metadata: there it is a column.
_PREFIX = "proprio.columns."
_ABOUT = "about"
# Most rows of a row group that are read.
_GROUP = 4096

Source = Union[str, "os.PathLike[str]", pyarrow.Table]
Work = Callable[[pyarrow.Table], pyarrow.Table]


def schema() -> pyarrow.Schema:
    """Columns of a part: those of `proprio.blocks/1`, and `about`, the JSON of the factors' columns, in one row of each robot and hash."""
    return _empty().append(pyarrow.field(_ABOUT, pyarrow.string())).remove_metadata()


def partial(source: Source) -> pyarrow.Table:
    """The rows that count, in one order, each joint's block once.

    Args:
        source: a file of `proprio factors`, or rows: a table of such a file, or of several parts together.

    What does not count is warned of, with the reason and what to do.
    """
    data, refused = fleet_partial(_given(source))
    _warn(refused)
    table = pyarrow.parquet.read_table(io.BytesIO(data))
    known = {
        key.decode()[len(_PREFIX) :]: text.decode()
        for key, text in table.schema.metadata.items()
        if key.decode().startswith(_PREFIX)
    }
    # Once for each robot, whose rows a shuffle brings together without the others'.
    seen: set[tuple[str, str]] = set()
    about = []
    for key in zip(table["robot"].to_pylist(), table["columns"].to_pylist()):
        about.append(None if key in seen else known[key[1]])
        seen.add(key)
    return table.append_column(_ABOUT, pyarrow.array(about, pyarrow.string())).replace_schema_metadata(None).cast(schema())


def final(table: Source) -> dict[str, Any]:
    """All answers of what `partial` made, or of files' rows: the object that `proprio-fleet report --json` prints."""
    text, refused = fleet_final(_given(table))
    _warn(refused)
    answers: dict[str, Any] = json.loads(text)
    return answers


def together(parts: Iterable[pyarrow.Table]) -> pyarrow.Table:
    """Parts as one table."""
    return pyarrow.concat_tables([schema().empty_table(), *parts])


def factors(log: str, robot: str, *words: str) -> pyarrow.Table:
    """The part that a log gives: `proprio factors LOG --robot ROBOT WORDS`, in any process.

    Raises:
        Error: the log gives no blocks; standard error says why.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "blocks.parquet")
        if run_command(["proprio", "factors", log, "--robot", robot, *words, "-o", path]) != 0:
            raise Error(f"{log}: no blocks")
        return partial(path)


def read(paths: pyarrow.Table) -> pyarrow.Table:
    """What a task does with a table whose column `path` names files: their parts."""
    return together(partial(path) for path in paths["path"].to_pylist())


def on_ray(paths: Iterable[str], read: Work = read, bring: Work = partial) -> dict[str, Any]:
    """The answers of files, on the Ray that `ray.init` has found: where it was not called, that of RAY_ADDRESS or one of this process.

    Args:
        read: what a task does with a file: for logs, `lambda table: together(factors(path, robot_of(path)) for path in table["path"].to_pylist())`.
        bring: what a task does with the rows of some robots, all of theirs, after the shuffle.
    """
    # Untyped: what mypy says of this file does not depend on whether Ray is installed.
    ray: Any = importlib.import_module("ray")

    if not ray.is_initialized():
        ray.init()
    many = max(2, int(ray.cluster_resources().get("CPU", 2)))

    @ray.remote(num_returns=many)  # type: ignore[untyped-decorator]
    def split(path: str) -> list[pyarrow.Table]:
        part = read(pyarrow.table({"path": [path]}))
        # The same in every process, which Python's own hash is not.
        place = pyarrow.array([zlib.crc32(robot.encode()) % many for robot in part["robot"].to_pylist()], pyarrow.int64())
        return [part.filter(pyarrow.compute.equal(place, n)) for n in range(many)]

    @ray.remote  # type: ignore[untyped-decorator]
    def gather(*parts: pyarrow.Table) -> pyarrow.Table:
        return bring(together(parts))

    made = [split.remote(os.fspath(path)) for path in paths]
    return final(together(ray.get([gather.remote(*(own[n] for own in made)) for n in range(many)])))


def on_spark(paths: Iterable[str], spark: Any, read: Work = read, bring: Work = partial) -> dict[str, Any]:
    """The same on a Spark session."""

    def each(batches: Iterator[pyarrow.RecordBatch]) -> Iterator[pyarrow.RecordBatch]:
        for batch in batches:
            yield from read(pyarrow.Table.from_batches([batch])).to_batches()

    named = [(os.fspath(path),) for path in paths]
    files = spark.createDataFrame(named, "path string").repartition(max(1, len(named)))
    columns = _spark_schema()
    robots = files.mapInArrow(each, columns).groupBy("robot").applyInArrow(bring, columns)
    return final(robots.toArrow())


def _spark_schema() -> Any:
    from pyspark.sql.pandas.types import from_arrow_schema  # type: ignore[import-not-found, unused-ignore]

    return from_arrow_schema(schema())


def _empty() -> pyarrow.Schema:
    return pyarrow.parquet.read_schema(io.BytesIO(fleet_schema()))


def _given(source: Source) -> Union[bytes, str]:
    """A path as it is; of rows the Parquet, with the metadata that an engine has lost."""
    if not isinstance(source, pyarrow.Table):
        return os.fspath(source)
    table = source
    if _ABOUT in table.column_names:
        told = table.filter(pyarrow.compute.is_valid(table[_ABOUT]))
        known = dict(zip(told["columns"].to_pylist(), told[_ABOUT].to_pylist()))
        named = {f"{_PREFIX}{name}": text for name, text in known.items()}
        table = table.drop_columns([_ABOUT]).replace_schema_metadata({**(_empty().metadata or {}), **named})
    target = io.BytesIO()
    pyarrow.parquet.write_table(_as_declared(table), target, compression="none", row_group_size=_GROUP)
    return target.getvalue()


def _as_declared(table: pyarrow.Table) -> pyarrow.Table:
    """With the fields of the schema where only an engine's way of storing differs (long text, what may be null): another type or name is left to be named."""
    for field in _empty():
        at = table.schema.get_field_index(field.name)
        if at >= 0 and _same(table.schema.field(at).type, field.type) and not (table[at].null_count and not field.nullable):
            table = table.set_column(at, field, table[at].cast(field.type))
    return table


def _same(a: pyarrow.DataType, b: pyarrow.DataType) -> bool:
    kinds = pyarrow.types
    if kinds.is_list(b):
        return bool((kinds.is_list(a) or kinds.is_large_list(a)) and a.value_type == b.value_type)
    return bool(a == b or (kinds.is_large_string(a) and kinds.is_string(b)))


def _warn(refused: list[str]) -> None:
    for words in refused:
        warnings.warn(words, stacklevel=3)
