"""A run's metrics: the host's row for each says what the simulator's table says."""

import json
import subprocess
from pathlib import Path

from foldcar.simulation.results import METRICS


def test_the_host_knows_the_simulator_s_metrics(carsim_binary: Path) -> None:
    told = json.loads(subprocess.run([carsim_binary, "metrics"], capture_output=True, check=True, timeout=60).stdout)

    assert [(metric.name, metric.unit, metric.optional) for metric in METRICS] == [
        (row["name"], row["unit"], row["optional"]) for row in told
    ]
    assert all(metric.name.endswith(f"_{metric.unit.lower()}") for metric in METRICS)
