"""`foldcar select`: advice on known truths."""

import csv
import math
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from foldcar.evidence import adviser, costs
from foldcar.evidence.adviser import NEXT, Selection
from foldcar.evidence.comparison import compare
from foldcar.evidence.evidence import read_evidence
from foldcar.evidence.selecting import select as select_designs
from foldcar.evidence.selecting import select_evidence
from foldcar.statistics.built_cars import SPREADS
from foldcar.statistics.pooled_bias import NO_CONTRADICTIONS, contradictions
from foldcar.statistics.selection import BEST, MIDDLE, Effort
from typer.testing import CliRunner

from foldcar.car.design import compose_columns
from foldcar.car.folded_car import folded_car
from foldcar.cli import app
from foldcar.commands.tables import print_selections
from foldcar.fabrication.assembly.operations import operations
from foldcar.fabrication.patterns.options import options
from foldcar.fabrication.patterns.sheets import cut_car, enlarge_sheet, pattern
from foldcar.report.page_data import read_experiments
from foldcar.statistics.rate import wilson_interval
from foldcar.store.measured import write_measured
from foldcar.store.reader import Store
from swept_listing import json_output
from written_study import add_trials, import_trials, write_study


def advise(store: Path, **options: Any) -> list[Selection]:
    """As the command."""
    with Store.open(store) as opened:
        return select_designs(opened, **options)


def plain(store: Path, capsys: pytest.CaptureFixture[str]) -> str:
    print_selections(advise(store))
    text = " ".join(capsys.readouterr().out.split())
    assert "nan" not in text.lower()
    return text


def test_what_was_not_measured_is_named_while_more_trials_are_advised(tmp_path: Path) -> None:
    store = write_study(tmp_path / "s.db", FAMILY, 40, outcome)
    (before,) = advise(store)
    import_trials(store, [({"width_mm": 90.0}, None, "passed"), ({"width_mm": 120.0}, None, "stuck")] * 3)

    (unmeasured,) = advise(store)
    with write_measured(store) as writer:
        writer.measure("1", {"track_m": 0.001, "obstacle_height": 1.0})
        writer.measure("2", {"com_height_m": 0.001})
    (one_missing,) = advise(store)
    with write_measured(store) as writer:
        writer.measure("1", {"com_height_m": 0.0})
    (measured,) = advise(store)

    first = "Measure first, before more trials: "
    assert not any(line.startswith(first) for line in (*before.remarks, *measured.remarks))
    assert f"{first}obstacle_height, com_height_m and track_m (`foldcar trials measure`)." in unmeasured.remarks
    assert f"{first}com_height_m (`foldcar trials measure`)." in one_missing.remarks
    assert measured.recommendations == unmeasured.recommendations != ()


def outcome(design: Mapping[str, float], sample: int) -> str:
    """All pass from 100 to 130 mm, fewer the farther away."""
    away = max(0.0, 100 - design["width_mm"], design["width_mm"] - 130)
    return "passed" if (sample * 7) % 40 >= away else "stuck"


FAMILY = {"width_mm": [float(width) for width in range(70, 190, 10)]}


def test_advice_before_trials_and_after_each_round(tmp_path: Path) -> None:
    store = write_study(tmp_path / "s.db", FAMILY, 40, outcome, thresholds=[0.5, 0.75])

    (before,) = advise(store)
    (printed,) = json_output("select", store, "--build", "1", "--csv", tmp_path / "build.csv")["experiments"]

    assert before.threshold == 0.75 and not before.enough and before.loss is None
    assert "100 to 130 mm with 95 % confidence" in before.headline and "No car was driven yet" in before.headline
    first = [float(recommendation.design["width_mm"]) for recommendation in before.recommendations]
    assert len(first) == 4 and before.recommendations[0].place == MIDDLE and 100 <= first[0] <= 130
    assert min(first) < 90 and max(first) > 140
    assert len(set(before.environments)) == min(
        40, max(recommendation.trials for recommendation in before.recommendations)
    )
    (middle,) = printed["recommendations"]
    assert middle["cost"]["sheets"] >= 1 and middle["trials"] > 5
    with (tmp_path / "build.csv").open() as text:
        rows = list(csv.DictReader(text))
    assert [(row["rank"], float(row["width_mm"])) for row in rows] == [("1", first[0])]
    assert list(rows[0])[:3] == ["experiment", "rank", "width_mm"]
    ends = [float(rows[0][f"simulated{end}"]) for end in ("", "_low", "_high")]
    assert ends == [1.0, *wilson_interval(40, 40)]
    assert (int(rows[0]["sheets"]), int(rows[0]["minutes"])) == (middle["cost"]["sheets"], middle["cost"]["minutes"])

    # The truth: only 100 mm and below pass.
    truth = {width: 0.9 if width <= 100 else 0.1 for width in FAMILY["width_mm"]}
    met = before.environments[:10]
    import_trials(
        store,
        [({"width_mm": w}, k, "passed" if i < 10 * truth[w] else "stuck") for w in first for i, k in enumerate(met)],
    )
    (after,) = advise(store, build=3)

    assert after.next_step.startswith("Next, ") and (after.loss or 0) > 0
    assert after.recommendations and all(recommendation.place == NEXT for recommendation in after.recommendations)
    assert any(recommendation.design["width_mm"] not in first for recommendation in after.recommendations)
    assert {design.label for design in (*before.recommendations, *after.recommendations)} >= {
        after.recommendations[0].label
    }
    assert not set(after.environments) & set(met) or all(
        not recommendation.built for recommendation in after.recommendations
    )


