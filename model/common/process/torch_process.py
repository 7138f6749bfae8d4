"""Process-wide settings for running or training networks.

Commands and :mod:`pointglass` call these functions once torch is about to be used; no class of ``model`` does, because the
settings outlive it and affect every other user of torch in the process.  Each function imports torch, so a command that needs
no network must not call it.

Without :func:`prepare_inference` a network gives the same pictures, but slower: memory is cleared anew for each picture (16 to
20 % of the network's time on two cores, see :mod:`model.common.process.memory`), and torch may use fewer threads than there are
processors.  Only fp32 networks on CUDA then differ, because cuDNN may round their inputs to TF32.
"""

import logging
import os
import sys

from .memory import keep_freed_memory
from .processors import usable_processors

_log = logging.getLogger(__name__)


_SPINS = "20000"
"""Rounds that OpenMP's threads wait for more work before they sleep, a fifth of a millisecond and less.  GNU's own are 300,000,
during which a processor is taken from the loops between the convolutions: at 960x720 on two cores the fast network's picture
took 45 ms, and takes 39; in a sparse view 72 and 60."""


def prepare_inference() -> None:
    """Keeps freed memory for the next picture, uses all processors, and computes fp32 on CUDA in fp32 (10 bits of fraction, as
    TF32 has, are not called exact).  Where torch is not imported yet, its threads wait for a short time only."""
    if "torch" not in sys.modules:  # OpenMP reads it when it is loaded
        os.environ.setdefault("GOMP_SPINCOUNT", _SPINS)
    import torch

    _keep_memory()
    torch.set_num_threads(usable_processors())
    torch.backends.cudnn.allow_tf32 = False


def prepare_training() -> None:
    """Keeps freed memory for the next step, and lets CUDA multiply fp32 as TF32.  The number of threads stays torch's own."""
    import torch

    _keep_memory()
    torch.backends.cuda.matmul.allow_tf32 = torch.backends.cudnn.allow_tf32 = True


def _keep_memory() -> None:
    if not keep_freed_memory():
        _log.info("this C library cannot keep freed memory: networks on the CPU run slower")
