"""torch while it is being imported, as other threads see it.

SciPy asks of the arrays that it is given whether they are torch's: it looks for ``Tensor`` in ``sys.modules["torch"]``.  While
a thread imports torch, which takes a second or more, the module is there and the class is not, and SciPy raises AttributeError.
A window ended so: its network was loaded while a thread turned a photograph's pose with ``Rotation``.
"""

import importlib.machinery
import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from types import ModuleType


class _NoTensor:
    """Stands for torch.Tensor until torch sets it: nothing is one yet."""


class _TorchFinder(MetaPathFinder):
    """Finds torch where Python does, and gives its module the class before its code runs."""

    def find_spec(self, fullname: str, path: Sequence[str] | None,
                  target: ModuleType | None = None) -> importlib.machinery.ModuleSpec | None:
        if fullname != "torch":
            return None
        spec = importlib.machinery.PathFinder.find_spec(fullname, path, target)
        if spec is not None and spec.loader is not None:
            run = spec.loader.exec_module

            def exec_module(module: ModuleType) -> None:
                module.Tensor = _NoTensor  # type: ignore[attr-defined]
                run(module)

            spec.loader.exec_module = exec_module  # type: ignore[method-assign]
        return spec


def let_scipy_meet_torch() -> None:
    """From now on SciPy may be called on one thread while another imports torch.  A second call changes nothing."""
    if not any(isinstance(finder, _TorchFinder) for finder in sys.meta_path):
        sys.meta_path.insert(0, _TorchFinder())
