"""Renderer noise taken out of a picture by Intel Open Image Denoise; textures stay sharp.

What is denoised is the light, not the picture: radiance divided by albedo. The albedo costs little,
is nearly free of noise and is multiplied back, so that bricks and joints never go through the
network (demodulation, as in Schied et al., 2017).

Áfra, A. T. (2019). Intel Open Image Denoise, https://www.openimagedenoise.org
Schied, C. et al. (2017). Spatiotemporal variance-guided filtering. High-Performance Graphics.
"""

from __future__ import annotations

import ctypes
import functools
import importlib.util
import sys
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from si3fp.errors import MissingDependencyError

TILE_PX = 1536
OVERLAP_PX = 96  # the network looks about this far
FLOAT3 = 3
LIBRARIES = {  # in the order in which they are loaded
    "linux": ("lib.linux.x64/libtbb.so.12*", "lib.linux.x64/libOpenImageDenoise.so*"),
    "darwin": ("lib.macos.aarch64/libOpenImageDenoise*.dylib",),
    "win32": ("lib.win.x64/tbb12.dll", "lib.win.x64/OpenImageDenoise.dll"),
}


@functools.cache
def _library() -> ctypes.CDLL | None:
    """The denoiser's library from the package ``oidn``, or None."""
    spec = importlib.util.find_spec("oidn")
    if spec is None or spec.origin is None or sys.platform not in LIBRARIES:
        return None
    folder = Path(spec.origin).parent
    try:
        for name in LIBRARIES[sys.platform]:
            library = ctypes.CDLL(str(sorted(folder.glob(name))[0]), ctypes.RTLD_GLOBAL)
    except (IndexError, OSError):
        return None
    pointer, text, size = ctypes.c_void_p, ctypes.c_char_p, ctypes.c_size_t
    for name, result, arguments in (
        ("oidnNewDevice", pointer, [ctypes.c_int]),
        ("oidnCommitDevice", None, [pointer]),
        ("oidnGetDeviceError", ctypes.c_int, [pointer, ctypes.POINTER(text)]),
        ("oidnReleaseDevice", None, [pointer]),
        ("oidnNewFilter", pointer, [pointer, text]),
        ("oidnSetFilter1b", None, [pointer, text, ctypes.c_bool]),
        (
            "oidnSetSharedFilterImage",
            None,
            [pointer, text, pointer, ctypes.c_int, *[size] * 5],
        ),
        ("oidnCommitFilter", None, [pointer]),
        ("oidnExecuteFilter", None, [pointer]),
        ("oidnReleaseFilter", None, [pointer]),
    ):
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    return library


def available() -> bool:
    """Whether the denoiser can be used here (extra ``estate``, where its package has a wheel)."""
    return _library() is not None


def denoised(
    light: NDArray[np.float32],
    normal: NDArray[np.float32],
    seen: NDArray[np.bool_],
    albedo: NDArray[np.float32] | None = None,
) -> NDArray[np.float32]:
    """Light (H, W, 3) without the renderer's noise, 0 where not ``seen`` (H, W).

    ``normal`` (H, W, 3) is that of the first surface, and so is ``albedo``, a guide where the light
    was not divided by it. Only tiles with something seen are worked on.
    """
    library = _library()
    if library is None:
        raise MissingDependencyError(
            "The denoiser needs the package oidn; install it with: pip install 'si3fp[estate]'"
        )
    result = np.zeros_like(light)
    rows, columns = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
    if not len(rows):
        return result
    device = library.oidnNewDevice(0)
    library.oidnCommitDevice(device)
    try:
        for top, left in product(
            range(rows[0], rows[-1] + 1, TILE_PX), range(columns[0], columns[-1] + 1, TILE_PX)
        ):
            bottom, right = min(top + TILE_PX, rows[-1] + 1), min(left + TILE_PX, columns[-1] + 1)
            wanted = seen[top:bottom, left:right]
            if not wanted.any():
                continue
            y0, x0 = max(top - OVERLAP_PX, 0), max(left - OVERLAP_PX, 0)
            tile = np.s_[y0 : bottom + OVERLAP_PX, x0 : right + OVERLAP_PX]
            guide = np.ones_like(light[tile]) if albedo is None else albedo[tile]
            clean = _filtered(library, device, light[tile], normal[tile], guide)
            clean = clean[top - y0 : bottom - y0, left - x0 : right - x0]
            result[top:bottom, left:right] = clean * wanted[..., None]
    finally:
        library.oidnReleaseDevice(device)
    return result


def _filtered(
    library: Any,
    device: int,
    light: NDArray[np.float32],
    normal: NDArray[np.float32],
    albedo: NDArray[np.float32],
) -> NDArray[np.float32]:
    """One tile through the network, which takes normals only beside an albedo."""
    images = {
        name: np.ascontiguousarray(image, np.float32)
        for name, image in (
            ("color", light),
            ("albedo", albedo),
            ("normal", normal),
            ("output", np.zeros_like(light)),
        )
    }
    task = library.oidnNewFilter(device, b"RT")
    try:
        for name, image in images.items():
            height, width = image.shape[:2]
            library.oidnSetSharedFilterImage(
                task, name.encode(), image.ctypes.data, FLOAT3, width, height, 0, 0, 0
            )
        library.oidnSetFilter1b(task, b"hdr", True)
        library.oidnCommitFilter(task)
        library.oidnExecuteFilter(task)
        message = ctypes.c_char_p()
        if library.oidnGetDeviceError(device, ctypes.byref(message)):
            raise RuntimeError(f"Open Image Denoise failed: {message.value!r}")
    finally:
        library.oidnReleaseFilter(task)
    return images["output"]
