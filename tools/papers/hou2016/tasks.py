"""Work behind the tables of Hou 2016: clips, settings and results."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from mcz.bench.cases import Case, Variant, has_preset
from mcz.bench.tasks import Runner, Task
from mcz.codecs import CODECS
from mcz.codecs.training import SHIPPED
from tools.papers.curves import at, references
from tools.papers.hou2016.spatial import P_ROWS
from tools.papers.hou2016.training import SPARSITIES, TRAINING_CLIPS

# The paper's test clips, then ours for length.
PAPER = ("14_08", "15_04", "17_08", "17_10", "41_07", "49_02", "56_07", "85_12", "86_05")
NAMES = (*PAPER, "14_02", "135_02", "01_01")
FAMILY = ("lsdt-frame", "lsdt-clip", "mdtt", "pca-rdo")
PRESET = "hou2016"
WINDOWS = (60, 120, 240)
ERRORS = (0.1, 0.2, 0.5, 1.0, 2.0)  # cm, of the tables
ITERATIONS, EVERY = 300, 2  # of training for Fig. 3 and 4: every other frame is enough
SPEED_CM = 0.5  # the error at which speeds are compared
STEPS_CM = (None, 0.2, 0.8)  # of the way back; None: exact places
ONE_CLIP = "17_10"  # for speeds and the way back; without it the first

FRAME = Variant("lsdt-frame")
COSINES = Variant("lsdt-frame", (("basis", "cosines"),))
CLIPS = tuple(Variant("lsdt-clip", (("window", n),)) for n in WINDOWS)
CLIP = CLIPS[-1]
MDTT, RDO = Variant("mdtt"), Variant("pca-rdo")
REFERENCE = Variant("mrdwt")
OWN = {"lsdt-frame": FRAME, "lsdt-clip": CLIP}  # codecs whose bases are compared


def published_variant(variant: Variant) -> Variant:
    """The same with prefix codes and the rest of the paper's settings."""
    return Variant(variant.codec, (("preset", PRESET), *variant.params))


def in_channels(variant: Variant) -> Variant:
    return replace(variant, params=(*variant.params, ("domain", "channels")))


def _known_codecs() -> dict[str, Any]:
    return {codec.name: codec for codec in CODECS.values()}


def here() -> list[str]:
    return [name for name in FAMILY if name in _known_codecs()]


def missing_codecs() -> list[str]:
    return [name for name in FAMILY if name not in here()]


def variants(*, preset: bool) -> list[Variant]:
    """The curves of one coder, the paper's or ours; mrdwt, for reference, with ours alone."""
    found = [FRAME, COSINES, *CLIPS, MDTT, RDO]
    found = [v for v in found if v.codec in here()]
    if preset:
        return [published_variant(v) for v in found if has_preset(_known_codecs()[v.codec], PRESET)]
    return [*found, REFERENCE]


def channel_variants() -> list[Variant]:
    return [in_channels(v) for v in (CLIP, RDO) if v.codec in here()]


def others(names: Sequence[str]) -> list[str]:
    """Training clips: for ours, and for the test clips those of their subjects."""
    beside = [name for name in names if any(same_subject(name, test) for test in NAMES)]
    return [*(name for name in TRAINING_CLIPS if name in names), *sorted(beside)]


def same_subject(a: str, b: str) -> bool:
    """
    >>> same_subject("17_03", "17_10"), same_subject("17_10", "17_10"), same_subject("7_1", "17_1")
    (True, False, False)
    """
    return a != b and a.partition("_")[0] == b.partition("_")[0]


