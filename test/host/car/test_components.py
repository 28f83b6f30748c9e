"""The component model: derived parameters, equal edges, faces that fold to bodies, user modules, docs/compiler.md."""

import math
import os
import py_compile
import re
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from foldcar.car.components.assemble import Assembly, assemble, build
from foldcar.car.components.component import Component, ComponentError, Parameter, Sub
from foldcar.car.components.shape import Shape
from foldcar.car.design import compose
from foldcar.car.design_parameters import MODULES, parameters
from foldcar.car.folded.pose import apply, folded
from foldcar.car.folded_car import folded_car
from foldcar.car.parts.catalogue import catalogue
from foldcar.car.user_modules import components_digest, forbid_new_files, load_components
from foldcar.car.verify import verify
from foldcar.errors import FoldcarError

SIZE = Parameter("size", 30, 5, 100, "edge of a cube", "glue")


def made(kind: type[Component], **values: float) -> Assembly:
    """The assembled component."""
    return assemble(build(kind(values)))


class Panel(Component):
    """A rectangle of film: face ``panel``."""

    parameters = (
        Parameter("length", 10, 0.5, 2000, "along x", "what can be cut"),
        Parameter("width", 10, 0.5, 2000, "along y", "what can be cut"),
    )

    def build(self, shape: Shape) -> None:
        shape.rectangle("panel", self["length"], self["width"])


class Cube(Component):
    """Six panels; the cross of a cube, glued along the other seven edges."""

    parameters = (SIZE,)
    sides = ("bottom", "a", "b", "c", "d", "top")

    def subcomponents(self) -> Sequence[Sub]:
        """All as large as the cube."""
        return [Sub(name, Panel, {"length": self["size"], "width": self["size"]}) for name in self.sides]

    def build(self, shape: Shape) -> None:
        """Edges of a panel: near, front, far, rear."""
        for side, edge in zip("abcd", ("near", "front", "far", "rear"), strict=True):
            shape.connect(f"bottom.panel.{edge}", f"{side}.panel.near", "fold", 90)
        shape.connect("a.panel.far", "top.panel.near", "fold", 90)
        for side, following in ("ab", "bc", "cd", "da"):
            shape.connect(f"{side}.panel.front", f"{following}.panel.rear", "tab", 90, depth_mm=4)
        for edge, side in (("front", "d"), ("far", "c"), ("rear", "b")):
            shape.connect(f"{side}.panel.far", f"top.panel.{edge}", "tab", 90, depth_mm=4)


class Pair(Component):
    """Two panels of the same length."""

    parameters = Panel.parameters[:1]

    def subcomponents(self) -> Sequence[Sub]:
        return [Sub(name, Panel, self.values) for name in ("one", "other")]

    def build(self, shape: Shape) -> None:
        shape.connect("one.panel.front", "other.panel.rear", "rigid")


def test_a_cross_of_squares_folds_to_a_cube() -> None:
    assembly = made(Cube, size=20)

    (piece,) = assembly.pieces
    assert len(piece.creases) == 5 + 7
    poses = folded(piece)
    corners = {
        tuple(round(c, 9) + 0.0 for c in apply(poses[face.name], *point))
        for face in piece.faces
        if face.role == "panel"
        for point in face.outline_mm
    }
    assert corners == {(x, y, z) for x in (0, 20) for y in (0, 20) for z in (0, 20)}
    # Half folded it is open: the lid's far edge has not come down to z = 20 yet.
    half = folded(piece, 0.5)
    assert apply(half["top.panel"], 0, 20)[2] != pytest.approx(20, abs=1)
    # Flat, all faces lie in one plane.
    flat = folded(piece, 0)
    assert all(abs(apply(flat[f.name], *point)[2]) < 1e-12 for f in piece.faces for point in f.outline_mm)


def test_parameters_flow_down_from_the_parent_s_values_and_defaults() -> None:
    assert Cube()["size"] == Cube().children["top"]["length"] == 30
    assert Pair({"length": 12}).children["one"]["length"] == Pair({"length": 12}).children["other"]["length"] == 12


def test_fused_panels_are_one_face() -> None:
    (piece,) = made(Pair, length=12).pieces

    (face,) = piece.faces
    assert len(face.outline_mm) == 4
    xs, ys = zip(*face.outline_mm, strict=True)
    assert (max(xs) - min(xs), max(ys) - min(ys)) == (24, 10)


