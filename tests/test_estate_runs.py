"""The StreetView path on the benchmark's small set: rendered here, looked at by nobody before."""

from __future__ import annotations

from pathlib import Path

import pytest

from si3fp.errors import MissingDependencyError
from si3fp.evaluate import Evaluation, evaluate, facades_from_hbjson
from si3fp.pipeline import run_street
from si3fp.workspace import read_json

pytestmark = pytest.mark.slow
SEED = 7  # no constant of the package was chosen on it


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Evaluation:
    """The run on a rendered house against its exact truth."""
    pytest.importorskip("mitsuba")
    from benchmarks.estate.build import build
    from benchmarks.estate.capture.pictures import SIZES
    from benchmarks.estate.specs import estate_of

    folder: Path = tmp_path_factory.mktemp("small")
    truth = folder / "truth" / "model.hbjson"
    only = ("panoramas", "truth")
    try:
        build(estate_of("small", SEED), folder, SIZES["small"], only=only)
    except MissingDependencyError as error:
        pytest.skip(str(error))
    run = run_street(folder / "panoramas.geojson", folder / "footprints.geojson", folder / "RUN")
    assert not run.failed
    found_origin, found = facades_from_hbjson(read_json(run.workspace.model))
    true_origin, true = facades_from_hbjson(read_json(truth))
    return evaluate(found, true, found_origin, true_origin)


def test_facades_that_the_street_shows_are_found(result: Evaluation) -> None:
    # The garden side faces no street; everything else does.
    assert [f.facade_id for f in result.facades if f.found_id is None] == ["small-2"]


def test_windows_of_a_photoreal_house_are_found(result: Evaluation) -> None:
    assert result.windows.f1 is not None
    # Of 14 windows, three on a gable that the road shows at a slant; 0.86 when this was written.
    assert result.windows.f1 >= 0.75
    assert result.windows.mean_abs_position_error_m is not None
    # Poses are 0.10 to 0.15 m off, each in its own direction.
    assert result.windows.mean_abs_position_error_m < 0.25
    assert result.wwr.mean_absolute is not None
    assert result.wwr.mean_absolute < 0.05  # what the paper calls accurate enough
