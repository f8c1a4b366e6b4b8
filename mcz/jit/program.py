"""A kernel with all the loops that it calls, as one module in LLVM's assembly."""

from __future__ import annotations

from types import FunctionType

from mcz.jit.arrays import FAULT, NOWHERE
from mcz.jit.calls import ONE_FLOAT, returned
from mcz.jit.sources import definition_of
from mcz.jit.statements import Function
from mcz.jit.types import LoopError, Tuple, Type

DECLARED = (
    "declare ptr @malloc(i64)",
    "declare ptr @calloc(i64, i64)",
    "declare void @free(ptr)",
    "declare i64 @llvm.abs.i64(i64, i1)",
    "declare double @llvm.fabs.f64(double)",
    "declare double @llvm.pow.f64(double, double)",
    "declare double @llvm.ldexp.f64.i32(double, i32)",
    "declare i64 @llvm.fptosi.sat.i64.f64(double)",
    "declare i64 @llvm.ctlz.i64(i64, i1)",
    *(f"declare double @llvm.{name}.f64(double)" for name in ONE_FLOAT.values()),
)
CHECKS = f"{FAULT} = internal global i64 0\n{NOWHERE} = internal global i64 0"


class Module:
    """The functions of a program, each once for all types that it is called with."""

    def __init__(self, checked: bool) -> None:
        self.checked = checked
        self.texts: list[str] = []
        self._known: dict[tuple[FunctionType, tuple[Type, ...]], tuple[str, Type]] = {}

    def function(self, function: FunctionType, types: tuple[Type, ...]) -> tuple[str, Type]:
        """Name and type of what ``function`` returns; it is translated where it is new."""
        if (function, types) not in self._known:
            name = f"@{function.__name__}.{len(self._known)}"
            self._known[function, types] = self._translate(function, types, name)
        return self._known[function, types]

    def _translate(
        self, function: FunctionType, types: tuple[Type, ...], name: str
    ) -> tuple[str, Type]:
        body = Function(self, function, definition_of(function), self.checked)
        try:
            text, result = body.text(name, types)
        except LoopError as error:
            if getattr(error, "__notes__", ()):
                raise
            error.add_note(f"in {function.__module__}.{function.__name__}, line {body.line}")
            raise
        self.texts.append(text)
        return name, result


def assembly(
    function: FunctionType, types: tuple[Type, ...], name: str, *, checked: bool
) -> tuple[str, Type]:
    """The module of a kernel, whose function ``name`` is called from outside; what it returns.

    A tuple is returned by way of an address in front of all parameters. Where indices are checked,
    the next parameter is the address of the line of the first one out of range.
    """
    module = Module(checked)
    inside, result = module.function(function, types)
    parts = [part for type_ in types for part in type_.parts()]
    arguments = ", ".join(f"{part} %p{place}" for place, part in enumerate(parts))
    call = f"call {returned(result)} {inside}({arguments})"
    lines = [f"%r = {call}" if result.parts() else call]
    outside = returned(result)
    last = f"ret {outside} %r" if result.parts() else "ret void"
    parameters = arguments
    if isinstance(result, Tuple) and result.parts():
        for place, part in enumerate(result.parts()):
            lines.append(f"%r{place} = extractvalue {outside} %r, {place}")
            lines.append(f"%a{place} = getelementptr i64, ptr %results, i64 {place}")
            lines.append(f"store {part} %r{place}, ptr %a{place}")
        parameters = ", ".join(filter(None, ["ptr %results", arguments]))
        outside, last = "void", "ret void"
    if checked:
        lines.insert(0, f"store i64 0, ptr {FAULT}")
        lines += [f"%fault = load i64, ptr {FAULT}", "store i64 %fault, ptr %line"]
        parameters = ", ".join(filter(None, ["ptr %line", parameters]))
    body = "\n  ".join([*lines, last])
    entry = f"define {outside} @{name}({parameters}) {{\n  {body}\n}}\n"
    head = [*DECLARED, CHECKS] if checked else DECLARED
    return "\n".join([*head, *module.texts, entry]), result
