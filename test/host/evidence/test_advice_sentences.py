"""The adviser's sentences on studies whose counts are known, and that the page prints those of `foldcar select`."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from foldcar.evidence.adviser import Selection
from foldcar.evidence.evidence import Evidence, read_evidence
from foldcar.evidence.selecting import select, select_evidence
from foldcar.report.page_data import page_data
from foldcar.report.page_ranges import range_sentences
from foldcar.report.reported_experiment import read_experiments
from foldcar.store.measured import write_measured
from foldcar.store.reader import Store
from written_study import add_trials, import_trials, write_realities, write_study

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


def advise(path: Path) -> list[Selection]:
    with Store.open(path) as opened:
        return select(opened)


@pytest.fixture
def study(store: Callable[..., Path]) -> Studied:
    def made(*words: Any, **facts: Any) -> Selection:
        (selection,) = advise(store(*words, **facts))
        return selection

    return made


@pytest.mark.parametrize(
    ("counts", "message"),
    [
        ({75.0: 0, 95.0: 0}, "no run passed."),
        ({75.0: 12}, "the design does not reach 75 %; it passes 60 %."),
        ({75.0: 12, 95.0: 2}, "no design reaches 75 %; the best, 75 mm, passes 60 %."),
        ({75.0: 12, 85.0: 12, 95.0: 2}, "no design reaches 75 %; the best 2 pass 60 %."),
        ({75.0: 12, 85.0: 12}, "no design reaches 75 %; each passes 60 %."),
        ({75.0: 17, 95.0: 17}, "each of 2 designs reaches 75 %, none with 95 % confidence"),
        (dict.fromkeys((75.0, 80.0, 85.0, 90.0, 95.0), 20) | {115.0: 4}, "75 to 95 mm reach 75 % with 95 % confidence"),
        ({75.0: 4, 95.0: 20, 115.0: 4}, "95 mm reaches 75 %"),
    ],
)
def test_without_realities_the_advice_is_what_simulation_says_and_no_more(
    study: Studied, counts: Counts, message: str
) -> None:
    selection = study(counts)

    assert message in selection.works
    assert selection.learn.startswith("Nothing is said of built cars: ")
    assert (selection.leader, selection.steps, selection.gain) == (None, (), None)


@pytest.mark.parametrize(
    ("threshold", "message"),
    [
        (0.945, "In simulation the design reaches 94.5 %, but not with 95 % confidence."),
        (0.954, "In simulation the design does not reach 95.4 %; it passes 95 %."),
        (0.9502, "In simulation the design does not reach 95.02 %; it passes 95 %."),
        (0.004, "In simulation the design reaches 0.4 % with 95 % confidence."),
    ],
)
def test_a_threshold_is_named_as_it_is(study: Studied, threshold: float, message: str) -> None:
    assert message in study({75.0: 19}, thresholds=[threshold]).works


def test_runs_that_a_rule_may_have_ended_need_their_own_interval_for_confidence(study: Studied) -> None:
    """18 of 20: Wilson's interval begins at 0.699, the anytime-valid one at 0.591."""
    rule = {"thresholds": [], "half_width": 0.01, "confidence": 0.95}

    assert "the design reaches 69 % with 95 % confidence" in study({75.0: 18}, thresholds=[0.69]).works
    stopped = study({75.0: 18}, thresholds=[0.69], until=rule)
    assert "the design reaches 69 %, but not with 95 % confidence" in stopped.works


PLANE = {"width_mm": [75.0, 95.0], "radius_mm": [40.0, 50.0, 60.0]}


@pytest.mark.parametrize(
    ("least_mm", "message"), [(50, "4 of 6 designs with runs reach"), (40, "each of 6 designs with")]
)
def test_a_driven_design_without_runs_is_not_counted_among_those_of_simulation(
    least_mm: float, message: str, tmp_path: Path
) -> None:
    """The runs are of another build of carsim, so that the driven design cannot be simulated now."""
    path = write_study(
        tmp_path / "s.db", PLANE, SAMPLES, lambda design, sample: "passed" if design["radius_mm"] >= least_mm else "stuck"
    )
    import_trials(path, [({"width_mm": 85.0, "radius_mm": 55.0}, None, "passed")] * 3)

    (selection,) = advise(path)

    assert f"In simulation {message}" in selection.works
    assert "Trials that passed: 3 of 3 at width 85 mm, radius 55 mm." in selection.works


