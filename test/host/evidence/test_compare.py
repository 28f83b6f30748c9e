"""`foldcar compare`: verdicts and sentences on stores with known rates."""

import csv
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from typer.testing import CliRunner

from foldcar.api.study import Study
from foldcar.cli import app
from foldcar.errors import FoldcarError
from foldcar.evidence.comparison import _verdict
from foldcar.evidence.design_evidence import in_family
from foldcar.evidence.selecting import select as select_designs
from foldcar.report.page_data import page_data
from foldcar.statistics.gap import (
    AGREES,
    OPTIMISTIC,
    TOO_FEW,
    Gap,
)
from foldcar.statistics.rate import wilson_interval
from foldcar.store.reader import Store
from foldcar.store.trial_writer import write_trials
from swept_listing import foldcar, json_output
from written_study import SETTINGS, add_trial, add_trials, fingerprint, import_trials, write_realities, write_study

WIDTHS = {"width_mm": [65.0, 95.0, 115.0, 180.0]}
# Percent passed in simulation; trials passed and all, of the published table.
SIMULATED = {65.0: 7, 95.0: 100, 115.0: 100, 180.0: 56}
PUBLISHED = {65.0: (0, 10), 95.0: (7, 10), 115.0: (3, 12), 180.0: (0, 12)}


def compare(*words: Any) -> dict[str, Any]:
    return json_output("compare", *words)


def plain(store: Path) -> str:
    text = " ".join(foldcar("compare", store).split())
    assert "nan" not in text.lower()
    return text


def passing(percent: Mapping[float, int]) -> Callable[[Mapping[str, float], int], str]:
    """An outcome of runs by width: environments are the harder the higher their number."""
    return lambda design, sample: "passed" if sample < percent[design["width_mm"]] else "tipped"


def as_published(scores: Mapping[str, float], design: Mapping[str, float]) -> float:
    """Log-odds of the nominal rates, which fall with the obstacles' height."""
    rate = min(max(SIMULATED[design["width_mm"]] / 100, 0.01), 0.99)
    return math.log(rate / (1 - rate)) - 2.5 * scores["obstacle_height"]


def test_trials_that_end_as_simulated_in_hard_environments_are_counted_as_agreeing(tmp_path: Path) -> None:
    """Of 100 environments 56 pass at 180 mm; the driven ones are 3 of these and 9 of the others."""
    store = write_study(tmp_path / "s.db", WIDTHS, 100, passing(SIMULATED))
    write_realities(store, as_published)
    met = [*range(53, 56), *range(60, 69)]
    import_trials(store, [({"width_mm": 180.0}, k, "passed" if k < 56 else "stuck") for k in met], cars=12)

    (experiment,) = compare(store)["experiments"]

    assert experiment["designs"][0]["agreeing"] == experiment["designs"][0]["paired"] == 12
    assert "12 of 12 trials ended as simulated in the same environment" in experiment["sentence"]


@pytest.mark.parametrize(("labels", "mean_high", "verdict"), [
    ((AGREES, AGREES), 0.1, AGREES), ((AGREES, TOO_FEW), 0.1, TOO_FEW), ((AGREES, AGREES), 0.2, TOO_FEW),
])  # fmt: skip
def test_simulation_agrees_if_all_designs_and_their_mean_do(labels: Any, mean_high: float, verdict: str) -> None:
    compared: Any = [SimpleNamespace(verdict=label, label="65 mm", gap=0, paired=0, agreeing=0) for label in labels]

    result, sentence = _verdict(compared, Gap(0.02, -0.1, mean_high, 0.95), 0.15, "simulation")

    assert result == verdict and sentence.startswith("Simulation and trials agree within 15 points at 65 ")
    assert "built cars pass 2 points more often than simulation" in sentence
    _, sentence = _verdict(compared, Gap(-0.004, -0.1, mean_high, 0.95), 0.15, "simulation")
    assert "built cars pass as often as simulation" in sentence


