"""`foldcar select`: tables, files and costs of the advice; the sentences are tested in test_advice_sentences.py."""

import csv
import json
import math
from collections.abc import Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from typer.testing import CliRunner

from foldcar.car.design import compose_columns
from foldcar.car.folded_car import folded_car
from foldcar.cli import app
from foldcar.evidence import costs
from foldcar.evidence.belief import learned_rate
from foldcar.fabrication.assembly.operations import operations
from foldcar.fabrication.patterns.options import options
from foldcar.fabrication.patterns.sheets import cut_car, enlarge_sheet, pattern
from foldcar.store.reader import Store
from study_car import listing_of
from swept_listing import STEP_PYRAMIDS, foldcar, json_output
from written_study import add_trials, import_trials, write_realities, write_study

FAMILY = {"width_mm": [float(width) for width in range(60, 181, 10)]}


def good_in_the_middle(scores: Mapping[str, float], design: Mapping[str, float]) -> float:
    return 3 - 0.1 * abs(design["width_mm"] - 110) - 1.5 * scores["obstacle_height"]


def outcome(design: Mapping[str, float], sample: int) -> str:
    return "passed" if sample < 40 - 0.5 * abs(design["width_mm"] - 110) else "tipped"


@pytest.fixture
def store(tmp_path: Path) -> Path:
    path = write_study(tmp_path / "s.db", FAMILY, 40, outcome)
    write_realities(path, good_in_the_middle)
    return path


def test_the_command_prints_two_lines_and_the_steps(store: Path) -> None:
    add_trials(store, [({"width_mm": 110.0}, sample, "tipped") for sample in range(4)])

    text = " ".join(foldcar("select", store).split())

    assert text.index("Want a car that works?") < text.index("Want to learn most?") < text.index("In simulation ")
    assert "gain an hour" in text
    assert "Environments to set up for the trials (`foldcar log --sample K`): " in text
    assert "nan" not in text.lower()


def test_select_states_the_error_that_the_sweep_stated(tmp_path: Path) -> None:
    """Both learn from the runs in other realities and from the nominal ones."""
    listing = listing_of(STEP_PYRAMIDS, {"width": [95, 170, 245]}, timeout=60, environments=20)
    (tmp_path / "l.json").write_text(json.dumps(listing))

    swept = json_output("sweep", tmp_path / "l.json", "--store", tmp_path / "s.db", "--realities", "400")

    with Store.open(tmp_path / "s.db") as store:
        learned = learned_rate(store, store.info().experiments["1"])
    assert learned is not None and swept["realities"]["1"]["error"] == learned.error


def test_files_have_the_steps(store: Path, tmp_path: Path) -> None:
    add_trials(store, [({"width_mm": 110.0}, sample, "tipped") for sample in range(4)])

    (selection,) = json_output("select", store, "--csv", tmp_path / "steps.csv")["experiments"]

    with (tmp_path / "steps.csv").open() as text:
        rows = list(csv.DictReader(text))
    assert [row["step"] for row in rows] == [step["text"] for step in selection["steps"]]
    assert [float(row["gain"]) for row in rows] == pytest.approx([step["gain"] for step in selection["steps"]])
    assert selection["leader"]["width_mm"] in FAMILY["width_mm"]
    built = next(step for step in selection["steps"] if step["kind"] == "build")
    assert 0 <= built["built"]["low"] <= built["built"]["value"] <= built["built"]["high"] <= 1


def test_the_number_of_written_steps_is_said_in_words(tmp_path: Path) -> None:
    store = write_study(tmp_path / "one.db", {"width_mm": [110.0]}, 40, outcome)
    write_realities(store, good_in_the_middle)

    done = CliRunner().invoke(app, ["select", str(store), "--csv", str(tmp_path / "steps.csv")])

    with (tmp_path / "steps.csv").open() as text:
        number = len(list(csv.DictReader(text)))
    assert number == 1 and f"steps.csv: {number} step\n" in done.output
    help_text = " ".join(CliRunner().invoke(app, ["select", "--help"]).output.split())
    assert "CSV file to write, a row for each step." in help_text


