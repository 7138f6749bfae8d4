"""Compiled loops: numba's njit, kept on disk between runs where there is a folder for it."""

from numba import njit


def compiled(**options):
    """njit, kept on disk between runs where numba finds a folder it can write to: an installation may be read-only."""

    def decorate(function):
        try:
            return njit(cache=True, **options)(function)
        except RuntimeError:
            return njit(**options)(function)

    return decorate
