"""Random cars on random scenes: carsim and carsim.wasm answer with the same bytes, or this lists the cases that differ.

    .venv/bin/python tools/determinism_fuzz.py 2000 --seed 1

Each case is a car with 1 to 4 segments and 2 to 8 wheels, a scene of up to 260 pieces of terrain, a reality, and a run
of a few seconds in multibody or in the side view. In some scenes many blocks overlap below the car, which gives more
contacts than the simulator keeps. --show NUMBER prints the input of one case for `carsim batch`. The exit code is 1 if
answers differ.
"""

import argparse
import json
import math
import random
import subprocess
import sys
from collections import Counter
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent))

from determinism import CARSIM, wasm_command

CHANNELS = 8
SERVO_RPM = 2 * math.pi / 60
# What scenes are made of; those that occur twice are drawn twice as often.
SCENES = ("level", "blocks", "pile", "pile", "stair", "tiles", "smooth", "smooth", "rough", "mixed", "mixed")
CONDITIONS = (["x_m", 0.4, ">"], ["time_s", 1.0, ">="], ["rise_m", "abs", 0.02, ">"], [0.5, 0, 0.2, "in_disc"])
# Characters of an answer that are shown.
SHOWN = 400


@dataclass(frozen=True)
class Case:
    """The lines of one random car in one random scene."""

    number: int
    side_view: bool
    lines: tuple[dict[str, Any], ...]

    @property
    def text(self) -> str:
        """The lines as `carsim batch` reads them."""
        return "".join(json.dumps(line) + "\n" for line in self.lines)


@dataclass(frozen=True)
class Difference:
    """A case and the answers of both programs."""

    case: Case
    native: tuple[str, ...]
    wasm: tuple[str, ...]


def random_case(number: int, seed: int) -> Case:
    """Return the case with this number; it depends on number and seed only."""
    draw = random.Random(f"{seed}/{number}")
    body = random_body(draw, number)
    scene = random_scene(draw, number)
    points = [[round(draw.uniform(-0.3, 1.5), 3) for _ in range(20)] for _ in "xy"]
    run = {
        "id": f"r{number}",
        "body": body["id"],
        "scene": scene["id"],
        "speed_m_s": draw.choice([0.3, 0.5, 0.7, -0.3]),
        "yaw_rate_rad_s": draw.choice([0, 0, 0.4, -1.0]),
        "time_limit_s": draw.choice([1, 3, 6, 9]),
        "path_interval_s": draw.choice([0, 0.1]),
        "reality": draw.choice([{}, random_reality(draw)]),
    }
    heights = {"id": f"h{number}", "scene": scene["id"], "x_m": points[0], "y_m": points[1]}
    lines = ({"body": body}, {"scene": scene}, {"heights": heights}, {"run": run})
    return Case(number, draw.random() < 0.3, lines)


