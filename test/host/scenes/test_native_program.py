"""Endings and records of Scenic programs that carsim evaluates: it gives what Scenic beside the simulation gives."""

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from foldcar.errors import FoldcarError
from foldcar.scenes.source import SceneSource, open_environment, seeded
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.carsim_step import SteppedCarsim
from foldcar.simulation.engines import MULTIBODY, SIDE_VIEW
from foldcar.simulation.runner import RunRequest
from foldcar.simulation.scenic_simulator import CarSimulator
from foldcar.store.reader import Store
from study_car import car_texts
from swept_listing import WriteListing, swept

SCENARIOS = Path(__file__).resolve().parents[3] / "scenarios"
HEAD = (
    "model model\nparam far = Range(0.5, 0.9)\nparam outer_step_s = 1 / 240\n"
    "bump = new Bump at (Range(0.2, 0.3), 0.05), facing -90 deg, with width 0.15, with height Range(0.01, 0.02)\n"
    "mark = new Marker at (globalParameters.far, Range(-0.02, 0.02)), facing -90 deg\n"
    "ego = new Robot at (0, 0), facing Range(-95, -85) deg\ncar = ego\nh = Range(0.1, 0.2)\nspot = mark.position\n"
    "target = new Point at (0.8, 0)\n"
)
STATEMENTS = (
    "terminate when (distance from (front of ego) to mark) <= 0.05 and ego.speed > 0.05",
    "terminate when car.position.x > globalParameters.far + h or abs(ego.roll) > 60 deg",
    "terminate simulation when not (0 <= ego.position.y + 1 < 1.03)",
    "region = RectangularRegion((0.7, 0), 0.1, 0.2, 2)\nterminate when ego.position in region",
    "terminate when (distance to target) < 0.05",
    "terminate when ego.x > 0.3 and not simulation().currentRealTime < 1.2",
    "terminate after 0.7 seconds",
    "terminate after 100 steps\nrecord final (distance from ego to spot) as left",
    "terminate when ego.position.x > 0.4\nrecord final abs(ego.position.y) < 0.02 as passed",
    "terminate when ego.position.x > 0.4\nrecord ego.speed as passed",
    "terminate when ego.x > 0.5\nrecord ego.position as path\nrecord ego.position.z as height\nrecord ego.pitch as pitch",
    "terminate when ego.x > 0.5\nrecord initial bump.height as height\n"
    "record final max(ego.heading, -1.6) * 2 / h as turn\n"
    "record initial [1, 'two', (mark.x, 3)] as odd\nrecord final globalParameters.far as far\n"
    "record final -min(ego.angularSpeed, 2, 3) + ego.consumedEnergy as energy\n"
    "record final (distance from (back right of ego) to (0.1 @ 0.2)) as corner",
    "flag = True\nterminate when ego.x * flag > 0.3",
    "terminate when ego.x > 0.4 and 1\nrecord final ego.x > 0.2 and (ego.y > 1 or not ego.x > 0.9) or False as both",
    "terminate when (distance from ego to (0.1 @ 0) + (0.2 @ 0) * 2) < 0.1",
    "terminate when (distance from ego to mark.position + (0.1 @ 0)) < 0.3",
    "import math\nterminate when ego.x > 0.3\nrecord final math.isclose(1, 1.1, rel_tol=0.5) as close",
    "terminate after 0.000000001 seconds\nrecord ego.x as x",
    "param fast = 1\nterminate when ego.x > 0.3 and globalParameters.fast\nrecord initial [[[[[[1]]]]]] as deep",
)


def opened(folder: Path, statements: str) -> SceneSource:
    program = folder / "program.scenic"
    program.write_text(f"{HEAD}{statements}\n")
    return open_environment(program, {}, 7)


def rounded(value: Any) -> Any:
    """With six digits: places in a scene have nine."""
    if isinstance(value, bool | str) or value is None:
        return value
    if isinstance(value, int | float):
        return round(float(value), 6) + 0.0
    if isinstance(value, dict):
        return {key: rounded(part) for key, part in value.items()}
    return [rounded(part) for part in value]


