"""The extras of the package: which one brings a module that is not installed."""

# By the names under which they are imported; pyproject.toml has the packages.
MODULES = {
    "calibrate": ("sklearn",),
    "cluster": ("dask", "distributed"),
    "fabricate": ("ezdxf", "fcl", "pypdf", "reportlab", "trimesh"),
    "link": ("mcap", "pymavlink", "serial"),
    "mujoco": ("mujoco",),
    "optimize": ("optuna",),
    "parquet": ("pyarrow",),
}  # fmt: skip


def require(extra: str) -> None:
    """ModuleNotFoundError if a module of the extra is missing, before work is done for it."""
    from importlib.util import find_spec

    for module in MODULES[extra]:
        if find_spec(module) is None:
            raise ModuleNotFoundError(module, name=module)


def missing_extra(error: ModuleNotFoundError) -> str | None:
    """What to install, in a line; None if no extra of foldcar brings the module."""
    missing = (error.name or "").partition(".")[0]
    extra = next((name for name, modules in MODULES.items() if missing in modules), None)
    return extra and f"this needs the package {missing}, of an extra: pip install 'foldcar[{extra}]'"
