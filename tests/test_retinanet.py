"""The paper's detector: names and shapes of the published weights, anchors, losses, recipe."""

import hashlib
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("torch", reason="training needs the extra `train`")

import torch
from training import paper
from training.anchors import (
    BACKGROUND,
    NEITHER,
    PER_CELL,
    anchors,
    decode,
    detections,
    encode,
    grids,
    match,
)
from training.augment import Sample
from training.data import M_PER_PX, Facade
from training.paper import batch_of, box_loss, focal_loss, rate
from training.recipes import CPU, PAPER, jittered, training_sample
from training.retinanet import FrozenBatchNorm, RetinaNet, export_onnx, load_published
from training.targets import iou

from si3fp.errors import InputError

Narrow = partial(RetinaNet, width=8, channels=32, blocks=(1, 1, 1, 1))


def published_shapes(labels: int) -> dict[str, tuple[int, ...]]:
    """Names and shapes in the published file (of 2020), by the rules of ResNet-50 and RetinaNet."""
    shapes: dict[str, tuple[int, ...]] = {}

    def norm(name: str, channels: int) -> None:
        for part in ("weight", "bias", "running_mean", "running_var"):
            shapes[f"backbone.body.{name}.{part}"] = (channels,)

    def biased(name: str, outputs: int, inputs: int, kernel: int) -> None:
        shapes[f"{name}.weight"] = (outputs, inputs, kernel, kernel)
        shapes[f"{name}.bias"] = (outputs,)

    shapes["backbone.body.conv1.weight"] = (64, 3, 7, 7)
    norm("bn1", 64)
    inputs = 64
    for layer, (units, width) in enumerate([(3, 64), (4, 128), (6, 256), (3, 512)], start=1):
        for unit in range(units):
            name = f"layer{layer}.{unit}"
            for conv, shape in (
                ("conv1", (width, inputs, 1, 1)),
                ("conv2", (width, width, 3, 3)),
                ("conv3", (4 * width, width, 1, 1)),
            ):
                shapes[f"backbone.body.{name}.{conv}.weight"] = shape
                norm(f"{name}.bn{conv[-1]}", shape[0])
            if unit == 0:
                down = f"{name}.downsample"
                shapes[f"backbone.body.{down}.0.weight"] = (4 * width, inputs, 1, 1)
                norm(f"{down}.1", 4 * width)
            inputs = 4 * width
    for level, width in enumerate((512, 1024, 2048)):
        biased(f"backbone.fpn.inner_blocks.{level}", 256, width, 1)
        biased(f"backbone.fpn.layer_blocks.{level}", 256, 256, 3)
    for name in ("p6", "p7"):
        biased(f"backbone.fpn.extra_blocks.{name}", 256, 256, 3)
    for head, last, outputs in (
        ("classification", "cls_logits", 9 * labels),
        ("regression", "bbox_reg", 9 * 4),
    ):
        for conv in (0, 2, 4, 6):
            biased(f"head.{head}_head.conv.{conv}", 256, 256, 3)
        biased(f"head.{head}_head.{last}", outputs, 256, 3)
    return shapes


