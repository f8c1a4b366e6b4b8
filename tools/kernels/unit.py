"""A unit: modules of kernels and all functions that they call, as one module in Cython."""

from __future__ import annotations

from hashlib import sha256
from os.path import relpath
from pathlib import Path
from typing import Any

from tools.kernels.annotations import INT, NOTHING, Array, Record, Scalar, Tuple, Type
from tools.kernels.expressions import Root
from tools.kernels.functions import Function, type_text
from tools.kernels.source import ROOT, Source, mangle_name, source, sources_behind

HEAD = """# Written by tools/kernels from the sources that SOURCES names.
from operator import index
from numpy import dtype, empty, zeros
from mcz.kernels.types import fit, items, restore

cdef extern from "arithmetic.h" nogil:
    long long mcz_divide(long long a, long long b)
    long long mcz_remainder(long long a, long long b)
    long long mcz_left(long long a, long long n)
    long long mcz_right(long long a, long long n)
    long long mcz_magnitude(long long a)
    long long mcz_bit_length(long long a)
    long long mcz_integer(double a)
    long long mcz_truncated(double a)
    long long mcz_wrapped(long long a)
    long long mcz_eight_bytes(const unsigned char* at, unsigned char last)
    long long mcz_put_eight_bytes(unsigned char* at, unsigned char last, long long value)
    long long mcz_trailing_zeros(long long a)
    double INFINITY
    double mcz_square(double a)
    double mcz_power "pow"(double a, double b)
    double floor(double a)
    double rint(double a)
    double sqrt(double a)
    double log2(double a)
    double log(double a)
    double exp(double a)
    double cos(double a)
    double sin(double a)
    double fabs(double a)
    double ldexp(double a, int n)

cdef object int64_ = dtype("int64"), int32_ = dtype("int32"), float64_ = dtype("float64")
cdef object uint8_ = dtype("uint8"), bool_ = dtype("bool")
"""

# An index of a constant table; those of arrays are Cython's to check.
INDEX = """
cdef extern from "arithmetic.h" nogil:
    long long mcz_index(long long at, long long size)
"""
CHECKED_INDEX = """
cdef inline long long mcz_index(long long at, long long size) except -1 nogil:
    if at < 0 or at >= size:
        with gil:
            raise IndexError("an index is out of the range of a table")
    return at
"""


