"""`foldcar optimize`: finds what a sweep finds, resumes, judges the best in environments where nothing was chosen."""

import json
import math
import random
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import permutations
from pathlib import Path
from typing import Any

import pytest
import shapely

import foldcar
from conftest import STEP_PYRAMIDS
from foldcar.car.design import compose
from foldcar.car.folded.weight import film_area_cm2
from foldcar.car.folded_car import folded_car
from foldcar.car.proof.check_film import flat_polygons
from foldcar.simulation.carsim import Carsim
from foldcar.statistics.stopping import evidence_of_worse
from foldcar.store.reader import Store
from foldcar.study.experiments import read_study
from foldcar.study.search.design_simulator import RunRow
from foldcar.study.search.objectives import OBJECTIVES
from foldcar.study.search.proposals import Proposals
from foldcar.study.search.search import Plan, SearchResult, search, searched_study

Command = Callable[..., "subprocess.CompletedProcess[str]"]
# One of the six cars cannot be built: its wheels would touch.
LISTING = {
    "experiments": {"1": {"veh_id": 1, "env_id": 1, "params": {"environments": 3, "timeout": 30}}},
    "vehicles": {
        "1": {
            "type": "W_B_W",
            "params": [{"common": {"width": [65, 95, 125], "radius": [48, 72]}}, {"B": {"length": [80]}}],
        }
    },
    "environments": {"1": {"scenic_filename": str(STEP_PYRAMIDS), "seed": 7, "scenic_params": {"step_height": 0.024}}},
}
# Scenic runs beside the simulation for `require always`.
BESIDE = "model foldcar.scenes.vocabulary.model\nego = new Robot\nnew Goal at (0, 1)\nrequire always ego.position.x < 9\n"
SPACE = {
    **LISTING,
    "vehicles": {"1": {"type": "W_B_W", "params": [{"common": {"width": {"from": 65, "to": 245, "step": 5}}}]}},
}


@pytest.fixture
def foldcar_command(request: pytest.FixtureRequest) -> Command:
    """The command, whose fixture has the package's name."""
    command: Command = request.getfixturevalue("foldcar")
    return command


