"""Scenic's semantics over `carsim step`: decisions and records of programs take effect at the exact step."""

import json
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from foldcar.errors import FoldcarError
from foldcar.scenes.source import SceneSource, open_environment
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.carsim_step import SteppedCarsim, TrialFailedError
from foldcar.simulation.runner import RunRequest
from foldcar.simulation.scenic_simulator import CarSimulator
from study_car import car_texts

SCENARIOS = Path(__file__).resolve().parents[3] / "scenarios"
STEP_S = 1 / 240
HEAD = "model model\nego = new Robot at (0, 0), facing -90 deg\n"
GOAL = "goal = new Goal at (1, 0), facing -90 deg\n"

BLOCK = (
    "class Block(Terrain):\n    def pieces(self):\n        sizes = {}\n"
    "        sizes.update(length_m=0.1, width_m=0.1, height_m=0.03)\n        return [{'kind': 'box', **sizes}]\n"
    "new Block at (0.5, 0.5)\nnew RoundBump at (0.5, -0.5), facing -90 deg, with width 0.1\n"
)

Run = Callable[..., dict[str, Any]]


@pytest.fixture(scope="module")
def stepped(carsim_binary: Path) -> Iterator[SteppedCarsim]:
    with SteppedCarsim([str(carsim_binary)]) as carsim:
        yield carsim


def in_batch(carsim_binary: Path, scene: str, **settings: Any) -> dict[str, Any]:
    body, own = car_texts()
    request = RunRequest("b", "s", json.dumps({**json.loads(own), **settings}), "the run", 0)
    (result,) = Carsim(carsim_binary).run({"b": body}, {"s": scene}, [request])
    return result


def opened(folder: Path, text: str) -> SceneSource:
    program = folder / "program.scenic"
    program.write_text(text)
    return open_environment(program, {}, 1)


def simulator(stepped: SteppedCarsim, source: SceneSource, k: int = 0, **options: Any) -> tuple[CarSimulator, Any, str]:
    """A simulator of sample ``k``, its Scenic scene and carsim's."""
    scene = source.scenic_scene(k)
    # Here Scenic evaluates everything, also what carsim could.
    described = json.dumps({key: part for key, part in source.describe(scene, k).items() if key != "program"})
    return CarSimulator(stepped, *car_texts(**options), lambda _: described), scene, described


@pytest.fixture
def run(tmp_path: Path, stepped: SteppedCarsim) -> Run:
    """Runs a program given as text and returns the result, with ``scene`` as carsim was given it."""

    def single_run(text: str, again: bool = False, **options: Any) -> dict[str, Any]:
        own, scene, described = simulator(stepped, opened(tmp_path, text), **options)
        result = own.run(scene)
        assert not again or own.run(scene) == result
        return {**result, "scene": described}

    return single_run


def value(result: dict[str, Any], name: str) -> Any:
    return result["recorded"][name]["value"]


@pytest.mark.parametrize("program", ["step_pyramids", "two_bumps_mutated", "ten_random_bumps"])
def test_scenic_and_the_batch_agree_to_the_last_bit(program: str, stepped: SteppedCarsim, carsim_binary: Path) -> None:
    source = open_environment(SCENARIOS / f"{program}.scenic", {}, 42)
    assert not source.dynamic
    carsim = Carsim(carsim_binary)
    outcomes = set()
    for k, width_mm in enumerate((65, 120, 245)):
        own, scene, described = simulator(stepped, source, k, width_mm=width_mm)
        body, settings = car_texts(width_mm)
        (native,) = carsim.run({"b": body}, {"s": described}, [RunRequest("b", "s", settings, "", k)])
        result = own.run(scene)
        assert result.pop("recorded") == {}
        assert result == native
        outcomes.add(result["outcome"])
    assert len(outcomes) > 1 or program != "step_pyramids"


@pytest.mark.parametrize(
    "statement",
    [
        "mutate goal\nrequire ego.position.x < 3",
        "require always ego.position.x < 3",
        "monitor M():\n    wait\nrequire monitor M()",
        "behavior B():\n    wait\nnew Marker at (0, 1), with behavior B",
    ],
)
def test_what_needs_a_running_simulation_is_told_from_what_does_not(tmp_path: Path, statement: str) -> None:
    is_sampled = statement.startswith("mutate")
    assert opened(tmp_path, f"{HEAD}{GOAL}{statement}\n").dynamic != is_sampled


@pytest.mark.parametrize("outer_step_s", [STEP_S, 0.25])
def test_a_stop_is_traced_back_to_its_step(run: Run, carsim_binary: Path, outer_step_s: float) -> None:
    result = run(
        f"{HEAD}param outer_step_s = {outer_step_s!r}\nterminate when ego.position.x > 0.4\n"
        "record final ego.position.x as x\nrecord final simulation().currentRealTime as t\n"
    )
    path = in_batch(carsim_binary, result["scene"], path_interval_s=STEP_S)["path"]
    t_s, x_m, *_ = next(row for row in path if row[1] > 0.4)
    assert result["outcome"] == "terminated"
    assert (result["elapsed_time_s"], value(result, "t"), value(result, "x")) == (t_s, t_s, x_m)
    assert result["max_pitch_rad"] == max(abs(row[5]) for row in path if row[0] <= t_s)


