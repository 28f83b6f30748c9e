"""foldcar in Python: the oracle gives a sweep's numbers, studies read a store, mistakes are one plain line."""

import doctest
import json
import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import foldcar
from conftest import STEP_PYRAMIDS
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.results import NUMBERS
from foldcar.statistics.rate import wilson_interval
from foldcar.study.experiments import read_study
from foldcar.study.sweep import Sweep
from study_car import empty_scene

SEED = 42
SAMPLES = 3
LISTING = {
    "experiments": {
        "plain": {"veh_id": 1, "env_id": 1, "params": {"environments": SAMPLES, "timeout": 60}},
        "built": {
            "veh_id": 1,
            "env_id": 1,
            "params": {"environments": SAMPLES, "variation": "workshop", "variation_seed": 5},
        },
    },
    "vehicles": {"1": {"type": "W_B_W", "params": [{"common": {"width": [65, 95]}}, {"B": {"length": [80, 100]}}]}},
    "environments": {"1": {"scenic_filename": str(STEP_PYRAMIDS), "seed": SEED}},
}


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory, carsim_binary: Path) -> foldcar.Study:
    folder = tmp_path_factory.mktemp("api")
    listing = folder / "listing.json"
    listing.write_text(json.dumps(LISTING), encoding="utf-8")
    Sweep(read_study(listing), folder / "study.db", Carsim(carsim_binary), "a test").run(2)
    return foldcar.Study(folder / "study.db")


def swept(study: foldcar.Study, experiment: str, width_mm: float, b_length_mm: float) -> Any:
    runs = study.runs
    chosen = runs["experiment"].eq(experiment) & runs["width_mm"].eq(width_mm) & runs["B_length_mm"].eq(b_length_mm)
    return runs[chosen].reset_index(drop=True)


def test_importing_foldcar_imports_nothing_else() -> None:
    code = "import sys; before = set(sys.modules); import foldcar; print(sorted(set(sys.modules) - before))"
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert shown == "['foldcar', 'foldcar.version']\n"
    assert set(foldcar.__all__) <= set(dir(foldcar))
    with pytest.raises(AttributeError, match="foldcar"):
        foldcar.studdy  # noqa: B018


def test_the_oracle_gives_the_numbers_of_a_sweep(study: foldcar.Study) -> None:
    place = foldcar.environment(STEP_PYRAMIDS, seed=SEED)
    car = foldcar.design("W_B_W", width=65, B_length_mm=100)
    vehicle = {"type": "W_B_W", "params": [{"common": {"width": 65}}, {"B": {"length": 100}}]}
    plain, built = swept(study, "plain", 65, 100), swept(study, "built", 65, 100)

    runs = foldcar.evaluate(car, place, SAMPLES, timeout_s=60).runs
    varied = foldcar.evaluate(vehicle, STEP_PYRAMIDS, SAMPLES, seed=SEED, variation="workshop", variation_seed=5, jobs=1)
    singly = [foldcar.simulate(vehicle, place.scene(k), timeout_s=60) for k in range(SAMPLES)]

    columns = ["sample", "outcome", "passed", *NUMBERS]
    assert runs[columns].equals(plain[columns])
    assert varied.runs[columns].equals(built[columns])
    assert not plain[list(NUMBERS)].equals(built[list(NUMBERS)])
    assert [run.metrics for run in singly] == plain[list(NUMBERS)].to_dict("records")
    assert [run.passed for run in singly] == plain["passed"].to_list()


def test_a_path_goes_from_start_to_end() -> None:
    place = foldcar.environment(STEP_PYRAMIDS, seed=SEED)
    start = json.loads(place.scene(1).json)["start"]

    run = foldcar.simulate(foldcar.design("W_B_W", width=95), place.scene(1), path_interval_s=0.05)

    first, last = run.path.iloc[0], run.path.iloc[-1]
    # The car settles before its time starts.
    assert math.dist((first["x_m"], first["y_m"]), (start["x_m"], start["y_m"])) < 2e-3
    assert 0 <= float(run.metrics["elapsed_time_s"] or 0) - last["t_s"] <= 0.05 + 1e-9
    assert run.path["roll_rad"].abs().max() <= float(run.metrics["max_roll_rad"] or 0) + 1e-9


