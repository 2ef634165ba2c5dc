# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""
Plain functions on records, interpreted or compiled by numba.

A kernel is a Python function of numbers, lists of numbers and records: arithmetic, `math`, `if`,
`for`, and calls of other kernels by name. It runs unchanged on dataclasses with lists (no numba
needed), and `compiled` turns it and every kernel that it calls into machine code that works on
NumPy records with the same field names (`pack`, `unpack`). Compiled code is cached in the user's
cache folder, in a folder named by a hash of the sources and of numba's version.
"""

from collections.abc import Callable, Iterator, Sequence
import contextlib
from dataclasses import fields, is_dataclass
import fcntl
from functools import cache
import hashlib
from itertools import count
import os
from pathlib import Path
import shutil
import types
from typing import Any

import numpy as np

PACKAGE = 'fam_bundle_ros'
#: Environment variable: any value but 0 disables numba.
PLAIN_VARIABLE = 'FAM_BUNDLE_PLAIN'


@cache
def numba() -> Any:
    """Return the numba module, or None where it is not installed or disabled."""
    if os.environ.get(PLAIN_VARIABLE, '0') != '0':
        return None
    try:
        import numba
        from numba.core.bytecode import FunctionIdentity
    except ImportError:
        return None

    def count_from_anywhere():
        FunctionIdentity._unique_ids = count(int.from_bytes(os.urandom(6), 'big'))

    # The names of compiled functions contain this counter, but not the sizes of records. If it
    # starts at 1 in each process, functions compiled for two and for three units in two processes
    # get one name, and a third process that loads both calls the wrong one (numba issue 10486).
    count_from_anywhere()
    os.register_at_fork(after_in_child=count_from_anywhere)
    return numba


# --- records -----------------------------------------------------------------------------------

def pack(instance: Any) -> np.void:
    """
    Return a NumPy record with the fields and values of a dataclass instance.

    Floats, integers, booleans, nested dataclasses, and lists (of lists) of numbers become fields
    of the same name. Two instances have one dtype when their lists have the same lengths.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> @dataclass
    ... class Chamber:
    ...     pressure: float
    ...     volume: list
    >>> float(pack(Chamber(2e5, [1e-5, 2e-5]))['volume'][1])
    2e-05
    """
    record = np.zeros(1, _dtype(instance))[0]
    _write(record, instance)
    return record


def pack_all(instances: Sequence[Any]) -> np.ndarray:
    """Return an array of records of instances of one dataclass."""
    records = np.zeros(len(instances), _dtype(instances[0]))
    for record, instance in zip(records, instances):
        _write(record, instance)
    return records


def unpack(record: np.void, instance: Any) -> None:
    """Write the values of a record back into the dataclass instance it was packed from."""
    for item in fields(instance):
        value, now = record[item.name], getattr(instance, item.name)
        if is_dataclass(now):
            unpack(value, now)
        elif isinstance(now, (list, np.ndarray)):
            now[:] = value.tolist()
        else:
            setattr(instance, item.name, value.item())


def _dtype(instance):
    def kind(value, annotation):
        if is_dataclass(value):
            return (_dtype(value),)
        array = np.asarray(value)
        if array.dtype.kind not in 'bif':
            raise TypeError(f'{type(instance).__name__} has a field of {array.dtype}; a record '
                            'holds numbers')
        # An integer in a float field becomes a float, so that a class has one dtype.
        number = 'f8' if 'float' in str(annotation) else {'b': '?', 'i': 'i8', 'f': 'f8'}[
            array.dtype.kind]
        return (number, array.shape) if array.shape else (number,)
    return np.dtype([(item.name, *kind(getattr(instance, item.name), item.type))
                     for item in fields(instance)], align=True)


def _write(record, instance):
    for item in fields(instance):
        value = getattr(instance, item.name)
        if is_dataclass(value):
            _write(record[item.name], value)
        else:
            record[item.name] = value


# --- compilation -------------------------------------------------------------------------------

@cache
def compiled(function: Callable) -> Callable:
    """
    Return a kernel as machine code, with every kernel that it calls.

    Raises
    ------
    RuntimeError
        When numba is not available; check with `numba` first.
    """
    engine = numba()
    if engine is None:
        raise RuntimeError('numba is not installed')
    key = fingerprint(function)
    with _cache_folder(key) as keep:
        made = engine.njit(error_model='numpy', cache=keep, _nrt=False)(
            _rebound(function, counted=False))
    if keep:
        made.compile = _one_at_a_time(made.compile, cache_root() / key)
    return made


def _one_at_a_time(compile_: Callable, folder: Path) -> Callable:
    """Return `compile_` with a file lock: one process compiles, the others load the result."""
    def locked(signature):
        with contextlib.ExitStack() as stack:
            # without the folder, or without locks on it, each process compiles for itself
            with contextlib.suppress(OSError):
                lock = os.open(folder, os.O_RDONLY)
                stack.callback(os.close, lock)
                fcntl.flock(lock, fcntl.LOCK_EX)
            return compile_(signature)
    return locked


@cache
def compiled_inside(function: Callable, counted: bool = True) -> Callable:
    """
    Return a kernel for use inside another one: compiled with it, without a file of its own.

    It can only be called by compiled code: a wrapper for Python would take a fifth of the
    compilation time. References to arrays are ``counted``, as a user's function may allocate
    arrays. Our own kernels do not, and counting takes a quarter of the time of a closed loop.
    """
    return numba().njit(error_model='numpy', _nrt=counted, no_cpython_wrapper=True,
                        no_cfunc_wrapper=True)(_rebound(function, counted))


def pointer(function: Callable, signature: str) -> Any:
    """
    Return a kernel as a C function that can be passed to compiled kernels as an argument.

    Kernels with such an argument are compiled once for all functions of that signature.

    Parameters
    ----------
    signature : str
        Signature in numba's notation, such as ``'float64(int64, float64[::1])'``.

    Raises
    ------
    NotCompiled
        When numba is not available, or cannot compile the function.
    """
    engine = numba()
    if engine is None:
        raise NotCompiled('numba is not installed')
    kernel = _rebound(function, counted=True)
    key = fingerprint(function)
    for _ in range(2):
        with _cache_folder(key) as keep:
            on_file = keep and os.path.exists(function.__code__.co_filename)
            try:
                return _pointer_type()(engine.cfunc(signature, cache=on_file,
                                                    error_model='numpy')(kernel))
            except Exception as error:  # numba raises many kinds, also by its own bugs
                cause = error
        shutil.rmtree(cache_root() / key, ignore_errors=True)  # the cache may be damaged
    raise NotCompiled(f'{function.__name__}: {cause}') from cause


class NotCompiled(RuntimeError):
    """A kernel cannot be compiled here; run it as it is."""


@cache
def _pointer_type():
    """Return the class of first-class functions; created at first use, because it needs numba."""
    protocol: Any = numba().types.WrapperAddressProtocol

    class Pointer(protocol):
        def __init__(self, made):
            self._made = made

        def __wrapper_address__(self):
            return self._made.address

        def signature(self):
            return self._made._sig
    return Pointer


def _rebound(function, counted):
    """Return the function with the kernels among its globals replaced by compiled ones."""
    names = dict(_globals(function))
    for name, value in names.items():
        if isinstance(value, types.FunctionType):
            names[name] = compiled_inside(value, counted)
        elif hasattr(value, 'compiled_names'):
            names[name] = value.compiled_names(counted)
    # the cache is looked up by this module name; a user's file may not be importable later
    names['__name__'] = __name__
    return types.FunctionType(function.__code__, names, function.__name__,
                              function.__defaults__, function.__closure__)


class Alternative:
    """
    A kernel and a ``plain`` version of it, with the same arguments and results, for plain Python.

    The latter may be faster there, such as one call on arrays instead of a loop.
    """

    def __init__(self, kernel: Callable, plain: Callable):
        self.kernel, self.plain = kernel, plain

    def __call__(self, *values: Any) -> Any:
        """Run the plain version."""
        return self.plain(*values)

    def compiled_names(self, counted: bool = True) -> Callable:
        """Return the compiled version for use in compiled code; see `compiled_inside`."""
        return compiled_inside(self.kernel, counted)


def _globals(function) -> Iterator[tuple[str, Any]]:
    """Yield the global names that a function uses, with their values."""
    for name in function.__code__.co_names:
        if name in function.__globals__:
            yield name, function.__globals__[name]


def fingerprint(function: Callable) -> str:
    """Return a hash of the code of a kernel and of all that it calls, and of numba's version."""
    seen: dict[Callable, None] = {}

    def walk(kernel):
        if kernel not in seen:
            seen[kernel] = None
            for _, value in _globals(kernel):
                value = value.kernel if isinstance(value, Alternative) else value
                if isinstance(value, types.FunctionType):
                    walk(value)
                elif hasattr(value, 'compiled_names'):
                    for word in vars(value.compiled_names()).values():
                        if hasattr(word, 'py_func'):
                            walk(word.py_func)
    walk(function)
    # 2: version of the cache, since functions are counted from a random number
    digest = hashlib.sha256(f'2 {numba().__version__}'.encode())
    for kernel in seen:
        code = kernel.__code__
        numbers = [(n, v) for n, v in _globals(kernel) if isinstance(v, (int, float))]
        digest.update(repr((kernel.__qualname__, code.co_code, code.co_names,
                            [c for c in code.co_consts if not isinstance(c, types.CodeType)],
                            numbers)).encode())
    return digest.hexdigest()[:16]


def cache_root() -> Path:
    """Return the folder of compiled code; XDG_CACHE_HOME moves it."""
    base = os.environ.get('XDG_CACHE_HOME') or Path.home() / '.cache'
    return Path(base) / PACKAGE


@contextlib.contextmanager
def _cache_folder(key):
    """Set numba's cache folder for functions compiled in the block; yield if it is writable."""
    config = numba().config
    folder, before = cache_root() / key, config.CACHE_DIR
    try:
        folder.mkdir(parents=True, exist_ok=True)
        keep = os.access(folder, os.W_OK)
    except OSError:
        keep = False
    config.CACHE_DIR = str(folder) if keep else before
    try:
        yield keep
    finally:
        config.CACHE_DIR = before
