"""Builds the Unity suites with mutants in place of single objects, and runs them; runs processes that can be stopped.

Objects, programs and verdicts are kept in a folder of their own, each under a hash of all that it depends on.
"""

import configparser
import hashlib
import json
import re
import subprocess
import threading
import time
from dataclasses import asdict, dataclass
from pathlib import Path

from mutants import Mutant

# What no suite needs that runs with mutants, or what builds on the board only.
LEFT_OUT = {"feather_hal", "design_json", "protocol", "linked_car", "link", "firmware"}
SLACK_S = 5.0  # a suite may take three times its own time and this much longer
FAILURES = re.compile(rb"^\d+ Tests (\d+) Failures", re.M)


class StoppedError(Exception):
    """The run was interrupted: a process that was ended says nothing about its mutant."""


class BuildError(Exception):
    """A compiler or linker that failed; the message is its own."""


@dataclass(frozen=True)
class Verdict:
    """What became of a mutant: killed, equivalent, stillborn or survived, and the suite that killed it."""

    result: str
    suite: str = ""


class Processes:
    """Processes that can all be stopped."""

    def __init__(self) -> None:
        self._stopping = threading.Event()
        self._running: set[subprocess.Popen[bytes]] = set()

    def stop(self) -> None:
        """Ends every process under way; what waits for one raises StoppedError."""
        self._stopping.set()
        for process in list(self._running):
            process.kill()

    def process(
        self, command: list[str], folder: Path, limit_s: float | None, environment: dict[str, str] | None = None
    ) -> tuple[int, bytes]:
        """Exit code and output of a command, in a session of its own: Ctrl-C is for this program to handle."""
        if self._stopping.is_set():
            raise StoppedError
        process = subprocess.Popen(
            command, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, start_new_session=True
        )
        self._running.add(process)
        try:
            output, _ = process.communicate(timeout=limit_s)
        finally:
            process.kill()
            process.wait()
            self._running.discard(process)
        if self._stopping.is_set():
            raise StoppedError
        return process.returncode, output


