"""`compare -o residuals.mcap`, read back by the readers of others, and `compare` with several models."""

import json
import pathlib
import subprocess

import numpy as np
import proprio
from helpers import COMMAND, JOINTS, PYTHON, InFolder, command
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

TOPICS = {"/measured": "tau", "/predicted": "predicted", "/residual": "residual"}
JOINT_STATE, LOG = "sensor_msgs/msg/JointState", "rcl_interfaces/msg/Log"


class Viewers(InFolder):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        command(cls.folder, "diagnose", "hidden.csv", "--apply", "-m", "full.toml")
        command(cls.folder, "identify", "hidden.csv", "-o", "plain.toml")
        cls.model = proprio.Model.load(cls.folder / "full.toml")
        cls.series = proprio.predict(proprio.Log(cls.folder / "other.csv"), cls.model)

    def messages(self, file: pathlib.Path) -> dict:
        """Each topic's times (ns) and messages, as rosbags reads them by the definitions that the file holds."""
        with AnyReader([file], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
            kinds = {c.topic: c.msgtype for c in reader.connections}
            self.assertEqual(kinds, {**dict.fromkeys([*TOPICS, "/noise_floor"], JOINT_STATE), "/events": LOG})
            found: dict = {}
            for connection, time, raw in reader.messages():
                found.setdefault(connection.topic, []).append((time, reader.deserialize(raw, connection.msgtype)))
        return found

    def test_residuals_are_the_predictions_at_the_logs_rate(self):
        command(self.folder, "compare", "other.csv", "-m", "full.toml", "-o", "residuals.mcap")
        found = self.messages(self.folder / "residuals.mcap")
        times = sorted(set(np.concatenate([s.t for s in self.series])))
        for topic, column in TOPICS.items():
            stamps, messages = zip(*found[topic])
            np.testing.assert_allclose(np.array(stamps) * 1e-9, times, atol=1e-6)
            self.assertLess(abs(np.median(np.diff(stamps)) - 2e6), 1)
            for j, series in enumerate(self.series):
                self.assertEqual(messages[0].name[j], series.joint)
                here = np.isin(times, series.t)
                for values, own in (("effort", column), ("position", "q"), ("velocity", "dq")):
                    got = np.array([getattr(m, values)[j] for m in messages])
                    np.testing.assert_array_equal(got[here], getattr(series, own))
                    self.assertTrue(np.isnan(got[~here]).all())
            self.assertEqual(messages[9].header.stamp.nanosec + 10**9 * messages[9].header.stamp.sec, stamps[9])
        # The simulated noise is white and the model nearly complete: while a joint moves, what is left is the floor. Where it turns, a sample's
        # friction has the sign of a velocity that is noise: 0.3 rad/s is twenty times its deviation.
        floor = found["/noise_floor"][0][1].effort
        for series, floor in zip(self.series, floor):
            moves = np.abs(series.dq) > 0.3
            self.assertGreater(np.mean(moves), 0.5)
            left = np.sqrt(np.mean(series.residual[moves] ** 2))
            self.assertGreater(left, 0.85 * floor)
            self.assertLess(left, 1.15 * floor)
        worst = [m for _, m in found["/events"] if m.name in JOINTS]
        self.assertTrue(worst)
        self.assertIn("residual", worst[0].msg)

    def test_the_mcap_library_reads_it_and_indexes_are_there(self):
        comparison = proprio.compare(proprio.Log(self.folder / "other.csv"), self.model)
        comparison.save(self.folder / "python.mcap")
        command(self.folder, "compare", "other.csv", "-m", "full.toml", "-o", "own.mcap")
        self.assertEqual((self.folder / "python.mcap").read_bytes(), (self.folder / "own.mcap").read_bytes())
        with (self.folder / "own.mcap").open("rb") as file:
            reader = make_reader(file)
            summary = reader.get_summary()
            self.assertEqual(reader.get_header().profile, "ros2")
            self.assertTrue(summary.chunk_indexes)
            for channel in summary.channels.values():
                schema = summary.schemas[channel.schema_id]
                self.assertEqual((channel.message_encoding, schema.encoding), ("cdr", "ros2msg"))
            later = next(reader.iter_messages(topics=["/residual"], start_time=5 * 10**9))
            self.assertGreaterEqual(later[2].log_time, 5 * 10**9)
        # It is a log of joints' states too: the measured torque is the log's own.
        comparison.save(self.folder / "table.csv")
        command(self.folder, "compare", "other.csv", "-m", "full.toml", "-o", "command.csv")
        self.assertEqual((self.folder / "table.csv").read_bytes(), (self.folder / "command.csv").read_bytes())

    def test_values_that_were_fitted_are_said_to_be(self):
        command(self.folder, "add", "viscous", "coulomb", "-m", "bare.toml")
        command(self.folder, "compare", "other.csv", "-m", "bare.toml", "-o", "fitted.mcap")
        events = [m.msg for _, m in self.messages(self.folder / "fitted.mcap")["/events"]]
        self.assertTrue(any("not held out" in text for text in events), events)

    def test_layouts_name_topics_of_the_file(self):
        examples = PYTHON.parent / "examples"
        foxglove = json.loads((examples / "residuals.foxglove.json").read_text())
        paths = [p["value"] for panel in foxglove["configById"].values() for p in panel.get("paths", [])]
        self.assertGreaterEqual(len(paths), 24)
        plotjuggler = (examples / "residuals.plotjuggler.xml").read_text()
        for topic in TOPICS:
            self.assertTrue(any(path.startswith(f"{topic}.effort") for path in paths), topic)
            self.assertIn(f"{topic}/FR_hip/effort", plotjuggler)

    def test_several_models_are_compared_on_the_same_windows(self):
        proprio.Model.go2().save(self.folder / "cad.toml")
        self.model.save(self.folder / "twin.toml")
        models = ["full.toml", "plain.toml", "cad.toml", "twin.toml"]
        words = [word for model in models for word in ("-m", model)]
        found = self.json("compare", "other.csv", *words)
        alone = [self.json("compare", "other.csv", "-m", model) for model in models]
        self.assertEqual([m["model"] for m in found["models"]], models)
        for own, single in zip(found["models"], alone):
            self.assertLess(abs(own["rms"] - single["rms"]), 1e-12)
            for joint, one in zip(own["joints"], single["joints"]):
                self.assertEqual(joint["joint"], one["joint"])
                self.assertLess(abs(joint["rms"] - one["rms"]), 1e-12)
                self.assertLess(abs(joint["fit_percent"] - one["fit_percent"]), 1e-9)
        full, plain, cad, twin = found["models"]
        self.assertIn(found["best"], (0, 3))
        self.assertTrue(cad["significant"])
        self.assertGreater(plain["beyond_best"], 0.0)
        self.assertFalse(full["significant"] or twin["significant"])
        self.assertGreater(cad["beyond_best"], 10 * cad["beyond_best_std"])
        self.assertEqual(found["error"]["after"], full["rms"])
        text = command(self.folder, "compare", "other.csv", *words, "--html", "models.html")
        self.assertIn("the same predictions as full.toml", text)
        self.assertTrue(all(len(line) <= 80 for line in text.splitlines()[:-1]), text)
        page = (self.folder / "models.html").read_text()
        self.assertTrue(all(model in page for model in models))
        refused = subprocess.run(
            [COMMAND, "compare", "other.csv", *words, "--with", "spring"], cwd=self.folder, capture_output=True, text=True, check=False
        )
        self.assertEqual(refused.returncode, 2)
