import io

import pytest

from granulcal.progress import ProgressLine, duration, first_steps, shown, steps


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_steps_are_shown_inside_alone():
    stream = Terminal()
    assert list(steps("emulator", [5, 6])) == [5, 6]
    assert stream.getvalue() == ""
    with shown(stream):
        for item in steps("emulator", [5, 6]):
            assert f"emulator {item - 5}/2" in stream.getvalue()
        assert "at most 0 s left" in stream.getvalue()
        # What is printed next begins on an empty line.
        assert stream.getvalue().endswith(" \r")
    told = stream.getvalue()
    assert list(steps("emulator", [5, 6])) == [5, 6]
    assert stream.getvalue() == told


def test_steps_that_are_left_early_leave_an_empty_line():
    stream = Terminal()
    with shown(stream):
        for epoch in steps("network", range(1, 500)):
            if epoch == 3:
                break
    assert "network 2/499" in stream.getvalue()
    assert stream.getvalue().endswith(" \r")


def test_a_log_is_not_filled():
    stream = io.StringIO()
    with shown(stream):
        list(steps("check", range(1000)))
    assert stream.getvalue() == ""


def test_a_batch_says_what_is_left_out():
    stream = Terminal()
    line = ProgressLine(stream)
    line(10, 2, 3, 1, 0, 2)
    line.close()
    assert "5/10 pours (2 from disk), 1 unhealthy, 2 without grains in view, " in stream.getvalue()


@pytest.mark.parametrize(
    ("seconds", "words"), [(4.4, "4 s"), (61, "1 min 01 s"), (5399, "89 min 59 s"), (9000, "2.5 h")]
)
def test_durations_in_words(seconds, words):
    assert duration(seconds) == words


def test_first_steps_end_the_work_and_count_it():
    done = []

    def work():
        for item in steps("emulator", range(8)):
            done.append(item)
        for _ in steps("network", range(9)):
            raise AssertionError("never begun")

    found = first_steps("emulator", 3, work)
    assert done == [0, 1, 2] and found.total == 8
    assert found.each >= 0 and found.before >= 0
    # Fewer steps than are asked for are run whole, and end it too.
    done.clear()
    assert first_steps("emulator", 20, work).total == 8 and len(done) == 8
    with pytest.raises(ValueError, match="no steps 'posteriors'"):
        first_steps("posteriors", 1, lambda: None)
