"""The words `design rings` and `design spill` of the command line."""

import argparse
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from granulcal.commands.counts import seed_number, thread_count
from granulcal.commands.dry_run import add_dry_run, say_how_long
from granulcal.commands.exit_code import DONE, UNHEALTHY
from granulcal.commands.numbers import at_least, positive, probability
from granulcal.commands.setting import require_apart, setting
from granulcal.paths import READS, writes

if TYPE_CHECKING:
    from granulcal.design.posterior_file import PosteriorDraws
    from granulcal.design.ring import Ring
    from granulcal.design.ring_model import RingModel
    from granulcal.pours.left_out import LeftOut

__all__ = ["add"]

_TEXT = "plan pours: the height of the funnel for a wanted ring, or the grains that a height spills"
_RINGS = """\
Find the height of the funnel for wanted rings and piles about one axis, and
write a pour plan.

A ring is two radii in metres: within the inner one lie 5 % of a pour's grains,
within the outer one half. A pile is its outer radius alone. SCENE holds the
grains and their material:

  granulcal design rings couscous.toml --ring 0.136 0.223 --pile 0.034 -o plan
  granulcal design rings funnel --posterior couscous.json --pile 0.034 -o plan

--posterior takes the most probable material of that file, made by `infer -o` or
`calibrate`. The first call simulates --pours pours from heights drawn between
--heights and trains a model; it goes on after an interruption, and later calls
with the same scene, heights, pours and seed use what is there. Or give the
folder of `granulcal train`, of pours that vary funnel.height alone and observe
radius[5] and radius[50].

Written to -o: plan.csv and plan.json (height with its 90 % interval, expected
radii with the spread between pours, all in metres), plan.png (all pours
simulated one after another). A ring beyond the heights of the training is
refused unless --extrapolate, radii that no height gives together always. Exit
code 3: pours are unhealthy, jam the plan or do not come to rest in it, the
model fails its own check, or the posterior is outside its model.
"""
_SPILL = """\
Find the probability that a pour spills grains, against the height of the
funnel.

SCENE has a funnel, something to pour into, and an [observe.spill] table
(examples/bowl.toml). Pours from heights between --heights are simulated (it
goes on after an interruption) and the number of spilled grains is modelled, so
that each --grains k has its P(spilled >= k) with a 90 % band:

  granulcal design spill examples/bowl.toml --grains 1 10 50 -o spill
  granulcal design spill bowl.toml --posterior couscous.json -o spill

With --posterior every pour has a material of its own from that file, and the
band holds what is not known of the material; without it the scene's material is
taken as known. Written to -o: pours.json, spill.csv and spill.json (heights in
metres), spill.png. Exit code 3: pours are unhealthy, or the posterior is
outside its model.
"""


def add(commands: Any) -> None:
    """Adds the word to the command line."""
    parser = commands.add_parser("design", help=_TEXT, description=_TEXT)
    parser.set_defaults(run=lambda _: parser.print_help() or 2)
    words = parser.add_subparsers(title="what to design", metavar="WORD", dest="word")
    _add_rings(words)
    _add_spill(words)


def _add_common(
    parser: argparse.ArgumentParser,
    *,
    kind: str,
    pours: int,
    fewest: int,
    heights: tuple[float, ...],
) -> None:
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        type=setting,
        metavar="PATH=NUMBER",
        help="another number of the scene, as material.restitution=0.5, and none that --posterior has; may be repeated",
    )
    parser.add_argument("--posterior", type=READS, help="JSON of `infer -o` or `calibrate`")
    parser.add_argument(
        "--heights",
        nargs=2,
        type=float,
        metavar=("LOW", "HIGH"),
        default=heights,
        help=f"heights of the funnel's tip in metres (default: {heights[0]:g} {heights[1]:g})",
    )
    parser.add_argument(
        "--pours",
        type=at_least(fewest),
        default=pours,
        help=f"how many, at least {fewest} (default: {pours})",
    )
    parser.add_argument(
        "-o", "--out", type=writes(kind), required=True, help="folder; holds the pours"
    )
    parser.add_argument(
        "--seed", type=seed_number, default=0, help="seed of everything (default: 0)"
    )
    parser.add_argument("--threads", type=thread_count, help="pours at once (default: all cores)")
    add_dry_run(parser)
    parser.add_argument("--engine", help="another simulator in place of ours: docs/engines.md")
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")