def test_the_published_table_says_that_simulation_is_optimistic(tmp_path: Path) -> None:
    """The simulated runs and the published trials, whose environments nobody knows."""
    store = write_study(tmp_path / "s.db", WIDTHS, 100, passing(SIMULATED), build="build-7")
    write_realities(store, as_published)
    for width, (passed, number) in PUBLISHED.items():
        trials = [({"width_mm": width}, 100 + k, "passed" if k < passed else "not_passed") for k in range(number)]
        import_trials(store, [(design, None, outcome) for design, _, outcome in trials])

    whole = compare(store, "--csv", tmp_path / "gaps.csv")
    (experiment,) = whole["experiments"]

    assert whole["trials_alone"] == []
    designs = {design["design"]["width_mm"]: design for design in experiment["designs"]}
    verdicts = {width: design["verdict"] for width, design in designs.items()}
    assert (verdicts[115.0], verdicts[180.0]) == (OPTIMISTIC, OPTIMISTIC)
    assert experiment["ranks"]["mmrv"] == pytest.approx(0.45 / 4)
    assert experiment["mean_gap"]["high"] < 0
    assert "optimistic at " in experiment["sentence"]
    assert "44 of 44 trials cannot be paired" in " ".join(experiment["remarks"])
    with (tmp_path / "gaps.csv").open() as text:
        rows = list(csv.DictReader(text))
    assert list(rows[0])[:3] == ["experiment", "vehicle_type", "width_mm"]
    for row, design in zip(rows, experiment["designs"], strict=True):
        passed, number = PUBLISHED[design["design"]["width_mm"]]
        simulated = SIMULATED[design["design"]["width_mm"]] / 100
        assert (design["driven"]["low"], design["driven"]["high"]) == pytest.approx(wilson_interval(passed, number))
        assert design["gap"]["value"] == pytest.approx(design["built"]["value"] - simulated, abs=0.02)
        assert float(row["gap"]) == pytest.approx(design["gap"]["value"])
    height = next(unknown for unknown in experiment["unknowns"] if unknown["name"] == "obstacle_height")
    # Obstacles that are higher than simulated explain the trials.
    assert height["after"]["value"] > 1.1 > height["before"]["value"]
    assert "obstacle_height" in foldcar("compare", store)


def test_without_realities_only_counts_are_compared(tmp_path: Path) -> None:
    store = write_study(tmp_path / "s.db", WIDTHS, 100, passing(SIMULATED), no_realities="they were left out")
    import_trials(store, [({"width_mm": 95.0}, None, "stuck")] * 10)

    (experiment,) = compare(store)["experiments"]

    assert experiment["sentence"] == (
        "Passed: 0 of 10 trials at 95 mm (100 of 100 runs). Nothing is said of built cars: they were left out."
    )
    assert (experiment["verdict"], experiment["designs"][0]["gap"], experiment["unknowns"]) == (None, None, [])


def test_only_built_cars_count_each_beside_its_run(tmp_path: Path) -> None:
    store = write_study(tmp_path / "s.db", WIDTHS, 100, passing(SIMULATED))
    design = {"width_mm": 180.0}
    met = [*range(50, 56), *range(60, 70)]
    add_trials(store, [(design, k, "passed" if k < 56 else "stuck") for k in met])
    for car in ("simulated", None):
        add_trials(store, [(design, k, "passed") for k in range(5)], car=car)
    add_trial(store, design, 1, "aborted")
    add_trial(store, design, 0, "passed", environment="elsewhere", program="hills.scenic")

    (experiment,) = compare(store)["experiments"]
    (built_design,) = experiment["designs"]

    assert (
        built_design["trials"],
        built_design["trials_passed"],
        built_design["paired"],
        built_design["agreeing"],
        built_design["aborted"],
    ) == (16, 6, 16, 16, 1)
    remarks = " ".join(experiment["remarks"])
    assert "5 of a simulated car" in remarks and "5 of a car that may be" in remarks
    assert "1 trial left out: driven in hills.scenic" in remarks
    (simulated,) = compare(store, "--simulated-trials")["experiments"]
    assert [(design["trials"], design["trials_passed"]) for design in simulated["designs"]] == [(21, 11)]
    assert "SIMULATED cars drove 5 of 23 trials." in simulated["remarks"]


def test_a_program_named_by_its_absolute_path_is_the_same_program(tmp_path: Path) -> None:
    program = str(tmp_path / "step_pyramids.scenic")
    store = write_study(tmp_path / "s.db", WIDTHS, 100, passing(SIMULATED), scenic_program=program)
    import_trials(store, [({"width_mm": 95.0}, None, "passed")])
    # The listing names it by its relative path again.
    write_study(store, WIDTHS, 100, passing(SIMULATED))

    (experiment,) = compare(store)["experiments"]

    assert [design["trials"] for design in experiment["designs"]] == [1]
    assert not any("left out" in remark for remark in experiment["remarks"])


