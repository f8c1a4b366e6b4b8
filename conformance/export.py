"""Machine-readable results of all vectors: JSON, JUnit XML, and a badge as a file."""

from __future__ import annotations

import json
import re
from collections import Counter
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as Xml

from conformance.encode import Result
from conformance.outcome import Outcome
from conformance.summary import STATUSES, Report, badge, requirements, tables

COLORS = {"brightgreen": "#4c1", "blue": "#08c", "red": "#e05d44"}


def badge_file(report: Report, suffix: str) -> str:
    """The badge as an SVG, or as JSON for a shields.io endpoint."""
    label, message, color = badge(report)
    if suffix == ".json":
        fields = {"schemaVersion": 1, "label": label, "message": message, "color": color}
        return json.dumps(fields, indent=1) + "\n"
    left, right = 7 * len(label) + 12, 7 * len(message) + 12
    svg = Xml.Element("svg", xmlns="http://www.w3.org/2000/svg", height="20")
    svg.set("width", str(left + right))
    svg.set("role", "img")
    Xml.SubElement(svg, "title").text = f"{label}: {message}"
    Xml.SubElement(svg, "rect", width=str(left + right), height="20", rx="3", fill="#444")
    Xml.SubElement(svg, "rect", x=str(left), width=str(right), height="20", rx="3").set(
        "fill", COLORS[color]
    )
    for text, x, width in ((label, 6, left - 12), (message, left + 6, right - 12)):
        words = Xml.SubElement(svg, "text", x=str(x), y="14", fill="#fff", textLength=str(width))
        words.set("font-family", "Verdana, sans-serif")
        words.set("font-size", "11")
        words.text = text
    return Xml.tostring(svg, encoding="unicode") + "\n"


def document(report: Report) -> dict[str, Any]:
    """Document that ``--json`` prints."""
    passed, failed, not_asked = map(report.count, STATUSES)
    label, message, _ = badge(report)
    content: dict[str, Any] = {
        "format_version": report.version,
        "decoder": report.command,
        "badge": f"{label}: {message}",
        "passed": passed,
        "failed": failed,
        "not_asked": not_asked,
        "seconds": round(report.seconds, 3),
        "remarks": list(report.remarks),
        "tables": tables(report.outcomes),
        "requirements": requirements(report.outcomes),
        "vectors": [_row(o) for o in report.outcomes if o.asked],
        "not_asked_vectors": [
            {"file": o.file, "lacks": sorted(o.lacks)} for o in report.outcomes if not o.asked
        ],
    }
    if report.results is not None:
        content["encoder"] = [_encoder_row(result) for result in report.results]
    return content


def _row(outcome: Outcome) -> dict[str, Any]:
    faults = [
        {"arguments": words, "kind": fault.kind, "detail": fault.detail}
        for words, fault in outcome.faults
    ]
    return {
        "file": outcome.file,
        "passed": not outcome.faults,
        "faults": faults,
        "lacks": sorted(outcome.lacks),
        "seconds": round(outcome.seconds, 3),
    }


def _encoder_row(result: Result) -> dict[str, Any]:
    return {
        "file": result.task.vector["file"],
        "source": result.task.name,
        "status": result.status,
        "fault": str(result.fault) if result.fault else None,
        "deterministic": result.deterministic,
        "source_bytes": len(result.task.content),
        "mcz_bytes": result.size,
    }


def junit(report: Report) -> bytes:
    """JUnit XML: a suite a group, a case a vector, and one suite for the encoder."""
    root = Xml.Element("testsuites", name=badge(report)[0])
    for group in dict.fromkeys(outcome.vector["group"] for outcome in report.outcomes):
        members = [outcome for outcome in report.outcomes if outcome.vector["group"] == group]
        suite = _suite(root, f"conformance.{group}", Counter(o.status for o in members))
        for outcome in members:
            _case(suite, outcome)
    if report.results is not None:
        statuses = Counter(
            result.status.replace("declined", "not asked") for result in report.results
        )
        suite = _suite(root, "conformance.encoder", statuses)
        for result in report.results:
            name = f"{result.task.vector['file']} {result.task.name}"
            case = Xml.SubElement(suite, "testcase", classname="conformance.encoder", name=name)
            case.set("time", f"{result.seconds:.3f}")
            if result.declined:
                Xml.SubElement(case, "skipped", message="declined")
            elif result.fault:
                _failure(case, result.fault.kind, str(result.fault))
    Xml.indent(root)
    text = Xml.tostring(root, encoding="unicode")
    return f"<?xml version='1.0' encoding='utf-8'?>\n{text}\n".encode()


def _suite(root: Xml.Element, name: str, statuses: Counter[str]) -> Xml.Element:
    suite = Xml.SubElement(root, "testsuite", name=name, tests=str(statuses.total()))
    suite.set("failures", str(statuses["failed"]))
    suite.set("skipped", str(statuses["not asked"]))
    return suite


def _case(suite: Xml.Element, outcome: Outcome) -> None:
    folder, _, name = outcome.file.removesuffix(".mcz").rpartition("/")
    classname = f"conformance.{folder.replace('/', '.')}"
    case = Xml.SubElement(suite, "testcase", classname=classname, name=name)
    case.set("time", f"{outcome.seconds:.3f}")
    if not outcome.asked:
        Xml.SubElement(case, "skipped", message=f"not asked: {', '.join(sorted(outcome.lacks))}")
    for words, fault in outcome.faults:
        _failure(case, fault.kind, f"{words}: {fault}" if words else str(fault))
    if outcome.stderr:
        Xml.SubElement(case, "system-err").text = _clean(outcome.stderr)


def _failure(case: Xml.Element, kind: str, message: str) -> None:
    Xml.SubElement(case, "failure", type=kind, message=_clean(message))


def _clean(words: str) -> str:
    """``words`` without the characters that XML cannot hold."""
    return re.sub("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]", "?", words)


def write(report: Report, junit_file: Path | None, badge_at: Path | None) -> None:
    """Write the files that were asked for."""
    if junit_file is not None:
        junit_file.write_bytes(junit(report))
    if badge_at is not None:
        badge_at.write_text(badge_file(report, badge_at.suffix), "utf-8")
