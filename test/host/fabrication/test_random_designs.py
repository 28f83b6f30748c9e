"""Cars of random designs are made and their sheets read back, or are refused in one line that says what would do."""

import sys
from dataclasses import replace
from functools import cache

import pytest

from conftest import PROJECT
from foldcar.car.design import Design
from foldcar.car.verify import CheckError
from foldcar.errors import FoldcarError
from foldcar.fabrication.patterns import nesting
from foldcar.fabrication.patterns.options import Options

sys.path.insert(0, str(PROJECT / "tools"))
from random_designs import Draw, draws, tried

SEED, CARS = 9, 40


@cache
def foldable() -> Draw:
    """A draw that can be folded."""
    return next(draw for draw in draws(30, SEED) if tried(draw, lambda *_: None).made)


# Chosen designs are made by test_pattern_command.py and test_patterns_designs.py, sizes are advised by
# test_pattern_geometry.py.
@pytest.mark.slow
def test_random_designs_are_made_or_refused_with_what_would_do(monkeypatch: pytest.MonkeyPatch) -> None:
    # Small sheets are nested sooner, and the first layout is checked as well as the best.
    monkeypatch.setattr(nesting, "MAX_TRIES", 0)
    drawn = [replace(draw, sheet=None) for draw in draws(CARS, SEED)]
    outcomes = [tried(draw) for draw in drawn]

    assert [outcome.fault for outcome in outcomes if outcome.fault] == []
    assert sum(outcome.made for outcome in outcomes) >= CARS / 2
    assert any(outcome.refusals for outcome in outcomes)
    assert drawn == [replace(draw, sheet=None) for draw in draws(CARS, SEED)]


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (CheckError("beam: runs through lid"), "fails its checks"),
        (FoldcarError("something is wrong"), "says not what would do"),
        (FoldcarError("--sheet 600x400 would do"), "what should do does not"),
        (ZeroDivisionError("division by zero"), "ZeroDivisionError"),
    ],
)
def test_a_design_that_ends_otherwise_is_a_fault(error: Exception, message: str) -> None:
    def make(_design: Design, _chosen: Options) -> None:
        raise error

    assert message in tried(foldable(), make).fault
