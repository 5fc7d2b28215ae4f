"""How blocks are handed to a cluster, and what is said where it fails: a cluster that does as it is told.

tests/test_mushrooms_simulate.py has one with workers.
"""

import contextlib
import logging
from concurrent.futures import CancelledError

import distributed
import pytest
from distributed import KilledWorker
from distributed.comm import CommClosedError
from support.refusals import one_line

import mushrooms
from mushrooms.store import conduct
from mushrooms.store.run import BlockRange
from mushrooms.store.spec import RunSpec
from scene import load

SPEC = RunSpec(load("fermi-ulam"), 40.0, 1, 7)
ADDRESS = "tcp://127.0.0.1:8786"


class Answer:
    """A future: its result is that of the call, or the failure that its block is to have."""

    def __init__(self, number, failure):
        self.number, self.failure = number, failure

    def result(self):
        if self.failure is not None:
            raise self.failure
        return f"block {self.number}"


class Cluster:
    """A client whose blocks end in the order in which they were handed out, the first ones with failures."""

    def __init__(self, threads=(1,), kills=(), slow=0):
        self.threads, self.kills, self.slow = threads, list(kills), slow
        self.asked, self.out, self.most, self.cancelled = [], [], [], []

    def nthreads(self):
        return dict(enumerate(self.threads))

    def submit(self, function, *given, **options):
        assert function is conduct.follow_elsewhere
        number = given[2].number
        self.asked.append((*given, options))
        failure = KilledWorker(f"{number}", None, 0) if number in self.kills else None
        if failure is not None:
            self.kills.remove(number)
        self.out.append(Answer(number, failure))
        return self.out[-1]

    def as_current(self):
        return contextlib.nullcontext()

    def cancel(self, futures):
        self.cancelled += [one.number for one in futures]

    def wait(self, futures, timeout, return_when):
        assert (timeout, return_when) == (conduct.POLL_INTERVAL, "FIRST_COMPLETED")
        assert futures == self.out
        self.most.append(len(futures))
        if self.slow:
            self.slow -= 1
            raise TimeoutError
        return type("Waited", (), {"done": {self.out.pop(0)}})


def ranges(n):
    return [BlockRange(number, 4 * number, 4) for number in range(n)]


@pytest.fixture
def hand_out(monkeypatch):
    def follow(cluster, n, told=lambda _: None):
        monkeypatch.setattr(distributed, "wait", cluster.wait)
        return conduct._hand_out(cluster, SPEC, iter(ranges(n)), told, 3)

    return follow


@pytest.mark.parametrize(("threads", "ahead"), [((), 1), ((1,), 2), ((2, 1), 6)])
def test_each_thread_has_two_blocks_ahead_and_a_cluster_without_workers_one(hand_out, threads, ahead):
    cluster, told = Cluster(threads, slow=2), []
    found = list(hand_out(cluster, 9, told.append))
    assert found == [(one, f"block {one.number}") for one in ranges(9)]
    assert cluster.most[:4] == [ahead] * 4  # as many again, while none has ended and after each
    assert max(cluster.most) == ahead
    assert cluster.most[-1] == 1
    assert told == [0] * len(cluster.most)  # limits are looked at while one waits
    options = [{"pure": False, "retries": 10, "priority": -k} for k in range(9)]
    assert cluster.asked == [
        (mushrooms.__version__, SPEC, one, 3, more) for one, more in zip(ranges(9), options, strict=True)
    ]
    assert cluster.cancelled == []


@pytest.mark.parametrize("n_killed", [1, 10, 11])
def test_a_block_whose_workers_die_is_handed_out_again_ten_times(hand_out, n_killed):
    cluster = Cluster((1,), kills=[1] * n_killed + [2])
    following = hand_out(cluster, 4)
    if n_killed > conduct.RETRIES:
        with pytest.raises(ConnectionError, match="--dask: workers die of block 1 again and again"):
            list(following)
    else:
        assert sorted(found for found, _ in following) == ranges(4)
        assert [one.number for _, _, one, *_ in cluster.asked].count(1) == n_killed + 1


def test_what_is_still_out_is_dropped_at_the_end(hand_out):
    cluster = Cluster((2,))
    following = hand_out(cluster, 9)
    next(following)
    following.close()
    assert cluster.cancelled == [1, 2, 3]


FAILURES = [
    (CancelledError(), ConnectionError, "the scheduler has gone (CancelledError)"),
    (CommClosedError("lost"), ConnectionError, "the scheduler has gone (CommClosedError)"),
    (RuntimeError("Error during deserialization"), ConnectionError, "the scheduler must have this project"),
    (RuntimeError("something else"), RuntimeError, "something else"),
]


@pytest.mark.parametrize(("failure", "kind", "words"), FAILURES, ids=range(len(FAILURES)))
def test_a_lost_cluster_is_a_lost_connection_and_the_log_is_as_before(monkeypatch, failure, kind, words):
    levels, log = [], logging.getLogger("distributed.client")

    def lost(*given):
        levels.append(log.level)
        assert given[1:] == (SPEC, "blocks", print, 1)
        raise failure
        yield

    opened = []
    monkeypatch.setattr(conduct, "_hand_out", lost)
    monkeypatch.setattr(
        distributed,
        "Client",
        lambda *given, **options: opened.append((given, options)) or contextlib.nullcontext(),
    )
    before = log.level
    with pytest.raises(kind) as raised:
        list(conduct.by_dask(SPEC, "blocks", print, ADDRESS, None))
    assert words in str(raised.value)
    assert (kind is RuntimeError) or str(raised.value).startswith(f"--dask = {ADDRESS}: ")
    assert (levels, log.level) == ([logging.CRITICAL + 1], before)
    assert opened == [((ADDRESS,), {"timeout": 10.0, "set_as_default": False})]


@pytest.mark.parametrize("failure", [OSError("no"), ValueError("no")])
def test_a_scheduler_that_does_not_answer_is_named(monkeypatch, failure):
    def absent(*_, **__):
        raise failure

    monkeypatch.setattr(distributed, "Client", absent)
    line = one_line(lambda: list(conduct.by_dask(SPEC, "blocks", print, ADDRESS, None)))
    assert line == f"--dask = {ADDRESS}: no scheduler answers ({type(failure).__name__})"
