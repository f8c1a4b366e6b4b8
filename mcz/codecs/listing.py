"""JSON documents about codecs and their parameters."""

from __future__ import annotations

import re

from mcz.codecs.contract import Codec
from mcz.codecs.parameters import TARGETS, Parameter
from mcz.model.types import Settings

DEFAULT_IN_HELP = re.compile("(.+); default:? (.+)")  # of what a preset or the clip decides


def codec_document(codec: Codec) -> Settings:
    """Entry of a codec in ``mcz codecs --json``; its keys are stable."""
    return {
        "name": codec.name,
        "id": codec.id,
        "preset": codec.preset,
        "version": codec.version,
        "lossless": codec.lossless,
        "positions": codec.positions,
        "live": codec.live is not None,
        "quality": codec.dial.parameter if codec.dial else None,
        "parameters": [parameter_document(parameter) for parameter in parameters_of(codec)],
    }


def parameters_of(codec: Codec) -> tuple[Parameter, ...]:
    """Public parameters of a codec, plus the targets if it has a dial."""
    return (*(p for p in codec.parameters if not p.inner), *(TARGETS if codec.dial else ()))


def parameter_document(parameter: Parameter) -> Settings:
    """Name, default, range and meaning of a parameter."""
    match = DEFAULT_IN_HELP.fullmatch(parameter.help)
    decided, meaning = (match[2], match[1]) if match else (None, parameter.help)
    return {
        "name": parameter.name,
        "default": decided if parameter.default is None else parameter.default,
        "range": parameter.range,
        "meaning": meaning,
    }
