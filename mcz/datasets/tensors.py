"""A data set as PyTorch wants it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mcz.errors import OptionError

if TYPE_CHECKING:
    from mcz.datasets.dataset import Dataset

Tensors = Any  # a torch.utils.data.Dataset, which is not there to be named without torch


def tensors(dataset: Dataset) -> Tensors:
    """A ``torch.utils.data.Dataset``: an item is a dict of tensors, (window, ...).

    Its ``batches`` are those of ``dataset`` as tensors. Raises OptionError without PyTorch.
    """
    try:
        from mcz.datasets.torch_dataset import TorchDataset
    except ImportError as error:
        raise OptionError(f"PyTorch is not installed (pip install 'mcz[torch]'): {error}") from None
    return TorchDataset(dataset)
