"""The front of a search on the page: which designs none beats in all objectives."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy
import pytest

from foldcar.evidence.evidence import Evidence, read_evidence
from foldcar.report.page_front import search_front
from foldcar.simulation.results import NUMBERS
from foldcar.statistics.rate import wilson_interval
from foldcar.store.reader import Store
from written_study import write_study

SAMPLES = 20


def searched(
    store: Path, counts: Mapping[float, int], objectives: tuple[str, ...], left: Sequence[float] = ()
) -> Evidence:
    """A search's designs: how many of 20 runs each passed; those ``left`` early have half of their runs."""
    write_study(
        store,
        {"width_mm": list(counts)},
        SAMPLES,
        lambda d, sample: "passed" if sample < counts[d["width_mm"]] else "tipped",
    )
    with Store.open(store) as opened:
        (result,) = read_evidence(opened)
    widths = list(counts)
    kept = ~numpy.isin(result.runs.design, [widths.index(width) for width in left]) | (result.runs.sample < SAMPLES // 2)
    runs = type(result.runs)(*(getattr(result.runs, name)[kept] for name in ("design", "sample", "outcome", "metrics")))
    return replace(result, runs=runs, info=replace(result.info, searched=True, objectives=objectives))


def beaten(front: Mapping[str, Any] | None) -> dict[int, tuple[bool, bool]]:
    """Whether each design on the front is beaten, and judged in fresh environments."""
    assert front is not None
    return {point["design"]: (point["beaten"], point["fresh"]) for point in front["points"]}


def test_a_design_is_beaten_by_one_as_good_in_all_and_better_in_one(tmp_path: Path) -> None:
    tried = searched(tmp_path / "s.db", {60.0: 10, 70.0: 10, 80.0: 16, 90.0: 12}, ("success", "sheet-area"))

    front = search_front(tried, [100.0, 120.0, 300.0, 300.0], None)

    # 70 mm passes as often as 60 mm with more film, 90 mm less often than 80 mm with as much.
    assert beaten(front) == {0: (False, False), 1: (True, False), 2: (False, False), 3: (True, False)}
    assert front is not None and [point["values"] for point in front["points"]] == [
        [50.0, 100.0], [50.0, 120.0], [80.0, 300.0], [60.0, 300.0],
    ]  # fmt: skip
    assert front["objectives"][0] == {"label": "success in simulation", "unit": "%", "better": "more"}
    low, high = wilson_interval(16, 20)
    assert [front["points"][2][end][0] for end in ("low", "high")] == pytest.approx([100 * low, 100 * high], rel=1e-4)
    # Designs that are alike do not beat each other.
    alike = search_front(tried, [100.0, 100.0, 300.0, 300.0], None)
    assert beaten(alike) == {0: (False, False), 1: (False, False), 2: (False, False), 3: (True, False)}


def test_of_a_search_only_designs_judged_in_fresh_environments_are_compared_there(tmp_path: Path) -> None:
    tried = searched(tmp_path / "s.db", {60.0: 20, 70.0: 18, 80.0: 16}, ("success",))
    fresh = searched(tmp_path / "f.db", {70.0: 8, 80.0: 12}, ("success",))

    front = search_front(tried, [None] * 3, fresh)

    # The first was best where it was chosen, and was not judged; of the others the one that was worse there is the best.
    assert beaten(front) == {0: (False, False), 1: (True, True), 2: (False, True)}
    assert front is not None and [point["values"] for point in front["points"]] == [[100.0], [40.0], [60.0]]


def test_designs_that_were_left_early_are_not_on_the_front(tmp_path: Path) -> None:
    tried = searched(tmp_path / "s.db", {60.0: 20, 70.0: 18, 80.0: 3}, ("success",), left=(70.0,))

    assert beaten(search_front(tried, [None] * 3, None)) == {0: (False, False), 2: (True, False)}


def test_a_design_that_never_passes_has_no_energy_per_pass_and_is_beaten(tmp_path: Path) -> None:
    tried = searched(tmp_path / "s.db", {60.0: 0, 70.0: 10}, ("energy",))

    front = search_front(tried, [None] * 2, None)

    # 3 J each of 20 runs, of which 10 passed.
    assert tried.runs.metrics[0, NUMBERS.index("consumed_energy_j")] == 3.0
    assert front is not None and [point["values"] for point in front["points"]] == [[None], [6.0]]
    assert beaten(front) == {0: (True, False), 1: (False, False)}
    assert search_front(replace(tried, info=replace(tried.info, objectives=())), [None] * 2, None) is None
