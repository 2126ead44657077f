"""Damage of every kind to a file: bits, lengths, and numbers and words where others belong."""

import re
from collections.abc import Iterator

import numpy as np

__all__ = ["mutations"]

# What a hand, a shell script or an attacker writes where a number or a word stood.
_WORDS = [
    b"0", b"-1", b"1e308", b"-1e308", b"1e-320", b"NaN", b"nan", b"Infinity", b"inf", b"true",
    b"null", b"[]", b"{}", b'""', b'"false"', b"[[1]]", b"9" * 400, b"1" * 30, b"0.1.2", b"'",
    b'"' + b"x" * 5000 + b'"', b"[" * 3000, b'{"a":' * 2000, b"\xff\xfe", b"\x00",
]  # fmt: skip
_TOKEN = re.compile(rb'-?\d+\.?\d*(?:[eE][-+]?\d+)?|"[^"\n]{0,80}"|true|false|null')


def mutations(data: bytes, count: int, *, seed: int, is_text: bool) -> Iterator[bytes]:
    """Yields `count` damaged copies of `data`, always the same."""
    generator = np.random.default_rng(seed)
    tokens = list(_TOKEN.finditer(data)) if is_text else []
    for _ in range(count):
        if tokens and generator.random() < 0.6:
            yield _replaced(data, tokens, generator)
        else:
            yield _broken(data, generator)


def _replaced(data: bytes, tokens: list[re.Match[bytes]], generator: np.random.Generator) -> bytes:
    token = tokens[generator.integers(len(tokens))]
    word = _WORDS[generator.integers(len(_WORDS))]
    return data[: token.start()] + word + data[token.end() :]


def _broken(data: bytes, generator: np.random.Generator) -> bytes:
    at = int(generator.integers(len(data)))
    length = int(min(generator.integers(1, 64), len(data) - at))
    match int(generator.integers(6)):
        case 0:
            return (
                data[:at] + bytes([data[at] ^ (1 << int(generator.integers(8)))]) + data[at + 1 :]
            )
        case 1:
            return data[:at]
        case 2:
            return data[:at] + data[at + length :]
        case 3:
            return data[:at] + data[at : at + length] * 3 + data[at + length :]
        case 4:
            return data[:at] + generator.bytes(length) + data[at + length :]
        case _:
            # The largest number of its width, where a length may stand.
            return data[:at] + b"\xff" * min(length, 8) + data[at + min(length, 8) :]
