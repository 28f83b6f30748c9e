"""Sessions of `carsim batch` with numbers changed at random: no assertion, no crash, and a bound on what a run costs."""

import json
import random
import resource
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "test" / "fuzz"))

import seeds  # noqa: E402

SESSIONS = 40
SIMULATED_S = 0.5
# The bound of docs/carsim.md, and the time of a session's two trials, each after 0.25 s of standing.
MOST_CPU_PER_S = 5.0
SESSION_S = 2 * (0.25 + SIMULATED_S)


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
    return "".join(json.dumps(line) + "\n" for line in session)


@pytest.mark.parametrize("engine", [(), ("--side-view",)])
def test_no_changed_number_crashes_carsim_or_keeps_it_busy(carsim_binary: Path, engine: tuple[str, ...]) -> None:
    limits = json.loads(subprocess.run([carsim_binary, "limits"], capture_output=True, check=True).stdout)["input"]
    edges = sorted({edge for pair in limits.values() for edge in pair if edge is not None})
    sessions, chance = seeds.sessions()["batch"], random.Random(1)
    accepted = 0

    for _ in range(SESSIONS):
        text = changed(chance.choice(sessions), edges, chance)
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        run = subprocess.run([carsim_binary, *engine, "batch"], input=text, capture_output=True, text=True, timeout=600)
        cpu_s = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before

        assert run.returncode in (0, 2), (run.returncode, run.stderr, text)
        assert run.stderr == "", text
        assert all(json.loads(reply) for reply in run.stdout.splitlines())
        assert cpu_s < MOST_CPU_PER_S * SESSION_S, text
        accepted += '"outcome"' in run.stdout

    # Otherwise limits alone would be tested.
    assert accepted >= SESSIONS / 5