@pytest.mark.parametrize(
    ("options", "difference"),
    [
        ({"settings": {**SETTINGS, "speed_m_s": 0.05}}, "speed 0.05 m/s, not 0.3 m/s"),
        ({"settings": {**SETTINGS, "yaw_rate_rad_s": 0.1}}, "turn rate 0.1 rad/s, not 0 rad/s"),
        ({"settings": {**SETTINGS, "time_limit_s": 10}, "elapsed_time_s": 11.0}, "time limit 10 s, not 120 s"),
        ({"settings": {**SETTINGS, "time_limit_s": 300}, "elapsed_time_s": 150.0}, "time limit 300 s, not 120 s"),
        ({"mass_kg": 0.25}, "another body: segments.0.mass_kg 0.25, not 0.2"),
        (
            {"mass_kg": 0.25, "settings": {**SETTINGS, "speed_m_s": 0.1}},
            "speed 0.1 m/s, not 0.3 m/s; another body: segments.0.mass_kg 0.25, not 0.2",
        ),
        # These were driven alike: ended within both limits, a rounding error.
        ({"settings": {**SETTINGS, "time_limit_s": 20}}, None),
        ({"settings": {**SETTINGS, "time_limit_s": 10}, "elapsed_time_s": 10.02}, None),
        ({"settings": {**SETTINGS, "time_limit_s": 300}}, None),
        ({"mass_kg": 0.2 * (1 + 1e-9)}, None),
    ],
)
def test_trials_of_another_drive_are_left_out_and_named(
    tmp_path: Path, options: Mapping[str, Any], difference: str | None
) -> None:
    store = write_study(tmp_path / "s.db", WIDTHS, 100, passing(SIMULATED), speed_m_s=0.3)
    design = {"width_mm": 180.0}
    add_trials(store, [(design, k, "passed") for k in range(4)])
    add_trials(store, [(design, k, "passed") for k in range(4, 7)], **options)

    for shown in (compare(store), json_output("select", store)):
        (experiment,) = shown["experiments"]
        remark = f"3 trials left out, not driven as the runs: {difference}."
        assert (remark in experiment["remarks"]) == (difference is not None)
        assert not any("not driven as the runs" in text and text != remark for text in experiment["remarks"])
    (compared,) = compare(store)["experiments"]
    counted = 7 if difference is None else 4
    assert [row["trials"] for row in compared["designs"]] == [counted]
    study = Study(store)
    rate = study.rate(source="trials", width_mm=180)
    assert f"{counted} of {counted} trials of 1 built car that passed" in rate.method
    assert ("3 trials left out, not driven as the runs" in rate.method) == (difference is not None)
    assert study.trials["unlike_runs"].dropna().tolist() == ([] if difference is None else [difference] * 3)


@pytest.mark.parametrize(
    ("outcome", "options"), [("passed", {"settings": {**SETTINGS, "speed_m_s": 0.05}}), ("aborted", {})]
)
def test_trials_that_do_not_count_are_not_called_absent(tmp_path: Path, outcome: str, options: Mapping[str, Any]) -> None:
    store = write_study(tmp_path / "s.db", WIDTHS, 20, passing(SIMULATED), speed_m_s=0.3)
    write_realities(store, as_published)
    add_trials(store, [({"width_mm": 180.0}, k, outcome) for k in range(3)], **options)

    (compared,) = compare(store)["experiments"]
    (selected,) = json_output("select", store)["experiments"]

    with pytest.raises(FoldcarError, match=r"not driven as the runs: speed|has no trials of built cars that count"):
        Study(store).rate(source="trials", width_mm=180)
    assert compared["sentence"].startswith("Nothing to compare: no trial counts yet.")
    assert "a guess from simulation: no trial counts yet." in selected["works"]


def test_a_trial_that_timed_out_under_a_shorter_limit_says_nothing_of_a_longer_one(tmp_path: Path) -> None:
    store = write_study(tmp_path / "s.db", WIDTHS, 100, passing(SIMULATED), speed_m_s=0.3)
    design = {"width_mm": 180.0}
    short = {**SETTINGS, "time_limit_s": 20}
    add_trials(store, [(design, 0, "tipped")], settings=short)
    add_trials(store, [(design, 1, "timeout")], settings=short, elapsed_time_s=20.0)
    import_trials(store, [(design, 2, "passed")])

    (experiment,) = compare(store)["experiments"]

    # An imported trial does not say how it was driven: it counts.
    assert [(row["trials"], row["trials_passed"]) for row in experiment["designs"]] == [(2, 1)]
    assert "1 trial left out, not driven as the runs: time limit 20 s, not 120 s." in experiment["remarks"]


