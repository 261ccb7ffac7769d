"""What a fault campaign has measured, against the figures that are wanted."""
import math

from jobs import trusting

# What is wanted. Samples are counted from the end of a fault, of one for good from its beginning.
MEDIAN_RECOVERY = 5
MOVED_AFTER = (10, 30)
HONEST = 0.95
OK_AGAIN = 25
WIDE = 0.01      # share of the samples that are ok whose volume is more than twice that without the fault
CALM_OK = 0.999
FALSE_REJECTIONS = 0.005
ACCURACY = 1.03  # mean error, relative to an estimator that trusts all
FOLLOWED = 0.5   # share of the displacement

NEVER = math.inf


def quantile(values, share):
    """The smallest value that is at least as large as that share of all."""
    ordered = sorted(values)
    return ordered[max(0, math.ceil(share * len(ordered)) - 1)] if ordered else math.nan


def count(value):
    return "never" if value == NEVER else "" if math.isnan(value) else f"{value:.0f}"


def percent(share, digits=1):
    return f"{100.0 * share:.{digits}f} %"


def never_if_negative(value):
    return NEVER if value < 0 else value


class Rides:
    """Measures of rides of one kind, taken together."""

    def __init__(self, rides):
        self.rides = rides
        self.recovered = [never_if_negative(ride["recovered"]) for ride in rides]
        self.ok_again = [never_if_negative(ride["ok_again"]) for ride in rides]

    def sum(self, key):
        return sum(ride[key] for ride in self.rides)

    def share(self, key, of):
        whole = self.sum(of)
        return self.sum(key) / whole if whole else math.nan

    def unsaid(self):
        """Rides that never recover, and do not end with health lost."""
        return sum(ride["recovered"] < 0 and not ride["lost_at_end"] for ride in self.rides)

    def off_at_end(self):
        """How far these are off at their end [m]: the median and the most, in words."""
        errors = [ride["errors"][-1] for ride in self.rides if ride["recovered"] < 0 and not ride["lost_at_end"]]
        return f"; {quantile(errors, 0.5):.2f}, {max(errors):.2f} m" if errors else ""

    def moved(self):
        return [never_if_negative(ride["moved"] + (ride["moved"] >= 0)) for ride in self.rides]

    def followed(self):
        return sum(ride["followed"] > FOLLOWED for ride in self.rides)


