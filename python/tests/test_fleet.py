"""Blocks of many robots as Arrow tables: any parts in any order give one answer, and what is faulty is warned of and changes nothing."""

import pathlib
import tempfile
import unittest
import warnings

import pyarrow
import pyarrow.parquet

import proprio
from helpers import command
from proprio import fleet

ROBOTS, LOGS = 3, 2


class Fleet(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        temporary = tempfile.TemporaryDirectory()
        cls.addClassCleanup(temporary.cleanup)
        cls.folder = pathlib.Path(temporary.name)
        cls.paths = []
        for robot in range(ROBOTS):
            for log in range(LOGS):
                name = f"{robot}-{log}"
                of_leg = ["simulate", "--legs", "FR", "--typical", "--duration", "22", "--seed", str(10 * robot + log)]
                command(cls.folder, *of_leg, "-o", f"{name}.csv")
                begin = str(1_790_000_000 + 86_400 * log)
                words = ["--robot", f"robot-{robot}", "--block", "10", "--begin", begin, "-o", f"{name}.parquet"]
                command(cls.folder, "factors", f"{name}.csv", *words)
                cls.paths.append(cls.folder / f"{name}.parquet")
        cls.parts = [fleet.partial(path) for path in cls.paths]
        cls.truth = fleet.final(fleet.together(cls.parts))

    def refused(self, kind: str, *tables) -> pyarrow.Table:
        """What is let in of tables of which one is refused for a reason of this kind."""
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            part = fleet.together(fleet.partial(table) for table in tables)
            answers = fleet.final(part)
        self.assertTrue(caught)
        self.assertTrue(all(str(own.message).startswith(f"{kind}: ") for own in caught), caught[0].message)
        self.assertEqual(answers, self.truth, kind)
        return part

    def test_answers_are_of_all_robots(self):
        self.assertEqual((self.truth["schema"], self.truth["robots"]), ("proprio-fleet.report/1", ROBOTS))
        names = {(own["robot"], own["name"]) for own in self.truth["values"]}
        self.assertIn(("robot-2", "coulomb:FR_calf"), names)

    def test_parts_order_and_an_engines_types_change_nothing(self):
        together = fleet.together(reversed(self.parts))
        self.assertEqual(fleet.final(together), self.truth)
        rows = [together.slice(at, 1) for at in range(len(together))]
        scattered = fleet.together(rows[::2] + rows[1::2])
        self.assertEqual(fleet.final(scattered), self.truth)
        # The schema of a part is that of every part, and a part of parts is a part.
        again = fleet.partial(scattered)
        self.assertEqual(again.schema, fleet.schema())
        self.assertEqual(fleet.final(again), self.truth)
        # What Spark and pandas make of it: long texts, numbers that may be null.
        loose = [
            pyarrow.field(own.name, {pyarrow.string(): pyarrow.large_string()}.get(own.type, own.type)) for own in again.schema
        ]
        loose[again.schema.get_field_index("factor")] = pyarrow.field("factor", pyarrow.large_list(pyarrow.float32()))
        self.assertEqual(fleet.final(again.cast(pyarrow.schema(loose))), self.truth)
        # A file's own rows, as PyArrow reads them.
        read = [fleet.partial(pyarrow.parquet.read_table(path)) for path in self.paths]
        self.assertEqual(fleet.final(fleet.together(read)), self.truth)

    def test_each_fault_is_named_and_the_others_answers_stay(self):
        whole = pyarrow.parquet.read_table(self.paths[-1])
        factor = whole.schema.get_field_index("factor")
        wide = whole.set_column(factor, "factor", whole["factor"].cast(pyarrow.list_(pyarrow.float64())))
        self.refused("schema", *self.paths, wide)
        renamed = whole.rename_columns(["machine", *whole.column_names[1:]]).replace_schema_metadata(whole.schema.metadata)
        self.refused("schema", *self.paths, renamed)
        self.refused("not_blocks", *self.paths, whole.replace_schema_metadata(None))
        self.refused("duplicate", fleet.together([*self.parts, self.parts[0]]))
        other = whole.set_column(0, whole.schema.field(0), pyarrow.array(["robot-0"] * len(whole)))
        self.refused("checksum", *self.paths, other)
        numbers = whole["factor"].to_pylist()
        numbers[0][3] = float("nan")
        damaged = whole.set_column(factor, whole.schema.field(factor), pyarrow.array(numbers, whole.schema.field(factor).type))
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            left = fleet.partial(damaged)
        self.assertEqual((len(left), len(caught)), (len(whole) - 1, 1))
        cut = self.folder / "cut.part"
        cut.write_bytes(self.paths[0].read_bytes()[:2000])
        self.refused("damaged", *self.paths, cut)
        unnamed = fleet.partial(self.paths[0])
        self.refused("columns", *self.parts, unnamed.set_column(unnamed.num_columns - 1, "about", pyarrow.nulls(len(unnamed), pyarrow.string())))

    def test_a_map_makes_blocks_of_logs(self):
        begin = ["--block", "10", "--begin", "1790000000"]
        made = fleet.factors(str(self.folder / "1-0.csv"), "robot-1", *begin)
        drop = ["received", "crc32c"]
        self.assertEqual(made.drop_columns(drop), fleet.partial(self.paths[LOGS]).drop_columns(drop))
        with self.assertRaises(proprio.Error):
            fleet.factors(str(self.folder / "none.csv"), "robot-1")


if __name__ == "__main__":
    unittest.main()