class Unit:
    """The text of a module in Cython, for all kernels of ``modules``."""

    def __init__(self, modules: tuple[str, ...], *, checked: bool) -> None:
        self.checked = checked
        self.functions: dict[str, Function] = {}
        self.records: dict[str, Record] = {}
        self.entries = [
            (source(module), name)
            for module in modules
            for name in source(module).functions
            if source(module).is_entry(name)
        ]
        for where, name in self.entries:
            self._add(where, name)
        self.written: dict[str, set[Root]] = {}
        self.fields: set[Root] = set()
        self._spread_writes()
        self._check_order()
        self.raising = self._find_raising()

    def _add(self, where: Source, name: str) -> None:
        """Translate a function, after those that it calls."""
        full = mangle_name(where.name, name)
        if full in self.functions:
            return
        function = Function(where, name)
        for record in (type_ for type_ in function.types.values() if isinstance(type_, Record)):
            self._add_record(record)
        for there, called in function.needed:
            self._add(there, called)
        self.functions[full] = function

    def _add_record(self, record: Record) -> None:
        for _, type_ in record.fields:
            if isinstance(type_, Record):
                self._add_record(type_)
        self.records[record.name] = record

    def _spread_writes(self) -> None:
        """Find which variables and fields name arrays that are written."""
        self.written = {name: set(f.effects.written) for name, f in self.functions.items()}
        before = -1
        while before != (before := sum(map(len, self.written.values())) + len(self.fields)):
            for name, function in self.functions.items():
                written = self.written[name]
                for called, roots in function.effects.calls:
                    parameters = self.functions[called].parameters
                    for (parameter, _), root in zip(parameters, roots, strict=True):
                        if root is not None and parameter in self.written[called]:
                            written.add(root)
                for variable, roots_of in function.effects.aliases.items():
                    if variable in written or self._is_field_written(roots_of):
                        written.add(variable)
                        written |= roots_of
                self.fields |= {root for root in written if isinstance(root, tuple)}

    def _is_field_written(self, roots: set[Root]) -> bool:
        return any(isinstance(root, tuple) and root in self.fields for root in roots)

    def _check_order(self) -> None:
        """Refuse expressions that depend on which of several calls comes first."""
        for function in self.functions.values():
            for node, called in function.find_unordered_calls():
                if any(map(self._writes, called)):
                    raise function.error(node, "C leaves open which call comes first")

    def _writes(self, name: str) -> bool:
        """True if a function writes to its array arguments."""
        parameters = {parameter for parameter, _ in self.functions[name].parameters}
        return any(isinstance(r, tuple) or r in parameters for r in self.written[name])

    def _find_raising(self) -> set[str]:
        """The functions in which an exception can be raised."""
        if self.checked:
            return set(self.functions)
        found = {name for name, f in self.functions.items() if f.effects.allocates}
        before = -1
        while before != (before := len(found)):
            for name, function in self.functions.items():
                if any(called in found for called, _ in function.effects.calls):
                    found.add(name)
        return found

    def text(self) -> str:
        """The whole module."""
        parts = [
            HEAD,
            CHECKED_INDEX if self.checked else INDEX,
            self._tables(),
            f"SOURCES = {self._digests()!r}\n",
        ]
        parts += [self._record(record) for record in self.records.values()]
        parts += [self._function(name) for name in self.functions]
        parts += [self._door(where, name) for where, name in self.entries]
        return "\n".join(parts)

    def _digests(self) -> dict[str, str]:
        """SHA-256 of each source that the text depends on, by its path in the package."""
        modules = {record.module for record in self.records.values()}
        for function in self.functions.values():
            modules |= function.modules
        paths = [where.path for where in sources_behind(modules)]
        package = ROOT / "mcz"
        return {
            Path(relpath(p, package)).as_posix(): sha256(p.read_bytes()).hexdigest() for p in paths
        }

    def _tables(self) -> str:
        tables: dict[str, tuple[Any, ...]] = {}
        for function in self.functions.values():
            tables.update(function.tables)
        if not tables:
            return ""
        lines, declared = [], []
        for name, values in tables.items():
            type_ = "double" if any(isinstance(v, float) for v in values) else "long long"
            items = ", ".join(repr(float(v)) if type_ == "double" else f"{v}LL" for v in values)
            lines.append(f"static const {type_} {name}[{len(values)}] = {{{items}}};")
            declared.append(f"    const {type_} {name}[{len(values)}]")
        text = "\n    ".join(lines)
        return f'cdef extern from *:\n    """\n    {text}\n    """\n' + "\n".join(declared) + "\n"

    def _record(self, record: Record) -> str:
        if record.is_struct:
            fields = [f"    {type_.c} {name}" for name, type_ in record.fields]
            made = [
                f"    found.{name} = {self._convert_argument(f'given.{name}', type_, False)}"
                for name, type_ in record.fields
            ]
            return "\n".join(
                [
                    f"cdef struct {record.name}:",
                    *fields,
                    "",
                    f"cdef {record.name} of_{record.name}(object given) except *:",
                    f"    cdef {record.name} found",
                    *made,
                    "    return found",
                    "",
                ]
            )
        lines = [f"cdef class {record.name}:"]
        made = []
        for name, type_ in record.fields:
            is_written = (record.name, name) in self.fields
            lines.append(f"    cdef {type_text(type_, is_written)} {name}")
            value = self._convert_argument(f"given.{name}", type_, is_written)
            made.append(f"        self.{name} = {value}")
        return "\n".join([*lines, "    def __init__(self, object given, list moved):", *made, ""])

    def _convert_argument(self, text: str, type_: Type, is_written: bool) -> str:
        """An argument as Python gives it, as the type that a kernel takes."""
        if isinstance(type_, Array):
            dense = (type_.dense and "True") or "False"
            return f"fit({text}, {type_.item}_, {type_.rank}, {dense}, {is_written}, moved)"
        if isinstance(type_, Record):
            return f"of_{type_.name}({text})" if type_.is_struct else f"{type_.name}({text}, moved)"
        if isinstance(type_, Tuple):
            return f"items({text}, {tuple(item == INT for item in type_.items)})"
        return f"index({text})" if type_ == INT else text

    def _signature(self, function: Function) -> str:
        written = self.written[function.name]
        parameters = ", ".join(
            f"{type_text(type_, name in written)} {name}" for name, type_ in function.parameters
        )
        result = function.returns
        end = "noexcept"
        if function.name in self.raising:
            end = "except -1" if result == NOTHING else "except? -1"
            if isinstance(result, Tuple):
                end = "except *"
        c = result.c if isinstance(result, Scalar | Tuple) else ""
        return f"cdef inline {c} {function.name}({parameters}) {end} nogil"

    def _function(self, name: str) -> str:
        function = self.functions[name]
        declared = function.declarations(self.written[name])
        if not function.effects.allocates:  # its slices are of arrays that its callers hold
            declared.append("    cdef bint mcz_counts = False")
        return "\n".join([f"{self._signature(function)}:", *declared, *function.lines, ""])

    def _door(self, where: Source, name: str) -> str:
        """The function that Python calls: it checks arrays, and lets other threads run."""
        full = mangle_name(where.name, name)
        function, written = self.functions[full], self.written[full]
        names = [parameter for parameter, _ in function.parameters]
        lines = [f"def call_{full}({', '.join(f'object {n}' for n in names)}):"]
        lines.append("    cdef list moved = []")
        for parameter, type_ in function.parameters:
            taken = self._convert_argument(parameter, type_, parameter in written)
            is_written = parameter in written
            lines.append(f"    cdef {type_text(type_, is_written)} of_{parameter} = {taken}")
        call = f"{full}({', '.join(f'of_{n}' for n in names)})"
        result = function.returns
        if result != NOTHING:
            assert isinstance(result, Scalar | Tuple)
            lines.append(f"    cdef {result.c} result")
            call = f"result = {call}"
        lines += ["    with nogil:", f"        {call}", "    if moved:", "        restore(moved)"]
        if result != NOTHING:
            lines.append("    return result")
        return "\n".join([*lines, ""])
