"""The node as a package of a ROS workspace: `colcon build --base-paths .../ros_node`."""

from pathlib import Path
from xml.etree import ElementTree as ET

from setuptools import setup

NAME = "wheelwire_ros"
HERE = Path(__file__).parent
SHARE = Path("share") / NAME
SHARED_FOLDERS = ("launch", "config", "urdf", "udev", "systemd", "security")

version = ET.parse(HERE / "package.xml").findtext("version")  # noqa: S314 - it is our own
shared = [
    (
        str(SHARE / folder),
        [str(p.relative_to(HERE)) for p in (HERE / folder).iterdir() if p.is_file()],
    )
    for folder in SHARED_FOLDERS
]

setup(
    name=NAME,
    version=version,
    description="A ROS 2 node that drives a wheeled robot through Wheelwire",
    license="Apache-2.0",
    packages=[NAME],
    install_requires=[f"wheelwire=={version}"],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (str(SHARE), ["package.xml"]),
        *shared,
    ],
    entry_points={"console_scripts": ["hardware_robot = wheelwire_ros.__main__:main"]},
    zip_safe=True,
)
