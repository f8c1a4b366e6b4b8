"""Display of motions in notebooks, by the player that ``mcz`` registers.

A module apart from ``motion``, since ``import mcz`` loads it and must not wait for numpy.
"""

from __future__ import annotations

from collections.abc import Callable

Player = Callable[[object], str]

_players: list[Player] = []


def register_player(player: Player) -> None:
    """Register ``player``, which returns HTML of a motion."""
    _players[:] = [player]


def html_of(motion: object) -> str | None:
    """Return HTML of a Motion or Clip; None, for which a notebook prints text, without a player."""
    return _players[0](motion) if _players else None
