"""The same bits with other compilers and levels of optimisation, and with a C library that computes otherwise."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "tools"))

import determinism  # noqa: E402

RENEWAL = (
    "After a change of the physics `make golden` writes the new numbers; without one this platform computes otherwise"
)
# Nothing like the functions, so that a single call would show.
OTHER_LIBRARY = """
#include <math.h>
#include <stdlib.h>
#define OFF1(name) double name(double x) { return 3 - x; } float name##f(float x) { return 3 - x; }
#define OFF2(name) double name(double x, double y) { return 3 - x - y; } \\
  float name##f(float x, float y) { return 3 - x - y; }
OFF1(sin) OFF1(cos) OFF1(tan) OFF1(asin) OFF1(acos) OFF1(atan) OFF1(exp) OFF1(exp2) OFF1(expm1) OFF1(log) OFF1(log2)
OFF1(log10) OFF1(log1p) OFF1(sinh) OFF1(cosh) OFF1(tanh) OFF1(cbrt) OFF2(atan2) OFF2(pow) OFF2(hypot)
void sincos(double x, double* s, double* c) { *s = *c = 3 - x; }
void sincosf(float x, float* s, float* c) { *s = *c = 3 - x; }
"""


@pytest.fixture(scope="module")
def golden() -> str:
    return determinism.OUTPUT.read_text(encoding="utf-8")


def test_the_golden_trials_give_the_golden_numbers(carsim_binary: Path, golden: str) -> None:
    differing = determinism.difference(golden, determinism.answers(carsim_binary))
    assert differing == "", RENEWAL


def test_the_golden_trials_differ_from_each_other(golden: str) -> None:
    replies = golden.splitlines()
    # The ground is the same in both engines.
    grounds = [reply for reply in replies if reply.startswith('{"heights"')]
    assert (len(replies), len(set(replies)), len(set(grounds))) == (18, 15, 3)
    assert all('"outcome":"passed"' in reply for reply in replies if reply.startswith('{"run"'))


@pytest.mark.parametrize("level", ["O0", "O3"])
@pytest.mark.slow
def test_another_compiler_and_level_give_the_same_bits(
    carsim_binary: Path, tmp_path: Path, golden: str, level: str
) -> None:
    compiler = determinism.installed_compilers()[-1]
    if level == "O3" and compiler != "g++":
        pytest.skip("`make determinism` tries every level; here one of the other compiler is enough")

    program = determinism.build(compiler, level, tmp_path, numerics=True)

    assert determinism.difference(golden, determinism.answers(program)) == ""


def test_a_c_library_with_other_functions_changes_nothing(carsim_binary: Path, tmp_path: Path, golden: str) -> None:
    source, library = tmp_path / "other.c", tmp_path / "libother.so"
    source.write_text(OTHER_LIBRARY, encoding="utf-8")
    subprocess.run(["gcc", "-shared", "-fPIC", "-fno-builtin", source, "-o", library, "-lm"], check=True)

    assert determinism.difference(golden, determinism.answers(carsim_binary, LD_PRELOAD=str(library))) == ""


def test_the_program_replaces_no_function_of_the_c_library(carsim_binary: Path) -> None:
    command = ["nm", "-D", "--defined-only", carsim_binary]

    symbols = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()

    assert {"sin", "cosf", "exp", "atan2", "hypot", "gettimeofday"}.isdisjoint(symbols)


def test_a_difference_is_shown() -> None:
    assert "-two" in determinism.difference("one\ntwo\n", "one\nthree\n")
