"""Manifests: the facts from which pairs and checkpoints were made, stored beside them.

A later run with the same facts continues; one with other facts is refused.  Facts are named plain values, as JSON stores them:
folders, a seed, a batch size.  Files of earlier versions, without facts or with pairs and crops drawn differently, are refused.
"""

import hashlib
import json
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from torch import Tensor

from ..common.errors import DataError
from ..network.weights import load_weights

Facts = dict[str, Any]

OPTIONS = {"crops": "crops of version", "folders": "folder", "start_from": "--start-from", "sources": "pairs of"} | {
    name: f"--{name}" for name in ("batch", "crop", "perceptual", "procedural", "quality", "rate", "recipe", "seed")
}
"""Name of a fact in messages, where it differs from its key."""

EARLIER = "of an earlier version of pointglass, which drew pairs and crops differently; choose another --out"
MAX_LISTED = 3
"""Values of a list that a message names before it counts the rest."""


def whereabouts(out: Path, folders: Iterable[Path]) -> Facts:
    """Facts of the data folders: absolute paths, paths relative to ``out``, and a digest of file names and sizes.

    Equal absolute paths (``out`` was moved) or equal relative paths (all was moved together) identify the same folders.
    """
    base, full = Path(out).resolve(), [Path(folder).resolve() for folder in folders]
    return {"folders": [str(folder) for folder in full], "from_here": [_relative(folder, base) for folder in full],
            "contents": [_contents(folder, base) for folder in full]}


def _relative(folder: Path, base: Path) -> str:
    try:
        return Path(os.path.relpath(folder, base)).as_posix()
    except ValueError:  # another drive on Windows
        return str(folder)


def _contents(folder: Path, out: Path) -> str | None:
    """Digest of a folder's file names and sizes, without hidden files and ``out``; None where the folder is missing."""
    entries = []
    for above, below, names in os.walk(folder):
        below[:] = sorted(name for name in below if not name.startswith(".") and Path(above, name) != out)
        entries += [f"{Path(above, name).relative_to(folder).as_posix()} {Path(above, name).lstat().st_size}\n".encode()
                    for name in sorted(names) if not name.startswith(".")]
    return _digest(entries) if folder.is_dir() else None


def refuse_other(where: Path, what: str, kept: Facts, wanted: Facts) -> None:
    """Raises DataError, in one line, where facts present in both differ.

    where: the folder.  what: the thing in it and its verb, for example "its pairs were".  kept: facts it was made from.
    wanted: facts of this run.
    """
    wanted = json.loads(json.dumps(wanted))  # turns tuples into lists, as in ``kept``
    contents = wanted.pop("contents", [])
    if any(name in wanted and kept.get(name) == wanted[name] for name in ("folders", "from_here")):
        pairs = zip(wanted.pop("folders"), contents, kept.get("contents", contents), strict=True)
        if changed := [folder for folder, now, then in pairs if None not in (now, then) and now != then]:
            raise DataError(f"{where}: {what} made with other files in {_listed(changed)}", remedy="choose another --out")
    wanted.pop("from_here", None)
    differ = [_difference(OPTIONS.get(name, name), kept[name], wanted[name])
              for name in wanted if name in kept and kept[name] != wanted[name]]
    if differ:
        raise DataError(f"{where}: {what} made with {' and '.join(differ)}", remedy="choose another --out")


def _difference(label: str, kept: Any, wanted: Any) -> str:
    if not (isinstance(kept, list) and isinstance(wanted, list)):
        return f"{label} {'none' if kept is None else kept} (not {'none' if wanted is None else wanted})"
    gone, new = [k for k in kept if k not in wanted], [w for w in wanted if w not in kept]
    if gone and new:
        return f"{label} {_listed(gone)} (not {_listed(new)})"
    if gone or new:
        return f"{label} {_listed(gone)}, too" if gone else f"no {label} {_listed(new)}"
    return f"{label} in another order"


def _listed(values: Sequence[Any]) -> str:
    shown = ", ".join(map(str, values[:MAX_LISTED]))
    return shown if len(values) <= MAX_LISTED else f"{shown} and {len(values) - MAX_LISTED} more"


def read_manifest(path: Path, *names: str) -> Facts | None:
    """The facts in a file, None where it does not exist.  Raises DataError where it is unreadable or lacks one of ``names``."""
    try:
        data = json.loads(path.read_text())
    except FileNotFoundError:
        return None
    except (OSError, ValueError, RecursionError) as error:
        raise DataError(f"cannot be read ({error})", file=path, remedy="choose another --out") from None
    if not isinstance(data, dict) or not set(names) <= data.keys():
        raise DataError("not the manifest of a training", file=path, remedy="choose another --out")
    return data


def pairs_facts(folders: Iterable[str]) -> list[str]:
    """Folders of pairs by name and digest of their ``pairs.json``; independent of their location."""
    files = ((Path(folder), Path(folder) / "pairs.json") for folder in folders)
    return [f"{folder.name} {_digest([json.read_bytes()])}" if json.is_file() else folder.name for folder, json in files]


def start_fact(path: str | None, out: Path) -> str | None:
    """Initial weights: by name if they lie in ``out``, where they may be trained further; otherwise by a digest of their
    contents."""
    if path is None:
        return None
    if Path(path).resolve().is_relative_to(out.resolve()):
        return Path(path).stem
    state: dict[str, Tensor] = load_weights(Path(path))[0].state_dict()
    return f"weights {_digest(name.encode() + value.numpy().tobytes() for name, value in sorted(state.items()))}"


def _digest(parts: Iterable[bytes]) -> str:
    """First 12 hex digits of the SHA-256 of parts."""
    digest = hashlib.sha256()
    for part in parts:
        digest.update(part)
    return digest.hexdigest()[:12]