def test_it_ends_with_a_design_at_the_threshold_and_names_it(tmp_path: Path) -> None:
    """100 mm passes 30 of 40 trials, and the threshold is 75 %."""
    store = write_study(tmp_path / "s.db", FAMILY, 40, outcome)
    rates = {width: 40 if width < 100 else 30 if width == 100 else 2 for width in FAMILY["width_mm"]}
    ends = [({"width_mm": w}, k, "passed" if k < n else "stuck") for w, n in rates.items() for k in range(40)]
    import_trials(store, ends, cars=20)

    (selection,) = advise(store)

    (at,) = (design for design in selection.undecided if design.label == "100 mm")
    assert selection.enough and not selection.recommendations and at.at and at.trials > 100
    assert selection.headline.endswith("70 to 90 mm reach 75 %.")
    sentence = r"Enough: expected loss if you stop with \d+ mm: \d points; an hour of work wins less"
    assert re.match(sentence, selection.next_step)
    assert "100 mm is within 15 points of the threshold; some " in selection.next_step


def test_cars_that_differ_ask_for_several_of_a_design(tmp_path: Path) -> None:
    with Store.open(write_study(tmp_path / "s.db", FAMILY, 40, outcome)) as opened:
        (evidence,) = read_evidence(opened)
        assert evidence.belief is not None

        def with_spread(spread: float) -> Selection:
            belief = evidence.belief
            assert belief is not None
            designs = tuple(replace(design, spread=(spread == SPREADS).astype(float)) for design in belief.designs)
            (result,) = select_evidence([replace(evidence, belief=replace(belief, designs=designs))])
            return result

        alike, differing = with_spread(0.0), with_spread(1.0)

    for first, other in zip(alike.recommendations, differing.recommendations, strict=True):
        assert first.cars == 1 and other.cars > 1 and other.trials > first.trials


def test_a_lone_failing_design_is_named_and_rates_beside_it_are_open(tmp_path: Path) -> None:
    """All simulated runs pass; of five driven widths 110 mm fails."""
    store = write_study(tmp_path / "s.db", FAMILY, 40, lambda design, sample: "passed")
    driven = (70.0, 90.0, 110.0, 130.0, 150.0)
    import_trials(store, [({"width_mm": w}, k, "stuck" if w == 110 else "passed") for w in driven for k in range(15)])

    (selection,) = advise(store)
    with Store.open(store) as opened:
        (compared,) = compare(opened).experiments
        (shown,) = read_experiments(opened)
        verdicts = dict(zip(shown.columns.names, shown.columns.page(0.1)["verdict"], strict=True))

    sentence = "The trials of 110 mm contradict those of the other designs: do not trust the rates of undriven designs"
    assert f"{sentence} beside it (100 and 120 mm)." in selection.remarks
    assert any(remark.startswith(sentence) for remark in compared.remarks)
    assert {"100 mm", "120 mm"} <= {design.label for design in selection.undecided}
    assert verdicts["100 mm"] == verdicts["120 mm"] == "open" and verdicts["80 mm"] == "good"
    assert contradictions([[1.0], [2.0]], [[9, 10]] * 2, [[0, 9], [9, 9]]) == NO_CONTRADICTIONS


