"""The notebooks, executed as they are committed, each in a folder of its own."""

import json
import os
import pathlib
import tempfile
import unittest

import nbformat
from helpers import COMMAND, PYTHON
from nbclient import NotebookClient

SHARED = pathlib.Path(os.environ.get("PROPRIO_SHARED", PYTHON.parent.parent / "shared"))


def code_lines(notebook) -> list[str]:
    cells = [cell.source for cell in notebook.cells if cell.cell_type == "code"]
    lines = [line.strip() for cell in cells for line in cell.splitlines()]
    return [line for line in lines if line and not line.startswith("#")]


class Notebooks(unittest.TestCase):
    def run_notebook(self, name: str):
        notebook = nbformat.read(PYTHON / "notebooks" / name, as_version=4)
        for cell in notebook.cells:
            self.assertFalse(cell.get("outputs"), "notebooks are committed without outputs")
        with tempfile.TemporaryDirectory() as folder:
            os.environ["PATH"] = f"{COMMAND.parent}{os.pathsep}{os.environ['PATH']}"
            os.environ["PROPRIO_SHARED"] = str(SHARED)
            client = NotebookClient(notebook, timeout=120, resources={"metadata": {"path": folder}})
            client.execute()
        outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
        return notebook, outputs

    def test_the_users_loop_is_twelve_lines_and_ends_in_a_report(self):
        notebook, outputs = self.run_notebook("hidden_effect.ipynb")
        self.assertLessEqual(len(code_lines(notebook)), 12)
        self.assertIn("<iframe srcdoc", outputs[-1]["data"]["text/html"])
        told = json.dumps([o.get("text", "") for o in outputs]) + json.dumps([o.get("data", {}).get("text/plain", "") for o in outputs])
        self.assertIn("stribeck:RR_thigh", told)

    def test_a_go2_log(self):
        if not (SHARED / "data").is_dir():
            print("no recorded logs: the notebook simulates one")
        _, outputs = self.run_notebook("go2_log.ipynb")
        values = outputs[-1]["data"]["text/plain"]
        self.assertIn("coulomb:FR_hip", values)

    def test_a_mujoco_model_is_calibrated(self):
        _, outputs = self.run_notebook("mujoco_rollouts.ipynb")
        text = "".join(output.get("text", "") for output in outputs)
        before, after = (float(line.split()[-2]) for line in text.splitlines() if line.endswith(" rad"))
        self.assertLess(after, 0.1 * before, text)