def test_limits_are_named_with_path_value_limit_reason_and_the_outermost_parameter() -> None:
    with pytest.raises(ComponentError, match=r"^size: 4 is below the minimum 5 \(glue\)$"):
        Cube({"size": 4})
    with pytest.raises(ComponentError, match=r"^size: nan is below"):
        Cube({"size": math.nan})
    with pytest.raises(ComponentError, match=r'has no parameter "colour"; it has size'):
        Cube()["colour"]

    class Outer(Component):
        parameters = (Parameter("pair.length", 1, 0, 5000, "", ""),)

        def subcomponents(self) -> Sequence[Sub]:
            return (Sub("pair", Pair, {"length": self["pair.length"]}, {"length": "pair.length"}),)

    with pytest.raises(ComponentError, match=r"^pair.length: 2500 is above the maximum 2000$") as caught:
        Outer({"pair.length": 2500})
    assert caught.value.key == "pair.length"


class Wrong(Component):
    """Two panels connected in some wrong way."""

    connections: tuple[tuple[str, str, str], ...] = ()

    def subcomponents(self) -> Sequence[Sub]:
        return [Sub(name, Panel, {"length": length}) for name, length in (("p", 60), ("q", 41), ("r", 60))]

    def build(self, shape: Shape) -> None:
        for a, b, kind in self.connections:
            shape.connect(a, b, kind, 90, depth_mm=3)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("connections", "message"),
    [
        ((("p.panel.near", "q.panel.far", "fold"),), "p.panel.near: is 60 mm long, q.panel.far is 41 mm: a fold joins"),
        ((("p.panel.near", "q.panel.left", "fold"),), 'q.panel: has no edge "left"; it has near, front, far, rear'),
        ((("p.panel.near", "q.side.far", "fold"),), 'has no face "q.side"'),
        (
            (("p.panel.front", "q.panel.rear", "fold"), ("r.panel.front", "q.panel.rear", "fold")),
            "q.panel.rear: is connected to r.panel.front and p.panel.front",
        ),
        (
            (("p.panel.near", "r.panel.far", "fold"), ("p.panel.far", "r.panel.near", "fold")),
            "p.panel: is in a loop of 2 folds, which no flat sheet has; make one of them a tab",
        ),
        ((("p.panel.front", "q.panel.rear", "fold"),), "r.panel: is joined to nothing"),
    ],
)
def test_wrong_connections_are_named(connections: tuple[tuple[str, str, str], ...], message: str) -> None:
    kind = type("Broken", (Wrong,), {"connections": connections})

    with pytest.raises(ComponentError) as caught:
        made(kind)

    assert str(caught.value).startswith(message)


def test_every_parameter_says_what_it_is() -> None:
    for parameter in parameters().values():
        declared = parameter.declared
        assert declared.help and declared.reason and declared.unit in ("mm", "deg", "")
        assert declared.minimum_with(catalogue()) <= declared.default_with(catalogue()) <= declared.maximum


DOC = (Path(__file__).parents[3] / "docs" / "compiler.md").read_text(encoding="utf-8")
TAIL = "\n" + DOC[DOC.index("from foldcar.car.components.component import Parameter\n") :].partition("```")[0]


@pytest.fixture(autouse=True)
def forget_own_modules() -> object:
    """Unregister user modules after each test."""
    before = dict(MODULES)
    yield
    for letter in set(MODULES) - set(before):
        del MODULES[letter]
    parameters.cache_clear()


def test_a_user_module_is_part_of_the_car(tmp_path: Path) -> None:
    file = tmp_path / "tail.py"
    file.write_text(TAIL)

    assert load_components(file) == ["Tail"]

    design = compose("W_B_Tail", {"Tail.length": 50})
    assert design.columns["Tail_offset_mm"] == 5
    assert verify(design).findings == ()
    (caster,) = [mount for mount in folded_car(design).mounts if "caster" in mount.name]
    # Front to rear 60, 80, 50: the tail's middle is 70 behind the car's, the caster 5 further back.
    assert [caster.pose[i][3] for i in range(2)] == pytest.approx([-75, 0])
    assert caster.pose[2][3] < -25


