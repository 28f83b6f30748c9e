"""The classes of model.scenic: terrain pieces with the sizes and poses that their properties describe."""

import math
from pathlib import Path
from typing import Any

import numpy
import pytest

from foldcar.errors import FoldcarError
from foldcar.scenes.program import VOCABULARY_DIR
from foldcar.scenes.source import open_environment
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.heights import carsim_heights
from study_car import empty_scene

PLACES = "ego = new Robot at (-0.3, 0), facing -90 deg\ngoal = new Goal at (1.8, 0), facing -90 deg\n"
EAST = "at (0.5, 0.1), facing -90 deg"


def terrain(folder: Path, text: str, sample: int = 0) -> list[dict[str, Any]]:
    """The terrain of a program that places ``text`` besides a start and a goal."""
    program = folder / "program.scenic"
    program.write_text(f"model model\n{PLACES}{text}\n")
    pieces: list[dict[str, Any]] = open_environment(program, {}, 5).sample(sample)["terrain"]
    return pieces


def there(kind: str, x_m: float = 0.5, **sizes: float) -> dict[str, Any]:
    return {"kind": kind, "x_m": pytest.approx(x_m), "y_m": 0.1, "heading_rad": 0.0, **sizes}


def upright(kind: str, x_m: float, length_m: float, width_m: float, height_m: float) -> dict[str, Any]:
    return there(kind, x_m, length_m=pytest.approx(length_m), width_m=width_m, height_m=height_m)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("Bump {}, with height 0.01", [upright("box", 0.5, 0.06, 1.2, 0.01)]),
        ("RoundBump {}, with length 0.1", [upright("half_round", 0.5, 0.1, 1.2, 0.02)]),
        ("Step {}, with width 0.7", [upright("box", 0.5, 0.4, 0.7, 0.02)]),
        (
            "Kerb {}, with length 0.2, with face 0.05, with height 0.03",
            [upright("ramp", 0.425, 0.05, 1.2, 0.03), upright("box", 0.525, 0.15, 1.2, 0.03)],
        ),
        ("Kerb {}, with face 0", [upright("box", 0.5, 0.3, 1.2, 0.02)]),
        ("Ramp {}, with run_up 0.3", [upright("ramp", 0.5, 0.3, 0.6, 0.04)]),
        (
            "Ramp {}, with run_up 0.1, with plateau 0.2, with run_down 0.3",
            [
                upright("ramp", 0.25, 0.1, 0.6, 0.04),
                upright("box", 0.4, 0.2, 0.6, 0.04),
                {**upright("ramp", 0.65, 0.3, 0.6, 0.04), "heading_rad": pytest.approx(-math.pi)},
            ],
        ),
        (
            "StepPyramid {}, with steps 2, with step_height 0.01, with top_side 0.1, with tread 0.02",
            [upright("box", 0.5, 0.14, 0.14, 0.01), upright("box", 0.5, 0.1, 0.1, 0.02)],
        ),
        (
            "GaussianHill {}, with sd_along 0.05, with height -0.01",
            [there("hill", sd_along_m=0.05, sd_across_m=0.05, height_m=-0.01)],
        ),
        (
            "Pothole {}, with diameter 0.2",
            [{"kind": "pothole", "x_m": 0.5, "y_m": 0.1, "radius_m": 0.1, "depth_m": 0.015, "edge_m": 0.03}],
        ),
        (
            "RoughGround {}, with amplitude 0.002, with seed 7",
            [there("rough", length_m=0.6, width_m=1.0, height_sd_m=0.002, correlation_m=0.03, seed=7)],
        ),
        ("FrictionPatch {}, with friction 0.2", [there("patch", length_m=0.3, width_m=1.0, friction=0.2)]),
        ("Marker {}", []),
    ],
)
def test_a_class_is_made_of_its_pieces(tmp_path: Path, text: str, expected: list[dict[str, Any]]) -> None:
    assert terrain(tmp_path, f"new {text.format(EAST)}") == expected


