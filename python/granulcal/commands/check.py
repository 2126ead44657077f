"""The word `check`: what a model was made from, and whether its posteriors hold the truth."""

import argparse
from typing import TYPE_CHECKING, Any

from granulcal.commands.dry_run import add_dry_run, say_seconds
from granulcal.commands.exit_code import DONE, UNHEALTHY
from granulcal.commands.other_prior import difference
from granulcal.commands.reading import TRAINING
from granulcal.paths import READS, writes
from granulcal.starter.models import model_named

if TYPE_CHECKING:
    from granulcal.bayessim import BayesSim
    from granulcal.bayessim.training.pairs import TrainingPairs
    from granulcal.pours.dataset import Dataset
    from granulcal.prior import Prior

__all__ = ["add"]


def add(commands: Any) -> None:
    """Adds the word to the command line."""
    text = "say what a model was made from and whether its posteriors hold the truth"
    parser = commands.add_parser("check", help=text, description=text)
    parser.add_argument("model", type=READS, help="folder of `train`")
    parser.add_argument(
        "--data", type=READS, help="pours that the model was not trained on, to check it with"
    )
    parser.add_argument(
        "--plots",
        type=writes("plots"),
        help="write coverage.png, sbc.png and training.png to this folder",
    )
    add_dry_run(parser, by="ten pours of --data")
    parser.add_argument("--json", action="store_true", help="print JSON at the end")
    parser.set_defaults(run=_run, tells=True)


def _run(options: argparse.Namespace) -> int:
    from granulcal.bayessim import BayesSim
    from granulcal.progress import shown

    model = BayesSim.load(model_named(options.model))
    pairs = None if options.data is None else _pairs(options, model)
    if options.dry_run:
        return _say_how_long(options, model, pairs)
    print(model.summary)
    calibration, known = model.calibration, model.identifiability
    if pairs is not None:
        print(f"on the {len(pairs.theta)} usable pours of {options.data}:")
        with shown():
            calibration, known = model.examine(pairs.theta, pairs.x)
    options.told["model"] = str(options.model)
    options.told["calibrated"] = None if calibration is None else calibration.is_calibrated
    if calibration is None:
        print("  not checked: too few pours to keep some aside; give some with --data")
        return UNHEALTHY
    print(calibration)
    options.told |= {
        "failures": list(calibration.failures),
        "gain_nat": calibration.gain,
        "coverage": [vars(count) for count in calibration.coverage.counts],
        "rank_p_values": calibration.ranks.p_values.tolist(),
        "tarp_p_value": calibration.tarp.p_value,
        "identifiability": None if known is None else known.as_dict(),
    }
    if known is not None:
        print(known)
    if options.plots is not None:
        calibration.plot(options.plots)
        if model.summary.plot(options.plots / "training.png") is None:
            print("no training.png: the posterior is the emulator's alone, no network was kept")
        print(f"plots written to {options.plots}")
    return DONE if calibration.is_calibrated else UNHEALTHY


def _pairs(options: argparse.Namespace, model: "BayesSim") -> "TrainingPairs":
    from granulcal.bayessim.model import FEWEST_TO_CHECK
    from granulcal.bayessim.training.own_pours import require_own_pours
    from granulcal.bayessim.training.pairs import TrainingPairs
    from granulcal.calibrate import require_same_scene
    from granulcal.pours.dataset import Dataset

    data = Dataset.load(options.data)
    _require_same_prior(options, data.prior, model.prior)
    if model.scene_toml is not None:
        require_same_scene(model, data.scene)
    if lacking := [name for name in model.x_names if name not in data.x_names]:
        raise ValueError(
            f"{options.data} has no {', '.join(lacking)}, which the model is of; it has "
            f"{', '.join(data.x_names)}"
        )
    # The model may be of some of them.
    pairs = TrainingPairs.gather(
        dict(zip(data.theta_names, data.theta.T, strict=True)),
        data.x[:, [data.x_names.index(name) for name in model.x_names]],
        prior=model.prior,
        status=data.status.tolist(),
        x_names=model.x_names,
        fewest=FEWEST_TO_CHECK,
    )
    training = model_named(options.model) / TRAINING
    if training.exists():
        seen = Dataset.load(training)
        require_own_pours(model, seen, training)
        _require_unseen(options, pairs, seen)
    return pairs


def _require_same_prior(options: argparse.Namespace, found: "Prior", own: "Prior") -> None:
    """Refuses pours of another prior than the model's, under which its intervals need not hold.

    Raises:
        ValueError: says what differs.
    """
    what = difference(found, own)
    if not what:
        return
    raise ValueError(
        f"{options.data} was drawn from another prior than the model's: {what}. A check needs "
        "pours of `granulcal generate` with the model's prior and another --seed"
    )


def _require_unseen(
    options: argparse.Namespace, pairs: "TrainingPairs", training: "Dataset"
) -> None:
    """Refuses pours that the model was trained on.

    Raises:
        ValueError: some are among the training data.
    """
    seen = {row.tobytes() for row in training.theta}
    count = sum(row.tobytes() in seen for row in pairs.theta)
    if count:
        raise ValueError(
            f"{count} of the {len(pairs.theta)} pours of {options.data} are among those that "
            f"{options.model} was trained on: a check needs pours that it has not seen, "
            "as `granulcal generate` makes with another --seed"
        )


def _say_how_long(
    options: argparse.Namespace, model: "BayesSim", pairs: "TrainingPairs | None"
) -> int:
    from granulcal.bayessim.training.time_needed import check_time

    if pairs is None:
        return say_seconds(options, 0.0, "the check of the training is shown again")
    text = f"{len(pairs.theta)} posteriors"
    return say_seconds(options, check_time(model, pairs), text, posteriors=len(pairs.theta))
