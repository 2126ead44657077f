import hashlib
import json
import sys
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "benches" / "blind"))
answers = import_module("answers")
score = import_module("score")


@pytest.fixture
def place(tmp_path):
    """Folders of sets and of answers, and a function that puts a set and a verdict into them."""
    sets, sealed = tmp_path / "sets", tmp_path / "sealed"
    sets.mkdir()
    sealed.mkdir()

    def put(name, effect, verdict, named=(), *, truth=1.0, **more):
        effects = () if effect is None else effect if isinstance(effect, tuple) else (effect,)
        of = [{"name": one, "strength": truth} for one in effects]
        answers.seal({"set": name, "salt": "0", "effects": of}, sealed, sets)
        report = sets / name / "report"
        report.mkdir(parents=True)
        table = {
            "verdict": verdict,
            "named": list(named),
            "p": 0.5,
            "strength": more.get("strength", {}),
            "misfit": {
                "fit": {"before": more.get("delta", 2.0) ** 2, "after": 0.0},
                "sealed": {"before": more.get("before", 4.0), "after": more.get("after", 0.0)},
            },
            "pours": more.get("pours", 100),
        }
        (report / "verdict.json").write_text(json.dumps(table))

    return SimpleNamespace(put=put, sets=sets, sealed=sealed)


def measured(place):
    judged, missing = score.judge(place.sets, place.sealed, score.families())
    return {row[0]: row[3] for row in score.table(judged)}, missing


def test_every_line_counts_the_sets_it_is_about(place):
    place.put("null-0", None, "NONE", delta=0.1, pours=50)
    place.put("null-1", None, "EFFECT", ["tilt.x"], delta=0.4)  # False alarm, spurious name.
    place.put("null-2", None, "UNCONFIRMED")  # A word that was taken away alarms nobody.
    place.put("right", "polydispersity", "EFFECT", ["polydispersity"], truth=0.2, before=10.0,
          after=1.0, strength={"polydispersity": [0.15, 0.21, 0.24]})  # fmt: skip
    place.put("wrong", "tilt", "EFFECT", ["polydispersity"], truth=2.0)
    place.put("set", "cohesion", "SET", ["polydispersity", "cohesion.capillary"], truth=2.0)
    place.put("missed", "height", "NONE", delta=0.7)
    place.put("seen", "height", "RESIDUAL", delta=0.7)
    place.put("odd-0", "clumps", "UNEXPLAINED", before=8.0, after=4.0, pours=900)
    place.put("odd-1", "clumps", "EFFECT", ["polydispersity"])
    found, missing = measured(place)
    assert missing == []
    expected = {
        "false alarm, null of the other code": "1/3",
        "the same, of those with a word": "1/2",
        "no word (UNCONFIRMED, OVERTURNED), null": "1/3",
        "the same, sets with an effect": "0/7",
        "detected, delta >= 1": "3/3",
        "detected, delta .5-1": "1/2",
        "detected, delta < .5": "no such set",
        "top-1 among named singles, delta >= 1": "1/3",
        "truth inside what is named": "2/3",
        "mean number of names": "1.3",
        # The spurious name of the null and the wrong one; the odd set is no library verdict.
        "false naming among library verdicts that name": "2/4",
        "pairs: detected": "no such set",
        "pairs, named: no false member": "no such set",
        "pairs: both found": "no such set",
        "out of library, delta >= 1: UNEXPLAINED or not named": "1/2",
        "removed misfit at sealed heights, right effect": "90 %",
        "removed misfit at sealed heights, UNEXPLAINED": "50 %",
        "95 % interval of the strength covers": "1/1",
        "pours besides the shared ones, mean (most)": "175 (900)",
    }
    assert found.keys() == expected.keys()
    for metric, text in expected.items():
        assert text in found[metric], (metric, found[metric])


@pytest.mark.parametrize(("low", "high", "covered"), [(0.35, 0.45, "1/1"), (0.45, 0.9, "0/1")])
def test_a_strength_is_read_in_the_loops_unit(place, low, high, covered):
    # 0.6 of the restitution is lost: e_w / e is 0.4.
    interval = {"ground.restitution": [low, 0.5 * (low + high), high]}
    place.put("a", "ground_soft", "EFFECT", ["ground.restitution"], truth=0.6, strength=interval)
    assert covered in measured(place)[0]["95 % interval of the strength covers"]


def test_one_right_name_of_two_that_act_together_is_false(place):
    place.put("a", "tilt", "EFFECTS", ["tilt.x", "polydispersity"])
    found, _ = measured(place)
    assert "1/1" in found["false naming among library verdicts that name"]
    assert "1/1" in found["truth inside what is named"]
    assert found["removed misfit at sealed heights, right effect"] == "no such set"


def test_a_pair_is_told_by_its_members(place):
    both = ("tilt", "adhesion")
    # Either name of a family will do; another name beside them is a false member.
    place.put("found", both, "EFFECTS", ["cohesion.capillary", "tilt.y"])
    place.put("half", both, "EFFECT", ["tilt.x"])
    place.put("false", both, "EFFECTS", ["tilt.x", "height"])
    place.put("quiet", both, "RESIDUAL")
    found, _ = measured(place)
    assert "4/4" in found["pairs: detected"]
    assert "2/3" in found["pairs, named: no false member"]
    assert "1/4" in found["pairs: both found"]
    # Rows of single effects are not of pairs.
    assert found["truth inside what is named"] == "no such set"


def test_removed_misfit_has_an_interval_of_sets(place):
    for number, after in enumerate((0.0, 4.0)):
        place.put(f"s{number}", "tilt", "EFFECT", ["tilt.x"], before=4.0, after=after)
    text = measured(place)[0]["removed misfit at sealed heights, right effect"]
    assert text == "50 % (0-100), n = 2"


def test_a_set_without_verdict_is_not_counted(place):
    place.put("a", None, "NONE")
    place.put("b", None, "NONE")
    (place.sets / "b" / "report" / "verdict.json").unlink()
    found, missing = measured(place)
    assert missing == ["b"]
    assert "0/1" in found["false alarm, null of the other code"]


def test_a_changed_answer_is_refused(place):
    place.put("a", None, "NONE")
    file = place.sealed / "a.json"
    sealed = answers.seals(place.sets)["a"]
    assert sealed == hashlib.sha256(file.read_bytes()).hexdigest()
    file.write_text(file.read_text().replace("[]", "[1]"))
    with pytest.raises(answers.BrokenSealError, match=f"a: its answer has the hash .* {sealed}"):
        answers.unseal(place.sealed, place.sets)
    file.unlink()
    with pytest.raises(answers.BrokenSealError, match="a: its answer is not in"):
        answers.unseal(place.sealed, place.sets)


@pytest.mark.parametrize(
    ("verdict", "named", "message"),
    [
        ("MAYBE", [], "allowed: NONE, RESIDUAL, EFFECT"),
        ("EFFECT", [], "EFFECT with effects named"),
        ("NONE", ["tilt.x"], "NONE with effects named"),
    ],
)
def test_a_verdict_that_is_none_is_named(place, verdict, named, message):
    place.put("a", None, verdict, named)
    with pytest.raises(score.BadVerdictError, match=message):
        measured(place)


def test_wilson_interval():
    # Newcombe 1998, table I, method 3: 81 of 263.
    low, high = score.wilson(81, 263)
    assert (round(low, 4), round(high, 4)) == (0.2553, 0.3662)