# Properties of Scenic's that are about sampling, seeing and drawing, not about what stands there.
ABOUT_SAMPLING = {
    *("allowCollisions", "regionContainedIn", "requireVisible", "occluding", "creationLine", "mutator", "mutationScale"),
    *("positionStdDev", "headingStdDev", "orientationStdDev", "name", "color", "render", "showVisibleRegion", "sensors"),
    *("viewAngle", "viewAngles", "visibleDistance", "viewRayDensity", "viewRayCount", "viewRayDistanceScaling"),
    *("cameraOffset", "visionSensorOffset", "contactTolerance", "sideComponentThresholds", "onDirection", "lastActions"),
    *("baseOffset", "behavior", "parentOrientation", "position", "pitch", "roll", "yaw"),
}
# What a car or an empty place is as large as: specifiers such as `behind` use it, and the check of a free start.
FOR_SPECIFIERS = {(kind, size) for kind in ("Marker", "Goal", "Robot") for size in ("width", "length", "height")}
KINDS_OF_TERRAIN = (
    *(
        "Bump",
        "RoundBump",
        "Step",
        "Kerb",
        "Ramp",
        "StepPyramid",
        "GaussianHill",
        "Pothole",
        "RoughGround",
        "FrictionPatch",
    ),
)


def properties(folder: Path) -> dict[str, list[str]]:
    """The properties of each class of the vocabulary."""
    program = folder / "program.scenic"
    program.write_text(f"model model\n{PLACES}")
    scenario = open_environment(program, {}, 5).scenario
    names = scenario.dynamicScenario._dummyNamespace
    return {kind: sorted(names[kind]._defaults) for kind in (*KINDS_OF_TERRAIN, "Marker", "Goal", "Robot")}


def described(folder: Path, kind: str, more: str) -> dict[str, Any] | str:
    """The scene with an object of that kind, or why it is refused."""
    made = {"Goal": "goal = new Goal at (1.8, 0)", "Robot": "ego = new Robot at (-0.3, 0)"}.get(kind)
    rest = "\n".join(line for line in PLACES.splitlines() if f"new {kind}" not in line)
    program = folder / "p.scenic"
    program.write_text(f"model model\n{rest}\n{made or f'new {kind} at (0.5, 0.1)'}, facing -90 deg{more}\n")
    try:
        return open_environment(program, {}, 5).sample(0)
    except FoldcarError as error:
        return str(error)


