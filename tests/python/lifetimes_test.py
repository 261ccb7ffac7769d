"""What Python may do with objects whose memory is in C++: let owners go, keep views, use them from threads."""
import gc
import os
import signal
import threading
import time
import weakref

import numpy
import pytest
import rhec
from shared import FIGURE8, SHORT, Driven, line


def test_views_outlive_everything():
    driven = Driven()
    for _ in range(5):
        estimate, command = driven.step()
    views = [estimate.state, estimate.parameters, estimate.covariance, command.inputs]
    copies = [view.copy() for view in views]
    del driven, estimate, command
    gc.collect()
    rubbish = [numpy.full(1000, -1.0) for _ in range(1000)]  # what was freed would be overwritten
    for view, copied in zip(views, copies):
        numpy.testing.assert_array_equal(view, copied)
    assert len(rubbish) == 1000


def test_views_keep_their_owner_and_no_longer():
    driven = Driven()
    estimate, _ = driven.step()
    view = estimate.state
    assert view.base is estimate
    told = weakref.ref(view)
    del view
    gc.collect()
    assert told() is None


def test_views_are_read_only():
    driven = Driven()
    estimate, command = driven.step()
    for view in (estimate.state, estimate.parameters, estimate.covariance, command.inputs):
        with pytest.raises(ValueError, match="read-only"):
            view[...] = 0.0
        with pytest.raises(ValueError):
            view.flags.writeable = True


def test_estimators_and_controllers_outlive_their_robot():
    driven = Driven()
    driven.robot = None
    robot = rhec.Robot({"model": "bicycle_slip"})
    estimator, controller = robot.make_estimator(), robot.make_controller(line())
    vehicle = robot.vehicle
    del robot
    gc.collect()
    estimator.push_measurement(0.0, vehicle.observe(numpy.zeros(4)))
    assert controller.control(estimator.estimate(0.0)).inputs.shape == (2,)


def test_a_controller_keeps_the_estimator_whose_map_it_uses():
    robot = rhec.Robot({"model": "bicycle_slip", "estimator": {"memory": "place"}})
    estimator = robot.make_estimator()
    controller = robot.make_controller(line(), ahead=estimator)
    estimator.push_measurement(0.0, robot.vehicle.observe(numpy.zeros(4)))
    now = estimator.estimate(0.0)
    del estimator
    gc.collect()
    for _ in range(5):
        assert numpy.isfinite(controller.control(now).inputs).all()


def test_solutions_outlive_their_problems():
    problems = rhec.run(FIGURE8, set=SHORT, problems_every=50).problems
    solution = problems[0].solve("sparse_sqp")
    states = solution.states
    copied = states.copy()
    del problems, solution
    gc.collect()
    numpy.testing.assert_array_equal(states, copied)


def test_a_failed_construction_leaves_nothing():
    for _ in range(100):
        with pytest.raises(rhec.Error):
            rhec.Robot({"estimator": {"horizon": -1}})
    gc.collect()


def test_objects_that_only_C_can_make():
    for kind in (rhec.Estimate, rhec.Command, rhec.Solution, rhec.Report, rhec.Vehicle, rhec.Variable):
        with pytest.raises(TypeError, match="No constructor"):
            kind()
    with pytest.raises(TypeError):
        rhec.Estimator(None)
    with pytest.raises(TypeError):
        rhec.Controller(None, line())

    class Half(rhec.Path):
        def __init__(self):
            pass  # what is below it was not made

    with pytest.raises(TypeError, match="__init__"):
        Half()


class Threads:
    """Runs functions at the same time until one of them fails or the time is over."""

    def __init__(self, *functions, seconds=1.0):
        self.failures, self._end = [], time.monotonic() + seconds
        threads = [threading.Thread(target=self._run, args=(function,)) for function in functions]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()

    def _run(self, function):
        try:
            while time.monotonic() < self._end:
                function()
        except BaseException as failure:  # noqa: B902  (told by the test)
            self.failures.append(failure)


def test_one_estimator_in_several_threads():
    driven = Driven()
    moment = [0.0]
    outputs = driven.robot.vehicle.observe(numpy.zeros(4))
    kept = driven.step()[0]

    def push():
        moment[0] += 0.2
        driven.estimator.push_measurement(moment[0], outputs)
        driven.estimator.push_input(moment[0], [1.0, 0.0])

    def estimate():
        assert numpy.isfinite(driven.estimator.estimate(moment[0]).state).all()

    def reuse():
        assert driven.estimator.estimate(moment[0], out=kept) is kept
        assert driven.estimator.counts["nodes"] > 0

    def control():
        assert numpy.isfinite(driven.controller.control(kept).inputs).all()
        driven.controller.plan()

    threads = Threads(push, estimate, estimate, reuse, control, control, driven.estimator.prepare, driven.estimator.rehearse)
    assert not threads.failures
    assert moment[0] > 1.0


def test_other_threads_go_on_while_one_solves():
    ticks, done = [0], threading.Event()

    def count():
        while not done.is_set():
            ticks[0] += 1
            time.sleep(0.0005)

    thread = threading.Thread(target=count)
    thread.start()
    rhec.smooth(FIGURE8, set=SHORT, progress=False)
    before = ticks[0]
    done.set()
    thread.join()
    assert before > 20


def test_a_problem_is_solved_by_several_threads():
    problem = rhec.run(FIGURE8, set=SHORT, problems_every=60).problems[-1]
    expected = problem.solve("sparse_sqp").states

    def solve():
        numpy.testing.assert_array_equal(problem.solve("sparse_sqp").states, expected)

    assert not Threads(solve, solve, solve).failures


@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
def test_children_of_a_fork_go_on_by_themselves():
    """Also where another thread of the parent is within an estimator at that moment."""
    driven, busy, stop = Driven(), Driven(), threading.Event()
    estimate = driven.step()[0]

    def work():
        while not stop.is_set():
            busy.step()

    thread = threading.Thread(target=work)
    thread.start()
    try:
        for _ in range(5):
            child = os.fork()
            if not child:
                signal.alarm(30)  # who waits for ever is ended
                own = Driven().step()[0]
                driven.step()
                os._exit(3 if numpy.array_equal(own.state, estimate.state) else 1)
            assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 3
    finally:
        stop.set()
        thread.join()
    driven.step()


def test_what_was_not_made_is_refused():
    estimate = Driven().step()[0]
    for kind, call in ((rhec.Estimator, lambda it: it.estimate(0.0)), (rhec.Controller, lambda it: it.control(estimate)),
                       (rhec.Path, lambda it: it.length), (rhec.Vehicle, lambda it: it.name), (rhec.Estimate, lambda it: it.time),
                       (rhec.Command, lambda it: it.inputs), (rhec.Report, lambda it: it.status), (rhec.Solution, lambda it: it.states)):
        with pytest.raises(TypeError, match="an object that was not made; call its class"):
            call(kind.__new__(kind))
    with pytest.raises(TypeError, match="must be called when overriding __init__"):
        type("Empty", (rhec.Path,), {"__init__": lambda self: None})()
