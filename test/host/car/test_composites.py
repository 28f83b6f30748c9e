"""Cars composed by a script: the publication's Appendix C in examples/snake.py, modules of modules, mistakes in them."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from foldcar.car.body import body_json, car_json
from foldcar.car.design import DesignError, compose
from foldcar.car.design_parameters import MODULES, USER_FILES, parameters
from foldcar.car.folded_car import folded_car
from foldcar.car.user_modules import load_components
from foldcar.car.verify import verify
from foldcar.errors import FoldcarError
from foldcar.fabrication.patterns.options import options
from foldcar.fabrication.patterns.sheets import pattern
from foldcar.study.family import read_family
from foldcar.study.listing import ListedVehicle

PROJECT = Path(__file__).parents[3]
DOC = (PROJECT / "docs" / "compiler.md").read_text(encoding="utf-8")
PART = DOC[DOC.index("## Cars composed by a script") :].partition("## Verification")[0]
SNAKE = (PROJECT / "examples" / "snake.py").read_text(encoding="utf-8")
(TYPE_STRING,) = re.findall("```json\n(.*?)```", PART, re.S)


@pytest.fixture(autouse=True)
def forget_own_modules() -> Iterator[None]:
    """Unregister user modules after each test."""
    before = dict(MODULES)
    yield
    for letter in set(MODULES) - set(before):
        del MODULES[letter]
    USER_FILES.clear()
    parameters.cache_clear()


def load(folder: Path, text: str, name: str = "snake.py") -> Path:
    """The file with that text, loaded."""
    file = folder / name
    file.write_text(text)
    load_components(file)
    return file


def listed_design() -> Any:
    """The design that the documentation gives as a type string."""
    vehicle = ListedVehicle.model_validate(json.loads(TYPE_STRING))
    return read_family(Path("cars.json"), "v", vehicle).single()


@pytest.mark.slow
def test_the_script_s_car_is_that_of_the_type_string(tmp_path: Path) -> None:
    load(tmp_path, SNAKE)
    scripted, listed = compose("Snake", {}), listed_design()

    cars = [folded_car(design) for design in (scripted, listed)]
    assert cars[0] == cars[1]
    assert body_json(scripted) == body_json(listed)
    assert {**car_json(scripted), "name": "", "hash": ""} == {**car_json(listed), "name": "", "hash": ""}
    assert verify(scripted).findings == ()
    assert [(axle.radius_mm, axle.driven) for axle in cars[0].axles[::2]] == [(36, True), (36, False), (60, True)]
    sheets = [pattern(car, options("silhouette"), "car", "command").sheets for car in cars]
    assert sheets[0] == sheets[1]


def test_the_script_s_parameters_are_those_of_the_car(tmp_path: Path) -> None:
    load(tmp_path, SNAKE)
    vehicle = ListedVehicle.model_validate({"type": "Snake", "params": [{"Snake": {"width": [80, 95], "radius": 32}}]})
    cars = read_family(Path("cars.json"), "v", vehicle)

    assert [design.width_mm for design in cars] == [80, 95]
    assert cars.varied == {"Snake_width_mm": (80, 95)}
    assert [design.radii_mm for design in cars] == [(32, 32, 60)] * 2
    assert next(iter(cars)).title == "Snake Snake.length=80 Snake.width=80 Snake.height=50 Snake.radius=32 Snake.gap=20"


def test_a_composite_is_a_module_among_others_and_of_others(tmp_path: Path) -> None:
    text = """
from foldcar.car.components.component import Parameter
from foldcar.car.components.composite import Composite
from foldcar.car.components.module import HEIGHT, WIDTH, BrainModule, WheelModule
class Bogie(Composite):
    letter, title = "Bogie", "two axles"
    parameters = (WIDTH, HEIGHT, Parameter("apart", 70, 60, 200, "distance of the axles", "wheels"))
    connections = (("front.rear", "rear.front"),)
    def subcomponents(self):
        return [self.sub(name, WheelModule, "width height", length="apart", radius=30) for name in ("rear", "front")]
class Truck(Composite):
    letter, title = "Truck", "a bogie before the electronics, a second body behind"
    parameters = (WIDTH, HEIGHT)
    root = "last"
    connections = (("bogie.rear", "middle.front"), ("middle.rear", "last.front"))
    def subcomponents(self):
        yield self.sub("bogie", Bogie, "width height", apart=80)
        yield self.sub("middle", BrainModule, "width height", length=20)
        yield self.sub("last", BrainModule, "width height", length=100)
"""
    load(tmp_path, text, "truck.py")
    truck = compose("Truck_W", {"W.length": 80, "radius": 30})

    assert truck.modules == ("W", "W", "B", "B", "W")
    # The root has the electronics, not the first B.
    assert truck.electronics == 3
    same = compose("W_W_B_B_W", {"W.length": 80, "B1.length": 20, "B2.length": 100, "radius": 30})
    assert [truck.length_of(i) for i in range(5)] == [same.length_of(i) for i in range(5)]
    assert verify(truck).findings == ()
    assert compose("Bogie_B_Bogie", {"Bogie2.apart": 90, "width": 100}).axles_mm == (165, 95, -65, -155)


def test_a_second_kind_of_wheel_module_is_taken(tmp_path: Path) -> None:
    text = """
