"""An encoder under test: what it writes is judged by the decoder, byte for byte.

README.md, "The contract", says how it is asked. The source files come from the vectors.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from conformance.child import Answer, Asker, Limits, Once
from conformance.judge import (
    OK,
    REFUSED,
    UNSUPPORTED,
    Fault,
    Wrong,
    end_of,
    judge_answer,
    listing_of,
)
from conformance.manifest import FORMATS, Capabilities, Request, Vector, all_requests, format_of
from conformance.outcome import spread

SPARE_OUTPUT = 2**25  # bytes that a file may be longer than its source


@dataclass(frozen=True, slots=True)
class Task:
    """A source file, and the skeleton that goes with it."""

    vector: Vector
    name: str
    content: bytes
    skeleton: bytes | None

    @property
    def format(self) -> str:
        return format_of(self.name)


@dataclass(frozen=True, slots=True)
class Result:
    """An encoder's result for one source file."""

    task: Task
    fault: Fault | None = None
    declined: bool = False  # exit 3: it does not take such files
    deterministic: bool = True
    size: int = 0  # bytes of the .mcz
    seconds: float = 0.0

    @property
    def status(self) -> str:
        """restored, failed or declined."""
        if self.declined:
            return "declined"
        return "failed" if self.fault else "restored"


class Pair:
    """An encoder and the decoder that reads what it writes."""

    def __init__(self, encoder: Asker, decoder: Asker) -> None:
        self.encoder = encoder
        self.decoder = decoder

    def kill(self) -> None:
        self.encoder.kill()
        self.decoder.kill()

    def close(self) -> None:
        self.encoder.close()
        self.decoder.close()


def try_encoder(
    command: Sequence[str],
    limits: Limits,
    vectors: Sequence[Vector],
    can: Capabilities,
    decoder: Callable[[], Asker],
    jobs: int,
) -> list[Result]:
    """Encode the source files of ``vectors`` twice each, and compare what the decoder restores.

    A source file that was made for decoders is left out. So is one that the decoder does not give
    back as the manifest says; the decoder's own table has that fault.
    """
    wanted = [
        request
        for vector in vectors
        if not vector.get("crafted")
        for request in all_requests(vector)
        if request.listing == "sources" and request.expected and not can.lacks(request)
    ]
    tasks_of_all = [task for tasks in spread(_tasks, wanted, decoder, jobs) for task in tasks]
    unique = {(task.content, task.skeleton, task.format): task for task in tasks_of_all}
    with tempfile.TemporaryDirectory() as folder:
        paths = _store_skeletons(Path(folder), unique.values())

        def work(pair: Pair, task: Task) -> Result:
            return _encode(pair, task, paths)

        def start() -> Pair:
            return Pair(Once(command, limits), decoder())

        return list(spread(work, list(unique.values()), start, jobs))


def _store_skeletons(folder: Path, tasks: Iterable[Task]) -> dict[bytes, Path]:
    """A file of each skeleton, before several processes read it."""
    skeletons = dict.fromkeys(task.skeleton for task in tasks if task.skeleton is not None)
    paths = {content: folder / f"{number}.asf" for number, content in enumerate(skeletons)}
    for content, path in paths.items():
        path.write_bytes(content)
    return paths


def _tasks(asker: Asker, request: Request) -> list[Task]:
    """The source files of one vector, none where the decoder does not restore them."""
    answer = asker.ask(request.arguments, request.path, request.max_output)
    if answer.code != OK or judge_answer(request, answer) is not None:
        return []
    files = dict(_files(answer.output))
    skeletons = [name for name in files if format_of(name) == "asf"]
    return [
        Task(
            request.vector,
            name,
            content,
            files[skeletons[0]] if format_of(name) == "amc" and len(skeletons) == 1 else None,
        )
        for name, content in files.items()
        if format_of(name) in FORMATS
    ]


def _files(output: bytes) -> Iterator[tuple[str, bytes]]:
    """Name and content of the files in an answer to ``--source``; Wrong if it is malformed."""
    rows, body = listing_of(output, "sources")
    at = 0
    for row in rows:
        yield str(row["path"]), body[at : at + row["bytes"]]
        at += row["bytes"]


def _encode(pair: Pair, task: Task, paths: Mapping[bytes, Path]) -> Result:
    """Encode one source file twice, and let the decoder read the first result."""
    arguments = ["--format", task.format]
    if task.skeleton is not None:
        arguments += ["--skeleton", str(paths[task.skeleton])]
    limit = len(task.content) + SPARE_OUTPUT
    first = pair.encoder.ask(arguments, task.content, limit)
    if first.code == UNSUPPORTED and not first.fault:
        return Result(task, declined=True, seconds=first.seconds)
    fault = _encoder_fault(first) or _check_restored(pair.decoder, task, first.output)
    second = first if fault else pair.encoder.ask(arguments, task.content, limit)
    fault = fault or _encoder_fault(second)
    same = second.output == first.output
    return Result(task, fault, False, same, len(first.output), first.seconds)


def _encoder_fault(answer: Answer) -> Fault | None:
    ended = end_of(answer)
    if ended is not None or answer.code == OK:
        return ended
    kind = "wrongly refused" if answer.code == REFUSED else "bad exit code"
    last = answer.errors.strip().rpartition("\n")[2][:200]
    return Fault(kind, f"exit {answer.code}: {last}")


def _check_restored(decoder: Asker, task: Task, data: bytes) -> Fault | None:
    """Fault of the .mcz ``data``, None if it restores the source file."""
    limit = len(task.content) + len(task.skeleton or b"") + SPARE_OUTPUT
    decoded = decoder.ask([], data, 2**30)
    restored = decoder.ask(["--source"], data, limit)
    for answer in (decoded, restored):
        ended = end_of(answer)
        if ended is not None or answer.code != OK:
            why = ended or f"exit {answer.code}: {answer.errors.strip()[-200:]}"
            return Fault("refused by the decoder", str(why))
    try:
        contents = [content for _, content in _files(restored.output)]
    except Wrong as wrong:
        return wrong.fault
    if task.content in contents:
        return None
    sizes = ", ".join(str(len(content)) for content in contents) or "none"
    return Fault("other bytes", f"files of {sizes} bytes, the source has {len(task.content)}")