def test_what_a_user_module_reads_is_part_of_it(tmp_path: Path) -> None:
    file = tmp_path / "tail.py"
    (tmp_path / "data").mkdir()
    for name, text in (("offset.txt", "5"), ("other.txt", "5"), ("late.txt", "5")):
        (tmp_path / "data" / name).write_text(text)
    read = "from pathlib import Path\nDATA = Path(__file__).parent / 'data'\nOFFSET = (DATA / 'offset.txt').read_text()\n"
    file.write_text(read + TAIL)
    load_components(file)
    first = components_digest()
    folded_car(compose("W_B_Tail", {"Tail.length": 51}))

    (tmp_path / "data" / "other.txt").write_text("6")
    assert components_digest() == first
    (tmp_path / "data" / "offset.txt").write_text("6")
    assert components_digest() != first

    late = tmp_path / "late.py"
    late.write_text(read + TAIL.replace('"Tail"', '"Late"').replace("shape)", "shape)", 1))
    text = late.read_text()
    at = text.index("        ", text.index("def build"))
    late.write_text(f"{text[:at]}        (DATA / 'late.txt').read_text()\n{text[at:]}")
    load_components(late)
    with pytest.raises(FoldcarError, match=r"reads .*late\.txt while a car is folded; foldcar tells designs apart"):
        folded_car(compose("W_B_Late", {"Late.length": 52}))


def test_the_names_in_a_folder_that_a_user_module_lists_are_part_of_it(tmp_path: Path) -> None:
    file, folder = tmp_path / "tail.py", tmp_path / "d"
    folder.mkdir()
    (folder / "5").touch()
    file.write_text(f"import os\nOFFSET = float(max(os.listdir({str(folder)!r})))\n{TAIL}")
    load_components(file)
    first = components_digest()

    (tmp_path / "s.db").touch()
    assert components_digest() == first
    (folder / "6").touch()
    assert components_digest() != first


def compiled_as_before(helper: Path, before: str, now: str) -> None:
    """Write ``now`` to a module whose compiled code is of ``before``, and which Python takes for unchanged."""
    assert len(before) == len(now)
    helper.write_text(before)
    py_compile.compile(str(helper), doraise=True)
    status = helper.stat()
    helper.write_text(now)
    os.utime(helper, ns=(status.st_atime_ns, status.st_mtime_ns))


def test_a_user_module_and_its_helpers_are_loaded_from_their_sources(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, helper = tmp_path / "tail.py", tmp_path / "tail_helper.py"
    compiled_as_before(helper, "OFFSET = 5\n", "OFFSET = 7\n")
    (cache,) = (tmp_path / "__pycache__").iterdir()
    compiled = cache.read_bytes()
    text = f"from tail_helper import OFFSET as O5\n{TAIL}"
    compiled_as_before(file, text.replace('"offset", 5', '"offset", 3', 1), text.replace('"offset", 5', '"offset",O5', 1))
    monkeypatch.syspath_prepend(tmp_path)

    load_components(file)

    assert compose("W_B_Tail", {}).columns["Tail_offset_mm"] == 7
    assert cache.read_bytes() == compiled


def test_a_file_outside_of_the_folder_of_a_user_module_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "own").mkdir()
    (tmp_path / "other").mkdir()
    file, helper, data = tmp_path / "own" / "tail.py", tmp_path / "other" / "far_helper.py", tmp_path / "other" / "5.txt"
    compiled_as_before(helper, "OFFSET = 5\n", "OFFSET = 7\n")
    data.write_text("5")
    monkeypatch.syspath_prepend(tmp_path / "other")
    for head, outside in (
        ("from far_helper import OFFSET\n", helper),
        # Loaded before, so it is not read again.
        ("import far_helper\n", helper),
        (f"with open({str(data)!r}) as file:\n    OFFSET = file.read()\n", data),
    ):
        file.write_text(head + TAIL)

        with pytest.raises(FoldcarError) as caught:
            load_components(file)

        assert str(caught.value).startswith(f"--components {file}: reads {outside}, which is outside its folder; put")


