"""`foldcar sweep --until`: anytime-valid intervals, and sweeps that stop a design's runs when it is decided."""

import json
import math
import shutil
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy
import pytest
from scipy.integrate import quad
from scipy.stats import binom
from typer.testing import CliRunner

from foldcar.api.study import Study
from foldcar.cli import app
from foldcar.commands.sweep import stopping_lines
from foldcar.errors import FoldcarError
from foldcar.evidence.evidence import read_evidence
from foldcar.report.page_data import page_data
from foldcar.report.page_remarks import stopped_remarks
from foldcar.statistics.rate import anytime_interval, wilson_interval
from foldcar.statistics.stopping import StoppingRule
from foldcar.store.reader import Store
from foldcar.study.experiment_runs import Progress
from foldcar.study.experiments import read_study
from foldcar.study.stopping import stopping_rules
from swept_listing import STEP_PYRAMIDS, rows, swept

# Of designs on low pyramids, 95 passes always, 240 nearly never, 145 in about half.
WIDTHS = [95.0, 145.0, 240.0]
LOW = {"step_height": 0.0215, "top_side": 0.07, "tread": 0.04, "offset": 0.05, "friction": 0.6}
MOST = 30


@pytest.fixture(scope="module")
def listing(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("until") / "l.json"
    params = {"environments": MOST, "threshold": [0.5, 0.75]}
    data = {
        "experiments": {"1": {"veh_id": 1, "env_id": 1, "params": params}},
        "vehicles": {"1": {"type": "W_B_W", "params": [{"common": {"width": WIDTHS}}]}},
        "environments": {"1": {"scenic_filename": str(STEP_PYRAMIDS), "seed": 42, "scenic_params": LOW}},
    }
    file.write_text(json.dumps(data))
    return file


@pytest.fixture(scope="module")
def full_store(listing: Path, carsim_binary: Path) -> Path:
    store = listing.with_name("full.db")
    swept(listing, store, carsim_binary)
    return store


@pytest.fixture(scope="module")
def decided(listing: Path, carsim_binary: Path) -> tuple[Path, Progress]:
    """The store of a sweep until decided, and what it told."""
    store = listing.with_name("decided.db")
    return store, swept(listing, store, carsim_binary, until="decided")


def test_the_interval_ends_where_the_mixture_is_twenty_times_as_likely() -> None:
    for passed, runs in ((0, 7), (3, 10), (20, 20), (56, 100)):
        low, high = anytime_interval(passed, runs)
        # The mixture's likelihood by quadrature: with theta = sin^2(x), Beta(1/2, 1/2) is uniform in x.
        mixture, _ = quad(lambda x, k=passed, n=runs: binom.pmf(k, n, math.sin(x) ** 2) * 2 / math.pi, 0, math.pi / 2)
        for end in {float(low), float(high)} - {0.0, 1.0}:
            assert mixture / binom.pmf(passed, runs, end) == pytest.approx(20, rel=1e-6)
        assert (low == 0) == (passed == 0)
        assert (high == 1) == (passed == runs)
        assert low <= passed / runs <= high
    assert anytime_interval(0, 0) == (0, 1)


def test_an_interval_that_is_looked_at_after_every_run_covers_nevertheless() -> None:
    """The chance, computed over all sequences of 200 runs, that the interval misses the rate at any of them."""

    def missed(rate: float, interval: Callable[[int, int], Any]) -> float:
        chance, hit = 0.0, numpy.array([1.0])
        for runs in range(1, 201):
            hit = numpy.append(hit * (1 - rate), 0) + numpy.append(0, hit * rate)
            for passed in numpy.flatnonzero(hit):
                low, high = interval(int(passed), runs)
                if not low <= rate <= high:
                    chance += hit[passed]
                    hit[passed] = 0.0
        return float(chance)

    low, high = anytime_interval(numpy.arange(201), numpy.arange(201)[:, None].clip(numpy.arange(201)))
    for rate in (0.02, 0.3, 0.5, 0.75, 0.97):
        assert missed(rate, lambda passed, runs: (low[runs, passed], high[runs, passed])) <= 0.05
    wilson = [wilson_interval(passed, runs) if runs else (0, 1) for runs in range(41) for passed in range(runs + 1)]
    # An interval for a fixed number of runs would mislead: 40 looks are enough.
    at = {key: ends for key, ends in zip(((k, n) for n in range(41) for k in range(n + 1)), wilson, strict=True)}
    assert missed(0.75, lambda passed, runs: at.get((passed, runs), (0, 1))) > 0.15


def test_a_rule_is_one_of_width_or_of_sides() -> None:
    sides = StoppingRule(None, (0.5, 0.75))
    assert sides.decided([20, 10, 62, 0], [20, 20, 100, 0]).tolist() == [True, False, False, False]
    narrow = StoppingRule(0.05, ())
    assert narrow.text == "its 95 % interval is at most 5 percentage points to each side"
    assert sides.text == "its 95 % interval lies on one side of 50 % and of 75 %"
    low, high = anytime_interval(350, 700)
    assert narrow.decided([350, 0], [700, 100]).tolist() == [bool((high - low) / 2 <= 0.05), True]


def test_runs_go_where_they_are_undecided_and_are_the_same_however_they_are_made(
    listing: Path, full_store: Path, decided: tuple[Path, Progress], carsim_binary: Path, tmp_path: Path
) -> None:
    store, counts = decided
    with pytest.raises(InterruptedError):
        swept(listing, tmp_path / "resumed.db", carsim_binary, jobs=1, until="decided", stop_at=20)
    interrupted = len(rows(tmp_path / "resumed.db"))
    resumed = swept(listing, tmp_path / "resumed.db", carsim_binary, jobs=3, until="decided")

    stored, everything = rows(store), rows(full_store)
    assert stored == rows(tmp_path / "resumed.db")
    assert 20 <= interrupted < len(stored) == counts.total == counts.new
    assert (resumed.reused, resumed.total) == (interrupted, counts.total)
    made = Counter(result.design["width_mm"] for result in stored)
    for width in WIDTHS:
        passed = [result.outcome == "passed" for result in everything if result.design["width_mm"] == width]
        ends = [anytime_interval(sum(passed[:n]), n) for n in range(1, MOST + 1)]
        outside = [n for n, (low, high) in enumerate(ends, 1) if all(high < t or low > t for t in (0.5, 0.75))]
        if width != 145:
            assert made[width] == outside[0]
    assert made[95] > made[240] and made[145] < MOST
    assert [(state.design["width_mm"], state.runs, state.decided) for state in counts.states] == [
        (width, made[width], width != 145) for width in WIDTHS
    ]


def test_a_store_that_has_everything_is_left_and_read_with_anytime_intervals(
    listing: Path, full_store: Path, tmp_path: Path
) -> None:
    store = tmp_path / "s.db"
    shutil.copy(full_store, store)

    words = ["sweep", str(listing), "--store", str(store), "--until", "30pp", "--realities", "0", "--json"]
    object_ = json.loads(CliRunner().invoke(app, words).stdout)

    assert (object_["new"], object_["there"], object_["most_runs"]) == (0, 90, 90)
    with Store.open(store) as opened:
        info = opened.info().experiments["1"]
        designs = page_data(opened)["experiments"][0]["designs"]
    assert info.until == StoppingRule(0.3, ())
    assert (info.planned_runs, info.stored_runs, info.designs, info.decided) == (90, 90, 3, 3)
    for state in object_["designs"]:
        at = designs["name"].index(f"{state['design']['width_mm']:g} mm")
        assert (designs["low"][at], designs["high"][at]) == pytest.approx((state["low"], state["high"]), abs=1e-6)
        assert (state["low"], state["high"]) == anytime_interval(state["passed"], state["runs"])
    assert any("anytime-valid" in remark for remark in stopped_remarks(info))


def test_a_sweep_that_stopped_is_complete_and_weighs_its_designs_alike(
    listing: Path, decided: tuple[Path, Progress]
) -> None:
    store, counts = decided
    study = read_study(listing)

    with Store.open(store) as opened:
        info = opened.info().experiments["1"]
    assert info.stored_runs == info.planned_runs < 3 * MOST
    sentence = "2 of 3 designs are decided; 1 is undecided, simulated in 30 environments, or fewer"
    assert sentence in stopped_remarks(info)[0]
    first, _, named = stopping_lines(study.experiments[0], stopping_rules("decided", study)["1"], counts.states)
    assert first.startswith("experiment 1: 2 of 3 designs decided, 1 undecided; ")
    assert first.endswith(f"{counts.new} of at most {3 * MOST} runs")
    assert named == "  undecided: 145 mm; --samples N allows more runs"


@pytest.mark.parametrize(
    ("until", "threshold", "message"),
    [
        ("5", 0.75, "--until: '5' is neither decided nor a number of percentage points, such as 5pp"),
        ("decided", None, "experiments.1.params.threshold: is missing; --until decided needs it"),
        ("decided", 75, "experiments.1.params.threshold: 75 is not between 0 and 1"),
        ("decided", [], "experiments.1.params.threshold: an empty list has no threshold"),
    ],
)
def test_what_cannot_be_decided_is_refused(
    until: str, threshold: Any, message: str, listing_data: Any, write_listing: Callable[[Any], Path]
) -> None:
    if threshold is not None:
        listing_data["experiments"]["1"]["params"]["threshold"] = threshold

    with pytest.raises(FoldcarError) as caught:
        stopping_rules(until, read_study(write_listing(listing_data)))

    assert message in str(caught.value)


def test_undefined_success_is_refused_before_the_store_is_made(
    tmp_path: Path, listing_data: Any, write_listing: Callable[[Any], Path], carsim_binary: Path
) -> None:
    program = "model model\nego = new Robot at (0, 0), facing -90 deg\nterminate after 1 seconds\n"
    (tmp_path / "p.scenic").write_text(program)
    listing_data["environments"]["1"] = {"scenic_filename": "p.scenic"}
    listing_data["experiments"]["1"]["params"]["threshold"] = 0.75

    with pytest.raises(FoldcarError, match=r"experiments\.1: --until needs a definition of success: success is"):
        swept(write_listing(listing_data), tmp_path / "s.db", carsim_binary, until="decided")

    assert not (tmp_path / "s.db").exists()


def test_advice_and_python_give_the_interval_that_a_sweep_that_stopped_may_give(
    decided: tuple[Path, Progress], full_store: Path
) -> None:
    store, counts = decided
    with Store.open(store) as opened, Store.open(full_store) as full:
        stopped, fixed = read_evidence(opened)[0].designs, read_evidence(full)[0].designs
    study = Study(store)

    for state, design in zip(counts.states, stopped, strict=True):
        expected = pytest.approx([float(end) for end in anytime_interval(state.passed, state.runs)])
        for rate in (design.simulated(), study.rate(width=state.design["width_mm"])):
            assert [rate.low, rate.high] == expected
            assert rate.method.startswith("anytime-valid interval of")
    assert [(design.simulated().low, design.simulated().high) for design in fixed] == [
        wilson_interval(design.runs_passed, design.runs) for design in fixed
    ]
