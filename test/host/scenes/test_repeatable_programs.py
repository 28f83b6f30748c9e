"""A program draws the same course for a sample whenever it is read; what is random in another way is refused or named."""

import json
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from swept_listing import WriteListing, straight_listing

HEAD = "model model\nego = new Robot at (0, 0), facing -90 deg\ngoal = new Goal at (0.6, 0), facing -90 deg\n"
Run = Callable[..., "subprocess.CompletedProcess[str]"]


@pytest.fixture
def program(tmp_path: Path) -> Path:
    return tmp_path / "program.scenic"


@pytest.fixture
def listing(write_listing: WriteListing, listing_data: Any, program: Path) -> Path:
    """A width, three samples of ``program``."""
    return straight_listing(write_listing, listing_data, program)


@pytest.mark.parametrize(
    "value",
    ["time.time() % 1", "random.Random().random()", "numpy.random.default_rng().random()", "uuid.uuid4().int % 97 / 97"],
)
def test_a_program_that_draws_another_course_each_time_is_refused_at_once(
    value: str, listing: Path, program: Path, foldcar: Run, tmp_path: Path
) -> None:
    imports = "import time, random, numpy, uuid\n"
    program.write_text(f"{HEAD}{imports}height = 0.01 + 0.01 * {value}\nnew Kerb at (0.5, 0), with height height\n")
    for words in (["sweep", listing, "--store", "s.db"], ["sample", program]):
        refused = foldcar(*words)
        assert refused.returncode == 2
        assert "sample 0 is another scene now than when it was first drawn" in refused.stderr
    assert not (tmp_path / "s.db").exists()


def test_classes_with_random_pieces_draw_the_same_pieces_for_a_sample(program: Path, foldcar: Run) -> None:
    stones = """import random, numpy
class Stones(Terrain):
    def pieces(self):
        y_m = numpy.random.uniform(-0.1, 0.1)
        size = {"length_m": 0.05, "width_m": 0.05, "height_m": random.uniform(0.003, 0.06)}
        return [{"kind": "box", "x_m": 0.0, "y_m": y_m, **size}]
new Stones at (0.6, 0), with length 0.4, with width 0.6, with height 0.06
"""
    program.write_text(f"{HEAD}{stones}")
    first, again, single = (foldcar("sample", program, "-n", number) for number in ("3", "3", "1"))
    assert first.returncode == 0, first.stderr
    assert first.stdout == again.stdout
    scenes = first.stdout.splitlines()
    assert scenes[0] == single.stdout.strip()
    heights_m = {json.loads(line)["scene"]["terrain"][0]["height_m"] for line in scenes}
    assert len(heights_m) == 3


def test_values_that_all_samples_share_are_remarked_on(listing: Path, program: Path, foldcar: Run) -> None:
    shared = "import random\nnew Kerb at (0.5, 0), with height random.uniform(0.01, 0.02)\n"
    program.write_text(f"{HEAD}{shared}")
    for words in (["sweep", listing, "--store", "s.db"], ["sample", program, "-n", "2"]):
        assert "outside of Scenic's distributions: all samples have the same ones" in foldcar(*words).stderr
    program.write_text(f"{HEAD}new Kerb at (0.5, 0), with height Range(0.01, 0.02)\n")
    assert "all samples have the same" not in foldcar("sweep", listing, "--store", "t.db").stderr