def test_an_exported_trial_that_passed_as_its_time_ended_comes_back_and_one_of_another_limit_is_left_out(
    tmp_path: Path,
) -> None:
    """The firmware stops at the first step after the limit, and a person may say then that the car has passed."""
    driven = write_study(tmp_path / "driven.db", WIDTHS, 100, passing(SIMULATED))
    design = {"width_mm": 180.0}
    add_trials(driven, [(design, 0, "passed")], settings=SETTINGS, elapsed_time_s=120.02)
    add_trials(driven, [(design, 1, "timeout")], settings=SETTINGS, elapsed_time_s=120.02)
    longer = {**SETTINGS, "time_limit_s": 300}
    add_trials(driven, [(design, 2, "passed")], settings=longer, elapsed_time_s=150.0)
    shorter = {**SETTINGS, "time_limit_s": 20}
    add_trials(driven, [(design, 3, "timeout")], settings=shorter, elapsed_time_s=20.02)
    store, table = write_study(tmp_path / "s.db", WIDTHS, 100, passing(SIMULATED)), tmp_path / "t.csv"

    for words in (["export", driven, "--trials", table], ["trials", "import", store, table]):
        assert CliRunner().invoke(app, list(map(str, words))).exit_code == 0

    (experiment,) = compare(store)["experiments"]
    assert [(row["trials"], row["trials_passed"]) for row in experiment["designs"]] == [(2, 1)]
    differences = "time limit 300 s, not 120 s; time limit 20 s, not 120 s"
    assert f"2 trials left out, not driven as the runs: {differences}." in experiment["remarks"]


def test_a_trial_whose_time_contradicts_its_own_limit_is_left_out(tmp_path: Path) -> None:
    """A store of others may hold a correction that foldcar refuses."""
    store = write_study(tmp_path / "s.db", WIDTHS, 100, passing(SIMULATED))
    add_trials(store, [({"width_mm": 180.0}, 0, "passed")], settings=SETTINGS, elapsed_time_s=200.0)
    add_trials(store, [({"width_mm": 180.0}, 1, "passed")], settings=SETTINGS, elapsed_time_s=120.0)

    (experiment,) = compare(store)["experiments"]

    assert [(row["trials"], row["trials_passed"]) for row in experiment["designs"]] == [(1, 1)]
    left_out = "1 trial left out, not driven as the runs: passed after 200 s, above the time limit of 120 s."
    assert left_out in experiment["remarks"]


def test_an_imported_trial_that_passed_after_the_time_limit_is_refused(tmp_path: Path) -> None:
    store = write_study(tmp_path / "s.db", WIDTHS, 100, passing(SIMULATED))
    table = tmp_path / "t.csv"
    table.write_text("experiment,vehicle_type,outcome,source,width_mm,elapsed_time_s\n1,W_B_W,passed,notes,95,130\n")

    done = CliRunner().invoke(app, ["trials", "import", str(store), str(table)])

    message = "line 2: elapsed_time_s: 130 is above the time limit of 120 s, so the trial has not passed"
    assert str(done.exception) == f"{table}: {message}"
    with Store.open(store) as opened:
        assert not list(opened.trials())