def flat(folder: Path, statements: str) -> SceneSource:
    """A program in which a car drives along y = 0 on level ground."""
    program = folder / "flat.scenic"
    head = "model model\nparam outer_step_s = 1 / 60\nego = new Robot at (0, 0), facing -90 deg\n"
    program.write_text(head + statements)
    return open_environment(program, {}, 7)


def both_ways(
    source: SceneSource, k: int, width_mm: float, carsim: Path, options: tuple[str, ...] = ()
) -> tuple[dict[str, Any], dict[str, Any]]:
    """The result of carsim alone, and of Scenic beside it. ``options`` choose the engine."""
    body, settings = car_texts(width_mm, 8)
    scene = source.sample(k)
    request = RunRequest("car", "scene", settings, "run", k)
    engine = SIDE_VIEW if options else MULTIBODY
    (native,) = Carsim(engine=engine).run({"car": body}, {"scene": json.dumps(scene)}, [request])
    without = json.dumps({key: part for key, part in scene.items() if key != "program"})
    with SteppedCarsim([str(carsim), *options]) as stepped, seeded("run"):
        simulator = CarSimulator(stepped, body, settings, lambda _: without, source.success.endings)
        beside = simulator.run(source.scenic_scene(k))
    return {"recorded": {}, **native}, beside


@pytest.mark.parametrize("statements", STATEMENTS)
def test_carsim_gives_what_scenic_gives(tmp_path: Path, carsim_binary: Path, statements: str) -> None:
    source = opened(tmp_path, statements)
    assert not source.dynamic, source.needs_scenic
    for k, width_mm in ((0, 95.0), (1, 65.0), (2, 150.0)):
        native, beside = both_ways(source, k, width_mm, carsim_binary)
        assert rounded(native) == rounded(beside)


@pytest.mark.parametrize("program", ["paper_bumps", "paper_bumps_mutated"])
def test_the_publications_programs_need_no_scenic(program: str, carsim_binary: Path) -> None:
    source = open_environment(SCENARIOS / f"{program}.scenic", {}, 42)
    assert not source.dynamic
    for k in range(3):
        native, beside = both_ways(source, k, 95.0, carsim_binary)
        assert rounded(native) == rounded(beside)
        assert native["outcome"] == "passed" and len(native["recorded"]) == 3


@pytest.mark.parametrize(
    ("statements", "needs"),
    [
        ("require always ego.position.y < 0.3", "a requirement on the run"),
        ("monitor M():\n    wait\nrequire monitor M()", "monitors"),
        ("behavior B():\n    wait\nnew Marker at (0, 1), with behavior B", "behaviors"),
        ("def f(x): return x\nterminate when f(ego.x) > 1", "line 12: Call"),
        ("terminate when ego in RectangularRegion((0, 0), 0, 1, 1)", "line 11: a region"),
        ("t = 1\nt = 2\nterminate when ego.x > t", "line 13: `t`"),
        ("marks = [mark]\nterminate when ego.x > marks[0].x", "line 12: `….x`"),
        ("for i in range(2):\n    terminate when ego.x > i", "statements that do not stand at the top level"),
        ("record ego.orientation as turn", "line 11: `….orientation`"),
        ("def abs(x): return 5\nterminate when abs(ego.x) > 1", "line 12: Call"),
        ("max = min\nrecord final max(ego.x, 3) as x", "line 12: Call"),
        ("def simulation(): return ego\nterminate when simulation().currentRealTime > 5", "line 12: `….currentRealTime`"),
        ("def CircularRegion(a): return a\nterminate when ego.position in CircularRegion(0)", "line 12: Call"),
        ("terminate when min(ego.x, 3, key=abs) > 0.3", "line 11: Call"),
        ("r = CircularRegion((0.5, 0), 0.2)\nterminate when (distance to r) < 1", "line 12: the distance from a region"),
        ("from pathlib import Path\nplace = Path('a')\nterminate when ego.x > place.x", "line 13: `….x`"),
        ("param who = ego\nrecord final globalParameters.who.x as x", "line 12: `….x`"),
        (
            "class Sign(Marker):\n    @property\n    def limit(self): return 1\nsign = new Sign at (0.1, 0.5)\n"
            "terminate when ego.x > sign.limit",
            "line 15: `….limit`",
        ),
        (
            "area = CircularRegion((0.5, 0), 0.4).difference(CircularRegion((0.5, 0), 0.2))\n"
            "terminate when ego.position in area",
            "line 12: a region with a hole",
        ),
        (
            "area = CircularRegion((0.5, 0), 0.4, 300).union(CircularRegion((0.9, 0), 0.4, 300))\n"
            "terminate when ego.position in area",
            "line 12: a polygon of more than 1000 corners",
        ),
        ("record final ego.position as passed", "line 11: a position as `passed`"),
        # Python gives 1, not True.
        ("record final ego.x > 0.2 and 1 as odd", "line 11: BoolOp"),
        ("record final ego.x > 0.2 and (ego.x > 0.1 or h) as odd", "line 11: BoolOp"),
        ("terminate when ego.x > 1\n" * 101, "more than 100 conditions or records"),
        ("terminate when " + " and ".join(["ego.x > 1"] * 150), "an expression of more than 400 terms"),
    ],
)
def test_what_needs_scenic_is_named(tmp_path: Path, statements: str, needs: str) -> None:
    assert opened(tmp_path, statements).needs_scenic == needs


