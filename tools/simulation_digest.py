"""A digest of everything that can change a simulation's results: sources, flags, Box2D.

Compilers and C libraries that compute the golden numbers of test/determinism compute all runs alike, so they are not part
of it. Others are, and so are those of MuJoCo's program, which calls the C library's functions. The digest does not depend
on the checkout's path nor on the order in which the file system lists files.
"""

import hashlib
import json
import platform
import subprocess
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path


class Box2dError(Exception):
    """Box2D is in none of PlatformIO's folders of libraries."""


def simulation_digest(root: Path, flags: Sequence[str], compiler: str | None, libraries: Sequence[Path]) -> str:
    """The digest as 16 hexadecimal digits.

    ``root`` is the project's folder, ``flags`` the compiler flags, ``compiler`` the C++ compiler's command if results
    depend on it, ``libraries`` the folders where PlatformIO may keep the environment's libraries. Raises Box2dError.
    """
    digest = hashlib.sha256()
    platform_texts = [] if compiler is None else [compiler_version(compiler), " ".join(platform.libc_ver())]
    for text in (" ".join(flags), *platform_texts):
        _add(digest, "text", text.encode())
    for name, content in _contents(root, source_files(root)):
        _add(digest, name, content)
    for name, content in _box2d_contents(libraries):
        _add(digest, name, content)
    return digest.hexdigest()[:16]


def source_files(root: Path) -> list[Path]:
    """The source files of carsim, that is of the portable firmware and the simulator, sorted by path."""
    firmware = (folder for folder in (root / "firmware" / "lib").iterdir() if _is_portable(folder))
    folders = [root / "sim2d", *firmware]
    return sorted(file for folder in folders for file in _files(folder))


def firmware_digest(root: Path) -> str:
    """The digest of a car's firmware, board code included, and the MAVLink dialect: 16 hexadecimal digits."""
    digest = hashlib.sha256()
    folders = (root / "firmware" / "lib", root / "firmware" / "src")
    files = [root / "host" / "foldcar" / "link" / name for name in ("dialect.py", "foldcar.xml", "standard_messages.txt")]
    files += [file for folder in folders for file in _files(folder)]
    for name, content in _contents(root, sorted(files)):
        _add(digest, name, content)
    return digest.hexdigest()[:16]


def compiler_version(compiler: str) -> str:
    """The compiler's target and version as it reports them."""
    return _ask(compiler, "-dumpmachine") + _ask(compiler, "--version")


def write_header(file: Path, name: str, digest: str) -> None:
    """Write the header that defines the macro ``name``, unless its content is unchanged."""
    text = f'#pragma once\n#define {name} "{digest}"\n'
    if not file.is_file() or file.read_text(encoding="utf-8") != text:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8")


def _is_portable(library: Path) -> bool:
    manifest = library / "library.json"
    if not manifest.is_file():
        return library.is_dir()
    platforms = json.loads(manifest.read_text(encoding="utf-8")).get("platforms", "*")
    return "*" in platforms or "native" in platforms


def _box2d_contents(libraries: Iterable[Path]) -> Iterator[tuple[str, bytes]]:
    source = next((folder / "box2d" for folder in libraries if (folder / "box2d").is_dir()), None)
    if source is None:
        raise Box2dError("Box2D is missing: run `make setup`")
    files = [file for part in ("include", "src") for file in _files(source / part)]
    yield from _contents(source, sorted(files))


def _files(folder: Path) -> Iterator[Path]:
    return (file for file in folder.rglob("*") if file.is_file() and "__pycache__" not in file.parts)


def _contents(base: Path, files: Iterable[Path]) -> Iterator[tuple[str, bytes]]:
    return ((file.relative_to(base).as_posix(), file.read_bytes()) for file in files)


def _ask(*command: str) -> str:
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def _add(digest: "hashlib._Hash", name: str, content: bytes) -> None:
    # The lengths make the encoding unambiguous: different lists of files give different bytes.
    digest.update(f"{len(name)} {len(content)} {name}".encode())
    digest.update(content)
