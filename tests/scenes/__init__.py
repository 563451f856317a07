"""A small synthetic street with known windows: rendered panoramas, noisy poses, plane maps."""

from tests.scenes.files import truth_model, write_street
from tests.scenes.street import PanoramaPose, Street, make_street

__all__ = ["PanoramaPose", "Street", "make_street", "truth_model", "write_street"]
