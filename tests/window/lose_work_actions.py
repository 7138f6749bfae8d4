"""What lose_work.py does on the way and at the end of an attempt to lose work: each a function of the attempt."""

import os
import signal
import subprocess
import time

from lose_work_attempt import Attempt, LostError, Piece, alike
from test_work_is_kept import dimmed

from pointglass.viewer.work.notes.annotation import Annotation

NAMES = ("other", "é ü 名", "a" * 60, "x.png", "with space.pointglass", "..", "-rf", "$(touch x)", "sub/none/x",
         "room.pointglass")
"""Typed into the dialog of Ctrl+Shift+S."""
HARMLESS = (*"bnlcpmki123vv", "F10", "F10", "F1", "F1", "F3", "F3", "Tab", "Home")
"""Keys that change no work."""
S_KEY = 39
"""The X key code of the key right of A on a PC's keyboard."""


def unchanged(made: Attempt, what: str) -> None:
    """Whether the window is there, with the work that there was."""
    if not made.alive or not alike(made.state, made.expected):
        raise LostError(f"{what}: alive {made.alive}, {len(made.state)} of {len(made.expected)} measurements and notes")


def leave(made: Attempt) -> None:
    """Ctrl+Q, or the close button of the window manager."""
    if made.chance.random() < 0.6:
        made.window.keys("ctrl+q")
    else:
        made.window.close()


def out_of_dialogs(made: Attempt) -> None:
    for _ in range(4):
        made.window.keys("Escape")
        time.sleep(0.6)


# -- on the way ------------------------------------------------------------------------------------------------------


def noted(made: Attempt) -> None:
    made.note(made.chance.choice(["Crack, 3 mm wide", "to be measured again", "q", "Loose bolt! (see sheet 2)"]))


def quit_cancelled(made: Attempt) -> None:
    if not made.changed:
        made.measure()
    leave(made)
    made.asked()
    if made.chance.random() < 0.3:  # keys and wheel behind the question
        made.window.keys("t", "1", "ctrl+z")
        made.window.xdo("click", "4")
    made.window.keys(*made.chance.choice([("Escape",), ("Left", "Return"), ("Tab", "Tab", "Return")]))
    made.asked(there=False)
    unchanged(made, "a question that was cancelled")
    made.marked(changed=True)


def saved_in_flight(made: Attempt) -> None:
    key = made.chance.choice("weadq")
    made.window.xdo("keydown", key)
    time.sleep(made.chance.random())
    try:
        made.save()
    finally:
        made.window.xdo("keyup", key)
    made.window.keys("Home")
    time.sleep(2.0)


def steps(piece: Piece) -> int:
    """Of the history: a note is made, then has a text."""
    return 2 if isinstance(piece, Annotation) else 1


def undone_and_redone(made: Attempt) -> None:
    everything = list(made.expected)
    for _ in range(made.chance.randint(1, len(everything))):
        made.window.keys(*["ctrl+z"] * steps(made.expected[-1]))
        made.expected = made.expected[:-1]
        made.settles()
        made.marked(made.changed)
    made.window.keys(*["ctrl+y"] * (sum(map(steps, everything)) + 1))
    made.expected = everything
    made.settles()
    made.marked(made.changed)


def many_keys(made: Attempt) -> None:
    keys = [made.chance.choice(HARMLESS) for _ in range(made.chance.randint(5, 25))]
    made.window.xdo("windowfocus", "--sync", made.window.window)
    made.window.xdo("key", "--delay", made.chance.choice([0, 10, 60]), *keys)
    time.sleep(2.0)
    made.window.keys("Escape", *(key for key in ("F10", "F3", "v") if keys.count(key) % 2), "3", "Home")
    time.sleep(2.0)
    unchanged(made, f"keys {' '.join(keys)}")


def other_layout(made: Attempt) -> None:
    """Ctrl and the key that is S on these layouts and Ы on the Russian one.  By its key code: for a letter that a layout lacks,
    xdotool invents a key for an instant, which nobody has."""
    layout = made.chance.choice(["fr", "de", "ru"])
    subprocess.run(["setxkbmap", layout], env=made.window.environment, check=True)
    try:
        made.save("keydown", "Control_L", "key", S_KEY, "keyup", "Control_L")
    finally:
        subprocess.run(["setxkbmap", "us"], env=made.window.environment, check=True)


def project_deleted(made: Attempt) -> None:
    if made.project.exists():
        made.project.unlink()
        made.measure()
        made.save()


def folder_taken_away(made: Attempt) -> None:
    made.measure()
    os.rename(made.scan.parent, made.folder / "away")
    try:
        made.window.keys("ctrl+s")
        time.sleep(2.0)
        if not made.alive or "•" not in made.window.title:
            raise LostError("no changes in the title, though nothing could be saved")
        made.window.keys("Escape")
    finally:
        os.rename(made.folder / "away", made.scan.parent)
    out_of_dialogs(made)
    made.save()


