"""How many random examples a property test draws: POINTGLASS_EXAMPLES=20 is for a change of what it is about."""

import os


def examples(count: int) -> int:
    """``count``, times POINTGLASS_EXAMPLES where that is set."""
    return max(1, round(count * float(os.environ.get("POINTGLASS_EXAMPLES") or 1)))
