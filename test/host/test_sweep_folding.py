"""Sweeps fold a car once, and again only if it may differ."""

import sqlite3
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from foldcar.car.body import body_json
from foldcar.car.design import Design
from foldcar.store.check import check_store
from foldcar.study import planned_designs
from swept_listing import WriteListing, swept


def test_cars_are_folded_once_and_again_only_if_they_may_differ(
    tmp_path: Path, write_listing: WriteListing, listing_data: Any, carsim_binary: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store, folded = tmp_path / "s.db", list[dict[str, float]]()

    def counted(design: Design) -> dict[str, Any]:
        folded.append(dict(design.values))
        return body_json(design)

    def run() -> tuple[int, list[float]]:
        folded.clear()
        counts = swept(write_listing(listing_data), store, carsim_binary)
        return counts.new, [values["width"] for values in folded]

    monkeypatch.setattr(planned_designs, "body_json", counted)
    assert run() == (6, [95, 245])
    assert run() == (0, [])
    listing_data["vehicles"]["1"]["params"][0]["common"]["width"] = [20, 95, 245]
    # One that cannot be built is no design: the others are the same, under another family.
    assert run() == (0, [95, 245])
    assert run() == (0, [])
    monkeypatch.setattr(planned_designs, "_code", lambda: "changed")
    assert run() == (0, [95, 245])
    with sqlite3.connect(store) as connection:
        connection.execute("UPDATE design SET parameters = '{}' WHERE position = 1")
    assert run() == (0, [95, 245])
    with sqlite3.connect(store) as connection:
        connection.execute("DELETE FROM design WHERE position = 1")
    assert run() == (0, [95, 245])
    assert run() == (0, [])
    assert check_store(store).findings == []


def test_a_module_of_the_users_that_changes_changes_the_designs(tmp_path: Path) -> None:
    """The fingerprint covers the file that --components names, and its neighbours."""
    told = (
        "import sys; from pathlib import Path; from foldcar.car.design import load_components; "
        "from foldcar.study.experiments import read_study; from foldcar.study.planned_designs import *; "
        "load_components(Path(sys.argv[1])); study = read_study(Path(sys.argv[2])); "
        "print(designs_fingerprint(study.experiments[0], {}))"
    )
    part = "from foldcar.car.components.module import Module\nclass Tail(Module):\n    letter, title = 'Tail', 'a tail'\n"
    module = tmp_path / "tail.py"
    listing = Path(__file__).resolve().parents[2] / "scenarios" / "two_bumps.json"
    found = []
    for text, neighbour in ((part, ""), (part, ""), (part + "# new\n", ""), (part + "# new\n", "lid = 1\n")):
        module.write_text(text)
        (tmp_path / "lid.py").write_text(neighbour)
        done = subprocess.run([sys.executable, "-c", told, module, listing], capture_output=True, text=True, check=True)
        found.append(done.stdout)
    assert found[0] == found[1] and len(set(found)) == 3
