"""The README's first figures, a line each, from the same bench files as its tables."""

from typing import Any

NEEDED = {"frame-plant_room", "frame-plant_room-fast", "versus-plant_room", "evaluate", "scale", "open-procedural", "stability"}
_NETWORK, _FILLED, _PAPER = "network balanced-filtered", "pull-push, our filter, stations weighed", "pull-push, paper's filter"


def _judged(found: dict[str, Any], method: str) -> str:
    """PSNR and distance of one way of making a picture, of every point and with the exposures a scan is opened with."""
    row = next(r for r in found["rows"] if (r["method"], r["exposure"], r["density"]) == (method, "matched", 1.0))
    return f"{row['psnr']:.1f} dB, distance {row['distance']:.3f}"


def _median(found: dict[str, Any], view: str) -> float:
    return found["runs"][0]["views"][view]["total"]["p50"]


def glance(files: dict[str, dict]) -> str:
    """What a frame takes, what its picture is worth, how large a scan may be, what holds under stress."""
    frame, fast, opened = (files[name] for name in ("frame-plant_room", "frame-plant_room-fast", "open-procedural"))
    machine, size = frame["machine"], "{}x{}".format(*frame["runs"][0]["size"])
    cores = f"{machine['cores']} cores of an {machine['processor']}"
    where = f"on {cores} without a GPU" if frame.get("software", True) else f"on {frame['opengl']}"
    rivals = files["versus-plant_room"]["runs"][0]["contenders"]
    paper, ours = (rivals[who]["milliseconds"]["total"]["p50"] for who in ("paper, as published", "ours, balanced"))
    neural, filled, averaged = (_judged(files["evaluate"], method) for method in (_NETWORK, _FILLED, _PAPER))
    first = opened["milliseconds"]["cache to first picture"] / 1e3
    grown = files["scale"]["growth"]["rooms"]
    claims = [row["ok"] for row in files["stability"]["rows"] if "skipped" not in row]
    return "\n".join([
        f"Measured {where} (all of it under [Figures](#figures)):", "",
        f"- A neural frame of {frame['points'] / 1e6:.1f} M points at {size} takes **{_median(frame, 'neural'):.0f} ms** "
        f"(`--quality fast`: {_median(fast, 'neural'):.0f}), a filtered one {_median(frame, 'filtered'):.0f}.",
        f"- The paper's pipeline takes **{paper / ours:.1f} times** as long in the same run.",
        f"- A room that it never learned from, against the truth: **{neural}**. The same points filtered and filled, without "
        f"the network: {filled}; by the paper's filter and its averaging: {averaged}.",
        f"- {opened['points'] / 1e6:.0f} M points opened again are on the screen in {first:.2f} s.",
        f"- Inside a building of {grown['to'] / 1e6:,.0f} M points a neural frame takes {grown['neural']:.2f} times as long as "
        f"in one of {grown['from'] / 1e6:,.0f} M.",
        f"- {sum(claims)} of {len(claims)} claims about numerical stability hold.",
    ])
