"""The programs of docs/python.md run as they stand there."""

import os
import re

from helpers import PYTHON, InFolder, command


class Page(InFolder):
    def test_the_programs_of_the_page_run(self):
        text = (PYTHON.parent / "docs/python.md").read_text()
        programs = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
        self.assertEqual(len(programs), 3)
        (self.folder / "hidden.csv").rename(self.folder / "chirp.csv")
        before = os.getcwd()
        self.addCleanup(os.chdir, before)
        os.chdir(self.folder)
        names: dict[str, object] = {}
        for program in programs:
            exec(compile(program, "docs/python.md", "exec"), names)
        self.assertGreater((self.folder / "report.html").stat().st_size, 100_000)
        self.assertIn("coulomb", command(self.folder, "show", "fitted.toml"))
        self.assertEqual(names["W"].shape[1:], (3, 30))
