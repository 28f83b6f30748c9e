"""The study page's data against the export of the same store."""

import json
from pathlib import Path
from typing import Any

import numpy
import pandas
import pytest

from foldcar.api.study import Study
from foldcar.evidence.comparison import compare
from foldcar.report import page_data as module
from foldcar.report.page_data import page_data
from foldcar.report.paper_figures import draw_feasibility
from foldcar.report.reported_experiment import read_experiments
from foldcar.simulation.results import OUTCOMES
from foldcar.statistics.rate import wilson_interval
from foldcar.store.reader import Store
from swept_listing import STEP_PYRAMIDS, foldcar
from written_study import import_trials, write_realities, write_study

SAMPLES = 3


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory, carsim_binary: Path) -> Path:
    """A swept store of two widths times two lengths with four trials, one of a width that was not swept."""
    folder = tmp_path_factory.mktemp("data")
    params = [{"common": {"width": [95, 245]}}, {"B": {"length": [80, 120]}}]
    listing = {
        "experiments": {"1": {"veh_id": 1, "env_id": 1, "params": {"timeout": 120, "environments": SAMPLES}}},
        "vehicles": {"1": {"type": "W_B_W", "params": params}},
        "environments": {"1": {"scenic_filename": str(STEP_PYRAMIDS), "seed": 42}},
    }
    (folder / "l.json").write_text(json.dumps(listing))
    foldcar("sweep", folder / "l.json", "--store", folder / "s.db")
    rows = ("vehicle_type,outcome,source,width_mm,B_length_mm", "W_B_W,passed,notes,95,80", "W_B_W,tipped,notes,95,80")
    rows += ("W_B_W,aborted,notes,95,80", "W_B_W,passed,notes,150,80", "")
    (folder / "t.csv").write_text("\n".join(rows))
    foldcar("trials", "import", folder / "s.db", folder / "t.csv", "--experiment", "1")
    return folder / "s.db"


def read(store: Path) -> dict[str, Any]:
    """The only experiment, as the page gets it."""
    with Store.open(store) as opened:
        (result,) = json.loads(json.dumps(page_data(opened), allow_nan=False))["experiments"]
    return dict(result)


def designs_of(table: pandas.DataFrame, page: dict[str, Any]) -> pandas.Series:
    """The index of each row's design on the page."""
    places = {}
    for index, at in enumerate(page["designs"]["value"]):
        values = [parameter["values"][place] for parameter, place in zip(page["parameters"], at, strict=True)]
        places[tuple(values)] = index
    names = [parameter["name"] for parameter in page["parameters"]]
    return table[names].apply(lambda row: places[tuple(row)], axis=1)