# Regions across the car's way, with a function of x and y that says whether a place is inside.
REGIONS: dict[str, tuple[str, Callable[[float, float], bool]]] = {
    "circle": ("CircularRegion((0.45, 0.02), 0.1)", lambda x, y: math.hypot(x - 0.45, y - 0.02) <= 0.1),
    "circle at another height": ("CircularRegion((0.45, 0, 0.3), 0.12)", lambda x, y: math.hypot(x - 0.45, y) <= 0.12),
    "random circle": ("CircularRegion((0.4, 0), Range(0.05, 0.051))", lambda x, y: math.hypot(x - 0.4, y) <= 0.0505),
    "rectangle": ("RectangularRegion((0.45, 0), 0, 0.2, 0.9)", lambda x, y: abs(x - 0.45) <= 0.1 and abs(y) <= 0.45),
    "rectangle with the way as its edge": (
        "RectangularRegion((0.4, -0.2), 0, 0.2, 0.4)", lambda x, y: abs(x - 0.4) <= 0.1 and -0.4 <= y <= 0,
    ),
    "other rectangle with the way as its edge": (
        "RectangularRegion((0.4, 0.2), 0, 0.2, 0.4)", lambda x, y: abs(x - 0.4) <= 0.1 and 0 <= y <= 0.4,
    ),
    "polygon": ("PolygonalRegion([(0.4, 0.5), (0.3, -0.5), (0.5, -0.5)])", lambda x, y: abs(x - 0.4) <= (0.5 - y) / 10),
}  # fmt: skip
RECORDED = (
    "record ego.position as path\nrecord ego.position in area as inside\nrecord ego.position not in area as outside\n"
)


@pytest.mark.parametrize("engine", [(), ("--side-view",)], ids=["multibody", "side view"])
@pytest.mark.parametrize("region", REGIONS)
def test_a_region_is_compared_in_the_ground_plane_in_both(
    tmp_path: Path, carsim_binary: Path, region: str, engine: tuple[str, ...]
) -> None:
    """The records of both evaluators agree with plane geometry, also where the car drives exactly along an edge."""
    text, is_inside = REGIONS[region]
    source = flat(tmp_path, f"area = {text}\nterminate when ego.x > 0.6\n{RECORDED}")
    native, beside = both_ways(source, 0, 95.0, carsim_binary, engine)

    assert not source.dynamic and rounded(native) == rounded(beside)
    values = {name: [value for _, value in series["value"]] for name, series in native["recorded"].items()}
    expected = [is_inside(x, y) for x, y, _ in values["path"]]
    assert values["inside"] == expected == [not value for value in values["outside"]]
    # Where the way is an edge, a car that may leave it to either side is inside now and then.
    assert (not engine and "edge" in region) or 5 < sum(expected) < len(expected) - 5


