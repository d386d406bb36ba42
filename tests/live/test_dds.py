"""`proprio record dds` and `proprio monitor dds` beside another DDS, which replays a real Go2's chirp at 500 Hz."""

import csv
import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

from cable import Cable
from rows import rows, single

PROPRIO = os.environ["PROPRIO"]
HERE = Path(__file__).parent
DATA = Path(os.environ.get("PROPRIO_DATA", HERE / "../../../shared/data"))
CHIRP = DATA / "go2_air_chirp_7.0hz_p25d5.0.csv"
WALK = HERE / "../oracle/walk/trot.csv.gz"
URI = "<CycloneDDS><Domain><General><Interfaces><NetworkInterface address='10.77.0.2'/></Interfaces></General></Domain></CycloneDDS>"
SOURCE = "dds:robot0"
# Motors of a G1 in the order of its messages.
LEG = ["hip_pitch", "hip_roll", "hip_yaw", "knee", "ankle_pitch", "ankle_roll"]
ARM = ["shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow", "wrist_roll", "wrist_pitch", "wrist_yaw"]
SIDES = ["left", "right"]
G1 = [
    *(f"{side}_{joint}" for side in SIDES for joint in LEG),
    *("waist_yaw", "waist_roll", "waist_pitch"),
    *(f"{side}_{joint}" for side in SIDES for joint in ARM),
]


def humanoid():
    """A robot whose joints have a G1's names, each on the trunk: only the names are of interest."""
    inertia = '<inertial><mass value="1"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>'
    links = "".join(f'<link name="{name}_link">{inertia}</link>' for name in G1)
    joint = (
        '<joint name="{0}_joint" type="revolute"><parent link="pelvis"/><child link="{0}_link"/><axis xyz="0 0 1"/>'
        '<limit lower="-9" upper="9" effort="9" velocity="9"/></joint>'
    )
    return f'<robot name="g1_29dof"><link name="pelvis"/>{links}{"".join(map(joint.format, G1))}</robot>'


def setUpModule():
    global cable
    if not CHIRP.exists():
        print(f"{CHIRP} is not here: live sources over DDS are not tested", file=sys.stderr)
        raise unittest.SkipTest("no data")
    cable = Cable()


def tearDownModule():
    cable.close()