def test_imported_samples_are_of_the_environment_that_the_store_had(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def paired(store: Path) -> tuple[int, str]:
        (experiment,) = compare(store)["experiments"]
        return sum(design["paired"] for design in experiment["designs"]), " ".join(experiment["remarks"])

    def write(store: Path) -> Path:
        return write_study(store, {"width_mm": [95.0, 180.0]}, 20, passing({95.0: 90, 180.0: 50}))

    trials = [({"width_mm": 180.0}, sample, "passed") for sample in (3, 4)]
    known = write(tmp_path / "known.db")
    import_trials(known, trials)
    unknown = tmp_path / "unknown.db"
    import_trials(unknown, trials)
    write(unknown)

    assert paired(known)[0] == 2
    assert paired(unknown)[0] == 0 and "2 of 2 trials cannot be paired" in paired(unknown)[1]
    # The listing's environment of that name changes: samples 3 and 4 are others now.
    monkeypatch.setattr("written_study.fingerprint", lambda experiment: "another environment")
    number, remarks = paired(write(known))
    assert number == 0
    assert "2 trials left out: driven in other samples of step_pyramids.scenic than the runs" in remarks


def test_trials_in_other_samples_of_a_program_of_that_name_count_nowhere(tmp_path: Path) -> None:
    store = write_study(tmp_path / "s.db", WIDTHS, 20, passing(dict.fromkeys(SIMULATED, 10)))
    add_trials(store, [({"width_mm": 95.0}, k, "passed") for k in range(6)], environment="as it was in May")
    # The text of the program has changed since, its scenes have not.
    same = [({"width_mm": 115.0}, k, "passed") for k in range(3)]
    add_trials(store, same, environment="with another comment", scenes_of=fingerprint("1"))

    (compared,) = compare(store)["experiments"]
    with Store.open(store) as opened:
        (selected,) = select_designs(opened)
        (shown,) = page_data(opened)["experiments"]

    assert [(design["design"]["width_mm"], design["trials"]) for design in compared["designs"]] == [(115.0, 3)]
    assert sum(shown["designs"]["trials"]) == 3
    left_out = "6 trials left out: driven in other samples of step_pyramids.scenic than the runs"
    assert all(left_out in " ".join(remarks) for remarks in (compared["remarks"], shown["remarks"], selected.remarks))


def test_a_design_of_the_family_differs_in_what_varies_only() -> None:
    info: Any = SimpleNamespace(vehicle_type="W_B_W", fixed={"height_mm": 50.0}, varied={"width_mm": (65.0, 95.0)})

    def belongs(design: dict[str, float], vehicle_type: str = "W_B_W") -> bool:
        return in_family(info, vehicle_type, design)

    assert belongs({"width_mm": 300.0, "height_mm": 50.0})
    assert not belongs({"width_mm": 65.0, "height_mm": 50.0}, "W_B_H_W_H_W")
    assert not belongs({"width_mm": 65.0, "height_mm": 60.0})
    assert not belongs({"width_mm": 65.0})
    assert not belongs({"height_mm": 50.0})
    assert not belongs({"width_mm": 65.0, "height_mm": 50.0, "depth_mm": 3.0})


ONE = ({"width_mm": 95.0}, 3, "passed")
STORES: dict[str, tuple[list[tuple[Mapping[str, float], int, str]], str]] = {
    "no trials": ([], "no trials of built cars yet"),
    "all failed": ([({"width_mm": width}, k, "stuck") for width in (65.0, 95.0) for k in range(6)], "optimistic at "),
    "an unknown design": ([({"width_mm": 300.0, "depth_mm": 3.0}, 1, "passed")], "no design has both runs and trials"),
}


@pytest.mark.parametrize("kind", STORES)
def test_odd_trials_get_a_plain_sentence(tmp_path: Path, kind: str) -> None:
    trials, sentence = STORES[kind]
    store = write_study(tmp_path / "s.db", WIDTHS, 20, passing({65.0: 1, 95.0: 20, 115.0: 20, 180.0: 10}))
    write_realities(store, as_published)
    if trials:
        add_trials(store, trials)

    text = plain(store)
    assert sentence in text
    assert kind != "all failed" or "points less often" in text


def test_engines_have_their_own_builds_and_may_be_compared(tmp_path: Path) -> None:
    path = tmp_path / "s.db"
    write_study(path, WIDTHS, 5, passing(SIMULATED))
    write_study(path, WIDTHS, 5, passing(SIMULATED), experiment="1 (MuJoCo)", build="mujoco-8", engine="mujoco")
    assert "Experiment 1 (MuJoCo)" in plain(path) and "builds of carsim" not in plain(path)


def test_odd_stores_get_a_plain_sentence(tmp_path: Path) -> None:
    path = tmp_path / "s.db"
    add_trials(path, [ONE])
    assert "the store has no runs yet" in plain(path)
    assert "Experiment 1 was not swept: 1 trial without runs" in plain(path)

    undefined = {"success_defined": False, "success_rule": "success is undefined"}
    write_study(path, WIDTHS, 5, passing(SIMULATED), **undefined)
    assert "success is undefined" in plain(path)

    write_study(path, WIDTHS, 5, passing(SIMULATED), experiment="2", build="build-8")
    write_study(path, WIDTHS, 5, passing(SIMULATED))
    with write_trials(path) as writer:
        writer.correct(1, {"outcome": "tipped"}, "seen", "Ada")
        writer.correct(1, {"outcome": "passed"}, "no", "Bo")
    text = plain(path)
    assert "simulated by 2 builds of carsim" in text
    assert "1 trial corrected afterwards: the latest correction counts" in text
    answer = CliRunner().invoke(app, ["compare", str(path), "--experiment", "7"])
    assert 'has no experiment "7"' in str(answer.exception)
    answer = CliRunner().invoke(app, ["compare", str(path), "--margin", "0.1"])
    assert "--margin" in str(answer.exception) and "15pp" in str(answer.exception)
