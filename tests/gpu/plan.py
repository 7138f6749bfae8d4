"""How much of everything tests/gpu/run.py measures.  Imports nothing beyond Python's own library."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Plan:
    """points: of the benches' scan.  many: of the scan that is projected.  scale: sizes whose frame times are compared.
    sizes: of pictures.  frames: drawn to see whether memory grows.  device: asked for."""

    points: int = 25_000_000
    many: int = 100_000_000
    scale: str = "10000000,60000000"
    grid: int = 10_000_000
    sizes: tuple[str, ...] = ("960x720", "1920x1440", "3840x2160")
    repeats: int = 50
    frames: int = 10_000
    device: str = "cuda"


SMALL = Plan(points=30_000, many=40_000, scale="20000,40000", grid=50_000, sizes=("96x72",), repeats=2, frames=6, device="cpu")
"""The plumbing alone, on the CPU in half a minute or so."""