def test_counts_intervals_and_runs_are_those_of_the_export(store: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page, runs = read(store), Study(store).runs
    at = designs_of(runs, page)
    designs = page["designs"]

    for index in range(4):
        own_runs = runs[at == index]
        passed = int(own_runs["passed"].sum())
        assert (designs["runs"][index], designs["passed"][index]) == (len(own_runs), passed)
        low, high = wilson_interval(passed, len(own_runs))
        assert (designs["low"][index], designs["high"][index]) == pytest.approx((low, high), abs=1e-6)
        ends = own_runs["outcome"].value_counts()
        assert [column[index] for column in designs["outcomes"]] == [ends.get(name, 0) for name in OUTCOMES]
    assert page["runs"]["design"] == at.tolist() and len(runs) == 4 * SAMPLES
    assert page["runs"]["environment"] == runs["sample"].tolist()
    assert [OUTCOMES[code] for code in page["runs"]["outcome"]] == runs["outcome"].tolist()
    assert page["runs"]["time_s"] == pytest.approx(runs["elapsed_time_s"].tolist(), abs=1e-3)
    # More runs than the page holds are counted.
    monkeypatch.setattr(module, "MAX_RUNS", 4 * SAMPLES - 1)
    again = read(store)
    assert again["runs"] is None and "12 runs of 4 designs" in again["runs_omitted"]


def test_time_counts_the_limit_and_energy_is_per_pass(store: Path) -> None:
    page, runs = read(store), Study(store).runs
    at = designs_of(runs, page)
    measures = {measure["key"]: measure["value"] for measure in page["designs"]["measures"]}
    labels = [measure["label"] for measure in page["designs"]["measures"]]

    assert labels[:2] == ["time, failures at the limit", "time of passing runs"]

    for index in range(4):
        own_runs = runs[at == index]
        passed = own_runs["passed"].astype(bool)
        time_s = own_runs["elapsed_time_s"].where(passed, 120.0).mean()
        assert measures["time"][index] == pytest.approx(time_s, rel=1e-4)
        passing_s = own_runs["elapsed_time_s"][passed].mean() if passed.any() else None
        assert measures["passing_time"][index] == (None if passing_s is None else pytest.approx(passing_s, rel=1e-4))
        energy = own_runs["consumed_energy_j"].sum() / passed.sum() if passed.any() else None
        assert measures["energy"][index] == (None if energy is None else pytest.approx(energy, rel=1e-4))
    assert all(150 < mass < 500 for mass in measures["mass"][:4])
    assert measures["sheet_area"][2] > measures["sheet_area"][0]  # wider


def test_trials_stand_beside_their_designs_and_aborted_ones_do_not_count(store: Path) -> None:
    page = read(store)
    designs = page["designs"]
    first = page["trials"][0]["design"]

    assert [trial["passed"] for trial in page["trials"]] == [True, False, None, True]
    assert (designs["trials"][first], designs["trials_passed"][first]) == (2, 1)
    unswept = page["trials"][3]["design"]
    assert designs["swept"] == [True] * 4 + [False]
    assert unswept == 4
    # It was simulated now.
    assert (designs["trials"][4], designs["runs"][4]) == (1, 3)
    assert "150 mm" in designs["name"][4]


def test_trials_that_refute_simulation_make_a_design_bad(tmp_path: Path) -> None:
    """Belief is what simulation and trials together say: 1 of 21 trials of seven cars outweighs runs that all passed."""
    path = write_study(
        tmp_path / "s.db", {"width_mm": [95, 245]}, 20,
        lambda design, sample: "passed" if design["width_mm"] == 95 or sample % 2 else "tipped",
    )  # fmt: skip
    write_realities(path, lambda scores, design: 3 * scores["friction"] + (2 if design["width_mm"] == 95 else 0))
    before = read(path)
    trials = [({"width_mm": 95.0}, None, "passed" if number == 0 else "tipped") for number in range(21)]
    import_trials(path, trials, cars=7)

    page = read(path)

    designs, after = before["designs"], page["designs"]
    assert not before["realities"]["driven"] and page["realities"]["driven"]
    # Before trials, the verdict is that of simulation.
    assert designs["rate"][0] == after["rate"][0] == 1.0 and designs["verdict"][0] == "good"
    assert after["belief_high"][0] < 0.5 <= designs["belief_high"][0]
    assert (after["verdict"][0], after["refuted"]) == ("bad", ["optimistic", None])
    # The page and `foldcar compare` name the same.
    with Store.open(path) as opened:
        compared = {design.label: design.verdict for design in compare(opened, "1").experiments[0].designs}
    refuted = {name: how for name, how in zip(after["name"], after["refuted"], strict=True) if how}
    assert refuted == {name: how for name, how in compared.items() if how in ("optimistic", "pessimistic")}


def test_realities_are_drawn_by_their_weights(tmp_path: Path) -> None:
    """Success follows from friction alone: trials that failed leave realities with low friction and low success."""
    path = write_study(tmp_path / "s.db", {"width_mm": [95, 245]}, 20, lambda design, sample: "passed")
    write_realities(path, lambda scores, design: 4 * scores["friction"])
    before = read(path)["realities"]
    import_trials(path, [({"width_mm": 95.0}, None, "tipped")] * 20)
    after = read(path)["realities"]

    for realities in (before, after):
        frictions = [values[realities["names"].index("friction")] for values in realities["values"]]
        rates = [rates[1] for rates in realities["rates"]]
        # An error that no unknown explains is in the rates, too. The correlation of 100 realities has an error of 0.09.
        assert numpy.corrcoef(numpy.log(frictions), rates)[0, 1] > 0.3
    mean_before, mean_after = (numpy.mean(realities["rates"], axis=0) for realities in (before, after))
    assert (mean_after < 0.4 * mean_before).all()
    (unknown,) = (unknown for unknown in after["unknowns"] if unknown["name"] == "friction")
    assert unknown["taught"] and unknown["after"][1] < unknown["before"][1]
    assert before["taught"] == [] and any("friction" in sentence for sentence in after["taught"])
    # The figure for papers draws the same curves.
    with Store.open(path) as opened:
        (experiment,) = read_experiments(opened)
        (axes,) = draw_feasibility(experiment.columns, experiment.thresholds).axes
    curves = next(lines for lines in axes.collections if lines.get_label() == "ways in which reality may differ")
    drawn = [segment[:, 1] / 100 for segment in curves.get_segments()]
    assert numpy.allclose(drawn, after["rates"], atol=6e-4)
    assert "built cars, mean" in axes.get_legend_handles_labels()[1]


def test_a_figure_without_runs_in_other_realities_names_no_built_cars(tmp_path: Path) -> None:
    path = write_study(tmp_path / "s.db", {"width_mm": [95, 180]}, 20, lambda design, sample: "passed")
    with Store.open(path) as opened:
        (experiment,) = read_experiments(opened)
        figure = draw_feasibility(experiment.columns, experiment.thresholds)
    legend_texts = [text.get_text() for text in figure.legends[0].get_texts()]
    assert legend_texts == ["simulation, 95 % band"]


def test_effects_are_of_every_parameter(store: Path) -> None:
    page = read(store)

    assert {effect["parameter"] for effect in page["effects"]} == {0, 1}
    for effect in page["effects"]:
        assert len(effect["grid"]) == len(effect["mean"]) == 2
        assert "same 2 combinations of the other parameters" in effect["over"]
    shares = [row["share"] for row in page["importance"]]
    assert shares == sorted(shares, reverse=True)
    assert page["causes"] == []  # three environments tell nothing


def test_an_experiment_that_has_trials_only_is_shown_with_them(tmp_path: Path) -> None:
    rows = ["vehicle_type,outcome,source,width_mm", "W_B_W,passed,notes,95", "W_B_W,tipped,notes,115", ""]
    (tmp_path / "t.csv").write_text("\n".join(rows))
    foldcar("trials", "import", tmp_path / "s.db", tmp_path / "t.csv", "--experiment", "garden")

    page = read(tmp_path / "s.db")

    assert page["id"] == "garden: W_B_W, trials only"
    assert page["headline"] == "1 of 2 trials of built cars passed; nothing was simulated to compare with."
    assert page["designs"]["name"] == ["95 mm", "115 mm"]
    # Nothing was simulated, so nothing is said of further cars.
    assert page["realities"] is None and page["designs"]["belief"] == page["designs"]["verdict"] == [None, None]
    assert page["designs"]["trials_passed"] == [1, 0]
    assert [trial["design"] for trial in page["trials"]] == [0, 1]
    assert page["runs"]["design"] == []