class Workshop(Processes):
    """Compiles, links and runs. Objects are kept by a hash of everything they are made from."""

    def __init__(self, root: Path, work: Path) -> None:
        super().__init__()
        self.root = root
        self.work = work
        self.times_s: dict[str, float] = {}
        self.suites: dict[str, list[Path]] = {}
        for folder in ("objects", "programs", "verdicts", "copies"):
            (work / folder).mkdir(parents=True, exist_ok=True)
        config = configparser.ConfigParser(interpolation=None)
        config.read(root / "platformio.ini", encoding="utf-8")
        flags = config["host"]["build_flags"].split()
        libraries = _libraries(root)
        self.flags = [flag for flag in flags if not flag.startswith(("$", "-W"))] + ["-w", "-DUNITY_INCLUDE_DOUBLE"]
        self.unity = _unity(root)
        box2d = _box2d(root)
        folders = [*libraries, root / ".pio" / "mavlink", self.unity, box2d / "include"]
        self.includes = [f"-I{path}" for path in folders]
        sources = [source for library in libraries for source in sorted(library.glob("*.cpp"))]
        headers = [header for folder in [*libraries, root / "test"] for header in sorted(folder.glob("*.h"))]
        # Their comments change no object.
        texts = (re.sub(rb"^\s*//.*$", b"", header.read_bytes(), flags=re.M) for header in headers)
        self.headers = hashlib.sha256(b"".join(texts)).hexdigest()
        sources += [self.unity / "unity.c", *sorted((box2d / "src").rglob("*.cpp"))]
        self.objects = {source: self.compile(source) for source in sources}

    def compile(self, source: Path, text: str | None = None) -> Path:
        """The object of a source file, or of ``text`` in its place. Raises BuildError."""
        content = source.read_bytes() if text is None else text.encode()
        parts = (" ".join([*self.flags, *self.includes]).encode(), self.headers.encode(), source.name.encode(), content)
        key = hashlib.sha256(b"\0".join(parts)).hexdigest()
        target = self.work / "objects" / f"{key}.o"
        if target.is_file():
            return target
        copy = self.work / "copies" / f"{key[:16]}.{threading.get_ident()}" / source.name
        copy.parent.mkdir(exist_ok=True)
        copy.write_bytes(content)
        try:
            # Compiled in its own folder under its own name, so that the object depends on the code alone.
            in_c = source.suffix == ".c"
            flags = [flag for flag in self.flags if not (in_c and flag.startswith("-std"))]
            flags += [f"-I{source.parent}", *self.includes]
            made = copy.with_suffix(".o")
            self._run(["gcc" if in_c else "g++", *flags, "-c", copy.name, "-o", made.name], copy.parent)
            made.replace(target)
        finally:
            for file in copy.parent.iterdir():
                file.unlink()
            copy.parent.rmdir()
        return target

    def prepare(self, suite: str) -> None:
        """Builds a suite and measures its time. Raises BuildError if it fails without any mutant."""
        self.suites[suite] = [self.compile(file) for file in sorted((self.root / "test" / suite).glob("*.cpp"))]
        program = self.link(suite, None, None)
        start = time.monotonic()
        if not self.passes(program, 600):
            raise BuildError(f"{suite} fails without a mutant: mend it first")
        self.times_s[suite] = time.monotonic() - start

    def link(self, suite: str, source: Path | None, mutant: Path | None) -> Path:
        """The suite's program, with ``mutant`` in place of the object of ``source``."""
        objects = [mutant if path == source and mutant else built for path, built in self.objects.items()]
        program = self.work / "programs" / f"{suite}.{threading.get_ident()}"
        files = [str(path) for path in (*self.suites[suite], *objects)]
        self._run(["g++", *files, "-pthread", "-o", str(program)], self.work)
        return program

    def passes(self, program: Path, limit_s: float) -> bool:
        """Whether a suite's program ends in time without a failed test."""
        try:
            code, output = self.process([str(program)], self.work, limit_s)
        except subprocess.TimeoutExpired:
            return False
        summary = FAILURES.search(output)
        return code == 0 and summary is not None and summary.group(1) == b"0"

    def judge(self, source: Path, mutant: Mutant, suites: list[str]) -> Verdict:
        """Compiles and runs a mutant; a verdict on the same object code and suites is not made twice."""
        try:
            built = self.compile(source, mutant.text)
        except BuildError:
            return Verdict("stillborn")
        if built.read_bytes() == self.objects[source].read_bytes():
            return Verdict("equivalent")
        linked = [made for suite in suites for made in self.suites[suite]]
        linked += [made for path, made in self.objects.items() if path != source]
        parts = [hashlib.sha256(made.read_bytes()).hexdigest() for made in (built, *linked)]
        kept = self.work / "verdicts" / hashlib.sha256(" ".join(parts).encode()).hexdigest()
        if kept.is_file():
            return Verdict(**json.loads(kept.read_text()))
        verdict = Verdict("survived")
        for suite in suites:
            if not self.passes(self.link(suite, source, built), 3 * self.times_s[suite] + SLACK_S):
                verdict = Verdict("killed", suite)
                break
        kept.write_text(json.dumps(asdict(verdict)))
        return verdict

    def _run(self, command: list[str], folder: Path) -> None:
        code, output = self.process(command, folder, None)
        if code != 0:
            raise BuildError(output.decode(errors="replace")[-2000:])


def _libraries(root: Path) -> list[Path]:
    folders = [*(root / "firmware" / "lib").iterdir(), *(root / "sim2d" / "lib").iterdir()]
    return sorted(folder for folder in folders if folder.is_dir() and folder.name not in LEFT_OUT)


def _unity(root: Path) -> Path:
    """The folder of Unity's sources, as PlatformIO has it."""
    for pattern in (".pio/libdeps/native/Unity/src/unity.h", ".pio-core/lib/Unity/unity.h"):
        for found in root.glob(pattern):
            return found.parent
    raise BuildError("Unity is not there: run `make test-native` once")


def _box2d(root: Path) -> Path:
    """The folder of Box2D's headers and sources, as PlatformIO has it."""
    for pattern in (".pio/libdeps/native/box2d", ".pio-core/lib/box2d"):
        for found in root.glob(pattern):
            return found
    raise BuildError("Box2D is not there: run `make setup` once")
