"""Box2D's sources, for builds that compile them with flags of their own: box2d_source.py FOLDER.

They are a link to those that PlatformIO fetched, else come from the distribution's source archive. FOLDER then has
`include` and `src`; it must not exist.
"""

import sys
import tarfile
import tempfile
from pathlib import Path, PurePosixPath

from seed_files import SeedError, whole_folder
from unity_source import download_archive

FETCHED = Path(__file__).resolve().parent.parent / ".pio" / "libdeps" / "carsim" / "box2d"
PACKAGE = "box2d"


def put_sources(folder: Path) -> None:
    """Put them there. Raises SeedError."""
    if FETCHED.is_dir():
        folder.symlink_to(FETCHED)
        return
    with tempfile.TemporaryDirectory(prefix="foldcar-box2d-") as scratch:
        archive = download_archive(Path(scratch), PACKAGE, f"Box2D, from the source package {PACKAGE}")
        with whole_folder(folder) as part, tarfile.open(archive) as members:
            for member in members:
                path = PurePosixPath(*PurePosixPath(member.name).parts[1:])
                content = members.extractfile(member) if path.parts[:1] in (("include",), ("src",)) else None
                if content is not None:
                    (part / path).parent.mkdir(parents=True, exist_ok=True)
                    (part / path).write_bytes(content.read())


if __name__ == "__main__":
    try:
        put_sources(Path(sys.argv[1]).absolute())
    except (SeedError, OSError) as error:
        print(f"box2d_source: error: {error}", file=sys.stderr)
        sys.exit(2)
