"""``python -m pointglass.viewer`` is ``pointglass``: takes charge of Ctrl-C and SIGTERM, then starts the command line."""

import gc
from typing import NoReturn

from ..model.common.process.signals import stop_at_once
from .common.limited_memory import run_in_child_where_limited


def main() -> NoReturn:
    """Runs the command line and ends the process with its exit code."""
    run_in_child_where_limited()
    stop_at_once()  # before anything slow is imported
    gc.disable()  # a tenth of a start would go into collecting what imports make; viewer.cli turns it on again
    from ..model.common.process.background_threads import leave
    from .cli import main as run

    try:
        code = run()
    except SystemExit as error:  # --help, --version
        code = error.code if isinstance(error.code, int) else 0
    leave(code)


if __name__ == "__main__":
    main()
