"""A rendered street that ships with the package, and a run on it against its truth."""

from si3fp.demo.run import run_demo

__all__ = ["run_demo"]