def test_environment_variables_are_no_part_of_a_user_module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither when it is loaded nor when a car is folded."""
    file = tmp_path / "tail.py"
    file.write_text("import os\n" + TAIL.replace('"offset", 5', '"offset", float(os.environ.get("OFFSET", "5"))', 1))
    monkeypatch.setenv("OFFSET", "15")

    load_components(file)

    assert compose("W_B_Tail", {}).columns["Tail_offset_mm"] == 5
    with forbid_new_files():
        assert "OFFSET" not in os.environ
    assert os.environ["OFFSET"] == "15"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("class Tail(Module):", "class Tail(Module)"), ":7: expected ':'"),
        (("import put_caster", "import put_castor"), ":4: ImportError: cannot import name 'put_castor'"),
        (("class Tail(Module):", "exit(0)\nclass Tail(Module):"), ":7: SystemExit: 0"),
        (('letter = "Tail"', 'letter = "W"'), ':7: Tail: letter "W" is already used by WheelModule'),
        (('letter = "Tail"', "letter = 3"), ':7: Tail has no string "letter"'),
        (('"offset", 5, 0', '"width", 5, 0'), ':7: Tail: its parameter "width" must be declared like'),
        (('letter = "Tail"', 'letter = "Tail2"'), ':7: Tail: letter "Tail2" must consist of letters and dig'),
        (("class Tail(Module):", "from foldcar.car.components.electronics import *\nclass Tail(ElectronicsModule):"),
         ":8: Tail: derives from the class that carries the electronics"),
        (("class Tail(Module)", "class Tail(object)"), ":1: defines no subclass of Module or Composite of foldcar"),
    ],
)  # fmt: skip
def test_a_file_with_an_error_is_one_line_with_file_and_line(
    tmp_path: Path, change: tuple[str, str], message: str
) -> None:
    file = tmp_path / "tail.py"
    assert change[0] in TAIL
    file.write_text(TAIL.replace(*change))

    with pytest.raises(FoldcarError) as caught:
        load_components(file)

    assert str(caught.value).startswith(f"{file}{message}"), str(caught.value)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (('"beam.floor")[1]', '"beam.flor")[1]'), 'Tail1: has no face "beam.flor" [{file}:13]'),
        (('self["offset"]', 'self["offsets"]'), 'Tail1: has no parameter "offsets"; it has'),
        (("width / 2)", "width / 0)"), "{file}:14: ZeroDivisionError: float division by zero"),
        (("width / 2)", "width / exit(0))"), "{file}:14: SystemExit: 0"),
    ],
)
def test_a_module_that_cannot_be_built_is_named_with_file_and_line(
    tmp_path: Path, change: tuple[str, str], message: str
) -> None:
    file = tmp_path / "tail.py"
    assert change[0] in TAIL
    file.write_text(TAIL.replace(*change))
    load_components(file)

    with pytest.raises(FoldcarError) as caught:
        folded_car(compose("W_B_Tail", {}))

    assert str(caught.value).startswith(message.format(file=file)), str(caught.value)
    assert f"{file}:1" in str(caught.value)


def test_a_file_that_is_not_there_is_named() -> None:
    with pytest.raises(FoldcarError, match=r"^--components nowhere.py: is not a Python file$"):
        load_components(Path("nowhere.py"))


@pytest.mark.parametrize(
    ("change", "code", "answer"),
    [
        (("", ""), 0, "FoldcarV.urdf\n"),
        (('"beam.floor")[1]', '"beam.flor")[1]'), 2, "foldcar: error: cars.json: vehicles.V.type: Tail1: has no face"),
    ],
)  # fmt: skip
def test_commands_accept_user_modules(
    tmp_path: Path, foldcar: Any, change: tuple[str, str], code: int, answer: str
) -> None:
    (tmp_path / "own.py").write_text(TAIL.replace(*change))
    (tmp_path / "cars.json").write_text('{"vehicles": {"V": {"type": "W_B_Tail", "params": [{"Tail": {"offset": 4}}]}}}')

    done = foldcar("model", "cars.json", "--vehicle", "V", "--components", "own.py", "--to", "urdf", "-o", "out")

    assert done.returncode == code
    assert (done.stdout if code == 0 else done.stderr).startswith("out/" + answer if code == 0 else answer)
    assert done.stderr.count("\n") == (code != 0)
    assert (tmp_path / "out").exists() == (code == 0)


def test_the_parameter_table_is_that_of_the_components() -> None:
    rows = {
        f"|`{key}`|{' '.join(sorted(p.modules))}|{p.declared.unit}|{p.declared.default_with(catalogue()):g}"
        f"|{p.declared.minimum_with(catalogue()):g}|{p.declared.maximum:g}|{p.declared.help}|"
        for key, p in parameters().items()
    }

    written = set(re.findall(r"^\|`[\w.]+`\|[A-Z ]+\|(?:mm|deg|)\|.*$", DOC, re.M))

    assert written == rows


def test_the_components_are_where_it_says() -> None:
    matches = re.findall(r"^\|`(\w+)`(?: \w)?\|`(\w+)\.py`\|", DOC, re.M)

    assert len(matches) == 6
    for name, module in matches:
        assert hasattr(import_module(f"foldcar.car.components.{module}"), name), name
