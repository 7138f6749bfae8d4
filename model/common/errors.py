"""The base class of every anticipated failure, shared by ``model`` and ``viewer``: data, put into words in one place.

Who acts on a failure reads its fields (``file``, ``option``, ``value``, ``problem``, ``remedy``); nobody takes a message apart.
An option inside a sentence is an :class:`Option`, so that the Python interface can name its own argument there.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from .printable import printable

INSTALL_LAB = "pip install 'pointglass[lab]'"
"""Installs the libraries that only training and the evaluation of rooms use."""


@dataclass(frozen=True)
class Option:
    """An option of the command line that a message names.  choice: one of its fixed choices that the message names with it."""

    name: str
    choice: str | None = None

    def __str__(self) -> str:
        return self.name if self.choice is None else f"{self.name} {self.choice}"


Words = str | tuple["str | Option | PointglassError", ...]
"""A part of a sentence; in a tuple beside the options and the errors that it names."""
Naming = Callable[[Option], str]
"""How options are called: ``str`` on the command line."""


class PointglassError(Exception):
    """A failure that is reported to the user in one line.

    ``str(error)`` is that line, printable: ``{file}: {option} {value}: {problem}; {remedy}``, of which only the problem is
    always there.  ``exit_code`` is the exit code of the process.  Any other exception is a bug and keeps its traceback.

    problem: what is wrong.  file: the file or folder that it is wrong with.  option: the option or setting that has a value it
    cannot have, as the command line calls it.  value: that value; a path is shown as it is, anything else as in Python.
    remedy: what helps.
    """

    exit_code = 2
    _named: Naming = str

    def __init__(self, problem: Words = "", *, file: Path | str | None = None, option: Option | str | None = None,
                 value: object = ..., remedy: Words | None = None):  # fmt: skip
        self.problem, self.file, self.option, self.value, self.remedy = problem, file, option, value, remedy
        super().__init__(self.words())

    def words(self, named: Naming | None = None) -> str:
        """The line, not yet made printable.  named: how options are called, None: as by name_options."""
        named = named or self._named
        remedy = "" if self.remedy is None else f"; {_joined(self.remedy, named)}"
        return f"{self.subject(named)}{_joined(self.problem, named)}{remedy}"

    def subject(self, named: Naming | None = None) -> str:
        """What the line begins with, the file and the option with a colon behind each; "" where neither is known."""
        file = "" if self.file is None else f"{self.file}: "
        if self.option is None:
            return file
        option = (named or self._named)(self.option if isinstance(self.option, Option) else Option(self.option))
        shown = "" if self.value is ... else f" {self.value if isinstance(self.value, Path) else repr(self.value)}"
        return f"{file}{option}{shown}: "

    def name_options(self, named: Naming) -> None:
        """From now on the line calls options as ``named`` does (a function of a module: errors are pickled)."""
        self._named = named
        self.args = (self.words(), *self.args[1:])

    def is_of(self, path: Path) -> bool:
        """Whether it is about ``path``, or about a file in that folder.  A file told by its name alone is any of that name."""
        if self.file is None:
            return False
        file = Path(self.file)
        return path == file or path in file.parents or str(file) == path.name

    def __str__(self) -> str:
        return printable(self.words())

    def __reduce__(self):
        """Errors cross processes: all fields, of classes whose arguments are others, too."""
        return _restored, (type(self), self.args), self.__dict__


class DataError(PointglassError):
    """Data for training or evaluation that cannot be used; the message names the files and the remedy."""


def _joined(words: Words, named: Naming) -> str:
    if isinstance(words, str):
        return words
    return "".join(part if isinstance(part, str) else named(part) if isinstance(part, Option) else part.words(named)
                   for part in words)  # fmt: skip


def _restored(kind: type[PointglassError], args: tuple) -> PointglassError:
    error = kind.__new__(kind)
    error.args = args
    return error
