"""`foldcar select`: regions, information and environments against independent computations; advice on known truths."""

import csv
from collections.abc import Mapping
from itertools import product
from pathlib import Path
from typing import Any

import numpy
import pytest
from scipy.stats import binom
from typer.testing import CliRunner

from foldcar.advice.selecting import NEXT, Selection
from foldcar.advice.selecting import select as select_designs
from foldcar.analysis.rate import wilson_interval
from foldcar.analysis.selection import (
    ABOVE,
    BELOW,
    BEST,
    END,
    LOWER_EDGE,
    MIDDLE,
    UPPER_EDGE,
    choose,
    expected_loss,
    first_designs,
    honest_best,
    telling_environments,
    trials_needed,
    value_of_trials,
)
from foldcar.cli import app
from foldcar.commands.tables import print_selections
from foldcar.fabrication.patterns import nesting
from foldcar.store.reader import Store
from swept_listing import told
from written_study import add_trials, import_trials, write_study

WIDTHS = numpy.arange(65.0, 250.0, 5.0)


def advise(store: Path, **options: Any) -> list[Selection]:
    """As the command, without nesting sheets, which takes a second a car."""
    with Store.open(store) as opened:
        return select_designs(opened, with_cost=False, **options)


def plain(store: Path, capsys: pytest.CaptureFixture[str]) -> str:
    print_selections(advise(store))
    text = " ".join(capsys.readouterr().out.split())
    assert "nan" not in text.lower()
    return text


def test_first_designs_mark_the_region() -> None:
    # Feasible from 95 to 140 mm, as in the publication's figure 6.
    rates = numpy.where((WIDTHS >= 95) & (WIDTHS <= 140), 0.9, numpy.where(WIDTHS > 140, 0.4, 0.1))
    doubt = numpy.where(WIDTHS < 100, 0.5, 0.1)

    found = [(WIDTHS[one.index], one.place) for one in first_designs(WIDTHS[:, None], rates, doubt, 0.75)]

    assert [place for _, place in found] == [MIDDLE, LOWER_EDGE, ABOVE, BELOW, UPPER_EDGE]
    places = {place: width for width, place in found}
    assert (places[LOWER_EDGE], places[UPPER_EDGE]) == (95, 140)
    assert 115 <= places[MIDDLE] <= 120 and places[BELOW] < 95 and places[ABOVE] > 140
    # A rate at the threshold reaches it.
    assert [(WIDTHS[one.index], one.place) for one in first_designs(WIDTHS[:, None], rates, doubt, 0.9)] == found
    (best,) = first_designs(WIDTHS[:, None], rates, doubt, 0.95)
    assert best.place == BEST
    assert [one.place for one in first_designs(WIDTHS[:, None], rates, doubt, 0.05)] == [MIDDLE, END, END]


def test_the_middle_is_deepest_and_edges_have_a_neighbour_outside() -> None:
    """Of regions in several pieces, counted in steps: to the nearest design outside, or to beyond the range's ends."""
    random, n = numpy.random.default_rng(3), 40
    for _ in range(40):
        reached = numpy.convolve(random.random(n + 6), numpy.ones(7) / 7, "valid") > 0.5
        if reached.all() or not reached.any():
            continue
        outside = numpy.flatnonzero(~reached)
        depth = [min(numpy.abs(outside - i).min(), i + 1, n - i) if reached[i] else 0 for i in range(n)]

        found = first_designs(100 + 5 * numpy.arange(n)[:, None], reached.astype(float), numpy.zeros(n), 0.5)

        assert found[0].place == MIDDLE and depth[found[0].index] == max(depth)
        assert len({one.index for one in found}) == len(found) <= 5
        for one in found[1:]:
            beside = [i for i in (one.index - 1, one.index + 1) if 0 <= i < n]
            assert reached[one.index] == (one.place in (LOWER_EDGE, UPPER_EDGE))
            assert not reached[one.index] or not reached[beside].all()
            assert (one.index < found[0].index) == (one.place in (LOWER_EDGE, BELOW))


