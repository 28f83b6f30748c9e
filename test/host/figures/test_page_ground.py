"""The ground that pages draw (figures/web/ground.js) is the one on which carsim drives, also where blocks adjoin."""

import json
import math
import random
import subprocess
from pathlib import Path
from typing import Any

import numpy
import pytest

from foldcar.installation import PACKAGE
from foldcar.simulation.engines import find_wasm, program_command

PROGRAM = """
import {{ readFileSync }} from "node:fs";
import {{ Ground }} from {module};
const {{ scene, x_m, y_m }} = JSON.parse(readFileSync(0, "utf8")), ground = new Ground(scene);
process.stdout.write(JSON.stringify(x_m.map((x, k) => ground.height(x, y_m[k]))));
"""


def scene_of(terrain: list[dict[str, Any]]) -> dict[str, Any]:
    limits = {"x_min_m": -5, "x_max_m": 5, "y_min_m": -5, "y_max_m": 5}
    start = {"x_m": 0, "y_m": 0, "heading_rad": 0}
    return {"id": "s", "friction": 0.6, "terrain": terrain, "start": start, "goal": None, "course": limits}


def heights_in_page(scene: dict[str, Any], x_m: list[float], y_m: list[float], folder: Path) -> list[float]:
    wasm = find_wasm()
    if wasm is None:
        pytest.skip("carsim.wasm is not built")
    program = folder / "heights.mjs"
    module = json.dumps((PACKAGE / "figures" / "web" / "ground.js").as_uri())
    program.write_text(PROGRAM.format(module=module), encoding="utf-8")
    node, *_ = program_command(wasm)
    text = json.dumps({"scene": scene, "x_m": x_m, "y_m": y_m})
    result = subprocess.run([node, str(program)], input=text, capture_output=True, text=True, check=True)
    heights: list[float] = json.loads(result.stdout)
    return heights


def heights_in_carsim(scene: dict[str, Any], x_m: list[float], y_m: list[float], carsim: Path) -> list[float]:
    lines = ({"scene": scene}, {"heights": {"id": "h", "scene": "s", "x_m": x_m, "y_m": y_m}})
    text = "".join(json.dumps(line) + "\n" for line in lines)
    result = subprocess.run([carsim, "batch"], input=text, capture_output=True, text=True, check=True)
    heights: list[float] = json.loads(result.stdout)["z_m"]
    return heights


def block(kind: str, x_m: float, y_m: float, length_m: float, height_m: float, heading_rad: float) -> dict[str, Any]:
    place = {"x_m": round(x_m, 9), "y_m": round(y_m, 9), "heading_rad": round(heading_rad, 9)}
    return {"kind": kind, **place, "length_m": length_m, "width_m": 0.6, "height_m": height_m}


def test_blocks_are_as_high_as_for_carsim(carsim_binary: Path, tmp_path: Path) -> None:
    draw = random.Random(4)
    terrain = []
    for kind in 4 * ("box", "ramp", "half_round"):
        x_m, y_m, heading_rad = draw.uniform(-1, 1), draw.uniform(-1, 1), draw.uniform(-3, 3)
        terrain.append(block(kind, x_m, y_m, draw.uniform(0.2, 0.6), draw.uniform(0.01, 0.1), heading_rad))
    xs_m, ys_m = ([draw.uniform(-1.3, 1.3) for _ in range(4000)] for _ in "xy")
    scene = scene_of(terrain)

    expected = heights_in_carsim(scene, xs_m, ys_m, carsim_binary)

    assert sum(z_m > 0 for z_m in expected) > 400
    assert heights_in_page(scene, xs_m, ys_m, tmp_path) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("heading_rad", [-3.141592653, 0.7, 2.2])
def test_a_ramp_with_a_plateau_has_no_slit(heading_rad: float, carsim_binary: Path, tmp_path: Path) -> None:
    c, s = math.cos(heading_rad), math.sin(heading_rad)
    slope, plateau = (block(kind, 2 + c * along, s * along, length, 0.06, heading_rad)
                      for kind, along, length in (("ramp", -0.1, 0.3), ("box", 0.25, 0.4)))  # fmt: skip
    scene = scene_of([slope, plateau])
    places = [(0.05 + off, across) for off in (-1e-10, 0, 1e-10) for across in numpy.linspace(-0.29, 0.29, 59).tolist()]
    x_m = [2 + c * along - s * across for along, across in places]
    y_m = [s * along + c * across for along, across in places]

    for heights in (heights_in_carsim(scene, x_m, y_m, carsim_binary), heights_in_page(scene, x_m, y_m, tmp_path)):
        assert heights == pytest.approx([0.06] * len(places), abs=1e-6)