@pytest.mark.parametrize(
    ("driven", "message"),
    [
        ({"width_mm": 85.0, "radius_mm": 55.0}, "Each of 7 designs reaches 75 %"),
        ({"width_mm": 145.0, "radius_mm": 55.0}, "Each of 6 designs within the swept ranges reaches 75 %"),
    ],
)
def test_a_design_beyond_the_swept_ranges_is_not_counted_among_those_that_may_reach_the_threshold(
    driven: Mapping[str, float], message: str, tmp_path: Path
) -> None:
    path = write_study(tmp_path / "s.db", PLANE, SAMPLES, lambda design, sample: "passed")
    write_realities(path, lambda scores, design: 8.0)
    swept = [{"width_mm": 75.0, "radius_mm": 40.0}, {"width_mm": 95.0, "radius_mm": 60.0}]
    import_trials(path, [(design, None, "passed") for design in [driven, *swept] for _ in range(40)], cars=4)

    (selection,) = advise(path)

    assert message in selection.works, selection.works


@pytest.mark.filterwarnings("error")
def test_a_study_of_one_design_has_a_belief(tmp_path: Path) -> None:
    path = write_study(tmp_path / "s.db", {}, SAMPLES, lambda design, sample: "passed" if sample < 15 else "tipped")
    write_realities(path, lambda scores, design: 0.75, number=1000)

    (selection,) = advise(path)

    assert selection.works.startswith("Want a car that works? The design: ")


def test_without_a_rule_or_a_run_that_counts_nothing_is_advised(study: Studied) -> None:
    undefined = study({75.0: 5}, success_defined=False, success_rule="the program has no goal")
    rejected = study({75.0: None, 95.0: None})

    assert undefined.works == "No advice, because the program has no goal."
    assert rejected.works.startswith("No advice: ")


def good_in_the_middle(scores: Mapping[str, float], design: Mapping[str, float]) -> float:
    """Log-odds that are best at 95 mm and fall with the obstacles' height."""
    return 2.5 - 3 * abs(design["width_mm"] - 95) / 20 - 1.2 * scores["obstacle_height"]


COUNTS = {75.0: 12, 85.0: 18, 95.0: 20, 105.0: 19, 115.0: 9, 125.0: 2}


def test_before_trials_a_guess_is_called_a_guess(store: Callable[..., Path]) -> None:
    path = store(COUNTS)
    write_realities(path, good_in_the_middle)

    (selection,) = advise(path)

    assert re.match(r"Want a car that works\? 95 mm: \d+ % \(.* to .*\) for a built car, a guess from", selection.works)
    assert selection.learn.startswith("Want to learn most? ")
    assert selection.leader == {"width_mm": 95.0, "height_mm": 50.0}
    assert not selection.enough


def test_the_verb_follows_the_chance(store: Callable[..., Path]) -> None:
    for passed, verb in ((20, "Each of 6 designs reaches 75 %"), (0, "No design is likely to reach 75 %")):
        path = store(COUNTS)
        write_realities(path, good_in_the_middle)
        widths = list(COUNTS)
        trials = [({"width_mm": width}, None, "passed" if k < passed else "stuck") for width in widths for k in range(20)]
        import_trials(path, trials, cars=4)

        (selection,) = advise(path)

        assert re.search(verb, selection.works), selection.works


def test_the_car_that_passes_is_the_one_to_take_and_its_trials_count_for_it_most(store: Callable[..., Path]) -> None:
    path = store(COUNTS)
    write_realities(path, good_in_the_middle)
    import_trials(path, [({"width_mm": 105.0}, None, "passed")] * 12)

    (selection,) = advise(path)

    start = "Want a car that works? Take the car that you have, the car of 105 mm: "
    assert selection.works.startswith(start)
    assert int(selection.works.removeprefix(start).split()[0]) > 80


def test_a_design_that_fails_almost_surely_is_no_step(store: Callable[..., Path]) -> None:
    path = store({75.0: 20, 95.0: 20, 115.0: 0})
    write_realities(path, lambda scores, design: -9.0 if design["width_mm"] == 115 else 2 + scores["friction"])
    import_trials(path, [({"width_mm": width}, None, "passed") for width in (75.0, 95.0) for _ in range(6)], cars=2)

    (selection,) = advise(path)

    assert all(step.label != "115 mm" for step in selection.steps)


def test_enough_is_said_in_the_terms_of_an_afternoon(store: Callable[..., Path]) -> None:
    path = store({75.0: 20, 95.0: 20})
    write_realities(path, lambda scores, design: 4.0 + 0.2 * scores["friction"])
    import_trials(path, [({"width_mm": width}, None, "passed") for width in (75.0, 95.0) for _ in range(60)], cars=6)

    (selection,) = advise(path)

    assert selection.enough
    assert "Another afternoon is expected to gain less than one point." in selection.learn
    assert selection.steps == ()


def test_a_step_is_an_afternoon_with_its_cost_and_samples_that_were_not_driven(store: Callable[..., Path]) -> None:
    path = store(COUNTS)
    write_realities(path, good_in_the_middle)
    add_trials(path, [({"width_mm": width}, sample, "tipped") for width in (95.0, 105.0) for sample in (0, 1)])

    (selection,) = advise(path)

    step = next(step for step in selection.steps if step.kind != "measure")
    assert step.trials == 10
    assert step.minutes > 30
    first = 2 if step.label in ("95 mm", "105 mm") else 0
    assert selection.environments == tuple(range(first, first + 10))


