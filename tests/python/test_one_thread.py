"""Linear algebra on one thread: the same bits everywhere, and the caller's number put back."""

import os
import subprocess
import sys

import numpy as np
import pytest
from threadpoolctl import ThreadpoolController, threadpool_limits

torch = pytest.importorskip("torch")

from granulcal.bayessim import BayesSim  # noqa: E402
from granulcal.bayessim.check.toys import PileStandIn  # noqa: E402
from granulcal.one_thread import one_thread  # noqa: E402


def blas_threads() -> list[int]:
    """Threads of numpy's library, as its own interface says."""
    pools = ThreadpoolController().select(user_api="blas").info()
    return [pool["num_threads"] for pool in pools]


def test_the_number_is_one_inside_and_put_back_by_the_last_to_leave():
    before = torch.get_num_threads()
    with threadpool_limits(2, user_api="blas"):
        torch.set_num_threads(2)
        try:
            outer, inner = one_thread(), one_thread()
            outer.__enter__()
            inner.__enter__()
            assert set(blas_threads()) == {1}
            assert torch.get_num_threads() == 1
            # Left in the order in which they came, as two threads of the caller may.
            outer.__exit__(None, None, None)
            assert set(blas_threads()) == {1}
            inner.__exit__(None, None, None)
            assert set(blas_threads()) == {2}
            assert torch.get_num_threads() == 2
        finally:
            torch.set_num_threads(before)


def test_an_error_puts_the_number_back():
    with threadpool_limits(2, user_api="blas"):
        with pytest.raises(ValueError), one_thread():
            raise ValueError
        assert set(blas_threads()) == {2}


def test_an_emulator_has_the_same_bits_on_any_number_of_threads():
    toy = PileStandIn(seed=0)
    theta, x = toy.simulate(300, seed=1)
    models = []
    for threads in (1, 2):
        with threadpool_limits(threads, user_api="blas"):
            models.append(BayesSim.fit(theta, x, toy.prior, quiet=True, method="emulated"))
            models[-1].at_truth = models[-1].posterior(x[0]).log_prob(theta[0])
    one, two = (model.likelihood.leading.coefficients for model in models)
    np.testing.assert_array_equal(one, two)
    np.testing.assert_array_equal(*(model.at_truth for model in models))


def test_libraries_that_come_inside_are_held_as_well():
    # In a process of its own: SciPy's linear algebra is loaded by the first inverse.
    code = """
import sys
import numpy as np
from threadpoolctl import threadpool_info
from granulcal.loop.surrogate.inverse import inverse_of
from granulcal.one_thread import one_thread

def threads():
    return [pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"]

assert "scipy.linalg" not in sys.modules
with one_thread():
    inverse_of(np.eye(3))
    assert "scipy.linalg" in sys.modules and len(threads()) >= 2, threads()
    assert set(threads()) == {1}, threads()
before = threads()
with one_thread():
    assert set(threads()) == {1}, threads()
assert threads() == before
"""
    # As many threads as SciPy takes by itself, on any machine.
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "3"}
    subprocess.run([sys.executable, "-c", code], check=True, env=environment)
