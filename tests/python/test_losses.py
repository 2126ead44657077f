"""Tasks that kill their workers whenever they are tried: the driver had asked for them for ever."""

from typing import Any, cast

import pytest

from granulcal.pours import at_once as spread
from granulcal.pours import cluster
from granulcal.pours.cluster import Cluster, LostResultError, spread_over
from granulcal.pours.losses import Losses


class FakeRay:
    """A cluster of one node, in which some tasks end with their worker."""

    def __init__(self, deadly: int) -> None:
        self.deadly, self.is_alive = deadly, True
        self.begun: list[int] = []

    def remote(self, *given: Any, **_: Any) -> Any:
        """Of options a decorator, whose function has this method; of work a reference."""
        if not given:
            return lambda _: self
        # What is asked stands after the work, or before the store.
        asked = given[1] if len(given) == 3 else given[-2]
        self.begun.append(asked)
        assert len(self.begun) < 100, "the driver asks for ever"
        return len(self.begun), asked

    def put(self, work: object) -> object:
        return work

    def wait(self, tasks: list[Any], timeout: float) -> tuple[list[Any], list[Any]]:
        assert timeout > 0.0
        return tasks[:1], tasks[1:]

    def nodes(self) -> list[dict[str, bool]]:
        return [{"Alive": self.is_alive}]

    def cluster_resources(self) -> dict[str, int]:
        return {"CPU": 1}

    def cancel(self, *_: Any, **__: Any) -> None:
        pass


class FakeBatch:
    """A batch of three parts."""

    def __init__(self) -> None:
        self.lacks = [0, 1, 2]

    def missing(self) -> list[int]:
        return self.lacks

    def put(self, chunk: int, _part: object) -> bool:
        self.lacks.remove(chunk)
        return True


def result_of(ray: FakeRay, reference: tuple[int, int]) -> int:
    if reference[1] == ray.deadly:
        raise LostResultError("the worker died")
    return reference[1]


def test_a_pour_that_kills_every_worker_ends_the_command(monkeypatch: pytest.MonkeyPatch) -> None:
    ray = FakeRay(deadly=2)
    monkeypatch.setattr(spread, "connected", lambda: ray)
    monkeypatch.setattr(spread, "result_of", result_of)
    done = []
    told = r"die again and again of the same pours \(task 1\).*kept.*; the worker died$"
    with spread_over(Cluster("nowhere:1")), pytest.raises(ChildProcessError, match=told):
        for place, row in spread.at_once(lambda one: one, [1, 2, 3], 1):
            done.append((place, row))
    # Others go on meanwhile.
    assert sorted(done) == [(0, 1), (2, 3)]
    assert ray.begun.count(2) == 5


def test_a_part_that_kills_every_worker_ends_the_batch(monkeypatch: pytest.MonkeyPatch) -> None:
    ray, batch = FakeRay(deadly=1), FakeBatch()
    monkeypatch.setattr(cluster, "result_of", result_of)
    order: Any = ("scene", "prior", 48, 1, 16, 3)
    gathering = cluster._Gathering(ray, cast("Any", batch), order, None, None)
    with pytest.raises(ChildProcessError, match=r"the same pours \(task 1\)"):
        gathering.run()
    assert batch.lacks == [1] and ray.begun.count(1) == 5


def test_losses_while_no_node_is_alive_are_not_those_of_a_task() -> None:
    ray = FakeRay(deadly=0)
    losses, why = Losses(ray), LostResultError("gone")
    ray.is_alive = False
    for _ in range(20):
        losses.count(3, why)
    ray.is_alive = True
    for number in (3, 4):
        for _ in range(4):
            losses.count(number, why)
    with pytest.raises(ChildProcessError, match="task 3"):
        losses.count(3, why)
