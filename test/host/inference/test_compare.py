"""`foldcar compare`: gaps against published examples, verdicts on stores with known rates."""

import csv
import json
import math
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy
import pytest
from typer.testing import CliRunner

from foldcar.cli import app
from foldcar.inference.comparison import _verdict
from foldcar.inference.design_evidence import in_family
from foldcar.inference.resimulation import Resimulation
from foldcar.inference.selecting import select as select_designs
from foldcar.report.page_data import page_data
from foldcar.simulation.carsim import Carsim, CarsimLimits
from foldcar.simulation.runner import RunRequest
from foldcar.statistics.built_cars import BuiltCars
from foldcar.statistics.gap import (
    AGREES,
    OPTIMISTIC,
    PESSIMISTIC,
    TOO_FEW,
    Gap,
    Rates,
    mean_gap,
    pair_correlation,
    rank_agreement,
)
from foldcar.statistics.rate import Rate, wilson_interval
from foldcar.statistics.words import rank_text
from foldcar.store.reader import Store
from foldcar.store.tables import BY_NAME
from foldcar.store.trial_records import Ending, TrialDesign
from foldcar.store.trial_writer import CarFacts, Drive, write_trials
from live_car import write_free_course
from study_car import car_body
from swept_listing import foldcar, json_output, swept
from written_study import add_trial, add_trials, fingerprint, import_trials, write_study

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


def rate(passed: int, number: int) -> Rate:
    return Rate(passed / number, *wilson_interval(passed, number), 0.95, "")


def test_a_gap_is_newcombes_hybrid_score_interval() -> None:
    # Newcombe 1998, Statistics in Medicine 17, 873, table II, method 10: 56/70 against 48/80, 9/10 against 3/10, 0/10.
    for (driven, simulated), (low, high) in {
        ((56, 70), (48, 80)): (0.0524, 0.3339),
        ((9, 10), (3, 10)): (0.1705, 0.8090),
        ((10, 10), (0, 20)): (0.6791, 1.0),
    }.items():
        gap = mean_gap([Rates(rate(*simulated), rate(*driven))])
        assert (gap.low, gap.high) == pytest.approx((low, high), abs=5e-5)
    # Two alike, which err independently: by the root of two less.
    single, double = (mean_gap([Rates(rate(48, 80), rate(56, 70))] * n) for n in (1, 2))
    ends = (
        single.value + (single.low - single.value) / math.sqrt(2),
        single.value + (single.high - single.value) / math.sqrt(2),
    )
    assert (double.value, double.low, double.high) == pytest.approx((single.value, *ends))


@pytest.mark.parametrize(
    ("both", "driven", "simulated", "neither", "ends"),
    [
        # Newcombe 1998, Statistics in Medicine 17, 2635, table I; Bentur 2009 in Fagerland, Lydersen and Laake 2017.
        (36, 12, 2, 0, (0.0569, 0.3404)),
        (1, 1, 7, 12, (-0.507, -0.026)),
    ],
)
def test_a_gap_of_pairs_is_newcombes_for_paired_proportions(
    both: int, driven: int, simulated: int, neither: int, ends: tuple[float, float]
) -> None:
    counts = both, driven, simulated, neither
    y = [passed for passed, number in zip((True, True, False, False), counts, strict=True) for _ in range(number)]
    f = [passed for passed, number in zip((True, False, True, False), counts, strict=True) for _ in range(number)]

    gap = mean_gap([Rates(rate(sum(f), len(f)), rate(sum(y), len(y)), pair_correlation(y, f))])

    assert (gap.low, gap.high) == pytest.approx(ends, abs=5e-4)


def test_trials_that_end_as_simulated_in_hard_environments_do_not_contradict_simulation(tmp_path: Path) -> None:
    """Of 100 environments 56 pass at 180 mm; the driven ones are 3 of these and 9 of the others."""
    store = write_study(tmp_path / "s.db", WIDTHS, 100, passing(SIMULATED))
    met = [*range(53, 56), *range(60, 69)]
    import_trials(store, [({"width_mm": 180.0}, k, "passed" if k < 56 else "stuck") for k in met], cars=12)

    (experiment,) = compare(store)["experiments"]
    (design,) = experiment["designs"]

    assert design["gap_is_paired"] and design["gap"]["value"] == pytest.approx(0) and design["verdict"] == TOO_FEW
    assert "in the same environments, on average over 1 design, trials pass 0 points more often" in experiment["sentence"]
    assert experiment["sentence"].endswith("12 of 12 trials ended as simulated in the same environment.")


