"""Peak memory of `si3fp street` on panoramas of 16384 x 8192 pixels, in a process of its own.

``python -m benchmarks.speed.large_panorama``: the tiny street of the tests, its panoramas enlarged
to the largest size that Street View serves.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import cv2
from tests.scenes import make_street, write_street

WIDTH_PX, HEIGHT_PX = 16384, 8192


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        street = Path(name) / "street"
        write_street(make_street(5, "tiny"), street)
        for image in sorted((street / "panoramas").glob("*.jpg")):
            large = cv2.resize(cv2.imread(str(image)), (WIDTH_PX, HEIGHT_PX))
            cv2.imwrite(str(image), large, [cv2.IMWRITE_JPEG_QUALITY, 85])
        command = [
            sys.executable, "-m", "si3fp.cli", "street", street / "panoramas.geojson",
            "--footprints", street / "footprints.geojson", "-o", Path(name) / "RUN",
        ]  # fmt: skip
        start = time.monotonic()
        subprocess.run(command, check=True)
        seconds = time.monotonic() - start
    peak_gib = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 2**20
    print(f"3 panoramas of {WIDTH_PX} x {HEIGHT_PX}: {seconds:.1f} s, peak {peak_gib:.2f} GiB")


if __name__ == "__main__":
    main()
