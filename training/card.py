"""The model card, written from detector.json so that its numbers are those of the weights."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

_WEIGHTS = Path(__file__).parents[1] / "src/si3fp/windows/weights"
_NAMES = {
    "upright/window": "upright sets together, window",
    "spb/window": "SPB validation, window",
    "hslu-rectified/window": "HSLU validation, rectified, window",
    "hslu/window": "HSLU validation, as photographed, window",
    "hslu-rectified/balcony": "HSLU validation, rectified, balcony",
    "hslu/balcony": "HSLU validation, as photographed, balcony",
    "cmp/window": "CMP base, not trained or tuned on, window",
}
_TEMPLATE = """# Model card: {name} {version}

Finds windows and balcony fences in orthographic facade pictures at 0.04 m/px.

* **Input** `image` float32 (N, 3, H, W), RGB, 0..255, H and W multiples of 32.
* **Output** `scores` (N, 2, H/4, W/4), window and balcony, 0..1; `distances` (N, 4, H/4, W/4):
  left, top, right, bottom in input pixels from the cell centre (4 (column + 0.5), 4 (row + 0.5)),
  with (0, 0) at the corner of the first pixel. The caller takes 3 x 3 maxima and suppresses
  at IoU 0.5.
* **Thresholds** window {window:.3f}, balcony {balcony:.3f}: the best F1 at IoU 0.5 on the upright
  validation sets (so the F1 below is a little optimistic).
* Plain convolutions, {parameters:.2f} million parameters, ONNX opset {opset}, trained from
  scratch. The export differs from torch by at most {score_error:.1e} in scores and
  {side_error:.1e} px in sides.

## Data and licences

* **building-facade-segmentation**, Lucerne University of Applied Sciences and Arts (HSLU),
  CC BY 4.0: 429 pictures for training, 65 for validation; changed: polygons turned into boxes,
  balcony fences into `balcony`, pictures rectified and scaled.
* **SPB facades**, CC0 1.0: 363 pictures for training, 49 for validation.
* **CMP facade base** (Tylecek and Sara 2013), no licence stated: measured only, never
  trained or tuned on.

The weights are published under Apache-2.0 with the attribution above.

## Metrics

| set | boxes | AP50 | F1 at IoU 0.5 | precision | recall | F1 at IoU 0.75 | mean IoU of hits |
|---|---|---|---|---|---|---|---|
{table}

Each row is at its own best threshold; at the recommended ones the values are a little lower.

**What these numbers are not.** Validation pictures are scaled by the *true* median window height
(to 35 px), which a user's picture gets from its metres per pixel instead; see below for
wrong scales. HSLU rectification uses the annotated polygons. Many HSLU pictures are
taken at night and with strong perspective. SPB leaves some windows unlabelled, so some of its
"false" detections are windows. Validation chose the thresholds and
no setting of the training.
{extra}
## Limits

* Windows much smaller than 8 px (0.3 m) or larger than about 250 px (10 m) are beyond its training;
  glass curtain walls are not "windows" here.
* Shop fronts were ignored in HSLU and are partly labelled in SPB: expect either answer.
* Balconies are few ({balconies} validation boxes) and clearly worse than windows.
* Doors with glass are often taken for windows; shutters may widen a box; windows behind trees are
  missed more often. Roof windows seen at an angle are rare in the data.
* Data from Swiss towns and one Russian city only.

## Intended use

Proposals for the windows of facades in energy models, to be refined and checked by a person.
Not for surveillance, and not for safety decisions.

## Cost of training

{cost}
"""
_COST = (
    "{minutes:.0f} minutes on two cores of an AMD EPYC processor, shared with other work, without\n"
    "a graphics card: {steps} steps of 12 crops of 320 x 320 px. `training/README.md` has the\n"
    "command, `training/log` the curves."
)


def table(metrics: dict[str, dict[str, float]]) -> str:
    """Rows of the metrics table."""
    rows = []
    for key, title in _NAMES.items():
        if key in metrics:
            m = metrics[key]
            names = ("ap50", "f1_50", "precision", "recall", "f1_75", "mean_iou")
            cells = " | ".join(f"{m[name]:.3f}" for name in names)
            rows.append(f"| {title} | {m['n']:.0f} | {cells} |")
    return "\n".join(rows)


def main() -> None:
    """Write MODEL_CARD.md beside detector.json."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--weights", type=Path, default=_WEIGHTS)
    parser.add_argument("--minutes", type=float, required=True)
    parser.add_argument("--steps", type=int, required=True)
    parser.add_argument("--more", type=Path, help="JSON of training.measure for further rows")
    parser.add_argument("--extra", type=Path, help="text to add below the metrics")
    options = parser.parse_args()
    document = json.loads((options.weights / "detector.json").read_text())
    metrics = document["metrics"]
    if options.more:
        metrics = metrics | json.loads(options.more.read_text())
    text = _TEMPLATE.format(
        name=document["name"],
        version=document["version"],
        opset=document["opset"],
        parameters=document["parameters"] / 1e6,
        score_error=document["largest_export_error"]["scores"],
        side_error=document["largest_export_error"]["distances"],
        table=table(metrics),
        balconies=metrics["hslu/balcony"]["n"],
        extra="\n" + options.extra.read_text() if options.extra else "",
        cost=_COST.format(minutes=options.minutes, steps=options.steps),
        **document["score_thresholds"],
    )
    (options.weights / "MODEL_CARD.md").write_text(text)


if __name__ == "__main__":
    main()
