"""Mutation run: plants small faults in the C++ sources, or in the host's statistics, and sees whether tests notice them.

Usage: mutation.py [--host] [--mutants N|all] [--seed S] [--only TEXT] [--jobs N]

For each file of TARGETS a seeded sample of its mutants (tools/mutants.py) is compiled from a copy, linked with the suites
that concern the file and run. A mutant is killed if a suite fails, crashes or takes far longer than without it;
equivalent if its object code is that of the original; stillborn if it does not compile; otherwise it survives. Survivors
that tools/mutation_explained.txt gives a reason for are explained. With --host the files are the Python ones of TARGETS,
mutated by cosmic-ray (tools/python_mutants.py), which must be there, and what notices are files of test/host.

The working tree is only read; everything is made in .pio/mutation, where verdicts are kept too, so that an interrupted
run goes on where it was. Exit code: 0, 1 with survivors that are not explained or reasons that fit no line, 2 if
the suites cannot be built or fail without a mutant, 130 when interrupted.
"""

import argparse
import random
import signal
import sys
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

from mutants import Mutant, mutants_of
from mutation_build import BuildError, Workshop
from mutation_tests import PythonWorkshop

ROOT = Path(__file__).resolve().parent.parent
WORK = ROOT / ".pio" / "mutation"
EXPLAINED = ROOT / "tools" / "mutation_explained.txt"
CAR = ["test_sim_terms", "test_sim_car", "test_sim_terrain", "test_sim_trial"]
# Sources, or folders of them, and the suites that concern them, the quick ones first. The first entry that fits counts.
TARGETS = {
    "sim2d/lib/engine": CAR,
    "sim2d/lib/multibody": CAR,
    "sim2d/lib/side_view": ["test_sim_side_view"],
    "firmware/lib/control": ["test_control"],
    "firmware/lib/supervisor": ["test_supervisor", "test_application"],
    "host/foldcar/analysis/engine_bias.py": ["test_rate_statistics.py"],
    "host/foldcar/analysis/gap.py": ["test_compare.py"],
    "host/foldcar/analysis/gaussian_process.py": ["test_gaussian_process.py", "test_success_maps.py"],
    "host/foldcar/analysis/built_cars.py": ["test_built_cars.py"],
    "host/foldcar/analysis/pooled_bias.py": ["test_gaussian_process.py"],
    "host/foldcar/analysis/rate.py": ["test_rate_statistics.py", "test_sweep_until.py"],
    "host/foldcar/analysis/selection.py": ["test_select.py"],
    "host/foldcar/analysis/stopping.py": ["test_sweep_until.py"],
    "host/foldcar/analysis/words.py": ["test_advice.py", "test_compare.py"],
    "host/foldcar/analysis": ["test_rate_statistics.py"],
    "host/foldcar/advice/comparison.py": ["test_advice.py", "test_compare.py"],
    "host/foldcar/advice/resimulation.py": ["test_compare.py"],
    "host/foldcar/advice": ["test_advice.py", "test_select.py", "test_compare.py"],
    "host/foldcar/calibration/environment.py": ["test_reality.py", "test_calibration.py"],
    "host/foldcar/calibration/parameters.py": ["test_reality.py", "test_inference.py", "test_calibration.py"],
    "host/foldcar/calibration": ["test_inference.py", "test_calibration.py"],
}


def suites_of(file: str) -> list[str]:
    """The suites that concern a source file, given relative to the root."""
    return next(suites for target, suites in TARGETS.items() if file == target or file.startswith(target + "/"))


def read_explained(path: Path) -> dict[tuple[str, str, str], str]:
    """Reasons by (file, original line, mutated line); a mutated line "*" stands for every mutation of that line.

    The format: the file's path, then for each mutant "- original", "+ mutated", "= reason". ValueError if it is broken.
    """
    reasons: dict[tuple[str, str, str], str] = {}
    file = original = mutated = ""
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        mark, _, rest = line.partition(" ")
        if not line.strip() or mark == "#":
            continue
        if mark == "-":
            original = rest
        elif mark == "+":
            mutated = rest
        elif mark == "=" and file and original and mutated and rest:
            reasons[file, original, mutated] = rest
            mutated = ""
        elif not rest and "/" in mark:
            file = mark
        else:
            raise ValueError(f"{path.name}:{number}: expected a path, or a line that starts with '-', '+' or '='")
    return reasons


def stale_reasons(root: Path, reasons: dict[tuple[str, str, str], str]) -> list[str]:
    """The explained lines that their file does not have."""
    stale = []
    for file, original, _ in reasons:
        path = root / file
        lines = {line.strip() for line in path.read_text(encoding="utf-8").splitlines()} if path.is_file() else set()
        if original not in lines:
            stale.append(f"{file}: {original}")
    return sorted(set(stale))


