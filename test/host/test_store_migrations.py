"""A store that is older than a metric of carsim gets it by itself; what is no store is not made one."""

import json
import os
import subprocess
from pathlib import Path
from typing import Any

import pytest

from old_stores import contents


def test_what_is_no_store_is_not_made_one(tmp_path: Path, foldcar: Any) -> None:
    (tmp_path / "empty.db").touch()

    assert foldcar("migrate", "empty.db").stderr == "foldcar: error: empty.db: is no foldcar store\n"
    assert foldcar("migrate", "none.db").stderr == "foldcar: error: none.db: no such store\n"
    assert [file.name for file in tmp_path.iterdir()] == ["empty.db"]


@pytest.fixture
def slipping(tmp_path: Path, carsim_binary: Path) -> dict[str, str]:
    """An environment with a carsim that has a metric more."""
    told = json.loads(subprocess.run([carsim_binary, "metrics"], capture_output=True, check=True).stdout)
    more = [*told, {"name": "slip_m", "unit": "m", "optional": False, "help": "way slipped"}]
    program = tmp_path.with_name("slipping")
    program.write_text(f'#!/bin/sh\n[ "$1" = metrics ] || exec {carsim_binary} "$@"\necho \'{json.dumps(more)}\'\n')
    program.chmod(0o755)
    return {**os.environ, "FOLDCAR_CARSIM": str(program)}


def test_a_new_metric_of_carsim_comes_into_stores_by_itself(
    store: Path, slipping: dict[str, str], foldcar: Any, new_foldcar: Any
) -> None:
    before = contents(store)

    read = new_foldcar("export", "s.db", "--csv", "-", env=slipping)
    assert ",slip_m,message," in read.stdout and contents(store) == before
    for words in (("check",), ("migrate",), ("check",), ("repair", "-o", "w.db")):
        whole = new_foldcar(words[0], "s.db", *words[1:], env=slipping)
        assert whole.returncode == 0, whole.stdout
    assert new_foldcar("export", "s.db", "--csv", "-", env=slipping).stdout == read.stdout

    after = contents(store)
    assert [{**row, "slip_m": None} for row in before["run"]] == after["run"] == contents(store.with_name("w.db"))["run"]
    old = foldcar("export", "s.db", "--csv", "-")
    assert (old.returncode, old.stdout) == (2, "")
    assert old.stderr.startswith('foldcar: error: s.db: has the metric "slip_m", which this foldcar does not know')