def test_advice_of_two_parameters_of_one_design_and_of_none_that_passes(tmp_path: Path) -> None:
    family = {"width_mm": [80.0, 100.0, 120.0, 140.0], "depth_mm": [1.0, 2.0, 3.0]}
    write_study(tmp_path / "two.db", family, 20, outcome)
    write_study(tmp_path / "one.db", {"width_mm": [100.0]}, 20, outcome)
    write_study(tmp_path / "none.db", FAMILY, 20, lambda design, sample: "stuck")

    (two,) = advise(tmp_path / "two.db")
    (selection,) = advise(tmp_path / "one.db", precision=0.1)
    (none,) = advise(tmp_path / "none.db")
    import_trials(tmp_path / "one.db", [({"width_mm": 100.0}, k, "passed") for k in range(20)], cars=20)
    (driven,) = advise(tmp_path / "one.db")

    assert len({tuple(recommendation.design.values()) for recommendation in two.recommendations}) == 4
    assert two.recommendations[0].label.startswith("width ")
    assert len(selection.recommendations) == 1 and "the design reaches 75 %" in selection.headline
    assert "In simulation no run passed" in none.headline and none.recommendations[0].place == BEST
    assert driven.enough and "Enough: " in driven.next_step and driven.undecided == ()


ONE = ({"width_mm": 110.0}, 3, "passed")


def test_odd_trials_get_advice_that_is_unsure(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name, trials, sentence in (
        ("failed", [({"width_mm": w}, k, "stuck") for w in (100.0, 120.0) for k in range(8)], "Next, "),
        ("unknown", [({"width_mm": 300.0, "depth_mm": 3.0}, 1, "passed")], "Next, build"),
    ):
        store = write_study(tmp_path / f"{name}.db", FAMILY, 20, outcome)
        add_trials(store, trials)
        assert sentence in plain(store, capsys)


def test_odd_stores_get_a_plain_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "s.db"
    add_trials(path, [ONE])
    assert "the store has no runs yet" in plain(path, capsys)
    write_study(path, FAMILY, 3, outcome, success_defined=False, success_rule="success is undefined")
    assert "success is undefined" in plain(path, capsys)
    write_study(path, FAMILY, 1, outcome, experiment="2", build="build-8")
    assert "Experiment 2" in plain(path, capsys)
    answer = CliRunner().invoke(app, ["select", str(path), "--precision", "60pp"])
    assert "--precision" in str(answer.exception) and "45pp" in str(answer.exception)


def test_of_very_many_driven_designs_those_with_most_trials_count(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    widths = [60.0 + 10 * k for k in range(8)]
    store = write_study(tmp_path / "s.db", {"width_mm": widths}, 20, outcome)
    trials = [({"width_mm": width}, k, "passed") for at, width in enumerate(widths) for k in range(1 + at % 4)]
    import_trials(store, trials)
    (whole,) = advise(store)
    for module in ("belief", "adviser"):
        monkeypatch.setattr(f"foldcar.evidence.{module}.MAX_POOLED", 2)
    (selection,) = advise(store)

    sentence = "Of the driven designs the 2 with most trials count."
    assert sentence in selection.remarks and sentence not in whole.remarks


def test_cars_and_trials_cost_sheets_and_minutes() -> None:
    """71 min for a W_B_W, 3 min and the drive for each trial; 189 cm² of film is 3.2 sheets of 929 cm² at 63 %."""
    design = {"width_mm": 95.0}

    def priced(cars: int, trials: int, drive_s: float | None, design: dict[str, float] = design) -> costs.Cost | None:
        evidence: Any = SimpleNamespace(vehicle_type="W_B_W", design=design, mean_time_s=drive_s)
        return costs.cost(evidence, Effort(cars, trials, trials))

    assert priced(1, 10, 30.0) == costs.Cost(4, 71 + 35)
    assert priced(3, 10, 30.0) == costs.Cost(12, 3 * 71 + 35)
    assert priced(0, 60, None) == costs.Cost(0, 180)
    assert priced(0, 7, 45.0) == costs.Cost(0, math.ceil(7 * 3.75))
    assert priced(1, 10, 30.0, {"width_mm": 1.0}) is None
    assert priced(1, 10, 30.0, {"wit_mm": 95.0}) is None


def test_many_designs_are_thinned_evenly_from_first_to_last(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(adviser, "MAX_CANDIDATES", 3)
    (selection,) = advise(write_study(tmp_path / "s.db", FAMILY, 20, outcome))

    assert "9 designs between these were left out of the choice, to save time." in selection.remarks


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

    estimate = costs.cost(evidence, Effort(1, 0, 0))

    assert estimate is not None
    nested_cm2 = len(cut.sheets) * math.prod(sheet.sheet_size_mm) / 100
    assert abs(estimate.sheets * costs.SHEET_CM2 - nested_cm2) <= 1.01 * costs.SHEET_CM2
    assert estimate.minutes == pytest.approx(minutes, rel=0.15)