def written_by_another(made: Attempt) -> None:
    made.save()
    time.sleep(1.5)
    theirs = made.project.read_bytes() + b"\n"
    made.project.write_bytes(theirs)
    made.measure()
    for answer in (("Escape",), ("Tab", "Return")):  # Replace
        made.window.keys("ctrl+s")
        made.asked()
        if made.project.read_bytes() != theirs:
            raise LostError("a file of another program was replaced without a question")
        made.window.keys(*answer)
        made.asked(there=False)
    made.marked(changed=False)
    made.all_saved()


def saved_as(made: Attempt) -> None:
    name = made.chance.choice(NAMES)
    files = {path: path.read_bytes() for path in made.folder.rglob("*")
             if path.is_file() and not {"cache", "state"} & set(path.parts) and path.name != "window.log"}
    made.window.keys("ctrl+shift+s")
    time.sleep(2.0)
    made.window.keys("ctrl+a")
    made.window.xdo("type", "--delay", "12", "--", name)
    time.sleep(1.0 + len(name) / 10)
    made.window.xdo("key", "Return")
    time.sleep(2.0)
    out_of_dialogs(made)
    if any(not path.exists() or path.read_bytes() != data for path, data in files.items()):
        raise LostError(f"{name!r} replaced a file without a question")
    new = [path for path in made.folder.rglob("*.pointglass") if path not in files]
    made.project = new[0] if new else made.project
    if new:
        made.all_saved()
    unchanged(made, f"saved as {name!r}")


def chord_in_dialog(made: Attempt) -> None:
    made.window.keys("ctrl+shift+s")
    time.sleep(1.5)
    made.window.keys(made.chance.choice(["ctrl+z", "ctrl+s", "F12", "ctrl+y"]))
    time.sleep(1.5)
    out_of_dialogs(made)
    unchanged(made, "a chord in a dialog")


def broken_file_opened(made: Attempt) -> None:
    (made.folder / "broken.las").write_bytes(b"LASF" + bytes(400))
    made.window.keys("o")
    time.sleep(2.0)
    made.window.keys("ctrl+a")
    made.window.xdo("type", "--delay", "15", str(made.folder / "broken.las"))
    time.sleep(1.5)
    made.window.xdo("key", "Return")
    time.sleep(2.0)
    out_of_dialogs(made)
    unchanged(made, "a broken file")


# -- the end ---------------------------------------------------------------------------------------------------------


def saved_and_quit_at_once(made: Attempt) -> None:
    made.window.xdo("windowfocus", "--sync", made.window.window)
    made.window.xdo("key", "--delay", made.chance.choice([0, 5, 40]), "ctrl+s", "ctrl+q")
    if not made.waits(lambda: not made.alive, 15.0):  # Ctrl+Q was missed, or it asks
        made.window.keys("Return" if dimmed(made.window) else "ctrl+q")
    made.ended()
    made.all_saved()


def quit_saved(made: Attempt) -> None:
    ask = made.changed
    leave(made)
    if ask:
        made.asked()
        made.window.keys("Return")
    made.ended()
    made.all_saved()


def quit_discarded(made: Attempt) -> None:
    before, ask = made.saved, made.changed
    made.window.keys("ctrl+q")
    if ask:
        made.asked()
        made.window.keys("Tab", "Return")
    made.ended()
    if not alike(made.saved, before):
        raise LostError("Discard changed the project")


def signalled(made: Attempt) -> None:
    if made.changed and made.chance.random() < 0.4:
        made.window.keys("ctrl+q")
        made.asked()
    made.window.process.send_signal(made.chance.choice([signal.SIGTERM, signal.SIGINT, signal.SIGHUP]))
    made.ended()
    made.restored()


def killed(made: Attempt) -> None:
    time.sleep(1.5)
    made.window.process.kill()
    made.ended()
    if made.changed and made.chance.random() < 0.5:  # and again, after the first start
        made.open()
        made.asked()
        made.window.keys("Return")
        made.asked(there=False)
        made.measure()
        made.window.process.kill()
        made.ended()
    made.restored()


def killed_while_saving(made: Attempt) -> None:
    made.window.keys("ctrl+s")
    time.sleep(made.chance.choice([0.0, 0.02, 0.1, 0.3, 0.6]))
    made.window.process.kill()
    made.ended()
    made.restored()


def offered_later(made: Attempt) -> None:
    time.sleep(1.5)
    made.window.process.kill()
    made.ended()
    if made.changed:
        before = made.project.read_bytes() if made.project.exists() else None
        made.open()
        made.asked()
        made.window.keys("Tab", "Return")  # Later
        made.asked(there=False)
        made.window.keys("ctrl+q")
        made.ended()
        if (made.project.read_bytes() if made.project.exists() else None) != before:
            raise LostError("Later changed the project")
    made.restored()


MIDDLES = (noted, noted, quit_cancelled, saved_in_flight, undone_and_redone, many_keys, other_layout, project_deleted,
           folder_taken_away, written_by_another, saved_as, saved_as, chord_in_dialog, broken_file_opened)
ENDS = (saved_and_quit_at_once, quit_saved, quit_discarded, signalled, signalled, killed, killed_while_saving, offered_later)