class Live(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        cable.loss = 0.0
        cable.multicast = True
        cable.dropped = 0

    def leave(self, process):
        process.kill()
        process.wait()
        for pipe in (process.stdout, process.stderr):
            pipe.close()

    def robot(self, *options, log=CHIRP):
        """Starts a writer, and waits until it is there: Python may take longer to begin than a robot is waited for."""
        command = [*cable.inside, sys.executable, str(HERE / "writer.py"), str(log), *map(str, options)]
        environment = {**os.environ, "CYCLONEDDS_URI": URI}
        robot = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.addCleanup(self.leave, robot)
        while "waits" not in (line := robot.stderr.readline()):
            self.assertTrue(line)
        return robot

    def proprio(self, *words):
        process = subprocess.Popen(
            [PROPRIO, *map(str, words)], cwd=self.folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        self.addCleanup(self.leave, process)
        return process

    def ended(self, process, with_signal=signal.SIGINT):
        """Ends a recording as its user does; what it printed."""
        if with_signal is not None:
            process.send_signal(with_signal)
        out, err = process.communicate(timeout=60)
        self.assertEqual(process.returncode, 0, err)
        return out, err

    def sent(self, robot):
        out, err = robot.communicate(timeout=60)
        self.assertEqual(robot.returncode, 0, err)
        return json.loads(out)

    def log(self, name):
        with open(self.folder / name, newline="") as file:
            return list(csv.DictReader(file))

    def expect(self, recorded, expected):
        """The file holds these rows, each once and in their order, to the last digit."""
        self.assertEqual(len(recorded), len(expected))
        for cells, row in zip(recorded, expected):
            self.assertAlmostEqual(float(cells["t"]), (row.tick - expected[0].tick) / 1000, delta=1e-9)
            for channel, values in [("q", row.q), ("dq", row.dq), ("tau", row.tau)]:
                self.assertEqual([float(cells[f"{channel}/{name}"]) for name in row.names], values)

    def test_every_message_once(self):
        robot = self.robot("--readers", 3)
        to_csv = self.proprio("record", SOURCE, "-o", "log.csv", "--json")
        to_mcap = self.proprio("record", SOURCE + "/lowstate", "-o", "log.mcap")
        monitor = self.proprio("monitor", SOURCE, "--json")
        sent = self.sent(robot)
        # Nothing of ours writes, not even while three of ours read.
        self.assertEqual([name for name in sent["others_write"] if not name.startswith("DCPS")], [])
        report = json.loads(self.ended(to_csv)[0])
        words = self.ended(to_mcap, signal.SIGTERM)[0]
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        watched = json.loads(self.ended(monitor)[0])
        after = resource.getrusage(resource.RUSAGE_CHILDREN)

        expected = list(rows(CHIRP))
        self.assertEqual((report["recorded"], sent["sent"]), (len(expected), len(expected)))
        self.assertEqual((report["lost"], report["repeated"], report["writers"]), (0, 0, 1))
        self.expect(self.log("log.csv"), expected)
        self.assertIn(f"Recorded {len(expected)} messages of rt/lowstate (unitree_go/msg/LowState)", words)
        self.read_by_others(expected)

        # What is identified is what the rows themselves give.
        with open(self.folder / "rows.csv", "w") as file:
            names = expected[0].names
            print("t", *(f"{c}/{n}" for c in ("q", "dq", "tau") for n in names), sep=",", file=file)
            for row in expected:
                print((row.tick - expected[0].tick) / 1000, *row.q, *row.dq, *row.tau, sep=",", file=file)
        identified = [self.identified(name) for name in ("log.csv", "rows.csv", "log.mcap")]
        for other in identified[1:]:
            self.assertEqual(identified[0].keys(), other.keys())
            for name, value in identified[0].items():
                self.assertAlmostEqual(value, other[name], delta=1e-9 * max(1, abs(value)), msg=name)

        # The device has what the same one has of the recorded file's rows, to the last digit, however busy this machine is; a replay, which reads
        # ahead, puts late stamps right.
        with open(self.folder / "log.csv") as log:
            self.same_device(watched, self.device("monitor", "-", stdin=log), 0)
        self.same_device(watched, self.device("replay", "log.csv", "--to", "desktop"), 0.02)
        processor = (after.ru_utime + after.ru_stime) - (before.ru_utime + before.ru_stime)
        share = processor / (expected[-1].tick / 1000)
        print(f"monitor: {100 * share:.1f} % of a core at 500 Hz", file=sys.stderr)
        self.assertLess(share, 0.10)

    def test_a_robot_that_walks(self):
        robot = self.robot(log=WALK)
        monitor = self.proprio("monitor", SOURCE, "--free-base", "--json")
        sent = self.sent(robot)["sent"]
        walk = json.loads(self.ended(monitor)[0])["walk"]
        truth = json.loads(WALK.with_name("truth.json").read_text())["logs"]["trot"]["mass"]
        # The last estimate was begun 3 s after the first sample.
        self.assertGreater(walk["counts"]["samples"], 1400)
        self.assertLessEqual(walk["counts"]["samples"], sent)
        self.assertEqual((walk["counts"]["without_imu"], walk["counts"]["rejected"]), (0, 0))
        self.assertAlmostEqual(walk["mass"][0] / truth, 1, delta=0.03)

    def identified(self, name):
        done = subprocess.run([PROPRIO, "identify", name, "--json"], cwd=self.folder, capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr)
        return {p["name"]: p["value"] for p in json.loads(done.stdout)["parameters"]}

    def device(self, *words, stdin=None):
        done = subprocess.run([PROPRIO, *words, "--json"], cwd=self.folder, stdin=stdin, capture_output=True, text=True, check=True)
        return json.loads(done.stdout)

    def same_device(self, watched, other, share):
        """What the device has received, and what it makes of it, to this share of its standard deviations."""
        self.assertEqual(watched["counters"]["legs"], other["counters"]["legs"])
        seen, known = ({p["name"]: p for p in of["parameters"]} for of in (watched, other))
        self.assertEqual(seen.keys(), known.keys())
        for name, parameter in seen.items():
            self.assertLessEqual(abs(parameter["value"] - known[name]["value"]), share * parameter["std"], msg=name)

    def read_by_others(self, expected, kind="unitree_go/msg/LowState", motors=12):
        from mcap.reader import make_reader
        from rosbags.typesys import Stores, get_typestore
        from rosbags.typesys.msg import get_types_from_msg

        order = [motor % 12 for motor in range(motors)]
        store = get_typestore(Stores.ROS2_HUMBLE)
        with open(self.folder / "log.mcap", "rb") as file:
            for n, (schema, channel, message) in enumerate(make_reader(file).iter_messages()):
                if n == 0:
                    self.assertEqual((channel.topic, schema.name), ("/lowstate", kind))
                    parts = schema.data.decode().split("=" * 80 + "\nMSG: ")
                    store.register(get_types_from_msg(parts[0], schema.name))
                    for part in parts[1:]:
                        name, text = part.split("\n", 1)
                        store.register(get_types_from_msg(text, name.replace("/", "/msg/")))
                state = store.deserialize_cdr(message.data, schema.name)
                self.assertEqual(state.tick, expected[n].tick)
                self.assertEqual([float(m.q) for m in state.motor_state[:motors]], [expected[n].q[m] for m in order])
                self.assertEqual([float(m.tau_est) for m in state.motor_state[:motors]], [expected[n].tau[m] for m in order])
        self.assertEqual(n + 1, len(expected))

    def test_two_percent_of_the_datagrams_are_lost(self):
        cable.loss = 0.02
        robot = self.robot("--seconds", 6)
        recording = self.proprio("record", SOURCE, "-o", "log.csv", "--json")
        sent = self.sent(robot)["sent"]
        out, err = self.ended(recording)
        report = json.loads(out)
        self.assertGreater(cable.dropped, 20)
        self.assertEqual((report["recorded"], report["repeated"]), (sent - cable.dropped, 0))
        # Whether the first or the last were lost, nobody who receives can know.
        self.assertLessEqual(cable.dropped - report["lost"], 2)
        self.assertIn(f"messages that never came: the network or this machine was too slow: {report['lost']}", err)

    def test_what_is_lost_is_sent_again_where_it_is_asked_for(self):
        cable.loss = 0.02
        # It keeps all: how late a busy machine asks for what it lacks is not what is tested.
        robot = self.robot("--seconds", 6, "--depth", 3000)
        recording = self.proprio("record", SOURCE, "--qos", "reliable", "-o", "log.csv", "--json")
        sent = self.sent(robot)["sent"]
        out, _ = self.ended(recording)
        report = json.loads(out)
        self.assertGreater(cable.dropped, 20)
        self.assertEqual((report["recorded"], report["lost"], report["repeated"]), (sent, 0, 0))

    def test_a_writer_is_killed_and_started_again(self):
        first = self.robot("--seconds", 20)
        recording = self.proprio("record", SOURCE, "-o", "log.csv", "--json")
        while "begins" not in (line := first.stderr.readline()):
            self.assertTrue(line)
        time.sleep(3)
        # The writer itself, below nsenter.
        first.kill()
        first.wait()
        time.sleep(1.5)
        second = self.robot("--seconds", 3)
        sent = self.sent(second)["sent"]
        report = json.loads(self.ended(recording)[0])
        self.assertEqual((report["restarts"], report["writers"], report["repeated"]), (1, 2, 0))
        self.assertGreaterEqual(report["gaps"], 1)
        recorded = self.log("log.csv")
        expected = list(rows(CHIRP))
        before = len(recorded) - sent
        self.assertGreater(before, 1000)
        self.expect(recorded[:before], expected[:before])
        times = [float(cells["t"]) for cells in recorded]
        self.assertTrue(all(a <= b for a, b in zip(times, times[1:])))
        self.assertGreater(times[before] - times[before - 1], 1.4)
        after = [{**cells, "t": float(cells["t"]) - times[before]} for cells in recorded[before:]]
        self.expect(after, expected[:sent])

    def test_two_writers(self):
        first = self.robot("--seconds", 8)
        recording = self.proprio("record", SOURCE, "-o", "log.csv", "--json")
        while "begins" not in (line := first.stderr.readline()):
            self.assertTrue(line)
        second = self.robot("--seconds", 2)
        sent = (self.sent(first)["sent"], self.sent(second)["sent"])
        out, err = self.ended(recording)
        report = json.loads(out)
        self.assertEqual((report["recorded"], report["other_writers"], report["writers"]), (*sent, 2))
        self.assertIn("of another writer", err)
        self.expect(self.log("log.csv"), list(rows(CHIRP))[: sent[0]])

    def test_a_writer_of_another_type(self):
        first = self.robot("--seconds", 6)
        recording = self.proprio("record", SOURCE, "-o", "log.csv", "--json")
        while "begins" not in (line := first.stderr.readline()):
            self.assertTrue(line)
        other = self.robot("--kind", "other", "--seconds", 1, "--readers", 0)
        sent, others = self.sent(first)["sent"], self.sent(other)["sent"]
        out, err = self.ended(recording)
        report = json.loads(out)
        self.assertEqual((report["recorded"], report["other_writers"]), (sent, 0))
        # CycloneDDS sends a reader of another type nothing: the writer itself is what is counted.
        self.assertEqual((report["other_type_writers"], report["wrong_type"], others), (1, 0, 500))
        self.assertIn("writers that give the topic another type: 1", err)

    def test_nobody_writes(self):
        other = self.robot("--kind", "other", "--seconds", 15, "--readers", 0)
        recording = self.proprio("record", SOURCE, "-o", "log.csv", "--json")
        out, err = recording.communicate(timeout=60)
        self.assertEqual(recording.returncode, 1)
        self.assertIn("nobody sends joint states within 10 s", err)
        self.assertIn("rt/lowstate (other_robot::msg::dds_::LowState_)", err)
        self.assertEqual(json.loads(out)["verdict"], "refused")
        self.assertFalse((self.folder / "log.csv").exists())
        other.kill()

    def test_a_network_without_multicast(self):
        cable.multicast = False
        robot = self.robot("--seconds", 3, "--domain", 3)
        options = ["record", SOURCE, "--domain", 3, "--json"]
        alone = self.proprio(*options, "-o", "alone.csv")
        self.assertIn("nobody sends joint states within 10 s", alone.communicate(timeout=60)[1])
        recording = self.proprio(*options, "--peer", "10.77.0.9", "--peer", "10.77.0.2", "-o", "log.csv")
        sent = self.sent(robot)["sent"]
        report = json.loads(self.ended(recording)[0])
        self.assertEqual((report["recorded"], report["lost"], report["repeated"]), (sent, 0, 0))
        self.expect(self.log("log.csv"), list(rows(CHIRP))[:sent])

    def test_joint_states_in_another_domain(self):
        robot = self.robot("--kind", "joint_state", "--seconds", 3, "--domain", 5)
        recording = self.proprio("record", SOURCE + "/joint_states", "--domain", 5, "-o", "log.csv", "--seconds", 2, "--json")
        report = json.loads(self.ended(recording, None)[0])
        expected = [row for row in rows(CHIRP)]
        expected = [row for row in expected if row.tick - expected[0].tick <= 2000]
        self.assertEqual(report["recorded"], len(expected))
        self.expect(self.log("log.csv"), expected)
        self.sent(robot)

    def test_a_humanoid(self):
        """`unitree_hg` LowState: 29 motors of 35, which the G1's joints are named by."""
        (self.folder / "g1.urdf").write_text(humanoid())
        robot = self.robot("--kind", "hg_low_state", "--seconds", 3, "--readers", 2)
        to_csv = self.proprio("record", SOURCE, "--urdf", "g1.urdf", "-o", "log.csv", "--json")
        to_mcap = self.proprio("record", SOURCE, "-o", "log.mcap", "--json")
        sent = self.sent(robot)["sent"]
        report, messages = (json.loads(self.ended(process)[0]) for process in (to_csv, to_mcap))
        expected = list(rows(CHIRP))[:sent]
        for each in (report, messages):
            self.assertEqual((each["recorded"], each["lost"], each["kind"]), (sent, 0, "unitree_hg/msg/LowState"))
        recorded = self.log("log.csv")
        self.assertEqual(len(recorded), sent)
        for cells, row in zip(recorded, expected):
            self.assertAlmostEqual(float(cells["t"]), (row.tick - expected[0].tick) / 1000, delta=1e-9)
            for channel, values in [("q", row.q), ("dq", row.dq), ("tau", row.tau)]:
                given = [float(cells[f"{channel}/{name}_joint"]) for name in G1]
                self.assertEqual(given, [values[n % 12] for n in range(29)])
            self.assertEqual([float(cells[f"acc/{axis}"]) for axis in "xyz"], [single(value) for value in row.acc])
        self.read_by_others(expected, "unitree_hg/msg/LowState", 29)

    def test_interfaces(self):
        for source, words in [("dds:nowhere", "no network interface is called nowhere; there are"), ("dds:nowhere", "robot0 (10.77.0.1)")]:
            refused = self.proprio("record", source, "-o", "log.csv")
            out, err = refused.communicate(timeout=20)
            self.assertEqual((refused.returncode, out), (1, ""))
            self.assertIn(words, err)


if __name__ == "__main__":
    unittest.main()
