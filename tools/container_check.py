"""Exercises the Dockerfile where there is no container engine: its steps, each in the bare root of its stage.

Usage, as root: container_check.py

The Dockerfile itself is read; an instruction that this does not know is an error. An image debian:SUITE-slim is a
minimal root by debootstrap, in .fresh. Then the finished container is used as docs/installation.md says, by a user who
is not root and has no account in it. Mounts end with the process, which has namespaces of its own.
"""

import json
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

PROJECT = Path(__file__).resolve().parent.parent
ROOTS = PROJECT / ".fresh"
PATH = "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"
IMAGE = re.compile(r"debian:([a-z]+)-slim(?: AS ([a-z]+))?")
# A caller without an account in the container.
CALLER = "12345:12345"
COMMANDS = (
    "new yard",
    "sweep yard/study.json --store study.db",
    "sweep yard/study.json --store mujoco.db --engine mujoco --realities 100",
    "report study.db -o report",
)


class ContainerError(Exception):
    """A step that failed or is not understood; the message is one line."""


@dataclass
class Stage:
    """An image while it is made: its root and what the instructions have set for the next ones."""

    root: Path
    environment: dict[str, str]
    user: str = "root"
    folder: str = "/"
    entry: list[str] = field(default_factory=list)

    def run(self, command: list[str], user: str = "") -> None:
        """Run a command in the root, as an engine would. ContainerError if it fails."""
        name = user or self.user
        accounts = [line.split(":") for line in (self.root / "etc" / "passwd").read_text().splitlines()]
        home = next((account[5] for account in accounts if account[0] == name), "/")
        userspec = name if ":" in name else f"{name}:{name}"
        words = ["chroot", f"--userspec={userspec}", str(self.root), "/bin/sh", "-c", 'cd "$0" && exec "$@"', self.folder]
        environment = {"PATH": PATH, "HOME": home, **self.environment}
        code = subprocess.run([*words, *command], env=environment, check=False).returncode
        if code != 0:
            raise ContainerError(f"exit code {code} of: {' '.join(command)}")

    def copy(self, sources: list[Path], to: str) -> None:
        """COPY: into a folder, which is made; of a folder its content. ContainerError if a source is missing."""
        target = self.root / to.lstrip("/")
        target.mkdir(parents=True, exist_ok=True)
        for source in sources:
            if not source.exists():
                raise ContainerError(f"COPY: there is no {source}")
            if source.is_dir():
                shutil.copytree(source, target, symlinks=True, dirs_exist_ok=True, ignore=ignored)
            else:
                shutil.copy(source, target)


def instructions(text: str) -> list[tuple[str, str]]:
    """The Dockerfile's instructions, each with the rest of its line, continuation lines joined."""
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    joined = re.sub(r"\\\n\s*", "", "\n".join(lines))
    return [(word, rest.strip()) for word, _, rest in (line.partition(" ") for line in joined.splitlines())]


def ignored(folder: str, names: list[str]) -> set[str]:
    """What .dockerignore keeps out of the project's copy: names at its top, or `**/NAME` anywhere. For copytree."""
    patterns = [Path(line) for line in (PROJECT / ".dockerignore").read_text().split()]
    inside = Path(folder).is_relative_to(PROJECT) and not Path(folder).is_relative_to(ROOTS)
    top = Path(folder) == PROJECT
    return {
        name for name in names for pattern in patterns
        if inside and (pattern.parts[0] == "**" or top) and Path(name).match(pattern.name)
    }  # fmt: skip


def bare(suite: str, name: str) -> Stage:
    """A new root of that suite, with this machine's network."""
    root = ROOTS / name
    subprocess.run([PROJECT / "tools" / "bare_root.sh", suite, root], check=True)
    return Stage(root, variables(filter(None, Path(f"{root}.env").read_bytes().decode().split("\0"))))


def variables(lines: Iterable[str]) -> dict[str, str]:
    """NAME=VALUE as a table."""
    return {name: value for name, _, value in (line.partition("=") for line in lines)}


def build(text: str) -> Stage:
    """The last stage of the Dockerfile, finished. ContainerError."""
    stages: dict[str, Stage] = {}
    stage: Stage | None = None
    for word, rest in instructions(text):
        began_s = time.monotonic()
        print(f"container: {word} {rest}", flush=True)
        if word == "FROM":
            if not (match := IMAGE.fullmatch(rest)):
                raise ContainerError(f"FROM {rest}: not debian:SUITE-slim")
            name = match[2] or "last"
            stage = stages[name] = bare(match[1], f"container-{name}")
        elif stage is None:
            raise ContainerError(f"{word} before FROM")
        elif word == "RUN":
            stage.run(["/bin/sh", "-c", rest])
        elif word == "COPY":
            words = rest.split()
            base = stages[words.pop(0).removeprefix("--from=")].root if words[0].startswith("--from=") else PROJECT
            stage.copy([base / path.lstrip("/") for path in words[:-1]], words[-1])
        elif word == "USER":
            stage.user = rest
        elif word == "WORKDIR":
            stage.folder = rest
        elif word == "ENV":
            stage.environment.update(variables(rest.split()))
        elif word == "ENTRYPOINT":
            stage.entry = json.loads(rest)
        else:
            raise ContainerError(f"{word}: not known here")
        print(f"container: {time.monotonic() - began_s:.0f} s", flush=True)
    if stage is None or not stage.entry or stage.user == "root":
        raise ContainerError("the Dockerfile ends without an ENTRYPOINT, or as root")
    return stage


def use(stage: Stage) -> None:
    """Run COMMANDS, with a folder of the caller's in place of the container's own. ContainerError."""
    own_root = ROOTS / "container-work"
    shutil.rmtree(own_root, ignore_errors=True)
    own_root.mkdir()
    uid, gid = map(int, CALLER.split(":"))
    os.chown(own_root, uid, gid)
    stage.run([*stage.entry, "--version"])
    subprocess.run(["mount", "--bind", own_root, f"{stage.root}{stage.folder}"], check=True)
    for command in COMMANDS:
        print(f"container: as {CALLER}: {command}", flush=True)
        stage.run([*stage.entry, *command.split()], CALLER)
    page = own_root / "report" / "index.html"
    if page.stat().st_uid != uid or b"W_B_W" not in page.read_bytes():
        raise ContainerError(f"{page}: not the caller's, or without its cars")
    size = subprocess.run(["du", "-sxm", stage.root], capture_output=True, text=True, check=True).stdout.split()[0]
    print(f"container: the Dockerfile's steps passed; {size} MB in {stage.root}")


def main() -> int:
    """Run all in namespaces of its own; returns the exit code."""
    if os.geteuid() != 0:
        print("container: debootstrap and chroot need root", file=sys.stderr)
        return 2
    if os.environ.get("CONTAINER_INSIDE") != "yes":
        os.environ["CONTAINER_INSIDE"] = "yes"
        apart = ["unshare", "--mount", "--propagation", "private", "--pid", "--fork", "--kill-child"]
        os.execvp(apart[0], [*apart, sys.executable, *sys.argv])
    try:
        use(build((PROJECT / "Dockerfile").read_text(encoding="utf-8")))
    except (ContainerError, OSError, subprocess.CalledProcessError) as error:
        print(f"container: FAILED: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
