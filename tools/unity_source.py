"""The Unity test framework as a library in PlatformIO's core folder, from the distribution's source archive.

No binary package contains Unity, but the source package ntpsec does, for its own tests. apt fetches and verifies that
package, in a temporary folder, with a copy of its configuration in which source archives are enabled.
"""

import json
import re
import tarfile
import tempfile
from pathlib import Path, PurePosixPath

from seed_files import SeedError, run, whole_folder

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
        archive = download_archive(Path(scratch))
        with whole_folder(folder) as part:
            extract_unity(archive, part)
            version = unity_version((part / "unity.h").read_text(encoding="utf-8"))
            if version < OLDEST_VERSION:
                older = f"{_dotted(version)} is older than {_dotted(OLDEST_VERSION)}"
                raise SeedError(f"{PURPOSE}: version {older}")
            manifest = {"name": "Unity", "version": _dotted(version), "build": {"flags": ["-w"]}}
            (part / "library.json").write_text(json.dumps(manifest, indent=2) + "\n", encoding="utf-8")


def download_archive(scratch: Path, package: str = SOURCE_PACKAGE, purpose: str = PURPOSE) -> Path:
    """Download the package's upstream archive with apt into ``scratch``; returns its path. Raises SeedError."""
    options = _apt_options(scratch)
    run(purpose, "apt-get", *options, "update")
    get = ("source", "--download-only", "--tar-only", package)
    run(f"{purpose}, which apt cannot fetch", "apt-get", *options, *get, cwd=scratch)
    archives = sorted(scratch.glob(f"{package}_*.orig.tar.*"))
    if not archives:
        raise SeedError(f"{purpose}: apt fetched no archive")
    return archives[0]


def with_sources(text: str, is_deb822: bool) -> str:
    """The apt list with source instead of binary packages; ``is_deb822`` says which of apt's two formats it has."""
    if is_deb822:
        return re.sub(r"^Types:.*$", "Types: deb-src", text, flags=re.MULTILINE | re.IGNORECASE)
    return "".join(f"deb-src{rest}\n" for rest in re.findall(r"^\s*deb(\s.*)$", text, flags=re.MULTILINE))


def extract_unity(archive: Path, folder: Path) -> None:
    """Extract Unity's three files from the package's archive. Raises SeedError if one is missing."""
    found = set()
    with tarfile.open(archive) as members:
        for member in members:
            path = PurePosixPath(member.name)
            if member.isfile() and path.parts[1:-1] == ("tests", "unity") and path.name in FILES:
                content = members.extractfile(member)
                assert content is not None
                (folder / path.name).write_bytes(content.read())
                found.add(path.name)
    for name in FILES:
        if name not in found:
            raise SeedError(f"{PURPOSE}: {archive.name} has no tests/unity/{name}")


def unity_version(header: str) -> tuple[int, ...]:
    """The version in Unity's header."""
    names = (f"UNITY_VERSION_{part}" for part in ("MAJOR", "MINOR", "BUILD"))
    found = (re.search(rf"#define\s+{name}\s+(\d+)", header) for name in names)
    return tuple(int(match.group(1)) if match else 0 for match in found)


def _apt_options(scratch: Path) -> list[str]:
    setting = dict(re.findall(r"^(\w+)='(.*)'$", _apt_places(), flags=re.MULTILINE))
    parts, lists, cache = (scratch / name for name in ("parts", "lists", "cache"))
    for folder in (parts, lists, cache):
        folder.mkdir()
    own = [Path(setting["list"]), *sorted(Path(setting["parts"]).glob("*"))]
    for source in (file for file in own if file.suffix in (".list", ".sources") and file.is_file()):
        text = source.read_text(encoding="utf-8")
        (parts / source.name).write_text(with_sources(text, source.suffix == ".sources"), encoding="utf-8")
    chosen = {
        "Dir::Etc::SourceList": "/dev/null",
        "Dir::Etc::SourceParts": parts,
        "Dir::State::Lists": lists,
        "Dir::Cache": cache,
        # apt's own unprivileged user cannot enter the temporary folder.
        "APT::Sandbox::User": "",
        "Acquire::Retries": 1,
        "Acquire::http::Timeout": 15,
        "Acquire::https::Timeout": 15,
    }
    return ["-q", *(f"-o{key}={value}" for key, value in chosen.items())]


def _apt_places() -> str:
    places = ("list", "Dir::Etc::SourceList/f", "parts", "Dir::Etc::SourceParts/d")
    return run(PURPOSE, "apt-config", "shell", *places)


def _dotted(version: tuple[int, ...]) -> str:
    return ".".join(str(part) for part in version)
