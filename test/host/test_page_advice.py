"""The page's sentences on studies whose counts are known: headline, likely designs, what to learn; a search's front."""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from time import time_ns
from typing import Any

import numpy
import pytest

from foldcar.report.page_advice import Advice
from foldcar.report.page_data import read_experiments
from foldcar.report.page_designs import Designs
from foldcar.report.page_front import search_front
from foldcar.simulation.results import NUMBERS
from foldcar.store.reader import Store
from written_study import add_trials, write_study

SAMPLES = 20
# The square of the normal quantile of 0.975.
Z2 = 3.8415
Counts = Mapping[float, int | None]


@pytest.fixture
def study(tmp_path: Path) -> Iterator[Callable[..., Advice]]:
    """Advice on designs by how many of 20 runs each passes, None if all are rejected."""
    with ExitStack() as stores:

        def made(counts: Counts, trials: Sequence[tuple[float, str]] = (), key: str = "width_mm", **facts: Any) -> Advice:
            def ended(design: Mapping[str, float], sample: int) -> str:
                good = counts[design[key]]
                return "rejected" if good is None else "passed" if sample < good else "tipped"

            store = tmp_path / f"{time_ns()}.db"
            write_study(store, {key: list(counts)}, SAMPLES, ended, **facts)
            add_trials(store, [({key: value}, sample, outcome) for sample, (value, outcome) in enumerate(trials)])
            (one,) = read_experiments(stores.enter_context(Store.open(store)))
            return Advice(one.designs, one.effects, one.places, 0.75)

        yield made


def from_to(passed: int) -> str:
    """The rate and Wilson's interval of so many of 20: (k + z²/2 ∓ z √(k (n - k) / n + z²/4)) / (n + z²)."""
    middle, reach = passed + Z2 / 2, (Z2 * (passed * (20 - passed) / 20 + Z2 / 4)) ** 0.5
    low, high = ((middle + sign * reach) / (20 + Z2) for sign in (-1, 1))
    return f"{5 * passed} % ({100 * low:.0f} % to {100 * high:.0f} %)"


@pytest.mark.parametrize(
    ("counts", "said"),
    [
        ({75.0: 0, 95.0: 0}, "no design passes a single environment"),
        # Exactly the threshold is not more.
        ({75.0: 15, 95.0: 2}, "no design passes more than 75 % of the environments; the best, 75 mm, passes 75 %"),
        (
            {75.0: 16, 95.0: 17},
            "every one of 2 designs passes more than 75 % of the environments, but none of them surely",
        ),
        ({75.0: 20, 95.0: 20, 115.0: 4, 135.0: 18}, "75 to 95 mm and 135 mm pass more than 75 % .*, 75 to 95 mm surely"),
        ({75.0: 4, 95.0: 20, 115.0: 4}, "95 mm passes more than 75 % of the environments, and so do"),
    ],
)
def test_the_headline_says_which_designs_pass_and_how_sure_that_is(
    study: Callable[..., Advice], counts: Counts, said: str
) -> None:
    assert re.match(rf"In simulation {said}", study(counts).headline())


def test_without_a_rule_or_a_run_that_counts_nothing_is_advised(study: Callable[..., Advice]) -> None:
    undefined = study({75.0: 20, 95.0: 3}, success_defined=False, success_rule="no goal is set")
    rejected = study({75.0: None, 95.0: None})

    assert undefined.headline() == "No car is called good or bad: no goal is set."
    assert rejected.headline().startswith("Nothing can be said: there is no rate: all 40 runs were rejected")
    for one in (undefined, rejected):
        assert one.likely() == one.learn() == {"text": "", "designs": [], "why": []}
        assert one.edges() == []


def test_one_design_is_likely_and_there_is_nothing_to_choose(study: Callable[..., Advice]) -> None:
    one = study({75.0: 17})

    # A family of one has no parameter that tells it apart.
    assert one.likely()["designs"] == [0] and one.likely()["why"] == [from_to(17)]
    assert one.learn()["designs"] == [] and one.edges() == []


def test_ties_are_counted_and_the_named_ones_lie_apart(study: Callable[..., Advice]) -> None:
    tied = {75.0: 20, 85.0: 20, 95.0: 20, 105.0: 20, 115.0: 20}
    one = study({**tied, 125.0: 19, 135.0: 0}).likely()

    assert one["text"].startswith(
        f"5 designs tie at 100 % (at least {100 * 20 / (20 + Z2):.0f} % by the 95 % interval of each)"
    )
    assert len(one["designs"]) == 3 and set(one["designs"]) <= {0, 1, 2, 3, 4}
    # The ties span four steps.
    assert max(one["designs"]) - min(one["designs"]) >= 3
    assert one["why"] == [from_to(20)] * 3


