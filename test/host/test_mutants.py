"""Mutants of C++: which faults are planted, and where none are."""

import sys
from pathlib import Path

import pytest

TOOLS = Path(__file__).resolve().parent.parent.parent / "tools"
sys.path.insert(0, str(TOOLS))

from mutants import mutants_of  # noqa: E402
from mutation import read_explained, stale_reasons  # noqa: E402


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
    assert stale_reasons(TOOLS.parent, {("sim2d/lib/side_view/car_constants.cpp", "no such line", "*"): "x"}) != []


def test_a_broken_explanation_names_its_line(tmp_path: Path) -> None:
    (tmp_path / "explained.txt").write_text("a/b.cpp\n- x\n= reason\n", encoding="utf-8")
    with pytest.raises(ValueError, match=r"explained.txt:3: expected"):
        read_explained(tmp_path / "explained.txt")
