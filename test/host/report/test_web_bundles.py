"""The pages' scripts as they are bundled, what is said where they are missing, and figures inside pages."""

import json
import sys
from pathlib import Path

import pytest

from foldcar.errors import FoldcarError
from foldcar.figures.page import bundle

PROJECT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(PROJECT / "tools"))
import page_types  # noqa: E402


def test_a_missing_bundle_names_make_setup() -> None:
    with pytest.raises(FoldcarError, match=r"bundles/none\.js: .*`make setup`"):
        bundle("none.js")


def test_the_scripts_have_the_types_of_the_pages_data() -> None:
    source = '"""What it is."""\nColumn = list[float | None]\nclass A(TypedDict):\n    """An A."""\n'
    source += '    b: "B | None"\n    kind: Literal["x", "y"] | None\nB = TypedDict("B", {"from": dict[str, int]})\n'

    assert page_types.typescript(source).splitlines()[2:] == [
        "export type Column = Array<number | null>;",
        *("export interface A {", "  b: B | null;", '  kind: "x" | "y" | null;', "}"),
        *("export interface B {", "  from: Record<string, number>;", "}"),
    ]
    written = page_types.TYPES.read_text(encoding="utf-8")
    assert page_types.typescript(page_types.SOURCE.read_text(encoding="utf-8")) == written


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
