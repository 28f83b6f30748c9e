"""What the report's page needs to simulate its runs: a real study of two widths."""

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

from browser import Tab, study_of
from foldcar.belief.priors import NOMINAL
from foldcar.figures.scene_data import HEIGHT_M, ground_data
from foldcar.report import write
from foldcar.report.drives import result_hashes
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.heights import carsim_heights
from foldcar.simulation.results import NUMBERS, OUTCOMES
from foldcar.store.trial_writer import write_trials
from foldcar.study.reality_environment import read_reality
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


def test_the_page_holds_the_inputs_of_every_run(study: Path, carsim_binary: Path) -> None:
    """Carsim's answers to the page's inputs have the hashes of the stored results."""
    page = (study / "report" / "index.html").read_text()
    (experiment,) = study_of(study / "report")["experiments"]
    inputs, checks = blob_of(page, "e0-inputs")[0], blob_of(page, "e0-checks")[1]
    runs = experiment["runs"]
    stored = dict(
        zip(zip(runs["design"], runs["environment"], strict=True), numpy.frombuffer(checks, "<u4"), strict=True)
    )
    lines, keys = [], []
    for design, (body, setting) in inputs["designs"].items():
        lines.append({"body": {**inputs["bodies"][body], "id": f"b{body}"}})
        for sample in range(SAMPLES):
            lines.append({"scene": {**blob_of(page, f"e0-scene-{sample}")[0]["scene"], "id": f"s{sample}"}})
            reality = inputs["realities"][str(sample)]
            run = {
                **inputs["settings"][setting],
                "id": "r",
                "body": f"b{body}",
                "scene": f"s{sample}",
                "reality": reality,
            }
            lines.append({"run": run})
            keys.append((int(design), sample))

    answers = Carsim(carsim_binary).answers([json.dumps(line) for line in lines])

    outcomes = numpy.array([OUTCOMES.index(answer["outcome"]) for answer in answers])
    metrics = numpy.array(
        [[numpy.nan if answer[name] is None else answer[name] for name in NUMBERS] for answer in answers]
    )
    assert len(answers) == len(WIDTHS) * SAMPLES == len(stored)
    assert result_hashes(outcomes, metrics).tolist() == [stored[key] for key in keys]
    # One bit of one number is enough.
    metrics[0, 0] = numpy.nextafter(metrics[0, 0], 1)
    assert result_hashes(outcomes, metrics).tolist()[0] != stored[keys[0]]


def test_sliders_begin_at_what_was_simulated_and_stay_within_the_limits(study: Path, carsim_binary: Path) -> None:
    (experiment,) = study_of(study / "report")["experiments"]
    sliders = {slider["name"]: slider for slider in experiment["drives"]["sliders"]}

    assert set(sliders) == {*NOMINAL, "supply_resistance_ohm"} - {"wheel_spread"}
    for name, slider in sliders.items():
        assert slider["low"] <= slider["nominal"] == NOMINAL.get(name, 0.0) <= slider["high"]
        for value in (slider["low"], slider["high"]):
            (study / "reality.json").write_text(json.dumps({name: value}))
            assert read_reality(study / "reality.json", "multibody").values.get(name, 0.0) == value


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


# A picture of one pixel, as PNG.
PIXEL = b64decode("iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg==")


def test_photos_and_films_are_shown_beside_their_trial(study: Path) -> None:
    phone = study / "my phone"
    phone.mkdir()
    with write_trials(study / "s.db") as writer:
        for trial, kind, name in ((1, "photo", "a#1.png"), (1, "film", "drive.mp4"), (2, "photo", "gone.jpg")):
            # Equal files of a trial are stored once, so each ends with its name.
            (phone / name).write_bytes(PIXEL + name.encode())
            writer.put_media(trial, kind, phone / name)
    (phone / "gone.jpg").unlink()
    foldcar("report", study / "s.db", "-o", study / "report")

    (experiment,) = study_of(study / "report")["experiments"]
    assert [[item["address"] for item in trial["media"]] for trial in experiment["trials"]] == [
        ["../my%20phone/a%231.png", "../my%20phone/drive.mp4"], [None],
    ]  # fmt: skip
    with Tab((study / "report" / "index.html").as_uri()) as tab:
        tab.wait("document.body?.dataset.state === 'ready'")
        tab.ask("document.querySelector('.media img').scrollIntoView()")
        tab.wait("document.querySelector('.media img').naturalWidth === 1")
        assert tab.ask("document.querySelector('.media video').src").endswith("/my%20phone/drive.mp4")
        cells = tab.ask("[...document.querySelectorAll('.media')].map(cell => cell.textContent)")
    assert cells == ["", "gone.jpg (missing)"]
