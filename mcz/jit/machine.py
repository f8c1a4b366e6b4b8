"""LLVM, by way of llvmlite: text of its assembly made into machine code, and code made callable.

No flag lets it reorder or fuse what is computed: every float64 comes out as written.
"""

from __future__ import annotations

import ctypes
from functools import cache
from typing import Any

import llvmlite
import llvmlite.binding as llvm


@cache
def _target() -> Any:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm.Target.from_default_triple().create_target_machine(
        cpu=llvm.get_host_cpu_name(), features=_features(), opt=2, jit=True, codemodel="jitdefault"
    )


def _features() -> str:
    return str(llvm.get_host_cpu_features().flatten())


@cache
def identity() -> str:
    """All that machine code depends on beside what it was compiled from."""
    return f"{llvmlite.__version__} {llvm.get_host_cpu_name()} {_features()}"


def compile_assembly(text: str) -> bytes:
    """Object code of a module, optimized."""
    module = llvm.parse_assembly(text)
    module.verify()
    tuning = llvm.create_pipeline_tuning_options(speed_level=2)
    tuning.loop_vectorization = True
    tuning.slp_vectorization = False
    builder = llvm.create_pass_builder(_target(), tuning)
    builder.getModulePassManager().run(module, builder)
    return bytes(_target().emit_object(module))


@cache
def _engine() -> Any:
    return llvm.create_mcjit_compiler(llvm.parse_assembly(""), _target())


def load(code: bytes, name: str) -> int:
    """The address of the function ``name`` of object code, which stays loaded."""
    _engine().add_object_file(llvm.ObjectFileRef.from_data(code))
    _engine().finalize_object()
    return int(_engine().get_function_address(name))


C_TYPES: dict[str, Any] = {
    "i64": ctypes.c_int64,
    "double": ctypes.c_double,
    "i1": ctypes.c_bool,
    "ptr": ctypes.c_void_p,
}


def function_at(address: int, result: str | None, parameters: list[str]) -> Any:
    """The function at an address, to be called with numbers; other threads run meanwhile."""
    kinds = [C_TYPES[parameter] for parameter in parameters]
    return ctypes.CFUNCTYPE(C_TYPES[result] if result else None, *kinds)(address)
