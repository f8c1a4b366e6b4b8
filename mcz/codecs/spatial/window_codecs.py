"""Codec 20: the presets ``lsdt-clip``, ``mdtt`` and ``pca-rdo``, transforms of windows of frames.

SPEC.md, "Codec 20: lsdt-clip", is normative; ``windows.py`` has the decoder, this file the
encoders' choices. Sources:

- ``lsdt-clip``: cosines in time, a learned basis in space. J. Hou, L.-P. Chau, N.
Magnenat-Thalmann, Y. He, Low-latency compression of mocap data using learned spatial decorrelation
transform, 2016, section 3.2. - ``mdtt``: cosines in time, the clip's own basis in space, of low
rank. The same authors, Human motion capture data tailored transform coding, 2015, as described in
their paper of 2016, section 5.4.1. - ``pca-rdo``: principal components of poses, and of their
courses in windows. L. Vasa, G. Brunnett, Rate-distortion optimized compression of motion capture
data, 2014, as Hou 2016 describes it in sections 2.1 and 5.4.2.

Exactness: lossy; decoding is bit-exact (integers, then binary64 sums in the order that SPEC.md
states). Windows decode independently; their length is the delay. Means, bases and courses of a clip
are in the file, as a model.
"""

from __future__ import annotations

from mcz.codecs import space_choices
from mcz.codecs.contract import Encoded, SignalSource
from mcz.codecs.parameters import preset_parameter, preset_values
from mcz.codecs.segments import SEGMENT_FRAMES_PARAMETER
from mcz.codecs.spatial import windows
from mcz.codecs.spatial.window_choices import THRESHOLD, parameters_of, plan_of, window_options
from mcz.model.types import Params, Settings


def _presets(window: int, threshold: float) -> dict[str, Settings]:
    return {
        "default": {"window": window, "threshold": threshold, "coder": "mixed"},
        "hou2016": {"window": window, "threshold": 0.5, "coder": "prefix"},
    }


LSDT_CLIP_PRESETS = _presets(240, space_choices.THRESHOLD)
MDTT_PRESETS = _presets(240, THRESHOLD)
PCA_RDO_PRESETS = _presets(120, THRESHOLD)


def encode_lsdt_clip(source: SignalSource, params: Params) -> Encoded:
    """Encode the values of ``source``; invalid values are interpolated.

    Raises MotionError for a value that is not finite, or is too large.
    """
    name, chosen = "lsdt-clip", preset_values(LSDT_CLIP_PRESETS, params)
    sample = space_choices.sample_of(name, source)
    step = params["step"] or space_choices.default_step(sample)
    space = space_choices.choose_space(name, sample, step, params["basis"], space_choices.cosines)
    plan = windows.Plan(
        chosen["window"],
        chosen["window"],
        space.fields,
        space.models,
        space.known,
        chosen["threshold"],
        params["segment_frames"] or 0,
        chosen["coder"] == "prefix",
    )
    return windows.encode(name, source, plan)


def encode_mdtt(source: SignalSource, params: Params) -> Encoded:
    """Encode as ``encode_lsdt_clip``, in space with bases fitted to this clip."""
    sample = space_choices.sample_of("mdtt", source)
    step = params["step"] or space_choices.default_step(sample)
    options = window_options(params, preset_values(MDTT_PRESETS, params), step)
    plan = plan_of("mdtt", source, sample, options, apart=sample.apart, mean=False, courses=False)
    return windows.encode("mdtt", source, plan)


def encode_pca_rdo(source: SignalSource, params: Params) -> Encoded:
    """Encode as ``encode_lsdt_clip``, with a mean, components and courses fitted to this clip."""
    sample = space_choices.sample_of("pca-rdo", source)
    step = params["step"] or space_choices.default_step(sample)
    options = window_options(params, preset_values(PCA_RDO_PRESETS, params), step)
    plan = plan_of("pca-rdo", source, sample, options, apart=False, mean=True, courses=True)
    return windows.encode("pca-rdo", source, plan)


LSDT_CLIP = windows.BITSTREAM(
    preset=1,
    name="lsdt-clip",
    encode=encode_lsdt_clip,
    parameters=(
        preset_parameter(LSDT_CLIP_PRESETS),
        space_choices.STEP,
        space_choices.WINDOW,
        space_choices.THRESHOLD_PARAMETER,
        space_choices.BASIS,
        space_choices.CODER,
        space_choices.DOMAIN,
        space_choices.VIRTUAL_MARKERS,
        SEGMENT_FRAMES_PARAMETER,
    ),
)
MDTT = windows.BITSTREAM(
    preset=2, name="mdtt", encode=encode_mdtt, parameters=parameters_of(MDTT_PRESETS)
)
PCA_RDO = windows.BITSTREAM(
    preset=3, name="pca-rdo", encode=encode_pca_rdo, parameters=parameters_of(PCA_RDO_PRESETS)
)