def test_first_designs_of_two_parameters_are_on_the_level_set() -> None:
    grid = numpy.array(list(product(range(11), range(11))), dtype=float)
    away = numpy.hypot(grid[:, 0] - 5, grid[:, 1] - 5)

    found = first_designs(grid, 1 / (1 + numpy.exp(away - 3.2)), numpy.zeros(len(grid)), 0.5)

    distance = [away[one.index] for one in found]
    assert distance[0] == 0
    for one, far in zip(found[1:], distance[1:], strict=True):
        assert (2.2 <= far <= 3.2) if "edge" in one.place else (far > 3.2)
    first, second = (grid[one.index] for one in found if "edge" in one.place)
    assert numpy.hypot(*(first - second)) > 3


def test_the_value_of_trials_is_what_they_improve() -> None:
    random = numpy.random.default_rng(5)
    p = random.random((200, 3))
    found = value_of_trials(p, 0.6, 4)

    for design in range(3):
        best, wrong = 0.0, 0.0
        for passed in range(5):
            weight = binom.pmf(passed, 4, p[:, design])
            share = weight.mean()
            best += share * numpy.average(p, axis=0, weights=weight).max()
            above = numpy.average(p >= 0.6, axis=0, weights=weight)
            wrong += share * numpy.minimum(above, 1 - above).mean()
        assert found.choice[design] == pytest.approx(best - p.mean(axis=0).max())
        above = (p >= 0.6).mean(axis=0)
        assert found.threshold[design] == pytest.approx(numpy.minimum(above, 1 - above).mean() - wrong)


def test_a_twin_of_a_chosen_design_tells_nothing_more() -> None:
    random = numpy.random.default_rng(6)
    one, other = random.beta(2, 2, 400), random.beta(4, 4, 400)
    draws = numpy.column_stack([one, one, other])

    assert choose(draws, 0.5, 10, 2, [0]) == [2, 1]


@pytest.mark.parametrize("rate", [0.5, 0.8, 1.0])
def test_trials_needed_are_the_fewest_that_suffice(rate: float) -> None:
    number = trials_needed([rate], 0.15)

    def half_width(n: int) -> float:
        low, high = wilson_interval(round(rate * n), n)
        return (high - low) / 2

    # Whole numbers of passed trials lie beside the rate.
    assert half_width(number + 2) <= 0.15 < half_width(number - 3)


def test_environments_represent_all_and_tell_designs_apart() -> None:
    random = numpy.random.default_rng(8)
    hardness = random.random(100)
    passed = (numpy.array([0.9, 0.5, 0.3])[:, None] > hardness).astype(float)
    passed[0, 7] = numpy.nan

    chosen = telling_environments(passed, 20, met=[3])

    assert chosen == telling_environments(passed, 20, met=[3]) and len(set(chosen)) == 20
    assert not {3, 7} & set(chosen)
    shares = numpy.nanmean(passed, axis=1)
    assert numpy.abs(passed[:, chosen].mean(axis=1) - shares).max() <= 0.05
    spread = numpy.ptp(passed[:, chosen], axis=0)
    assert list(spread) == sorted(spread, reverse=True)
    assert len(telling_environments(passed, 500)) == 99


def test_the_best_is_not_quoted_from_the_environments_that_chose_it() -> None:
    random = numpy.random.default_rng(9)
    quoted, naive = [], []
    for _ in range(200):
        passed = (random.random((30, 40)) < 0.5).astype(float)
        _, k, n = honest_best(passed)
        quoted.append(k / n)
        naive.append(passed.mean(axis=1).max())
    assert abs(numpy.mean(quoted) - 0.5) < 0.02
    assert numpy.mean(naive) > 0.6


def outcome(design: Mapping[str, float], sample: int) -> str:
    """All pass from 100 to 130 mm, fewer the farther away."""
    away = max(0.0, 100 - design["width_mm"], design["width_mm"] - 130)
    return "passed" if (sample * 7) % 40 >= away else "stuck"


FAMILY = {"width_mm": [float(width) for width in range(70, 190, 10)]}


