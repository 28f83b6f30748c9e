"""What advice says, from evidence written by hand: costs, reasons, other simulations."""

import math
from types import SimpleNamespace
from typing import Any

import numpy
import pytest

from foldcar.advice import outlook
from foldcar.advice import selecting as costs
from foldcar.advice.comparison import _verdict
from foldcar.advice.evidence import Evidence, _pair_remarks
from foldcar.advice.reasons import Parting, first_reason, next_reason
from foldcar.advice.selecting import _Choice
from foldcar.analysis.built_cars import PRIOR
from foldcar.analysis.gap import AGREES, TOO_FEW, Gap, rank_agreement
from foldcar.analysis.gaussian_process import success_model
from foldcar.analysis.rate import Rate
from foldcar.analysis.selection import MIDDLE, Effort
from foldcar.analysis.words import rank_text
from foldcar.fabrication.patterns import sheets


def test_a_car_costs_its_sheets_and_minutes_of_cutting_assembly_and_trials(monkeypatch: pytest.MonkeyPatch) -> None:
    """As BASIS says: 20 mm of cut a second, 90 min for the car; 3 min and the drive for each trial."""
    cut = SimpleNamespace(cut_length_mm=24_010.0, sheets=[1, 2])
    monkeypatch.setattr(sheets, "pattern", lambda *_: cut)
    design = {"width_mm": 95.0}

    def priced(cars: int, trials: int, drive_s: float | None, design: dict[str, float] = design) -> costs.Cost | None:
        return costs.cost("W_B_W", design, Effort(cars, trials, trials), drive_s)

    assert priced(1, 10, 30.0) == costs.Cost(2, math.ceil(24_010 / 20 / 60 + 90 + 10 * 3.5))
    assert priced(3, 10, 30.0) == costs.Cost(6, math.ceil(3 * (24_010 / 20 / 60 + 90) + 10 * 3.5))
    assert priced(0, 60, None) == costs.Cost(0, 180)
    assert priced(0, 7, 45.0) == costs.Cost(0, math.ceil(7 * 3.75))
    assert priced(1, 10, 30.0, {"width_mm": 1.0}) is None
    assert priced(1, 10, 30.0, {"wit_mm": 95.0}) is None


def believed(x: list[list[float]], runs: list[int], trials: list[tuple[int, int]], rates: list[float]) -> Any:
    """An outlook on designs with ``runs`` passed of 100, whose true rates are surely ``rates``."""
    designs = [
        SimpleNamespace(label=f"{row[0]:g} mm", trials=range(n), trials_passed=k)
        for row, (k, n) in zip(x, trials, strict=True)
    ]
    passed = numpy.array([(k, 100) for k in runs], dtype=float)
    return SimpleNamespace(
        designs=designs, parameters=numpy.array(x), trials=numpy.array(trials, dtype=float), runs=passed,
        rates=passed[:, 0] / 100, draws=numpy.tile(rates, (10, 1)), pooled=None,
    )  # fmt: skip


def test_a_design_is_told_of_its_nearest_driven_one() -> None:
    """60 mm is 40 % of the range from 100 mm, nearer than 0 mm: there trials and simulation part, not at 0 mm."""
    seen = believed([[0.0], [60.0], [100.0]], [50, 50, 80], [(5, 10), (0, 0), (2, 10)], [0.5, 0.6, 0.4])

    reason = next_reason(seen, 1, 0.75, None)

    assert "at 100 mm, the nearest driven one, trials and simulation part by -60 points" in reason
    assert "its rate is 60 % to 60 %, which bounds its neighbours'" in reason
    assert "it is the best with a chance of 100 %" in reason
    assert "it was driven: 5 of 10 trials passed" in next_reason(seen, 0, 0.75, None)
    # In two directions: each is a share of its parameter's range.
    x = [[0.0, 0.0], [30.0, 0.0], [100.0, 10.0], [0.0, 4.0]]
    wide = believed(x, [50] * 4, [(5, 10), (0, 0), (0, 10), (10, 10)], [0.5] * 4)
    assert "nearest driven" not in next_reason(wide, 1, 0.5, None)
    parted = Parting(-0.3, "MuJoCo and multibody")
    assert next_reason(wide, 1, 0.5, parted).endswith("MuJoCo and multibody part by 30 points")


