"""The reading of the Dockerfile by `make container-check`."""

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "tools"))

import container_check  # noqa: E402


def test_every_line_of_the_dockerfile_is_read() -> None:
    read = container_check.instructions((ROOT / "Dockerfile").read_text(encoding="utf-8"))

    words = [word for word, _ in read]
    assert words.count("FROM") == 2 and words[-1] == "ENTRYPOINT"
    users = [rest for word, rest in read if word == "USER"]
    assert users and users[-1] not in ("", "root", "0")


def test_the_copy_leaves_out_what_docker_leaves_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    project = tmp_path / "project"
    for file in (".git/x", "dist/x", "host/dist/x", "host/a/__pycache__/x", "host/foldcar.egg-info/x", ".fresh/r/dist/x"):
        (project / file).parent.mkdir(parents=True, exist_ok=True)
        (project / file).touch()
    (project / ".dockerignore").write_bytes((ROOT / ".dockerignore").read_bytes())
    monkeypatch.setattr(container_check, "PROJECT", project)
    monkeypatch.setattr(container_check, "ROOTS", project / ".fresh")

    container_check.Stage(tmp_path, {}).copy([project], "copy")
    container_check.Stage(tmp_path, {}).copy([project / ".fresh" / "r"], "other")

    files = [*(tmp_path / "copy").rglob("x"), *(tmp_path / "other").rglob("x")]
    copied = {file.relative_to(tmp_path).as_posix() for file in files}
    assert copied == {"copy/host/dist/x", "other/dist/x"}


def test_what_is_not_understood_is_an_error() -> None:
    with pytest.raises(container_check.ContainerError, match=r"^FROM scratch: not debian:SUITE-slim$"):
        container_check.build("FROM scratch")
