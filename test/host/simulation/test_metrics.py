"""A run's metrics are carsim's, which the host asks for them."""

import os
from pathlib import Path
from typing import Any

import pytest

from foldcar.simulation.results import METRICS


def test_every_metric_s_name_ends_with_its_unit() -> None:
    assert METRICS and all(metric.name.endswith("_" + metric.unit.lower().replace("/", "_")) for metric in METRICS)


@pytest.mark.parametrize(
    ("program", "message"),
    [(None, "FOLDCAR_CARSIM: {} is not a program"), ("echo old", "{}: `carsim metrics` printed no")],
)
def test_without_carsim_a_store_is_not_read(tmp_path: Path, new_foldcar: Any, program: str | None, message: str) -> None:
    carsim = tmp_path / "carsim"
    if program is not None:
        carsim.write_text(f"#!/bin/sh\n{program}\n")
        carsim.chmod(0o755)

    refused = new_foldcar("report", "s.db", "-o", "out", env={**os.environ, "FOLDCAR_CARSIM": str(carsim)})

    assert refused.returncode == 2 and refused.stderr.startswith(f"foldcar: error: {message.format(carsim)}")
    assert refused.stderr.count("\n") == 1