def test_advice_before_trials_and_after_each_round(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # The first order of pieces that fits: a search takes longer than all else.
    monkeypatch.setattr(nesting, "MOST_TRIES", 0)
    store = write_study(tmp_path / "s.db", FAMILY, 40, outcome, thresholds=[0.5, 0.75])

    (before,) = advise(store)
    (printed,) = told("select", store, "--build", "1", "--csv", tmp_path / "build.csv")["experiments"]

    assert before.threshold == 0.75 and not before.enough and before.loss is None
    assert "no trials yet, so these mark the region that reaches 75 % in simulation." in before.sentence
    first = [float(one.design["width_mm"]) for one in before.recommendations]
    assert len(first) == 4 and before.recommendations[0].place == MIDDLE and 100 <= first[0] <= 130
    assert min(first) < 90 and max(first) > 140
    assert len(set(before.environments)) == max(one.trials for one in before.recommendations)
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

    assert after.sentence.startswith("Next, try ") and (after.loss or 0) > 0
    assert len(after.recommendations) == 3 and all(one.place == NEXT for one in after.recommendations)
    assert any(one.design["width_mm"] not in first for one in after.recommendations)
    assert all(one.expected is not None for one in after.recommendations)
    assert not set(after.environments) & set(met) or all(not one.built for one in after.recommendations)

    # Enough trials of enough cars of every design decide; then nothing is to be built.
    passing = {width: "passed" if rate > 0.5 else "stuck" for width, rate in truth.items()}
    import_trials(store, [({"width_mm": w}, k, passing[w]) for w in truth for k in range(40)], "more", 20)
    (last,) = advise(store)
    assert last.enough and not last.recommendations and last.loss is not None and last.loss < 0.15
    assert last.sentence.startswith("Enough: 70, 80, 90 and 100 mm reach 75 %")


def test_advice_of_two_parameters_of_one_design_and_of_none_that_passes(tmp_path: Path) -> None:
    family = {"width_mm": [80.0, 100.0, 120.0, 140.0], "depth_mm": [1.0, 2.0, 3.0]}
    write_study(tmp_path / "two.db", family, 20, outcome)
    write_study(tmp_path / "one.db", {"width_mm": [100.0]}, 20, outcome)
    write_study(tmp_path / "none.db", FAMILY, 20, lambda design, sample: "stuck")

    (two,) = advise(tmp_path / "two.db")
    (one,) = advise(tmp_path / "one.db", precision=0.1)
    (none,) = advise(tmp_path / "none.db")

    assert len({tuple(found.design.values()) for found in two.recommendations}) == 4
    assert two.recommendations[0].label.startswith("width ")
    assert len(one.recommendations) == 1 and "the design reaches 75 %" in " ".join(one.remarks)
    assert "no design reaches 75 % in simulation" in none.sentence and none.recommendations[0].place == BEST


ONE = ({"width_mm": 110.0}, 3, "passed")


@pytest.mark.parametrize(
    ("trials", "sentence"),
    [
        ([ONE], "Next, try"),
        ([({"width_mm": w}, k, "stuck") for w in (100.0, 120.0) for k in range(8)], "Next, try"),
        ([({"width_mm": w}, k, "passed") for w in (100.0, 120.0) for k in range(8)], "Next, try"),
        ([({"width_mm": 300.0, "depth_mm": 3.0}, 1, "passed")], "Build"),
    ],
    ids=["one", "all failed", "all passed", "unknown design"],
)
def test_odd_trials_get_advice_that_is_unsure(
    tmp_path: Path, trials: list[Any], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    store = write_study(tmp_path / "s.db", FAMILY, 20, outcome)
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
    for module in ("outlook", "selecting"):
        monkeypatch.setattr(f"foldcar.advice.{module}.MOST_POOLED", 2)
    (found,) = advise(store)

    said = "6 designs between these were left out of the choice, to save time; of the driven ones the 2 with most"
    assert any(one.startswith(said) for one in found.remarks)
    assert not any("left out of the choice" in one for one in whole.remarks)
    assert {one.design["width_mm"] for one in found.recommendations} <= {90.0, 130.0}


def test_the_expected_loss_is_that_of_the_best_mean() -> None:
    best, loss = expected_loss([[0.5, 0.6], [0.9, 0.6]])

    assert (best, loss) == (0, pytest.approx(0.05))
