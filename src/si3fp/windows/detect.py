"""M.1: window detection on one orthographic image, at a fixed metric resolution, in tiles.

An orthographic image knows its scale, so every window comes to the network at the size that it
was trained on, however long the facade is.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import resources
from itertools import pairwise
from pathlib import Path
from typing import Any, Protocol

import cv2
import numpy as np
import onnxruntime
from numpy.typing import NDArray

from si3fp.errors import InputError
from si3fp.geometry.boxes import iou_matrix
from si3fp.geometry.rigid import FloatArray
from si3fp.model import Detections, Image, OrthoImage
from si3fp.windows.interval import WwrErrors

STRIDE_PX = 4
TILE_PX = 1024
OVERLAP_PX = 224
"""6.7 m at 0.03 m per pixel: no wider window is cut by a tile's edge."""
NMS_IOU = 0.5
LOWEST_SCORE = 0.05
LAPLACE_SIGMA = 2.0**0.5
"""Standard deviation of a Laplace distribution of scale 1."""


class WindowDetector(Protocol):
    """Anything that finds windows on an orthographic image of known scale."""

    @property
    def thresholds(self) -> Mapping[str, float]:
        """Recommended score by label where one image stands alone."""
        ...

    @property
    def wwr_errors(self) -> WwrErrors | None:
        """How windows over a whole facade are off; None without a calibration."""
        ...

    def detect(self, image: OrthoImage, m_per_px: float) -> Detections:
        """Boxes in pixels of the image, scores from `LOWEST_SCORE` upwards."""
        ...


class OnnxDetector:
    """An anchor-free network run by ONNX Runtime.

    Input ``image`` (N, 3, H, W) RGB 0..255; outputs ``scores`` (N, L, H/4, W/4), ``distances``
    (N, 4, H/4, W/4) from the cell's centre to left, top, right and bottom in pixels, and, where the
    network knows, ``spreads`` of their shape: the scale of a Laplace distribution of each.
    Scores leave as probabilities, by the calibration that the description gives.

    Parameters
    ----------
    path
        The ONNX file; a JSON of the same name beside it holds sha256, scale, labels, threshold.
        Without a path, the weights that ship with the package.

    Raises
    ------
    InputError
        If a file is missing, is damaged, or does not match its sha256.
    """

    def __init__(self, path: Path | None = None) -> None:
        onnx = path or Path(str(resources.files("si3fp.windows") / "weights" / "detector.onnx"))
        card = onnx.with_suffix(".json")
        try:
            weights, description = onnx.read_bytes(), card.read_bytes()
            described: dict[str, Any] = json.loads(description)
        except (OSError, ValueError) as error:
            raise InputError(
                f"The window detector needs {onnx} and {card.name} beside it: {error}."
            ) from error
        self.sha256 = hashlib.sha256(weights).hexdigest()
        if self.sha256 != described["sha256"]:
            raise InputError(
                f"{onnx} has SHA-256 {self.sha256}, {card.name} says {described['sha256']}: the "
                "file is damaged or was exchanged. Install si3fp again."
            )
        # Another calibration of the same weights finds other windows.
        self.fingerprint = hashlib.sha256(weights + description).hexdigest()
        self.name = f"{described['name']} {described['version']}"
        self.m_per_px = float(described["m_per_px"])
        self.labels: tuple[str, ...] = tuple(described["labels"])
        self._thresholds = {name: float(v) for name, v in described["score_thresholds"].items()}
        self._calibration: dict[str, list[list[float]]] = described.get("calibration", {})
        self._spread_factor = float(described.get("spread_factor", 1.0))
        self._wwr_errors = WwrErrors(**described["wwr"]) if "wwr" in described else None
        options = onnxruntime.SessionOptions()
        options.log_severity_level = 3
        self._session = onnxruntime.InferenceSession(
            weights, options, providers=["CPUExecutionProvider"]
        )
        self._outputs = [output.name for output in self._session.get_outputs()]

    @property
    def thresholds(self) -> Mapping[str, float]:
        """Recommended score by label where one image stands alone."""
        return self._thresholds

    @property
    def wwr_errors(self) -> WwrErrors | None:
        """How windows over a whole facade are off; None without a calibration."""
        return self._wwr_errors

    def detect(self, image: OrthoImage, m_per_px: float) -> Detections:
        """Boxes in pixels of the image, scores from `LOWEST_SCORE` upwards, labels.

        Parameters
        ----------
        image
            Orthographic image; pixels that are not valid are black to the network.
        m_per_px
            Its resolution.
        """
        scale = m_per_px / self.m_per_px
        pixels = _resized(np.where(image.valid[..., None], image.rgb, np.uint8(0)), scale)
        found = [self._detect_tile(pixels, *tile) for tile in _tiles(*pixels.shape[:2])]
        height, width = image.valid.shape
        # The scaled image has whole pixels, so its scale is not exactly the one that was asked.
        per_pixel = np.array([width / pixels.shape[1], height / pixels.shape[0]] * 2)
        boxes = np.concatenate([part.boxes_px for part in found]) * per_pixel
        detections = Detections(
            np.clip(boxes, 0, [width, height, width, height]),
            np.concatenate([part.scores for part in found]),
            np.concatenate([part.labels for part in found]),
            np.concatenate([part.edge_sigma_px for part in found]) * per_pixel,
        )
        detections = detections.select(np.argsort(-detections.scores, kind="stable"))
        return detections.select(_not_suppressed(detections))

    def _detect_tile(self, pixels: Image, rows: _Span, columns: _Span) -> Detections:
        """What is centred in the tile's core, in pixels of the scaled image."""
        tile = pixels[rows.start : rows.stop, columns.start : columns.stop]
        bottom, right = -tile.shape[0] % 32, -tile.shape[1] % 32
        tile = np.pad(tile, ((0, bottom), (0, right), (0, 0)))
        batch = np.ascontiguousarray(tile.transpose(2, 0, 1)[None], dtype=np.float32)
        maps = dict(zip(self._outputs, self._session.run(None, {"image": batch}), strict=True))
        spreads = maps["spreads"][0] * self._spread_factor if "spreads" in maps else None
        found = decode(maps["scores"][0], maps["distances"][0], spreads, self.labels)
        scores = found.scores.copy()
        for label, (raw, probability) in self._calibration.items():
            mine = found.labels == label
            scores[mine] = np.interp(scores[mine], raw, probability)
        corner = np.array([columns.start, rows.start, columns.start, rows.start])
        x, y = (found.boxes_px + corner).reshape(-1, 2, 2).mean(axis=1).T
        moved = replace(found, boxes_px=found.boxes_px + corner, scores=scores)
        return moved.select(columns.owns(x) & rows.owns(y))


