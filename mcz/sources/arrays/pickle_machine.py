"""Opcodes of a pickle -> plain data and arrays. It imports, calls and instantiates nothing.

A pickle is a program for a stack machine. This one runs the opcodes that build data; the names of
NumPy and joblib below stand for arrays, and every other name is refused. ``pickletools`` has the
table of the opcodes.
"""

from __future__ import annotations

import pickletools
from collections.abc import Callable, Mapping, Sequence
from math import prod
from typing import NoReturn

from mcz.errors import SourceError
from mcz.sources.arrays.pickle_values import (
    LITERALS,
    Dict,
    DType,
    Number,
    PickledArray,
    PickledName,
    Raw,
    Storage,
    Wrapper,
    integer_of,
    size_of,
)

MAX_OPCODES = 2**20
MAX_STATE, MAX_WORD = 32, 512  # fields of joblib's wrapper, bytes of a name
AS_TEXT = "written as text, as protocols 0 to 2 of pickle do (protocol 4 writes plain bytes)"
UNPLAIN = "in an order of axes of its own"
OPCODES = {ord(op.code): op for op in pickletools.opcodes}
COUNT_SIZES = {  # bytes of the count before an argument
    pickletools.TAKEN_FROM_ARGUMENT1: 1,
    pickletools.TAKEN_FROM_ARGUMENT4: 4,
    pickletools.TAKEN_FROM_ARGUMENT4U: 4,
    pickletools.TAKEN_FROM_ARGUMENT8U: 8,
}


_MODULES = {
    "numpy.core.multiarray": ("_reconstruct", "scalar"),
    "numpy._core.multiarray": ("_reconstruct", "scalar"),
    "numpy.core.numeric": ("_frombuffer",),
    "numpy._core.numeric": ("_frombuffer",),
    "numpy": ("ndarray", "dtype"),
    "joblib.numpy_pickle": ("NumpyArrayWrapper",),
    "collections": ("OrderedDict",),
    "_codecs": ("encode",),
}
NAMES = {
    f"{module}.{name}": PickledName(name) for module, names in _MODULES.items() for name in names
}
STORAGES = {
    "BoolStorage": "b1",
    "CharStorage": "i1",
    "ShortStorage": "i2",
    "IntStorage": "i4",
    "LongStorage": "i8",
    "ByteStorage": "u1",
    "HalfStorage": "f2",
    "FloatStorage": "f4",
    "DoubleStorage": "f8",
    "BFloat16Storage": "bfloat16",
}
TENSORS = {f"torch.{name}": PickledName(name) for name in STORAGES}
TENSORS["torch._utils._rebuild_tensor_v2"] = PickledName("_rebuild_tensor_v2")
VIEW = "a view of a storage, or one of several tensors of it"