def test_what_was_measured_is_not_proposed_again(store: Callable[..., Path]) -> None:
    path = store(COUNTS)

    def by_height(scores: Mapping[str, float], design: Mapping[str, float]) -> float:
        return 4 * scores["obstacle_height"] * (1 if design["width_mm"] > 100 else -1)

    write_realities(path, by_height)
    (before,) = advise(path)
    with write_measured(path) as writer:
        writer.measure("1", {"obstacle_height": 1.0})
    (after,) = advise(path)

    assert "Measure the obstacles' height first (10 minutes), because success depends on it. Then build " in before.learn
    assert "obstacles" not in after.learn
    assert any("Measured values count: obstacle_height 1." in remark for remark in after.remarks)
    assert (before.steps[0].kind, before.steps[0].parameter) == ("measure", "obstacle_height")


def test_a_measurement_that_trials_contradict_is_doubted(store: Callable[..., Path]) -> None:
    path = store(COUNTS)
    write_realities(path, lambda scores, design: -4 * scores["obstacle_height"])
    with write_measured(path) as writer:
        writer.measure("1", {"obstacle_height": 0.75})
    import_trials(path, [({"width_mm": width}, None, "stuck") for width in COUNTS for _ in range(6)], cars=2)

    (selection,) = advise(path)

    assert any("The measurement of obstacle_height may be wrong" in remark for remark in selection.remarks)


def test_trials_of_one_design_move_its_neighbours_less_than_itself(store: Callable[..., Path]) -> None:
    means = []
    for trials in ([], [({"width_mm": 95.0}, None, "stuck")] * 10):
        path = store(COUNTS)
        write_realities(path, good_in_the_middle)
        import_trials(path, trials)
        with Store.open(path) as opened:
            (evidence,) = read_evidence(opened)
        assert evidence.belief is not None
        means.append(evidence.belief.answers.expected)

    itself, neighbour = (means[0] - means[1])[[2, 3]]
    assert itself > neighbour > 0


def test_the_page_prints_what_select_says(store: Callable[..., Path]) -> None:
    path = store(COUNTS)
    write_realities(path, good_in_the_middle)
    import_trials(path, [({"width_mm": 95.0}, k, "passed" if k < 7 else "stuck") for k in range(10)])
    with Store.open(path) as opened:
        (selected,) = select(opened)
        (shown,) = page_data(opened)["experiments"]

    assert (shown["headline"], shown["grounds"]) == (selected.works, selected.grounds)
    assert shown["next"]["text"] == selected.learn
    steps = shown["next"]["steps"]
    names = ["" if step["design"] is None else shown["designs"]["name"][step["design"]] for step in steps]
    assert names == [step.label for step in selected.steps]
    assert [step["gain"] for step in steps] == pytest.approx([step.gain for step in selected.steps], abs=1e-6)
    assert set(selected.remarks) <= {*shown["remarks"], *shown["realities"]["taught"]}
    assert len(shown["realities"]["rates"]) == 100
    assert selected.works in repr(selected)


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

    start = "3 designs were simulated; a search judged 2 in 20 fresh environments, which count here. "
    assert judged.works == start + alone.works
    assert "no design reaches 75 %; the best, 80 mm, passes 60 %" in judged.works


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


def test_of_very_many_cars_those_with_most_trials_count(
    store: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("foldcar.evidence.belief.MAX_CARS", 2)
    path = store(COUNTS)
    write_realities(path, good_in_the_middle)
    trials = [(75.0, "stuck"), *[(85.0, "stuck")] * 3, *[(95.0, "passed")] * 4]
    import_trials(path, [({"width_mm": width}, None, outcome) for width, outcome in trials])

    with Store.open(path) as opened:
        (evidence,) = read_evidence(opened)

    assert evidence.belief is not None
    assert [car.design for car in evidence.belief.answers.cars] == [1, 2]
    assert [car.counted for car in evidence.belief.answers.cars] == [3, 4]
    assert "Of the cars that drove, the 2 with most trials count." in evidence.remarks


def test_cars_that_differ_widely_are_told(store: Callable[..., Path]) -> None:
    """Of five cars of a design, each passes always or never; log-odds of simulation are 0."""
    path = store(COUNTS)
    write_realities(path, lambda scores, design: 0.1 * scores["friction"])
    outcomes = [(k, "passed" if k % 5 < 2 else "stuck") for k in range(60)]
    import_trials(path, [({"width_mm": 95.0}, None, outcome) for _, outcome in outcomes], cars=5)

    (selection,) = advise(path)

    (remark,) = (remark for remark in selection.remarks if remark.startswith("Cars of one design differ by "))
    assert float(remark.split()[6]) > 1.2
    low, high = (int(number) for number in re.findall(r"(\d+) %", remark))
    assert low < 30 < 70 < high
