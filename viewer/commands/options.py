"""Options that several commands share: scans, settings, exposures, memory, logging; and the functions that read them."""

import argparse
import re
import sys
from collections.abc import Sequence
from difflib import get_close_matches
from itertools import pairwise
from pathlib import Path
from typing import NoReturn

from ..common.errors import InputError
from ..picture.settings import CHOICES, MEMORY, Memory, Settings
from ..readers.formats import KNOWN_FILES, KNOWN_FOLDERS, check_address, refuse_address

_SCANS = ("scans", "before", "after", "moving", "fixed", "tune", "data")
"""Arguments that name scans, which may be addresses."""
_VALUE = re.compile(r"-(?!-)")
"""What begins with one minus; two begin an option."""


class Parser(argparse.ArgumentParser):
    """Options may stand anywhere between file names.  Raises InputError for what it cannot parse."""

    _mixing = False

    def parse_known_args(self, args=None, namespace=None):  # pyright: ignore[reportIncompatibleMethodOverride]
        args = self._joined(args or ())
        # Only the parsers of single commands allow options between file names.  Names after "--" may begin with a dash, which
        # parse_known_intermixed_args does not support.
        if self._mixing or self._subparsers is not None or "--" in args:
            return super().parse_known_args(args, namespace)
        self._refuse_unknown(args)
        self._mixing = True
        try:
            return self.parse_known_intermixed_args(args, namespace)
        finally:
            self._mixing = False

    def parse_args(self, args=None, namespace=None):  # pyright: ignore[reportIncompatibleMethodOverride]
        _refuse_empty(args or ())
        found, left = self.parse_known_args(args, namespace)
        if left:
            command = getattr(found, "command", None)
            of = f"{self.prog} {command}" if command else self.prog
            raise InputError(f"unrecognized arguments: {' '.join(left)} (see `{of} --help`)")
        for name, value in vars(found).items():
            for path in value if isinstance(value, list) else [value]:
                if isinstance(path, Path):
                    (check_address if name in _SCANS else refuse_address)(path)
        return found

    def _joined(self, args: Sequence[str]) -> list[str]:
        """The arguments with every option joined to a value that begins with a minus, as --clip=-1,2: argparse would take such
        a value for an option.  What is an option of this command stays one."""
        joined: list[str] = []
        args = list(args)
        while args:
            arg = args.pop(0)
            if arg == "--":
                return [*joined, arg, *args]
            if args and self._takes_one_value(arg) and _VALUE.match(args[0]) and args[0] not in self._option_string_actions:
                arg = f"{arg}={args.pop(0)}"
            joined.append(arg)
        return joined

    def _takes_one_value(self, arg: str) -> bool:
        """Whether an argument is an option, or the beginning of one, that takes a value."""
        if not arg.startswith("--"):
            return False
        known = self._option_string_actions
        meant = {arg} & known.keys() or {option for option in known if option.startswith(arg)}
        actions = [known[option] for option in meant]
        return bool(actions) and all(action is actions[0] and action.nargs in (None, 1, "?") for action in actions)

    def _refuse_unknown(self, args) -> None:
        """Refuses a misspelt option before argparse complains that something else is missing."""
        known = self._option_string_actions
        for name in (arg.partition("=")[0] for arg in args if arg.startswith("--")):
            if not any(option.startswith(name) for option in known):
                meant = get_close_matches(name, known, 1, 0.7)
                self.error(f"unrecognized arguments: {name}{f', did you mean {meant[0]}?' if meant else ''}")

    def _print_message(self, message: str, file=None) -> None:
        """argparse's own ignores a full disk."""
        if message:
            (file or sys.stderr).write(message)

    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message} (see `{self.prog} --help`)")


def _refuse_empty(args: Sequence[str]) -> None:
    """Refuses empty arguments: an unset variable of a script would mean the present folder, or the default."""
    for before, arg in pairwise(("", *args)):
        option, equals, value = arg.partition("=")
        if not arg or (option.startswith("--") and equals and not value):
            name = option or (before if before.startswith("--") else "an argument")
            raise InputError(f"{name} is empty", remedy="give it a value, or leave it out")


