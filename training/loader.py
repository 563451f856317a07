"""Endless stream of augmented, encoded batches."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import torch
from torch.utils.data import DataLoader, IterableDataset

from training.augment import Sample, random_crop
from training.data import Facade
from training.photometric import photometric
from training.targets import encode

_SPB_NEGATIVE = 0.4
_LAYOUTS = {(1, 1): 0.45, (1, 2): 0.3, (2, 1): 0.15, (2, 2): 0.1}


class Crops(IterableDataset):
    """Crops of (3, size, size) uint8 with their targets (see ``targets.encode``).

    A crop is whole, or made of two or four parts of different pictures. ``active`` (2, h, w) is 0
    for classes not labelled there, ``negative`` (h, w) below 1 where windows may be unlabelled.
    """

    def __init__(self, facades: list[Facade], size: int, seed: int) -> None:
        self.facades, self.size, self.seed = facades, size, seed

    def __iter__(self) -> Iterator[dict[str, torch.Tensor]]:
        info = torch.utils.data.get_worker_info()
        if info is not None:
            torch.set_num_threads(1)
        rng = np.random.default_rng([self.seed, info.id if info else 0])
        while True:
            yield self.draw(rng)

    def draw(self, rng: np.random.Generator) -> dict[str, torch.Tensor]:
        """One crop and its targets."""
        size = self.size
        layout = list(_LAYOUTS)[rng.choice(len(_LAYOUTS), p=list(_LAYOUTS.values()))]
        columns, rows = layout
        part = size // columns, size // rows
        image = np.zeros((size, size, 3), np.uint8)
        active = np.ones((2, size // 4, size // 4), np.float32)
        negative = np.ones((size // 4, size // 4), np.float32)
        boxes, labels = [], []
        for row in range(rows):
            for column in range(columns):
                facade = self.facades[rng.integers(len(self.facades))]
                crop = photometric(random_crop(facade, part, rng), rng)
                x, y = column * part[0], row * part[1]
                image[y : y + part[1], x : x + part[0]] = crop.image
                boxes.append(crop.boxes + np.array([x, y, x, y]))
                labels.append(crop.labels)
                cells = np.s_[y // 4 : (y + part[1]) // 4, x // 4 : (x + part[0]) // 4]
                for k in (0, 1):
                    active[k][cells] = float(k in facade.classes)
                if facade.source == "spb-facades":
                    negative[cells] = _SPB_NEGATIVE
        sample = Sample(image, np.concatenate(boxes), np.concatenate(labels))
        targets = encode(sample.boxes, sample.labels, (size, size))
        targets |= {"active": active, "negative": negative}
        tensors = {name: torch.from_numpy(value) for name, value in targets.items()}
        tensors["image"] = torch.from_numpy(image.transpose(2, 0, 1).copy())
        return tensors


def batches(facades: list[Facade], size: int, batch: int, seed: int) -> DataLoader:
    """Batches from one worker process."""
    return DataLoader(Crops(facades, size, seed), batch, num_workers=1, prefetch_factor=8)
