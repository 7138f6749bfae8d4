"""What pairs and checkpoints were made from, kept with them: a later run with the same goes on, one with another is refused.

Facts are plain values by name, as JSON holds them: where folders lie, a seed, a batch.  What earlier versions left, without
facts or with pairs and crops drawn otherwise, is refused.
"""

import hashlib
import json
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from torch import Tensor

from model.data.dataset import DataError
from model.weights import load_weights

Facts = dict[str, Any]

OPTIONS = {"crops": "crops of version", "folders": "folder", "start_from": "--start-from", "sources": "pairs of"} | {
    name: f"--{name}" for name in ("batch", "crop", "perceptual", "procedural", "quality", "rate", "recipe", "seed")
}
"""How a person gives a fact; the others are called by their own names."""

EARLIER = "of an earlier version of pointglass, which drew pairs and crops otherwise; choose another --out"
MOST_NAMED = 3  # values of a list, in a message


def whereabouts(out: Path, folders: Iterable[Path]) -> Facts:
    """Where data lie: by full paths, the same under another name and when ``out`` is moved; and as seen from ``out``, the same
    when all is moved together.  Either will do.  And what files there are, by names and sizes."""
    base, full = Path(out).resolve(), [Path(folder).resolve() for folder in folders]
    return {"folders": [str(folder) for folder in full], "from_here": [_relative(folder, base) for folder in full],
            "contents": [_contents(folder, base) for folder in full]}


def _relative(folder: Path, base: Path) -> str:
    try:
        return Path(os.path.relpath(folder, base)).as_posix()
    except ValueError:  # on another drive
        return str(folder)


def _contents(folder: Path, out: Path) -> str | None:
    """Of a folder's files, but for hidden ones and what lies in ``out``; None where it is gone."""
    told = []
    for above, below, names in os.walk(folder):
        below[:] = sorted(name for name in below if not name.startswith(".") and Path(above, name) != out)
        told += [f"{Path(above, name).relative_to(folder).as_posix()} {Path(above, name).lstat().st_size}\n".encode()
                 for name in sorted(names) if not name.startswith(".")]
    return _digest(told) if folder.is_dir() else None


def refuse_other(where: Path, what: str, kept: Facts, wanted: Facts) -> None:
    """Raises DataError, in one line, where facts that both know differ.

    where: the folder; what: in it was made from ``kept``, "its pairs".  wanted: what this run would make it from.
    """
    wanted = json.loads(json.dumps(wanted))  # a tuple comes back as a list
    contents = wanted.pop("contents", [])
    if any(name in wanted and kept.get(name) == wanted[name] for name in ("folders", "from_here")):
        told = zip(wanted.pop("folders"), contents, kept.get("contents", contents), strict=True)
        if changed := [folder for folder, now, then in told if None not in (now, then) and now != then]:
            raise DataError(f"{where}: {what} made with other files in {_listed(changed)}; choose another --out")
    wanted.pop("from_here", None)
    differ = [_difference(OPTIONS.get(name, name), kept[name], wanted[name])
              for name in wanted if name in kept and kept[name] != wanted[name]]
    if differ:
        raise DataError(f"{where}: {what} made with {' and '.join(differ)}; choose another --out")


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
    shown = ", ".join(map(str, values[:MOST_NAMED]))
    return shown if len(values) <= MOST_NAMED else f"{shown} and {len(values) - MOST_NAMED} more"


def read_record(path: Path, *names: str) -> Facts | None:
    """The facts kept in a file, None where there is none.  Raises DataError where it cannot be read or lacks some ``names``."""
    try:
        data = json.loads(path.read_text())
    except FileNotFoundError:
        return None
    except (OSError, ValueError, RecursionError) as error:
        raise DataError(f"{path}: cannot be read ({error}); choose another --out") from None
    if not isinstance(data, dict) or not set(names) <= data.keys():
        raise DataError(f"{path}: not a record of a training; choose another --out")
    return data


def pairs_facts(folders: Iterable[str]) -> list[str]:
    """Folders of pairs by name and by what they say of themselves; where they lie does not matter."""
    told = ((Path(folder), Path(folder) / "pairs.json") for folder in folders)
    return [f"{folder.name} {_digest([json.read_bytes()])}" if json.is_file() else folder.name for folder, json in told]


def start_fact(path: str | None, out: Path) -> str | None:
    """Weights to begin with: those of this run's own folder by name, as they may be trained on; others by their contents."""
    if path is None:
        return None
    if Path(path).resolve().is_relative_to(out.resolve()):
        return Path(path).stem
    state: dict[str, Tensor] = load_weights(Path(path))[0].state_dict()
    return f"weights {_digest(name.encode() + value.numpy().tobytes() for name, value in sorted(state.items()))}"


def _digest(parts: Iterable[bytes]) -> str:
    """First 12 hex digits of the SHA-256 of parts."""
    found = hashlib.sha256()
    for part in parts:
        found.update(part)
    return found.hexdigest()[:12]
