"""Problems: of runs and files, changed, written, solved by every backend."""
import json
import pickle
import subprocess

import numpy
import pytest
import rhec
from shared import CLI, FIGURE8, SHORT, Driven

BACKENDS = ("gn_rti", "sparse_sqp", "ipopt", "nlopt")


@pytest.fixture(scope="module")
def problems():
    return rhec.run(FIGURE8, set=SHORT, problems_every=40).problems


def options_of(solver):
    return {"mode": "converge"} if solver == "gn_rti" else {}


def test_problems_of_a_run(problems):
    assert {problem.kind for problem in problems} == {"rhe", "rhc"}
    control = next(problem for problem in problems if problem.kind == "rhc")
    assert control.intervals == 15 and control.names["inputs"] == ["u1", "u2_rate"] and control.vehicle.name == "bicycle_slip"


@pytest.mark.parametrize("solver", BACKENDS)
def test_every_backend_finds_the_same(problems, solver):
    control = [problem for problem in problems if problem.kind == "rhc"][1]
    reference = control.solve("sparse_sqp")
    solution = control.solve(solver, **options_of(solver))
    assert solution.usable and solution.report.kkt["largest"] < 1e-4
    assert solution.objective == pytest.approx(reference.objective, rel=1e-5)
    numpy.testing.assert_allclose(solution.states, reference.states, atol=2e-3)


def test_solutions_are_what_they_say(problems):
    for problem in problems:
        solution = problem.solve("sparse_sqp")
        assert solution.status == "solved" and solution.kkt["largest"] < 1e-6
        n = problem.intervals
        assert solution.states.shape == (n + 1, len(problem.names["states"]))
        assert solution.inputs.shape == (n, len(problem.names["inputs"]))
        assert solution.parameters.shape == (n, len(problem.names["parameters"]))
        again = problem.evaluate(solution.states, solution.inputs, solution.parameters)
        assert again["objective"] == pytest.approx(solution.objective, rel=1e-12)
        assert again["defect"] == pytest.approx(solution.kkt["defect"], abs=1e-9)


def test_lines_are_those_of_the_command_line(problems, tmp_path):
    file = tmp_path / "problems.jsonl"
    rhec.write_problems(file, problems)
    told = subprocess.run([CLI, "solve", str(file), "--solver", "sparse_sqp"], check=True, capture_output=True, text=True).stdout
    for problem, line in zip(rhec.read_problems(file), told.splitlines()):
        mine, theirs = json.loads(problem.solve("sparse_sqp").line()), json.loads(line)
        del mine["solve_time_us"], theirs["solve_time_us"]
        assert mine == theirs


def test_problems_are_changed_as_dicts(problems):
    control = next(problem for problem in problems if problem.kind == "rhc")
    keys = control.to_dict()
    assert rhec.Problem.from_dict(keys).line() == control.line()
    keys["bounds"]["u1"] = [0.0, 2.0]
    slower = rhec.Problem.from_dict(keys).solve("sparse_sqp", cold=True)
    assert slower.inputs[:, 0].max() <= 2.0 + 1e-6 < control.solve("sparse_sqp").inputs[:, 0].max()


def test_a_solve_without_a_solution_is_data(problems):
    keys = [problem for problem in problems if problem.kind == "rhe"][-1].to_dict()
    keys["bounds"] |= {"delta": [0.0, 0.1], "u2": [1.0, 1.0]}  # the wheels turn beyond their bound in the first interval
    solution = rhec.Problem.from_dict(keys).solve("gn_rti", mode="converge", cold=True)
    assert solution.status == "infeasible" and not solution.usable
    assert solution.kkt["largest"] > 1e-3 and solution.report.advice
    assert numpy.isfinite(solution.states).all()


def test_covariances(problems):
    window = [problem for problem in problems if problem.kind == "rhe"][-1]
    solution = window.solve("sparse_sqp", covariances=True)
    n, states = window.intervals, len(window.names["states"])
    assert solution.covariances.shape == (n + 1, states, states)
    assert (numpy.linalg.eigvalsh(solution.covariances[-1][:4, :4]) > 0.0).all()
    assert window.solve("sparse_sqp").covariances is None
    control = next(problem for problem in problems if problem.kind == "rhc")
    with pytest.raises(rhec.Error, match="expected one of estimation"):
        control.solve("gn_rti", covariances=True)
    with pytest.raises(rhec.Error, match="sparse_sqp and gn_rti"):
        window.solve("ipopt", covariances=True)


