"""What the refinement of edges does to windows that the detector boxes on real facades.

``python -m benchmarks.accuracy.refinement DATA`` (the folder with ``hslu-facades`` and
``spb-facades``): the rows of `benchmarks.accuracy.detectors` that tell, on the validation pictures
that look like those of a run. The labels are loose by a few per cent.
"""

from __future__ import annotations

import sys
from pathlib import Path

from benchmarks.accuracy.detectors import TITLES, UPRIGHT, measure, pictures_of, shipped
from training.data import read_validation


def main() -> None:
    sets = pictures_of(read_validation(Path(sys.argv[1])))
    print("| set | refined | mean IoU | area error | of the summed area |")
    print("|---|---|---|---|---|")
    for name in UPRIGHT:
        for refined, detector in zip(("no", "yes"), shipped(None), strict=True):
            result = measure(detector, sets[name])
            print(
                f"| {TITLES[name]} | {refined} | {result['mean_iou']:.3f} "
                f"| {result['area_mean']:.3f} | {result['area_bias_hits']:+.3f} |"
            )


if __name__ == "__main__":
    main()