@dataclass(frozen=True, slots=True)
class _Span:
    """Start and stop of a tile along one axis, and its core: what no other tile owns."""

    start: int
    stop: int
    low: float
    high: float

    def owns(self, centres: FloatArray) -> NDArray[np.bool_]:
        inside: NDArray[np.bool_] = (centres >= self.low) & (centres < self.high)
        return inside


def _spans(length: int) -> list[_Span]:
    """Tiles of equal size, as few as possible, that overlap by `OVERLAP_PX` or a little more."""
    count = max(1, -(-(length - OVERLAP_PX) // (TILE_PX - OVERLAP_PX)))
    size = -(-(length + (count - 1) * OVERLAP_PX) // count)
    size = min(length, size + -size % 32)
    starts = [round(i * (length - size) / max(count - 1, 1)) for i in range(count)]
    middles = [(after + before + size) / 2 for before, after in pairwise(starts)]
    edges = [-np.inf, *middles, np.inf]
    return [
        _Span(start, start + size, low, high)
        for start, (low, high) in zip(starts, pairwise(edges), strict=True)
    ]


def _tiles(height: int, width: int) -> Iterator[tuple[_Span, _Span]]:
    return ((rows, columns) for rows in _spans(height) for columns in _spans(width))


def _resized(rgb: Image, scale: float) -> Image:
    size = (max(1, round(rgb.shape[1] * scale)), max(1, round(rgb.shape[0] * scale)))
    how = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(rgb, size, interpolation=how), np.uint8)


def decode(
    scores: NDArray[np.float32],
    distances: NDArray[np.float32],
    spreads: NDArray[np.float32] | None,
    labels: Sequence[str],
) -> Detections:
    """The local maxima of the score maps as boxes in pixels.

    Parameters
    ----------
    scores
        (L, h, w) per label.
    distances
        (4, h, w) from the cell's centre to left, top, right, bottom in pixels.
    spreads
        (4, h, w) scales of Laplace distributions of the distances, or None.
    labels
        Names of the L labels.
    """
    rows, columns, kinds = [], [], []
    for kind, score in enumerate(scores):
        peak = score >= cv2.dilate(score, np.ones((3, 3), np.uint8))
        at = np.nonzero(peak & (score >= LOWEST_SCORE))
        rows.append(at[0])
        columns.append(at[1])
        kinds.append(np.full(len(at[0]), kind))
    row, column, kind_of = (np.concatenate(part) for part in (rows, columns, kinds))
    x, y = (column + 0.5) * STRIDE_PX, (row + 0.5) * STRIDE_PX
    left, top, right, bottom = distances[:, row, column].astype(np.float64)
    boxes = np.stack([x - left, y - top, x + right, y + bottom], axis=-1)
    sigma = np.zeros_like(boxes)
    if spreads is not None:
        sigma = LAPLACE_SIGMA * spreads[:, row, column].T.astype(np.float64)
    values = scores[kind_of, row, column].astype(np.float64)
    return Detections(boxes, values, np.array(labels, np.str_)[kind_of], sigma)


def _not_suppressed(detections: Detections) -> NDArray[np.int_]:
    """Indices that survive non-maximum suppression within each label; scores are descending."""
    overlap = iou_matrix(detections.boxes_px, detections.boxes_px)
    same = detections.labels[:, None] == detections.labels[None]
    clash = (overlap > NMS_IOU) & same
    kept: list[int] = []
    for index in range(len(detections)):
        if not clash[index, kept].any():
            kept.append(index)
    return np.array(kept, dtype=np.int_)
