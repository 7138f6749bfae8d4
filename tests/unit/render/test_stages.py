"""Stage times: what a GPU that works on its own is said to have taken, without one."""

import pytest

from pointglass.viewer.render.stage_times import Stages


class Gpu:
    """A clock, and a GPU that begins a stage when the host has submitted it and the one before is done."""

    def __init__(self):
        self.now = self.done = self.last = 0.0
        self.made = 0
        self.extra = None

    def clock(self) -> float:
        return self.now

    def query(self, *, time: bool):
        assert time
        self.made += 1
        return Query(self)

    def finish(self) -> None:
        self.now = max(self.now, self.done)

    def work(self, host: float, device: float):
        """A stage: seconds on the host, and then on the device."""

        def run() -> None:
            self.now += host
            self.done = max(self.done, self.now) + device
            self.last = device

        return run


class Query:
    def __init__(self, gpu: Gpu):
        self._gpu, self._open = gpu, False

    def __enter__(self):
        self._open = True

    def __exit__(self, *_):
        self._open, self._spent, self._until = False, self._gpu.last, self._gpu.done

    @property
    def elapsed(self) -> float:
        assert not self._open
        self._gpu.now = max(self._gpu.now, self._until)  # waits
        return self._spent * 1e9


def frame(stages: Stages, gpu: Gpu, **work: tuple[float, float]):
    stages.begin()
    for name, (host, device) in work.items():
        with stages(name):
            gpu.work(host, device)()
    stages.end()
    return stages.times


@pytest.fixture
def gpu():
    return Gpu()


@pytest.fixture
def stages(gpu):
    return Stages(gpu, software=False, clock=gpu.clock)  # type: ignore[arg-type]


def test_the_whole_is_what_passed_until_the_pictures_were_there(stages, gpu):
    times = frame(stages, gpu, cull=(0.005, 0.0), raster=(0.025, 0.020))
    assert times.milliseconds() == pytest.approx({"cull": 5, "raster": 20})
    assert times.host == pytest.approx({"cull": 5, "raster": 25})
    assert times.total() == pytest.approx(50)  # and not 30, which is when the host was done
    times = frame(stages, gpu, raster=(0.001, 0.030), filter=(0.001, 0.010))
    assert times.milliseconds() == pytest.approx({"raster": 30, "filter": 10})
    assert times.total() == pytest.approx(41)


def test_asked_for_late_it_is_never_less_and_knows_no_idle_time(stages, gpu):
    times = frame(stages, gpu, raster=(0.010, 0.020), filter=(0.015, 0.005))
    took = gpu.done * 1e3
    gpu.now += 3600.0
    assert took == pytest.approx(35) and took <= times.total() <= 25 + 25 + 1e-6


def test_a_frame_can_be_asked_while_the_next_is_being_made(stages, gpu):
    first = frame(stages, gpu, raster=(0.001, 0.010))
    second = frame(stages, gpu, raster=(0.001, 0.020))
    third = frame(stages, gpu, raster=(0.001, 0.030))
    told = [times.milliseconds()["raster"] for times in (first, second, third)]
    assert told == pytest.approx([10, 20, 30]) and gpu.made == 2


def test_work_elsewhere_tells_its_own_time(stages, gpu):
    def told() -> float:
        gpu.now += 0.0125
        return 12.5

    stages.begin()
    with stages("network") as stage:
        stage.elapsed = told
    stages.end()
    assert stages.times.milliseconds() == {"network": 12.5} and stages.times.total() == pytest.approx(12.5)


def test_a_stage_that_failed_ends_its_query_and_has_no_time(stages, gpu):
    stages.begin()
    with pytest.raises(ValueError, match="a bug"), stages("fill"):
        gpu.work(0.0, 0.001)()
        raise ValueError("a bug")
    with stages("fill"):
        gpu.work(0.0, 0.002)()
    stages.end()
    assert stages.times.milliseconds() == pytest.approx({"fill": 2}) and gpu.made == 1


def test_queries_are_left_to_the_next_renderer(stages, gpu):
    frame(stages, gpu, raster=(0.0, 0.001), filter=(0.0, 0.001))
    stages.release()
    frame(Stages(gpu, software=False, clock=gpu.clock), gpu, raster=(0.0, 0.001))  # type: ignore[arg-type]
    assert gpu.made == 2


def test_in_software_each_stage_is_finished_and_the_clock_counts(gpu):
    times = frame(Stages(gpu, software=True, clock=gpu.clock), gpu, cull=(0.002, 0.0), raster=(0.001, 0.010))  # type: ignore[arg-type]
    assert times.milliseconds() == pytest.approx({"cull": 2, "raster": 11}) and times.total() == pytest.approx(13)
    assert gpu.made == 0
