"""The build id depends on everything that carsim is built from, and on nothing else."""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "tools"))

import simulation_digest  # noqa: E402


def make_checkout(folder: Path) -> Path:
    """A small checkout: a simulator, a portable and a board's library, Box2D as PlatformIO fetches it."""
    files = {
        "sim2d/lib/car/car.cpp": "float speed;",
        "firmware/lib/control/control.cpp": "int control;",
        "firmware/lib/board/board.cpp": "int board;",
        "firmware/lib/board/library.json": '{"platforms": "espressif32"}',
        "libdeps/box2d/src/world.cpp": "int world;",
        "libdeps/box2d/testbed/main.cpp": "int main;",
    }
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    return folder


def digest(checkout: Path, flags: tuple[str, ...] = ("-O2",), compiler: str | None = None) -> str:
    return simulation_digest.simulation_digest(checkout, flags, compiler, [checkout / "none", checkout / "libdeps"])


def test_the_build_id_is_that_of_the_sources_of_results_wherever_they_lie(tmp_path: Path) -> None:
    here, there = make_checkout(tmp_path / "here"), make_checkout(tmp_path / "there" / "deeper")
    before = digest(here)
    assert before == digest(there) and len(before) == 16 and digest(here, flags=("-O3",)) != before
    # For programs whose results depend on the compiler.
    assert digest(here, compiler="g++") != before

    for name in ("firmware/lib/board/board.cpp", "libdeps/box2d/testbed/main.cpp"):
        (here / name).write_text("changed", encoding="utf-8")
    assert digest(here) == before
    seen = {before}
    for name in ("sim2d/lib/car/car.cpp", "firmware/lib/control/control.cpp", "libdeps/box2d/src/world.cpp"):
        (here / name).write_text("changed", encoding="utf-8")
        seen.add(digest(here))
    assert len(seen) == 4


def test_the_header_is_rewritten_only_when_the_id_changes(tmp_path: Path) -> None:
    header = tmp_path / "build_id" / "build_id.h"
    simulation_digest.write_header(header, "FOLDCAR_BUILD_ID", "0123456789abcdef")
    first = header.stat().st_mtime_ns
    simulation_digest.write_header(header, "FOLDCAR_BUILD_ID", "0123456789abcdef")
    assert header.stat().st_mtime_ns == first
    assert '#define FOLDCAR_BUILD_ID "0123456789abcdef"' in header.read_text(encoding="utf-8")


def test_the_firmware_id_stands_for_the_firmware_with_its_board_and_the_dialect(tmp_path: Path) -> None:
    checkout = make_checkout(tmp_path)
    dialect = (f"host/foldcar/link/{name}" for name in ("dialect.py", "foldcar.xml", "standard_messages.txt"))
    files = ("firmware/src/main.cpp", *dialect)
    for name in files:
        (checkout / name).parent.mkdir(parents=True, exist_ok=True)
        (checkout / name).write_text("first", encoding="utf-8")
    seen = {simulation_digest.firmware_digest(checkout)}
    for name in ("firmware/lib/board/board.cpp", "firmware/lib/control/control.cpp", *files):
        (checkout / name).write_text("changed", encoding="utf-8")
        seen.add(simulation_digest.firmware_digest(checkout))
    assert len(seen) == 7
    (checkout / "sim2d/lib/car/car.cpp").write_text("changed", encoding="utf-8")
    assert simulation_digest.firmware_digest(checkout) in seen
