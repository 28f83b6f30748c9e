"""The package as pip installs it, outside a checkout: it brings every program and data file that it needs."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

PROJECT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder into which the package was installed from a wheel, without its dependencies."""
    folder = tmp_path_factory.mktemp("installed")
    # A copy, so that nothing is built in the source tree.
    source = shutil.copytree(
        PROJECT / "host", folder / "host", ignore=shutil.ignore_patterns("*.egg-info", "__pycache__", "build")
    )
    options = ["--quiet", "--no-deps", "--no-build-isolation", "--target", folder / "site"]
    subprocess.run([sys.executable, "-m", "pip", "install", *options, source], check=True, cwd=folder)
    return folder / "site"


def test_every_file_of_the_package_is_installed(site: Path) -> None:
    def files(package: Path) -> set[str]:
        found = (file for file in package.rglob("*") if file.is_file() and "__pycache__" not in file.parts)
        return {file.relative_to(package).as_posix() for file in found}

    assert files(site / "foldcar") == files(PROJECT / "host" / "foldcar")


def test_an_installed_package_samples_designs_and_loads_its_dialect(site: Path, tmp_path: Path) -> None:
    program = tmp_path / "bump.scenic"
    program.write_text(
        "model model\nego = new Robot at (0, 0), facing -90 deg\nnew Bump at (0.5, 0), facing -90 deg\n"
        "goal = new Goal at (1, 0), facing -90 deg\n"
    )
    script = """
import json, pathlib, foldcar
from foldcar.car.body import body_json
from foldcar.car.design import compose
from foldcar.car.variation.spread import workshop
from foldcar.mavlink_dialect import load_dialect
from foldcar.scenes.source import open_environment

scene = open_environment(pathlib.Path("bump.scenic"), {}, 42).sample(0)
print(json.dumps([foldcar.__file__, scene["terrain"][0]["kind"], body_json(compose("W_B_W", {}))["track_m"],
                  len(workshop()), load_dialect().FOLDCAR_STATE_FAULT]))
"""
    # Before the checkout, which an editable install has put on the path.
    environment = {**os.environ, "PYTHONPATH": str(site), "HOME": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, env=environment, capture_output=True, text=True, check=True
    )

    file, kind, track_m, spreads, _ = json.loads(done.stdout)
    assert Path(file) == site / "foldcar" / "__init__.py"
    assert (kind, spreads > 5, 0.05 < track_m < 0.3) == ("box", True, True)