class Machine:
    """The pickle in ``data`` from ``at`` on; ``at`` moves to its end.

    ``frames`` are the frames of protocol 4: offset of the length, start and stop. ``storages`` are
    those of tensors by their key, in the byte order ``order``; None: there are no tensors.
    """

    def __init__(
        self,
        data: bytes,
        at: int = 0,
        storages: Mapping[str, Raw] | None = None,
        order: str = "<",
    ) -> None:
        self.data, self.at = data, at
        self.storages, self.order = storages, order
        self.tensors: dict[Raw, list[PickledArray]] = {}  # by storage
        self.names = NAMES if storages is None else NAMES | TENSORS
        self.stack: list[object] = []
        self.marks: list[int] = []
        self.memo: dict[int, object] = {}
        self.frames: list[tuple[int, int, int]] = []
        self.opcode_at = at
        self.is_foreign = False  # there is a name that is no part of an array
        self._frame = (0, 0, 0)

    def run(self) -> object:
        """The value of the pickle; raises SourceError with the offset at fault."""
        n_opcodes = 0
        while True:
            n_opcodes += 1
            if n_opcodes > MAX_OPCODES:
                self.refuse(f"more than {MAX_OPCODES} opcodes")
            at = self.opcode_at = self.at
            opcode = OPCODES.get(self.data[at]) if at < len(self.data) else None
            if opcode is None:
                self.refuse("the pickle ends early, or contains an invalid opcode")
            start, stop, size = self._argument(opcode, at + 1)
            self.at = stop + (opcode.arg is not None and opcode.arg.n == pickletools.UP_TO_NEWLINE)
            self._leave_frame()
            if opcode.name == "STOP":
                return self.pop()
            try:
                if opcode.name in LITERALS:
                    self.stack.append(LITERALS[opcode.name](self.data, start, stop, size))
                elif opcode.name in OPERATIONS:
                    OPERATIONS[opcode.name](self, start, stop)
                else:
                    self.refuse(
                        f"{opcode.name} would create an object of a program, which is never done"
                    )
            except (ValueError, OverflowError):
                self.refuse(f"the argument of {opcode.name} is not valid")

    def refuse(self, reason: str) -> NoReturn:
        raise SourceError(reason, offset=self.opcode_at)

    def pop(self) -> object:
        if len(self.stack) <= (self.marks[-1] if self.marks else 0):
            self.refuse("the pickle pops an empty stack")
        return self.stack.pop()

    def top(self) -> object:
        """The value on top, which stays there."""
        self.stack.append(self.pop())
        return self.stack[-1]

    def pop_items(self) -> list[object]:
        """The values from the last mark on."""
        if not self.marks:
            self.refuse("the pickle has no mark")
        at = self.marks.pop()
        items = self.stack[at:]
        del self.stack[at:]
        return items

    def text_of(self, value: object) -> str | None:
        """A short text; None for anything else."""
        if isinstance(value, Raw) and value.is_text and value.stop - value.start <= MAX_WORD:
            return self.data[value.start : value.stop].decode("latin-1")
        return value if isinstance(value, str) and len(value) <= MAX_WORD else None

    def _argument(self, opcode: pickletools.OpcodeInfo, at: int) -> tuple[int, int, int]:
        """Start and stop of the argument of an opcode, and the bytes of the length before it."""
        if opcode.arg is None:
            return at, at, 0
        n, size = opcode.arg.n, 0
        if n == pickletools.UP_TO_NEWLINE:
            stop = self.data.find(b"\n", at)
            if stop >= 0 and opcode.arg.name == "stringnl_noescape_pair":
                stop = self.data.find(b"\n", stop + 1)
            stop = stop if stop >= 0 else len(self.data) + 1
        elif n >= 0:
            stop = at + n
        else:
            size = COUNT_SIZES[n]
            is_signed = n == pickletools.TAKEN_FROM_ARGUMENT4
            at += size
            n = int.from_bytes(self.data[at - size : at], "little", signed=is_signed)
            stop = at + n if n >= 0 else len(self.data) + 1
        if stop > len(self.data):
            self.refuse(f"the argument of {opcode.name} extends past the end")
        return at, stop, size

    def _leave_frame(self) -> None:
        """Store the frame that ends here; one that ends within an opcode is not restored."""
        stop = self._frame[2]
        if stop and self.at >= stop:
            if self.at == stop:
                self.frames.append(self._frame)
            self._frame = (0, 0, 0)

    def enter_frame(self, start: int, stop: int) -> None:
        end = stop + int.from_bytes(self.data[start:stop], "little")
        if end > len(self.data):
            self.refuse("a frame extends past the end")
        self._frame = (start, stop, end)

    def put(self, index: int) -> None:
        if not 0 <= index < 2**32:
            self.refuse(f"index {index} of a memo is not allowed")
        self.memo[index] = self.top()

    def get(self, index: int) -> None:
        if index not in self.memo:
            self.refuse(f"index {index} of the memo is empty")
        self.stack.append(self.memo[index])

    def extend(self, kind: type[Dict] | type[list[object]], items: Sequence[object]) -> None:
        """Put items into the list or the Dict on top."""
        target = self.top()
        if not isinstance(target, kind) or (kind is Dict and len(items) % 2):
            self.refuse("items are added to something other than a list or a dictionary")
        if isinstance(target, Dict):
            target.pairs += zip(items[::2], items[1::2], strict=True)
        else:
            target.extend(items)

    def push_name(self, module: object, name: object) -> None:
        full = f"{self.text_of(module)}.{self.text_of(name)}"
        if full not in self.names:
            self.is_foreign = True
            self.refuse(f"{full[:200]!r} does not belong to arrays, and is never called")
        self.stack.append(self.names[full])

    def call(self) -> None:
        """REDUCE: what the few known functions would make of their arguments."""
        arguments, function = self.pop(), self.pop()
        if not isinstance(function, PickledName) or not isinstance(arguments, tuple):
            self.refuse("something other than a function is called")
        match function.name, arguments:
            case "_reconstruct", (PickledName("ndarray"), *_):
                result: object = PickledArray()
            case "scalar", (DType() as dtype, Raw() as content):
                result = PickledArray((), dtype, False, content)
            case "scalar", (DType() as dtype, _):
                result = PickledArray((), dtype, fault=AS_TEXT)
            case "_frombuffer", (content, DType() as dtype, tuple() as shape, order, *_):
                result = PickledArray(shape, dtype, order == "F", None, UNPLAIN)
                if isinstance(content, Raw) and order in ("C", "F"):
                    result.content = content
            case "dtype", (code, *_) if self.text_of(code) is not None:
                result = DType(str(self.text_of(code)))
            case "OrderedDict", ():
                result = Dict()
            case "_rebuild_tensor_v2", (Storage() as storage, offset, tuple(), tuple(), *_):
                result = _tensor(storage, integer_of(offset), *arguments[2:4])
                if storage.content is not None:
                    self.tensors.setdefault(storage.content, []).append(result)
            case "encode", (str(), *_):
                result = None  # bytes, written as text
            case _:
                self.refuse(f"{function.name} is called with arguments that arrays do not have")
        self.stack.append(result)

    def make_object(self) -> None:
        """NEWOBJ: only the wrapper of joblib."""
        arguments, of_class = self.pop(), self.pop()
        if of_class != NAMES["joblib.numpy_pickle.NumpyArrayWrapper"] or arguments != ():
            self.refuse("it contains an object of a class, which is never created")
        self.stack.append(Wrapper())

    def push_storage(self) -> None:
        """BINPERSID: only a storage of torch."""
        match self.pop():
            case ("storage", PickledName(name), key, _, items) if (
                self.storages and name in STORAGES
            ):
                content = self.storages.get(self.text_of(key) or "")
                self.stack.append(Storage(DType(STORAGES[name], self.order), content, items))
            case _:
                self.refuse("BINPERSID would create an object of a program, which is never done")

    def build(self) -> None:
        """BUILD: the state of a type, of an array, or of joblib's wrapper."""
        state, target = self.pop(), self.top()
        match target, state:
            case DType(), (_, order, subtype, names, fields, _, _, _, *_):
                target.order = self.text_of(order) or ""
                if not subtype is names is fields is None:  # arrays in arrays, or a structure
                    target.code = "V"
            case PickledArray(), (_, tuple() as shape, DType() as dtype, is_fortran, content):
                target.shape, target.dtype = shape, dtype
                target.is_fortran = is_fortran is True or integer_of(is_fortran) == 1
                target.content = content if isinstance(content, Raw | list) else None
                target.fault = AS_TEXT
            case Wrapper(), Dict():
                self.pop()
                self.stack.append(self._read_wrapped(state))
            case _:
                self.refuse("a state is set on something other than an array")

    def _read_wrapped(self, state: Dict) -> PickledArray:
        """The array whose bytes joblib puts after its wrapper and some padding."""
        if len(state.pairs) > MAX_STATE:
            self.refuse("a joblib wrapper has too many fields")
        known = {self.text_of(key): value for key, value in state.pairs if self.text_of(key)}
        shape, dtype, order = (known.get(key) for key in ("shape", "dtype", "order"))
        if not isinstance(shape, tuple) or not isinstance(dtype, DType) or order not in ("C", "F"):
            self.refuse("a joblib wrapper lacks shape, type or order")
        digits = dtype.code[1:]
        array = PickledArray(shape, dtype, order == "F")
        if not digits.isdecimal() or dtype.code[0] == "O":
            self.refuse(f"the joblib format of arrays of type {dtype.code!r} is unknown")
        size = size_of(array.lengths, int(digits) * (4 if dtype.code[0] == "U" else 1))
        start = self.at
        if known.get("numpy_array_alignment_bytes") is not None:
            start += 1 + (self.data[start] if start < len(self.data) else 0)
        if size is None or start + size > len(self.data):
            self.refuse("the bytes of a joblib array extend past the end")
        array.content = Raw(start, start + size, 0)
        self.at = start + size
        return array


