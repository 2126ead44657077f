"""Hashes of a model's document and of each of its tensors: bits that have turned are found.

They stand as metadata in the file of the tensors, `hash.model.json` and `hash.NAME`, where versions
of before do not mind them.
"""

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granulcal import _native
from granulcal.errors import ModelFormatError

__all__ = ["hashes", "in_order", "verify"]

_PREFIX, _DOCUMENT = "hash.", "hash.model.json"
_TYPES = {"float64": "F64", "float32": "F32", "uint8": "U8", "int64": "I64", "bool": "BOOL"}


def hashes(document: bytes, tensors: dict[str, NDArray[Any]]) -> dict[str, str]:
    """Returns the hash of the document and of every tensor, by the names of the metadata."""
    named = {f"{_PREFIX}{name}": _hash(name, array) for name, array in tensors.items()}
    return {_DOCUMENT: _native.hash_bytes(document), **named}


def verify(
    document: bytes,
    document_path: Path,
    data: bytes,
    tensors: dict[str, NDArray[Any]],
    tensors_path: Path,
) -> bool:
    """Returns whether the files have hashes.

    Raises:
        ModelFormatError: a document or a tensor is not what was written; it is named.
    """
    stated = _metadata(data)
    if not any(name.startswith(_PREFIX) for name in stated):
        return False
    for name, found in hashes(document, tensors).items():
        if stated.get(name) != found:
            is_document = name == _DOCUMENT
            where = document_path if is_document else tensors_path
            what = "the document" if is_document else f"tensor {name.removeprefix(_PREFIX)}"
            raise ModelFormatError(
                f"{where}: {what} is damaged: its hash is {found}, written was "
                f"{stated.get(name, 'none')}; take a copy, or train again"
            )
    return True


def in_order(data: bytes) -> bytes:
    """Returns a file of tensors with its metadata in order: one model, the same bytes."""
    (length,) = struct.unpack("<Q", data[:8])
    header = json.loads(data[8 : 8 + length])
    header["__metadata__"] = dict(sorted(header["__metadata__"].items()))
    text = json.dumps(header, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 8)
    return struct.pack("<Q", len(text)) + text + data[8 + length :]


def _hash(name: str, array: NDArray[Any]) -> str:
    kind = _TYPES.get(str(array.dtype), str(array.dtype))
    head = f"{name} {kind} {list(array.shape)}\n"
    return _native.hash_bytes(head.encode() + np.ascontiguousarray(array).tobytes())


def _metadata(data: bytes) -> dict[str, str]:
    """Text of the header: eight bytes of its length, then JSON. The reader has checked it."""
    (length,) = struct.unpack("<Q", data[:8])
    found = json.loads(data[8 : 8 + length]).get("__metadata__", {})
    return found if isinstance(found, dict) else {}
