"""Mutants: which faults are planted in C++, and where none are; one of Python in place of its module."""

import sys
from pathlib import Path

import pytest

TOOLS = Path(__file__).resolve().parent.parent.parent / "tools"
sys.path.insert(0, str(TOOLS))

from mutants import Mutant, mutants_of  # noqa: E402
from mutation import read_explained, stale_reasons  # noqa: E402
from mutation_tests import PythonWorkshop  # noqa: E402


def faults(line: str) -> set[str]:
    """What the mutants of a function with that line have in its place."""
    return {mutant.mutated for mutant in mutants_of(f"void f() {{\n  {line}\n}}\n") if mutant.line == 2}


def test_operators_signs_constants_and_functions_are_exchanged() -> None:
    assert faults("return a + b * 2;") == {"return a - b * 2;", "return a + b / 2;", "return a + b * 3;"}
    assert faults("return g(-a, 0.5, 0);") == {"return g(+a, 0.5, 0);", "return g(-a, 1.0, 0);", "return g(-a, 0.5, 1);"}
    assert faults("return std::min(a, b);") == {"return std::max(a, b);"}
    assert faults("return std::abs(a);") == {"return static_cast<double>(a);"}


def test_conditions_are_negated_and_statements_removed() -> None:
    assert faults("if (a <= b) return;") == {"if (!(a <= b)) return;", "if (a < b) return;"}
    assert faults("total += part;") == {"total -= part;", "(removed)"}
    assert faults("car.step(pulses);") == {"(removed)"}


@pytest.mark.parametrize(
    "line", ["// a + b", 'say("a + b, 1");', "std::vector<int> list;", "b2Body* body = other;", "#include <x1.h>"]
)
def test_comments_strings_types_and_includes_are_left_alone(line: str) -> None:
    assert faults(line) - {"(removed)"} == set()


def test_the_list_is_the_same_every_time() -> None:
    text = (TOOLS.parent / "sim2d" / "lib" / "engine" / "servo_model.cpp").read_text(encoding="utf-8")
    assert mutants_of(text) == mutants_of(text)
    assert len({mutant.text for mutant in mutants_of(text)}) == len(mutants_of(text)) > 30


def test_every_explained_line_is_still_in_its_file() -> None:
    reasons = read_explained(TOOLS / "mutation_explained.txt")
    assert stale_reasons(TOOLS.parent, reasons) == []
    assert stale_reasons(TOOLS.parent, {("sim2d/lib/multibody/car_constants.cpp", "no such line", "*"): "x"}) != []


def test_a_broken_explanation_names_its_line(tmp_path: Path) -> None:
    (tmp_path / "explained.txt").write_text("a/b.cpp\n- x\n= reason\n", encoding="utf-8")
    with pytest.raises(ValueError, match=r"explained.txt:3: expected"):
        read_explained(tmp_path / "explained.txt")


def test_a_mutant_stands_in_place_of_its_module_and_its_verdict_is_kept_until_its_test_changes(tmp_path: Path) -> None:
    source, test = tmp_path / "host" / "a" / "b.py", tmp_path / "test" / "host" / "test_b.py"
    for file in (source, test):
        file.parent.mkdir(parents=True)
    source.write_text("def half(x):\n    return x / 2\n", encoding="utf-8")
    text = f"import sys\nsys.path.insert(0, {str(tmp_path / 'host')!r})\nfrom a.b import half\n"
    test.write_text(f"{text}def test_half():\n    assert half(0) == 0\n")
    before = source.read_bytes()
    workshop = PythonWorkshop(tmp_path, tmp_path / "work", Path(sys.executable))
    workshop.prepare("test_b.py")
    third, more = (
        Mutant(2, "return x / 2", new, f"def half(x):\n    {new}\n") for new in ("return x / 3", "return x + 2")
    )

    verdicts = [workshop.judge(source, mutant, ["test_b.py"]).result for mutant in (third, more)]
    test.write_text(test.read_text().replace("half(0) == 0", "half(6) == 3"))
    again = workshop.judge(source, third, ["test_b.py"])
    workshop.stop()

    assert verdicts == ["survived", "killed"] and again.result == "killed"
    assert source.read_bytes() == before
    # Nothing can be run any more.
    assert workshop.judge(source, third, ["test_b.py"]) == again
