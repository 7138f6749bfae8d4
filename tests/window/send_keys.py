"""Sends keys to the focused window through XTEST: ``python send_keys.py PAUSE_LOW PAUSE_HIGH SEED KEYSYM...``.

Prints, one a line, the second of CLOCK_MONOTONIC (``time.perf_counter``) at which each key was pressed."""

import ctypes
import random
import sys
import time


def main(low: float, high: float, seed: int, keys: list[str]) -> None:
    x, xtest = ctypes.CDLL("libX11.so.6"), ctypes.CDLL("libXtst.so.6")
    x.XOpenDisplay.restype = ctypes.c_void_p
    x.XStringToKeysym.restype = ctypes.c_ulong
    display = ctypes.c_void_p(x.XOpenDisplay(None))
    assert display, "no X server"
    rng = random.Random(seed)
    for key in keys:
        time.sleep(rng.uniform(low, high))
        code = x.XKeysymToKeycode(display, ctypes.c_ulong(x.XStringToKeysym(key.encode())))
        at = time.perf_counter()
        for down in (1, 0):
            xtest.XTestFakeKeyEvent(display, code, down, ctypes.c_ulong(0))
            x.XFlush(display)
        print(at, flush=True)
    x.XCloseDisplay(display)


if __name__ == "__main__":
    main(float(sys.argv[1]), float(sys.argv[2]), int(sys.argv[3]), sys.argv[4:])