def _tensor(
    storage: Storage, offset: int, shape: tuple[object, ...], strides: tuple[object, ...]
) -> PickledArray:
    """The array of a tensor, which has all numbers of its storage in order."""
    array = PickledArray(shape, storage.dtype, fault=VIEW)
    lengths = array.lengths
    plain = [prod(lengths[k + 1 :]) for k in range(len(lengths))]
    is_whole = offset == 0 and size_of(lengths, 1) == integer_of(storage.items)
    if is_whole and [*map(integer_of, strides)] == plain and isinstance(storage.items, Number):
        array.content, array.items = storage.content, storage.items
    return array


def _push_tuple(m: Machine, n: int) -> None:
    items = [m.pop() for _ in range(n)]
    m.stack.append(tuple(items[::-1]))


def _push_dict(m: Machine) -> None:
    items = m.pop_items()
    m.stack.append(Dict())
    m.extend(Dict, items)


def _pop_any(m: Machine) -> None:
    """POP takes a mark, too."""
    if m.marks and m.marks[-1] == len(m.stack):
        m.marks.pop()
    else:
        m.pop()


def _setitem(m: Machine) -> None:
    value, key = m.pop(), m.pop()
    m.extend(Dict, (key, value))


def _binary(m: Machine, start: int, stop: int) -> int:
    return int.from_bytes(m.data[start:stop], "little")


