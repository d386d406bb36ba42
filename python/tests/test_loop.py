"""The loop from Python: the command's numbers to the last digit, from files and from arrays."""

import json
import os
import pathlib
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pandas
import polars
import pyarrow
import proprio
from helpers import COMMAND, JOINTS, PYTHON, InFolder, command

CHANNELS = ["q", "dq", "tau"]


def without_names(value):
    """A result without what differs by the way a log was given: paths, file sizes in words."""
    if isinstance(value, dict):
        return {k: without_names(v) for k, v in value.items() if k not in ("log", "logs", "next", "warnings", "data")}
    if isinstance(value, list):
        return [without_names(v) for v in value]
    return value


class Loop(InFolder):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.log = proprio.Log(cls.folder / "hidden.csv")
        cls.other = proprio.Log(cls.folder / "other.csv")
        cls.diagnosis = proprio.diagnose(cls.log)
        cls.fitted = proprio.identify(cls.log, cls.diagnosis.model)
        cls.comparison = proprio.compare(cls.other, cls.fitted.model)

    def test_the_loop_finds_the_hidden_effect(self):
        self.assertIn("stribeck:FR_thigh", self.diagnosis.missing)
        self.assertLess(self.comparison.rms, 0.1 * self.comparison.cad_rms)
        self.assertLess(self.comparison.rms, 1.5 * self.comparison.noise_floor_rms)

    def test_the_numbers_are_the_commands_to_the_last_digit(self):
        hidden = str(self.folder / "hidden.csv")
        other = str(self.folder / "other.csv")
        self.assertEqual(self.diagnosis.to_dict(), self.json("diagnose", hidden))
        self.assertEqual(proprio.identify(self.log).to_dict(), self.json("identify", hidden))
        self.diagnosis.model.save(self.folder / "found.toml")
        own = self.fitted.to_dict()
        self.assertEqual(own, self.json("identify", hidden, "-m", "found.toml", "-o", "fitted.toml", "--force"))
        model = proprio.Model.load(self.folder / "fitted.toml")
        self.assertEqual(proprio.compare(self.other, model).to_dict(), self.json("compare", other, "-m", "fitted.toml", "--verbose"))
        # What Python writes the command reads as the same model.
        self.fitted.model.save(self.folder / "python.toml")
        theirs = self.json("compare", other, "-m", "python.toml", "--verbose")
        self.assertEqual(self.comparison.to_dict(), theirs)
        self.assertEqual(self.comparison.rms, theirs["rms"])

    def test_a_log_of_arrays_is_the_log_of_the_file(self):
        frame = pandas.read_csv(self.folder / "hidden.csv")
        arrays = {c: np.stack([frame[f"{c}/{j}"] for j in JOINTS], axis=1) for c in CHANNELS}
        logs = {
            "arrays": proprio.Log(t=frame["t"], **arrays, joints=JOINTS),
            "Fortran order": proprio.Log(t=frame["t"], **{c: np.asfortranarray(a) for c, a in arrays.items()}, joints=JOINTS),
            "pandas": proprio.Log(frame),
            "polars": proprio.Log(polars.from_pandas(frame)),
            "arrow": proprio.Log(pyarrow.Table.from_pandas(frame)),
            "dictionary": proprio.Log({name: list(frame[name]) for name in frame.columns}),
        }
        expected = without_names(self.fitted.to_dict())
        for kind, log in logs.items():
            with self.subTest(kind):
                fitted = proprio.identify(log, self.diagnosis.model)
                self.assertEqual(without_names(fitted.to_dict()), expected)
        # The file keeps which arrays its values are of: a comparison with them is a fit's own data.
        fitted.model.save(self.folder / "arrays.toml")
        self.assertIn("sha256", (self.folder / "arrays.toml").read_text())
        self.assertIn("import proprio", (self.folder / "arrays.toml").read_text())

    def test_prediction_is_at_the_logs_rate_and_blind_to_torque(self):
        series = proprio.predict(self.other, self.fitted.model)
        self.assertEqual([s.joint for s in series], JOINTS)
        for s in series:
            self.assertEqual(s.t.shape, s.predicted.shape)
            self.assertLess(abs(np.median(np.diff(s.t)) - 0.002), 1e-9)
            np.testing.assert_array_equal(s.residual, s.tau - s.predicted)
            self.assertEqual(s.units["residual"], "N m")
        frame = pandas.read_csv(self.folder / "other.csv")
        blind = frame.copy()
        for joint in JOINTS:
            blind[f"tau/{joint}"] = 0.0
        for s, b in zip(series, proprio.predict(proprio.Log(blind), self.fitted.model)):
            common = np.isin(s.t, b.t)
            self.assertGreater(common.mean(), 0.99)
            np.testing.assert_array_equal(s.predicted[common], b.predicted[np.isin(b.t, s.t)])

    def test_results_are_tables_with_units(self):
        frame = self.fitted.to_pandas()
        self.assertEqual(list(frame.columns), ["name", "unit", "value", "std", "identified"])
        friction = self.fitted.parameter("coulomb:FR_calf")
        self.assertEqual(friction.unit, "N m")
        self.assertEqual(frame.set_index("name").loc["coulomb:FR_calf", "value"], friction.value)
        self.assertTrue(frame.equals(self.fitted.to_polars().to_pandas()))
        frame = self.comparison.to_pandas()
        rms = np.sqrt(np.mean(frame["residual"] ** 2))
        self.assertLess(abs(rms - self.comparison.rms), 1e-9)
        self.assertEqual(self.comparison.to_polars().shape, frame.shape)
        self.assertEqual(list(self.diagnosis.to_pandas()["error"])[-1], self.diagnosis.after)

    def test_a_notebook_shows_the_report(self):
        for result in (self.comparison, self.fitted, self.diagnosis):
            html = result._repr_html_()
            self.assertTrue(html.startswith('<iframe srcdoc="'))
            self.assertNotIn('"', html[len('<iframe srcdoc="') : html.rindex('" style=')])
        page = self.comparison.page()
        self.comparison.report(self.folder / "report.html")
        self.assertEqual((self.folder / "report.html").read_text(), page)

    def test_errors_are_exceptions_with_the_commands_hint(self):
        with self.assertRaises(proprio.LogError) as caught:
            proprio.diagnose(proprio.Log("none.csv"))
        done = subprocess.run([COMMAND, "diagnose", "none.csv"], capture_output=True, text=True, check=False)
        message, hint = done.stderr.splitlines()
        self.assertEqual(done.returncode, 1)
        self.assertEqual(f"error: {caught.exception}".splitlines(), [message, hint])
        self.assertEqual(f"hint: {caught.exception.hint}", hint)
        with self.assertRaises(proprio.UnknownNameError) as caught:
            proprio.Model.go2().add("culomb:FR_hip")
        self.assertEqual(caught.exception.hint, "did you mean `coulomb`?")
        with self.assertRaises(proprio.ModelError):
            proprio.Model.load("none.toml")
        with self.assertRaises(proprio.WriteError):
            self.fitted.model.save("none/none.toml")
        with self.assertRaises(proprio.LogError) as caught:
            proprio.identify(proprio.Log(t=np.arange(9.0), q=np.zeros((9, 3)), dq=np.zeros((9, 3)), tau=np.zeros((9, 3))))
        self.assertIsNotNone(caught.exception.hint)
        with self.assertRaises(proprio.LogError):
            proprio.identify(proprio.Log({"t": np.arange(9.0), "q/FR_hip": np.zeros(8)}))
        for wrong in (lambda: proprio.Log(), lambda: proprio.Log({"t": ["a"]}), lambda: proprio.excite(cost="none")):
            self.assertRaises(ValueError, wrong)
        self.assertRaises(TypeError, lambda: proprio.Log(3))

    def test_motions_are_the_commands(self):
        motion = proprio.excite(limbs=["FR"], duration=4.0, starts=2)
        told = self.json("excite", "--legs", "FR", "--duration", "4", "--starts", "2", "-o", "motion.csv")
        self.assertEqual(motion.condition_number, told["condition_number"])
        self.assertEqual(motion.log_det, told["log_det"])
        motion.save(self.folder / "own.csv")
        self.assertEqual((self.folder / "own.csv").read_bytes(), (self.folder / "motion.csv").read_bytes())
        read = pandas.read_csv(self.folder / "motion.csv")
        self.assertEqual(list(motion.to_pandas().columns)[:4], ["t", *(f"q/{j}" for j in JOINTS)])
        np.testing.assert_allclose(motion.q, read[[f"q/{j}" for j in JOINTS]], atol=1e-6)
        np.testing.assert_allclose(motion.tau, read[[f"tau/{j}" for j in JOINTS]], atol=1e-6)

    def test_other_threads_run_meanwhile_and_ctrl_c_ends_it(self):
        ticks = []
        done = threading.Event()

        def tick():
            while not done.is_set():
                ticks.append(time.monotonic())
                time.sleep(0.005)

        thread = threading.Thread(target=tick)
        thread.start()
        proprio.diagnose(proprio.Log(self.folder / "other.csv"))
        done.set()
        thread.join()
        self.assertLess(max(np.diff(ticks)), 0.25)
        code = "import proprio; print('ready', flush=True); proprio.excite(starts=100000)"
        with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
            process.stdout.readline()
            time.sleep(0.5)
            begun = time.monotonic()
            process.send_signal(signal.SIGINT)
            _, errors = process.communicate(timeout=20)
        self.assertIn("KeyboardInterrupt", errors)
        self.assertLess(time.monotonic() - begun, 10)


