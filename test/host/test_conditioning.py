"""Conditioning: named parts keep their values, the rest is sampled anew, the given scene is unchanged."""

from pathlib import Path
from typing import Any

import pytest

import foldcar
from foldcar.errors import FoldcarError
from foldcar.scenes.source import SceneSource, open_environment

# Noise on an object, an object placed relative to another, a point, a list of objects, two parameters.
PROGRAM = """model model
param friction = Range(0.3, 0.8)
param tall = Range(0.01, 0.03)
place = new Point at (Range(0.3, 0.4), Range(-0.1, 0.1))
ego = new Robot at (0, Range(-0.02, 0.02)), facing -90 deg
bump = new Bump at (Range(0.5, 0.6), 0), facing -90 deg, with height globalParameters.tall
behind = new Step ahead of bump by Range(0.2, 0.3), with height 0.005
stones = [new Bump at (x, Range(0.2, 0.4)), with height 0.01, with allowCollisions True for x in (0.4, 0.5)]
mark = new Kerb at place, facing -90 deg
goal = new Goal at (1.8, Range(-0.1, 0.1)), facing -90 deg
mutate bump, goal by 0.02
"""
# The order of the terrain in a scene.
BUMP, BEHIND, STONE, OTHER_STONE, MARK = range(5)
SAMPLES = range(4)
Scene = dict[str, Any]
# A value that two objects share and Scenic converts for each: `facing` takes a heading from an angle or a point.
SHARED = """model model
turn = {value}
ego = new Robot at (-0.35, 0), facing -90 deg
one = new Bump at (0.5, 0), facing turn, with height 0.01, with allowCollisions True
other = new Bump at (0.8, Range(-0.1, 0.1)), facing turn, with height 0.01
{more}
goal = new Goal at (1.8, 0), facing -90 deg
"""
POINT = "new OrientedPoint at ({x}, 0), facing Range({low}, {low} + 1)"


@pytest.fixture
def source(tmp_path: Path) -> SceneSource:
    return opened(tmp_path)


def opened(folder: Path, **options: Any) -> SceneSource:
    program = folder / "program.scenic"
    program.write_text(PROGRAM)
    return open_environment(program, {}, 5, **options)


def place(piece: Scene) -> tuple[float, float, float]:
    return piece["x_m"], piece["y_m"], piece["heading_rad"]


def places(scenes: list[Scene], index: int) -> set[tuple[float, float, float]]:
    return {place(scene["terrain"][index]) for scene in scenes}


def frozen(source: SceneSource, sample: int = 2, **names: Any) -> tuple[Scene, list[Scene]]:
    """That sample, and others once these names are frozen as they are in it, which leaves the given scene as it was."""
    scene = source.scenic_scene(sample)
    kept = source.describe(scene, sample)
    foldcar.condition(source.scenario, scene, **names)
    assert source.describe(scene, sample) == kept
    return kept, [source.sample(k) for k in SAMPLES]


def test_scenics_own_conditioning_moves_what_is_mutated(source: SceneSource) -> None:
    """Scenic's defect that foldcar's conditioning avoids; this test fails when Scenic corrects it."""
    scene = source.scenic_scene(2)
    kept = source.describe(scene, 2)
    source.scenario.conditionOn(scene=scene, objects=range(len(scene.objects)))
    assert len(places([source.sample(k) for k in SAMPLES], BUMP)) == len(SAMPLES)
    assert source.describe(scene, 2) != kept


def test_everything_frozen_is_the_same_scene_each_time(source: SceneSource) -> None:
    kept, scenes = frozen(source)
    assert scenes == [kept] * len(SAMPLES)


