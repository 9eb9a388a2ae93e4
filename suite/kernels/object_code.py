"""From LLVM's text to functions in memory, by way of object code in the cache folder."""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import llvmlite
import llvmlite.binding as llvm
from numba.core.typing.templates import Signature
from numba.extending import intrinsic

from suite.errors import InputError
from suite.files import written_whole
from suite.kernels import cache as kept
from suite.kernels import types as nb
from suite.kernels.cache import compile_kernel, numba

# LLVM's effort: there are no loops, and nothing is written twice; more gains no speed and costs a long chain seconds.
LEVEL = 1
DIGEST = hashlib.sha256().digest_size

# An engine owns the code that it holds: addresses are valid as long as it lives.
_loaded: dict[str, Any] = {}


class Address:
    """A compiled function as its address.

    `_numba_type_` and `__wrapper_address__` are numba's protocols for objects with a known type and for functions.
    """

    _numba_type_ = nb.MODEL

    def __init__(self, address: int) -> None:
        self.address = address

    def __wrapper_address__(self) -> int:
        return self.address

    def __call__(self, t: float, *arrays: Any) -> None:
        call_model(self.address, t, *arrays)


@intrinsic
def _call(typing_context: Any, address: Any, t: Any, x: Any, u: Any, p: Any, on: Any, v: Any, vx: Any, vp: Any) -> Any:
    """Call the model's function at an address."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        function = builder.inttoptr(arguments[0], context.get_value_type(nb.MODEL.ftype))
        builder.call(function, arguments[1:])
        return context.get_dummy_value()

    return Signature(nb.types.void, (nb.INT, *nb.MODEL_FUNCTION.args), None), generate


@compile_kernel(nb.types.void(nb.INT, *nb.MODEL_FUNCTION.args))
def call_model(address: int, t: float, x: Any, u: Any, p: Any, on: Any, v: Any, vx: Any, vp: Any) -> None:
    """The model's function at an address, called from Python. Writes v, vx and vp."""
    _call(address, t, x, u, p, on, v, vx, vp)  # pyright: ignore[reportCallIssue]  (numba adds the first)


def load(key: str, text: Callable[[], str]) -> Callable[[str], Address]:
    """Addresses, by name, of the functions in a module's text: from memory, from the cache folder, or compiled now.

    `key` says everything that the text follows from; the text is asked for only where nothing is kept.
    """
    name = hashlib.sha256(f"{key} {_machine()}".encode()).hexdigest()[:24]
    if name not in _loaded:
        place = kept.folder()
        path = None if place is None else place / f"model_{name}.o"
        code = None if path is None else _read(path)
        if code is None:
            code = _compiled(text())
            if path is not None:
                _write(path, code)
        engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), _target())
        engine.add_object_file(llvm.ObjectFileRef.from_data(code))
        engine.finalize_object()
        _loaded[name] = engine
    engine = _loaded[name]
    return lambda function: Address(engine.get_function_address(function))


@cache
def _machine() -> str:
    """What object code depends on beside the text: another processor or version has files of its own."""
    version = ".".join(map(str, llvm.llvm_version_info))
    return f"{llvm.get_process_triple()} {_processor()} LLVM {version} {llvmlite.__version__} {numba.__version__}"


@cache
def _processor() -> tuple[str, str]:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()


def _target() -> Any:
    cpu, features = _processor()
    target = llvm.Target.from_triple(llvm.get_process_triple())
    return target.create_target_machine(cpu=cpu, features=features, opt=LEVEL, jit=True)


def _compiled(text: str) -> bytes:
    module, machine = llvm.parse_assembly(text), _target()
    module.triple, module.data_layout = machine.triple, str(machine.target_data)
    tuning = llvm.create_pipeline_tuning_options(speed_level=LEVEL)
    tuning.slp_vectorization = False
    builder = llvm.create_pass_builder(machine, tuning)
    builder.getModulePassManager().run(module, builder)
    return bytes(machine.emit_object(module))


def _read(path: Path) -> bytes | None:
    """The code in a file that is whole; LLVM would end the process over a broken one."""
    try:
        content = path.read_bytes()
    except OSError:
        return None
    digest, code = content[:DIGEST], content[DIGEST:]
    return code if hashlib.sha256(code).digest() == digest else None


def _write(path: Path, code: bytes) -> None:
    """Whole, as others may write the same file; a full disk costs time, not results."""
    with contextlib.suppress(InputError), written_whole(path) as fresh:
        fresh.write_bytes(hashlib.sha256(code).digest() + code)