def test_the_mean_of_gaps_covers() -> None:
    random = numpy.random.default_rng(3)
    truth = [(0.3, 0.4), (0.9, 0.8), (0.5, 0.2)]
    covering = 0
    for _ in range(200):
        f = [rate(random.binomial(100, p), 100) for p, _ in truth]
        y = [rate(random.binomial(12, p), 12) for _, p in truth]
        gap = mean_gap([Rates(*pair) for pair in zip(f, y, strict=True)])
        covering += gap.low <= -0.1 <= gap.high
    # 95 % of 200, less three standard deviations.
    assert covering >= 180


def test_verdicts_are_those_of_the_interval() -> None:
    for low, high, verdict in (
        (-0.1, 0.1, AGREES),
        (-0.1, -0.01, AGREES),
        (-0.3, -0.01, OPTIMISTIC),
        (0.01, 0.3, PESSIMISTIC),
        (-0.2, 0.1, TOO_FEW),
    ):
        assert Gap((low + high) / 2, low, high, 0.95).verdict(0.15) == verdict


def test_ranks_are_told_as_far_as_they_are_defined() -> None:
    # The published table: only 95 and 115 mm, equal in simulation, differ otherwise: by 70 - 25 %, which counts for one.
    published = rank_agreement([0.07, 1.0, 1.0, 0.56], [0.0, 0.7, 0.25, 0.0])
    assert published.mmrv == pytest.approx(0.45 / 4)
    assert rank_text(None) is rank_text(rank_agreement([0.1], [0.1])) is None
    # Each of the two is violated by 80 - 30 %.
    assert rank_text(rank_agreement([0.1, 0.9], [0.8, 0.3])) == "Over 2 designs: mean maximum rank violation 0.50."


@pytest.mark.parametrize(("labels", "mean_high", "verdict"), [
    ((AGREES, AGREES), 0.1, AGREES), ((AGREES, TOO_FEW), 0.1, TOO_FEW), ((AGREES, AGREES), 0.2, TOO_FEW),
])  # fmt: skip
def test_simulation_agrees_if_all_designs_and_their_mean_do(labels: Any, mean_high: float, verdict: str) -> None:
    compared: Any = [
        SimpleNamespace(verdict=label, label="65 mm", gap=0, gap_is_paired=False, paired=0, agreeing=0)
        for label in labels
    ]

    result, sentence = _verdict(compared, Gap(0.02, -0.1, mean_high, 0.95), 0.15, "simulation")

    assert result == verdict and sentence.startswith("Simulation and trials agree within 15 points at 65 ")


def test_the_published_table_says_that_simulation_is_optimistic(tmp_path: Path) -> None:
    """The simulated runs and the published trials, whose environments nobody knows."""
    store = write_study(tmp_path / "s.db", WIDTHS, 100, passing(SIMULATED), build="0123456789abcdef")
    for width, (passed, number) in PUBLISHED.items():
        trials = [({"width_mm": width}, 100 + k, "passed" if k < passed else "not_passed") for k in range(number)]
        import_trials(store, [(design, None, outcome) for design, _, outcome in trials])

    whole = compare(store, "--csv", tmp_path / "gaps.csv")
    (experiment,) = whole["experiments"]

    assert whole["trials_alone"] == []
    designs = {design["design"]["width_mm"]: design for design in experiment["designs"]}
    verdicts = {width: design["verdict"] for width, design in designs.items()}
    # Of one car each: less than the same trials of several would tell.
    assert verdicts == {65: TOO_FEW, 95: OPTIMISTIC, 115: OPTIMISTIC, 180: TOO_FEW}
    assert experiment["ranks"]["mmrv"] == pytest.approx(0.45 / 4)
    assert experiment["mean_gap"]["value"] == pytest.approx((-7 - 30 - 75 - 56) / 400)
    assert "optimistic at 95 and 115 mm; too few cars or trials to say at 65 and 180 mm" in experiment["sentence"]
    assert "over 4 designs, trials pass 42 points less often than simulation" in experiment["sentence"]
    # Simulation and the neighbours tell something of 65 mm.
    assert designs[65]["pooled"]["high"] < designs[65]["driven"]["high"]
    remarks = " ".join(experiment["remarks"])
    assert "44 of 44 trials cannot be paired" in remarks
    with (tmp_path / "gaps.csv").open() as text:
        rows = list(csv.DictReader(text))
    assert list(rows[0])[:3] == ["experiment", "vehicle_type", "width_mm"]
    assert [float(row["gap"]) for row in rows] == pytest.approx([-0.07, -0.3, -0.75, -0.56])
    # Bonferroni: each of four gaps and their mean is one of 99 %; shown rates are each of 95 %.
    for design in experiment["designs"]:
        width = design["design"]["width_mm"]
        (passed, number), runs_passed = PUBLISHED[width], SIMULATED[width]
        car, y, f = BuiltCars.of_one_car(passed, number).rate(0.99), passed / number, runs_passed / 100
        f_low, f_high = wilson_interval(runs_passed, 100, 0.99)
        low, high = y - f - math.hypot(y - car.low, f_high - f), y - f + math.hypot(car.high - y, f - f_low)
        assert (design["gap"]["low"], design["gap"]["high"]) == pytest.approx((max(-1, low), min(1, high)), abs=1e-4)
        # Of the car that drove, and of a further one.
        assert (design["driven"]["low"], design["driven"]["high"]) == pytest.approx(wilson_interval(passed, number))
        assert (
            design["further_car"]["low"] <= design["driven"]["low"]
            and design["driven"]["high"] < design["further_car"]["high"]
        )
        assert design["cars"] == 1 and f"{number} trials of 1 car" in design["further_car"]["method"]


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
    assert [(design["trials"], design["trials_passed"]) for design in simulated["designs"]] == [(5, 5)]
    assert "SIMULATED trials" in simulated["remarks"][0] and "18 trials of built cars left out" in simulated["remarks"][0]


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
        (selected,) = select_designs(opened, with_cost=False)
        (shown,) = page_data(opened)["experiments"]

    assert [(design["design"]["width_mm"], design["trials"]) for design in compared["designs"]] == [(115.0, 3)]
    assert sum(shown["designs"]["trials"]) == 3
    left_out = "6 trials left out: driven in other samples of step_pyramids.scenic than the runs"
    assert all(left_out in " ".join(remarks) for remarks in (compared["remarks"], shown["remarks"], selected.remarks))


