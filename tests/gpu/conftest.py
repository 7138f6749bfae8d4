"""One headless context and its programs for the GPU tests, each skipped with its reason where there is no GPU."""

import pytest
from needs import absent

from pointglass.model.network.reconstruct import cuda_problem
from pointglass.viewer.common.errors import DeviceError


@pytest.fixture(scope="session")
def cuda():
    """CUDA works."""
    if problem := cuda_problem():
        absent(f"no CUDA here: {problem}")


@pytest.fixture(scope="session")
def programs(cuda):
    """Programs of an OpenGL context on the GPU that CUDA uses."""
    from pointglass.viewer.render.device.context import create_context, describe_device
    from pointglass.viewer.render.device.shader import Programs

    try:
        context = create_context()
    except DeviceError as error:
        absent(str(error))
        raise
    if describe_device(context).software:
        absent(f"OpenGL runs on the processor: {describe_device(context).renderer}")
    made = Programs(context)
    yield made
    made.release()
    context.release()


def pytest_runtest_logreport(report):
    """What failed is told at once, not only at an end that a test which hangs would keep from coming."""
    if report.failed:
        print(f"\n{report.nodeid} ({report.when}):\n{report.longreprtext}", flush=True)
