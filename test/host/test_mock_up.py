"""Paper prototypes: one page, the car's shape at their scale, honest labels, refusals."""

import json
import math
from dataclasses import replace
from pathlib import Path

import pytest
import shapely
from pypdf import PdfReader
from typer.testing import CliRunner

from foldcar.car.design import compose
from foldcar.car.folded.placed import place
from foldcar.car.folded_car import folded_car
from foldcar.car.proof.check_film import check_joins
from foldcar.cli import app
from foldcar.errors import FoldcarError
from foldcar.fabrication.patterns.mock_up import mocked
from published_cars import PUBLISHED, design


@pytest.mark.parametrize(("name", "scale"), [("w95", 0.5), ("hinged", 0.8)])
def test_a_prototype_has_the_cars_body_and_wheels_at_its_scale(name: str, scale: float) -> None:
    listed = design(name)
    of_card = {key: value for key, value in listed.values.items() if key != "H.thickness"}
    car = folded_car(compose(f"{listed.type}+film=card_160", of_card))
    small = mocked(car, scale)
    bodies, whole = place(small), place(car)
    kept = {piece.name for piece in small.pieces}

    assert {"servo doubler", "switch doubler", "wheel hub ring"}.isdisjoint(kept) and {"bridge", "wheel"} <= kept
    mine, real = (
        {(one.title, one.copy): one.corners_mm for body, faces in placed.items() if body[0] == "s" for one in faces}
        for placed in (bodies, whole)
    )
    assert mine.keys() == {key for key in real if key[0].partition(": ")[0] in kept}
    for key, corners in mine.items():
        assert corners == pytest.approx(scale * real[key], abs=1e-9)
    # Joined edges still meet, tongues still go through their slots: with film scaled, too, layers lie on each other.
    thin = replace(small, pieces=tuple(replace(piece, thickness_mm=0.2 * scale) for piece in small.pieces))
    assert [str(one) for one in check_joins(thin, place(thin))] == []
    (disc,) = (piece for piece in small.pieces if piece.name == "wheel")
    assert disc.count == len(car.axles)
    area = shapely.Polygon(disc.faces[0].outline_mm).area
    assert area == pytest.approx(math.pi * (scale * listed.values["radius"]) ** 2, rel=0.002)
    # A pin in the middle of each wheel passes the wall beside it.
    walls = [face for faces in bodies.values() for face in faces if face.piece.name != "wheel"]
    pins = [face.in_car([hole.center_mm])[0] for face in walls for hole in face.face.holes if hole.kind == "axle"]
    for axle in car.axles:
        x, y, z = (scale * c for c in axle.center_mm)
        (pin,) = (pin for pin in pins if math.dist((pin[0], pin[2]), (x, z)) < 1e-6 and pin[1] * y > 0)
        assert abs(pin[1]) == pytest.approx(scale * (listed.values["width"] - 0.2) / 2)
    assert len(pins) == len(car.axles)


def test_a_prototype_says_what_it_is_on_every_page_and_in_its_text(tmp_path: Path) -> None:
    out = tmp_path / "paper"
    done = CliRunner().invoke(app, ["pattern", str(PUBLISHED), "--vehicle", "w95", "--mockup", "0.5", "-o", str(out)])

    assert done.exit_code == 0 and "PAPER PROTOTYPE scale 1:2, not for driving" in done.output
    assert "pages     1 of 210 x 297 mm" in done.output
    assert len(PdfReader(out / "sheets.pdf").pages) == 1
    manifest = json.loads((out / "pattern.json").read_text())
    assert sorted(path.name for path in out.iterdir()) == manifest["files"]
    assert manifest["mockup"] == 0.5 and manifest["command"].endswith("--machine scissors --mockup 0.5 -o car")
    text = (out / "how_to_fold.md").read_text()
    assert text.startswith("# PAPER PROTOTYPE scale 1:2, not for driving") and "1 page: sheets.pdf" in text


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--mockup", "0.1"], "--mockup 0.1: not within 0.25 to 1"),
        (["--mockup", "0.5", "--machine", "laser"], "one car's prototype for scissors, without --machine laser"),
        (["--mockup", "0.5", "--all"], "one car's prototype for scissors, without --all"),
    ],
)
def test_prototypes_that_cannot_be_are_refused(tmp_path: Path, words: list[str], message: str) -> None:
    vehicle = [] if "--all" in words else ["--vehicle", "w95"]

    done = CliRunner().invoke(app, ["pattern", str(PUBLISHED), *vehicle, *words, "-o", str(tmp_path / "car")])

    assert isinstance(done.exception, FoldcarError) and message in str(done.exception)
    assert not (tmp_path / "car").exists()
