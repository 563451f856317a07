"""Encoding and decoding a plane map are inverse to the precision of float32."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from si3fp.geometry.planes import Planes
from si3fp.sources.plane_map import decode_plane_map, encode_plane_map


@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(0, 255),
    width=st.integers(1, 70),
    height=st.integers(1, 40),
)
def test_decode_inverts_encode(seed: int, count: int, width: int, height: int) -> None:
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    planes = Planes(normals, rng.uniform(0, 500, count))
    plane_index = rng.integers(-1, count, (height, width), dtype=np.int32)

    text = encode_plane_map(planes, plane_index)
    decoded, decoded_index = decode_plane_map(text, "map")

    np.testing.assert_array_equal(decoded_index, plane_index)
    # float32 carries 24 bits: 6e-8 of 1, and 3e-5 m of 500 m.
    np.testing.assert_allclose(decoded.normals, planes.normals, atol=6e-8)
    np.testing.assert_allclose(decoded.offsets_m, planes.offsets_m, atol=3.1e-5)
    # What went through once no longer changes.
    assert encode_plane_map(decoded, decoded_index) == text
