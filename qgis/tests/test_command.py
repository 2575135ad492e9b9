"""Tests of the part of the plugin that needs no QGIS: `python3 -m unittest discover qgis/tests`.

SKYSWEEP_COMMAND must name the built command.
"""

import importlib.util
import json
import os
import sys
import tempfile
import unittest
from pathlib import Path

ROOT = Path(__file__).parents[2]
PLUGIN = ROOT / "qgis" / "skysweep"
TOWN = ROOT / "data-samples" / "town"

# The module alone: the package imports QGIS.
_spec = importlib.util.spec_from_file_location("skysweep_command", PLUGIN / "command.py")
command = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(command)

ALGORITHMS = {a["id"]: a for a in json.loads((PLUGIN / "algorithms.json").read_text("utf-8"))["algorithms"]}


def arguments(algorithm, output, **values):
    described = ALGORITHMS[algorithm]
    with_output = {**described, "parameters": [*described["parameters"], described["output"]]}
    return command.arguments_of(with_output, {**values, "OUTPUT": str(output)})


class Arguments(unittest.TestCase):
    def test_options_come_first_and_files_last(self):
        found = arguments("dsm", "out", IMAGES=["a.tif", "-b.tif"], GSD="0.5", OVERWRITE=True, PRODUCTS=["dtm", "mesh"])
        self.assertEqual(found[:4], ["dsm", "--progress", "json", "--json"])
        self.assertEqual(found[-3:], ["--", "a.tif", "-b.tif"])
        self.assertEqual(
            set(found[4:-3]), {"--gsd=0.5", "--overwrite", "--products=dtm,mesh", "--output=out"}
        )

    def test_lists_follow_their_option(self):
        found = arguments("ortho", "o.tif", IMAGES=["a.tif"], DSM="d.tif", BOUNDS=["-1.0", "2.0", "3.0", "4.0"])
        at = found.index("--bounds")
        self.assertEqual(found[at : at + 5], ["--bounds", "-1.0", "2.0", "3.0", "4.0"])


class Runs(unittest.TestCase):
    def setUp(self):
        self.command = command.find_command()
        self.folder = tempfile.TemporaryDirectory()
        self.output = Path(self.folder.name) / "out"

    def tearDown(self):
        self.folder.cleanup()

    def test_a_job_tells_its_stages_and_returns_its_report(self):
        events = []
        surface = str(TOWN / "truth" / "dsm.tif")
        finished = command.run(self.command, arguments("dtm", self.output, SURFACE=surface), events.append)
        self.assertFalse(finished.missed)
        self.assertGreater(finished.report["cells_ground"], 0)
        self.assertTrue((self.output / "dtm.tif").is_file())
        kinds = {event["event"] for event in events}
        self.assertLessEqual({"stage", "step", "done"}, kinds)
        stages = command.Stages()
        percents = [p for p in map(stages.percent, events) if p is not None]
        self.assertTrue(all(0.0 <= p <= 100.0 for p in percents) and max(percents) == 100.0)

    def test_a_failure_has_the_words_of_the_command(self):
        with self.assertRaises(command.CommandError) as raised:
            command.run(self.command, arguments("dtm", self.output, SURFACE="no such file.tif"))
        self.assertIn("no such file.tif", str(raised.exception))
        self.assertFalse(self.output.exists())

    def test_a_cancelled_job_leaves_no_result(self):
        images = [str(TOWN / f"view_{i}.tif") for i in (1, 2, 3)]
        seen = []
        with self.assertRaises(command.Cancelled):
            command.run(
                self.command,
                arguments("dsm", self.output, IMAGES=images),
                seen.append,
                is_cancelled=lambda: any(event["event"] == "step" for event in seen),
            )
        self.assertFalse((self.output / "dsm" / "dsm.tif").exists())

    def test_a_command_that_is_missing_is_named(self):
        with self.assertRaises(command.CommandError) as raised:
            command.find_command("/nowhere/skysweep")
        self.assertIn("/nowhere/skysweep", str(raised.exception))


if __name__ == "__main__":
    if not os.environ.get("SKYSWEEP_COMMAND"):
        sys.exit("set SKYSWEEP_COMMAND to the built command")
    unittest.main()
