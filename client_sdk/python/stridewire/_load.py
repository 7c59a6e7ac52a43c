"""Loads libstridewire-client."""

import ctypes as c
import os

from . import _abi


def load() -> c.CDLL:
    """Loads the library: STRIDEWIRE_CLIENT_LIBRARY, or the installed one with this ABI version."""
    name = os.environ.get("STRIDEWIRE_CLIENT_LIBRARY",
                          f"libstridewire-client.so.{_abi.ABI_VERSION}")
    try:
        library = c.CDLL(name)
    except OSError as error:
        raise ImportError(
            f"cannot load {name}: {error}. Install the client library (cmake --install BUILD "
            "--component client) and run ldconfig, or set STRIDEWIRE_CLIENT_LIBRARY to its path"
        ) from error
    for name, (result, arguments) in _abi.FUNCTIONS.items():
        function = getattr(library, name)
        function.restype = result
        function.argtypes = arguments
    return library
