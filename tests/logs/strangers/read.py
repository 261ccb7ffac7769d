"""Reads what rhec has written: read.py <estimates.mcap> <measurements.mcap> <steps.csv>"""
import csv
import sys

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory


def decoded(path):
    with open(path, "rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        found = {}
        for _, channel, message, content in reader.iter_decoded_messages():
            found.setdefault(channel.topic, []).append((message.log_time, content))
        assert summary.statistics.message_count == sum(map(len, found.values()))
        return found


def main():
    with open(sys.argv[3], newline="") as stream:
        steps = list(csv.DictReader(stream))
    found = decoded(sys.argv[1])
    assert len(found["/rhec/odometry"]) == len(steps), (len(found["/rhec/odometry"]), len(steps))
    for step, (time, odometry), (_, slip), (_, plan), (_, diagnostics) in zip(
            steps, found["/rhec/odometry"], found["/rhec/slip"], found["/rhec/plan"], found["/diagnostics"]):
        assert abs(time - 1e9 * float(step["time"])) < 1000
        assert abs(odometry.pose.pose.position.x - float(step["x_pos"])) < 1e-8
        assert abs(odometry.pose.covariance[0] ** 0.5 - float(step["sigma_x_pos"])) < 1e-8
        values = dict(zip(slip.name, slip.position))
        assert abs(values["kappa"] - float(step["kappa"])) < 1e-8
        assert len(plan.poses) == 16 and abs(plan.poses[0].pose.position.y - float(step["y_pos"])) < 1e-6
        assert diagnostics.status[0].message in ("ok", step["findings"])
    assert found["/tf"][0][1].transforms[0].child_frame_id == "base_link"
    assert len(found["/rhec/path"][0][1].poses) > 100
    measured = decoded(sys.argv[2])
    names = [content.name for _, content in measured["/rhec/measured"]]
    assert names[0] == ["x_gps", "y_gps", "delta"], names[0]
    print(f"mcap and mcap-ros2-support read {sum(map(len, found.values()))} messages of {len(found)} topics")


main()
