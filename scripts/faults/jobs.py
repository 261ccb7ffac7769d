"""Jobs of the fault campaign: which drives with which faults, and the processes that make them."""
import json
import os
import pathlib
import queue
import random
import string
import subprocess
import threading

STEP = 0.2  # [s], of every scenario of the campaign


class Failure(Exception):
    """Something that the user can mend; says what."""


def read_data(file):
    """What a file says, and what the one says that it is `like`: `sensors` by vehicle are added to what is set there."""
    data = read_json(file)
    if "like" not in data:
        return data
    whole = {**read_data(file.parent / data["like"]), **data}
    for vehicle, sensors in data.get("sensors", {}).items():
        if vehicle not in whole["vehicles"]:
            raise Failure(f"{file}: sensors of '{vehicle}', which is no vehicle of {data['like']}; there are {', '.join(whole['vehicles'])}")
        about = whole["vehicles"][vehicle]
        about["set"] = [*about.get("set", []), f"sensors={sensors}"]
    return whole


def read_json(file):
    try:
        return json.loads(file.read_text())
    except OSError as problem:
        raise Failure(f"{file}: cannot be read ({problem.strerror}); give a file of vehicles and kinds with --data") from problem
    except json.JSONDecodeError as problem:
        raise Failure(f"{file}:{problem.lineno}: is no JSON ({problem.msg})") from problem


def number(time):
    return f"{time:.6g}"


def fault_of(data, index, name, sensors):
    """A list of faults that begins somewhere, another place for every job and kind."""
    kind = data["kinds"][name]
    begin = random.Random(f"{index} {name}").randint(*data["begin"])
    length, start = kind["length"], STEP * begin
    third = STEP * (length // 3)
    values = {"start": number(start), "length": number(STEP * length), "second": number(start + third),
              "third": number(start + 2 * third), **sensors}
    return {"samples": begin + length + data["after"], "list": string.Template(kind["faults"]).substitute(values)}


def job_of(data, root, index, kinds=None, vehicles=None):
    """Vehicles and paths take turns; speed and ground are drawn. The seed is the job's alone."""
    names = list(vehicles or data["vehicles"])
    vehicle = data["vehicles"][names[index % len(names)]]
    paths = list(vehicle["paths"])
    path = paths[index // len(names) % len(paths)]
    draw = random.Random(f"job {index}")
    speed, terrain = draw.choice(vehicle["speeds"]), draw.choice(list(vehicle["terrains"]))
    faults = {name: fault_of(data, index, name, vehicle["sensors"]) for name in kinds or data["kinds"]}
    drive = [*vehicle.get("set", []), *vehicle["paths"][path], *vehicle["terrains"][terrain], f"speed={speed}",
             f"seed={data['first_seed'] + index}", f"step={STEP}"]
    return {
        "about": {"vehicle": names[index % len(names)], "path": path, "speed": speed, "terrain": terrain},
        "scenario": str(root / vehicle["scenario"]), "set": drive,
        "samples": max(fault["samples"] for fault in faults.values()),
        "riders": data["estimators"],
        "calm": {trusting(name): [*settings, "estimator.health.watch=false"] for name, settings in data["estimators"].items()},
        "faults": faults}


def trusting(estimator):
    return f"{estimator}, trusting"


def steps_of(job):
    """Estimates that a job asks for."""
    riders = len(job["riders"])
    return (riders + len(job["calm"])) * job["samples"] + riders * sum(fault["samples"] for fault in job["faults"].values())


class Workers:
    """Processes that answer jobs, one a line."""

    def __init__(self, program, count):
        self.program, self.waiting, self.done = program, queue.Queue(), queue.Queue()
        self.threads = [threading.Thread(target=self.work, daemon=True) for _ in range(count)]
        for thread in self.threads:
            thread.start()

    def work(self):
        environment = dict(os.environ, OMP_NUM_THREADS="1")
        process = subprocess.Popen([self.program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment)
        while (task := self.waiting.get()) is not None:
            index, job = task
            try:
                process.stdin.write(json.dumps(job) + "\n")
                process.stdin.flush()
                line = process.stdout.readline()
            except BrokenPipeError:
                line = ""
            if line:
                self.done.put((index, json.loads(line)))
                continue
            self.done.put((index, {"error": f"{self.program} ended with {process.wait()}"}))
            process = subprocess.Popen([self.program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment)
        process.stdin.close()
        process.wait()

    def close(self):
        for _ in self.threads:
            self.waiting.put(None)
        for thread in self.threads:
            thread.join()
