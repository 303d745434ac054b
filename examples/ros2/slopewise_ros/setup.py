"""Installed by colcon."""

from glob import glob

from setuptools import setup

NAME = "slopewise_ros"

setup(
    name=NAME,
    version="0.1.0",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", glob("launch/*.launch.py")),
        (f"share/{NAME}/config", glob("config/*.yaml")),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="Name of the maintainer of your robot",
    maintainer_email="maintainer@example.com",
    description="Runs the ROS 2 edge of slopewise as a lifecycle node.",
    license="Apache-2.0",
    entry_points={"console_scripts": [f"edge = {NAME}.edge_node:main"]},
)