@pytest.fixture(scope="module")
def free_course(tmp_path_factory: pytest.TempPathFactory, carsim_binary: Path) -> Path:
    """A swept study of two widths in two environments without obstacles, which all runs pass."""
    listing = write_free_course(tmp_path_factory.mktemp("free"))
    swept(listing, listing.parent / "s.db", carsim_binary, 1)
    return listing.parent / "s.db"


def test_what_the_sweep_lacks_is_simulated_as_it_was_placed(tmp_path: Path, free_course: Path) -> None:
    free_course = Path(shutil.copy(free_course, tmp_path))
    with Store.open(free_course) as opened:
        drawn = next(opened.rows(BY_NAME["body"], "WHERE id = 1")), next(opened.rows(BY_NAME["settings"], "WHERE id = 1"))
        scene = json.loads(next(opened.rows(BY_NAME["scene"], "WHERE id = 1"))["json"])
        design = dict(opened.designs("1")[0])
        print_of = next(opened.rows(BY_NAME["environment"]))["fingerprint"]
    body, settings = (json.loads(row["json"]) for row in drawn)
    # Turned away from the goal, the car cannot pass.
    turned = {**scene, "start": {**scene["start"], "heading_rad": scene["start"]["heading_rad"] + 3.0}}
    with write_trials(free_course) as writer:
        drive = Drive(body, settings, turned, print_of, "free.scenic", 0)
        facts = CarFacts("fw", "hash", "/dev/null", "built")
        number = writer.begin("1", TrialDesign("W_B_W", design), drive, {"car": (0, 0, 3.0)}, facts, "log", "Ada")
        writer.complete(number, Ending("timeout", "time limit", 3.0, "", None))
        other = {"experiment": "1", "vehicle_type": "W_B_W", "outcome": "passed", "source": "x", "car": "built"}
        for changed in ({"width_mm": 100.0}, {"wit_mm": 3.0}, {"width_mm": 10.0}):
            writer.import_trials([{**other, "uuid": str(changed), "design": {**design, **changed}}])

    (experiment,) = compare(free_course)["experiments"]

    as_swept, new, *cannot = experiment["designs"]
    assert (as_swept["simulated"]["value"], as_swept["paired"], as_swept["agreeing"]) == (1.0, 1, 1)
    assert (new["design"]["width_mm"], new["swept"], new["runs"], new["simulated"]["value"]) == (100, False, 2, 1.0)
    assert any("simulated again as placed" in remark for remark in experiment["remarks"])
    assert any(
        "100 mm is not in the sweep: it was simulated now, in 2 environments" in remark
        for remark in experiment["remarks"]
    )
    assert [(design["runs"], design["simulated"], design["gap"]) for design in cannot] == [(0, None, None)] * 2
    narrow, unknown = (remark for remark in experiment["remarks"] if "cannot be simulated now" in remark)
    assert unknown.endswith("cannot be simulated now: no module has the parameter wit_mm.")
    assert "width" in narrow.partition("cannot be simulated now: ")[2]