def _push_line_names(m: Machine, start: int, stop: int) -> None:
    module, name = m.data[start:stop].decode("utf-8").split("\n")
    m.push_name(module, name)


def _push_stack_names(m: Machine) -> None:
    name, module = m.pop(), m.pop()
    m.push_name(module, name)


OPERATIONS: dict[str, Callable[[Machine, int, int], None]] = {
    "PROTO": lambda m, a, b: None,
    "FRAME": Machine.enter_frame,
    "MARK": lambda m, a, b: m.marks.append(len(m.stack)),
    "POP": lambda m, a, b: _pop_any(m),
    "POP_MARK": lambda m, a, b: m.pop_items().clear(),
    "DUP": lambda m, a, b: m.stack.append(m.top()),
    "LIST": lambda m, a, b: m.stack.append(m.pop_items()),
    "FROZENSET": lambda m, a, b: m.stack.append(m.pop_items()),
    "TUPLE": lambda m, a, b: m.stack.append(tuple(m.pop_items())),
    "TUPLE1": lambda m, a, b: _push_tuple(m, 1),
    "TUPLE2": lambda m, a, b: _push_tuple(m, 2),
    "TUPLE3": lambda m, a, b: _push_tuple(m, 3),
    "DICT": lambda m, a, b: _push_dict(m),
    "SETITEM": lambda m, a, b: _setitem(m),
    "SETITEMS": lambda m, a, b: m.extend(Dict, m.pop_items()),
    "APPEND": lambda m, a, b: m.extend(list, (m.pop(),)),
    "APPENDS": lambda m, a, b: m.extend(list, m.pop_items()),
    "ADDITEMS": lambda m, a, b: m.extend(list, m.pop_items()),
    "MEMOIZE": lambda m, a, b: m.put(len(m.memo)),
    "PUT": lambda m, a, b: m.put(int(m.data[a:b])),
    "BINPUT": lambda m, a, b: m.put(_binary(m, a, b)),
    "LONG_BINPUT": lambda m, a, b: m.put(_binary(m, a, b)),
    "GET": lambda m, a, b: m.get(int(m.data[a:b])),
    "BINGET": lambda m, a, b: m.get(_binary(m, a, b)),
    "LONG_BINGET": lambda m, a, b: m.get(_binary(m, a, b)),
    "GLOBAL": _push_line_names,
    "STACK_GLOBAL": lambda m, a, b: _push_stack_names(m),
    "REDUCE": lambda m, a, b: m.call(),
    "BINPERSID": lambda m, a, b: m.push_storage(),
    "NEWOBJ": lambda m, a, b: m.make_object(),
    "BUILD": lambda m, a, b: m.build(),
}