def test_rates_and_models_come_from_the_store(study: foldcar.Study) -> None:
    passed, n = int(swept(study, "plain", 95, 80)["passed"].sum()), SAMPLES

    rate = study.rate(experiment="plain", width=95, B_length=80)

    assert (rate.value, rate.low, rate.high) == pytest.approx((passed / n, *wilson_interval(passed, n)))
    assert str(n) in rate.method and "Wilson" in rate.method
    assert len(study.runs) == 2 * 4 * SAMPLES and study.trials.empty
    assert list(study.experiments) == ["plain", "built"]
    assert study.compare().experiments[0].verdict is None
    assert study.select(experiment="plain")[0].info.id == "plain"


def test_a_table_is_modelled_by_the_names_of_its_columns(study: foldcar.Study) -> None:
    import pandas

    model = study.success_model("width", "B_length", experiment="plain")
    # Either order is within the range of the designs.
    right, wrong = model.rates([[94, 81]]), model.rates([[81, 94]])
    assert right[0][0] != pytest.approx(wrong[0][0], abs=1e-6)
    for table in (
        {"B_length_mm": [81.0], "width_mm": [94.0]},
        {"sample": [0], "length": [81.0], "W_length_mm": [60.0], "width": [94.0]},
    ):
        assert model.rates(pandas.DataFrame(table)) == right  # type: ignore[comparison-overlap]
    with pytest.raises(foldcar.FoldcarError, match=r"^rates: the table has no column B_length_mm$"):
        model.rates(pandas.DataFrame({"width_mm": [94], "W_length_mm": [81]}))


def test_changed_tables_do_not_change_rates(study: foldcar.Study) -> None:
    """Notebooks clean their tables up in place."""
    fresh = foldcar.Study(study.path)
    expected = fresh.rate(experiment="plain", width=65, B_length=80), study.success_model("width", experiment="plain")
    fresh.reload()
    fresh.runs["passed"] = ~fresh.runs["passed"]

    assert fresh.runs["passed"].equals(~study.runs["passed"])
    assert fresh.rate(experiment="plain", width=65, B_length=80) == expected[0]
    model = fresh.success_model("width", experiment="plain")
    assert [values.tolist() for values in model.rates([[80]])] == [
        values.tolist() for values in expected[1].rates([[80]])
    ]


def test_the_examples_in_docstrings_are_true(carsim_binary: Path, tmp_path: Path, monkeypatch: Any) -> None:
    vehicles = {"1": {"type": "W_B_W", "params": [{"common": {"width": [65, 80, 95, 110]}}]}}
    listing = {**LISTING, "experiments": {"1": LISTING["experiments"]["plain"]}, "vehicles": vehicles}
    (tmp_path / "listing.json").write_text(json.dumps(listing), encoding="utf-8")
    (tmp_path / "scenarios").symlink_to(STEP_PYRAMIDS.parent)
    monkeypatch.chdir(tmp_path)
    swept = foldcar.sweep("listing.json", "study.db", jobs=1)
    names = {"foldcar": foldcar, "study": swept}
    finder, runner = doctest.DocTestFinder(exclude_empty=True), doctest.DocTestRunner()

    for name in foldcar.__all__:
        for example in finder.find(getattr(foldcar, name), name, globs=names):
            runner.run(example)
    assert runner.failures == 0 and runner.tries > 20


