"""Measures the nesting: the film that random cars and the published ones take.

    .venv/bin/python bench/nesting.py 20 --seed 7

Film is the area of the sheets, of the last one up to its highest cut. Each car of `tools/random_designs.py` that can be
made counts as one; a checkout of another version that has this file gives what to compare with.
"""

import argparse
import hashlib
import json
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tools"))

from random_designs import draws, tried  # noqa: E402

from foldcar.car.design import Design  # noqa: E402
from foldcar.car.folded_car import folded_car  # noqa: E402
from foldcar.commands.listed_run import listed_family  # noqa: E402
from foldcar.fabrication.patterns.drawing import bounds  # noqa: E402
from foldcar.fabrication.patterns.options import Options, options  # noqa: E402
from foldcar.fabrication.patterns.sheets import Pattern, pattern  # noqa: E402

COMMAND = "foldcar pattern listing.json --vehicle car -o car"
PUBLISHED = {"w65": "published_cars", "w95": "published_cars", "w180": "published_cars", "six": "six_wheels"}


def film_mm2(made: Pattern) -> float:
    """Area of the sheets (mm²), of the last one up to its highest cut."""
    *full, last = made.sheets
    top = bounds(shape for shape in last.shapes if shape.layer == "CUT_OUTER")[3]
    return sum(sheet.width_mm * sheet.height_mm for sheet in full) + last.width_mm * top


def main() -> None:
    """Print a line for each car, and the sum."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("count", type=int, help="number of random cars")
    parser.add_argument("--seed", type=int, default=7)
    asked = parser.parse_args()
    total = 0.0

    def laid(design: Design, chosen: Options, name: str = "") -> None:
        nonlocal total
        start = time.process_time()
        made = pattern(folded_car(design), chosen, design.title, COMMAND)
        film = film_mm2(made)
        total += 0 if name else film
        digest = hashlib.sha256(repr(made.sheets).encode()).hexdigest()[:8]
        print(
            json.dumps(
                {
                    "car": name or f"{design.title} ({chosen.machine}, {chosen.sheet})",
                    "sheets": len(made.sheets),
                    "film_m2": round(film / 1e6, 4),
                    "used": round(made.film_area_mm2 / film, 3),
                    "cpu_s": round(time.process_time() - start, 2),
                    "digest": digest,
                }
            ),
            flush=True,
        )

    for vehicle, listing in PUBLISHED.items():
        family = listed_family(ROOT / "patterns" / f"{listing}.json", vehicle, [])[1]
        laid(family.single(), options("silhouette"), vehicle)
    left = asked.count
    for draw in draws(100 * asked.count, asked.seed):
        left -= tried(draw, laid).made
        if not left:
            break
    print(f"{asked.count} random cars of seed {asked.seed}: {total / 1e6:.3f} m²")


if __name__ == "__main__":
    main()
