"""The metrics of the paper: a run against the truth (pure; no files, no figures)."""

from si3fp.evaluate.metrics import evaluate
from si3fp.evaluate.results import Evaluation, FacadeEvaluation, WindowMatch
from si3fp.evaluate.scores import Totals, WindowScores, WwrErrors
from si3fp.evaluate.truth import ModelFacades, facades_from_hbjson, read_facades

__all__ = [
    "Evaluation",
    "FacadeEvaluation",
    "ModelFacades",
    "Totals",
    "WindowMatch",
    "WindowScores",
    "WwrErrors",
    "evaluate",
    "facades_from_hbjson",
    "read_facades",
]