@pytest.mark.parametrize(
    ("names", "params", "still"),
    [
        (["bump"], ["tall"], {BUMP}),
        (["goal"], [], set()),
        (["stones"], [], {STONE, OTHER_STONE}),
        (["behind", "bump"], ["tall"], {BEHIND, BUMP}),
        (["mark", "place"], [], {MARK}),
        (["bump", "mark", "place"], ["tall"], {BUMP, MARK}),
    ],
)
def test_named_objects_keep_their_place_and_the_others_vary(
    source: SceneSource, names: list[str], params: list[str], still: set[int]
) -> None:
    kept, scenes = frozen(source, objects=names, params=params)
    for index in range(5):
        expected = {place(kept["terrain"][index])} if index in still else None
        found = places(scenes, index)
        assert found == expected if expected is not None else len(found) == len(SAMPLES)
    goals = {place(scene["goal"]) for scene in scenes}
    assert goals == {place(kept["goal"])} if "goal" in names else len(goals) == len(SAMPLES)
    # Objects that share a parameter leave it free.
    assert len({scene["friction"] for scene in scenes}) == len(SAMPLES)


@pytest.mark.parametrize(
    ("condition", "part"),
    [
        ({"objects": ["bump"]}, '"bump" depends on a random value of param "tall", which would be frozen too: '),
        ({"objects": ["mark"]}, '"mark" depends on a random value of "place", which'),
        (
            {"objects": ["behind"], "params": ["tall"]},
            '"behind" depends on a random value of "bump", which would be frozen too: name it as well, or leave both',
        ),
        ({"params": ["twice"]}, 'param "twice" depends on a random value of param "friction", which'),
        ({"objects": ["last"]}, '"last" depends on a random value of the Bump of line 14, which has no name, which'),
    ],
)
def test_a_random_value_is_not_frozen_for_what_is_not_named(tmp_path: Path, condition: dict[str, Any], part: str) -> None:
    program = tmp_path / "program.scenic"
    program.write_text(
        f"{PROGRAM}param twice = 2 * globalParameters.friction\ndeep = Range(0.01, 0.02)\n"
        "new Bump at (1.2, 0), with height deep\nlast = new Kerb at (1.5, 0), with height deep\n"
    )
    with pytest.raises(FoldcarError) as caught:
        open_environment(program, {}, 5, {"sample": 1, **condition})
    assert f"condition: {part}" in str(caught.value)


def test_what_depends_on_a_frozen_value_follows_it(tmp_path: Path) -> None:
    program = tmp_path / "program.scenic"
    program.write_text(f"{PROGRAM}param twice = 2 * globalParameters.friction\n")
    kept = open_environment(program, {}, 5).scenic_scene(1).params
    source = open_environment(program, {}, 5, {"sample": 1, "params": ["friction"]})
    for k in SAMPLES:
        params = source.scenic_scene(k).params
        assert params["twice"] == 2 * params["friction"] == kept["twice"]
        assert params["tall"] != kept["tall"] or k == 1


def test_objects_of_the_scene_may_be_given_instead_of_names(source: SceneSource) -> None:
    scene = source.scenic_scene(1)
    kept = source.describe(scene, 1)
    bump = next(thing for thing in scene.objects if type(thing).__name__ == "Bump")
    foldcar.condition(source.scenario, scene, objects=[bump, scene.egoObject], params=["tall"])
    scenes = [source.sample(k) for k in SAMPLES]
    assert places(scenes, BUMP) == {place(kept["terrain"][BUMP])}
    assert all(one["start"] == kept["start"] for one in scenes)


def test_a_frozen_point_takes_along_what_stands_at_it(source: SceneSource) -> None:
    kept, scenes = frozen(source, objects=["place"])
    assert places(scenes, MARK) == {place(kept["terrain"][MARK])}
    assert len(places(scenes, BUMP)) == len(SAMPLES)