def add_settings(parser: argparse.ArgumentParser, *, views: Sequence[str] = tuple(CHOICES["view"])) -> None:
    """The options of viewer.picture.settings.Settings, from its own tables.  views: those that --view offers; none: it is not
    added."""
    defaults = Settings()
    for name, table in CHOICES.items():
        if name == "view":
            table = {key: text for key, text in table.items() if key in views}
        if not table:
            continue
        texts = "; ".join(f"{key}: {text}" for key, text in table.items()).replace("%", "%%")
        default = getattr(defaults, name)
        texts += f" (default {default})"
        parser.add_argument(f"--{name.replace('_', '-')}", choices=list(table), default=default, help=texts)
    parser.add_argument("--filter-strength", type=float, default=defaults.filter_strength, metavar="X",
                        help="factor of the depth filter's tolerance; a smaller one keeps fewer points (default 1)")
    parser.add_argument("--filter-levels", type=int, metavar="N",
                        help="pyramid levels of the depth filter (default: the filter's own)")
    parser.add_argument("--lod", type=float, metavar="P", help="level of detail: draw about P points per pixel (default: every "
                        "point)")
    parser.add_argument("--detail", type=float, default=defaults.detail, metavar="X",
                        help="neural view: from 0 (smooth) to 2 (keep all measured detail, noise too); 1 follows the noise "
                             "estimated for the scan (default 1)")
    parser.add_argument("--photos", default=defaults.photos, metavar="auto|off|FOLDER",
                        help="colour surfaces of filled and neural pictures from photographs where these are finer than the "
                             "points: auto: the posed photographs of E57 files; FOLDER: those of a folder with transforms.json "
                             "or a COLMAP model, in the scan's coordinates; without these, where they were taken is searched "
                             "in the scan (default auto)")
    parser.add_argument("--weights", metavar="F", help="a weights file made by `train` (default: the shipped weights)")


def settings_of(options: argparse.Namespace) -> Settings:
    """The Settings of parsed options.  Raises InputError for a value out of range."""
    names = (*CHOICES, "filter_strength", "filter_levels", "lod", "detail", "weights", "photos")
    return Settings(**{name: getattr(options, name) for name in names if hasattr(options, name)})


def add_memory(parser: argparse.ArgumentParser) -> None:
    """The options of viewer.picture.settings.Memory."""
    parser.add_argument("--gpu-memory", metavar="SIZE",
                        help="GPU memory for points, such as 4G; a larger scan is streamed (default: chosen for the device)")
    parser.add_argument("--read-ahead", metavar="SIZE",
                        help=f"main memory for points prefetched for the GPU (default {MEMORY.read_ahead >> 20}M)")


_MEMORY = {"gpu": "gpu-memory", "read_ahead": "read-ahead"}


def memory_of(options: argparse.Namespace) -> Memory:
    """The Memory of parsed options.  Raises InputError for what is not a size."""
    from ..stream.residency import byte_count

    given = {"gpu": options.gpu_memory, "read_ahead": options.read_ahead}
    return Memory(**{name: byte_count(text, f"--{_MEMORY[name]}") for name, text in given.items() if text is not None})


def add_scans(parser: argparse.ArgumentParser, *, least: str = "+") -> None:
    """The scans and how to open them.  least: "+" one scan or more, "*" any number."""
    parser.add_argument("scans", nargs=least, type=Path, metavar="SCAN",
                        help=f"{KNOWN_FILES} files, {KNOWN_FOLDERS} folders, https:// and s3:// addresses of these, or a "
                             "folder made by `convert`; several are opened as one scene")
    parser.add_argument("--no-cache", action="store_true", help="build the grid in memory and do not keep it in the cache")
    add_columns(parser)


def add_columns(parser: argparse.ArgumentParser) -> None:
    """The columns of a text file."""
    parser.add_argument("--columns", metavar="C,C,...",
                        help="meaning of the columns of a text file: x, y, z, r, g, b, i (intensity), c (class) or - "
                             "(ignored), such as x,y,z,i,r,g,b,- (default: recognised from the values)")


def add_exposures(parser: argparse.ArgumentParser, default: str = "matched") -> None:
    """Exposure compensation."""
    parser.add_argument("--exposures", choices=["matched", "as-scanned"], default=default,
                        help="matched: compensate different exposures of scans of one place; as-scanned: colours as in the "
                             f"file (default {default})")


def add_logging(parser: argparse.ArgumentParser) -> None:
    """What is reported while the command runs (viewer.common.command_log)."""
    parser.add_argument("--verbose", action="store_true", help="report on standard error what is chosen and why")
    parser.add_argument("--log-file", type=Path, metavar="F", help="append a detailed log to this file")
