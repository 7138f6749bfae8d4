"""What a GPU test does where there is no GPU.

POINTGLASS_EXPECT_GPU=1 (tests/gpu/run.py sets it where there is one) makes a failure of every skip.
"""

import os

import pytest


def absent(reason: str) -> None:
    """Skips, or fails where a GPU was promised."""
    if os.environ.get("POINTGLASS_EXPECT_GPU"):
        pytest.fail(f"a GPU was expected: {reason}")
    pytest.skip(reason)