def test_a_first_design_is_told_of_its_share_in_simulation() -> None:
    one: Any = SimpleNamespace(runs=40, runs_passed=30)

    assert first_reason(MIDDLE, one, "simulation", None).endswith("where it is surest; simulation passes 75 %")


def test_a_loss_as_large_as_the_precision_is_small_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of two draws the first has the second design better by 0.25; each of both reaches the threshold surely."""
    designs: Any = [
        SimpleNamespace(
            label=f"{w} mm", design={"width_mm": w}, trials=range(10), cars=None, mean_time_s=30.0, spread=PRIOR
        )
        for w in (65.0, 95.0)
    ]
    monkeypatch.setattr(costs, "LEAST_GAIN", 1.0)
    monkeypatch.setattr(costs, "MOST_LOSS", 0.125)
    known = Rate(0.9, 0.8, 0.95, 0.95, "")
    seen = outlook.Outlook(
        tuple(designs), numpy.array([[65.0], [95.0]]), numpy.full((2, 2), 20), numpy.array([[9, 10]] * 2),
        numpy.array([[0.5, 0.75], [0.75, 0.5]]), numpy.arange(4), numpy.ones((2, 4)), (known, known), 0,
        numpy.array([[0.9, 0.8, 0.95]] * 2),
    )  # fmt: skip
    info = SimpleNamespace(simulation="simulation", until=None, searched=False)
    evidence: Any = SimpleNamespace(info=info, parameters=["width_mm"], remarks=())

    found = _Choice(evidence, [evidence], seen, 0.75, 0.125).selection(2, False)

    assert found.loss == 0.125 and found.enough and not found.recommendations
    assert not any("environments are left" in remark for remark in found.remarks)


def test_many_designs_are_thinned_evenly_from_first_to_last(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(outlook, "MOST_CANDIDATES", 3)
    family: Any = [SimpleNamespace(trials=(), number=number) for number in range(5)]

    assert [one.number for one in outlook._thinned(family, set())] == [0, 2, 4]
    assert [one.number for one in outlook._thinned(family[:3], set())] == [0, 1, 2]


def test_simulations_rates_are_smooth_where_there_are_enough_designs() -> None:
    x, passed = numpy.arange(65.0, 145, 10)[:, None], numpy.array([0, 2, 1, 5, 9, 7, 10, 10])
    runs = numpy.column_stack([passed, numpy.full(8, 10)])
    designs: Any = [SimpleNamespace(simulated=lambda k=k: Rate.counted(k, 10, "")) for k in passed.tolist()]
    own = numpy.array([(rate.value, rate.low, rate.high) for rate in (one.simulated() for one in designs)])

    assert outlook._smooth(designs, x, runs) == pytest.approx(
        numpy.column_stack(success_model(x, passed, runs[:, 1]).rates(x))
    )
    for few, some in ((designs[:7], x[:7]), (designs, numpy.hstack([x, x, x])), (designs, numpy.hstack([x, 0 * x]))):
        assert numpy.array_equal(outlook._smooth(few, some, runs[: len(few)]), own[: len(few)])


@pytest.mark.parametrize(("labels", "mean_high", "verdict"), [
    ((AGREES, AGREES), 0.1, AGREES), ((AGREES, TOO_FEW), 0.1, TOO_FEW), ((AGREES, AGREES), 0.2, TOO_FEW),
])  # fmt: skip
def test_simulation_agrees_if_all_designs_and_their_mean_do(labels: Any, mean_high: float, verdict: str) -> None:
    compared: Any = [SimpleNamespace(verdict=one, label="65 mm") for one in labels]

    found, sentence = _verdict(compared, Gap(0.02, -0.1, mean_high, 0.95), 0.15, "simulation")

    assert found == verdict and sentence.startswith("Simulation and trials agree within 15 points at 65 ")


@pytest.mark.parametrize(("number", "said"), [
    (1, "1 trial placed otherwise than planned, or has no stored run: simulated again as placed."),
    (2, "2 trials placed otherwise, or have no run: simulated again as placed."),
])  # fmt: skip
def test_trials_that_are_simulated_again_are_told(number: int, said: str) -> None:
    one: Any = SimpleNamespace(trials=[SimpleNamespace(again=True, simulated=1, sample=None)] * number)

    assert list(_pair_remarks([one])) == [said]


def simulation(engine: str, calibration: Any, rates: dict[float, int], listed: str = "1") -> Any:
    """Evidence of widths with these numbers of 10 runs passed."""
    under = None if calibration is None else f"calibration {calibration['name']}"
    info = SimpleNamespace(engine=engine, calibration=calibration, under=under, listed_id=listed)
    designs = [
        SimpleNamespace(design={"width_mm": width}, runs=10, runs_passed=passed) for width, passed in rates.items()
    ]
    return SimpleNamespace(info=info, designs=designs)


def test_the_simulation_that_parts_most_is_one_that_differs_in_one_thing() -> None:
    here = simulation("", None, {65.0: 5, 95.0: 9})
    calibrated = {"name": "mine"}
    others = [
        simulation("MuJoCo 4.0.0", None, {65.0: 2, 95.0: 10}),
        simulation("", calibrated, {65.0: 6}),
        simulation("MuJoCo 4.0.0", calibrated, {65.0: 0, 95.0: 0}),  # of engine and calibration, either may be the cause
        simulation("MuJoCo 4.0.0", None, {65.0: 0, 95.0: 0}, listed="2"),
    ]
    seen: Any = SimpleNamespace(
        designs=here.designs, smooth=numpy.array([[0.5, 0.3, 0.7], [0.9, 0.7, 0.95]]), rates=numpy.array([0.5, 0.9])
    )
    choice = _Choice(here, [here, *others], seen, 0.75, 0.15)

    first, second = (choice._parted(one) for one in here.designs)

    assert first is not None and second is not None
    assert (first.difference, first.between) == (pytest.approx(-0.3), "multibody and MuJoCo")
    assert (second.difference, second.between) == (pytest.approx(0.1), "multibody and MuJoCo")
    # Doubt falls with the distance from the threshold in widths of the band, and rises with the parting.
    assert list(choice._doubt()) == pytest.approx([1 / (1 + 0.25 / 0.4) + 0.3, 1 / (1 + 0.15 / 0.25) + 0.1])


def test_a_design_of_the_family_differs_in_what_varies_only() -> None:
    info: Any = SimpleNamespace(vehicle_type="W_B_W", fixed={"height_mm": 50.0}, varied={"width_mm": (65.0, 95.0)})
    evidence = Evidence(info, (), ())

    def belongs(design: dict[str, float], vehicle_type: str = "W_B_W") -> bool:
        one: Any = SimpleNamespace(vehicle_type=vehicle_type, design=design)
        return evidence.in_family(one)

    assert belongs({"width_mm": 300.0, "height_mm": 50.0})
    assert not belongs({"width_mm": 65.0, "height_mm": 50.0}, "W_B_H_W_H_W")
    assert not belongs({"width_mm": 65.0, "height_mm": 60.0})
    assert not belongs({"width_mm": 65.0})
    assert not belongs({"height_mm": 50.0})
    assert not belongs({"width_mm": 65.0, "height_mm": 50.0, "depth_mm": 3.0})


def test_ranks_are_told_as_far_as_they_are_defined() -> None:
    two = rank_agreement([(10, 100), (90, 100)], [(8, 10), (3, 10)])
    three = rank_agreement([(10, 100), (50, 100), (90, 100)], [(1, 10), (5, 10), (9, 10)])

    assert rank_text(None) is rank_text(rank_agreement([(1, 10)], [(1, 10)])) is None
    # Each of the two is violated by 80 - 30 %.
    assert rank_text(two) == "Over 2 designs: mean maximum rank violation 0.50."
    text = rank_text(three) or ""
    assert text.startswith("Over 3 designs: Pearson correlation 1.00 (95 %: 0.") and "rank correlation 1.00" in text
