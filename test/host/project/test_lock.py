"""The lock of what `make` installs fits the package's own requirements on every supported Python."""

import re
import sys
from functools import cache
from pathlib import Path

import pytest
from packaging.requirements import Requirement

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

PROJECT = Path(__file__).resolve().parents[3]
# What a first study needs, and all the rest.
LOCKS = [(PROJECT / "host" / name).read_text(encoding="utf-8") for name in ("requirements.txt", "requirements-dev.txt")]
LOCK = "\n".join(LOCKS)
PYTHONS = ["3.10", "3.11", "3.12", "3.13", "3.14"]


@cache
def locked() -> list[Requirement]:
    return [Requirement(line.rstrip("\\")) for line in re.findall(r"^[a-z0-9].*$", LOCK, flags=re.MULTILINE)]


def required() -> list[Requirement]:
    """What pyproject.toml names: the package's own needs, its extras', and what it is built with."""
    project = tomllib.loads((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))
    own = project["project"]
    extras = [line for lines in own["optional-dependencies"].values() for line in lines]
    lines = own["dependencies"] + extras + project["build-system"]["requires"]
    return [requirement for requirement in map(Requirement, lines) if requirement.name != own["name"]]


def spelled_alike(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def holds(requirement: Requirement, python: str) -> bool:
    environment = {
        "python_version": python,
        "python_full_version": f"{python}.0",
        "sys_platform": "linux",
        "platform_machine": "x86_64",
    }
    return requirement.marker is None or requirement.marker.evaluate(environment)


@pytest.mark.parametrize("python", PYTHONS)
def test_the_lock_has_one_fitting_version_of_all_that_is_required(python: str) -> None:
    versions: dict[str, list[str]] = {}
    for requirement in (requirement for requirement in locked() if holds(requirement, python)):
        (specifier,) = requirement.specifier
        assert specifier.operator == "==", f"{requirement}: no exact version"
        versions.setdefault(spelled_alike(requirement.name), []).append(specifier.version)
    assert {name: spellings for name, spellings in versions.items() if len(spellings) != 1} == {}
    wanted = [requirement for requirement in required() if holds(requirement, python)]
    assert len(wanted) > 25
    for requirement in wanted:
        version = versions.get(spelled_alike(requirement.name))
        assert version, f"Python {python}: the lock has no {requirement}; run `make lock`"
        assert requirement.specifier.contains(version[0]), (
            f"Python {python}: the lock has {version[0]} for {requirement}; run `make lock`"
        )


def test_every_locked_package_has_hashes_and_none_is_bound_to_a_place() -> None:
    blocks = re.split(r"^(?=[a-z0-9])", LOCK, flags=re.MULTILINE)[1:]
    assert len(blocks) == len(locked()) > 100
    assert [block.splitlines()[0] for block in blocks if "--hash=sha256:" not in block] == []
    assert not re.search(r"://|--(index|extra|find|trusted)", LOCK)
