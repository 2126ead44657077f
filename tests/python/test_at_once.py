import threading
import time

from granulcal.pours.at_once import at_once


def test_who_stops_waits_for_no_pour_that_is_under_way():
    goes_on = threading.Event()

    def work(one: int) -> int:
        if one:
            goes_on.wait(30.0)
        return one

    rows = at_once(work, [0, 1, 2], 2)
    assert next(rows) == (0, 0)
    stopped = time.monotonic()
    rows.close()
    took = time.monotonic() - stopped
    goes_on.set()
    assert took < 5.0


def test_all_come_with_their_places():
    assert sorted(at_once(lambda one: 10 * one, [3, 1, 2], 2)) == [(0, 30), (1, 10), (2, 20)]
