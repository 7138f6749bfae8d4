"""The first page of a GPU run: each promise, its figure, and whether it is kept.  Plain functions of results.json.

Imports nothing beyond Python's own library.
"""

from collections.abc import Callable
from dataclasses import dataclass

PASS, FAIL, UNJUDGED = "pass", "FAIL", "not judged"
PAPER = "paper, as published"  # the name that `pointglass bench versus` gives it


@dataclass(frozen=True)
class Verdict:
    """figure: for a person.  state: PASS, FAIL or UNJUDGED.  why: of what could not be judged."""

    figure: str
    state: str
    why: str = ""


@dataclass(frozen=True)
class Promise:
    """text: the claim.  judge: from the results of all parts, by name; raises KeyError, IndexError or TypeError where a figure
    is missing.  needs_gpu: on a CPU its figure is shown and not judged."""

    text: str
    judge: Callable[[dict], Verdict]
    needs_gpu: bool = True


def _limit(figure: str, kept: bool) -> Verdict:
    return Verdict(figure, PASS if kept else FAIL)


def _frame_rate(parts: dict) -> Verdict:
    run = parts["frame-1"]["runs"][0]
    total = run["views"]["neural"]["total"]
    rate = total.get("in_a_row_fps") or 1e3 / total["p50"]
    return _limit(f"{rate:.1f} frames/s at {run['size'][0]}x{run['size'][1]} (p50 {total['p50']:.2f} ms)", rate >= 120)


def _against(least: float) -> Callable[[dict], Verdict]:
    def judge(parts: dict) -> Verdict:
        run = parts["versus"]["runs"][-1]
        if not run["fairness"]["fair"]:
            return Verdict(f"{run['ratios']['ours, balanced'][PAPER]:.2f}x", UNJUDGED, "the opponent is not a fair one")
        ratio = run["ratios"]["ours, balanced"][PAPER]
        return _limit(f"{ratio:.2f}x at {run['size'][0]}x{run['size'][1]}", ratio >= least)

    return judge


def _fair(parts: dict) -> Verdict:
    fairness = parts["versus"]["runs"][-1]["fairness"]
    return _limit(f"{fairness['share_of_matmul']:.0%} of {fairness['matmul_rate'] / 1e12:.1f} TFLOP/s", fairness["fair"])


def _projected(parts: dict) -> Verdict:
    most = parts["projected"]["most"]
    return _limit(f"{most['ms_per_100M']:.2f} ms for 100M points ({most['points']:,} drawn in {most['raster_ms']:.2f} ms)",
                  most["ms_per_100M"] <= 5.0)


def _flat(parts: dict) -> Verdict:
    worst, to, start = 0.0, 0, 0
    for found in parts["scale"]["growth"].values():
        start = found["from"]
        worst = max(worst, *(value for key, value in found.items() if key not in ("from", "to")))
        to = max(to, found["to"])
    figure = f"{worst:.2f}x from {start:,.0f} to {to:,.0f} points"
    if worst > 1.3:
        return Verdict(figure, FAIL)
    if to < 1e9:
        return Verdict(figure, UNJUDGED, "1G points take longer to make than this run lasts")
    return Verdict(figure, PASS)


def _tests(*names: str) -> Callable[[dict], Verdict]:
    """All cases of these tests, of the parts ``tests`` and ``pictures``; none named: every case."""

    def judge(parts: dict) -> Verdict:
        cases = {**parts["tests"]["cases"], **(parts.get("pictures") or {"cases": {}})["cases"]}
        states = [state for name, state in cases.items() if not names or any(part in name for part in names)]
        counts = {state: states.count(state) for state in ("passed", "failed", "skipped")}
        if counts["failed"]:
            broken = [name for name, state in cases.items() if state == "failed"]
            return Verdict(f"{counts['failed']} of {len(states)} fail, first {broken[0]}", FAIL)
        if not counts["passed"]:
            return Verdict(f"{counts['skipped']} skipped", UNJUDGED, "none of its tests ran")
        return Verdict(f"{counts['passed']} of {len(states)} pass", PASS)

    return judge


def _growth(parts: dict) -> Verdict:
    found = parts["growth"]
    grown = max(found["main_bytes"], found["gpu_bytes"] or 0)
    figure = f"{grown / 2**20:.1f} MiB more after {found['frames']:,} frames"
    if grown > found["allowed_bytes"]:
        return Verdict(figure, FAIL)
    return Verdict(figure, PASS) if found["frames"] >= 10_000 else Verdict(figure, UNJUDGED, "fewer than 10,000 frames")


