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
        (["stones"], [], {STONE, OTHER_STONE}),
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
        positions = places(scenes, index)
        assert positions == expected if expected is not None else len(positions) == len(SAMPLES)
    goals = {place(scene["goal"]) for scene in scenes}
    assert goals == {place(kept["goal"])} if "goal" in names else len(goals) == len(SAMPLES)
    # Objects that share a parameter leave it free.
    assert len({scene["friction"] for scene in scenes}) == len(SAMPLES)


@pytest.mark.parametrize(
    ("condition", "part"),
    [
        ({"objects": ["bump"]}, '"bump" depends on a random value of param "tall", which would be frozen too: '),
        (
            {"objects": ["behind"], "params": ["tall"]},
            '"behind" depends on a random value of "bump", which would be frozen too: name both, or neither',
        ),
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
    ("condition", "part"),
    [
        (
            {"sample": 0, "objects": ["bmp"]},
            'condition: objects: no "bmp"; the program names: behind, bump, ego, goal, mark, place, stones',
        ),
        ({"sample": 0, "params": ["frction"]}, 'condition: params: no "frction"; the program names: '),
    ],
)
def test_unknown_names_are_refused(tmp_path: Path, condition: dict[str, Any], part: str) -> None:
    with pytest.raises(FoldcarError) as caught:
        opened(tmp_path, condition=condition)
    assert part in str(caught.value)
    assert str(caught.value).startswith(f"{tmp_path / 'program.scenic'}: ")
