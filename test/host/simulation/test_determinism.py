"""The same bits with other compilers and levels of optimisation, and with a C library that computes otherwise."""

import json
import math
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "tools"))

import determinism  # noqa: E402
import determinism_fuzz  # noqa: E402

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
    difference = determinism.difference(golden, determinism.answers([str(carsim_binary)]))
    assert difference == "", RENEWAL


def test_the_golden_trials_differ_from_each_other(golden: str) -> None:
    replies = golden.splitlines()
    # The ground is the same in both engines.
    grounds = [reply for reply in replies if reply.startswith('{"heights"')]
    assert (len(replies), len(set(replies)), len(set(grounds))) == (44, 41, 3)


def test_the_golden_trials_end_in_every_way(golden: str) -> None:
    # In a batch no fault can occur: the simulated battery, bus and host do not fail.
    replies = [json.loads(line) for line in golden.splitlines()]
    outcomes = [reply["outcome"] for reply in replies if "run" in reply]
    half = len(outcomes) // 2
    every = {"passed", "tipped", "stuck", "off_course", "timeout", "terminated"}
    assert set(outcomes[:half]) == set(outcomes[half:]) == every


def test_the_golden_trials_have_more_contacts_than_are_kept() -> None:
    lines = [json.loads(line) for line in determinism.INPUT.read_text(encoding="utf-8").splitlines()]
    pile = next(line["scene"]["terrain"] for line in lines if line.get("scene", {}).get("id") == "pile")
    wheels = next(line["body"]["wheels"] for line in lines if line.get("body", {}).get("id") == "six")
    # The six wheels of the car in the middle of the pile, and the blocks below each: both rims of a tyre touch each
    # block that is at most 4 mm lower than the highest.
    contacts = 0
    for wheel in wheels:
        x_m, y_m = 0.5 + wheel["x_m"], 0.065 if wheel["side"] == "left" else -0.065
        tops = [block["height_m"] for block in pile if _covers(block, x_m, y_m)]
        contacts += 2 * sum(top > max(tops) - 0.003 for top in tops)
    assert contacts > 200


def _covers(block: dict[str, float], x_m: float, y_m: float) -> bool:
    dx, dy = x_m - block["x_m"], y_m - block["y_m"]
    c, s = math.cos(block["heading_rad"]), math.sin(block["heading_rad"])
    return abs(c * dx + s * dy) < 0.5 * block["length_m"] and abs(c * dy - s * dx) < 0.5 * block["width_m"]


def test_random_cars_on_random_scenes_give_the_same_bits_in_webassembly(carsim_binary: Path) -> None:
    cases = [determinism_fuzz.random_case(number, seed=20) for number in range(60)]

    differing, outcomes = determinism_fuzz.differences(cases, [str(carsim_binary)], determinism.wasm_command())

    assert [found.case.number for found in differing] == []
    assert len(outcomes) >= 5 and outcomes["error"] == 0


def test_a_random_case_that_is_answered_otherwise_is_found(carsim_binary: Path, tmp_path: Path) -> None:
    other = tmp_path / "carsim"
    other.write_text(f'#!/bin/sh\n"{carsim_binary}" "$@" | sed "/r3/s/elapsed_time_s/elapsed_s/"\n', encoding="utf-8")
    other.chmod(0o755)
    cases = [determinism_fuzz.random_case(number, seed=20) for number in range(5)]

    differing, _ = determinism_fuzz.differences(cases, [str(carsim_binary)], [str(other)])

    assert [found.case.number for found in differing] == [3]


@pytest.mark.parametrize("level", ["O0", "O3"])
@pytest.mark.slow
def test_another_compiler_and_level_give_the_same_bits(
    carsim_binary: Path, tmp_path: Path, golden: str, level: str
) -> None:
    compiler = determinism.installed_compilers()[-1]
    if level == "O3" and compiler != "g++":
        pytest.skip("`make determinism` tries every level; here one of the other compiler is enough")

    command = determinism.build(compiler, level, tmp_path, numerics=True)

    assert determinism.difference(golden, determinism.answers(command)) == ""


def test_carsim_in_webassembly_gives_the_same_bits(golden: str) -> None:
    assert determinism.difference(golden, determinism.answers(determinism.wasm_command())) == ""


def test_a_c_library_with_other_functions_changes_nothing(carsim_binary: Path, tmp_path: Path, golden: str) -> None:
    source, library = tmp_path / "other.c", tmp_path / "libother.so"
    source.write_text(OTHER_LIBRARY, encoding="utf-8")
    subprocess.run(["gcc", "-shared", "-fPIC", "-fno-builtin", source, "-o", library, "-lm"], check=True)

    assert determinism.difference(golden, determinism.answers([str(carsim_binary)], LD_PRELOAD=str(library))) == ""


def test_the_program_replaces_no_function_of_the_c_library(carsim_binary: Path) -> None:
    command = ["nm", "-D", "--defined-only", carsim_binary]

    symbols = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()

    assert {"sin", "cosf", "exp", "atan2", "hypot", "gettimeofday"}.isdisjoint(symbols)


def test_a_difference_is_shown() -> None:
    assert "-two" in determinism.difference("one\ntwo\n", "one\nthree\n")
