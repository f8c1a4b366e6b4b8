"""The part of the codec contract that is about coding and decoding frame by frame."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from mcz.codecs.base import Model


class LiveEncoder(Protocol):
    """Codes frames as they come, each into the one stream of a segment of one frame.

    ``header`` and ``models`` are known before the first frame. ``n_resolutions`` is 1, and there is
    one group.
    """

    header: bytes
    models: tuple[Model, ...]

    def push(
        self, values: NDArray[np.float64], valid: NDArray[np.bool_] | None = None
    ) -> tuple[bytes, bool]:
        """The stream of the next frame, (n_channels,), and whether its segment starts fresh."""
        ...

    def change(self, options: Mapping[str, Any]) -> None:
        """Let some parameters have new values as soon as the stream allows.

        Raises OptionError for one that cannot change.
        """
        ...


class LiveDecoder(Protocol):
    """The inverse: raises FormatError on bad bytes, and takes such a frame for one that was lost.

    A frame that needs a lost one raises LostFrameError; those that need none go on.
    """

    def push(self, stream: bytes, fresh: bool) -> NDArray[np.float64]:
        """The values of the next frame, (n_channels,)."""
        ...

    def skip(self, n_frames: int) -> None:
        """So many frames that were due did not come."""
        ...