@pytest.fixture(scope="module")
def listing(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("optimize") / "listing.json"
    file.write_text(json.dumps(LISTING), encoding="utf-8")
    return file


def optimized(listing: Path, store: Path, designs: int, objectives: Sequence[str] = ("success",)) -> SearchResult:
    """A search that tests the two best designs in four new environments."""
    plan = Plan(tuple(OBJECTIVES[name] for name in objectives), designs, best=2, fresh=4)
    result = SearchResult(planned=designs)
    search(searched_study(read_study(listing), plan), plan, store, Carsim(), 1, "", result)
    return result


@pytest.mark.usefixtures("carsim_binary")
def test_a_search_of_all_designs_finds_what_a_sweep_finds(
    foldcar_command: Command, listing: Path, tmp_path: Path
) -> None:
    store = tmp_path / "s.db"
    result = optimized(listing, store, 9)
    swept = json.loads(foldcar_command("sweep", listing, "--store", "s.db", "--json").stdout)
    multiple = optimized(listing, store, 9, ("time", "sheet-area"))

    study = foldcar.Study(store)
    runs = study.runs[study.runs["experiment"] == "1"]
    rates = runs.groupby(["width_mm", "radius_mm"])["passed"].mean()
    # Every design that can be built was simulated, under the keys of a sweep; bad ones not in all environments.
    assert (result.designs, result.exhausted) == (len(rates), True)
    assert 3 * (len(rates) - result.pruned) < result.runs <= 3 * len(rates)
    assert result.unbuildable and "wheels touch" in str(result.unbuildable)
    assert (swept["new"], swept["there"]) == (3 * len(rates) - result.runs, result.runs)
    assert result.best[0].chosen_by == (rates.max(),)
    for design in result.best:
        place = (design.design["width_mm"], design.design["radius_mm"])
        rate = study.rate(experiment="1 fresh", width_mm=place[0], radius_mm=place[1])
        assert design.chosen_by == (rates[place],)
        assert (design.fresh, design.intervals) == ((rate.value,), ((rate.low, rate.high),))
    # None of the best of two objectives is beaten in both by any design.
    times = runs["elapsed_time_s"].where(runs["passed"].astype(bool), 30.0)
    worth = {
        key: (times[index].mean(), film_area_cm2(folded_car(compose("W_B_W", {"width": key[0], "radius": key[1]}))))
        for key, index in runs.groupby(["width_mm", "radius_mm"]).groups.items()
    }
    for design in multiple.best:
        own_value = worth[design.design["width_mm"], design.design["radius_mm"]]
        assert design.chosen_by == pytest.approx(own_value)
        assert not any(other[0] < own_value[0] and other[1] < own_value[1] for other in worth.values())
    assert multiple.new <= 2 * 4


# The command with few new environments, interrupted when nine runs or more are stored.
CUT = """
import signal
# A shell may have started the tests in the background, where SIGINT is ignored.
signal.signal(signal.SIGINT, signal.default_int_handler)
from foldcar.commands.progress_bar import SearchBar
from foldcar.study.search import search
search.Plan.__init__.__defaults__ = (2, 4)
update, cut = SearchBar.update, []
def interrupted(self, found):
    update(self, found)
    if found.new >= 9 and not cut:
        cut.append(found.new)
        signal.raise_signal(signal.SIGINT)
SearchBar.update = interrupted
from foldcar.cli import main
main()
"""


@pytest.mark.usefixtures("carsim_binary")
def test_the_advice_of_a_whole_sweep_stays_after_a_search(
    foldcar_command: Command, listing: Path, tmp_path: Path
) -> None:
    foldcar_command("sweep", listing, "--store", "s.db", "--realities", 32)
    advice = foldcar_command("select", "s.db", "--json").stdout
    with Store.open(tmp_path / "s.db") as store:
        before = store.info().experiments["1"]
    optimized(listing, tmp_path / "s.db", 2)
    with Store.open(tmp_path / "s.db") as store:
        after = store.info().experiments["1"]
    assert after == before
    advice_after = json.loads(foldcar_command("select", "s.db", "--json").stdout)
    assert advice_after["experiments"][0] == json.loads(advice)["experiments"][0]


@pytest.mark.parametrize("objective", ["built", "success"])
def test_an_interrupted_search_ends_where_an_uninterrupted_one_does(
    tmp_path: Path, write_listing: Callable[[Any], Path], objective: str
) -> None:
    listing = write_listing(SPACE)
    words = ["optimize", str(listing), "--designs", "8", "--jobs", "1", "--store", "cut.db", "--objective", objective]
    cut = subprocess.run([sys.executable, "-c", CUT, *words], cwd=tmp_path, capture_output=True, text=True, check=False)

    resumed = optimized(listing, tmp_path / "cut.db", 8, [objective])
    straight = optimized(listing, tmp_path / "straight.db", 8, [objective])

    assert (cut.returncode, cut.stdout) == (130, "")
    assert "designs tried, runs in cut.db; the same command resumes" in cut.stderr
    assert resumed.new <= straight.new - 9
    assert replace(resumed, new=0, started_s=0.0) == replace(straight, new=0, started_s=0.0)
    assert foldcar.Study(tmp_path / "cut.db").runs.equals(foldcar.Study(tmp_path / "straight.db").runs)


@pytest.mark.parametrize(
    ("words", "experiment", "tested", "heading"),
    [
        # Without an objective, the search is for built cars.
        ([], "1 (realities)", "200 new environments, each in a new reality (95", "expected success of built cars, new"),
        (["--objective", "success"], "1", "200 new environments (95 %", "success, new"),
    ],
)
def test_the_command_tests_three_designs_in_200_new_environments(
    foldcar_command: Command, tmp_path: Path, words: list[str], experiment: str, tested: str, heading: str
) -> None:
    # Wide cars with large wheels are nearly as good as each other, so that none is stopped early.
    common = {"width": [110, 115, 120, 125], "radius": 60}
    alike = {**LISTING, "vehicles": {"1": {"type": "W_B_W", "params": [{"common": common}]}}}
    (tmp_path / "alike.json").write_text(json.dumps(alike), encoding="utf-8")

    done = foldcar_command("optimize", "alike.json", "--store", "s.db", "--designs", "4", *words)

    assert done.returncode == 0, done.stderr
    assert f"tested in {tested}" in done.stdout and f"  {heading}  " in done.stdout
    assert ("Expected success is over realities" in done.stdout) == (not words)
    runs = foldcar.Study(tmp_path / "s.db").runs
    assert set(runs["experiment"]) == {experiment, f"{experiment} fresh"}
    fresh = runs[runs["experiment"] == f"{experiment} fresh"].groupby("width_mm").size()
    assert list(fresh) == [200, 200, 200]


def test_objectives_make_failing_at_once_no_gain() -> None:
    passed, tipped, failed = RunRow("passed", 2.0, 6.0), RunRow("tipped", 0.1, 0.2), RunRow("failed", None, None)
    rows = [passed, passed, tipped, failed]
    values = {name: objective.value(rows, 30.0) for name, objective in OBJECTIVES.items() if objective.value is not None}

    # The failed run's energy counts as the mean of the others, 12.2 / 3.
    assert values == {"built": 0.5, "success": 0.5, "time": 16.0, "energy": pytest.approx((12.2 + 12.2 / 3) / 2)}
    for objective in OBJECTIVES.values():
        if objective.value is not None and objective.interval is not None:
            low, high = objective.interval(rows, 30.0)
            assert low <= objective.value(rows, 30.0) <= high
            worse, better = objective.value([tipped, tipped, failed], 30.0), values[objective.name]
            assert worse < better if objective.is_maximised else worse > better
    assert OBJECTIVES["energy"].value is not None and math.isinf(OBJECTIVES["energy"].value([tipped], 30.0))


def row(time_s: float | None, energy_j: float = 5.0) -> RunRow:
    """A run that passed in this time; None: it tipped."""
    return RunRow("tipped" if time_s is None else "passed", 30.0 if time_s is None else time_s, energy_j)


@pytest.mark.parametrize("name", ["success", "time", "energy"])
def test_the_excess_sums_to_what_a_design_is_worse_than_the_best(name: str) -> None:
    """Of equally many runs: 0 where both are as good, above 0 where the best is better, and never below its bound."""
    objective, draw = OBJECTIVES[name], random.Random(4)
    assert objective.value is not None
    for _ in range(50):
        pair = [[row(draw.choice([None, draw.uniform(1, 30)]), draw.uniform(1, 9)) for _ in range(12)] for _ in "ab"]
        own_value, best = (objective.value(rows, 30.0) for rows in pair)
        if not all(map(math.isfinite, (own_value, best))):
            continue
        losses = objective.compare(*pair, 30.0)
        excess = losses.differences
        assert min(excess) >= -losses.max_gain - 1e-9
        assert sum(objective.compare(pair[1], pair[1], 30.0).differences) == 0
        apart = best - own_value if objective.is_maximised else own_value - best
        assert math.copysign(1, round(sum(excess), 9)) == math.copysign(1, round(apart, 9))
    rejected = RunRow("rejected", None, None)
    losses = objective.compare([rejected, row(3.0)], [row(3.0), rejected, row(3.0)], 30.0)
    assert losses.differences == [0, 0]


def test_of_designs_that_end_as_good_as_the_best_few_are_left_early() -> None:
    """The evidence is 1 on average over all orders where the design ends equal: so it reaches 10 in a tenth at most."""
    for equal in ([1, 1, -1, -1, 0, 0], [0.4, -1, 0.3, 0.3, -0.5, 0.5], [0, 0, 0]):
        orders = list(permutations(equal))
        for n in range(1, len(equal) + 1):
            evidence = [evidence_of_worse(order[:n], len(equal), 1.0) for order in orders]
            assert sum(evidence) / len(evidence) == pytest.approx(1)
    # What is left cannot make up for it: three environments of at most -1 each.
    assert evidence_of_worse([1] * 4, 6, 1.0) == math.inf and evidence_of_worse([0, 0, 1], 9, 0.0) == math.inf
    draw = random.Random(5)
    left, worse = 0, 0
    for _ in range(1000):
        equal = [1] * 6 + [-1] * 6 + [0] * 28
        draw.shuffle(equal)
        left += any(evidence_of_worse(equal[: 4 * k], 40, 1.0) >= 10 for k in range(1, 10))
        worse += evidence_of_worse([float(draw.random() < 0.6) for _ in range(12)], 40, 1.0) >= 10
    assert left <= 100 and worse > 700


def test_a_design_that_fails_where_the_best_passes_is_left_early(listing: Path) -> None:
    (experiment,) = read_study(listing).experiments
    proposals = Proposals(experiment.family, [OBJECTIVES["success"]])
    assert proposals.next() is not None and not proposals.is_worse([row(None)] * 3, 30.0)
    proposals.tell([0.9], [row(3.0)] * 27 + [row(None)] * 3, False, 5.0)
    assert proposals.next() is not None

    looks = [proposals.is_worse([row(None)] * n, 30.0) for n in (1, 3, 6)]

    assert looks == [False, False, True] and not proposals.is_worse([row(3.0)] * 29, 30.0)


def test_the_film_is_that_of_the_flat_pieces() -> None:
    design = compose("W_B_W", {"width": 105, "radius": 56})
    area = 0.0
    for piece in folded_car(design).pieces:
        faces = [shapely.Polygon(face.exterior) for face in flat_polygons(piece).values()]
        area += piece.count * shapely.union_all(faces).area

    assert film_area_cm2(folded_car(design)) == pytest.approx(area / 100, rel=1e-6)


def test_each_design_is_proposed_once(listing: Path) -> None:
    (experiment,) = read_study(listing).experiments
    proposals = Proposals(experiment.family, [OBJECTIVES["success"]])
    seen = []
    while (values := proposals.next()) is not None:
        seen.append(values)
        proposals.tell([0.5], [row(None)] * 3, False, 30.0)

    assert len(seen) == len(set(seen)) == len(experiment.family)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--objective", "sheet-area"], "--objective sheet-area: needs no simulation"),
        (["--objective", "time", "--objective", "time"], "each objective may be named only once"),
        (["--objective", "success", "--objective", "built"], "built and success cannot be combined"),
    ],
)
def test_a_search_without_meaning_is_refused(
    foldcar_command: Command, listing: Path, tmp_path: Path, words: list[str], message: str
) -> None:
    done = foldcar_command("optimize", listing, "--store", "s.db", *words)

    assert (done.returncode, done.stdout) == (2, "")
    assert message in done.stderr and len(done.stderr.splitlines()) == 1
    assert not (tmp_path / "s.db").exists()


