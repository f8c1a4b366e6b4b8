"""Frames and channels of a clip: how many there are, and which ranges of frames are among them."""

from __future__ import annotations

import operator

from mcz.errors import OptionError


class Extent:
    """The length and the shape of a Clip, and the check of ranges of its frames."""

    name: str
    n_frames: int

    @property
    def n_channels(self) -> int:
        """Channels of the motion signal."""
        raise NotImplementedError

    def __len__(self) -> int:
        """The number of frames."""
        return self.n_frames

    def __bool__(self) -> bool:
        """True: a clip without frames is a clip, too."""
        return True

    @property
    def shape(self) -> tuple[int, int]:
        """(n_frames, n_channels) of the motion signal."""
        return self.n_frames, self.n_channels

    def checked_range(self, frames: tuple[int, int] | None) -> tuple[int, int]:
        """``frames``, or all; raises OptionError where they are not in the clip."""
        if frames is None:
            return 0, self.n_frames
        try:
            start, stop = map(operator.index, frames)
        except (TypeError, ValueError):
            raise OptionError(f"frames {frames!r}: not two integers, first and end") from None
        if not 0 <= start <= stop <= self.n_frames:
            raise OptionError(
                f"clip {self.name!r} has frames 0 to {self.n_frames}, not {start}:{stop}"
            )
        return start, stop