@dataclass(frozen=True, slots=True)
class Found:
    """The clips of the tables, those that bases are learned from, and the results by task."""

    cases: Mapping[str, Case]
    training: tuple[Case, ...]
    own: Mapping[str, tuple[Case, ...]]  # of each test clip the others of its subject
    results: dict[Task, Any] = field(default_factory=dict)
    iterations: int = ITERATIONS

    @property
    def one(self) -> Case:
        return self.cases.get(ONE_CLIP) or next(iter(self.cases.values()))

    @property
    def papers(self) -> dict[str, Case]:
        """The paper's own test clips, or all where there is none."""
        found = {name: case for name, case in self.cases.items() if name in PAPER}
        return found or dict(self.cases)

    def get(self, task: Task | None) -> Any:
        """A result; None where there is none, or the task was refused."""
        found = self.results.get(task) if task else None
        return None if isinstance(found, dict) and "error" in found else found

    def curve(self, clip: str, variant: Variant, data: str = "") -> list[dict[str, Any]]:
        found = self.get(curve_task(self.cases[clip], variant, data))
        return found if isinstance(found, list) else []

    def cr(self, clip: str, variant: Variant, error: float) -> float | None:
        """CR, with the models that the file has, at a mean distance in cm."""
        return at(self.curve(clip, variant), "cm", error, "cr")

    # Tasks

    def convergence(self) -> Task | None:
        if not self.training:
            return None
        arguments = (references(self.training), self.iterations, EVERY)
        return Task("convergence", self.training[0], arguments=arguments)

    def bases_of(self, sparsity: int) -> Task | None:
        if not self.training:
            return None
        given = {"sparsity": sparsity, "iterations": self.iterations, "kind": "frames"}
        recipe = tuple((given | {"every": EVERY}).items())
        return Task("bases", self.training[0], arguments=(references(self.training), recipe))

    def own_bases(self, clip: str) -> Task | None:
        """Bases from the other clips of a subject, by the recipe of the package's own."""
        if not self.own.get(clip):
            return None
        names = ("sparsity", "growth", "start", "kind", "mirror", "headings", "every")
        recipe = tuple((name, getattr(SHIPPED, name)) for name in names)
        recipe = (*recipe, ("iterations", self.iterations))
        return Task("bases", self.own[clip][0], arguments=(references(self.own[clip]), recipe))

    def data_of(self, task: Task | None) -> str:
        """The bases that a task has learned, as text; "" where there are none."""
        found = self.get(task)
        return found["data"] if found else ""

    def spatial(self) -> Task | None:
        named = [(f"{P_ROWS}{P}", self.data_of(self.bases_of(P))) for P in SPARSITIES]
        if not all(data for _, data in named):
            return None
        plain = [("LSDT", dict(named)[f"{P_ROWS}8"])]
        clips = list(self.papers.values())
        return Task("spatial", clips[0], arguments=(references(clips), (*plain, *named)))

    def speeds(self) -> Task | None:
        """All codecs beside each other, each at its setting for ``SPEED_CM``."""
        clip = next(name for name, case in self.cases.items() if case == self.one)
        given = []
        wanted = [REFERENCE, CLIP, FRAME, MDTT, RDO]
        for variant in (*wanted, *map(published_variant, (CLIP, FRAME))):
            setting = at(self.curve(clip, variant), "cm", SPEED_CM, "setting")
            if setting is not None:
                given.append((variant.codec, variant.params, float(f"{setting:.3g}")))
        return Task("speeds_beside", self.one, arguments=tuple(given)) if given else None

    def way_back(self, step: float | None, *, virtual_markers: bool) -> Task:
        return Task("way_back", self.one, arguments=(step, virtual_markers))

    def first(self) -> Iterator[Task | None]:
        """Tasks without dependencies."""
        yield self.convergence()
        yield from (self.bases_of(P) for P in SPARSITIES)
        yield from (self.own_bases(clip) for clip in self.cases)
        for case in self.cases.values():
            for variant in (*variants(preset=False), *variants(preset=True), *channel_variants()):
                yield curve_task(case, variant)
        if "lsdt-clip" in here():
            for step in STEPS_CM:
                yield from (self.way_back(step, virtual_markers=v) for v in (False, True))

    def second(self) -> Iterator[Task | None]:
        """Tasks that depend on trained bases and settings."""
        yield self.spatial()
        yield self.speeds()
        for variant in OWN.values():
            for case in self.papers.values():
                for P in SPARSITIES:
                    if data := self.data_of(self.bases_of(P)):
                        yield curve_task(case, variant, data)
            for name, case in self.cases.items():
                if data := self.data_of(self.own_bases(name)):
                    yield curve_task(case, variant, data)


def curve_task(case: Case, variant: Variant, data: str = "") -> Task:
    return Task("curve", case, variant, (data,) if data else ())


def measure(
    runner: Runner,
    cases: Mapping[str, Case],
    more: Mapping[str, Case],
) -> Found:
    """Everything; ``more`` are the clips that bases are learned from."""
    training = tuple(more[name] for name in TRAINING_CLIPS if name in more)
    every = {**more, **cases}
    own = {
        name: tuple(case for other, case in sorted(every.items()) if same_subject(other, name))
        for name in cases
    }
    found = Found(cases, training, own, iterations=ITERATIONS)
    found.results.update(runner.run(task for task in found.first() if task))
    found.results.update(runner.run(task for task in found.second() if task))
    return found