from dataclasses import replace
from foldcar.car.components.module import WheelModule
class Big(WheelModule):
    letter, title = "Big", "a wheel module with large wheels"
    parameters = tuple(replace(p, default=66, shared=False) if p.name == "radius" else p for p in WheelModule.parameters)
"""
    load(tmp_path, text, "big.py")

    big = compose("W_B_Big", {"radius": 50})
    assert big.radii_mm == (50, 66)
    assert big.columns["Big_radius_mm"] == 66
    assert body_json(big) == body_json(compose("W_B_W", {"W1.radius": 50, "W2.radius": 66}))
    assert verify(big).findings == ()
    with pytest.raises(
        DesignError, match=r"^Big.tire_thickness: 14 differs from the 12 of W.tire_thickness: all modules sh"
    ):
        compose("W_B_Big", {"Big.tire_thickness": 14, "radius": 50})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (('("car1.rear", "vhinge1.front"),', ""), ":7: Snake: its connections must make one chain, but make vhinge1"),
        (('("car1.rear", "vhinge1.front")', '("car1.rear", "car2.rear")'), ":7: Snake: car1.rear meets car2.rear: a"),
        (('"car2.front"', '"car0.front"'), ":7: Snake: its connections must make one chain, but make car2; vhinge0 - v"),
        (('("car1.rear", "vhinge1.front")', '("brain0.rear", "vhinge1.front")'), ":7: Snake: brain0.rear meets vhinge1"),
        (('"car0.rear"', '"cart.rear"'), ':7: Snake: connects "cart.rear"; it has vhinge0, vhinge1, brain0, car0'),
        (('root = "brain0"', 'root = "car0"'), ':7: Snake: root "car0" is not one module B, nor a composite'),
        (('length="gap"', 'long="gap"'), ':28: Snake.vhinge0: HingeModule has no parameter "long"; it has width'),
        (('"width height", length="gap"', '"width hight"'), ':28: Snake.vhinge0: HingeModule has no parameter "hight"'),
        (('length="gap"', 'length="gab"'), ':28: Snake: has no parameter "gab"; it has length, width, height'),
        (('"height", 50, 48', '"height", 36, 36'), ":7: Snake.vhinge0.height: 36 is below the minimum 47.74 (the boards"),
    ],
)  # fmt: skip
def test_a_mistake_in_a_script_is_one_line(tmp_path: Path, change: tuple[str, str], message: str) -> None:
    assert change[0] in SNAKE
    text = SNAKE.replace(*change) if "hight" in change[1] or "gab" in change[1] else SNAKE.replace(*change, 1)

    with pytest.raises(FoldcarError) as caught:
        load(tmp_path, text)

    assert str(caught.value).startswith(f"{tmp_path / 'snake.py'}{message}"), str(caught.value)
    assert "Snake" not in MODULES


def test_a_module_of_modules_that_is_no_composite_says_what_to_derive_it_from(tmp_path: Path) -> None:
    text = """
from foldcar.car.components.module import BrainModule, Module
class Two(Module):
    letter, title = "Two", "two lengths of body"
    def subcomponents(self):
        return [self.sub(name, BrainModule, "width height") for name in ("a", "b")]
"""
    with pytest.raises(
        FoldcarError, match=r"two.py:3: Two: has modules in it: derive it from Composite and connect them$"
    ):
        load(tmp_path, text, "two.py")


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"Snake.radius": 26}, "Snake.radius: 26 is below the minimum 27 (2 mm under the belly)"),
        ({"Snake.radius": 45}, "Snake.radius: 60 beside 45 needs axles at least 108 apart, or wheels touch"),
        ({"Snake.length": 60}, "Snake.radius: 60 beside 36 needs axles"),
        ({"W.length": 60}, "W.length: Snake has no such parameter; it has Snake.length"),
        ({"Snake2.length": 60}, "Snake2.length: Snake has 1 modules Snake"),
    ],
)
def test_a_value_of_a_script_s_car_that_cannot_be_is_one_line(
    tmp_path: Path, values: dict[str, float], message: str
) -> None:
    load(tmp_path, SNAKE)

    with pytest.raises(DesignError) as caught:
        folded_car(compose("Snake", values))

    assert str(caught.value).startswith(message), str(caught.value)


def test_commands_make_a_script_s_car(tmp_path: Path, foldcar: Any) -> None:
    (tmp_path / "snake.py").write_text(SNAKE)
    (tmp_path / "cars.json").write_text('{"vehicles": {"1": {"type": "Snake"}}}')

    done = foldcar("model", "cars.json", "--vehicle", "1", "--components", "snake.py", "--to", "urdf", "-o", "out")

    assert done.returncode == 0, done.stderr
    (file,) = (tmp_path / "out").iterdir()
    assert file.read_text().count("<transmission") == 4
