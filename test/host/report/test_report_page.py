"""The paths, grounds and cars that the report's page replays: a real study of two widths."""

import json
import re
import sqlite3
import zlib
from base64 import b64decode
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy
import pytest

from foldcar.figures.scene_data import HEIGHT_M, ground_data
from foldcar.report import write
from foldcar.report.replay import choose_runs
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.compact_path import ANGLE_RAD, PLACE_M, compact_path
from foldcar.simulation.heights import carsim_heights
from foldcar.simulation.results import NUMBERS
from foldcar.simulation.runner import KEPT_INTERVAL_S as INTERVAL_S
from foldcar.store.frames import RunArrays
from foldcar.study.kept_paths import MAX_DESIGNS, KeptPaths
from swept_listing import foldcar, reported

WIDTHS, SAMPLES = (95, 245), 3


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory, carsim_binary: Path) -> Iterator[Path]:
    """The folder of a swept store, s.db, with two trials, and of its report; reports have no figures here."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(write, "_save_figures", lambda *_: None)
        yield reported(tmp_path_factory.mktemp("page"), WIDTHS, SAMPLES)


def blob_of(page: str, name: str) -> tuple[Any, bytes]:
    """The head and the bytes of a blob of the page."""
    text = re.search(rf'<script type="text/plain" id="{name}">([^<]*)</script>', page)
    assert text is not None
    head, _, content = zlib.decompress(b64decode(text[1]), -15).partition(b"\n")
    return json.loads(head), content


def integers(content: bytes) -> list[int]:
    """What zigzag LEB128 holds, read here as its definition says."""
    integers, value, shift = [], 0, 0
    for byte in content:
        value |= (byte & 127) << shift
        shift += 7
        if byte < 128:
            integers.append(value >> 1 if value % 2 == 0 else -(value >> 1) - 1)
            value, shift = 0, 0
    return integers


def test_a_path_comes_back_within_half_a_unit() -> None:
    turn = numpy.linspace(3.0, 3.3, 40)
    path = numpy.column_stack([numpy.arange(40) * INTERVAL_S, *([numpy.sin(7 * turn + k) for k in range(7)])])
    # Beyond a half turn the simulator's heading leaps to the other side.
    path[:, 4] = (turn + numpy.pi) % (2 * numpy.pi) - numpy.pi

    columns = numpy.array(integers(compact_path(path.tolist()))).reshape(7, 40)

    back = numpy.cumsum(numpy.cumsum(columns, axis=1), axis=1) * numpy.array([PLACE_M] * 3 + [ANGLE_RAD] * 4)[:, None]
    assert numpy.abs(back[:3] - path[:, 1:4].T).max() <= PLACE_M / 2 + 1e-12
    assert numpy.abs(numpy.exp(1j * back[3]) - numpy.exp(1j * path[:, 4])).max() <= ANGLE_RAD / 2 + 1e-9
    assert numpy.abs(numpy.diff(back[3])).max() < 0.1


def test_carsims_compact_path_is_that_of_its_rows(study: Path, carsim_binary: Path) -> None:
    query = "SELECT b.json, s.json, t.json FROM design d JOIN body b ON b.id = d.body_id JOIN settings t JOIN scene s"
    body, scene, settings = map(json.loads, sqlite3.connect(study / "s.db").execute(query).fetchone())
    scene["start"]["heading_rad"] = 3.14159
    run = {"body": "b", "scene": "s", **settings, "time_limit_s": 3.0, "path_interval_s": INTERVAL_S}
    lines = [{"body": {**body, "id": "b"}}, {"scene": {**scene, "id": "s"}}]
    lines += [{"run": {"id": "rows", **run}}, {"run": {"id": "few", **run, "path_form": "compact"}}]

    rows, few = (answer["path"] for answer in Carsim(carsim_binary).answers([json.dumps(line) for line in lines]))

    assert few["rows"] == len(rows) >= 20
    assert b64decode(few["compact"]) == compact_path(rows)


def test_a_report_simulates_only_without_kept_paths_and_gives_the_same(
    study: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "s.db").write_bytes((study / "s.db").read_bytes())
    with sqlite3.connect(tmp_path / "s.db") as connection:
        connection.execute("DELETE FROM path")
    foldcar("report", tmp_path / "s.db", "-o", tmp_path / "report")

    def refuse(*_: object) -> None:
        raise AssertionError("a run is simulated")

    monkeypatch.setattr(Carsim, "run", refuse)
    foldcar("report", study / "s.db", "-o", study / "again")

    first, *others = (folder / "index.html" for folder in (study / "report", study / "again", tmp_path / "report"))
    for name in ("e0-runs-0", "e0-runs-1"):
        expected = blob_of(first.read_text(), name)
        assert [blob_of(page.read_text(), name) for page in others] == [expected] * 2


def test_kept_paths_are_bounded_but_for_the_first_of_each_ending() -> None:
    keeper = KeptPaths(designs=2 * MAX_DESIGNS)
    endings = ["passed", "tipped"] * 10_000 + ["stuck", "stuck", "rejected"]

    shown = [design for design in range(2 * MAX_DESIGNS) if keeper.wants(design)]
    kept = [keeper.keeps(shown[number % 7], outcome, 1000) for number, outcome in enumerate(endings)]

    assert len(shown) == MAX_DESIGNS and shown[0] == 0 and shown[-1] == 2 * MAX_DESIGNS - 1
    # 750 bytes each of 3 million.
    assert kept[:4000] == [True] * 4000 and not any(kept[4000:20_000])
    assert kept[20_000:] == [True, True, False]
    # What the store has counts.
    assert not KeptPaths(1, [(0, "passed", 4_000_000)]).keeps(0, "passed", 10)


def test_the_page_holds_every_run_as_stored(study: Path) -> None:
    page = (study / "report" / "index.html").read_text()
    query = "SELECT design_position, sample, elapsed_time_s, distance_to_target_m FROM result"
    runs = sqlite3.connect(study / "s.db").execute(query).fetchall()

    assert len(runs) == len(WIDTHS) * SAMPLES
    assert "No replay" not in page and "end otherwise" not in page
    for design, sample, elapsed_s, distance_m in runs:
        head, content = blob_of(page, f"e0-runs-{design}")
        goal = blob_of(page, f"e0-scene-{sample}")[0]["scene"]["goal"]
        at = [run[0] for run in head["runs"]].index(sample)
        assert head["runs"][at][2] == elapsed_s
        values, skipped = integers(content), sum(6 * run[1] for run in head["runs"][:at])
        rows = head["runs"][at][1]
        columns = numpy.array(values[skipped : skipped + 6 * rows]).reshape(6, rows)
        x, y = (numpy.cumsum(numpy.cumsum(column))[-1] * PLACE_M for column in columns[:2])
        # The path ends where the stored distance to the goal says.
        assert numpy.hypot(x - goal["x_m"], y - goal["y_m"]) == pytest.approx(distance_m, abs=1e-3)


def test_a_page_that_cannot_hold_all_runs_keeps_every_kind_and_those_at_the_threshold() -> None:
    designs, samples = (at.ravel() for at in numpy.indices((20, 3000)))
    outcome = numpy.zeros(len(designs), dtype=numpy.uint8)
    outcome[(designs == 7) & (samples == 2900)] = 1
    outcome[(designs == 11) & (samples < 800)] = 2
    metrics = numpy.full((len(designs), len(NUMBERS)), 5.0)

    chosen = choose_runs(RunArrays(designs, samples, outcome, metrics), most_bytes=1_000_000, most_runs=150)

    assert len(chosen) == 150 and list(chosen) == sorted(chosen)
    assert (chosen[7, 2900], chosen[11, 0]) == (("tipped", 5.0), ("stuck", 5.0))
    # The design at 73 % success is nearest to the threshold of 75 %: after one run of each kind come its runs.
    assert sum(design == 11 for design, _ in chosen) > 100


def test_smooth_ground_is_the_simulators(study: Path, carsim_binary: Path) -> None:
    hill = {"kind": "hill", "x_m": 0.5, "y_m": 0.2, "heading_rad": 0.5}
    hill |= {"height_m": 0.05, "sd_along_m": 0.1, "sd_across_m": 0.06}
    (text,) = sqlite3.connect(study / "s.db").execute("SELECT json FROM scene").fetchone()
    scene = {**json.loads(text), "terrain": [hill]}
    head, content = ground_data(scene, carsim_heights(Carsim(carsim_binary)))
    grid = head["grid"]
    heights = numpy.cumsum(integers(content)).reshape(grid["rows"], grid["columns"]) * grid["height_m"]
    rows, columns = numpy.indices(heights.shape)[:, ::7, ::7].reshape(2, -1)
    x = grid["x_min_m"] + columns * grid["x_step_m"] - hill["x_m"]
    y = grid["y_min_m"] + rows * grid["y_step_m"] - hill["y_m"]
    along, across = (x * numpy.cos(0.5) + y * numpy.sin(0.5)) / 0.1, (y * numpy.cos(0.5) - x * numpy.sin(0.5)) / 0.06
    # A Gaussian, cut off at four standard deviations (docs/carsim.md).
    expected = 0.05 * numpy.exp(-(along**2 + across**2) / 2)

    assert heights[rows, columns] == pytest.approx(expected, abs=HEIGHT_M / 2 + 0.05 * numpy.exp(-8))
    assert heights.max() > 0.045
