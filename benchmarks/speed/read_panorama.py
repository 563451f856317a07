"""Time and peak memory of reading one panorama: ``python benchmarks/speed/read_panorama.py``.

A textured JPEG is written to a temporary folder, then a fresh process imports the package, reads
the header, decodes the image and finds the pixels that it does not show.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np

_READER = """
import resource, sys, time
from pathlib import Path
start = time.perf_counter()
from si3fp.sources.images import image_size, load_panorama, seen_pixels
imported = time.perf_counter()
path, limit = Path(sys.argv[1]), 16384 * 8192
width_px, height_px = image_size(path, limit)
header = time.perf_counter()
image = load_panorama(path, limit)
decoded = time.perf_counter()
loaded_kib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
seen = seen_pixels(image)
done = time.perf_counter()
peak_kib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
print(f"{width_px} x {height_px} px, {path.stat().st_size / 1e6:.0f} MB file, "
      f"{image.nbytes / 1e6:.0f} MB decoded, {seen.mean():.0%} seen")
print(f"import {imported - start:.2f} s, header {header - imported:.3f} s, "
      f"load {decoded - header:.2f} s, seen_pixels {done - decoded:.2f} s")
print(f"peak RSS {loaded_kib / 2**20:.2f} GiB after loading, {peak_kib / 2**20:.2f} GiB in all")
"""


def write_panorama(path: Path, width_px: int) -> None:
    """A textured 2:1 JPEG with a black nadir, written without holding more than one copy."""
    rng = np.random.default_rng(0)
    tile = cv2.GaussianBlur(rng.integers(0, 256, (512, 512, 3), dtype=np.uint8), (0, 0), 1.0)
    image = np.tile(tile, (width_px // 1024, width_px // 512, 1))
    image[-image.shape[0] // 8 :] = 0
    cv2.imwrite(str(path), image, [cv2.IMWRITE_JPEG_QUALITY, 90])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--width-px", type=int, default=16384, help="a multiple of 1024")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "panorama.jpg"
        write_panorama(path, arguments.width_px)
        subprocess.run([sys.executable, "-c", _READER, str(path)], check=True, timeout=120)


if __name__ == "__main__":
    main()
