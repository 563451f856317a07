"""Materials by name: the fixed ones of the estate, and paint of any colour.

Textures cover ``textures.TILE_M`` metres square and repeat without seams. Each is painted when it
is first asked for and kept, so that importing costs nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

from benchmarks.estate.painting import textures
from benchmarks.estate.painting.textures import Painter, tile
from benchmarks.estate.parts import Material, MaterialKind
from benchmarks.estate.plan import Rgb


def painted(rgb: Rgb, roughness: float = 0.25) -> tuple[str, Material]:
    """Name and material of a painted surface: coloured, with a coat of that roughness."""
    name = f"painted-{_hex(rgb)}-{round(100 * roughness):02d}"
    return name, Material("plastic", rgb, None, roughness)


def _hex(rgb: Rgb) -> str:
    return "".join(f"{round(255 * min(max(value, 0.0), 1.0)):02x}" for value in rgb)


def _is(
    kind: MaterialKind, rgb: Rgb, painter: Painter | None = None, roughness: float = 0.3
) -> Callable[[str], Material]:
    def made(name: str) -> Material:
        texture = None if painter is None else tile(name, rgb, painter)
        return Material(kind, rgb, texture, roughness)

    return made


_RECIPES: dict[str, Callable[[str], Material]] = {
    # Windows and what is behind them.
    "glass": _is("glass", (0.95, 0.97, 0.96)),
    "dark_room": _is("diffuse", (0.20, 0.19, 0.18)),
    "room_light": _is("light", (1.0, 0.82, 0.58)),
    "curtain_white": _is("diffuse", (0.86, 0.85, 0.82), textures.cloth),
    "curtain_linen": _is("diffuse", (0.74, 0.69, 0.60), textures.cloth),
    "curtain_grey": _is("diffuse", (0.50, 0.50, 0.51), textures.cloth),
    "curtain_blue": _is("diffuse", (0.36, 0.43, 0.53), textures.cloth),
    "curtain_ochre": _is("diffuse", (0.68, 0.52, 0.28), textures.cloth),
    "curtain_red": _is("diffuse", (0.50, 0.22, 0.19), textures.cloth),
    "blind": _is("diffuse", (0.80, 0.80, 0.78), textures.slats),
    # Buildings.
    "painted": _is("plastic", (0.60, 0.60, 0.59), textures.plain),
    "zinc": _is("metal", (0.60, 0.62, 0.63), textures.patina, 0.40),
    "galvanised": _is("metal", (0.66, 0.67, 0.68), textures.spangle, 0.35),
    "coping": _is("metal", (0.42, 0.43, 0.44), textures.patina, 0.45),
    "concrete": _is("diffuse", (0.63, 0.62, 0.60), textures.concrete),
    "wood": _is("diffuse", (0.50, 0.42, 0.33), textures.boards),
    "door_wood": _is("plastic", (0.45, 0.29, 0.18), textures.timber, 0.30),
    "felt": _is("diffuse", (0.27, 0.27, 0.28), textures.felt),
    "roof_tiles": _is("diffuse", (0.53, 0.31, 0.23), textures.roof_tiles),
    "sheet_roof": _is("plastic", (0.30, 0.31, 0.32), textures.seamed, 0.35),
    # Ground.
    "asphalt": _is("diffuse", (0.385, 0.380, 0.372), textures.asphalt),
    "paving": _is("diffuse", (0.55, 0.54, 0.52), textures.slabs),
    "kerb": _is("diffuse", (0.55, 0.54, 0.53), textures.concrete),
    "grass": _is("diffuse", (0.375, 0.415, 0.265), textures.grass),
    "gravel": _is("diffuse", (0.54, 0.52, 0.48), textures.gravel),
    "soil": _is("diffuse", (0.30, 0.25, 0.20), textures.soil),
    # Plants. Leaves are darker than they are remembered: about a tenth of the light comes back.
    "bark": _is("diffuse", (0.34, 0.30, 0.26), textures.bark),
    "bark_birch": _is("diffuse", (0.74, 0.73, 0.70), textures.birch_bark),
    "bark_pine": _is("diffuse", (0.47, 0.33, 0.25), textures.bark),
    "leaf_birch": _is("leaf", (0.37, 0.44, 0.21)),
    "leaf_linden": _is("leaf", (0.31, 0.40, 0.19)),
    "leaf_maple": _is("leaf", (0.33, 0.38, 0.18)),
    "leaf_pine": _is("leaf", (0.23, 0.30, 0.19)),
    "leaf_hedge": _is("leaf", (0.26, 0.35, 0.17)),
    "leaf_dry": _is("leaf", (0.46, 0.36, 0.20)),
    # Street.
    "rubber": _is("diffuse", (0.12, 0.12, 0.12)),
    "car_glass": _is("plastic", (0.08, 0.09, 0.09), None, 0.03),
    "chrome": _is("metal", (0.78, 0.78, 0.78), None, 0.08),
    "lamp_metal": _is("metal", (0.50, 0.51, 0.52), textures.plain, 0.40),
}


class _Fixed(Mapping[str, Material]):
    """The fixed materials; each is made when it is first looked up."""

    def __init__(self) -> None:
        self._made: dict[str, Material] = {}

    def __getitem__(self, name: str) -> Material:
        if name not in self._made:
            self._made[name] = _RECIPES[name](name)
        return self._made[name]

    def __iter__(self) -> Iterator[str]:
        return iter(_RECIPES)

    def __len__(self) -> int:
        return len(_RECIPES)


FIXED: Mapping[str, Material] = _Fixed()
