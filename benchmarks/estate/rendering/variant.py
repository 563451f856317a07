"""Mitsuba with a variant that works here."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from si3fp.errors import InputError, MissingDependencyError

VARIANTS = ("cuda_ad_rgb", "llvm_ad_rgb")
LLVM_NAMES = (
    "libLLVM*.so.1[6-9]*",
    "libLLVM*.so.[2-9][0-9]*",
    "libLLVM-1[6-9].so*",
    "libLLVM-[2-9][0-9].so*",
)
LLVM_FOLDERS = (
    "/usr/lib/*-linux-gnu",
    "/usr/lib/llvm-*/lib",
    "/usr/lib64",
    "/usr/lib64/llvm*/lib*",
    "/usr/lib",
    "/usr/local/lib",
)
MAC_LLVM = ("/opt/homebrew/opt/llvm*/lib/libLLVM.dylib", "/usr/local/opt/llvm*/lib/libLLVM.dylib")


def llvm_library() -> Path | None:
    """The newest LLVM in the usual places, 16 or later: Dr.Jit crashes with 14 and 15."""
    found = [
        path
        for folder in LLVM_FOLDERS
        for name in LLVM_NAMES
        for path in Path("/").glob(f"{folder}/{name}".lstrip("/"))
    ]
    found += [path for pattern in MAC_LLVM for path in Path("/").glob(pattern.lstrip("/"))]
    return max(found, key=lambda path: [int(n) for n in _numbers(path.name)], default=None)


def mitsuba(variant: str | None = None) -> Any:
    """The module ``mitsuba`` with ``variant`` set, or the first that works: CUDA, then LLVM.

    One that is set already is kept. ``DRJIT_LIBLLVM_PATH`` names the LLVM to use; without it the
    usual places are searched.
    """
    try:
        import mitsuba as mi  # noqa: PLC0415
    except ImportError as error:
        raise MissingDependencyError(
            "The renderer needs mitsuba; install it with: pip install 'si3fp[estate]'"
        ) from error
    if variant not in (None, *VARIANTS):
        raise InputError(f"The renderer has the variants {VARIANTS}, got {variant!r}.")
    if mi.variant() in (VARIANTS if variant is None else (variant,)):
        return mi
    if not os.environ.get("DRJIT_LIBLLVM_PATH") and (library := llvm_library()):
        os.environ["DRJIT_LIBLLVM_PATH"] = str(library)
    for name in (variant,) if variant else VARIANTS:
        try:
            mi.set_variant(name)
            if len(mi.Float(mi.UInt32([1, 2])) + 1) == 2:
                return mi
        except (ImportError, RuntimeError, AttributeError):
            continue
    raise MissingDependencyError(
        "The renderer found neither a CUDA device nor LLVM 16 or later. On Debian and Ubuntu: "
        "apt-get install libllvm19; elsewhere let DRJIT_LIBLLVM_PATH name libLLVM's file."
    )


def _numbers(name: str) -> list[str]:
    """The numbers in a file's name."""
    return "".join(letter if letter.isdigit() else " " for letter in name).split()