class Result:
    def __init__(self, data, answers):
        self.data, self.answers = data, answers
        self.kinds, self.after = list(answers[0]["faults"]), answers[0]["after"]
        self.estimators = list(data["estimators"])
        self.vehicles = list(dict.fromkeys(answer["about"]["vehicle"] for answer in answers))
        self.steps = sum(answer["steps"] for answer in answers)

    def rides(self, kind, vehicle=None, estimator=None):
        return Rides([ride for answer in self.answers if vehicle in (None, answer["about"]["vehicle"])
                      for name, ride in answer["faults"][kind].items() if estimator in (None, name)])

    def group(self, kind):
        return self.data["kinds"][kind]["group"]

    # ---- what is wanted of a kind: text -> whether it is reached

    def wanted(self, kind):
        rides, group, window = self.rides(kind), self.group(kind), self.data["window"]
        found = {}
        if group != "angle":
            found["recovers, or says lost"] = rides.unsaid() == 0
        if group in ("transient", "long"):
            found[f"median recovery <= {MEDIAN_RECOVERY}"] = quantile(rides.recovered, 0.5) <= MEDIAN_RECOVERY
            found[f"99 % recover within {window}"] = quantile(rides.recovered, 0.99) <= window
        if group == "transient":
            found["not followed"] = rides.followed() == 0
        if group == "moved":
            found["followed after {} to {}".format(*MOVED_AFTER)] = all(
                MOVED_AFTER[0] <= moved <= MOVED_AFTER[1] for moved in rides.moved())
            found["not ok until followed"] = all(ride["doubted"] == max(0, ride["moved"]) for ride in rides.rides)
        if group != "angle":
            found[f"99 % ok within {OK_AGAIN}"] = quantile(rides.ok_again, 0.99) <= OK_AGAIN
        found[f"honest >= {percent(HONEST, 0)}"] = rides.share("honest", "counted") >= HONEST
        found[f"twice the volume in <= {percent(WIDE, 0)} of ok"] = not rides.share("wide", "ok") > WIDE
        found["finite, in bounds"] = rides.sum("not_finite") + rides.sum("not_bounded") == 0
        return found

    def kinds_table(self):
        lines = ["| fault | rides | recovered after: median, 99 %, most | never (of these not `lost`; off at the end: median, most) | followed | `moved` after | honest: position, heading"
                 " | longest not | ok after: median, 99 % | volume while ok: median, more than twice | not reached |", "|" + "---|" * 11]
        for kind in self.kinds:
            rides = self.rides(kind)
            moved = [each for each in rides.moved() if each != NEVER]
            missed = [text for text, reached in self.wanted(kind).items() if not reached]
            lines.append("| " + " | ".join([
                kind, str(len(rides.rides)),
                ", ".join(count(quantile(rides.recovered, share)) for share in (0.5, 0.99, 1.0)),
                f"{sum(each == NEVER for each in rides.recovered)} ({rides.unsaid()}{rides.off_at_end()})",
                str(rides.followed()),
                f"{min(moved)} to {max(moved)} ({len(moved)})" if moved else "",
                f"{percent(rides.share('honest', 'counted'))}, {percent(rides.share('honest_heading', 'counted'))}",
                str(max(ride["longest_dishonest"] for ride in rides.rides)),
                ", ".join(count(quantile(rides.ok_again, share)) for share in (0.5, 0.99)),
                f"{quantile([ride['volume'] for ride in rides.rides], 0.5):.2f}, {percent(rides.share('wide', 'ok'))}",
                "; ".join(missed)]) + " |")
        return "\n".join(lines)

    def vehicles_table(self):
        """Honest shares, and rides that never recover, by vehicle and estimator."""
        pairs = [(vehicle, estimator) for vehicle in self.vehicles for estimator in self.estimators]
        lines = ["| fault | " + " | ".join(f"{vehicle}: {estimator}" for vehicle, estimator in pairs) + " |",
                 "|" + "---|" * (len(pairs) + 1)]
        for kind in self.kinds:
            cells = []
            for vehicle, estimator in pairs:
                rides = self.rides(kind, vehicle, estimator)
                never = sum(each == NEVER for each in rides.recovered)
                cells.append(percent(rides.share("honest", "counted")) + (f", {never} never" if never else ""))
            lines.append(f"| {kind} | " + " | ".join(cells) + " |")
        return "\n".join(lines)

    # ---- where nothing goes wrong

    def calm(self, vehicle, estimator):
        return [answer["calm"][estimator] for answer in self.answers if answer["about"]["vehicle"] == vehicle]

    def calm_measures(self, vehicle, estimator):
        drives, trusted = self.calm(vehicle, estimator), self.calm(vehicle, trusting(estimator))
        samples = sum(drive["samples"] for drive in drives)
        rejections = {}
        for sensor in drives[0]["sensors"]:
            verdicts = [drive["sensors"][sensor] for drive in drives]
            rejected = sum(each["rejected"] for each in verdicts)
            rejections[sensor] = rejected / max(1, rejected + sum(each["accepted"] for each in verdicts))
        def of_drive(drive):
            return [drive["position"], drive["heading"], *drive["parameters"]]
        sums = [[sum(column) for column in zip(*map(of_drive, each))] for each in (drives, trusted)]
        return {"samples": samples, "ok": sum(drive["ok"] for drive in drives) / samples,
                "inside": sum(drive["inside"] for drive in drives) / samples,
                "inside_heading": sum(drive["inside_heading"] for drive in drives) / samples,
                "rejections": rejections, "cost": [mine / theirs for mine, theirs in zip(*sums)],
                "wrong": sum(drive["not_finite"] + drive["not_bounded"] for drive in drives)}

    def wanted_calm(self, vehicle, estimator):
        calm = self.calm_measures(vehicle, estimator)
        return {f"ok >= {percent(CALM_OK)}": calm["ok"] >= CALM_OK,
                f"false rejections < {percent(FALSE_REJECTIONS)}": max(calm["rejections"].values()) < FALSE_REJECTIONS,
                f"accuracy lost <= {percent(ACCURACY - 1, 0)}": max(calm["cost"]) <= ACCURACY,
                "finite, in bounds": calm["wrong"] == 0}

    def calm_table(self):
        lines = ["| vehicle, estimator | samples | ok | inside 3 sigma: position, heading | most false rejections of a sensor"
                 " | error relative to trusting all: position, heading, largest of slip | not reached |", "|" + "---|" * 7]
        for vehicle in self.vehicles:
            for estimator in self.estimators:
                calm = self.calm_measures(vehicle, estimator)
                sensor = max(calm["rejections"], key=calm["rejections"].get)
                missed = [text for text, reached in self.wanted_calm(vehicle, estimator).items() if not reached]
                lines.append("| " + " | ".join([
                    f"{vehicle}, {estimator}", str(calm["samples"]), percent(calm["ok"], 2),
                    f"{percent(calm['inside'])}, {percent(calm['inside_heading'])}",
                    f"{percent(calm['rejections'][sensor], 2)} ({sensor})",
                    f"{calm['cost'][0]:.3f}, {calm['cost'][1]:.3f}, {max(calm['cost'][2:]):.3f}", "; ".join(missed)]) + " |")
        return "\n".join(lines)

    # ---- all of it

    def surprises(self):
        """What is not reached, and not known to be so."""
        known = {line for lines in self.data.get("known", {}).values() for line in lines}
        return [line for line in self.missed() if line not in known]

    def missed(self):
        lines = [f"{kind}: not reached: {text}" for kind in self.kinds for text, reached in self.wanted(kind).items() if not reached]
        lines += [f"{vehicle}, {estimator}, no fault: not reached: {text}" for vehicle in self.vehicles for estimator in self.estimators
                  for text, reached in self.wanted_calm(vehicle, estimator).items() if not reached]
        return lines

    def text(self):
        drives = len(self.answers)
        return {"size": f"{self.steps:,} estimates, of {drives} drives with {len(self.kinds)} kinds of faults each.",
                "kinds": self.kinds_table(), "calm": self.calm_table(), "vehicles": self.vehicles_table()}

    def curve(self, kind, estimator):
        """[samples after the end, median, 99 %] of the errors."""
        found = {}
        for ride in self.rides(kind, estimator=estimator).rides:
            for after, error in zip(self.after, ride["errors"]):
                found.setdefault(after, []).append(error)
        return [[after, quantile(errors, 0.5), quantile(errors, 0.99)] for after, errors in found.items()]

    def measures(self, kind, estimator):
        """What the page of `rhec report` tells of an estimator and a kind of fault; None: never."""
        rides = self.rides(kind, estimator=estimator)
        def spread(samples):
            found = [quantile(samples, share) for share in (0.5, 0.99)]
            return dict(zip(("median", "p99"), (None if value == NEVER else value for value in found)))
        def known(value):
            return None if math.isnan(value) else value
        return {"rides": len(rides.rides), "recovered": spread(rides.recovered), "ok_again": spread(rides.ok_again),
                "never": sum(each == NEVER for each in rides.recovered), "unsaid": rides.unsaid(), "followed": rides.followed(),
                "honest": rides.share("honest", "counted"), "honest_heading": rides.share("honest_heading", "counted"),
                "longest_dishonest": max(ride["longest_dishonest"] for ride in rides.rides),
                "volume": quantile([ride["volume"] for ride in rides.rides], 0.5), "wide": known(rides.share("wide", "ok")),
                "curve": self.curve(kind, estimator)}

    def document(self):
        """What `rhec report` makes a page of."""
        figures = sum(len(self.wanted(kind)) for kind in self.kinds) + sum(
            len(self.wanted_calm(vehicle, estimator)) for vehicle in self.vehicles for estimator in self.estimators)
        return {"form": "rhec faults", "version": 2, "steps": self.steps, "drives": len(self.answers), "window": self.data["window"],
                "samples": self.after, "vehicles": self.vehicles, "estimators": self.estimators, "wanted": {"honest": HONEST},
                "figures": figures, "missed": self.missed(),
                "kinds": [{"name": kind, "group": self.group(kind),
                           "estimators": {name: self.measures(kind, name) for name in self.estimators}} for kind in self.kinds]}


def write(page, text, program="scripts/fault-campaign"):
    """Replaces what stands between the marks of each part that a program writes."""
    content = page.read_text()
    for part, table in text.items():
        begin, end = f"<!-- {program}: {part} -->", "<!-- end -->"
        head, rest = content.split(begin, 1)
        content = f"{head}{begin}\n\n{table}\n\n{end}{rest.split(end, 1)[1]}"
    draft = page.with_suffix(".md.new")
    draft.write_text(content)
    draft.replace(page)