@pytest.mark.parametrize("region", REGIONS)
@pytest.mark.parametrize(
    "statements",
    [
        "terminate when ego.position in area",
        "terminate when ego.position in area and ego.x > 0.4",
        "terminate simulation when not ego.position not in area",
        "terminate when ego.position not in area",
        "terminate when ego.x > 0.3 and (ego.y > 1 or not ego.position in area)",
        "terminate when ego.x > 0.45\nrecord final ego.position in area as passed",
        "terminate when ego.x > 0.45\nrecord ego.position not in area as passed",
        "terminate after 1.2 seconds\nrecord initial ego.position in area as begins\n"
        "record final ego.position in area and ego.speed > 0.1 as ends",
    ],
)
def test_a_region_ends_a_run_as_in_scenic(tmp_path: Path, carsim_binary: Path, region: str, statements: str) -> None:
    source = flat(tmp_path, f"area = {REGIONS[region][0]}\n{statements}\nrecord final ego.x as x\n")
    assert not source.dynamic, source.needs_scenic
    # In the side view the car drives exactly along an edge.
    native, beside = both_ways(source, 0, 95.0, carsim_binary, ("--side-view",))
    assert rounded(native) == rounded(beside)


def test_a_monitor_does_not_change_where_a_circle_ends_a_run(tmp_path: Path, carsim_binary: Path) -> None:
    ending = "terminate when ego.position in CircularRegion((0.5, 0), 0.05)\nrecord final ego.x as x\n"
    monitor = "monitor Idle():\n    while True:\n        wait\nrequire monitor Idle()\n"
    native, _ = both_ways(flat(tmp_path, ending), 0, 95.0, carsim_binary)
    source = flat(tmp_path, ending + monitor)
    body, settings = car_texts(95.0, 8)
    with SteppedCarsim([str(carsim_binary)]) as stepped:
        simulator = CarSimulator(stepped, body, settings, lambda scene: json.dumps(source.describe(scene, 0)))
        watched = simulator.run(source.scenic_scene(0))

    assert source.dynamic and rounded(watched) == rounded(native)
    assert native["outcome"] == "terminated" and 0.45 < native["recorded"]["x"]["value"] < 0.46


def test_a_sector_is_compared_in_the_ground_plane(tmp_path: Path, carsim_binary: Path) -> None:
    """Only Scenic beside the simulation has sectors: this one is a quarter that opens towards the car."""
    statements = (
        "area = SectorRegion(0.5 @ 0, 0.2, 90 deg, 90 deg)\nterminate when ego.x > 0.6\nrecord ego.position as path\n"
        "record ego.position in area as inside\n"
    )
    source = flat(tmp_path, statements)
    body, settings = car_texts(95.0, 8)
    with SteppedCarsim([str(carsim_binary)]) as stepped:
        simulator = CarSimulator(stepped, body, settings, lambda scene: json.dumps(source.describe(scene, 0)))
        recorded = simulator.run(source.scenic_scene(0))["recorded"]

    inside = [value for _, value in recorded["inside"]["value"]]
    # The car drives along the sector's axis, so that only its radius counts.
    assert inside == [0.3 <= x <= 0.5 for _, (x, _, _) in recorded["path"]["value"]] and sum(inside) > 5


def test_a_region_with_a_hole_is_compared_by_scenic(tmp_path: Path, carsim_binary: Path) -> None:
    statements = (
        "area = RectangularRegion((0.5, 0), 0, 0.4, 1).difference(CircularRegion((0.5, 0), 0.1, 200))\n"
        "terminate when ego.x > 0.6 and ego.position in area\nrecord ego.position as path\n"
        "record ego.position in area as inside\n"
    )
    source = flat(tmp_path, statements)
    body, settings = car_texts(95.0, 8)
    with SteppedCarsim([str(carsim_binary)]) as stepped:
        simulator = CarSimulator(stepped, body, settings, lambda scene: json.dumps(source.describe(scene, 0)))
        result = simulator.run(source.scenic_scene(0))

    recorded = {name: [value for _, value in series["value"]] for name, series in result["recorded"].items()}
    assert source.needs_scenic == "line 5: a region with a hole" and result["outcome"] == "terminated"
    assert recorded["inside"] == [0.3 <= x <= 0.7 and math.hypot(x - 0.5, y) > 0.1 for x, y, _ in recorded["path"]]
    assert sum(recorded["inside"]) > 5


