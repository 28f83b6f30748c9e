"""Chromium without a window, which opens a page as a person's browser does.

`make test` installs it. Ubuntu has it as a snap only, which may not read temporary files: there Google Chrome is taken,
and where that is missing too the tests of pages are left out.
"""

import shutil
import subprocess
import tempfile
from pathlib import Path

import pytest

# A software renderer draws, the same on every machine; no network, no first-run pages; root may run it.
FLAGS = [
    "--headless",
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-dev-shm-usage",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
    "--virtual-time-budget=3000",
    "--window-size=1100,900",
]
HANGS_S = 600


def browse(page: Path | str, fragment: str, *options: str) -> str:
    """Open ``page``, a file or an address, at ``#fragment`` with an empty profile; gives the standard output."""
    address = page.as_uri() if isinstance(page, Path) else page
    with tempfile.TemporaryDirectory(prefix="foldcar-browser-", ignore_cleanup_errors=True) as profile:
        command = [browser(), *FLAGS, f"--user-data-dir={profile}", *options, f"{address}#{fragment}"]
        return subprocess.run(command, capture_output=True, text=True, timeout=HANGS_S, check=True).stdout


def browser() -> str:
    """The browser's command. Without one the test fails, on Ubuntu it is left out."""
    for name in ("chromium", "google-chrome"):
        found = shutil.which(name)
        if found is not None and not found.startswith("/snap/"):
            return found
    if "\nID=ubuntu\n" in Path("/etc/os-release").read_text(encoding="utf-8"):
        pytest.skip("Ubuntu has no package of Chromium, and there is no Google Chrome")
    pytest.fail("there is no Chromium: tools/install_system_packages.sh tests")
