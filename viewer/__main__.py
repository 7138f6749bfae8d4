"""``python -m pointglass.viewer`` is ``pointglass``: starts the command line; handles Ctrl-C and SIGTERM during its import."""

import gc
import signal
import sys


def main() -> int:
    """Runs the command line and returns its exit code."""
    gc.disable()  # a tenth of a start would go into collecting what imports make; viewer.cli turns it on again
    if signal.getsignal(signal.SIGTERM) == signal.SIG_DFL:  # a scheduler, `timeout`, a container that is stopped
        signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        from ..model.common.signals import importing

        with importing():
            from .cli import main as run

        code = run()
    except KeyboardInterrupt:
        print("pointglass: stopped", file=sys.stderr)
        code = 130
    from ..model.common.background_threads import leave

    return leave(code)


if __name__ == "__main__":
    sys.exit(main())
