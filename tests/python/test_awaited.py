"""Tasks of a cluster whose nodes are all gone are not waited for."""

import pytest

from granulcal.pours.awaited import Awaited


class FakeRay:
    """A cluster of one node, of which tasks are lost as soon as it is gone."""

    def __init__(self) -> None:
        self.is_alive = True

    def wait(self, tasks: list[str], timeout: float) -> tuple[list[str], list[str]]:
        assert timeout > 0.0
        return ([], tasks) if self.is_alive else (tasks[:1], tasks[1:])

    def nodes(self) -> list[dict[str, bool]]:
        return [{"Alive": self.is_alive}]


def test_tasks_are_awaited_as_long_as_a_node_is_alive() -> None:
    ray = FakeRay()
    awaited = Awaited(ray, patience_s=0.0)
    assert awaited.done(["one", "two"]) == []
    ray.is_alive = False
    with pytest.raises(ConnectionError, match="no node .* alive for 0 s; what is done is kept"):
        awaited.done(["one", "two"])


def test_a_node_may_come_back_in_time() -> None:
    ray = FakeRay()
    ray.is_alive = False
    awaited = Awaited(ray, patience_s=60.0)
    assert awaited.done(["one", "two"]) == ["one"]
    ray.is_alive = True
    assert awaited.done(["two"]) == []
