"""Names of Scenic that are not public stand for what scenic_private says: a new version of Scenic fails here first."""

import math
from pathlib import Path
from typing import Any

import pytest
from scenic.core.requirements import RequirementType
from scenic.core.simulators import Simulation

from foldcar.scenes import scenic_private as private
from foldcar.scenes.source import open_environment

PACKAGE = Path(private.__file__).resolve().parents[1]
HEAD = "model model\nego = new Robot at (0, Range(0, 0.1)), facing -90 deg\ngoal = new Goal at (1, 0), facing -90 deg\n"
BEHAVIOR = "behavior Wait():\n    while True:\n        wait\nmoved = new Marker at (0.5, 0.5), with behavior Wait()\n"
MODULAR = "model model\nscenario Main():\n    setup:\n        ego = new Robot at (0, 0), facing -90 deg\n        h = 3\n"


def scenario(folder: Path, text: str) -> Any:
    (folder / "p.scenic").write_text(text)
    return open_environment(folder / "p.scenic", {}, 1).scenario


class Idle(Simulation):  # type: ignore[misc]
    """A simulation in which nothing moves."""

    def setup(self) -> None:
        super().setup()
        private.end_simulation_when(self.scene.dynamicScenario, _Never())
        self.endings = private.endings(self.scene.dynamicScenario)

    def createObjectInSimulator(self, obj: Any) -> None:  # noqa: N802
        pass

    def step(self) -> None:
        dynamic = self.scene.dynamicScenario
        self.monitors = list(private.requirement_monitors(dynamic))
        self.running = [private.running_generator(agent.behavior) for agent in self.agents]
        self.copy = private.shown_copy(self.scene.egoObject)
        self.values = private.recorded(dynamic, RequirementType.record, self.currentTime)

    def getProperties(self, obj: Any, properties: set[str]) -> dict[str, Any]:  # noqa: N802
        return {name: getattr(obj, name) for name in properties}


class _Never:
    is_truthy = False

    def isTrue(self) -> "_Never":  # noqa: N802
        return self


def test_no_other_file_uses_a_private_name() -> None:
    import re

    names = set(re.findall(r"(?:\.|\")(_[a-z]\w+)", Path(private.__file__).read_text()))
    assert len(names) > 20
    for file in [*(PACKAGE / "scenes").glob("*.py"), *(PACKAGE / "simulation").glob("*.py")]:
        if file.name != "scenic_private.py":
            used = set(re.findall(r"(?<!self)\.(_[a-z]\w+)", file.read_text())) & names
            assert not used, file


def test_classes_have_properties_with_sources(tmp_path: Path) -> None:
    made = scenario(tmp_path, f"{HEAD}new Ramp at (0.5, 0), facing -90 deg\n")
    ramp = type(next(thing for thing in private.instances(made) if type(thing).__name__ == "Ramp"))
    assert {"run_up", "length", "position"} <= set(private.defaults(ramp))
    assert {"length", "heading"} <= private.final_properties(ramp) and "run_up" not in private.final_properties(ramp)
    assert private.sources_of(ramp, "length") == ["plateau", "run_down", "run_up"]
    assert private.caches(ramp) and all(name.startswith("_cached_") for name in private.caches(ramp))
    assert {"heading", "orientation"} <= private.derived_while_driving(ramp)


def test_a_scenario_has_names_parts_and_a_limit(tmp_path: Path) -> None:
    plain = scenario(tmp_path, f"{HEAD}h = 2\nterminate after 4 steps\n{BEHAVIOR}").dynamicScenario
    assert private.names(plain)["h"] == 2 and private.file_of(plain) == str(tmp_path / "p.scenic")
    assert not private.is_modular(plain) and not private.has_compose(plain)
    assert [type(agent).__name__ for agent in private.agents(plain)] == ["Marker"]
    assert private.is_limited(plain) and private.time_limit_s(plain, 0.25) == 1.0
    compose = "    compose:\n        wait\n        terminate\n"
    modular = scenario(tmp_path, MODULAR + compose).dynamicScenario
    assert private.is_modular(modular) and private.has_compose(modular) and private.names(modular)["h"] == 3
    assert not private.is_limited(modular) and private.time_limit_s(modular, 0.25) == math.inf


def test_samples_know_what_they_are_of(tmp_path: Path) -> None:
    made = scenario(tmp_path, HEAD)
    scene, _ = made.generate()
    ego = made.egoObject
    assert private.unsampled(scene.egoObject) is ego and private.unsampled(ego) is ego
    assert private.conditioned(ego) is ego and any(dependency is not ego for dependency in private.dependencies(ego))


def test_objects_are_made_and_sampled(tmp_path: Path) -> None:
    made = scenario(tmp_path, HEAD)
    goal = type(next(thing for thing in made.objects if type(thing).__name__ == "Goal"))
    lone = private.made(goal, [], is_object=False)
    assert all(lone is not instance for instance in private.instances(made))
    private.sample_always(lone)
    assert lone.sample() is not lone


def test_a_simulation_shows_its_parts(tmp_path: Path) -> None:
    text = (
        f"{HEAD}{BEHAVIOR}terminate when ego.position.x > 1\nterminate after 3 steps\nrequire always ego.position.x < 2\n"
        "record ego.position.x as x\n"
    )
    made = scenario(tmp_path, text)
    scene, _ = made.generate()
    private.forget_last_simulation(scene.dynamicScenario)
    simulation = Idle(scene, maxSteps=9, name="idle", timestep=0.1)
    assert simulation.result.terminationReason == "reached time limit"
    assert [ending.ty for ending in simulation.endings[:1]] == [RequirementType.terminateWhen] and len(
        simulation.endings
    ) == 2
    assert len(simulation.monitors) == len(simulation.running) == 1
    assert simulation.copy is not scene.egoObject and simulation.values == {"x": pytest.approx(0)}
    assert not list(private.invoked(scene.dynamicScenario))
    assert isinstance(list(private.temporal_requirements(scene.dynamicScenario)), list)
    private.derive_again(simulation.copy)
    assert simulation.copy.heading == pytest.approx(-math.pi / 2)
    limited = scene.dynamicScenario
    private.round_time_limit(limited)
    private.defer_time_limit(limited)
