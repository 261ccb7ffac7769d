"""A node that estimates slip and steers, and with simulate:=true a simulated robot for its other end.

    ros2 launch rhec_ros rhec.launch.py file:=/path/to/robot.yaml interface:=eth0
"""
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node


def generate_launch_description():
    file, interface = LaunchConfiguration("file"), LaunchConfiguration("interface")
    time = ["-p", ["use_sim_time:=", LaunchConfiguration("use_sim_time")]]
    return LaunchDescription([
        DeclareLaunchArgument("file", description="what the robot is: docs/live.md"),
        DeclareLaunchArgument("interface", default_value="lo", description="the network interface that is heard, and no other"),
        DeclareLaunchArgument("use_sim_time", default_value="false", description="the time is that of /clock"),
        DeclareLaunchArgument("simulate", default_value="false", description="start a simulated robot, too"),
        Node(package="rhec_ros", executable="node", output="screen", arguments=[file, "--interface", interface], ros_arguments=time,
             # What has not come to rest in time is stopped by the base.
             sigterm_timeout="10"),
        Node(package="rhec_ros", executable="node", output="screen", arguments=[file, "--interface", interface, "--simulate"],
             condition=IfCondition(LaunchConfiguration("simulate"))),
    ])