SCENE = empty_scene()
MISTAKES = {
    'design("W_B_W"): widht is not a design parameter': lambda s: foldcar.design("W_B_W", widht=95),
    'design("W_B_W"): length may be W_length_mm or B_length_mm': lambda s: foldcar.design("W_B_W", length=95),
    "design(\"W_B_W\"): width: '95' is not a number": lambda s: foldcar.design("W_B_W", width="95"),
    "has 2 values (65, 95)": lambda s: foldcar.evaluate(
        {"type": "W_B_W", "params": [{"common": {"width": [65, 95]}}]}, STEP_PYRAMIDS, 1
    ),
    "none.scenic: no such Scenic program": lambda s: foldcar.environment("none.scenic"),
    "n: 0 is not an integer": lambda s: foldcar.evaluate(foldcar.design("W_B_W"), STEP_PYRAMIDS, 0),
    "scene.friction: is missing": lambda s: foldcar.simulate(foldcar.design("W_B_W"), {}),
    "timeout_s: -1.0 is not above 0": lambda s: foldcar.evaluate(foldcar.design("W_B_W"), STEP_PYRAMIDS, 1, timeout_s=-1),
    "width: inf is not a number": lambda s: foldcar.design("W_B_W", width=math.inf),
    "width: 1000": lambda s: foldcar.design("W_B_W", width=10**400),
    "timeout_s: nan is not a number": lambda s: foldcar.evaluate(
        foldcar.design("W_B_W"), STEP_PYRAMIDS, 1, timeout_s=math.nan
    ),
    "speed_m_s: 1000": lambda s: foldcar.evaluate(foldcar.design("W_B_W"), STEP_PYRAMIDS, 1, speed_m_s=10**400),
    "path_interval_s: nan is not a number": lambda s: foldcar.simulate(
        foldcar.design("W_B_W"), SCENE, path_interval_s=math.nan
    ),
    "unknown variation 'shop'": lambda s: foldcar.evaluate(foldcar.design("W_B_W"), STEP_PYRAMIDS, 1, variation="shop"),
    'variation: lacks "from"; write {"from": "workshop", …}': lambda s: foldcar.evaluate(
        foldcar.design("W_B_W"), STEP_PYRAMIDS, 1, variation={"mass": 0.1}
    ),
    "choose with experiment=: plain, built": lambda s: s.rate(width=95),
    "no simulation with width_mm 70; there are 65, 95": lambda s: s.rate(experiment="plain", width=70),
    "success_model: name some of width_mm, B_length_mm": lambda s: s.success_model(experiment="plain"),
}


def test_the_simulators_refusal_names_the_argument_and_not_its_program() -> None:
    car = foldcar.design("W_B_W", width=95)
    for mistake, message in (
        ({"scene": {}}, "scene.friction: is missing"),
        ({"scene": SCENE, "path_interval_s": -1}, "path_interval_s: -1.0 is below the limit 0.0"),
        ({"scene": SCENE, "timeout_s": -1}, "timeout_s: -1.0 is not above 0.0"),
        ({"scene": SCENE, "yaw_rate_rad_s": 21}, "yaw_rate_rad_s: 21.0 is above the maximum 20.0"),
    ):
        with pytest.raises(foldcar.FoldcarError) as raised:
            foldcar.simulate(car, **mistake)
        assert str(raised.value) == message
    with pytest.raises(foldcar.FoldcarError, match=r"^speed_m_s: 3 is above 0\.691 m/s, the full speed of W_B_W "):
        foldcar.simulate(car, SCENE, speed_m_s=3)


# What no argument accepts, but those of which a row says so.
ODD: list[Any] = [None, 3.5, -1, math.nan, math.inf, 10**400, 10**5000, b"x", ["a"], {"a": 1}, object(), "", "a\0b"]


