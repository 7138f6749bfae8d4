"""Networks that settings ask for: which are there, which may stand in for them in flight, and their loading."""

from functools import cache

from ....model.network.qualities import QUALITIES, stand_ins
from ....model.network.weights_folder import weights_file
from ...picture.settings import Settings


@cache
def _is_shipped(quality: str, filtered: bool) -> bool:
    """Whether a quality's weights are there; asked in each turn of the window, and the same as long as the program runs."""
    return weights_file(quality, filtered=filtered).is_file()


def network_key(settings: Settings) -> tuple:
    """The settings that decide which network is used."""
    return settings.quality, settings.filter != "off", settings.weights, settings.precision, settings.device


def smaller_networks(settings: Settings) -> tuple[str, ...]:
    """Qualities whose networks may stand in for that of ``settings`` while the camera moves, the largest first: those shipped
    for the same input; none for a person's own weights."""
    if settings.weights is not None:
        return ()
    filtered = settings.filter != "off"
    return tuple(name for name in stand_ins(settings.quality) if _is_shipped(name, filtered))


def load_network(settings: Settings) -> None:
    """Imports torch and reads the weights, also those of smaller networks for flight, off the window's thread, so that the
    first neural frame only has to run."""
    from ....model.common.process.torch_process import prepare_inference

    prepare_inference()  # before torch is imported
    from ....model.network.reconstruct import cuda_problem
    from ...common.errors import DeviceError, Option
    from ...render.network import neural

    problem = None if settings.device == "cpu" else cuda_problem()
    if settings.device == "cuda" and problem:
        raise DeviceError(problem, option=Option("--device", "cuda"), remedy="see `pointglass doctor`, or use the CPU")
    device = "cpu" if settings.device == "cpu" or problem else "cuda"
    for quality in (settings.quality, *smaller_networks(settings)):
        neural.load_network(quality, settings.filter != "off", settings.weights, settings.precision, device)


def missing_qualities(settings: Settings) -> dict[str, str]:
    """Qualities without weights -> the reason."""
    if settings.weights is not None:
        return {}
    files = {quality: weights_file(quality, filtered=settings.filter != "off") for quality in QUALITIES}
    return {
        quality: f"No weights of this network are shipped ({path.name})."
        for quality, path in files.items() if not path.is_file()
    }  # fmt: skip
