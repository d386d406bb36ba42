"""Logs and the command, for the tests."""

import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

PYTHON = pathlib.Path(__file__).resolve().parent.parent
COMMAND = pathlib.Path(sys.executable).parent / "proprio"
JOINTS = ["FR_hip", "FR_thigh", "FR_calf"]


def command(folder: pathlib.Path, *words: str) -> str:
    """What the installed command prints; it must succeed."""
    done = subprocess.run([COMMAND, *words], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, (words, done.stderr)
    return done.stdout


class InFolder(unittest.TestCase):
    """Tests in a folder with a leg's log `hidden.csv`, whose thigh has a hidden effect, and another log of the same leg."""

    @classmethod
    def setUpClass(cls) -> None:
        cls._temporary = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls._temporary.cleanup)
        cls.folder = pathlib.Path(cls._temporary.name)
        of_leg = ["simulate", "--legs", "FR", "--typical", "--hide", "stribeck:FR_thigh=0.6", "--duration", "10"]
        command(cls.folder, *of_leg, "-o", "hidden.csv")
        command(cls.folder, *of_leg, "--seed", "2", "-o", "other.csv")

    def json(self, *words: str) -> dict:
        return json.loads(command(self.folder, *words, "--json"))