def test_a_program_beside_the_simulation_can_only_be_searched_for_the_nominal_rate(
    foldcar_command: Command, tmp_path: Path, write_listing: Callable[[Any], Path]
) -> None:
    (tmp_path / "beside.scenic").write_text(BESIDE)
    listing = write_listing({**LISTING, "environments": {"1": {"scenic_filename": "beside.scenic", "seed": 7}}})

    refused = foldcar_command("optimize", listing, "--store", "s.db", "--objective", "built", "--objective", "time")

    assert (refused.returncode, refused.stdout) == (2, "")
    (line,) = refused.stderr.splitlines()
    assert "beside.scenic runs beside the simulation (" in line and "--objective success" in line
    assert not (tmp_path / "s.db").exists()


def test_time_and_energy_are_nominal_without_built(listing: Path, tmp_path: Path) -> None:
    nominal = optimized(listing, tmp_path / "s.db", 9, ("time", "success"))
    expected = optimized(listing, tmp_path / "s.db", 9, ("time", "built"))

    assert nominal.runs == expected.runs == expected.new - 4 * len(expected.best)
    study = foldcar.Study(tmp_path / "s.db")
    for result, experiment in ((nominal, "1"), (expected, "1 (realities)")):
        for design in result.best:
            runs = study.runs[study.runs["experiment"] == experiment]
            for name in ("width_mm", "radius_mm"):
                runs = runs[runs[name] == design.design[name]]
            times = runs["elapsed_time_s"].where(runs["passed"].astype(bool), 30.0)
            assert design.chosen_by == pytest.approx((times.mean(), runs["passed"].mean()))
