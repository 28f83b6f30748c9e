"""foldcar: which folding cars to build. Design, simulate, sweep, store, report."""

__version__ = "0.1.0"