@pytest.mark.slow
def test_every_property_has_an_effect_or_is_refused(tmp_path: Path) -> None:
    """A property that is accepted and changes nothing would leave its author with another world than he thinks."""
    values = {"shape": "BoxShape()", "velocity": "(1, 0, 0)", "angularVelocity": "(0, 0, 1)", "steps": "2"}
    useless = []
    for kind, names in properties(tmp_path).items():
        plain = described(tmp_path, kind, "")
        assert isinstance(plain, dict), plain
        for name in names:
            if name in ABOUT_SAMPLING or (kind, name) in FOR_SPECIFIERS or name.startswith("_"):
                continue
            if described(tmp_path, kind, f", with {name} {values.get(name, '0.0123')}") == plain:
                useless.append((kind, name))
    assert not useless


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("new StepPyramid at (0.5, 0), with width 0.3", "line 4: StepPyramid: width follows from steps, top_side, tread"),
        ("new Ramp at (0.5, 0), with length 0.3", "Ramp: length follows from plateau, run_down, run_up: set these"),
        ("new Pothole at (0.5, 0), with height 0.3", "Pothole: height has no meaning here"),
        ("new Bump at (0.5, 0), with friction 0.3", "Bump has no property friction; FrictionPatch has"),
        ("new GaussianHill at (0.5, 0), with sd 0.05", "GaussianHill has no property sd; did you mean sd_along?"),
        (
            "new GaussianHill at (0.5, 0), with sd_along 0.1, with length 0.2",
            "length 0.2 m is not 4 times sd_along, 0.1 m",
        ),
        ("new Bump at (0.5, 0), with shape BoxShape()", "Bump: shape has no effect: its class decides the shape"),
        ("behavior B():\n    wait\nego = new Robot at (0, 0), with behavior B", "line 6: Robot: behavior has no effect"),
        ("terminate when ego.postion.x > 1", "line 4: ego has no property postion; did you mean"),
        ("record final goal.widht as w", "line 4: goal has no property widht; did you mean"),
        ("new Marker visible", "give x and y only, or a region of the ground such as RectangularRegion"),
    ],
)
def test_what_has_no_effect_is_refused(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(FoldcarError) as error:
        terrain(tmp_path, text)
    assert message in str(error.value)


def test_a_hill_is_as_wide_and_long_as_it_is_said_to_be(tmp_path: Path) -> None:
    assert terrain(tmp_path, f"new GaussianHill {EAST}, with width 0.2, with length 0.4, with height 0.02") == [
        there("hill", sd_along_m=0.1, sd_across_m=0.05, height_m=0.02)
    ]
    # What stands ahead of it begins where it ends.
    hill = f"hill = new GaussianHill {EAST}, with sd_along 0.05\nnew Bump ahead of hill"
    assert terrain(tmp_path, hill)[1]["x_m"] == pytest.approx(0.5 + 0.1 + 0.03, abs=1e-4)


def test_pieces_off_the_middle_turn_with_their_object(tmp_path: Path) -> None:
    # Facing +y, "ahead" is +y and "left" is -x.
    own = (
        "class Posts(Terrain):\n"
        "    def pieces(self):\n"
        "        size = {'kind': 'box', 'length_m': 0.02, 'width_m': 0.03, 'height_m': 0.04}\n"
        "        return [{**size, 'x_m': 0.2}, {**size, 'y_m': 0.1, 'heading_rad': 30 deg}]\n"
        "new Posts at (1, 0.5)\n"
    )
    ahead, left = terrain(tmp_path, own)
    assert (ahead["x_m"], ahead["y_m"]) == pytest.approx((1.0, 0.7))
    assert (left["x_m"], left["y_m"]) == pytest.approx((0.9, 0.5))
    assert ahead["heading_rad"] == pytest.approx(math.pi / 2)
    assert left["heading_rad"] == pytest.approx(math.pi / 2 + math.radians(30))


def test_a_ramp_leads_up_from_the_side_that_it_is_met_from(tmp_path: Path, carsim_binary: Path) -> None:
    pieces = terrain(tmp_path, f"new Ramp {EAST}, with run_up 0.4, with plateau 0.2, with run_down 0.2")
    x_m = [0.0, 0.1, 0.2, 0.3, 0.5, 0.7, 0.75, 0.85, 0.91]
    expected = [0.0, 0.0, 0.01, 0.02, 0.04, 0.04, 0.03, 0.01, 0.0]
    heights = carsim_heights(Carsim(carsim_binary))
    heights_m = heights(empty_scene(pieces), numpy.array(x_m), numpy.full(len(x_m), 0.1))
    assert heights_m == pytest.approx(expected, abs=1e-6)


def test_rough_ground_differs_from_sample_to_sample_unless_it_has_a_seed(tmp_path: Path) -> None:
    both = f"new RoughGround {EAST}\nnew RoughGround {EAST}, with seed 4"
    seeds = [[piece["seed"] for piece in terrain(tmp_path, both, sample)] for sample in range(4)]
    assert len({drawn for drawn, _ in seeds}) == 4
    assert {given for _, given in seeds} == {4}


def test_a_copy_of_the_model_beside_the_program_is_used(tmp_path: Path) -> None:
    model = VOCABULARY_DIR / "model.scenic"
    (tmp_path / "model.scenic").write_text(model.read_text().replace("friction = 0.6", "friction = 0.3"))
    program = tmp_path / "program.scenic"
    program.write_text(f"model model\n{PLACES}")
    assert open_environment(program, {}, 1).sample(0)["friction"] == 0.3
