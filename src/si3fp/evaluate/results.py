"""What an evaluation reports; plain frozen values, None where a denominator is zero."""

from __future__ import annotations

from dataclasses import dataclass

from si3fp.evaluate.scores import Totals, WindowScores

Box = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class WindowMatch:
    """A found window and the true one that it is.

    Attributes
    ----------
    found, truth
        Indices into the two facades' windows.
    iou
        Intersection over union on the true facade's plane.
    relative_area_error
        (found - true) / true area.
    position_error_m
        Distance of the centres on the true facade's plane.
    """

    found: int
    truth: int
    iou: float
    relative_area_error: float
    position_error_m: float


@dataclass(frozen=True, slots=True)
class FacadeEvaluation:
    """One true facade and what was found of it.

    Attributes
    ----------
    facade_id, found_id
        Ids of the true facade and of the found one; `found_id` is None where it is missing.
    building_id
        The building that it belongs to.
    balconies
        Whether it has balconies.
    width_m, height_m
        Size of the true facade.
    area_m2, found_area_m2
        Gross areas of the true and of the found facade.
    relative_area_error
        (found - true) / true gross area.
    windows
        Scores of its windows; those of a missing facade are all false negatives.
    matches
        The true positives.
    wwr_truth, wwr_found, wwr_error
        Window-to-wall ratios and found - true; None where the facade is missing.
    wwr_interval
        The interval that was stated for the found ratio, or None.
    found_outline_m
        The found facade as x0, y0, x1, y1 on the true facade's plane, from its lower left corner.
    true_boxes_m, found_boxes_m
        The windows on the true facade's plane, likewise; in the order of the facades' windows.
    found_offsets_m
        How far the centre of every found window lies in front of the true facade's plane.
    """

    facade_id: str
    found_id: str | None
    building_id: str
    balconies: bool
    width_m: float
    height_m: float
    area_m2: float
    found_area_m2: float | None
    relative_area_error: float | None
    windows: WindowScores
    matches: tuple[WindowMatch, ...]
    wwr_truth: float
    wwr_found: float | None
    wwr_error: float | None
    wwr_interval: tuple[float, float] | None
    found_outline_m: Box | None
    true_boxes_m: tuple[Box, ...]
    found_boxes_m: tuple[Box, ...]
    found_offsets_m: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class BuildingEvaluation:
    """The facades of one true building.

    Attributes
    ----------
    id
        The building.
    height_m, longest_side_m
        Lowest foot to highest top, and the widest facade.
    all, without_balconies
        Over all its facades, and over those without balconies.
    """

    id: str
    height_m: float
    longest_side_m: float
    all: Totals
    without_balconies: Totals


@dataclass(frozen=True, slots=True)
class Unmatched:
    """A facade without partner in the other model.

    Attributes
    ----------
    facade_id
        Its id.
    model
        The model that has it: ``truth`` (the facade is missing) or ``found`` (not scored).
    windows
        Its number of windows.
    reason
        Why no facade of the other model is its partner.
    """

    facade_id: str
    model: str
    windows: int
    reason: str


@dataclass(frozen=True, slots=True)
class Evaluation(Totals):
    """A run against the truth: the totals over all facades, and their parts.

    Attributes
    ----------
    without_balconies
        The totals over the facades without balconies.
    buildings
        In the order of the truth's facades.
    facades
        One entry per true facade, in its order.
    unmatched
        True facades that are missing, then found ones that the truth does not know; the latter are
        not scored.
    mean_shift_m
        Mean east, north and up from the true facades' centres to the found ones'; None without.
    """

    without_balconies: Totals
    buildings: tuple[BuildingEvaluation, ...]
    facades: tuple[FacadeEvaluation, ...]
    unmatched: tuple[Unmatched, ...]
    mean_shift_m: tuple[float, float, float] | None

    @property
    def extra(self) -> tuple[str, ...]:
        """Ids of found facades that the truth does not know."""
        return tuple(row.facade_id for row in self.unmatched if row.model == "found")
