"""How much of everything tests/gpu/run.py measures.  Nothing here imports more than Python's own library."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Plan:
    """How much of everything.  points, many: of the benches' scan, of the scan that is projected.  sizes: of pictures.
    device: asked for."""

    points: int = 25_000_000
    many: int = 100_000_000
    grid: int = 10_000_000
    sizes: tuple[str, ...] = ("960x720", "1920x1440", "3840x2160")
    repeats: int = 50
    device: str = "cuda"


DRY = Plan(points=30_000, many=40_000, grid=50_000, sizes=("96x72",), repeats=2, device="cpu")
