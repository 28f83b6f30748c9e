"""Working without PlatformIO's registry: the local project file, apt's lists, Unity's archive."""

import json
import re
import sys
import tarfile
import threading
import time
from pathlib import Path

import pytest
import requests

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "tools"))

import box2d_source  # noqa: E402
import debian_source  # noqa: E402
import seed_platformio  # noqa: E402
from seed_files import SeedError, whole_folder  # noqa: E402


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A project's folder, whose seeding takes nothing from outside."""
    monkeypatch.delenv("PLATFORMIO_CORE_DIR", raising=False)
    monkeypatch.delenv("SEED_LIBRARIES", raising=False)
    monkeypatch.setattr(seed_platformio, "seed_core", lambda core_dir: core_dir.mkdir(exist_ok=True))
    monkeypatch.setattr(seed_platformio, "seed_unity", lambda folder: None)
    monkeypatch.setattr(seed_platformio, "seed_box2d", lambda folder: None)
    return tmp_path


def test_seeding_twice_leaves_the_local_file_untouched_and_undo_removes_it_once(project: Path) -> None:
    seed_platformio.seed(project)
    first = (project / "platformio.local.ini").stat()
    seed_platformio.seed(project)
    second = (project / "platformio.local.ini").stat()
    assert (first.st_ino, first.st_mtime_ns) == (second.st_ino, second.st_mtime_ns)
    assert seed_platformio.undo(project)
    assert not (project / "platformio.local.ini").exists()
    assert not seed_platformio.undo(project)
    own = project / "platformio.local.ini"
    own.write_text("[env:carsim]\n", encoding="utf-8")
    with pytest.raises(SeedError, match="not written by this script"):
        seed_platformio.seed(project)
    assert not seed_platformio.undo(project)
    assert own.read_text(encoding="utf-8") == "[env:carsim]\n"


@pytest.mark.parametrize("is_reachable", [True, False])
def test_if_unreachable_seeds_only_where_the_registry_is_silent(
    project: Path, monkeypatch: pytest.MonkeyPatch, is_reachable: bool
) -> None:
    monkeypatch.setattr(seed_platformio, "ROOT", project)
    monkeypatch.setattr(seed_platformio, "is_set_up_online", lambda: False)
    monkeypatch.setattr(seed_platformio, "is_registry_reachable", lambda: is_reachable)
    monkeypatch.setattr(sys, "argv", ["seed_platformio.py", "--if-unreachable"])
    assert seed_platformio.main() == 0
    assert (project / "platformio.local.ini").exists() != is_reachable


def test_neither_a_silent_network_nor_a_login_page_is_the_registry(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    released = threading.Event()
    monkeypatch.setattr(seed_platformio, "PROBE_TIMEOUT_S", 0.2)
    monkeypatch.setattr(seed_platformio.requests, "get", lambda *_, **__: released.wait())
    start_s = time.monotonic()
    is_reachable = seed_platformio.is_registry_reachable()
    took_s = time.monotonic() - start_s
    assert not is_reachable
    login_page = requests.Response()
    login_page.status_code, login_page._content = 200, b"<html>Please log in</html>"
    monkeypatch.setattr(seed_platformio.requests, "get", lambda *_, **__: login_page)
    assert not seed_platformio.is_registry_reachable()
    # The hosts are asked at once, and none for longer than the limit: room for a busy machine.
    assert took_s < 30.0


def test_arduino_json_is_taken_from_a_named_folder_in_the_version_of_the_board(tmp_path: Path) -> None:
    source = tmp_path / "libraries" / "ArduinoJson"
    source.mkdir(parents=True)
    (source / "ArduinoJson.h").write_text("// the header", encoding="utf-8")
    seeded = tmp_path / "lib" / "ArduinoJson"
    for manifest, complaint in ((None, "no library.json with a version"), ('{"version": "6.0.0"}', "has version 6.0.0")):
        if manifest is not None:
            (source / "library.json").write_text(manifest, encoding="utf-8")
        with pytest.raises(SeedError, match=rf"SEED_LIBRARIES: .*{complaint}, platformio.ini asks for \d"):
            seed_platformio.seed_arduino_json(seeded, source.parent)
        assert not seeded.exists()

    wanted = re.search(r"^arduino_json = .*@(\S+)$", (ROOT / "platformio.ini").read_text(encoding="utf-8"), re.MULTILINE)
    assert wanted is not None
    (source / "library.json").write_text(json.dumps({"version": wanted[1]}), encoding="utf-8")
    seed_platformio.seed_arduino_json(seeded, source.parent)
    assert (seeded / "ArduinoJson.h").read_text(encoding="utf-8") == "// the header"


def test_an_interrupted_folder_is_not_left_half_written(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), whole_folder(tmp_path / "package") as part:
        (part / "one.py").write_text("", encoding="utf-8")
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []


def test_apts_lists_of_both_forms_are_turned_to_sources() -> None:
    deb822 = "# main\nTypes: deb deb-src\nURIs: http://mirror/x\nSuites: stable\nSigned-By: /k.gpg\n"
    assert debian_source.with_sources(deb822, is_deb822=True) == deb822.replace("deb deb-src", "deb-src")
    wanted = "deb [signed-by=/k.gpg] http://mirror/ x main\n"
    lines = f"# deb http://off/ x main\n{wanted}deb-src http://mirror/ x main\n"
    assert debian_source.with_sources(lines, is_deb822=False) == wanted.replace("deb", "deb-src", 1)


def test_of_box2ds_archive_headers_and_sources_are_taken(tmp_path: Path) -> None:
    names = ("include/box2d/box2d.h", "src/dynamics/b2_world.cpp", "testbed/main.cpp")
    archive = tmp_path / "box2d_2.4.1.orig.tar.gz"
    with tarfile.open(archive, "w:gz") as members:
        for name in names:
            (tmp_path / Path(name).name).write_text(name, encoding="utf-8")
            members.add(tmp_path / Path(name).name, f"box2d-2.4.1/{name}")
    folder = tmp_path / "library"
    box2d_source.extract_box2d(archive, folder)
    texts = {file.relative_to(folder).as_posix(): file.read_text() for file in folder.rglob("*") if file.is_file()}
    assert texts == {name: name for name in names[:2]}