def _add_rings(words: Any) -> None:
    parser = words.add_parser(
        "rings",
        help="heights for wanted rings and piles, as a pour plan",
        description=_RINGS,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("scene", type=READS, help="TOML, the word funnel, or folder of `train`")
    parser.add_argument(
        "--ring",
        nargs=2,
        type=float,
        action="append",
        default=[],
        metavar=("INNER", "OUTER"),
        help="radii [m] within which 5 %% and 50 %% of the grains lie; may be repeated",
    )
    parser.add_argument(
        "--pile",
        type=float,
        action="append",
        default=[],
        metavar="OUTER",
        help="radius [m] within which half of the grains lie; may be repeated",
    )
    parser.add_argument(
        "--tolerance",
        type=positive,
        default=0.1,
        help="how far a radius may be off, over the outer radius (default: 0.1)",
    )
    parser.add_argument(
        "--extrapolate", action="store_true", help="flag what lies beyond the training's heights"
    )
    parser.add_argument(
        "--held-out",
        type=at_least(2),
        metavar="N",
        help="infer the heights of N more pours, at least 2, and say how far they are off",
    )
    _add_common(parser, kind="rings", pours=400, fewest=50, heights=(0.01, 0.13))
    parser.set_defaults(run=_with_engine(_rings), goes_on=True)


def _add_spill(words: Any) -> None:
    parser = words.add_parser(
        "spill",
        help="probability of spilling k grains against the height",
        description=_SPILL,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("scene", type=READS, help="TOML with an [observe.spill] table")
    parser.add_argument(
        "--grains",
        type=int,
        nargs="+",
        default=[1, 10, 50],
        metavar="K",
        help="numbers of grains whose spilling is asked for (default: 1 10 50)",
    )
    parser.add_argument(
        "--at-most",
        type=probability,
        default=0.05,
        metavar="P",
        help="say from which height on each K is more probable than P (default: 0.05)",
    )
    _add_common(parser, kind="spill", pours=200, fewest=20, heights=(0.06, 0.3))
    parser.set_defaults(run=_with_engine(_spill), goes_on=True)


def _with_engine(
    command: Callable[[argparse.Namespace], int],
) -> Callable[[argparse.Namespace], int]:
    """Returns a command whose pours are by the engine of its options."""

    def run(options: argparse.Namespace) -> int:
        from granulcal.engines import engine_named, pouring_with

        with pouring_with(None if options.engine is None else engine_named(options.engine)):
            return _dry_run(options) if options.dry_run else command(options)

    return run


def _dry_run(options: argparse.Namespace) -> int:
    from granulcal.design.ring_model import RingModel, height_prior

    if options.scene.is_dir() and options.word == "rings":
        # A trained model pours what is held out, and the plan.
        _require_no_scene(options)
        model, pours = RingModel.load(options.scene), len(_wanted(options))
        pours += options.held_out or 0
        return say_how_long(options, model.scene, model.bayes.prior, pours)
    scene = _scene(options)
    if (draws := _draws(options)) is not None:
        scene = draws.at_mode(scene)
    return say_how_long(options, scene, height_prior(tuple(options.heights)), options.pours)


def _wanted(options: argparse.Namespace) -> "list[Ring]":
    """Returns the rings and piles that are asked for.

    Raises:
        ValueError: nothing is, and no pour is held out either.
    """
    from granulcal.design.ring import Ring

    rings = [Ring(outer=outer, inner=inner) for inner, outer in options.ring]
    rings += [Ring(outer=outer) for outer in options.pile]
    if not rings and options.held_out is None:
        raise ValueError("nothing is wanted: give --ring INNER OUTER, --pile OUTER or --held-out N")
    return rings


def _rings(options: argparse.Namespace) -> int:
    from granulcal.design.pattern import simulate_plan
    from granulcal.design.picture import plan_picture
    from granulcal.design.rings import design_rings

    rings = _wanted(options)
    model, is_inside = _ring_model(options)
    print(model, file=sys.stderr if options.json else sys.stdout)
    unusable = model.unusable
    if options.held_out is not None:
        # Seeds of the training and of its check must differ: a folder's own may be any.
        seed = next(options.seed + i for i in (1, 2) if options.seed + i != model.seed)
        held_out = model.held_out(
            options.held_out, seed=seed, out=options.out, threads=options.threads
        )
        print(held_out, file=sys.stderr if options.json else sys.stdout)
        unusable += held_out.unusable
    code = _code(unusable, is_inside)
    if model.fails_its_check:
        print("warning: the model of the heights fails its own check", file=sys.stderr)
        code = UNHEALTHY
    if not rings:
        return code
    plan = design_rings(model, rings, tolerance=options.tolerance, extrapolate=options.extrapolate)
    plan.save(options.out)
    pattern = simulate_plan(plan, seed=options.seed)
    plan_picture(plan, pattern, options.out / "plan.png")
    if options.json:
        print((options.out / "plan.json").read_text(encoding="utf-8"), end="")
    else:
        print(plan)
        print(pattern)
        print(f"written to {options.out}: plan.csv and plan.json (metres), plan.png")
    for note in pattern.notes:
        print(f"note: {note}", file=sys.stderr)
    return code if pattern.is_whole else UNHEALTHY


def _code(unusable: "LeftOut", is_inside: bool) -> int:
    """Returns the exit code of pours, and of a posterior that is inside of its model or not."""
    if unusable.unhealthy:
        print(f"note: pours that cannot be used: {unusable}", file=sys.stderr)
    return UNHEALTHY if unusable.unhealthy or not is_inside else DONE


def _ring_model(options: argparse.Namespace) -> "tuple[RingModel, bool]":
    """Returns the model, and whether the posterior of its material is inside of its own."""
    from granulcal.design.pattern import require_one_size
    from granulcal.design.ring_model import RingModel

    if options.scene.is_dir():
        _require_no_scene(options)
        return RingModel.load(options.scene), True
    scene, is_inside = _scene(options), True
    if len(options.ring) + len(options.pile) > 1:
        require_one_size(scene)
    if (draws := _draws(options)) is not None:
        scene, is_inside = draws.at_mode(scene), draws.is_inside
    model = RingModel.train(
        scene,
        heights=tuple(options.heights),
        pours=options.pours,
        out=options.out,
        seed=options.seed,
        threads=options.threads,
    )
    return model, is_inside


def _require_no_scene(options: argparse.Namespace) -> None:
    if options.set or options.posterior is not None:
        raise ValueError("--set and --posterior need a scene; a trained model has its material")


def _draws(options: argparse.Namespace) -> "PosteriorDraws | None":
    """Returns the material of --posterior, without a height of the funnel; None without it."""
    from granulcal.design.posterior_file import PosteriorDraws
    from granulcal.design.ring_model import HEIGHT

    if options.posterior is None:
        return None
    draws = PosteriorDraws.load(options.posterior).without(HEIGHT)
    require_apart(options.set, draws, options.posterior)
    return draws


def _spill(options: argparse.Namespace) -> int:
    from granulcal.design.spill import design_spill

    draws, scene = _draws(options), _scene(options)
    forecast = design_spill(
        scene if draws is None else draws.on(scene),
        heights=tuple(options.heights),
        grains=options.grains,
        pours=options.pours,
        posterior=draws,
        out=options.out,
        seed=options.seed,
        threads=options.threads,
    )
    forecast.save(options.out, options.at_most)
    code = _code(forecast.unusable, draws is None or draws.is_inside)
    if options.json:
        print((options.out / "spill.json").read_text(encoding="utf-8"), end="")
        return code
    print(forecast)
    for k in forecast.grains:
        print(forecast.advice(k, options.at_most))
    print(f"written to {options.out}: spill.csv and spill.json (metres), spill.png")
    return code


def _scene(options: argparse.Namespace) -> Any:
    from granulcal.pours.scene import Scene

    scene = Scene.named(options.scene)
    return scene.with_(dict(options.set))
