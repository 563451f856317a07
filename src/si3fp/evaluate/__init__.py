"""The metrics of the paper: a run against the truth (pure; no files, no figures)."""

from si3fp.evaluate.metrics import evaluate
from si3fp.evaluate.results import (
    Evaluation,
    FacadeEvaluation,
    WindowMatch,
    WindowScores,
    WwrErrors,
)
from si3fp.evaluate.truth import facades_from_hbjson

__all__ = [
    "Evaluation",
    "FacadeEvaluation",
    "WindowMatch",
    "WindowScores",
    "WwrErrors",
    "evaluate",
    "facades_from_hbjson",
]