def todays_name(name: str) -> str:
    """The name in a state dict of today's torchvision."""
    parts = name.split(".")
    if parts[0] == "head" and parts[2] == "conv":
        parts[3:4] = [str(int(parts[3]) // 2), "0"]
    if parts[2].endswith("_blocks") and parts[2] != "extra_blocks":
        parts.insert(4, "0")
    return ".".join(parts)


def write_checkpoint(path: Path, shapes: dict[str, tuple[int, ...]]) -> str:
    """A file with a different number in each tensor; its SHA-256."""
    values = {
        name: torch.tensor((k + 1) / 1024).expand(shape)
        for k, (name, shape) in enumerate(shapes.items())
    }
    torch.save(values, path)
    return hashlib.sha256(path.read_bytes()).hexdigest()


def test_names_and_shapes_are_the_published_ones() -> None:
    with torch.device("meta"):
        model = RetinaNet(91)
    got = {name: tuple(value.shape) for name, value in model.state_dict().items()}
    assert got == {todays_name(name): shape for name, shape in published_shapes(91).items()}
    assert sum(p.numel() for p in model.parameters()) == 34_014_999  # as torchvision states


@pytest.mark.parametrize(("labels", "today"), [(3, False), (1, False), (1, True)])
def test_published_weights_load(tmp_path: Path, labels: int, today: bool) -> None:
    shapes = published_shapes(3)
    if today:
        shapes = {todays_name(name): shape for name, shape in shapes.items()}
    digest = write_checkpoint(tmp_path / "published.pth", shapes)
    with torch.device("meta"):
        model = RetinaNet(labels)
    model.to_empty(device="cpu")  # random weights would take a second
    for parameter in model.head["classification_head"].cls_logits.parameters():
        torch.nn.init.constant_(parameter, -7.0)
    load_published(model, tmp_path / "published.pth", digest[:8])
    after = model.state_dict()
    for k, name in enumerate(shapes):
        own = name if today else todays_name(name)
        if "cls_logits" in name and labels != 3:
            assert torch.all(after[own] == -7)
        else:
            assert torch.all(after[own] == (k + 1) / 1024)
    learning = {name.split(".")[2] for name, p in model.named_parameters() if p.requires_grad}
    assert not {"conv1", "layer1"} & learning and {"layer2", "layer4"} < learning


def test_other_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "published.pth"
    model = Narrow(1)
    with pytest.raises(InputError, match="Cannot read"):
        load_published(model, path)
    digest = write_checkpoint(path, {"backbone.body.conv1.weight": (64, 3, 7, 7)})
    with pytest.raises(InputError, match="does not begin with eeacb38b"):
        load_published(model, path)
    with pytest.raises(InputError, match="does not fit"):
        load_published(model, path, digest)
    with pytest.raises(InputError, match="frozen"):
        load_published(Narrow(1, norm="batch"), path, digest)


def test_frozen_normalisation_is_the_formula() -> None:
    norm = FrozenBatchNorm(2)
    for name, value in (("weight", 3.0), ("bias", 1.0), ("running_mean", 5.0)):
        getattr(norm, name).fill_(value)
    norm.running_var.copy_(torch.tensor([4.0, 16.0]))
    out = norm(torch.full((1, 2, 1, 1), 9.0)).ravel()
    assert out.tolist() == pytest.approx([3 * 4 / 2 + 1, 3 * 4 / 4 + 1])
    assert not list(norm.parameters())


def test_anchors_have_the_known_places() -> None:
    places = anchors((96, 64))
    assert grids((96, 64)) == [(12, 8), (6, 4), (3, 2), (2, 1), (1, 1)]
    assert len(places) == 9 * (96 + 24 + 6 + 2 + 1)
    first = [[-23, -11], [-28, -14], [-35, -18], [-16, -16], [-20, -20], [-25, -25]]
    assert places[:6, :2].tolist() == first and np.allclose(places[:9, 2:], -places[:9, :2])
    assert places[9 + 3].tolist() == [8 - 16, -16, 8 + 16, 16]  # next column
    assert places[12 * 9 + 3].tolist() == [-16, 8 - 16, 16, 8 + 16]  # next row
    second = places[96 * 9 :]
    assert second[9 + 3].tolist() == [16 - 32, -32, 16 + 32, 32]
    assert places[-6].tolist() == [-256, -256, 256, 256]


def test_matching_by_hand() -> None:
    places = np.array(
        [
            [0, 0, 10, 10],  # the box itself
            [0, 0, 10, 20],  # IoU 0.5
            [0, 0, 10, 22],  # IoU 0.45
            [0, 0, 10, 26],  # IoU 0.38
            [50, 0, 60, 10],  # the best for the second box, IoU 0.25
            [80, 0, 90, 10],  # 60 % in the ignored area
            [84, 0, 94, 10],  # 20 % in it
        ],
        np.float32,
    )
    boxes = np.array([[0, 0, 10, 10], [50, 0, 55, 5], [70, 0, 86, 10]], float)
    kinds, deltas = match(boxes, np.array([2, 1, -1]), places)
    assert kinds.tolist() == [2, 2, NEITHER, BACKGROUND, 1, NEITHER, BACKGROUND]
    assert deltas[0].tolist() == [0, 0, 0, 0]
    assert deltas[1] == pytest.approx([0, -0.25, 0, np.log(0.5)])
    assert deltas[4] == pytest.approx([-0.25, -0.25, np.log(0.5), np.log(0.5)])
    empty, _ = match(np.zeros((0, 4)), np.zeros(0, int), places)
    assert np.all(empty == BACKGROUND)


PLACE, SIDE = st.floats(-200, 1500), st.floats(10, 600)


@given(st.tuples(PLACE, PLACE, SIDE, SIDE), st.tuples(PLACE, PLACE, SIDE, SIDE))
def test_decode_undoes_encode(one: tuple[float, ...], other: tuple[float, ...]) -> None:
    box, place = (np.array([[x, y, x + w, y + h]]) for x, y, w, h in (one, other))
    assert decode(encode(box, place), place) == pytest.approx(box, abs=1e-6)


def test_losses_by_hand() -> None:
    kinds = torch.tensor([[0, BACKGROUND, NEITHER], [BACKGROUND, BACKGROUND, NEITHER]])
    half = float(np.log(2)) / 4  # at a logit of 0: (1 - 0.5)^2 log 2
    focal = focal_loss(torch.zeros(2, 3, 1), kinds)
    assert float(focal) == pytest.approx(((0.25 + 0.75) * half + 2 * 0.75 * half) / 2)
    sure = focal_loss(torch.tensor([[[np.log(9.0)]]]), torch.tensor([[0]]))
    assert float(sure) == pytest.approx(0.25 * 0.1**2 * np.log(10 / 9), rel=1e-5)
    wanted = torch.zeros(2, 3, 4)
    deltas = torch.tensor([0.5, -1.0, 0.0, 2.0]).expand(2, 3, 4)
    assert float(box_loss(deltas, wanted, kinds)) == pytest.approx(3.5 / 2)


def test_detections_are_the_best_of_each_object() -> None:
    size = (96, 64)
    places = anchors(size)
    logits, deltas = np.full((len(places), 2), -9.0), np.zeros((len(places), 4))
    middle = ((places[:, :2] + places[:, 2:]) / 2 == [48, 32]).all(axis=1)
    square = (places[:, 2:] - places[:, :2] == 32).all(axis=1)
    (at,) = np.flatnonzero(middle & square)
    logits[at] = 2.0, -1.0
    logits[at + 1, 0] = 1.0  # the next octave of the same place, IoU 0.64: suppressed
    logits[at - 1, 0] = -4.0  # score 0.018: too low
    deltas[at] = 0.5, 0.0, np.log(2.0), 0.0
    deltas[at + 1] = encode(decode(deltas[[at]], places[[at]]), places[[at + 1]])[0]
    boxes, scores, labels = detections(logits, deltas, size, (80, 64))
    assert labels.tolist() == [0, 1] and scores == pytest.approx([0.8808, 0.2689], abs=1e-4)
    assert boxes[0] == pytest.approx([32, 16, 80, 48])  # 96 clipped to the picture's 80
    assert len(detections(logits - 20, deltas, size, size)[0]) == 0


def test_the_papers_numbers() -> None:
    assert (PAPER.iterations, PAPER.learning_rate) == (64_000, 0.0005)
    assert (PAPER.shortest_px, PAPER.longest_px) == ((800, 1600), 1440)
    assert (PAPER.inference_shortest_px, PAPER.inference_longest_px) == (1024, 1333)
    assert PAPER.published_weights and PAPER.crop_px is None
    assert rate(PAPER, 999, 0.5) == rate(PAPER, 63_999, 1.0) == 0.0005
    assert rate(CPU, 500, 0.0) == CPU.learning_rate and rate(CPU, 500, 1.0) == 0


def made_facade() -> Facade:
    """Windows of 24 x 35 px, white on a dark wall, 240 x 180 px; one label is a balcony."""
    picture = np.full((180, 240, 3), 40, np.uint8)
    polygons = []
    for x in range(20, 200, 60):
        for y in (20, 100):
            picture[y : y + 35, x : x + 24] = 230
            polygons.append(np.array([[x, y], [x + 24, y], [x + 24, y + 35], [x, y + 35]], float))
    return Facade("made", "made", [picture], polygons, np.array([0, 0, 0, 0, 0, 1]), (0, 1))


def test_pictures_of_the_recipes() -> None:
    rng = np.random.default_rng(0)
    for _ in range(5):
        sample = training_sample(made_facade(), PAPER, rng)
        height, width = sample.image.shape[:2]
        assert (
            800 <= height <= 1080 and width <= 1440 and width / height == pytest.approx(4 / 3, 1e-2)
        )
        assert len(sample.boxes) == 5
        scale = width / 240
        assert sample.boxes[0] == pytest.approx(np.array([20, 20, 44, 55]) * scale, abs=2)
        assert training_sample(made_facade(), CPU, rng).image.shape == (256, 256, 3)
    grey = np.full((4, 4, 3), 100, np.uint8)
    assert 64 <= jittered(grey, 0.2, rng).mean() <= 144 and np.array_equal(
        jittered(grey, 0, rng), grey
    )


def made_samples() -> list[Sample]:
    """Two pictures of 128 x 96 px with two bright windows each on noise, and an ignored one."""
    rng = np.random.default_rng(0)
    samples = []
    for k in range(2):
        image = rng.integers(30, 60, (96, 128, 3)).astype(np.uint8)
        boxes = np.array(
            [[6 + 4 * k, 8, 40, 52], [70, 30 - 4 * k, 112, 86], [50, 0, 60, 10]], float
        )
        for left, top, right, bottom in boxes.astype(int):
            image[top:bottom, left:right] = 220
        samples.append(Sample(image, boxes, np.array([0, 0, -1])))
    return samples


@pytest.fixture
def narrow_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> paper.Run:
    monkeypatch.setattr(paper, "RetinaNet", Narrow)
    torch.manual_seed(0)
    torch.set_num_threads(1)
    recipe = replace(CPU, learning_rate=0.02, warm_up_iterations=10)
    return paper.Run(recipe, tmp_path, None, resume=True)


def test_learns_a_handful_of_pictures(narrow_run: paper.Run) -> None:
    samples = made_samples()
    batch = batch_of(samples)
    for step in range(150):
        narrow_run.advance(batch, step / 150)
    narrow_run.save()
    model = paper.load_trained(narrow_run.out / "weights.pt", narrow_run.recipe)
    for sample, half in zip(samples, (1, 2), strict=True):
        image = np.kron(sample.image, np.ones((half, half, 1), np.uint8))  # twice the pixels
        boxes, scores, labels = paper.detect(model, image, M_PER_PX / half, narrow_run.recipe)
        found = boxes[(scores > 0.9) & (labels == 0)]
        assert len(found) == 2
        assert iou(half * sample.boxes[:2], found).max(axis=1).min() > 0.9


def test_a_killed_run_goes_on(narrow_run: paper.Run) -> None:
    batch = batch_of(made_samples())
    narrow_run.advance(batch, 0.0)
    narrow_run.elapsed_s = 7.0
    narrow_run.save()
    again = paper.Run(narrow_run.recipe, narrow_run.out, None, resume=True)
    assert (again.iteration, again.elapsed_s) == (1, 7.0)
    narrow_run.advance(batch, 0.1), again.advance(batch, 0.1)
    for a, b in zip(narrow_run.model.parameters(), again.model.parameters(), strict=True):
        assert torch.equal(a, b)


def test_the_paper_starts_from_published_weights(tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match="--published"):
        paper.Run(PAPER, tmp_path, None, resume=False)


def test_export_matches_torch(tmp_path: Path) -> None:
    pytest.importorskip("onnx", reason="export needs onnx")
    runtime = pytest.importorskip("onnxruntime")
    torch.manual_seed(0)
    for norm in ("frozen", "batch"):
        model = Narrow(2, norm=norm)
        export_onnx(model, tmp_path / "paper.onnx", (96, 64))
        session = runtime.InferenceSession(
            tmp_path / "paper.onnx", providers=["CPUExecutionProvider"]
        )
        image = np.random.default_rng(0).uniform(0, 255, (1, 3, 64, 96)).astype(np.float32)
        got = session.run(["logits", "deltas"], {"image": image})
        with torch.no_grad():
            want = model(torch.from_numpy(image))
        cells = sum(columns * rows for columns, rows in grids((96, 64)))
        assert got[0].shape == (1, PER_CELL * cells, 2)
        for a, b in zip(got, want, strict=True):
            assert np.abs(a - b.numpy()).max() < 1e-4