def test_a_threshold_is_judged_by_itself(store: Path) -> None:
    chances = [
        json.loads(json.dumps(json_output("select", store, "--threshold", limit)))["experiments"][0]["works"]
        for limit in (0.1, 0.99)
    ]

    assert "10 %" in chances[0]
    assert "99 %" in chances[1]


def test_trials_of_simulated_cars_count_only_if_asked_and_every_answer_says_so(store: Path) -> None:
    add_trials(store, [({"width_mm": 110.0}, sample, "tipped") for sample in range(8)], car="simulated")

    plain, counted = (
        json_output("select", store, *words)["experiments"][0]["works"] for words in ((), ("--simulated-trials",))
    )

    assert "no car was driven yet" in plain
    assert counted.startswith("Trials of SIMULATED cars count here as trials of built ones. Want a car that works?")


def test_a_trial_in_an_easy_environment_counts_less_than_in_a_hard_one(tmp_path: Path) -> None:
    """Environments are the harder the higher their number."""
    expected = []
    for first in (0, 36):
        store = write_study(tmp_path / f"{first}.db", FAMILY, 40, outcome)
        write_realities(store, good_in_the_middle, scene_log_odds=lambda sample: 1.5 - 3 * sample / 40)
        import_trials(store, [({"width_mm": 110.0}, first + k, "passed") for k in range(4)] * 2)
        (experiment,) = json_output("compare", store)["experiments"]
        expected.append(experiment["designs"][0]["built"]["value"])

    assert expected[0] < expected[1]


def test_cars_and_trials_cost_sheets_and_minutes() -> None:
    """189 cm² of film is 3.2 sheets of 929 cm² at 63 %."""

    def sheets(design: Mapping[str, float]) -> int | None:
        evidence: Any = SimpleNamespace(vehicle_type="W_B_W", design=design)
        return costs.sheets_of(evidence)

    assert sheets({"width_mm": 95.0}) == 4
    assert sheets({"width_mm": 1.0}) is None
    assert sheets({"wit_mm": 95.0}) is None
    assert costs.car_min("W_B_W+cells=nimh") == 91
    assert costs.trial_min(45.0) == pytest.approx(3.75)


# As in patterns/six_wheels.json and hinged.json.
SIX = {"width_mm": 95.0, "height_mm": 50.0, "radius_mm": 40.0, "W_length_mm": 90.0, "B_length_mm": 80.0}


@pytest.mark.parametrize(
    ("vehicle_type", "design"),
    [
        ("W_B_W", {"width_mm": 65.0}),
        ("W_B_W", {"width_mm": 245.0}),
        ("W_B_W_W", SIX),
        ("W_B_H_W_H_W", SIX),
        ("W_W_B_W", SIX),
    ],
)
def test_the_estimate_of_a_car_is_near_its_pattern_and_its_guide(vehicle_type: str, design: dict[str, float]) -> None:
    """The real pattern nests the pieces, the real guide counts operations; a blade cuts 20 mm/s."""
    folded = folded_car(compose_columns(vehicle_type, design))
    sheet = enlarge_sheet(folded, options("silhouette"))
    cut = pattern(folded, sheet, "car")
    minutes = operations(folded, cut_car(folded, sheet)).minutes + cut.cut_length_mm / 20 / 60
    evidence: Any = SimpleNamespace(vehicle_type=vehicle_type, design=design, mean_time_s=None)

    sheets = costs.sheets_of(evidence)

    assert sheets is not None
    nested_cm2 = len(cut.sheets) * math.prod(sheet.sheet_size_mm) / 100
    assert abs(sheets * costs.SHEET_CM2 - nested_cm2) <= 1.01 * costs.SHEET_CM2
    assert costs.car_min(vehicle_type) == pytest.approx(minutes, rel=0.15)