def test_of_driven_designs_the_best_is_named_beside_a_better_one_that_was_not(study: Callable[..., Advice]) -> None:
    alone = study({75.0: 12, 95.0: 18, 115.0: 3})
    one = study({75.0: 20, 95.0: 20, 115.0: 2, 135.0: 1}, [(115.0, "passed"), (115.0, "tipped"), (135.0, "tipped")])

    assert alone.likely()["text"] == f"95 mm: {from_to(18)}."
    assert " % chance to pass more than 75 %; by simulation and trials together it passes " in one.likely()["text"]
    assert one.likely()["text"].endswith(" Trials that passed: 1 of 2 at 115 mm and 0 of 1 at 135 mm.")
    assert not {2, 3} & set(one.likely()["designs"])


def test_trials_that_contradict_simulation_stand_first(study: Callable[..., Advice]) -> None:
    one = study({75.0: 20, 95.0: 20, 115.0: 20, 135.0: 20}, [(75.0, "tipped")] * 10 + [(95.0, "passed")])

    assert one.headline().startswith("Trials contradict simulation: it is optimistic at 75 mm. ")
    assert "By simulation and 11 trials together" in one.headline()


def as_searched(one: Advice) -> Advice:
    return replace(one, designs=replace(one.designs, info=replace(one.designs.info, searched=True)))


def test_success_that_rises_to_an_end_of_the_range_is_told_and_a_plateau_is_not(study: Callable[..., Advice]) -> None:
    values = [float(value) for value in range(40, 61, 2)]

    rising = study(dict(zip(values, (0, 1, 2, 4, 6, 8, 10, 12, 14, 16, 19), strict=True)), key="plate_mm")
    level = study(dict(zip(values, (20, 20, 20, 18, 14, 10, 6, 2, 0, 0, 0), strict=True)), key="plate_mm")

    assert rising.edges() == ["Success still rises at plate 60 mm, the range's upper end: extend it if it can be built."]
    assert level.edges() == as_searched(rising).edges() == []


def test_a_gap_that_hides_the_border_is_to_be_swept_first(study: Callable[..., Advice]) -> None:
    gapped = study({60.0: 20, 65.0: 20, 70.0: 20, 75.0: 20, 120.0: 0, 125.0: 0, 130.0: 0})

    start = "Nothing was simulated"
    found = re.search(
        rf"{start} between width 75 mm and 120 mm; sweep there first: 97 mm has a (\d+) %", gapped.learn()["text"]
    )
    # Simulation is sure of each design, and knows nothing of the middle: even odds within what a smooth model sees.
    assert found is not None and 10 <= int(found[1]) <= 90
    assert start not in as_searched(gapped).learn()["text"]
    # Both sides pass: the border is elsewhere, at 70 mm.
    elsewhere = study({60.0: 0, 65.0: 4, 70.0: 15, 75.0: 20, 120.0: 20, 125.0: 20, 130.0: 20})
    even = study({float(width): 20 if width < 95 else 0 for width in range(60, 131, 5)})
    assert all(start not in one.learn()["text"] for one in (elsewhere, even))


def test_what_to_learn_is_at_the_border_and_says_the_chance(study: Callable[..., Advice]) -> None:
    counts = {float(width): passed for width, passed in zip(range(60, 160, 10), [20] * 4 + [15] + [0] * 5, strict=True)}
    one = study(counts)
    found = one.learn()

    assert 4 in found["designs"] and len(found["designs"]) <= 3
    # None is a neighbour of another.
    assert numpy.diff(sorted(found["designs"])).min(initial=9) > 1
    for index, why in zip(found["designs"], found["why"], strict=True):
        share = 100 * float((one.draws[:, index] > 0.75).mean())
        assert why == f"{share:.0f} % chance to pass more than 75 %"
        assert f"{one.designs.names[index]} ({why})" in found["text"]


# The front of a search.


