"""Cars and scenes at the limits of what carsim accepts, or changed at random: no crash, no more CPU time than told."""

import json
import random
import resource
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from conftest import PROJECT
from study_car import run_carsim

sys.path.insert(0, str(PROJECT / "test" / "fuzz"))

import seeds

# docs/carsim.md, "run".
MAX_CPU_PER_S = 5.0
STANDING_S = 0.25


SESSIONS = 40
SIMULATED_S = 0.5
# The time of a session's two trials, each after its standing.
SESSION_S = 2 * (STANDING_S + SIMULATED_S)


def numbers(of: Any) -> Iterator[tuple[Any, Any]]:
    """Container and key of every number."""
    for key, value in of.items() if isinstance(of, dict) else enumerate(of):
        if isinstance(value, (dict, list)):
            yield from numbers(value)
        elif isinstance(value, (int, float)) and not isinstance(value, bool):
            yield of, key


def changed(session: list[Any], edges: list[float], chance: random.Random) -> str:
    """The session's lines with one or two numbers of body, scene or run at a limit, scaled, or negated."""
    session = json.loads(json.dumps(session))
    for line in session:
        for kind in ("run", "pulses"):
            if kind in line:
                line[kind]["time_limit_s"] = SIMULATED_S
    places = list(numbers(session[:3]))
    for _ in range(chance.randint(1, 2)):
        of, key = chance.choice(places)
        number = of[key]
        other = chance.choice([chance.choice(edges), number * 2.0 ** chance.randint(-3, 3), -number])
        of[key] = int(other) if isinstance(number, int) else other
    return "\n".join(map(json.dumps, session))


@pytest.mark.parametrize("engine", [(), ("--side-view",)])
def test_no_changed_number_crashes_carsim_or_keeps_it_busy(carsim_binary: Path, engine: tuple[str, ...]) -> None:
    limits = json.loads(subprocess.run([carsim_binary, "limits"], capture_output=True, check=True).stdout)["input"]
    edges = sorted({edge for pair in limits.values() for edge in pair if edge is not None})
    sessions, chance = seeds.sessions()["batch"], random.Random(1)
    accepted = 0

    for _ in range(SESSIONS):
        text = changed(chance.choice(sessions), edges, chance)
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        run = run_carsim(carsim_binary, [text], *engine, "batch")
        cpu_s = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before

        assert run.returncode in (0, 2), (run.returncode, run.stderr, text)
        assert run.stderr == "", text
        assert all(json.loads(reply) for reply in run.stdout.splitlines())
        assert cpu_s < MAX_CPU_PER_S * SESSION_S, text
        accepted += '"outcome"' in run.stdout

    # Otherwise limits alone would be tested.
    assert accepted >= SESSIONS / 5
