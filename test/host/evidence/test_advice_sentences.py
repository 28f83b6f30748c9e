"""The adviser's sentences on studies whose counts are known, and that the page prints those of `foldcar select`."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from foldcar.evidence.adviser import Selection
from foldcar.evidence.evidence import Evidence, read_evidence
from foldcar.evidence.selecting import select, select_evidence

from foldcar.report.page_data import page_data, read_experiments
from foldcar.report.page_ranges import range_sentences
from foldcar.store.reader import Store
from written_study import add_trials, import_trials, write_study

SAMPLES = 20
Counts = Mapping[float, int | None]
Studied = Callable[..., Selection]


@pytest.fixture
def store(tmp_path: Path) -> Callable[..., Path]:
    """A store of designs by how many of 20 runs each passes, None if all are rejected."""

    def made(counts: Counts, trials: Sequence[tuple[float, str]] = (), key: str = "width_mm", **facts: Any) -> Path:
        def ended(design: Mapping[str, float], sample: int) -> str:
            good = counts[design[key]]
            return "rejected" if good is None else "passed" if sample < good else "tipped"

        path = write_study(tmp_path / f"{len(list(tmp_path.iterdir()))}.db", {key: list(counts)}, SAMPLES, ended, **facts)
        add_trials(path, [({key: value}, sample, outcome) for sample, (value, outcome) in enumerate(trials)])
        return path

    return made


@pytest.fixture
def study(store: Callable[..., Path]) -> Studied:
    def made(*words: Any, **facts: Any) -> Selection:
        with Store.open(store(*words, **facts)) as opened:
            (selection,) = select(opened)
        return selection

    return made


@pytest.mark.parametrize(
    ("counts", "message"),
    [
        ({75.0: 0, 95.0: 0}, "no run passed. No car was driven yet"),
        ({75.0: 12, 95.0: 2}, "no design reaches 75 %; the best, 75 mm, passes 60 %."),
        ({75.0: 17, 95.0: 17}, "each of 2 designs reaches 75 %, none with 95 % confidence"),
        (dict.fromkeys((75.0, 80.0, 85.0, 90.0, 95.0), 20) | {115.0: 4}, r"75 to 95 mm reach 75 % with 95 % confidence"),
        ({75.0: 4, 95.0: 20, 115.0: 4}, "95 mm reaches 75 %"),
    ],
)
def test_before_trials_the_headline_tells_simulation_from_built_cars(
    study: Studied, counts: Counts, message: str
) -> None:
    headline = study(counts).headline

    assert re.match(rf"In simulation {message}", headline)
    assert "No car was driven yet; of built cars " in headline


def test_without_a_rule_or_a_run_that_counts_nothing_is_advised(study: Studied) -> None:
    undefined = study({75.0: 20, 95.0: 3}, success_defined=False, success_rule="no goal is set")
    rejected = study({75.0: None, 95.0: None})

    assert undefined.sentence == "No advice, because no goal is set."
    assert rejected.sentence.startswith("No advice: there is no rate: all 40 runs were rejected")
    assert undefined.recommendations == rejected.recommendations == ()


def test_the_verb_follows_the_chance(study: Studied) -> None:
    counts = dict.fromkeys((75.0, 95.0, 115.0, 135.0), 20)
    few = study(counts, [(75.0, "tipped"), (95.0, "tipped")])
    many = study(counts, [(width, "passed") for width in counts for _ in range(12)])
    failing = study(counts, [(75.0, "tipped")] * 10 + [(95.0, "passed")])

    assert re.match(r"No design is known to reach 75 %; \d+ mm has the best chance, \d+ %\.", few.headline)
    assert re.match(r"Each of 4 designs (probably )?reaches 75 %", many.headline)
    assert failing.headline.startswith("Trials contradict simulation: it is optimistic at 75 mm. ")
    assert "Trials that passed: 1 of 1 at 95 mm and 0 of 10 at 75 mm." in failing.grounds


def test_designs_that_simulation_cannot_rank_are_named(study: Studied) -> None:
    store = study({75.0: 3, 85.0: 20, 95.0: 19, 105.0: 20, 115.0: 2})

    assert re.search(r"Simulation cannot rank 85 to 105 mm \(\d+ to \d+ %\)\.", store.grounds)


def test_trials_of_one_design_move_its_neighbours_less_than_itself(store: Callable[..., Path]) -> None:
    with Store.open(store(dict.fromkeys((75.0, 95.0, 115.0, 135.0), 20), [(75.0, "tipped")] * 12)) as opened:
        (evidence,) = read_evidence(opened)
    assert evidence.belief is not None
    rates = [rate.value for rate in evidence.belief.built]

    assert rates[0] < rates[1] < rates[2]


def test_designs_beside_each_other_with_equal_runs_differ_by_less_than_4_points(store: Callable[..., Path]) -> None:
    """98 to 100 of 100 in turn: single runs do not move the belief."""
    counts = {float(width): 19 + width % 2 for width in range(80, 110)}
    with Store.open(store(counts, [(85.0, "passed")] * 7 + [(85.0, "tipped")] * 3)) as opened:
        (evidence,) = read_evidence(opened)
    assert evidence.belief is not None
    rates = [rate.value for rate in evidence.belief.built]

    assert max(abs(a - b) for a, b in pairwise(rates[8:])) < 0.04


def test_the_page_prints_what_select_says(store: Callable[..., Path]) -> None:
    counts = {75.0: 12, 85.0: 18, 95.0: 20, 105.0: 20, 115.0: 9, 125.0: 2}
    path = store(counts)
    import_trials(path, [({"width_mm": 95.0}, k, "passed" if k < 7 else "stuck") for k in range(10)])
    with Store.open(path) as opened:
        (selected,) = select(opened)
        (shown,) = page_data(opened)["experiments"]

    assert (shown["headline"], shown["grounds"]) == (selected.headline, selected.grounds)
    assert shown["next"]["text"] == selected.next_step
    names = [shown["designs"]["name"][index] for index in shown["next"]["designs"]]
    assert names == [recommendation.label for recommendation in selected.recommendations]
    assert shown["next"]["why"] == [recommendation.reason for recommendation in selected.recommendations]
    assert set(selected.remarks) <= set(shown["remarks"])
    text = repr(selected)
    assert selected.headline in text and all(
        f"\n  {recommendation.label}: " in text for recommendation in selected.recommendations
    )


def test_a_search_is_judged_by_its_best_in_fresh_environments(tmp_path: Path) -> None:
    def evidence(name: str, counts: Mapping[float, int], **facts: Any) -> Evidence:
        path = write_study(
            tmp_path / f"{name}.db",
            {"width_mm": list(counts)},
            SAMPLES,
            lambda design, sample: "passed" if sample < counts[design["width_mm"]] else "tipped",
        )
        with Store.open(path) as opened:
            (evidence,) = read_evidence(opened)
        return replace(evidence, info=replace(evidence.info, **facts))

    searched = evidence("s", {60.0: 20, 70.0: 18, 80.0: 16}, searched=True, objectives=("success",))
    fresh = evidence("f", {70.0: 8, 80.0: 12}, id="1 fresh")

    judged, alone = select_evidence([searched, fresh])

    start = "A search tried 3 designs; 2 were judged in 20 fresh environments. "
    assert judged.headline == start + alone.headline
    assert "no design reaches 75 %; the best, 80 mm, passes 60 %" in judged.headline


# What the page says of ranges.


@pytest.fixture
def ranges(store: Callable[..., Path]) -> Callable[..., list[str]]:
    def sentences_of(counts: Counts, searched: bool = False, **facts: Any) -> list[str]:
        with Store.open(store(counts, **facts)) as opened:
            (experiment,) = read_experiments(opened)
        evidence = replace(experiment.evidence, info=replace(experiment.info, searched=searched))
        return range_sentences(evidence, experiment.effects, experiment.parameter_indices, 0.75)

    return sentences_of


def test_success_that_rises_to_an_end_of_the_range_is_told_and_a_plateau_is_not(
    ranges: Callable[..., list[str]],
) -> None:
    values = [float(value) for value in range(40, 61, 2)]
    rising = dict(zip(values, (0, 1, 2, 4, 6, 8, 10, 12, 14, 16, 19), strict=True))
    level = dict(zip(values, (20, 20, 20, 18, 14, 10, 6, 2, 0, 0, 0), strict=True))

    sentence = "Success still rises at plate 60 mm, the range's upper end: extend it if it can be built."
    assert ranges(rising, key="plate_mm") == [sentence]
    assert ranges(level, key="plate_mm") == ranges(rising, searched=True, key="plate_mm") == []


def test_a_gap_that_hides_the_border_is_to_be_swept_first(ranges: Callable[..., list[str]]) -> None:
    gapped = {60.0: 20, 65.0: 20, 70.0: 20, 75.0: 20, 120.0: 0, 125.0: 0, 130.0: 0}
    (sentence,) = ranges(gapped)

    start = "Nothing was simulated"
    match = re.match(rf"{start} between width 75 mm and 120 mm; sweep there first: 97 mm has a (\d+) %", sentence)
    # Simulation is sure of each design, and knows nothing of the middle: even odds within what a smooth model sees.
    assert match is not None and 10 <= int(match[1]) <= 90
    assert ranges(gapped, searched=True) == []
    # Both sides pass: the border is elsewhere, at 70 mm.
    elsewhere = {60.0: 0, 65.0: 4, 70.0: 15, 75.0: 20, 120.0: 20, 125.0: 20, 130.0: 20}
    even = {float(width): 20 if width < 95 else 0 for width in range(60, 131, 5)}
    assert not any(line.startswith(start) for counts in (elsewhere, even) for line in ranges(counts))