def test_timestep_is_scenics_own_name_for_the_outer_step(run: Run) -> None:
    text = f"{HEAD}terminate after 2 seconds\nrecord ego.position.x as x\n"
    assert value(run(f"{text}param timestep = 0.5\n"), "x") == value(run(f"{text}param outer_step_s = 0.5\n"), "x")


@pytest.mark.parametrize("within_m", [0.05, 0.001])
def test_an_ending_that_holds_between_two_looks_only_is_not_missed(run: Run, within_m: float) -> None:
    """At looks of 0.25 s the car is at 0.28 and 0.45 m."""
    results = [
        run(
            f"{HEAD}param outer_step_s = {outer_step_s!r}\nend = new Point at (0.37, 0)\n"
            f"terminate when distance from ego to end <= {within_m}\nrecord final ego.position.x as x\n"
        )
        for outer_step_s in (STEP_S, 0.05, 0.25, 60)
    ]
    assert results == results[:1] * 4
    # A step is 3 mm, so that one may cross the smaller place too.
    assert results[0]["outcome"] == ("terminated" if within_m == 0.05 else results[1]["outcome"])
    assert within_m < 0.05 or value(results[0], "x") == pytest.approx(0.32, abs=0.004)


def test_the_earlier_ending_wins(run: Run) -> None:
    goal = "new Goal at (0.5, 0), facing -90 deg\n"
    first = run(f"{HEAD}{goal}terminate when ego.position.x > 0.49\n")
    assert first["outcome"] == "terminated"
    later = run(f"{HEAD}{goal}terminate when ego.position.x > 0.505\n")
    at_once = run(f"{HEAD}{goal}terminate when ego.position.x >= 0.5\n")
    assert later["outcome"] == at_once["outcome"] == "passed"
    assert first["elapsed_time_s"] < later["elapsed_time_s"] == at_once["elapsed_time_s"]


@pytest.mark.parametrize(("limit", "elapsed_s"), [("1.1 seconds", 1.1), ("3 steps", 0.75)])
def test_terminate_after_is_exact(run: Run, limit: str, elapsed_s: float) -> None:
    result = run(f"{HEAD}param course_x_max = 5\nterminate after {limit}\nrecord ego.speed as speed\n")
    assert (result["outcome"], result["elapsed_time_s"]) == ("terminated", pytest.approx(elapsed_s, abs=1e-12))
    times = [t_s for t_s, _ in value(result, "speed")]
    assert times == sorted(set(times))


@pytest.mark.parametrize(
    ("statements", "outcome"),
    [
        # At the look after the ending the car is at 0.45 m, at the look before it at 0.28 m.
        ("require eventually ego.position.x > 0.36\nterminate when ego.position.x > 0.35\n", "rejected"),
        ("require eventually ego.position.x > 0.5\nterminate after 0.8 seconds\n", "rejected"),
        ("require eventually 0.35 < ego.position.x < 0.36\nterminate after 0.8 seconds\n", "terminated"),
        ("require always ego.position.x < 0.36\nterminate when ego.position.x > 0.35\n", "terminated"),
        ("require always not 0.35 < ego.position.x < 0.36\nterminate simulation when ego.position.x > 1\n", "rejected"),
        ("require eventually ego.position.x > 0.51\nnew Goal at (0.5, 0), facing -90 deg\n", "rejected"),
        ("require (ego.position.x < 0.36 until ego.position.x > 0.35)\nterminate after 1 seconds\n", "terminated"),
        # Terrain has a method, the program's own as well.
        (f"{BLOCK}require always ego.position.x < 0.36\nterminate when ego.position.x > 0.35\n", "terminated"),
    ],
)
def test_requirements_do_not_depend_on_when_scenic_looks(run: Run, statements: str, outcome: str) -> None:
    results = []
    for outer_step_s in (STEP_S, 0.25):
        text = f"{HEAD}param outer_step_s = {outer_step_s!r}\n{statements}record final ego.position.x as end\n"
        results.append(run(text, again=True))
    assert results == results[:1] * 2
    assert results[0]["outcome"] == outcome