def odd_calls(study: foldcar.Study) -> dict[str, tuple[Any, str, tuple[Any, ...]]]:
    """By function and argument: a call with a value, how the message begins, and the odd values that are allowed."""
    car, steps = foldcar.design("W_B_W", width=95), foldcar.environment(STEP_PYRAMIDS)
    scene, run = steps.scene(0), {"experiment": "plain", "width": 95}
    no_default = (None,)
    return {
        "design": (foldcar.design, "type: ", ("", "a\0b")),
        "design width": (lambda value: foldcar.design("W_B_W", width=value), 'design("W_B_W"): width: ', (-1, 3.5)),
        "environment": (foldcar.environment, "program: ", ()),
        "seed": (lambda value: foldcar.environment(STEP_PYRAMIDS, seed=value), "seed: ", ()),
        "params": (lambda value: foldcar.environment(STEP_PYRAMIDS, params=value), "params: ", (None, {"a": 1})),
        "scene": (steps.scene, "scene: ", ()),
        "simulate design": (lambda value: foldcar.simulate(value, scene), "design: ", ()),
        "simulate scene": (lambda value: foldcar.simulate(car, value), "scene: ", ({"a": 1},)),
        "timeout": (lambda value: foldcar.simulate(car, scene, timeout_s=value), "timeout_s: ", (3.5,)),
        "speed": (lambda value: foldcar.simulate(car, scene, speed_m_s=value), "speed_m_s: ", no_default),
        "yaw rate": (lambda value: foldcar.simulate(car, scene, yaw_rate_rad_s=value), "yaw_rate_rad_s: ", (-1, 3.5)),
        "path": (lambda value: foldcar.simulate(car, scene, path_interval_s=value), "path_interval_s: ", (None, 3.5)),
        "evaluate design": (lambda value: foldcar.evaluate(value, steps, 1), "design: ", ()),
        "evaluate environment": (lambda value: foldcar.evaluate(car, value, 1), "environment: ", ()),
        "n": (lambda value: foldcar.evaluate(car, steps, value), "n: ", ()),
        "variation": (lambda value: foldcar.evaluate(car, steps, 1, variation=value), "variation: ", no_default),
        "variation seed": (
            lambda value: foldcar.evaluate(car, steps, 1, variation="workshop", variation_seed=value),
            "variation_seed: ", no_default,
        ),
        "no variation": (
            lambda value: foldcar.evaluate(car, steps, 1, variation_seed=value), "variation_seed: ", no_default,
        ),
        "jobs": (lambda value: foldcar.evaluate(car, steps, 1, jobs=value), "jobs: ", no_default),
        "confidence": (lambda value: foldcar.evaluate(car, steps, 1, confidence=value), "confidence: ", ()),
        "Study": (foldcar.Study, "store: ", ()),
        "rate experiment": (lambda value: study.rate(experiment=value), "experiment: ", (None, "", "a\0b")),
        "rate source": (lambda value: study.rate(source=value, **run), "source: ", ()),
        "rate confidence": (lambda value: study.rate(confidence=value, **run), "confidence: ", ()),
        "model rates": (lambda value: study.success_model("width", experiment="plain").rates(value), "", ()),
        "model confidence": (
            lambda value: study.success_model("width", experiment="plain").rates([[80]], value), "confidence: ", (),
        ),
        "figure": (lambda value: study.plot_success(experiment="plain", figure=value), "figure: ", no_default),
        "threshold": (lambda value: study.select(threshold=value), "threshold: ", no_default),
        "select trials": (lambda value: study.select(simulated_trials=value), "simulated_trials: ", ()),
        "select experiment": (lambda value: study.select(experiment=value), "experiment: ", (None, "", "a\0b")),
        "margin": (lambda value: study.compare(margin=value), "margin: ", ()),
        "compare trials": (lambda value: study.compare(simulated_trials=value), "simulated_trials: ", ()),
        "compare experiment": (lambda value: study.compare(experiment=value), "experiment: ", (None, "", "a\0b")),
        "listing": (lambda value: foldcar.sweep(value, "w.db"), "listing: ", ()),
        "store": (lambda value: foldcar.sweep("l.json", value), "store: ", ()),
        "sweep experiment": (
            lambda value: foldcar.sweep("l.json", "w.db", experiment=value), "experiment: ", (None, "", "a\0b"),
        ),
        "samples": (lambda value: foldcar.sweep("l.json", "w.db", samples=value), "samples: ", no_default),
        "sweep jobs": (lambda value: foldcar.sweep("l.json", "w.db", jobs=value), "jobs: ", no_default),
        "condition": (lambda value: foldcar.condition(value, value), "condition: scenario: ", ()),
    }  # fmt: skip


def test_every_argument_refuses_odd_values_in_one_line_that_names_it(study: foldcar.Study) -> None:
    for name, (call, beginning, allowed) in odd_calls(study).items():
        for value in ODD:
            if any(value is other or (type(value) is type(other) and value == other) for other in allowed):
                continue
            with pytest.raises(foldcar.FoldcarError) as raised:
                call(value)
            line = str(raised.value)
            assert line.startswith(beginning) and len(line) < 500 and "\n" not in line, (name, line)


def test_names_of_frozen_parts_are_lists() -> None:
    import scenic

    scenario = scenic.scenarioFromString("ego = new Object with width Range(1, 2)")
    scene, _ = scenario.generate()
    for names in ("ego", 3, [3], b"ego"):
        with pytest.raises(foldcar.FoldcarError, match=r"^condition: objects: .* is not a list of names"):
            foldcar.condition(scenario, scene, objects=names)  # type: ignore[arg-type]
    with pytest.raises(foldcar.FoldcarError, match=r"^condition: scene: None is not a Scene of Scenic"):
        foldcar.condition(scenario, None)


def test_a_mistake_is_one_line_that_names_it(study: foldcar.Study) -> None:
    for message, mistake in MISTAKES.items():
        with pytest.raises(foldcar.FoldcarError) as raised:
            mistake(study)
        (line,) = raised.value.lines()
        assert message in line
