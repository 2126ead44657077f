"""What `model.json` must hold, version by version."""

from pathlib import Path
from typing import Any

from granulcal.documents import (
    Flag,
    ListOf,
    Mapping,
    Maybe,
    Number,
    OneOf,
    Schema,
    Table,
    Text,
    Whole,
    check,
)
from granulcal.errors import ModelFormatError

__all__ = ["check_model"]

_COUNT = Whole(0)
_SOME = Whole(1, 1_000_000)
_SHARE = Number(0, 1)
_NAMES = ListOf(Text(), least=1)
_NUMBERS = ListOf(Number())
_LOSSES = ListOf(Maybe(Number()))
_DEGREES = Number(0.1, 1e6)

_CONFIG = Table(
    {
        "method": Text(),
        "kernel": Text(),
        "features": _SOME,
        "components": OneOf((ListOf(_SOME, least=1), _SOME)),
        "ensemble": _SOME,
        "emulator_features": _SOME,
    },
    {
        "length_scale": Number(0),
        "snr": Flag(),
        "linear_start": Flag(),
        "jitter": Number(0),
        "learning_rate": Number(0),
        "batch_size": _SOME,
        "max_epochs": _SOME,
        "patience": _SOME,
        "validation_share": _SHARE,
        "test_share": _SHARE,
        "weight_decay": Number(0),
        "synthetic": Whole(1),
    },
)
_SUMMARY = Table(
    {
        "method": Text(),
        "choice": Text(),
        "pair_count": _COUNT,
        "train_count": _COUNT,
        "test_count": _COUNT,
        "excluded": Mapping(_COUNT),
        "horizon_count": _COUNT,
        "best_epochs": ListOf(_COUNT),
        "train_losses": _LOSSES,
        "validation_losses": _LOSSES,
        "curve": ListOf(ListOf(Maybe(Number()), least=2)),
        "notes": ListOf(Text()),
    },
    {"status": Text(), "validation_count": _COUNT, "epoch_count": _COUNT},
)
_IDENTIFIABILITY = Table(
    {
        "names": _NAMES,
        "gains": _NUMBERS,
        "effective_dimension": Number(),
        "ridge": _NUMBERS,
        "ridge_spread": Number(),
        "blind": ListOf(Text()),
    }
)
_CALIBRATION = Table(
    {
        "names": _NAMES,
        "prior_loss": Number(),
        "posterior_losses": ListOf(Maybe(Number()), least=1),
        "truth_levels": _NUMBERS,
        "counts": ListOf(
            Table(
                {
                    "level": _SHARE,
                    "inside": _COUNT,
                    "total": _COUNT,
                    "low": _COUNT,
                    "high": _COUNT,
                }
            )
        ),
        "ranks": ListOf(ListOf(_COUNT)),
        "rank_draws": _SOME,
        "rank_p_values": _NUMBERS,
        "tarp_shares": _NUMBERS,
        "tarp_p_value": Number(),
    },
    {"chose_form": Flag()},
)
_WEIGHT = Number(0, 1e6)


def _schema(version: int) -> Schema:
    of_version: dict[str, Schema] = {}
    if version >= 4:
        of_version = {"average": Text(("geometric", "arithmetic")), "network_weight": _WEIGHT}
    return Table(
        {
            "prior_toml": Text(),
            "x_names": _NAMES,
            "config": _CONFIG,
            "scene_toml": Maybe(Text()),
            "has_network": Flag(),
            "emulator_weight": _WEIGHT,
            "emulator": Table(
                {
                    "widening": Number(1e-3, 1e3),
                    "degrees": _DEGREES,
                    "leading_degrees": _DEGREES,
                    "axis_count": _SOME,
                }
            ),
            "summary": _SUMMARY,
            "identifiability": Maybe(_IDENTIFIABILITY),
            "calibration": Maybe(_CALIBRATION),
            **of_version,
        },
        {"is_calibrated": Maybe(Flag()), "law": Maybe(Whole(0, 2**32 - 1))},
        open=True,
    )


def check_model(document: Any, where: Path) -> None:
    """Checks the document of a model whose version is known to be read.

    Raises:
        ModelFormatError: names the file, the entry, what was found and what is allowed.
    """
    check(document, _schema(document["version"]), where, error=ModelFormatError)
    axes, statistics = document["emulator"]["axis_count"], len(document["x_names"])
    if axes > statistics:
        raise ModelFormatError(
            f"{where}: emulator.axis_count must be at most {statistics}, the number of statistics, "
            f"got {axes}"
        )
    for part, lists in (
        ("identifiability", ("gains", "ridge")),
        ("calibration", ("rank_p_values",)),
    ):
        found = document[part]
        if found is None:
            continue
        for name in lists:
            if len(found[name]) != len(found["names"]):
                raise ModelFormatError(
                    f"{where}: {part}.{name} must have as many numbers as there are names, "
                    f"{len(found['names'])}, got {len(found[name])}"
                )
    calibration = document["calibration"] or {}
    for row in calibration.get("ranks", []):
        if len(row) != len(calibration["names"]):
            raise ModelFormatError(f"{where}: calibration.ranks must have a column for each name")
