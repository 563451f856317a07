"""``python -m tests.scenes --seed 1 -o DIR``: write a synthetic street."""

from __future__ import annotations

import argparse
from pathlib import Path

from tests.scenes.files import write_street
from tests.scenes.street import make_street


def main() -> None:
    """Render one street and write it."""
    parser = argparse.ArgumentParser(prog="python -m tests.scenes", description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--size", choices=["tiny", "small", "street"], default="street")
    parser.add_argument("--width", type=int, help="pixels of a panorama, a multiple of 32")
    parser.add_argument("-o", "--output", type=Path, required=True)
    arguments = parser.parse_args()
    write_street(make_street(arguments.seed, arguments.size, arguments.width), arguments.output)


if __name__ == "__main__":
    main()