class Wheel(InFolder):
    def test_numpy_is_imported_only_for_arrays(self):
        code = (
            "import sys, proprio\n"
            "sys.modules['numpy'] = None\n"
            f"log = proprio.Log({str(self.folder / 'hidden.csv')!r})\n"
            "fitted = proprio.identify(log)\n"
            "print(fitted.rms, proprio.compare(log, fitted.model).rms, len(fitted.to_dict()))\n"
        )
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)

    def test_the_command_is_the_rust_programs(self):
        program = PYTHON.parent / os.environ.get("CARGO_TARGET_DIR", "target") / "release/proprio"
        if not program.exists():
            self.skipTest("cargo has not built the command")
        for words in (["--help"], ["effects", "spring"], ["compare", "hidden.csv"], ["compare", "none.csv"], ["compare"]):
            both = [
                subprocess.run([path, *words], cwd=self.folder, capture_output=True, text=True, check=False)
                for path in (program, COMMAND)
            ]
            ours, theirs = [(p.returncode, p.stdout, p.stderr) for p in both]
            self.assertEqual(ours, theirs, words)
        # A model file says what made it, whichever it was.
        for name, path in (("a", program), ("b", COMMAND)):
            subprocess.run([path, "identify", "hidden.csv", "-o", "m.toml", "--force"], cwd=self.folder, check=True, stdout=subprocess.DEVNULL)
            os.rename(self.folder / "m.toml", self.folder / f"{name}.toml")
        self.assertEqual(*((self.folder / f"{n}.toml").read_bytes() for n in "ab"))

    def test_public_names_have_stubs_and_docstrings(self):
        stub = pathlib.Path(proprio.__file__).with_name("_proprio.pyi").read_text()
        for name in proprio.__all__:
            own = getattr(proprio, name)
            self.assertTrue(own.__doc__, name)
            self.assertTrue(f"class {name}" in stub or f"def {name}(" in stub, name)
            if isinstance(own, type) and not issubclass(own, Exception):
                members = [m for m in vars(own) if not m.startswith("_")]
                block = stub[stub.index(f"class {name}:") :].split("\n@final")[0]
                for member in members:
                    self.assertIn(f"def {member}(", block, f"{name}.{member}")
        self.assertTrue(pathlib.Path(proprio.__file__).with_name("py.typed").exists())
