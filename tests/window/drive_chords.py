"""Presses every chord of the table of controls by X events, for ``test_chords.py``: at rest, while flying, and while typing;
and a key that flies, in frames that are longer than it is held."""

import json
import sys
import time
from pathlib import Path

import numpy as np
from driver import Driver
from x_keyboard import focus, keys_of, xdo

from pointglass.viewer.window.interaction.controls import by_chord


def main(folder: Path) -> None:
    d = Driver(folder)
    d.drop(Path("room1"))
    d.until(lambda: d.session.scene is not None and d.session.loads.current is None)
    d.rest()
    focus()
    d.settle()
    done: list[str] = []
    for control in by_chord().values():
        d.app.actions.table[control.action] = lambda name=control.action: done.append(name)
    report = {}
    for key, control in by_chord().items():
        found = report[key] = {"action": control.action}
        for held in ("", "w", "shift"):
            if held == "shift" and "SHIFT" not in key:
                continue
            done.clear()
            start = d.session.flight.state
            if held:
                xdo("keydown", held)
                d.until(lambda: d.session.flight.held)
            xdo("key", keys_of(key))
            d.until(lambda: done)
            d.settle()
            found[held or "rest"] = list(done)
            found[f"{held or 'rest'} held"] = sorted(d.session.flight.held - {"fast"})
            if held:
                xdo("keyup", held)
            d.until(lambda: not d.session.flight.held and not d.session.flight.moving)
            moved = float(np.linalg.norm(d.session.flight.state.position - start.position))
            found[f"{held or 'rest'} moved"] = moved
        d.session.notices.say("A dialog", "is open")
        done.clear()
        xdo("key", keys_of(key))
        if control.everywhere:
            d.until(lambda: done)
        d.settle(8)
        found["dialog"] = list(done)
        d.session.notices.message = None
        d.settle()
    for name, steps in (("within a frame", 0), ("in a long frame", 2)):
        start = d.session.flight.state
        xdo("keydown", "w")
        d.settle(steps)
        time.sleep(0.6)  # a long frame: the window takes no events
        xdo("keyup", "w")
        d.settle()
        d.until(lambda: not d.session.flight.moving)
        report[name] = float((d.session.flight.state.position - start.position) @ start.forward) / start.speed
    (folder / "chords.json").write_text(json.dumps(report, indent=1))
    d.app.close()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
