"""The Unity test framework as a library in PlatformIO's core folder, from the distribution's source archive.

No binary package contains Unity, but the source package ntpsec does, for its own tests.
"""

import json
import re
import tarfile
import tempfile
from pathlib import Path, PurePosixPath

from debian_source import source_archive
from seed_files import SeedError, whole_folder

SOURCE_PACKAGE = "ntpsec"
FILES = ("unity.c", "unity.h", "unity_internals.h")
# Earlier versions lack the hooks through which PlatformIO reads the output.
OLDEST_VERSION = (2, 5, 0)
PURPOSE = f"Unity, from the source package {SOURCE_PACKAGE}"


def seed_unity(folder: Path) -> None:
    """Put Unity into ``folder`` unless it is there already. Raises SeedError."""
    if all((folder / name).is_file() for name in (*FILES, "library.json")):
        return
    with tempfile.TemporaryDirectory(prefix="foldcar-unity-") as scratch:
        archive = source_archive(SOURCE_PACKAGE, PURPOSE, Path(scratch))
        with whole_folder(folder) as part:
            extract_unity(archive, part)
            version = unity_version((part / "unity.h").read_text(encoding="utf-8"))
            if version < OLDEST_VERSION:
                older = f"{_dotted(version)} is older than {_dotted(OLDEST_VERSION)}"
                raise SeedError(f"{PURPOSE}: version {older}")
            manifest = {"name": "Unity", "version": _dotted(version), "build": {"flags": ["-w"]}}
            (part / "library.json").write_text(json.dumps(manifest, indent=2) + "\n", encoding="utf-8")


def extract_unity(archive: Path, folder: Path) -> None:
    """Extract Unity's three files from the package's archive. Raises SeedError if one is missing."""
    names = set()
    with tarfile.open(archive) as members:
        for member in members:
            path = PurePosixPath(member.name)
            if member.isfile() and path.parts[1:-1] == ("tests", "unity") and path.name in FILES:
                content = members.extractfile(member)
                assert content is not None
                (folder / path.name).write_bytes(content.read())
                names.add(path.name)
    for name in FILES:
        if name not in names:
            raise SeedError(f"{PURPOSE}: {archive.name} has no tests/unity/{name}")


def unity_version(header: str) -> tuple[int, ...]:
    """The version in Unity's header."""
    names = (f"UNITY_VERSION_{part}" for part in ("MAJOR", "MINOR", "BUILD"))
    matches = (re.search(rf"#define\s+{name}\s+(\d+)", header) for name in names)
    return tuple(int(match.group(1)) if match else 0 for match in matches)


def _dotted(version: tuple[int, ...]) -> str:
    return ".".join(str(part) for part in version)