def searched(store: Path, counts: Counts, objectives: tuple[str, ...], left: Sequence[float] = ()) -> Designs:
    """A search's designs: how many of 20 runs each passed; those ``left`` early have half of their runs."""
    write_study(
        store,
        {"width_mm": list(counts)},
        SAMPLES,
        lambda d, sample: "passed" if sample < counts[d["width_mm"]] else "tipped",
    )
    with Store.open(store) as opened:
        (one,) = read_experiments(opened)
    found, widths = one.designs, list(counts)
    kept = ~numpy.isin(found.runs.design, [widths.index(width) for width in left]) | (found.runs.sample < SAMPLES // 2)
    runs = type(found.runs)(*(getattr(found.runs, name)[kept] for name in ("design", "sample", "outcome", "metrics")))
    return replace(found, runs=runs, info=replace(found.info, searched=True, objectives=objectives))


def beaten(front: Mapping[str, Any] | None) -> dict[int, tuple[bool, bool]]:
    """Whether each design on the front is beaten, and judged in fresh environments."""
    assert front is not None
    return {one["design"]: (one["beaten"], one["fresh"]) for one in front["points"]}


def test_a_design_is_beaten_by_one_as_good_in_all_and_better_in_one(tmp_path: Path) -> None:
    designs = searched(tmp_path / "s.db", {60.0: 10, 70.0: 10, 80.0: 16, 90.0: 12}, ("success", "sheet-area"))

    front = search_front(designs, [100.0, 120.0, 300.0, 300.0], None)

    # 70 mm passes as often as 60 mm with more film, 90 mm less often than 80 mm with as much.
    assert beaten(front) == {0: (False, False), 1: (True, False), 2: (False, False), 3: (True, False)}
    assert front is not None and [one["values"] for one in front["points"]] == [
        [50.0, 100.0], [50.0, 120.0], [80.0, 300.0], [60.0, 300.0],
    ]  # fmt: skip
    assert front["objectives"][0] == {"label": "share of runs that pass", "unit": "%", "better": "more"}
    low, high = (float(part) for part in re.findall(r"\((\d+) % to (\d+) %", from_to(16))[0])
    assert [front["points"][2][end][0] for end in ("low", "high")] == pytest.approx([low, high], abs=0.5)
    # Designs that are alike do not beat each other.
    alike = search_front(designs, [100.0, 100.0, 300.0, 300.0], None)
    assert beaten(alike) == {0: (False, False), 1: (False, False), 2: (False, False), 3: (True, False)}


def test_a_search_is_told_by_what_its_best_do_in_fresh_environments(tmp_path: Path) -> None:
    designs = searched(tmp_path / "s.db", {60.0: 20, 70.0: 18, 80.0: 16}, ("success",))
    fresh = searched(tmp_path / "f.db", {70.0: 8, 80.0: 12}, ("success",))

    front = search_front(designs, [None] * 3, fresh)
    headline, likely = Advice(designs, None, [0], 0.75).judged(Advice(fresh, None, [0], 0.75))

    # The first was best where it was chosen, and was not judged; of the others the one that was worse there is the best.
    assert beaten(front) == {0: (False, False), 1: (True, True), 2: (False, True)}
    assert front is not None and [one["values"] for one in front["points"]] == [[100.0], [40.0], [60.0]]
    assert headline == (
        f"A search tried 3 designs and 2 were judged in 20 fresh environments: 80 mm leads with {from_to(12)}."
    )
    assert likely["designs"] == [2] and likely["text"] == f"In fresh environments: 80 mm: {from_to(12)}."
    failing = searched(tmp_path / "n.db", {70.0: 0, 80.0: 0}, ("success",))
    headline, likely = Advice(designs, None, [0], 0.75).judged(Advice(failing, None, [0], 0.75))
    assert headline == "A search tried 3 designs; none passes in fresh environments."
    assert likely["designs"] == []


def test_designs_that_were_left_early_are_not_on_the_front(tmp_path: Path) -> None:
    designs = searched(tmp_path / "s.db", {60.0: 20, 70.0: 18, 80.0: 3}, ("success",), left=(70.0,))

    assert beaten(search_front(designs, [None] * 3, None)) == {0: (False, False), 2: (True, False)}


def test_a_design_that_never_passes_has_no_energy_per_pass_and_is_beaten(tmp_path: Path) -> None:
    designs = searched(tmp_path / "s.db", {60.0: 0, 70.0: 10}, ("energy",))

    front = search_front(designs, [None] * 2, None)

    # 3 J each of 20 runs, of which 10 passed.
    assert designs.runs.metrics[0, NUMBERS.index("consumed_energy_j")] == 3.0
    assert front is not None and [one["values"] for one in front["points"]] == [[None], [6.0]]
    assert beaten(front) == {0: (True, False), 1: (False, False)}
    assert search_front(replace(designs, info=replace(designs.info, objectives=())), [None] * 2, None) is None
