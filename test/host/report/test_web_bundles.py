"""The pages' scripts as they are bundled, what is said where they are missing, and figures inside pages."""

import json
from pathlib import Path

import pytest

from foldcar.errors import FoldcarError
from foldcar.figures.page import bundle

PROJECT = Path(__file__).resolve().parents[3]


def test_a_missing_bundle_names_make_setup() -> None:
    with pytest.raises(FoldcarError, match=r"bundles/none\.js: .*`make setup`"):
        bundle("none.js")


def test_the_notice_has_every_package_that_is_bundled_with_its_version_and_licence() -> None:
    locked = json.loads((PROJECT / "host" / "web" / "package-lock.json").read_text(encoding="utf-8"))["packages"]
    notice = (PROJECT / "host" / "foldcar" / "bundles" / "NOTICE.txt").read_text(encoding="utf-8")

    for name in json.loads((PROJECT / "host" / "web" / "package.json").read_text(encoding="utf-8"))["dependencies"]:
        package = locked[f"node_modules/{name}"]
        assert f"{name} {package['version']} ({package['license']})" in notice.splitlines()
    assert "Copyright © 2010-2026 three.js authors" in notice


def test_the_lock_of_npm_pins_hashes_and_names_no_host() -> None:
    text = (PROJECT / "host" / "web" / "package-lock.json").read_text(encoding="utf-8")
    packages = {name: package for name, package in json.loads(text)["packages"].items() if name}

    assert packages and all(package["integrity"].startswith("sha512-") for package in packages.values())
    assert not any("resolved" in package for package in packages.values())
