"""Warns where files that are shown in one frame differ in units or reference system."""

from collections.abc import Sequence

from ..preprocess.scan_description import ScanWarning, WarningTopic


def differences(files: Sequence[tuple[float | None, str | None]]) -> list[ScanWarning]:
    """A warning where files differ, else none.  files: of each the metres of a unit and the reference system, None where
    they are not known."""
    units = {metres for metres, _ in files}
    if len(units - {None}) > 1:
        return [ScanWarning("units of length; they are shown as if they agreed", WarningTopic.DIFFERENT)]
    if len(units) > 1:
        return [ScanWarning("unit of length; they are shown as if it were the same", WarningTopic.PARTLY_UNKNOWN)]
    if len({crs for _, crs in files}) > 1:
        return [ScanWarning("coordinate reference system; they are shown as if they agreed", WarningTopic.DIFFERENT)]
    return []
