"""A seed: small good files of one format, from which mutants are made."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Seed:
    """kind: what runs (exercise.KINDS).  files: path in the folder -> contents.  entry: path that is given to the program,
    "" for the folder.  untouched: files that are not edited."""

    format: str
    name: str
    kind: str
    files: dict[str, bytes]
    entry: str
    untouched: tuple[str, ...] = ()


def files_of(folder: Path) -> dict[str, bytes]:
    """Contents of the files below a folder, by path in it."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}
