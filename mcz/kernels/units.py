"""Extension modules by family of kernels; each includes all that its kernels call."""

from __future__ import annotations

UNITS: dict[str, tuple[str, ...]] = {
    "fast": (
        "mcz.codecs.coding.fast.decode_kernels",
        "mcz.codecs.coding.fast.encoder",
        "mcz.codecs.coding.fast.plan_kernels",
        "mcz.codecs.coding.fast.residual_kernels",
        "mcz.codecs.coding.fast.survey_kernels",
        "mcz.codecs.coding.fast.write_kernels",
    ),
    "best": (
        "mcz.codecs.coding.mixing",
        "mcz.codecs.lossless.best_kernels",
        "mcz.codecs.coding.residuals",
    ),
    "numbers": (
        "mcz.codecs.coding.forms.units",
        "mcz.model.numbers.decimal_kernels",
        "mcz.model.numbers.token_kernels",
        "mcz.model.numbers.value_kernels",
        "mcz.sources.text.text_kernels",
    ),
    "curves": (
        "mcz.codecs.curves.kernels",
        "mcz.codecs.pca.streams",
    ),
    "online": ("mcz.codecs.online.kernels",),
    "spatial": (
        "mcz.codecs.coding.prefix_codes",
        "mcz.codecs.spatial.kernels",
        "mcz.codecs.transforms.bases",
    ),
    "wavelets": (
        "mcz.codecs.transforms.lifting",
        "mcz.codecs.transforms.wavelets",
        "mcz.codecs.wavelet.streams",
    ),
    "metric": (
        "mcz.codecs.posewave.contact_kernels",
        "mcz.codecs.posewave.metric_kernels",
        "mcz.codecs.posewave.order_kernels",
    ),
    "rows": (
        "mcz.codecs.posewave.displacement_kernels",
        "mcz.codecs.posewave.head_kernels",
        "mcz.codecs.posewave.model_kernels",
    ),
    "deflate": ("mcz.sources.arrays.deflate_kernels",),
    "motion": (
        "mcz.codecs.transforms.post_filter",
        "mcz.container.recovery.kernels",
        "mcz.exchange.conversion.scenes.keys",
        "mcz.kinematics.frame_kernels",
    ),
}
UNIT_OF = {module: unit for unit, modules in UNITS.items() for module in modules}