def test_mistakes_in_problems(problems, tmp_path):
    file = tmp_path / "problems.jsonl"
    keys = problems[0].to_dict()
    keys["weigths"] = keys.pop("weights")
    file.write_text("\n" + json.dumps(keys) + "\n")
    with pytest.raises(rhec.Error, match="did you mean 'weights'") as caught:
        rhec.read_problems(file)
    assert caught.value.file == str(file) and caught.value.line == 2
    with pytest.raises(rhec.Error, match="mode"):
        problems[0].solve("gn_rti", mod="converge")
    with pytest.raises(rhec.Error, match="states: expected an array"):
        problems[0].evaluate(numpy.zeros((2, 2)), numpy.zeros((2, 2)), numpy.zeros((2, 2)))


def test_a_file_is_written_whole_or_not_at_all(problems, tmp_path):
    file = tmp_path / "problems.jsonl"
    rhec.write_problems(file, problems[:1])
    before = file.read_text()

    class Broken:
        def line(self):
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        rhec.write_problems(file, [problems[0], Broken()])
    with pytest.raises(rhec.ArgumentError, match=r"write_problems: problems\[1\]: found 3, expected a Problem"):
        rhec.write_problems(file, [problems[0], 3])
    assert file.read_text() == before and [each.name for each in tmp_path.iterdir()] == ["problems.jsonl"]


def test_problems_of_a_robot_that_drives():
    driven = Driven()
    with pytest.raises(rhec.Error, match="no window at present"):
        rhec.Problem.of(driven.estimator)
    for _ in range(20):
        _, command = driven.step()
    control = rhec.Problem.of(driven.controller, "now/rhc/19")
    assert control.kind == "rhc" and control.id == "now/rhc/19"
    window = rhec.Problem.of(driven.estimator)
    assert window.kind == "rhe" and window.intervals == 15 and window.solve("sparse_sqp").status == "solved"
    with pytest.raises(rhec.Error, match="no window at present"):
        rhec.Problem.of(rhec.Robot({"estimator": {"name": "ekf"}}).make_estimator())


def test_problems_of_a_vehicle_of_equations():
    sympy = pytest.importorskip("sympy")
    x, v, force = sympy.symbols("x v force")
    model = rhec.Model("cart", states={x: {"unit": "m"}, v: {"unit": "m/s"}}, inputs={force: {"unit": "N"}}, outputs=["x"],
                       rates={x: v, v: force - v / 5})
    estimator = rhec.Robot({"model": model}).make_estimator()
    for k in range(10):
        estimator.push_measurement(0.2 * k, [0.1 * k])
        estimator.push_input(0.2 * k, [0.0])
        estimator.estimate(0.2 * k)
    window = rhec.Problem.of(estimator)
    assert window.vehicle.name == "cart" and window.solve("sparse_sqp").usable


def test_names_that_results_do_not_have(tmp_path):
    """Every result that is looked up by name says what it has, and stays a dict for all else."""
    run = rhec.run(FIGURE8, set=SHORT, problems_every=50)
    problem = next(each for each in run.problems if each.kind == "rhc")
    solution, vehicle, check = problem.solve("gn_rti", mode="converge"), rhec.Robot({"model": "bicycle_slip"}).vehicle, rhec.check("corridor")
    results = {"kapa": (run.steps, "kappa"), "mea": (run.summary, "mae"), "trakcing": (run.summary["mae"], "tracking"), "larges": (solution.kkt, "largest"),
               "bound": (problem.to_dict(), "bounds"), "nam": (rhec.plugins(), "name"), "postion_x": (vehicle.roles, "position_x"),
               "finding": (check.details, "findings"), "verdic": (check.findings, "verdict"), "meanin": (rhec.options("gn_rti"), "meaning")}
    for wrong, (result, right) in results.items():
        with pytest.raises(rhec.UnknownName, match=f"there is no '{wrong}'; did you mean '{right}'"):
            result[wrong]
        assert wrong not in result and result.get(wrong) is None and isinstance(result, dict)
        result[right]
        with pytest.raises(KeyError, match="expected one of"):
            result["zzz"]
    assert json.loads(json.dumps(run.summary)) == run.summary and pickle.loads(pickle.dumps(run.summary)) == run.summary
    with pytest.raises(rhec.UnknownName, match="nothing is there"):
        rhec.Table()["x"]
    again = pickle.loads(pickle.dumps(rhec.UnknownName("there is no 'a'", "a")))
    assert str(again) == "there is no 'a'"