def test_what_is_placed_relative_to_a_frozen_object_keeps_its_own_randomness_only(source: SceneSource) -> None:
    """The noise of `mutate` moves the bump alone: the step is 0.2 to 0.3 m ahead of the bump's unperturbed position."""
    scene = source.scenic_scene(2)
    foldcar.condition(source.scenario, scene, objects=["bump"], params=["tall"])
    x = [source.sample(k)["terrain"][BEHIND]["x_m"] for k in range(20)]
    assert len(set(x)) == 20
    assert max(x) - min(x) < 0.1
    # What has been frozen before need not be named again.
    foldcar.condition(source.scenario, scene, objects=["behind"])
    assert len(places([source.sample(k) for k in SAMPLES], BEHIND)) == 1


def test_frozen_parameters_and_free_objects(source: SceneSource) -> None:
    kept, scenes = frozen(source, params=["friction", "tall"])
    assert {one["friction"] for one in scenes} == {kept["friction"]}
    assert {one["terrain"][BUMP]["height_m"] for one in scenes} == {kept["terrain"][BUMP]["height_m"]}
    assert len(places(scenes, BUMP)) == len(places(scenes, STONE)) == len(SAMPLES)


def test_the_listings_condition_does_the_same(tmp_path: Path, source: SceneSource) -> None:
    scene = source.scenic_scene(3)
    foldcar.condition(source.scenario, scene, objects=["bump", "ego"], params=["friction", "tall"])
    listed = opened(tmp_path, condition={"sample": 3, "objects": ["bump", "ego"], "params": ["friction", "tall"]})
    assert [listed.sample(k) for k in SAMPLES] == [source.sample(k) for k in SAMPLES]
    kept = opened(tmp_path).sample(3)
    assert place(listed.sample(0)["terrain"][BUMP]) == place(kept["terrain"][BUMP])
    whole = opened(tmp_path, condition={"sample": 3})
    assert [whole.sample(k) for k in SAMPLES] == [kept] * len(SAMPLES)


@pytest.mark.parametrize(
    ("value", "more"),
    [
        ("Uniform(Range(0, 1), Range(2, 3))", ""),
        ("Discrete({Range(0, 1): 1, Range(1, 2): 3})", "new Kerb at (1, 0), facing turn"),
        (f"Uniform({POINT.format(x=1.1, low=0)}, {POINT.format(x=1.2, low=2)})", "new Kerb at turn"),
    ],
)
def test_a_value_that_is_converted_for_several_objects_is_frozen_with_the_first(
    tmp_path: Path, value: str, more: str
) -> None:
    program = tmp_path / "shared.scenic"
    program.write_text(SHARED.format(value=value, more=more))
    source = open_environment(program, {}, 5)
    scene = source.scenic_scene(7)
    kept = source.describe(scene, 7)["terrain"]
    with pytest.raises(FoldcarError, match=r'^condition: "other" depends on a random value of "one", which'):
        foldcar.condition(source.scenario, scene, objects=["other"])
    assert len({source.sample(k)["terrain"][1]["heading_rad"] for k in range(20)}) == 20
    foldcar.condition(source.scenario, scene, objects=["one"])
    samples = [source.sample(k)["terrain"] for k in range(20)]
    assert all(place(sample[0]) == place(kept[0]) for sample in samples)
    assert {piece["heading_rad"] for sample in samples for piece in sample[:2]} == {kept[0]["heading_rad"]}
    assert len({sample[1]["y_m"] for sample in samples}) == 20


@pytest.mark.parametrize(
    ("condition", "part"),
    [
        (
            {"sample": 0, "objects": ["bmp"]},
            'condition: objects: no "bmp"; the program names: behind, bump, ego, goal, mark, place, stones',
        ),
        ({"sample": 0, "params": ["frction"]}, 'condition: params: no "frction"; the program\'s parameters are: '),
    ],
)
def test_unknown_names_are_refused(tmp_path: Path, condition: dict[str, Any], part: str) -> None:
    with pytest.raises(FoldcarError) as caught:
        opened(tmp_path, condition=condition)
    assert part in str(caught.value)
    assert str(caught.value).startswith(f"{tmp_path / 'program.scenic'}: ")
