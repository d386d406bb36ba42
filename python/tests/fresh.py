"""What `pip install ./python` gives where nothing else is installed: `python/test` runs this in such an environment."""

import importlib.util
import json
import unittest

import proprio
from helpers import InFolder


class Fresh(InFolder):
    def test_nothing_else_is_here(self):
        for name in ("numpy", "pandas", "polars", "pyarrow"):
            self.assertIsNone(importlib.util.find_spec(name), name)

    def test_the_loop_needs_no_numpy(self):
        log = proprio.Log(self.folder / "hidden.csv")
        fitted = proprio.identify(log)
        fitted.model.save(self.folder / "fitted.toml")
        said = self.json("identify", "hidden.csv", "-o", "same.toml")
        self.assertEqual(json.loads(json.dumps(fitted.to_dict()))["rms"], said["rms"])
        comparison = proprio.compare(proprio.Log(self.folder / "other.csv"), fitted.model)
        self.assertEqual(comparison.rms, self.json("compare", "other.csv", "-m", "fitted.toml")["rms"])
        comparison.report(self.folder / "report.html")
        self.assertIn("FR_thigh", (self.folder / "report.html").read_text())

    def test_arrays_ask_for_it(self):
        model = proprio.Model.go2()
        with self.assertRaisesRegex(ImportError, "numpy"):
            proprio.torque_regressor(model, [[0.0] * 12], [[0.0] * 12], [[0.0] * 12])


if __name__ == "__main__":
    unittest.main()
