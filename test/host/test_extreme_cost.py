"""Cars and scenes at the limits of what carsim accepts, or changed at random: no crash, no more CPU time than told."""

import itertools
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
from study_car import asked

sys.path.insert(0, str(PROJECT / "test" / "fuzz"))

import seeds

# docs/carsim.md, "run".
MOST_CPU_PER_S = 5.0
TIME_LIMIT_S = 1.0
STANDING_S = 0.25
# A firmware that asks for all that eight wheels can do.
PARAMETERS = {
    "WHEEL_RADIUS_M": 0.05, "WHEEL_MAX_RAD_S": 100.0, "TRACK_M": 2.0, "SLEW_US_PER_S": 1e5, "STAGGER_MS": 0.0,
    "TILT_MAX_RAD": 3.2, **{f"CH{channel}_SIDE": 2.0 - channel % 2 for channel in range(1, 9)},
}  # fmt: skip
SERVO = {
    "stall_torque_n_m": 50.0, "no_load_speed_rad_s": 200.0, "rated_v": 5.2, "stall_current_a": 0.7,
    "no_load_current_a": 0.11, "rotor_inertia_kg_m2": 2e-4, "neutral_us": 1500, "deadband_us": 45, "saturation_us": 200,
}  # fmt: skip
SEGMENT = {
    "length_m": 0.25, "width_m": 2.0, "height_m": 0.05, "center_z_m": 0.0, "com_y_m": 0.0, "com_z_m": 0.0, "grip": 0.6,
}  # fmt: skip
# Mass (kg) and inertia (kg m²) of a segment, stiffness of a hinge (N m/rad), radius of a wheel (m).
CARS = {"heavy": (1.0, 0.01, 1000.0, 0.5), "limp": (0.0005, 1e-7, 1e-6, 0.1), "stiff": (0.0005, 1e-7, 1000.0, 0.1)}
MOTIONS = {"fast": (5.0, 0.0), "in a curve": (5.0, 3.0), "spinning": (0.0, 100.0)}


def body(mass_kg: float, inertia_kg_m2: float, stiffness_n_m_rad: float, radius_m: float) -> dict[str, Any]:
    """Eight segments and eight wheels, two metres wide."""
    xs = [0.875 - 0.25 * k for k in range(8)]
    inertias = dict.fromkeys(("roll_inertia_kg_m2", "pitch_inertia_kg_m2", "yaw_inertia_kg_m2"), inertia_kg_m2)
    hinge = {
        "z_m": 0.0, "stiffness_n_m_rad": stiffness_n_m_rad, "damping_n_m_s_rad": 0.0, "min_rad": -3.0, "max_rad": 3.0
    }  # fmt: skip
    wheels = [
        {"channel": k, "segment": 2 * (k // 2), "side": ("left", "right")[k % 2], "x_m": xs[2 * (k // 2)],
         "radius_m": radius_m, "width_m": 0.2, "mass_kg": 0.012, "grip": 1.0, "eccentricity_m": 0.0,
         "eccentricity_phase_rad": 0.0, "servo": {**SERVO, "direction": 1 - 2 * (k % 2)}}
        for k in range(8)
    ]  # fmt: skip
    return {
        "id": "b",
        "segments": [{**SEGMENT, **inertias, "x_m": x, "com_x_m": x, "mass_kg": mass_kg} for x in xs],
        "hinges": [{**hinge, "x_m": (front + rear) / 2} for front, rear in itertools.pairwise(xs)],
        "track_m": 2.0,
        "wheels": wheels,
        "supply_v": 60.0,
    }


def blocks(kind: str, side: int, distance_m: float, length_m: float, height_m: float) -> Iterator[dict[str, Any]]:
    """``side`` × ``side`` blocks around the start."""
    for k in range(side * side):
        yield {
            "kind": kind, "x_m": (k % side - side / 2) * distance_m, "y_m": (k // side - side / 2) * distance_m,
            "heading_rad": 0.0, "length_m": length_m, "width_m": length_m, "height_m": height_m,
        }  # fmt: skip


def hills(count: int, sd_m: float, height_m: float) -> Iterator[dict[str, Any]]:
    """Hills on a spiral around the start."""
    for k in range(count):
        x_m, y_m = 0.05 * k * (-1) ** k, 0.05 * k * (-1) ** (k // 2)
        yield {
            "kind": "hill", "x_m": x_m, "y_m": y_m, "heading_rad": 0.1 * k, "sd_along_m": sd_m, "sd_across_m": sd_m,
            "height_m": height_m,
        }  # fmt: skip


ROUGH = {"kind": "rough", "x_m": 0.0, "y_m": 0.0, "heading_rad": 0.0, "length_m": 8.0, "width_m": 8.0, "seed": 1}
TERRAINS: dict[str, list[dict[str, Any]]] = {
    "flat": [],
    "boxes": list(blocks("box", 100, 0.07, 0.03, 0.01)),
    "arcs": list(blocks("half_round", 100, 0.16, 0.06, 0.03)),
    "rough": [{**ROUGH, "height_sd_m": 0.02, "correlation_m": 0.05}],
    "hills": list(hills(20, 0.3, 0.1)),
}


@pytest.mark.slow
@pytest.mark.parametrize("terrain", TERRAINS)
@pytest.mark.parametrize("car", CARS)
def test_no_accepted_extreme_costs_more_than_documented(carsim_binary: Path, car: str, terrain: str) -> None:
    scene = {
        "id": "s", "friction": 0.6, "terrain": TERRAINS[terrain], "start": {"x_m": 0.0, "y_m": 0.0, "heading_rad": 0.0},
        "goal": None, "course": {"x_min_m": -900.0, "x_max_m": 900.0, "y_min_m": -900.0, "y_max_m": 900.0},
    }  # fmt: skip
    for name, (speed_m_s, yaw_rate_rad_s) in MOTIONS.items():
        run = {
            "id": "r", "body": "b", "scene": "s", "speed_m_s": speed_m_s, "yaw_rate_rad_s": yaw_rate_rad_s,
            "time_limit_s": TIME_LIMIT_S, "parameters": PARAMETERS,
        }  # fmt: skip
        lines = [{"body": body(*CARS[car])}, {"scene": scene}, {"run": run}]
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        answer = asked(carsim_binary, lines)
        cpu_s = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before

        assert answer.returncode == 0, (name, answer.stdout, answer.stderr)
        simulated_s = STANDING_S + json.loads(answer.stdout)["elapsed_time_s"]
        assert cpu_s < MOST_CPU_PER_S * simulated_s, name


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
        run = asked(carsim_binary, [text], *engine, "batch")
        cpu_s = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before

        assert run.returncode in (0, 2), (run.returncode, run.stderr, text)
        assert run.stderr == "", text
        assert all(json.loads(reply) for reply in run.stdout.splitlines())
        assert cpu_s < MOST_CPU_PER_S * SESSION_S, text
        accepted += '"outcome"' in run.stdout

    # Otherwise limits alone would be tested.
    assert accepted >= SESSIONS / 5
