"""A search over realities: each sample in a random reality of its own, kept apart from nominal runs and from trials."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.special import ndtr

import foldcar as foldcar_api
from foldcar.belief.priors import MAX_SCORE, NAMES, built_priors, values_of
from foldcar.belief.reality import drawn_reality
from foldcar.evidence.comparison import compare
from foldcar.evidence.selecting import select
from foldcar.report.page_data import page_data
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.runner import RunRequest
from foldcar.store.reader import Store
from foldcar.store.stored_drives import read_drives
from foldcar.study.experiments import read_study
from foldcar.study.reality_draws import draw_runs, draw_sample_scores
from foldcar.study.search.objectives import OBJECTIVES
from foldcar.study.search.search import Plan, SearchResult, search, searched_study
from study_car import listing_of
from swept_listing import STEP_PYRAMIDS, foldcar

SEARCHED, FRESH = "1 (realities)", "1 (realities) fresh"
SAMPLES = 40


def write_widths(tmp_path: Path, widths: Sequence[float] = (95, 245), environments: int = SAMPLES) -> Path:
    file = tmp_path / "widths.json"
    file.write_text(json.dumps(listing_of(STEP_PYRAMIDS, {"width": list(widths)}, timeout=60, environments=environments)))
    return file


def searched(listing: Path, store: Path, objectives: Sequence[str], carsim: Carsim, fresh: int) -> SearchResult:
    """The result of a search of both designs; the best is tested in ``fresh`` new environments."""
    plan = Plan(tuple(OBJECTIVES[name] for name in objectives), designs=2, best=1, fresh=fresh)
    result = SearchResult(planned=2)
    search(searched_study(read_study(listing), plan), plan, store, carsim, 1, "", result)
    return result


def test_scores_have_the_priors_of_cars_from_sheets_and_depend_on_the_sample_alone() -> None:
    priors = built_priors("W_B_W+cells=nimh", from_sheets=True)
    assert priors
    scores = np.array([draw_sample_scores(5, sample, priors) for sample in range(20_000)])

    for index in range(len(NAMES)):
        mean, sd = priors[index][:2] if index in priors else (0.0, 1.0)
        unclipped = scores[np.abs(scores[:, index]) < MAX_SCORE, index]
        below = (unclipped < mean).sum() + (scores[:, index] == -MAX_SCORE).sum()
        assert below / len(scores) == pytest.approx(0.5, abs=0.02)
        within = np.mean(np.abs(scores[:, index] - mean) < sd)
        assert within == pytest.approx(ndtr(1) - ndtr(-1), abs=0.02)
    assert np.abs(np.corrcoef(scores.T) - np.eye(len(NAMES))).max() < 0.04
    assert np.array_equal(draw_sample_scores(5, 17, priors), scores[17])
    assert not np.array_equal(draw_sample_scores(6, 17, priors), scores[17])
    # Other realities than those of a sweep with the same seed.
    swept = draw_runs(5, range(20_000), 2, 10).scores
    without_priors = np.array([draw_sample_scores(5, sample, {}) for sample in range(2000)])
    assert not set(map(tuple, without_priors)) & set(map(tuple, swept))
    assert abs(np.corrcoef(without_priors[:, 0], swept[:2000, 0])[0, 1]) < 0.1


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory, carsim_binary: Path) -> Path:
    """A search of two widths with 40 samples for built cars and sheet area, the best in six fresh ones."""
    folder = tmp_path_factory.mktemp("realities")
    file = folder / "s.db"
    searched(write_widths(folder), file, ("built", "sheet-area"), Carsim(carsim_binary), 6)
    return file


def test_each_sample_has_a_reality_and_a_car_that_all_designs_share(store: Path, carsim_binary: Path) -> None:
    (experiment,) = read_study(store.parent / "widths.json").experiments
    priors = built_priors(experiment.family.vehicle_type, from_sheets=True)
    runs = foldcar_api.Study(store).runs
    carsim = Carsim(carsim_binary)

    with Store.open(store) as opened:
        for name, seed, samples in ((SEARCHED, experiment.variation_seed, (0, 7, 39)), (FRESH, None, (0, 5))):
            drives, info = read_drives(opened, name), opened.info().experiments[name]
            assert (info.variation_seed == seed) == (name == SEARCHED)
            for place, design in enumerate(drives.parameters):
                own_runs = runs[(runs["experiment"] == name) & (runs["width_mm"] == design["width_mm"])]
                outcomes = dict(zip(own_runs["sample"], own_runs["outcome"], strict=True))
                assert len(outcomes) == info.environments
                for k in samples:
                    (values,) = values_of(draw_sample_scores(info.variation_seed, k, priors).reshape(1, -1))
                    reality = drawn_reality(values, experiment.variation, info.variation_seed, k, k)
                    bodies = {"b": drives.text("body", drives.bodies[place])}
                    scenes = {"s": drives.text("scene", drives.scenes[k])}
                    settings = drives.text("settings", drives.settings[place])
                    (answer,) = carsim.run(bodies, scenes, [RunRequest("b", "s", settings, "", k, json.dumps(reality))])
                    assert outcomes[k] == answer["outcome"]


class KnownTruth(Carsim):
    """Narrow cars pass always in nominal simulation, and else if friction is near 1; wide ones unless it is low."""

    def run(
        self, bodies: Mapping[str, str], scenes: Mapping[str, str], requests: Sequence[RunRequest]
    ) -> list[dict[str, Any]]:
        """Answers without simulation."""
        return [self._answer(json.loads(bodies[request.body]), request) for request in requests]

    def _answer(self, body: Mapping[str, Any], request: RunRequest) -> dict[str, Any]:
        friction = json.loads(request.reality)["friction"] if "friction" in request.reality else None
        # The score of the friction, whose logarithm has the standard deviation 0.3.
        score = None if friction is None else np.log(friction) / 0.3
        if body["track_m"] < 0.15:
            passed = score is None or abs(score) < 0.5
        else:
            passed = request.sample % 5 > 0 if score is None else score > -1
        return {**self.template, "outcome": "passed" if passed else "stuck"}

    template: Mapping[str, Any] = {}


def test_the_best_over_realities_need_not_be_the_nominal_best(tmp_path: Path, carsim_binary: Path, store: Path) -> None:
    carsim = KnownTruth(carsim_binary)
    with Store.open(store) as opened:
        drives = read_drives(opened, SEARCHED)
        texts = [drives.text(name, key) for name, key in (("body", drives.bodies[0]), ("scene", drives.scenes[0]))]
        settings = drives.text("settings", drives.settings[0])
    (carsim.template,) = Carsim(carsim_binary).run(
        {"b": texts[0]}, {"s": texts[1]}, [RunRequest("b", "s", settings, "", 0)]
    )
    listing = write_widths(tmp_path, environments=100)

    built = searched(listing, tmp_path / "b.db", ["built"], carsim, 1000)
    nominal = searched(listing, tmp_path / "n.db", ["success"], carsim, 50)

    (best,), (nominal_best,) = built.best, nominal.best
    assert (best.design["width_mm"], nominal_best.design["width_mm"]) == (245, 95)
    # The rates over realities follow from the priors: P(z > -1) and P(|z| < 0.5).
    assert best.fresh[0] == pytest.approx(ndtr(1), abs=4 * 0.37 / 1000**0.5) and best.intervals[0] is not None
    assert best.intervals[0][0] < ndtr(1) < best.intervals[0][1]
    rate = foldcar_api.Study(tmp_path / "b.db").rate(experiment=SEARCHED, width_mm=95)
    assert nominal_best.fresh == (1.0,) and rate.low < ndtr(0.5) - ndtr(-0.5) < rate.high


def test_names_and_runs_stay_apart_from_nominal_ones(store: Path, tmp_path: Path, carsim_binary: Path) -> None:
    file = tmp_path / "s.db"
    file.write_bytes(store.read_bytes())

    again = searched(store.parent / "widths.json", file, ("sheet-area", "built"), Carsim(carsim_binary), 6)
    nominal = searched(store.parent / "widths.json", file, ("success", "sheet-area"), Carsim(carsim_binary), 6)

    assert (again.new, again.runs) == (0, 2 * SAMPLES)
    assert nominal.new == 2 * SAMPLES + 6
    with Store.open(file) as opened:
        infos = opened.info().experiments
        draws = {name: set(read_drives(opened, name).variations.values()) for name in infos}
    assert set(infos) == {SEARCHED, FRESH, "1", "1 fresh"}
    for name, info in infos.items():
        over_realities = "realities" in name
        assert info.is_over_realities == over_realities and info.under == ("random realities" if over_realities else None)
        assert info.listed_id == ("1" if over_realities else name)
    assert len(draws[SEARCHED]) == SAMPLES and not draws[SEARCHED] & draws[FRESH] and not draws[SEARCHED] & draws["1"]
    assert infos[SEARCHED].simulation == "random realities" and infos["1"].simulation == "simulation"


def test_rates_are_said_to_be_expected_and_not_compared_with_trials(store: Path, tmp_path: Path) -> None:
    file = tmp_path / "s.db"
    file.write_bytes(store.read_bytes())
    trials = tmp_path / "t.csv"
    trials.write_text("vehicle_type,outcome,source,width_mm\nW_B_W,passed,notes,95\nW_B_W,tipped,notes,245\n")
    foldcar("trials", "import", file, trials, "--experiment", "1")

    with Store.open(file) as opened:
        selections = select(opened)
        comparison = compare(opened)
        page = page_data(opened)

    left_out = (
        "2 trials left out, because the rates of runs in random realities do not take trials into account. "
        "To compare the trials with simulation, sweep experiment 1."
    )
    for selection in selections:
        assert "Expected over realities, " in selection.works and "trials" not in selection.works
        assert selection.learn == "Trials do not change these rates: sweep experiment 1 to learn from trials."
        assert selection.remarks[0].startswith("Rates are averages over realities, before any trial: each environment")
        assert left_out in selection.remarks
    assert len(selections) == 2
    for compared in comparison.experiments:
        assert compared.designs == () and compared.sentence.startswith("Nothing to compare: rates are averages over")
    assert comparison.unswept == ("Experiment 1 was not swept: 2 trials without runs.",)
    shown = {experiment["id"]: experiment for experiment in page["experiments"]}
    assert set(shown) == {SEARCHED, FRESH, "1: W_B_W, trials only"}
    for name in (SEARCHED, FRESH):
        assert shown[name]["simulation"] == "random realities"
        assert shown[name]["trials"] == [] and not any(shown[name]["designs"]["trials"])
        assert ["simulated under", "random realities"] in shown[name]["provenance"]
    assert shown[SEARCHED]["front"]["objectives"][0]["label"] == "expected success of built cars"
    assert sum(shown["1: W_B_W, trials only"]["designs"]["trials"]) == 2