SHAPES = [
    ("CircularRegion((0.5, 0), 0)", "CircularRegion: radius 0 is not above 0 and finite"),
    ("CircularRegion((0.5, 0), -0.2)", "CircularRegion: radius -0.2 is not above 0 and finite"),
    ("SectorRegion(0.5 @ 0, 0.2, 0, 0)", "SectorRegion: angle 0 is not above 0 and finite"),
    ("SectorRegion((0.5, 0), 0.2, 0, 1)", "SectorRegion: center (0.5, 0) is not a vector: write x @ y"),
    ("RectangularRegion((0.5, 0), 0, 0, 1)", "RectangularRegion: width 0 is not above 0 and finite"),
    ("RectangularRegion((0.5, 0), 0, 1, float('inf'))", "RectangularRegion: length inf is not above 0 and finite"),
    ("RectangularRegion((0.5, 0), 0, Range(0, 0), 1)", "RectangularRegion: width 0 is not above 0 and finite"),
    ("PolygonalRegion([(0, 0), (1, 0)])", "PolygonalRegion: 2 corners: a polygon has at least 3"),
    ("PolygonalRegion([(0, 0), (1, 0), (2, 0)])", "PolygonalRegion: its corners lie on one line"),
    ("PolygonalRegion([(0, 0), (1, 1), (1, 0), (0, 1)])", "PolygonalRegion: its sides cross at (0.5, 0.5)"),
    ("PolygonalRegion([(0, 0), (1, 0), 'ab'])", "PolygonalRegion: corner 3 is not two finite numbers"),
    ("PolygonalRegion([(0, 0), (1, Range(0, 1)), (2, 3)])", "PolygonalRegion: corner 2 is not two finite numbers"),
]


@pytest.mark.parametrize(("region", "message"), SHAPES)
@pytest.mark.parametrize("ending", ["", "\nmonitor M():\n    wait\nrequire monitor M()"], ids=["alone", "monitor"])
def test_a_region_without_an_area_is_refused_in_plain_words(
    tmp_path: Path, region: str, message: str, ending: str
) -> None:
    with pytest.raises(FoldcarError) as error:
        flat(tmp_path, f"area = {region}\nterminate when ego.position in area{ending}\n").sample(0)
    assert message in str(error.value) and "Error" not in str(error.value)
    assert "line 4: " in str(error.value) or "Range" in region


def test_a_value_that_is_no_finite_number_fails_its_run(tmp_path: Path, carsim_binary: Path) -> None:
    source = opened(tmp_path, "terminate when ego.x > 9\nrecord final 1 / (ego.x - ego.x) as x")
    body, settings = car_texts(95, 1)
    request = RunRequest("car", "scene", settings, "run", 0)
    (result,) = Carsim(carsim_binary).run({"car": body}, {"scene": json.dumps(source.sample(0))}, [request])
    assert result == {"error": "the program divides by zero"}


