"""The source archives of the distribution's packages, which apt fetches and verifies.

apt works in a temporary folder, with a copy of its configuration in which source archives are enabled.
"""

import re
from pathlib import Path

from seed_files import SeedError, run


def source_archive(package: str, purpose: str, scratch: Path) -> Path:
    """Download the package's upstream archive into ``scratch``; its path. Raises SeedError with ``purpose``."""
    options = _apt_options(scratch, purpose)
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


def _apt_options(scratch: Path, purpose: str) -> list[str]:
    setting = dict(re.findall(r"^(\w+)='(.*)'$", _apt_places(purpose), flags=re.MULTILINE))
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


def _apt_places(purpose: str) -> str:
    places = ("list", "Dir::Etc::SourceList/f", "parts", "Dir::Etc::SourceParts/d")
    return run(purpose, "apt-config", "shell", *places)