def random_body(draw: random.Random, number: int) -> dict[str, Any]:
    """Return a car whose segments follow each other, with one to three axles on each, at most four in all."""
    segment_count = draw.choice([1, 1, 1, 2, 2, 3, 4])
    length_m, width_m = draw.uniform(0.06, 0.2), draw.uniform(0.04, 0.15)
    radius_m, tyre_width_m = draw.uniform(0.02, 0.07), draw.uniform(0.002, 0.03)
    height_m = draw.uniform(0.01, 1.5 * radius_m)
    mass_kg = draw.uniform(0.05, 0.6)
    front_m = 0.5 * (segment_count - 1) * length_m
    segments = []
    for index in range(segment_count):
        middle_m = front_m - index * length_m
        sides = {"roll": (width_m, height_m), "pitch": (length_m, height_m), "yaw": (length_m, width_m)}
        segments.append(
            {
                "x_m": middle_m,
                "length_m": length_m,
                "width_m": width_m,
                "height_m": height_m,
                "center_z_m": draw.uniform(-0.2, 0.5) * height_m,
                "mass_kg": mass_kg,
                "com_x_m": middle_m + draw.uniform(-0.2, 0.2) * length_m,
                "com_y_m": draw.uniform(-0.1, 0.1) * width_m,
                "com_z_m": draw.uniform(-0.2, 0.8) * height_m,
                **{f"{axis}_inertia_kg_m2": mass_kg / 12 * (a * a + b * b) for axis, (a, b) in sides.items()},
                "grip": draw.uniform(0.2, 1),
            }
        )
    hinges = [
        {
            "x_m": front_m - (index + 0.5) * length_m,
            "z_m": draw.uniform(-0.5, 0.5) * height_m,
            "stiffness_n_m_rad": draw.uniform(0.01, 2),
            "damping_n_m_s_rad": draw.uniform(0, 0.01),
            "min_rad": -draw.uniform(0.1, 1),
            "max_rad": draw.uniform(0.1, 1),
        }
        for index in range(segment_count - 1)
    ]
    axles = [(index, segments[index]["x_m"]) for index in range(segment_count)]
    if segment_count <= 3 and draw.random() < 0.9:
        axles = [(index, x_m + side * 0.4 * length_m) for index, x_m in axles for side in (1, -1)][: CHANNELS // 2]
    torque_n_m = draw.uniform(0.05, 0.3)
    wheels = [
        {
            "channel": 2 * axle + right,
            "segment": segment,
            "side": "right" if right else "left",
            "x_m": x_m,
            "radius_m": radius_m,
            "width_m": tyre_width_m,
            "mass_kg": 0.1 * mass_kg,
            "grip": draw.uniform(0.6, 1.3),
            "eccentricity_m": draw.choice([0, 0.03 * radius_m]),
            "eccentricity_phase_rad": draw.uniform(0, 6),
            "servo": {
                "stall_torque_n_m": torque_n_m,
                "no_load_speed_rad_s": draw.uniform(80, 130) * SERVO_RPM,
                "rated_v": 5.2,
                "stall_current_a": 0.7,
                "no_load_current_a": 0.11,
                "rotor_inertia_kg_m2": draw.choice([0, 1e-5, 2e-4]),
                "neutral_us": 1500,
                "deadband_us": 45,
                "saturation_us": 200,
                "direction": -1 if right else 1,
            },
        }
        for axle, (segment, x_m) in enumerate(axles)
        for right in (0, 1)
    ]
    track_m = width_m + 2 * tyre_width_m + draw.uniform(0, 0.05)
    parts = {"segments": segments, "hinges": hinges, "wheels": wheels}
    return {"id": f"b{number}", **parts, "track_m": track_m, "supply_v": 5.2}


def random_block(draw: random.Random, kind: str, reach_m: float, height_m: float) -> dict[str, Any]:
    """Return a block at most ``height_m`` high whose middle is within ``reach_m`` of the start along and across."""
    length_m = draw.uniform(0.02, 0.4)
    return {
        "kind": kind,
        "x_m": draw.uniform(-0.2, 1) * reach_m,
        "y_m": draw.uniform(-0.5, 0.5) * reach_m,
        "heading_rad": draw.choice([0, draw.uniform(-3.2, 3.2)]),
        "length_m": length_m,
        "width_m": draw.uniform(0.02, 0.5),
        "height_m": min(draw.uniform(0.2, 1) * height_m, 0.5 * length_m),
    }


def random_terrain(draw: random.Random) -> list[dict[str, Any]]:
    """Return pieces of one or several kinds."""
    kind = draw.choice(SCENES)
    terrain: list[dict[str, Any]] = []
    if kind in ("blocks", "mixed"):
        for _ in range(draw.randint(1, 30)):
            terrain.append(random_block(draw, draw.choice(["box", "ramp", "half_round"]), 1.5, 0.05))
    if kind == "pile":
        height_m = draw.uniform(0.004, 0.03)
        for _ in range(draw.randint(60, 260)):
            block = random_block(draw, draw.choice(["box", "box", "half_round"]), 0.4, height_m)
            terrain.append({**block, "length_m": draw.uniform(0.2, 0.6), "height_m": height_m - draw.uniform(0, 0.002)})
    if kind == "stair":
        step_m, rise_m = draw.uniform(0.05, 0.2), draw.uniform(0.003, 0.02)
        for index in range(draw.randint(2, 24)):
            place = {"x_m": 0.3 + index * step_m + 1, "y_m": 0.0, "heading_rad": 0.0, "length_m": 2.0, "width_m": 1.0}
            terrain.append({"kind": "box", **place, "height_m": (index + 1) * rise_m})
    if kind == "tiles":
        # Many that begin at one place along the way.
        side_m = draw.uniform(0.06, 0.3)
        for row in range(draw.randint(2, 6)):
            for column in range(8):
                block = random_block(draw, draw.choice(["box", "ramp", "half_round"]), 1, 0.03)
                place = {"x_m": 0.3 + row * side_m, "y_m": 0.04 * (column - 3.5), "heading_rad": 0.0}
                terrain.append({**block, **place, "length_m": side_m, "width_m": 0.04})
    if kind in ("smooth", "mixed"):
        for _ in range(draw.randint(1, 4)):
            sizes = {"sd_along_m": draw.uniform(0.05, 0.4), "sd_across_m": draw.uniform(0.05, 0.4)}
            place = {"x_m": draw.uniform(-0.2, 1.5), "y_m": draw.uniform(-0.4, 0.4), "heading_rad": draw.uniform(-3, 3)}
            terrain.append({"kind": "hill", **place, **sizes, "height_m": draw.uniform(-0.05, 0.08)})
        place = {"x_m": draw.uniform(0.2, 1.2), "y_m": draw.uniform(-0.3, 0.3), "radius_m": draw.uniform(0.05, 0.3)}
        terrain.append(
            {"kind": "pothole", **place, "depth_m": draw.uniform(0.002, 0.04), "edge_m": draw.uniform(0.01, 0.05)}
        )
    if kind in ("rough", "mixed"):
        sides = {"length_m": draw.uniform(0.5, 3), "width_m": draw.uniform(0.5, 2), "heading_rad": draw.uniform(-3, 3)}
        relief = {"height_sd_m": draw.uniform(0.0005, 0.01), "correlation_m": draw.uniform(0.02, 0.2)}
        terrain.append({"kind": "rough", "x_m": 0.5, "y_m": 0.0, **sides, **relief, "seed": draw.randrange(1000)})
    for _ in range(draw.choice([0, 0, 2])):
        sides = {"length_m": draw.uniform(0.1, 1), "width_m": draw.uniform(0.1, 1), "heading_rad": draw.uniform(-3, 3)}
        place = {"x_m": draw.uniform(0, 1), "y_m": draw.uniform(-0.3, 0.3)}
        terrain.append({"kind": "patch", **place, **sides, "friction": draw.uniform(0.05, 1)})
    return terrain


def random_scene(draw: random.Random, number: int) -> dict[str, Any]:
    """Return a scene with a goal, a program, both or neither."""
    line = {"kind": "line", "x_m": draw.uniform(0.3, 1.2), "y_m": 0.0, "heading_rad": draw.uniform(-0.5, 0.5)}
    disc = {"kind": "disc", "x_m": draw.uniform(0.3, 1.2), "y_m": 0.0, "radius_m": 0.2}
    near_m = draw.choice([0.3, 3])
    scene = {
        "id": f"s{number}",
        "friction": draw.uniform(0.2, 1.2),
        "terrain": random_terrain(draw),
        "start": {"x_m": 0.0, "y_m": 0.0, "heading_rad": draw.choice([0, draw.uniform(-3.2, 3.2)])},
        "goal": draw.choice([line, disc, None]),
        "course": {"x_min_m": -near_m, "x_max_m": 3, "y_min_m": -near_m, "y_max_m": near_m},
    }
    if draw.random() < 0.3:
        when = draw.choice(CONDITIONS)
        records = [
            {"name": "way", "kind": "series", "value": [1.0, 0.0, 0.0, "distance_m"]},
            {"name": "heading", "kind": "final", "value": ["heading_rad", 1.0, "+", "wrap_rad"]},
        ]
        ending = {"when": when, "outcome": draw.choice(["passed", "terminated"])}
        scene["program"] = {"endings": [ending], "time_limit_s": 2.0, "verdict": None, "step_s": 0.25, "records": records}
    return scene


def random_reality(draw: random.Random) -> dict[str, Any]:
    """Return what a built car and its ground differ in from their design."""
    each = {name: [draw.gauss(0, sd) for _ in range(CHANNELS)] for name, sd in (("servo_torque", 0.1), ("neutral_us", 4))}
    each["eccentricity_m"] = [draw.uniform(0, 0.002) for _ in range(CHANNELS)]
    car = {"mass": draw.gauss(0, 0.05), "com_x_m": draw.gauss(0, 0.003), "supply_resistance_ohm": draw.uniform(0, 0.1)}
    ground = {"friction": draw.uniform(0.8, 1.2), "obstacle_height": draw.uniform(0.8, 1.2)}
    return {**each, **car, **ground, "start_y_m": draw.gauss(0, 0.01)}


def batch_answers(command: Sequence[str], side_view: bool, cases: Iterable[Case]) -> dict[int, tuple[str, ...]]:
    """Return a program's two answers to each case: heights and run. Raises RuntimeError if some are missing."""
    options = ["--side-view"] if side_view else []
    chosen = [case for case in cases if case.side_view == side_view]
    text = "".join(case.text for case in chosen)
    result = subprocess.run([*command, *options, "batch"], input=text, capture_output=True, text=True, check=False)
    lines = result.stdout.splitlines()
    if len(lines) != 2 * len(chosen):
        raise RuntimeError(f"{command[-1]}: {len(lines)} answers to {2 * len(chosen)} lines: {result.stderr[-SHOWN:]}")
    return {case.number: (lines[2 * at], lines[2 * at + 1]) for at, case in enumerate(chosen)}


def differences(
    cases: Sequence[Case], native: Sequence[str], wasm: Sequence[str]
) -> tuple[list[Difference], Counter[str]]:
    """Return the cases that both programs answer differently, and how many runs end in each way natively."""
    with ThreadPoolExecutor() as pool:
        jobs = {
            (name, side_view): pool.submit(batch_answers, command, side_view, cases)
            for side_view in (False, True)
            for name, command in (("native", native), ("wasm", wasm))
        }
        answers = {key: job.result() for key, job in jobs.items()}
    endings: Counter[str] = Counter()
    differing = []
    for case in cases:
        pair = answers["native", case.side_view][case.number], answers["wasm", case.side_view][case.number]
        endings[json.loads(pair[0][1]).get("outcome", "error")] += 1
        if pair[0] != pair[1]:
            differing.append(Difference(case, *pair))
    return differing, endings


def main() -> int:
    """Run the command line; returns the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("count", type=int, help="number of cases")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--native", nargs="+", default=[str(CARSIM)], metavar="WORD", help="command of one program")
    parser.add_argument("--wasm", nargs="+", default=wasm_command(), metavar="WORD", help="command of the other")
    parser.add_argument("--show", type=int, metavar="NUMBER", help="print the input of this case, and run nothing")
    arguments = parser.parse_args()
    if arguments.show is not None:
        print(random_case(arguments.show, arguments.seed).text, end="")
        return 0
    cases = [random_case(number, arguments.seed) for number in range(arguments.count)]
    differing, endings = differences(cases, arguments.native, arguments.wasm)
    for found in differing:
        print(f"case {found.case.number}{' in the side view' if found.case.side_view else ''}:")
        for native, wasm in zip(found.native, found.wasm, strict=True):
            if native != wasm:
                print(f"  {native[:SHOWN]}\n  {wasm[:SHOWN]}")
    print(f"{len(differing)} of {len(cases)} cases differ; outcomes: {dict(endings.most_common())}")
    return 1 if differing else 0


if __name__ == "__main__":
    sys.exit(main())
