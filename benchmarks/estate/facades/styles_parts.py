"""Details that facades of several countries share: shop fronts, decoys, guards, pediments."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from benchmarks.estate.facades.styles_draft import (
    Draft,
    axes,
    behind,
    box_of,
    choose,
    near,
    reach_of,
)
from benchmarks.estate.plan import Behind, Rgb, WindowStyle

IRON: Rgb = (0.09, 0.09, 0.10)
WHITE: Rgb = (0.90, 0.90, 0.88)
FRAMES: tuple[Rgb, ...] = (
    WHITE,
    (0.84, 0.81, 0.73),
    (0.30, 0.17, 0.10),
    (0.16, 0.17, 0.18),
    (0.44, 0.29, 0.17),
    (0.16, 0.27, 0.21),
    (0.55, 0.57, 0.58),
)
SIGNS: tuple[Rgb, ...] = (
    (0.70, 0.12, 0.10),
    (0.10, 0.24, 0.50),
    (0.12, 0.35, 0.20),
    (0.86, 0.68, 0.12),
    (0.08, 0.08, 0.08),
    (0.88, 0.88, 0.86),
    (0.45, 0.20, 0.12),
)
DARK: Rgb = (0.13, 0.14, 0.15)
STONE: tuple[Rgb, ...] = (
    (0.80, 0.75, 0.65),
    (0.74, 0.69, 0.60),
    (0.84, 0.80, 0.72),
    (0.66, 0.62, 0.55),
)

WARM: tuple[Rgb, ...] = (
    (0.84, 0.70, 0.44),
    (0.78, 0.52, 0.34),
    (0.82, 0.62, 0.52),
    (0.85, 0.80, 0.68),
    (0.72, 0.36, 0.26),
    (0.86, 0.84, 0.80),
    (0.72, 0.70, 0.52),
)

TOWN: tuple[Rgb, ...] = (*WARM, (0.62, 0.70, 0.56), (0.62, 0.66, 0.72), (0.74, 0.72, 0.70))

BRICKS: tuple[Rgb, ...] = (
    (0.50, 0.24, 0.17),
    (0.60, 0.45, 0.30),
    (0.42, 0.20, 0.15),
    (0.66, 0.56, 0.40),
    (0.36, 0.24, 0.20),
)


def shop_floor(draft: Draft, height_m: float, frame: Rgb) -> None:
    """Shop fronts along the ground floor with piers, sign boards, awnings and a house door."""
    rng = draft.rng
    pier = rng.uniform(0.35, 0.9)
    centres = axes(rng, draft.width_m, rng.uniform(3.0, 5.2), "even")
    pitch = draft.width_m / len(centres)
    house = int(rng.integers(len(centres)))
    top = min(height_m - 0.75, rng.uniform(2.4, 3.0))
    for index, centre in enumerate(centres):
        left, width = centre - (pitch - pier) / 2, pitch - pier
        if index == house and len(centres) > 1:
            entrance(draft, centre, 0.02, rng.uniform(1.0, 1.5), rng.uniform(2.2, 2.6), frame)
            continue
        base = float(rng.choice([0.08, 0.35, 0.55]))
        count = int(np.clip(round(width / rng.uniform(1.0, 1.9)), 1, 4))
        style = WindowStyle(
            lights=(1.0 / count,) * count,
            transom=0.78 if rng.random() < 0.3 else None,
            frame_m=round(rng.uniform(0.05, 0.11), 3),
            frame_rgb=frame,
            sill_m=0.0,
        )
        inside = Behind(curtain=0.0, light=round(rng.uniform(0.0, 0.7), 2), things=True)
        if not draft.opening(
            "window", left, base, width, top - base, rng.uniform(0.06, 0.25), style, inside
        ):
            continue
        board = choose(rng, SIGNS)
        draft.shops.append((left, 0.0, left + width, top))
        draft.box(left, top + 0.06, width, 0.5, 0.08, near(rng, board))
        draft.extra(
            "text",
            (left + 0.15 * width, top + 0.16, left + 0.85 * width, top + 0.46),
            WHITE if sum(board) < 1.5 else IRON,
            z_m=0.08,
            out_m=0.02,
            count=int(rng.integers(4, 11)),
        )
        if rng.random() < 0.3:
            draft.extra(
                "awning",
                (left, top - 0.45, left + width, top + 0.05),
                near(rng, choose(rng, SIGNS)),
                out_m=rng.uniform(0.6, 1.3),
            )


def entrance(
    draft: Draft, centre: float, y_m: float, width: float, height: float, frame: Rgb
) -> bool:
    """A house door, with a glazed or a solid leaf, a step and sometimes a canopy."""
    rng = draft.rng
    leaf = choose(rng, [(0.28, 0.16, 0.09), (0.12, 0.22, 0.16), (0.45, 0.11, 0.09), frame, IRON])
    style = WindowStyle(
        lights=(1.0,) if width < 1.25 else choose(rng, [(0.5, 0.5), (0.7, 0.3)]),
        transom=0.8 if rng.random() < 0.5 else None,
        panel=float(choose(rng, [0.3, 0.5, 0.78, 0.98])),
        frame_m=0.1,
        frame_rgb=near(rng, leaf),
        sill_m=0.0,
    )
    done = draft.opening(
        "door", centre - width / 2, y_m, width, height, rng.uniform(0.06, 0.3), style, Behind(0.0)
    )
    if done and rng.random() < 0.3:
        draft.box(
            centre - width * 0.8,
            y_m + height + 0.15,
            width * 1.6,
            0.1,
            rng.uniform(0.5, 1.2),
            near(rng, (0.5, 0.5, 0.5)),
        )
    return done


def decoys(draft: Draft, count: int) -> None:
    """What looks like a window and is none: niches, panels, vents, signs, murals, boxes."""
    rng = draft.rng
    for _ in range(count):
        kind = choose(
            rng,
            ["niche", "panel", "vent", "sign", "mural", "box", "fan", "hole"],
            (3, 3, 4, 2, 1, 2, 2, 1),
        )
        size = {
            "niche": (rng.uniform(0.7, 1.3), rng.uniform(1.0, 1.7)),
            "panel": (rng.uniform(0.5, 1.6), rng.uniform(0.6, 1.6)),
            "vent": (rng.uniform(0.15, 0.5), rng.uniform(0.15, 0.4)),
            "sign": (rng.uniform(0.6, 3.0), rng.uniform(0.3, 0.9)),
            "mural": (rng.uniform(1.5, 4.0), rng.uniform(1.5, 4.0)),
            "box": (rng.uniform(0.3, 0.7), rng.uniform(0.4, 0.9)),
            "fan": (0.85, 0.6),
            "hole": (rng.uniform(0.8, 2.6), rng.uniform(1.2, 2.2)),
        }[kind]
        x = rng.uniform(0.1, max(0.11, draft.width_m - size[0] - 0.1))
        y = rng.uniform(0.4, max(0.41, draft.height_m - size[1] - 0.2))
        box = (x, y, x + size[0], y + size[1])
        taken = any(
            box[0] < b.x_m + b.width_m + 0.1
            and b.x_m < box[2] + 0.1
            and box[1] < b.y_m + b.clear_m
            and b.y_m - 0.3 < box[3]
            for b in draft.balconies
        )
        if taken or not draft.fits(box, 0.08):
            continue
        if kind in ("niche", "hole"):
            draft.balcony(
                "loggia",
                x,
                y,
                size[0],
                0.12 if kind == "niche" else 1.2,
                near(rng, (0.6, 0.6, 0.6)),
                clear_m=round(size[1], 3),
                guard_m=0.0,
                slab_m=0.0,
            )
        elif kind == "fan":
            conditioner(draft, x, y)
        else:
            colour = (
                choose(rng, SIGNS)
                if kind in ("sign", "mural")
                else choose(rng, [(0.2, 0.2, 0.22), (0.4, 0.42, 0.45), (0.7, 0.7, 0.68), *SIGNS])
            )
            deep = {"vent": 0.02, "box": 0.18, "sign": 0.06}.get(kind, 0.012)
            draft.box(x, y, size[0], size[1], deep, near(rng, colour))
            if kind == "sign":
                inner = (x + 0.1, y + 0.2 * size[1], box[2] - 0.1, y + 0.8 * size[1])
                letters = WHITE if sum(colour) < 1.5 else IRON
                draft.extra("text", inner, letters, z_m=deep, out_m=0.01, count=6)
            elif kind == "vent":
                draft.extra("lines", box, IRON, z_m=deep, out_m=0.01, count=5)


def conditioner(draft: Draft, x_m: float, y_m: float) -> bool:
    """The outdoor unit of an air conditioner on brackets."""
    rgb = near(draft.rng, (0.80, 0.79, 0.76))
    if not draft.box(x_m, y_m, 0.82, 0.56, 0.32, rgb, gap_m=0.06):
        return False
    return draft.extra(
        "fan", (x_m + 0.06, y_m + 0.05, x_m + 0.52, y_m + 0.51), IRON, z_m=0.38, out_m=0.01
    )


def pipes(draft: Draft, count: int, rgb: Rgb) -> None:
    """Downpipes from top to bottom where they cross no opening."""
    rng = draft.rng
    for _ in range(count):
        for _ in range(6):
            x = rng.uniform(0.1, draft.width_m - 0.25)
            reaches = [reach_of(opening) for opening in draft.openings]
            blocked = any(left - 0.14 < x < right + 0.04 for left, _, right, _ in reaches)
            cut = any(b.x_m - 0.14 < x < b.x_m + b.width_m + 0.04 for b in draft.balconies)
            if not blocked and not cut:
                draft.box(x, 0.1, 0.1, draft.height_m - 0.1, 0.1, rgb, gap_m=0.03, kind="pipe")
                break


def cornice(draft: Draft, y_m: float, height: float, out: float, rgb: Rgb) -> None:
    """A moulding along the whole wall in two steps."""
    draft.box(0.0, y_m, draft.width_m, height * 0.45, out * 0.5, rgb)
    draft.box(0.0, y_m + height * 0.45, draft.width_m, height * 0.55, out, rgb)


def head(draft: Draft, kind: str, x_m: float, y_m: float, width: float, rgb: Rgb) -> None:
    """What crowns a window whose surround ends at ``y_m``: a moulding or a pediment."""
    out = draft.rng.uniform(0.08, 0.18)
    if kind in ("straight", "triangle", "segment"):
        if not draft.box(x_m - 0.1, y_m, width + 0.2, 0.12, out, rgb):
            return
        if kind != "straight":
            box = (x_m - 0.12, y_m + 0.12, x_m + width + 0.12, y_m + 0.12 + 0.26 * width)
            if draft.fits(box, 0.0):
                draft.extra(kind, box, rgb, out_m=out)
    elif kind == "keystone":
        draft.box(x_m + width / 2 - 0.11, y_m - 0.12, 0.22, 0.34, 0.08, rgb)


def shutters(draft: Draft, rgb: Rgb, closed: float, roller: bool = False) -> None:
    """Close some windows: leaves with louvres, or roller shutters part of the way down."""
    rng = draft.rng
    for index, opening in enumerate(draft.openings):
        if opening.kind == "door" or rng.random() >= closed:
            continue
        left, low, right, high = box_of(opening)
        front = -opening.depth_m - min(0.02, opening.recess_m / 2)
        if roller:
            share = float(choose(rng, [rng.uniform(0.12, 0.9), 1.0], (3, 1)))
            box = (left, high - share * (high - low), right, high)
            draft.extra("roller", box, rgb, z_m=front - 0.02, out_m=0.02, count=1)
        elif opening.style.arch == 0:
            draft.extra("leaf", (left, low, right, high), rgb, z_m=front - 0.03, out_m=0.03)
            shut = replace(opening.style, shutters=False)  # its leaves are the ones beside it
            draft.openings[index] = replace(opening, style=shut)


def sashes(
    rng: np.random.Generator, frame: Rgb, bars: tuple[int, int], **more: float
) -> WindowStyle:
    """A double-hung window: one bar across the middle, glazing bars in both halves."""
    return WindowStyle(
        transom=0.5,
        bars=bars,
        frame_m=round(float(rng.uniform(0.06, 0.1)), 3),
        frame_rgb=near(rng, frame),
        **more,
    )


def home_window(
    draft: Draft,
    centre: float,
    y_m: float,
    width: float,
    height: float,
    recess: float,
    style: WindowStyle,
) -> bool:
    """A window of a home around its centre."""
    return draft.opening(
        "window", centre - width / 2, y_m, width, height, recess, style, behind(draft.rng)
    )
