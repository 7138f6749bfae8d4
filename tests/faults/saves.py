"""``kill -9`` while work is autosaved and saved: what is on disk is never older than the last write that was reported."""

import json
import random
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from .product import ROOT, Product, environment, left_in, run

_AUTOSAVE = """
import sys
from pointglass.viewer.work.document import Document
from pointglass.viewer.work.notes.annotation import Annotation
from pointglass.viewer.window import autosave
autosave.PAUSE_S = 0.0
kept = autosave.Autosave()
for number in range(1 << 30):
    work = autosave.UnsavedWork(Document(annotations=tuple(Annotation(f"note {number}", (1.0, 2.0, 3.0)) for _ in range(200))))
    kept.follow(work)
    while kept._kept != work:
        pass
    print(number, flush=True)
"""
_SAVE = """
import sys
from pathlib import Path
from pointglass.viewer.work.document import Document
from pointglass.viewer.work.notes.annotation import Annotation
from pointglass.viewer.work.project import write_project
for number in range(1 << 30):
    note = Annotation(f"note {number}", (1.0, 2.0, 3.0))
    write_project(Path(sys.argv[1]), Document(annotations=(note,) * 200))
    print(number, flush=True)
"""


def killed_saves(product: Product, work: Path, name: str, rng: random.Random) -> Iterator[str]:
    """name: autosave or project."""
    while True:
        shutil.rmtree(work / "state", ignore_errors=True)
        out = work / "saves"
        shutil.rmtree(out, ignore_errors=True)
        out.mkdir(parents=True)
        code = _AUTOSAVE if name == "autosave" else _SAVE
        process = subprocess.Popen([sys.executable, "-c", code, str(out / "a.pointglass")], cwd=ROOT, env=environment(work),
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)  # fmt: skip
        assert process.stdout is not None
        process.stdout.readline()  # the first one is there
        time.sleep(rng.uniform(0.0, 0.3))
        process.kill()
        said, error = process.communicate()
        reported = int(([line for line in said.split("\n")[:-1] if line] or ["0"])[-1])
        found = [*(work / "state" / "autosave").glob("*.json")] if name == "autosave" else [*out.glob("*.pointglass")]
        found = [path for path in found if not path.name.startswith(".")]  # unfinished ones, which the next start removes
        yield _judged(found, reported, error) or _swept(product, work, out)


def _judged(found: list[Path], reported: int, error: str) -> str:
    if error or len(found) != 1:
        return f"{len(found)} files, {error[-300:]!r}"
    text = found[0].read_text("utf-8")
    try:
        json.loads(text)
    except ValueError as wrong:
        return f"the file is damaged: {wrong}"
    numbers = set(map(int, re.findall(r"note (\d+)", text)))
    if len(numbers) != 1 or min(numbers) < reported:
        return f"{numbers} is on disk, {reported} was reported"
    return ""


def _swept(product: Product, work: Path, out: Path) -> str:
    run(["info", "--no-cache", str(product.scan)], work)
    left = left_in(out) + [name for name in left_in(work / "state") if not name.endswith(".lock")]
    return f"{left} is left after the next start" if left else ""