def chosen(root: Path, host: bool, only: str, most: int | None, seed: int) -> list[tuple[Path, Mutant]]:
    """The sample: up to ``most`` mutants of each file, all if it is None, the files taken in turn.

    The same seed gives the same order, whatever ``most`` is: a larger sample contains the smaller one.
    """
    suffix = ".py" if host else ".cpp"
    sources = {root / target for target in TARGETS if target.endswith(suffix)}
    sources |= {path for target in TARGETS for path in (root / target).glob(f"*{suffix}")}
    sample_of = _python_sample if host else _cpp_sample
    sample: list[tuple[int, Path, Mutant]] = []
    for source in sorted(sources):
        name = source.relative_to(root).as_posix()
        if only not in name:
            continue
        mutants = sample_of(source.read_text(encoding="utf-8"), most, random.Random(f"{seed}:{name}"))
        sample += [(turn, source, mutant) for turn, mutant in enumerate(mutants)]
    sample.sort(key=lambda choice: choice[:2])
    return [(source, mutant) for _, source, mutant in sample]


def _cpp_sample(text: str, most: int | None, order: random.Random) -> list[Mutant]:
    mutants = mutants_of(text)
    order.shuffle(mutants)
    return mutants[:most]


def _python_sample(text: str, most: int | None, order: random.Random) -> list[Mutant]:
    from python_mutants import sample_of

    return sample_of(text, most, order)


def main() -> int:
    """Run the command line; returns the exit code."""
    parser = argparse.ArgumentParser(description="Plants faults in the sources and sees whether tests notice.")
    parser.add_argument("--host", action="store_true", help="in the host's statistics instead of C++")
    parser.add_argument("--mutants", default="10", help="mutants of each file, or 'all' (default %(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="of the sample (default %(default)s)")
    parser.add_argument("--only", default="", metavar="TEXT", help="only files whose path contains TEXT")
    parser.add_argument("--jobs", type=int, default=1, help="mutants at the same time (default %(default)s)")
    options = parser.parse_args()
    if options.mutants != "all" and not options.mutants.isdecimal():
        parser.error(f"--mutants: {options.mutants} is neither a number nor 'all'")
    # Also where the caller ignores Ctrl-C, as a shell does for what it starts in the background.
    for interruption in (signal.SIGINT, signal.SIGTERM):
        signal.signal(interruption, signal.default_int_handler)
    start = time.monotonic()
    most = None if options.mutants == "all" else int(options.mutants)
    sample = chosen(ROOT, options.host, options.only, most, options.seed)
    if not sample:
        parser.error(f"--only: no target's path contains {options.only}")
    try:
        reasons = read_explained(EXPLAINED)
        tested_by = ROOT / ".venv" / "bin" / "python"
        workshop = PythonWorkshop(ROOT, WORK, tested_by) if options.host else Workshop(ROOT, WORK)
        for suite in sorted({suite for source, _ in sample for suite in suites_of(source.relative_to(ROOT).as_posix())}):
            workshop.prepare(suite)
            print(f"{suite} passes in {workshop.times_s[suite]:.1f} s", flush=True)
    except KeyboardInterrupt:
        return 130
    except (BuildError, ValueError) as error:
        print(f"mutation: error: {error}", file=sys.stderr)
        return 2
    return run(workshop, sample, reasons, options.jobs, start)


def run(
    workshop: Workshop | PythonWorkshop,
    sample: list[tuple[Path, Mutant]],
    reasons: dict[tuple[str, str, str], str],
    jobs: int,
    start: float,
) -> int:
    """Judges the sample, prints progress, survivors and numbers; the exit code."""
    counts: Counter[str] = Counter()
    interrupted = False
    with ThreadPoolExecutor(jobs) as pool:
        waiting = {
            pool.submit(workshop.judge, source, mutant, suites_of(source.relative_to(ROOT).as_posix())): (source, mutant)
            for source, mutant in sample
        }
        try:
            for done in as_completed(waiting):
                source, mutant = waiting[done]
                file = source.relative_to(ROOT).as_posix()
                result = done.result().result
                if result == "survived":
                    known = {(file, mutant.original, mutated) for mutated in (mutant.mutated, "*")} & set(reasons)
                    result = "explained" if known else "survived"
                    if not known:
                        print(f"\r{file}:{mutant.line} survived\n  - {mutant.original}\n  + {mutant.mutated}")
                counts[result] += 1
                print(f"\r{counts.total()}/{len(sample)} {_numbers(counts)}", end="", flush=True)
        except KeyboardInterrupt:
            interrupted = True
            workshop.stop()
            pool.shutdown(wait=False, cancel_futures=True)
    print()
    stale = stale_reasons(ROOT, reasons)
    for line in stale:
        print(f"{EXPLAINED.name}: no such line any more: {line}")
    print(f"{counts.total()} mutants: {_numbers(counts)}; {(time.monotonic() - start) / 60:.1f} minutes")
    if interrupted:
        return 130
    return 1 if counts["survived"] or stale else 0


def _numbers(counts: "Counter[str]") -> str:
    return ", ".join(f"{counts[key]} {key}" for key in ("killed", "equivalent", "stillborn", "explained", "survived"))


if __name__ == "__main__":
    sys.exit(main())
