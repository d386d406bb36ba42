"""A fleet's answers on Ray and on Spark, with a worker killed in the map and in the shuffle: to the bit those of `proprio-fleet report`.

Usage: engines.py ray|spark PROPRIO_FLEET, with an interpreter that has the wheel and the engine. It prints a row of tests/fleet/engines.md for each case.
"""

from __future__ import annotations

import json
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import threading
import time

import pyarrow

from proprio import fleet
from proprio._proprio import run_command

ROBOTS, LOGS = 5, 3


def uploads(folder: pathlib.Path) -> list[str]:
    """Blocks of simulated legs, as `tests/user.rs` makes them; one robot has a spring."""
    paths = []
    for robot in range(ROBOTS):
        for log in range(LOGS):
            csv, table = str(folder / "log.csv"), str(folder / f"{robot}-{log}.parquet")
            hidden = ["--hide", "spring:FR_thigh=4"] if robot == 3 else []
            seed = str(10 * robot + log + 1)
            simulate = ["simulate", "--legs", "FR", "--typical", "--duration", "24", "--seed", seed, *hidden, "-o", csv]
            begin = str(1_790_000_000 + 86_400 * log)
            factors = ["factors", csv, "--robot", f"robot-{robot}", "--block", "10", "--begin", begin, "-o", table]
            for words in (simulate, factors):
                assert run_command(["proprio", *words, "--json"]) == 0, words
            paths.append(table)
    return paths


def dies_once(work: fleet.Work, marker: pathlib.Path) -> fleet.Work:
    """`work`, whose first process kills itself before it is done."""

    def do(table: pyarrow.Table) -> pyarrow.Table:
        done = work(table)
        try:
            marker.mkdir()
        except FileExistsError:
            return done
        os.kill(os.getpid(), signal.SIGKILL)
        return done

    return do


def executors() -> list[int]:
    """Spark's executors that this process has started, by their ids."""
    listed = subprocess.run(["ps", "-eo", "pid,ppid,args"], capture_output=True, text=True, check=True).stdout
    rows = [line.split(None, 2) for line in listed.splitlines()[1:]]
    ours = {os.getpid()}
    for _ in range(8):
        ours |= {int(row[0]) for row in rows if int(row[1]) in ours}
    return [int(row[0]) for row in rows if int(row[0]) in ours and "CoarseGrainedExecutorBackend" in row[2]]


def waits_once(work: fleet.Work, marker: pathlib.Path) -> fleet.Work:
    """`work`, which says by a folder that it has begun and gives a killer two seconds, once."""

    def do(table: pyarrow.Table) -> pyarrow.Table:
        try:
            marker.mkdir()
            time.sleep(2.0)
        except FileExistsError:
            pass
        return work(table)

    return do


def kill_executor(marker: pathlib.Path, killed: list[int]) -> None:
    """`kill -9` of one executor once `marker` is there."""
    for _ in range(1200):
        if marker.exists():
            victim = executors()[0]
            os.kill(victim, signal.SIGKILL)
            killed.append(victim)
            return
        time.sleep(0.05)


def main() -> None:
    engine, program = sys.argv[1:]
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        paths = uploads(folder)
        subprocess.run([program, "add", name, "--to", str(folder / "fleet")], check=True)
        report = subprocess.run([program, "report", str(folder / "fleet"), "--json"], check=True, capture_output=True).stdout
        truth = json.loads(report)
        odd = truth["outliers"][0]
        assert (odd["robot"], odd["name"]) == ("robot-3", "spring:FR_thigh"), odd

        def check(case: str, answers: dict, happened: bool) -> None:
            assert happened, f"{case}: nothing was killed"
            assert answers == truth, case
            print(f"| {engine} | {case} | {truth['robots']} × {LOGS} | to the bit |", flush=True)

        check_plain = fleet.final(fleet.together(fleet.partial(path) for path in reversed(paths)))
        check("one process, files backwards", check_plain, True)
        twice = fleet.partial(fleet.together(fleet.partial(path) for path in paths))
        check("a part of parts", fleet.final(twice), True)
        marks = {case: folder / case for case in ("map", "shuffle", "map-executor", "shuffle-executor")}
        if engine == "ray":
            import ray

            ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False, object_store_memory=200_000_000)
            check("nothing killed", fleet.on_ray(paths), True)
            check("worker killed in the map", fleet.on_ray(paths, read=dies_once(fleet.read, marks["map"])), marks["map"].exists())
            answers = fleet.on_ray(paths, bring=dies_once(fleet.partial, marks["shuffle"]))
            check("worker killed in the shuffle", answers, marks["shuffle"].exists())
            here = {"PROPRIO_PYTHON": sys.executable, "RAY_ADDRESS": ray.get_runtime_context().gcs_address}
            words = [program, "report", str(folder / "fleet"), "--json", "--engine", "ray"]
            report = subprocess.run(words, check=True, stdout=subprocess.PIPE, env={**os.environ, **here}).stdout
            check("proprio-fleet report --engine ray", json.loads(report), True)
            return
        import pyspark
        from pyspark.sql import SparkSession

        os.environ.setdefault("SPARK_HOME", os.path.dirname(pyspark.__file__))
        os.environ["PYSPARK_PYTHON"] = sys.executable
        builder = SparkSession.builder.master("local-cluster[2,1,1024]").config("spark.ui.enabled", "false")
        spark = builder.config("spark.task.maxFailures", "8").getOrCreate()
        check("nothing killed", fleet.on_spark(paths, spark), True)
        check("worker killed in the map", fleet.on_spark(paths, spark, read=dies_once(fleet.read, marks["map"])), marks["map"].exists())
        answers = fleet.on_spark(paths, spark, bring=dies_once(fleet.partial, marks["shuffle"]))
        check("worker killed in the shuffle", answers, marks["shuffle"].exists())
        for case, where in (("map", "read"), ("shuffle", "bring")):
            mark = marks[f"{case}-executor"]
            killed: list[int] = []
            killer = threading.Thread(target=kill_executor, args=(mark, killed))
            killer.start()
            work = waits_once(fleet.read if where == "read" else fleet.partial, mark)
            answers = fleet.on_spark(paths, spark, **{where: work})
            killer.join()
            check(f"executor killed in the {case} (kill -9 of its JVM)", answers, bool(killed))
        spark.stop()


if __name__ == "__main__":
    main()
