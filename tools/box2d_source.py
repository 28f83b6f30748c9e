"""Box2D as a library in PlatformIO's core folder, from the distribution's source archive.

The version is the one that platformio.ini fetches online: the same sources then give the same program and build id.
"""

import tarfile
import tempfile
from pathlib import Path, PurePosixPath

from debian_source import source_archive
from seed_files import SeedError, whole_folder, write_if_changed

SOURCE_PACKAGE = "box2d"
VERSION = "2.4.1"
PURPOSE = f"Box2D {VERSION}, from the source package {SOURCE_PACKAGE}"
# What the digest of a build reads; the rest are examples and their libraries.
PARTS = ("include", "src")
MANIFEST = f'{{"name": "box2d", "version": "{VERSION}", "build": {{"flags": ["-w"]}}}}\n'


def has_box2d(folder: Path) -> bool:
    """Whether `seed_box2d` has filled ``folder``."""
    manifest = folder / "library.json"
    return manifest.is_file() and manifest.read_text(encoding="utf-8") == MANIFEST


def seed_box2d(folder: Path) -> None:
    """Put Box2D into ``folder`` unless it is there already. Raises SeedError."""
    if has_box2d(folder):
        return
    with tempfile.TemporaryDirectory(prefix="foldcar-box2d-") as scratch:
        archive = source_archive(SOURCE_PACKAGE, PURPOSE, Path(scratch))
        if f"_{VERSION}.orig." not in archive.name:
            raise SeedError(f"{PURPOSE}: apt has {archive.name}")
        with whole_folder(folder) as part:
            extract_box2d(archive, part)
            write_if_changed(part / "library.json", MANIFEST)


def extract_box2d(archive: Path, folder: Path) -> None:
    """Extract Box2D's headers and sources from the package's archive. Raises SeedError if there are none."""
    names = set()
    with tarfile.open(archive) as members:
        for member in members:
            path = PurePosixPath(*PurePosixPath(member.name).parts[1:])
            if not member.isfile() or ".." in path.parts or path.parts[:1] not in [(name,) for name in PARTS]:
                continue
            content = members.extractfile(member)
            assert content is not None
            (folder / path).parent.mkdir(parents=True, exist_ok=True)
            (folder / path).write_bytes(content.read())
            names.add(path.parts[0])
    for name in PARTS:
        if name not in names:
            raise SeedError(f"{PURPOSE}: {archive.name} has no folder {name}")