@pytest.mark.parametrize(
    ("statements", "message"),
    [
        ("import math\nrecord final math.sqrt(-1) + ego.x as x", "line 12: ValueError: math domain error"),
        ("record final 1 / 0 + ego.x as x", "line 11: ZeroDivisionError: division by zero"),
        ("terminate when (distance to (0.1, 0.2) + (0.3, 0)) < 1", "line 11: (0.1, 0.2, 0.3, 0) is not a place to "),
        ("terminate when (distance to None) < 1", "line 11: None is not a place to measure a distance from"),
        ("terminate when ego.x > 1 and 4", "line 11: 4 beside `and` or `or` is neither True nor False"),
        ("param box = object()\nterminate when ego.x > globalParameters.box", "line 12: a object cannot be used in a "),
        (
            "class Sign(Marker):\n    @property\n    def limit(self): return 1\nparam s = [new Sign at (0.1, 0.5)]\n"
            "terminate when ego.x > globalParameters.s[0].limit",
            "line 15: `limit` of a Sign is code, which a condition or record cannot",
        ),
        ("record initial '\\ud800' as a", r"record a: the string '\ud800' is not Unicode"),
        ("b = 10 ** 400\nrecord initial b as a", "record a: an integer is above the limit 1.8e+308"),
        ("param a = eval('[' * 22 + ']' * 22)\nrecord initial globalParameters.a as a", "value is nested deeper"),
    ],
)
def test_what_cannot_be_evaluated_is_refused_in_one_line(tmp_path: Path, statements: str, message: str) -> None:
    with pytest.raises(FoldcarError) as error:
        opened(tmp_path, f"{statements}\nterminate when ego.x > 1").sample(0)
    assert message in str(error.value) and "\n" not in str(error.value)


def test_a_limit_that_is_not_above_zero_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FoldcarError, match=r"program\.scenic: sample 0: terminate after 0 s: is not above 0"):
        opened(tmp_path, "terminate after 0 seconds").sample(0)


@pytest.mark.parametrize("outer_step_s", [0.25, 0.1, 0.05])
def test_figure_11_passes_as_often_at_every_outer_step(
    tmp_path: Path, write_listing: WriteListing, listing_data: Any, carsim_binary: Path, outer_step_s: float,
    seen: dict[str, Any],
) -> None:  # fmt: skip
    environment = {"scenic_filename": str(SCENARIOS / "paper_bumps_mutated.scenic"), "seed": 42}
    listing_data["environments"]["1"] = {**environment, "scenic_params": {"outer_step_s": outer_step_s}}
    listing_data["experiments"]["1"]["params"]["environments"] = 3
    swept(write_listing(listing_data), tmp_path / "s.db", carsim_binary, 1)
    with Store.open(tmp_path / "s.db") as store:
        results = [(result.outcome, result.metrics["elapsed_time_s"]) for result in store.results()]
    assert {outcome for outcome, _ in results} <= {"passed", "stuck", "tipped", "off_course"}
    assert seen.setdefault("results", results) == results


@pytest.fixture(scope="module")
def seen() -> dict[str, Any]:
    """What the tests before have found."""
    return {}


READING: list[tuple[Callable[[dict[str, Any]], Any], str]] = [
    (lambda program: program["endings"][0].update(when=["x_m", "<"]), 'endings.0.when[1]: "<" lacks its operands'),
    (lambda program: program["endings"][0].update(when=["x_m"]), "endings.0.when: leaves no truth"),
    (lambda program: program["endings"][0].update(when=["q"]), 'is no number, truth, polygon or operator: "q"'),
    (lambda program: program["endings"][0].update(when=[[0, 0, 1, 1]]), "must be x and y of 3 to 1000 corners"),
    (lambda program: program["endings"][0].update(outcome="won"), "endings.0.outcome"),
    (lambda program: program.update(verdict=["x_m"]), "program.verdict: leaves no truth"),
    (lambda program: program.update(records=[{"name": "n", "kind": "final", "value": []}]), "leaves neither one number"),
    (lambda program: program.update(step_s=0), "program.step_s: 0"),
]


@pytest.mark.parametrize(("change", "message"), READING)
def test_a_wrong_program_is_refused(tmp_path: Path, carsim_binary: Path, change: Any, message: str) -> None:
    scene = opened(tmp_path, "terminate when ego.x > 1").sample(0)
    change(scene["program"])
    body, settings = car_texts(95, 8)
    with pytest.raises(FoldcarError) as error:
        Carsim(carsim_binary).run(
            {"car": body}, {"scene": json.dumps(scene)}, [RunRequest("car", "scene", settings, "run", 0)]
        )
    assert message in str(error.value)
