"""Which runs a sweep until decided makes next: batches, valid statements, the same runs after a stop."""

import json
from pathlib import Path
from typing import Any

import numpy
import pytest

from foldcar.evidence import remarks
from foldcar.simulation.carsim import Carsim
from foldcar.statistics.rate import anytime_interval
from foldcar.statistics.stopping import MIN_CHANCE, StoppingRule
from foldcar.store.reader import Store
from foldcar.study.experiments import read_study
from foldcar.study.stopping import Batch, Schedule, stopping_rules
from swept_listing import STEP_PYRAMIDS, swept

RULE = StoppingRule(None, (0.5, 0.75))
MOST = 60


def ended(passed: Any, rule: StoppingRule = RULE) -> Schedule:
    """The schedule of (designs, samples) results at its end."""
    schedule = Schedule(rule, passed.shape[1], [0] * len(passed))
    while batches := schedule.next():
        new = {batch.design: passed[batch.design, batch.samples.start : batch.samples.stop] for batch in batches}
        # NaN is a rejected run.
        counts = {design: (int(numpy.nansum(row)), int((~numpy.isnan(row)).sum())) for design, row in new.items()}
        schedule.record(counts, batches)
    return schedule


@pytest.mark.slow
def test_statements_hold_where_the_schedule_stops() -> None:
    """Over rates at most 5 % of intervals miss, and as many verdicts are wrong."""
    random = numpy.random.default_rng(3)
    rates = numpy.array([0.02, 0.3, 0.45, 0.5, 0.501, 0.6, 0.749, 0.75, 0.8, 0.97])
    repeats = 100
    missed, wrong = numpy.zeros(len(rates)), numpy.zeros(len(rates))
    for _ in range(repeats):
        # Environments are common: a hard one is hard for every design.
        schedule = ended(random.random((1, MOST)) < rates[:, None])
        low, high = anytime_interval(schedule.passed, schedule.runs)
        missed += (low > rates) | (high < rates)
        sides = [((low > t) & (rates < t)) | ((high < t) & (rates > t)) for t in RULE.thresholds]
        wrong += schedule.decided & numpy.any(sides, axis=0)
    assert missed.mean() / repeats <= 0.05, missed / repeats
    # 5 % and three standard errors at a single rate.
    assert missed.max() / repeats <= 0.115 and wrong.max() / repeats <= 0.115


def test_a_design_is_left_when_the_rest_would_hardly_decide_it() -> None:
    """The chance by simulation of the rest, the rate drawn of what Jeffreys' prior and the runs leave."""
    random = numpy.random.default_rng(1)
    for passed, runs in ((6, 12), (4, 12), (20, 30), (28, 30), (13, 20)):
        rates = random.beta(passed + 0.5, runs - passed + 0.5, 40_000)
        chance = RULE.decided(passed + random.binomial(100 - runs, rates), 100).mean()
        assert abs(chance - MIN_CHANCE) > 0.004, "too near to tell"
        assert RULE.hopeless(passed, runs, 100) is bool(chance < MIN_CHANCE)
    assert not RULE.hopeless(50, 100, 100_000)
    assert not StoppingRule(0.05, ()).hopeless(50, 100, 101)


def test_rejected_runs_are_made_but_tell_nothing() -> None:
    passed = numpy.ones((3, MOST))
    passed[0, ::2], passed[1] = numpy.nan, numpy.nan

    schedule = ended(passed)

    half, none, all_of_them = schedule.counted.tolist()
    assert schedule.decided.tolist() == [True, False, True]
    # Of the second the last runs could decide nothing any more.
    assert 2 * half == schedule.runs[0] and none == 0 and schedule.runs[1] > 50 and all_of_them == schedule.runs[2]
    # As many runs that count decide, whatever was rejected between them.
    assert bool(RULE.decided(half, half)) and abs(half - all_of_them) < 0.5 * all_of_them


def test_what_is_stored_beyond_a_decision_is_judged() -> None:
    schedule = Schedule(RULE, 50, [30, 0])
    (first, second) = schedule.next()
    assert first.samples == second.samples == range(7)
    schedule.record({0: (0, 7), 1: (0, 7)}, [first, second])
    assert schedule.next() == [Batch(0, range(7, 30))]
    schedule.record({0: (12, 23)}, [Batch(0, range(7, 30))])
    assert schedule.runs.tolist() == [30, 7]


@pytest.fixture(scope="module")
def listing(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("schedule") / "l.json"
    data = {
        "experiments": {"1": {"veh_id": 1, "env_id": 1, "params": {"environments": 24, "threshold": 0.5}}},
        "vehicles": {"1": {"type": "W_B_W", "params": [{"common": {"width": [95.0, 150.0, 240.0]}}]}},
        "environments": {"1": {"scenic_filename": str(STEP_PYRAMIDS), "seed": 42}},
    }
    file.write_text(json.dumps(data))
    return file


def test_a_sweep_in_mujoco_makes_the_runs_of_the_schedule(
    listing: Path, native: Carsim, carsim_binary: Path, tmp_path: Path
) -> None:
    stores = [tmp_path / name for name in ("one.db", "stopped.db")]
    for store in stores:
        swept(listing, store, carsim_binary, until="decided")
    counts = swept(listing, stores[0], native, 1, until="decided")
    with pytest.raises(InterruptedError):
        swept(listing, stores[1], native, until="decided", stop_at=12)
    with Store.open(stores[1]) as store:
        info = store.info().experiments["1 (MuJoCo)"]
        assert 12 <= info.stored_runs < info.planned_runs
        remark = f"{info.stored_runs} of at most {info.planned_runs} planned runs are here."
        assert remark in remarks.on_runs(store, info)[0]
    resumed = swept(listing, stores[1], native, 3, until="decided")

    orders = []
    for path in stores:
        with Store.open(path) as store:
            orders.append([(r.design, r.sample, r.outcome, r.metrics) for r in store.results("1 (MuJoCo)")])
            info = store.info().experiments["1 (MuJoCo)"]
            assert info.stored_runs == info.planned_runs == len(orders[-1])
    assert orders[0] == orders[1] and resumed.states == counts.states
    assert resumed.new + resumed.reused == counts.new == resumed.total == counts.total
    # The same schedule on the results alone.
    passed = numpy.zeros((3, 24), bool)
    for design, sample, outcome, _ in orders[0]:
        passed[[95.0, 150.0, 240.0].index(design["width_mm"]), sample] = outcome == "passed"
    (rule,) = {stopping_rules("decided", read_study(listing))["1"]}
    schedule = ended(passed, rule)
    assert [(state.runs, state.passed, state.decided) for state in counts.states] == list(
        zip(schedule.runs.tolist(), schedule.passed.tolist(), schedule.decided.tolist(), strict=True)
    )
    assert counts.states[0].decided and counts.states[2].decided
