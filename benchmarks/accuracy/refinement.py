"""What the refinement of edges does to windows that the detector boxes on real facades.

``python -m benchmarks.accuracy.refinement DATA`` (extra ``train``; the folder with ``hslu-facades``
and ``spb-facades``): mean IoU, mean absolute and mean signed area error of the windows that the
detector finds on the validation pictures, rectified and scaled to 0.02 m per pixel by their median
window, before and after the refinement. The labels are loose by a few per cent.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from training.data import WINDOW, read_validation
from training.measure import views

from si3fp.config import MeasureConfig
from si3fp.geometry.boxes import iou_matrix
from si3fp.model import OrthoImage
from si3fp.windows.detect import OnnxDetector
from si3fp.windows.fuse import FusedDetections
from si3fp.windows.refine import refine_boxes

M_PER_PX = 0.02
SETS = ("hslu-rectified", "spb")


def main() -> None:
    detector = OnnxDetector()
    rows: dict[tuple[str, bool], list[tuple[float, float, float]]] = {}
    for facade in read_validation(Path(sys.argv[1])):
        for name, sample in views(facade, 2.0):
            if name not in SETS:
                continue
            rgb = np.ascontiguousarray(sample.image)
            image = OrthoImage("fused", rgb, rgb.max(axis=2) > 0)
            found = detector.detect(image, M_PER_PX)
            sure = found.scores >= detector.thresholds["window"]
            found = found.select(sure & (found.labels == "window"))
            true = sample.boxes[sample.labels == WINDOW]
            if not len(found) or not len(true):
                continue
            fused = FusedDetections(found, ((),) * len(found))
            refined = refine_boxes(fused, image, M_PER_PX, MeasureConfig()).detections
            overlap = iou_matrix(found.boxes_px, true)
            for i in np.flatnonzero(overlap.max(axis=1) > 0.5):
                truth = true[overlap[i].argmax()]
                for is_refined, boxes in ((False, found.boxes_px), (True, refined.boxes_px)):
                    iou = float(iou_matrix(boxes[i : i + 1], truth[None])[0, 0])
                    area = np.prod(boxes[i, 2:] - boxes[i, :2])
                    error = float(area / np.prod(truth[2:] - truth[:2]) - 1)
                    rows.setdefault((name, is_refined), []).append((iou, abs(error), error))
    print("| set | windows | refined | mean IoU | area error | signed area error |")
    print("|---|---|---|---|---|---|")
    for (name, is_refined), values in sorted(rows.items()):
        iou, absolute, signed = np.mean(values, axis=0)
        print(
            f"| {name} | {len(values)} | {'yes' if is_refined else 'no'} "
            f"| {iou:.3f} | {absolute:.3f} | {signed:+.3f} |"
        )


if __name__ == "__main__":
    main()