def test_of_many_designs_that_the_sweep_lacks_a_bounded_number_is_simulated(
    tmp_path: Path, free_course: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = Path(shutil.copy(free_course, tmp_path))
    with Store.open(store) as opened:
        design = dict(opened.designs("1")[0])
    other = {"experiment": "1", "vehicle_type": "W_B_W", "outcome": "passed", "source": "x", "car": "built"}
    widths = [*(90.0 + k for k in range(11) if k != 5), 97.0]
    with write_trials(store) as writer:
        trials = [{**other, "uuid": str(at), "design": {**design, "width_mm": width}} for at, width in enumerate(widths)]
        writer.import_trials(trials)
    made = []
    run = Carsim.run
    monkeypatch.setattr(Carsim, "run", lambda *words: made.append(words) or run(*words))
    monkeypatch.setattr("foldcar.inference.resimulation.MAX_RUNS", 4)

    (experiment,) = compare(store)["experiments"]

    runs = {design["design"]["width_mm"]: design["runs"] for design in experiment["designs"] if not design["swept"]}
    assert list(runs) == widths[:-1] and len(made) == 2
    # The one with most trials, and the first of the rest.
    assert {width for width, number in runs.items() if number} == {97.0, 90.0}
    assert "97 mm is not in the sweep: it was simulated now, in 2 environments." in experiment["remarks"]
    many = "91 mm, 92 mm, 93 mm, 94 mm, 96 mm and 3 further designs are not in the sweep, and cannot be simulated now: "
    assert any(remark == f"{many}no more than 4 runs are made at a time; sweep it." for remark in experiment["remarks"])


def test_of_more_designs_than_can_be_pooled_the_rest_are_compared_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = write_study(tmp_path / "s.db", WIDTHS, 100, passing(SIMULATED))
    add_trials(store, [({"width_mm": width}, k, "passed") for width in WIDTHS["width_mm"] for k in range(4)])
    (pooled,) = compare(store)["experiments"]
    monkeypatch.setattr("foldcar.inference.belief.MAX_POOLED", 3)
    (alone,) = compare(store)["experiments"]

    changed = [a["pooled"] != b["pooled"] for a, b in zip(pooled["designs"], alone["designs"], strict=True)]
    assert any(changed)
    assert all(design["gap"] is not None for design in alone["designs"] if design["trials"])
    assert pooled["mean_gap"] == alone["mean_gap"]


def test_what_is_simulated_now_is_the_car_as_it_varied_then(carsim_limits: CarsimLimits) -> None:
    body = car_body()
    simulated: list[Any] = []

    def answers(bodies: dict[str, str], scenes: dict[str, str], requests: list[RunRequest]) -> list[dict[str, Any]]:
        simulated.extend((json.loads(bodies[request.body]), scenes[request.scene]) for request in requests)
        return [{"outcome": "passed", "elapsed_time_s": 2.0}, {"error": "no"}]

    carsim: Any = SimpleNamespace(limits=lambda: carsim_limits, run=answers, build="a build of this test")
    unread: Any = None

    ended = Resimulation(unread)._run(carsim, json.dumps(body), [({}, "as drawn"), ({"mass": 0.1}, "heavier")], "{}")

    assert ended == [("passed", 2.0), ("failed", None)]
    # What was run once is not run again.
    assert Resimulation(unread)._run(carsim, json.dumps(body), [({}, "as drawn")], "{}") == ended[:1]
    (drawn, first), (heavier, second) = simulated
    assert (drawn, first, second) == (body, "as drawn", "heavier")
    assert heavier["segments"][0]["mass_kg"] == pytest.approx(1.1 * body["segments"][0]["mass_kg"])


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
    "all failed": ([({"width_mm": width}, k, "stuck") for width in (65.0, 95.0) for k in range(6)], "optimistic at 95"),
    "an unknown design": ([({"width_mm": 300.0, "depth_mm": 3.0}, 1, "passed")], "no design has both runs and trials"),
}


@pytest.mark.parametrize("kind", STORES)
def test_odd_trials_get_a_plain_sentence(tmp_path: Path, kind: str) -> None:
    trials, sentence = STORES[kind]
    store = write_study(tmp_path / "s.db", WIDTHS, 20, passing({65.0: 1, 95.0: 20, 115.0: 20, 180.0: 10}))
    if trials:
        add_trials(store, trials)

    text = plain(store)
    assert sentence in text
    assert kind != "all failed" or "points less often" in text


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
