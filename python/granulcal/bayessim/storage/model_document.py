"""The document of a model, `model.json`: read and checked alone, without tensors and torch."""

from os import PathLike
from pathlib import Path
from typing import Any

from granulcal import _native
from granulcal.bayessim.storage.model_schema import check_model
from granulcal.bayessim.storage.place import MODEL_JSON
from granulcal.documents import LARGEST_DOCUMENT, parse_json, read_bytes
from granulcal.errors import ModelFormatError

__all__ = ["FORMAT", "OLDER_VERSIONS", "VERSION", "read_model_document"]

FORMAT, VERSION = "granulcal-bayessim", 4
# Of these the emulator's weight is that of an arithmetic average.
OLDER_VERSIONS = (3,)


def read_model_document(folder: str | PathLike[str]) -> tuple[bytes, dict[str, Any]]:
    """Returns the text of the document in a model's folder, and what it says.

    Raises:
        FileNotFoundError: there is none.
        ModelFormatError: it is no model's, of a version that cannot be read, or damaged.
    """
    where = Path(folder) / MODEL_JSON
    text = read_bytes(where, most=LARGEST_DOCUMENT)
    document = parse_json(text, where, error=ModelFormatError)
    _check_header(document, where)
    check_model(document, where)
    return text, document


def _check_header(document: Any, where: Path) -> None:
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise ModelFormatError(f"{where} is not a {FORMAT} file")
    found = document.get("version")
    if (
        isinstance(found, bool)
        or not isinstance(found, int)
        or found not in (*OLDER_VERSIONS, VERSION)
    ):
        made_by = document.get("made_by", "an earlier granulcal")
        newer = isinstance(found, int) and found > VERSION
        advice = "update granulcal" if newer else "train the model again"
        raise ModelFormatError(
            f"{where}: version must be {_versions()} (granulcal {_native.__version__}), "
            f"got {found!r} (made by {made_by}): {advice}"
        )


def _versions() -> str:
    """The versions that can be read, in words."""
    return " or ".join(str(version) for version in (*OLDER_VERSIONS, VERSION))