def test_records_are_what_the_car_did(run: Run, carsim_binary: Path) -> None:
    result = run(
        f"{HEAD}{GOAL}record ego.position as place\nrecord initial ego.position as begin\n"
        "record final ego.speed as speed\nrecord final [ego.heading, 'text', None, True] as list\n",
        again=True,
    )
    path = in_batch(carsim_binary, result["scene"], path_interval_s=0.25)["path"]
    assert result["outcome"] == "passed"
    assert {name: entry["kind"] for name, entry in result["recorded"].items()} == {
        "place": "series", "begin": "initial", "speed": "final", "list": "final"
    }  # fmt: skip
    series = value(result, "place")
    assert [t_s for t_s, _ in series] == [row[0] for row in path]
    rest_m = path[0][3]
    for (_, place), row in zip(series, path, strict=True):
        assert place == pytest.approx([row[1], row[2], row[3] - rest_m], abs=1e-12)
    assert value(result, "begin") == series[0][1]
    assert value(result, "speed") == pytest.approx(0.69, abs=0.05)
    heading, *rest = value(result, "list")
    assert heading == pytest.approx(path[-1][4] - math.pi / 2)
    assert rest == ["text", None, True]


def test_the_programs_verdict_counts_only_where_it_ended_the_run(run: Run) -> None:
    stop = f"{HEAD}terminate when ego.position.x > 0.3\n"
    assert run(f"{stop}record final ego.position.x > 0.2 as passed\n")["outcome"] == "passed"
    assert run(f"{stop}record final ego.position.x > 0.4 as passed\n")["outcome"] == "terminated"
    off = run(f"{HEAD}param course_x_max = 0.2\nterminate after 9 seconds\nrecord final True as passed\n")
    assert off["outcome"] == "off_course"


def test_requirements_on_the_sample_are_none_on_the_run(tmp_path: Path, stepped: SteppedCarsim) -> None:
    """A soft requirement is drawn once per sample: samples that need not fulfil it run like the others."""
    source = opened(
        tmp_path,
        "model model\nego = new Robot at (Range(0, 0.02), 0), facing -90 deg\nterminate after 0.5 seconds\n"
        "require[0.5] ego.position.x > 0.01\nrequire ego.position.x < 0.019\n",
    )
    scenes = [source.scenic_scene(k) for k in range(40)]
    let_off = [scene for scene in scenes if scene.egoObject.position.x <= 0.01]
    # A quarter, within five standard deviations.
    assert 0 < len(let_off) < 40 * (0.25 + 5 * math.sqrt(0.25 * 0.75 / 40))
    assert all(scene.egoObject.position.x < 0.019 for scene in scenes)
    for k in (scenes.index(let_off[0]), scenes.index(let_off[-1])):
        own, scene, _ = simulator(stepped, source, k)
        assert own.run(scene)["outcome"] == "terminated"


@pytest.mark.parametrize(
    "use",
    ["monitor Stop():{}require monitor Stop()\n", "behavior Stop():{}new Marker at (0, 0.5), with behavior Stop()\n"],
)
def test_monitors_and_behaviors_end_the_run_at_a_look(run: Run, use: str) -> None:
    body = "\n    while ego.position.x < 0.4:\n        wait\n    terminate simulation\n"
    result = run(f"{HEAD}{GOAL}{use.format(body)}terminate after 9 seconds\n", again=True)
    assert (result["outcome"], result["elapsed_time_s"] % 0.25) == ("terminated", 0)


LEG = """model model
scenario Leg(far):
    setup:
        here = new Marker at (far, 0)
{statement}    compose:
        while ego.position.x < far:
            wait
scenario Main():
    setup:
        ego = new Robot at (0, 0), facing -90 deg
        record ego.position.x as x
    compose:
        do Leg(0.2)
        do Leg(0.5)
        do Leg(9) until ego.position.x > 0.8
"""


@pytest.mark.parametrize("statement", ["terminate when ego.position.x > far", "record ego.speed as speed"])
def test_what_scenic_misplaces_in_sub_scenarios_is_refused(run: Run, statement: str) -> None:
    with pytest.raises(FoldcarError, match=r"line 5: `(terminate when|record)` has no effect in a scenario"):
        run(LEG.format(statement=f"        {statement}\n"))


def test_terrain_cannot_appear_while_the_car_drives(run: Run) -> None:
    text = (
        "model model\nscenario Late():\n    setup:\n        new Bump at (0.3, 0)\n"
        "scenario Main():\n    setup:\n        ego = new Robot at (0, 0), facing -90 deg\n"
        "    compose:\n        do Late()\n"
    )
    with pytest.raises(Exception, match="a Bump is created while the car drives"):
        run(text)


def test_a_temporal_requirement_of_an_imported_program_holds_in_the_run(run: Run, tmp_path: Path) -> None:
    (tmp_path / "other.scenic").write_text(f"{HEAD}{GOAL}require always ego.position.x < 0.5\n")
    imported = "model model\nfrom other import ego, goal\n"
    assert run(f"{imported}terminate when ego.position.x > 0.4\n")["outcome"] == "terminated"
    assert run(f"{imported}terminate when ego.position.x > 0.6\n")["outcome"] == "rejected"


def test_a_refused_trial_is_that_runs_failure(run: Run) -> None:
    with pytest.raises(TrialFailedError, match="the firmware refused"):
        run(f"{HEAD}terminate after 1 seconds\n", timeout_s=3000)
    assert run(f"{HEAD}terminate after 1 seconds\n")["outcome"] == "terminated"