def _agreement(parts: dict) -> Verdict:
    found = parts["agreement"]
    worst = max(found["shares"].values())
    following = max(found["following"].values())
    return _limit(f"rasterisers differ in {worst:.3%} of pixels ({found['tolerance']:.3%} allowed), the float64 reference in "
                  f"{following:.2%} ({found['following_tolerance']:.1%})",
                  worst <= found["tolerance"] and following <= found["following_tolerance"])


PROMISES = (
    Promise("1920x1440 neural, 25M points: 120 frames/s or more", _frame_rate),
    Promise("3x the published pipeline, same run", _against(3.0)),
    Promise("8x the published pipeline, same run", _against(8.0)),
    Promise("The published pipeline reaches 40 % of the measured matrix rate", _fair),
    Promise("At no worse a distance than the published network",
            lambda parts: Verdict("-", UNJUDGED, "its weights are not public; see model/README.md for pictures")),
    Promise("100M points projected in 5 ms", _projected),
    Promise("Frame time flat within 1.3x from 10M to 1G points", _flat),
    Promise("10,000 frames without growth", _growth),
    Promise("CUDA mapping bit-equal to read-back", _tests("test_mapped_and_copied", "test_pictures_are_equal_to_read_back")),
    Promise("Both rasterisers and the float64 reference agree within the stated tolerance", _agreement, needs_gpu=False),
    Promise("GPU tests and picture tests", _tests()),
)


def verdicts(results: dict) -> list[tuple[Promise, Verdict]]:
    """Every promise with its verdict.  results: as in results.json."""
    parts = {name: held["result"] for name, held in results["parts"].items()}
    cuda = not results["plan"]["small"]
    found = []
    for promise in PROMISES:
        try:
            verdict = promise.judge(parts)
        except (KeyError, IndexError, TypeError, StopIteration, ValueError):
            verdict = Verdict("-", UNJUDGED, "its part left no figure")
        if promise.needs_gpu and not cuda:
            verdict = Verdict(verdict.figure, UNJUDGED, "no CUDA")
        found.append((promise, verdict))
    return found


def page(results: dict) -> str:
    """PAGE.md: what a person reads in a minute."""
    machine, plan = results["machine"], results["plan"]
    judged = verdicts(results)
    counts = {state: sum(verdict.state == state for _, verdict in judged) for state in (PASS, FAIL, UNJUDGED)}
    lines = [
        "# pointglass on a GPU", "",
        f"{machine['gpu'] or 'no GPU'}; {machine['system']}; Python {machine['python']}; {plan['points']:,} points.",
        f"**{counts[PASS]} kept, {counts[FAIL]} broken, {counts[UNJUDGED]} not judged.**", "",
        "| promise | figure | verdict |", "|---|---|---|",
    ]
    for promise, verdict in judged:
        why = f": {verdict.why}" if verdict.why else ""
        lines.append(f"| {promise.text} | {verdict.figure} | {verdict.state}{why} |")
    lines += ["", "| part | seconds | state |", "|---|---|---|"]
    lines += [f"| {name} | {held['seconds']:.0f} | {held['said']} |" for name, held in results["parts"].items()]
    lines += ["", *_remarks(results), "", "Figures: results.json; output of every part: log.txt."]
    return "\n".join(lines) + "\n"


def _remarks(results: dict) -> list[str]:
    """What the doctor says of the device, and the fastest workgroup shape."""
    parts = {name: held["result"] for name, held in results["parts"].items()}
    said = []
    doctor = parts.get("doctor")
    for item in doctor["items"] if isinstance(doctor, dict) else []:
        if item["name"] in ("OpenGL", "GPU memory", "CUDA", "interop"):
            said.append(f"- {item['name']}: {item['value']}")
    shapes = (parts.get("workgroups") or {}).get("rows") or []
    if shapes:
        best = min(shapes, key=lambda row: row["raster_ms"])
        times = ", ".join(f"{row['workgroup']} {row['raster_ms']:.2f} ms" for row in shapes)
        said.append(f"- Workgroups, lanes x batches: {times}; fastest {best['workgroup']}")
    return said
